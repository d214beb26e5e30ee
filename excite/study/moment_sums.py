"""Second moments of the rows of each equation, summed over blocks of rows that are never held together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from excite.identification.streamed_rows import Decimation
from regressors.models.model import RegressorModel
from regressors.samples import Array, Index, Samples


@dataclass(frozen=True, eq=False)
class MomentSums:
    """How rows become moments of ``[W P, e]``, or of ``[Z P, W P, e]`` with instruments Z; ``e = y - W beta``."""

    used: list[Index]  # base parameters of each equation's columns
    beta: Array  # (b,) True parameters
    change: Array | None = None  # (b, b) matrix P by which columns are multiplied; none if not given
    instruments: list[Array] | None = None  # (p_j, m) transposed columns of Z

    @property
    def front(self) -> int:
        """Columns of the instruments."""
        return 0 if self.instruments is None else self.beta.size

    @property
    def size(self) -> int:
        """Columns whose moments are summed, with e."""
        return self.front + self.beta.size + 1

    def of(self, parts: Iterable[Part], y: Array) -> Array:
        """Moments of all rows, shape (r, k, k)."""  # y (m, r)
        b = self.beta.size
        G = np.zeros((len(self.used), self.size, self.size))
        sums = [np.zeros((used.size + 1, used.size + 1)) for used in self._places]
        crossed = [np.zeros((used.size, used.size + 1)) for used in self._places]
        for rows, X in parts:
            for j, x in enumerate(X):
                A, e = self._mixed(x, self.used[j]), y[rows, j] - self.beta[self.used[j]] @ x
                _add(sums[j], A, e)
                if self.instruments is not None:
                    Z = self._instruments[j][:, rows]
                    crossed[j][:, :-1] += Z @ A.T
                    crossed[j][:, -1] += Z @ e
        for j, place in enumerate(self._places):
            last = self.front + np.append(place, b)
            G[j][np.ix_(last, last)] = sums[j]
            if self.instruments is not None:
                G[j][np.ix_(place, last)] = crossed[j]
                G[j][np.ix_(last, place)] = crossed[j].T
                G[j][np.ix_(place, place)] = self._of_instruments[j]
        return G

    def shared(self, parts: Iterable[Part]) -> Array:
        """Moments of the columns alone, for `with_errors`, shape (r, k, k)."""
        held = list(parts)
        rows = held[-1][0].stop
        G = self.of(held, np.zeros((rows, len(self.used))))
        G[:, -1, :] = G[:, :, -1] = 0.0
        return G

    def with_errors(self, shared: Array, parts: Iterable[Part], e: Array) -> Array:
        """Moments of columns that are those of `shared`, with other errors, shape (r, k, k)."""
        # shared (r, k, k); e (m, r)
        G = shared.copy()
        for rows, X in parts:
            for j, x in enumerate(X):
                place, error = self._places[j], e[rows, j]
                c = self._mixed(x, self.used[j]) @ error
                if self.instruments is not None:
                    c = np.concatenate([self._instruments[j][:, rows] @ error, c])
                    place = np.concatenate([place, self.front + place])
                G[j][place, -1] += c
                G[j][-1, place] += c
                G[j][-1, -1] += error @ error
        return G

    @cached_property
    def _places(self) -> list[Index]:
        """Places of each equation's columns among all of them."""
        return self.used if self.change is None else [np.arange(self.beta.size)] * len(self.used)

    @cached_property
    def _instruments(self) -> list[Array]:
        """Transposed columns of ``Z P``."""
        assert self.instruments is not None
        return [self._mixed(z, used) for z, used in zip(self.instruments, self.used, strict=True)]

    @cached_property
    def _of_instruments(self) -> list[Array]:
        """Moments of the instruments, which are those of every repetition."""
        return [Z @ Z.T for Z in self._instruments]

    def _mixed(self, x: Array, used: Index) -> Array:
        return x if self.change is None else self.change[used].T @ x


def _add(sums: Array, A: Array, e: Array) -> None:
    """Add the moments of ``[A', e]``."""
    c = A @ e
    sums[:-1, :-1] += A @ A.T
    sums[:-1, -1] += c
    sums[-1, :-1] += c
    sums[-1, -1] += e @ e


BLOCK = 1024  # instants: what is computed for them stays in the cache of a core
Part = tuple[slice, Sequence[Array]]


class EquationColumns:
    """Base columns of each equation of a model."""  # index (b,)

    def __init__(self, model: RegressorModel, index: Index, decimation: Decimation | None = None) -> None:
        self.model, self.index, self.decimation = model, index, decimation
        self.direct = is_direct(model)
        self.used: list[Index] = [np.arange(index.size)] * len(model.row_labels)
        if self.direct:
            entries, self.used = _entries(model, index)
            self._ends = np.cumsum([0, *(k.size for k in entries)])
            self._function = model.function.selection(np.concatenate(entries))

    def parts(self, samples: Samples) -> Iterator[Part]:
        """Columns along a motion, in blocks of rows."""  # result (p_j, k)
        if not self.direct:
            W = self.model.assembled_entries(samples, self.index)
            yield slice(0, W.shape[2]), self._filtered(list(W))
            return
        count = samples.time.size
        block = BLOCK if self.decimation is None else count
        motion = [np.ascontiguousarray(x.T) for x in (samples.q, samples.dq, samples.ddq)]
        for first in range(0, count, block):
            rows = slice(first, min(first + block, count))
            values = self._function(*(x[:, rows] for x in motion))
            yield rows, self._filtered([values[i:k] for i, k in zip(self._ends, self._ends[1:], strict=False)])

    def _filtered(self, X: list[Array]) -> list[Array]:
        if self.decimation is None:
            return X
        return [np.ascontiguousarray(self.decimation(x.T).T) for x in X]


def is_direct(model: RegressorModel) -> bool:
    """Whether a model's rows are its expression at single instants."""
    own = type(model)
    return model.window is None and all(
        getattr(own, name) is getattr(RegressorModel, name) for name in ("assemble", "instants", "function")
    )


def entries_of_equations(model: RegressorModel, index: Index) -> list[int]:
    """Number of the columns of each equation, without those that are zero by its structure."""  # index (b,)
    if not is_direct(model):
        return [index.size] * len(model.row_labels)
    return [k.size for k in _entries(model, index)[0]]


def _entries(model: RegressorModel, index: Index) -> tuple[list[Index], list[Index]]:
    """Nonzeros of each equation in the model's function, and the base parameters that they belong to."""
    place = np.full(len(model.columns), -1)
    place[index] = np.arange(index.size)
    row, column = np.asarray(model.function.row), place[np.asarray(model.function.column)]
    entries = [np.flatnonzero((row == j) & (column >= 0)) for j in range(len(model.row_labels))]
    return entries, [column[k] for k in entries]
