"""Second moments of the rows of each equation, summed over blocks of rows that are never held together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from excite.montecarlo.equation_columns import Part
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class MomentSums:
    """How rows become moments of ``[W P, e]``, or of ``[Z P, W P, e]`` with instruments Z; ``e = y - W beta``.

    Parameters
    ----------
    used : list of ndarray of int
        Base parameters of each equation's columns.
    beta : ndarray, shape (b,)
        True parameters.
    change : ndarray, shape (b, b), optional
        Matrix P by which columns are multiplied; none if not given.
    instruments : list of ndarray, shape (p_j, m) each, optional
        Transposed columns of Z.
    """

    used: list[Index]
    beta: Array
    change: Array | None = None
    instruments: list[Array] | None = None

    @property
    def front(self) -> int:
        """Columns of the instruments."""
        return 0 if self.instruments is None else self.beta.size

    @property
    def size(self) -> int:
        """Columns whose moments are summed, with e."""
        return self.front + self.beta.size + 1

    def of(self, parts: Iterable[Part], y: Array) -> Array:
        """Moments of all rows, shape (r, k, k).

        Parameters
        ----------
        parts : iterable
            Blocks of rows and the transposed columns of each equation.
        y : ndarray, shape (m, r)
        """
        places = [self._place(used) for used in self.used]
        sums = [np.zeros((place.size + 1, place.size + 1)) for place in places]
        for rows, X in parts:
            for j, x in enumerate(X):
                e = y[rows, j] - self.beta[self.used[j]] @ x
                _add(sums[j], self._columns(j, x, rows), e)
        return self._spread(sums, places)

    def shared(self, parts: Iterable[Part]) -> Array:
        """Moments of the columns alone, for `with_errors`, shape (r, k, k)."""
        places = [self._place(used) for used in self.used]
        sums = [np.zeros((place.size + 1, place.size + 1)) for place in places]
        for rows, X in parts:
            for j, x in enumerate(X):
                A = self._columns(j, x, rows)
                sums[j][:-1, :-1] += A @ A.T
        return self._spread(sums, places)

    def with_errors(self, shared: Array, parts: Iterable[Part], e: Array) -> Array:
        """Moments of columns that are those of `shared`, with other errors, shape (r, k, k).

        Parameters
        ----------
        shared : ndarray, shape (r, k, k)
        parts : iterable
        e : ndarray, shape (m, r)
        """
        G = shared.copy()
        for rows, X in parts:
            for j, x in enumerate(X):
                place, error = self._place(self.used[j]), e[rows, j]
                c = self._columns(j, x, rows) @ error
                G[j][place, -1] += c
                G[j][-1, place] += c
                G[j][-1, -1] += error @ error
        return G

    def _place(self, used: Index) -> Index:
        """Places of an equation's columns among all of them."""
        place = used if self.change is None else np.arange(self.beta.size)
        return place if self.instruments is None else np.concatenate([place, self.front + place])

    def _columns(self, j: int, x: Array, rows: slice) -> Array:
        A = self._mixed(x, self.used[j])
        if self.instruments is None:
            return A
        return np.concatenate([self._mixed(self.instruments[j][:, rows], self.used[j]), A])

    def _mixed(self, x: Array, used: Index) -> Array:
        return x if self.change is None else self.change[used].T @ x

    def _spread(self, sums: list[Array], places: list[Index]) -> Array:
        G = np.zeros((len(sums), self.size, self.size))
        for j, place in enumerate(places):
            whole = np.append(place, self.size - 1)
            G[j][np.ix_(whole, whole)] = sums[j]
        return G


def _add(sums: Array, A: Array, e: Array) -> None:
    """Add the moments of ``[A', e]``."""
    c = A @ e
    sums[:-1, :-1] += A @ A.T
    sums[:-1, -1] += c
    sums[-1, :-1] += c
    sums[-1, -1] += e @ e
