"""The smallest factor for which a polynomial inequality in velocities and accelerations has a certificate.

``m' (factor D - Q) m = m' S m + sum of multipliers times products of bounds`` with positive semidefinite S and
multipliers: the right side is nonnegative wherever the bounds hold [Putinar 1993; Parrilo 2003].
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import clarabel
import numpy as np
import scipy.sparse as sp

from excite.optimality.triangles import matrix_of, triangle, triangle_basis
from regressors.samples import Array

Polynomial = dict[tuple[int, ...], float]  # sorted indices of the variables (v, a) of each monomial
_MARGIN = 1e-6  # of the largest number of Q and D, which takes up what the solver leaves


def _product(a: Polynomial, b: Polynomial) -> Polynomial:
    result: Polynomial = {}
    for x, p in a.items():
        for y, q in b.items():
            key = tuple(sorted(x + y))
            result[key] = result.get(key, 0.0) + p * q
    return result


def _names(k: int) -> list[tuple[int, ...]]:
    """Monomials m, as indices of (v, a)."""
    rows, columns = np.tril_indices(k)
    squares = [tuple(sorted((int(i), int(j)))) for i, j in zip(rows, columns, strict=True)]
    return [(), *((i,) for i in range(2 * k)), *squares]


class SumOfSquares:
    """Certificates for scaled v and a of k functions, for given signs: ``0 <= signs v <= 1`` and ``|a| <= 1``."""

    def __init__(self, signs: Array, linked: Array) -> None:
        k = signs.size
        self._k, self._names = k, _names(k)
        self._linked = np.flatnonzero(np.isfinite(linked))
        self._factors = linked[self._linked]
        self._sizes = [len(self._names), *(1 + k for _ in range(k))]
        gram = _gram(self._names, len(self._names), {(): 1.0})
        columns = [*gram]
        for i in range(k):
            columns += _gram(self._names, 1 + k, {(): 1.0, (i, i): -1.0})
        self._free = len(columns)
        columns += _bounds(signs)
        self._places: dict[tuple[int, ...], int] = {}
        for column in columns:
            for key in column:
                self._places.setdefault(key, len(self._places))
        self._columns = np.stack([_column(each, self._places) for each in columns], axis=1)
        self._of_m = self._columns[:, : len(gram)]

    def _links(self, highest: Array) -> Array:
        """Columns of the links, for velocities in units of the highest ones."""
        k = self._k
        links = [
            {(): float(factor), (i, i): -float(factor * highest[i] ** 2), (k + i, k + i): -1.0}
            for i, factor in zip(self._linked.tolist(), self._factors, strict=True)
        ]
        return np.array([_column(each, self._places) for each in links]).reshape(-1, len(self._places)).T

    def _scales(self, highest: Array) -> Array:
        return np.array([np.prod([highest[i] for i in name if i < self._k]) for name in self._names])

    def factor(self, Q: Array, D: Array, highest: Array) -> float:
        """Smallest factor with a certificate of ``m' Q m <= factor m' D m``; infinite where none was found."""
        # Q, D (|m|, |m|); highest (k,)
        scales = self._scales(highest)
        of_Q, of_D = (self._of_m @ triangle(M * np.outer(scales, scales)) for M in (Q, D))
        A = np.concatenate([self._columns, self._links(highest)], axis=1)
        margin = np.zeros(len(A))
        margin[self._places[()]] = _MARGIN * max(np.abs(of_Q).max(), np.abs(of_D).max())
        x = self._solved(A, of_Q + margin, of_D)
        lacking = self._lacking(x, A, of_Q + margin, of_D)
        return float(x[0]) if lacking <= margin.max() else np.inf

    def _solved(self, A: Array, of_Q: Array, of_D: Array) -> Array:
        """``A x = factor of_D - of_Q`` with the least factor; the factor, then x."""
        count = A.shape[1]
        equations = sp.hstack([sp.csc_matrix(-of_D[:, None]), sp.csc_matrix(A)])
        signs = sp.hstack([sp.csc_matrix((count, 1)), -sp.eye_array(count)])
        cones = [clarabel.ZeroConeT(len(A)), *(clarabel.PSDTriangleConeT(size) for size in self._sizes)]
        cones.append(clarabel.NonnegativeConeT(count - self._free))
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads = False, 1
        solver = clarabel.DefaultSolver(
            sp.csc_matrix((1 + count, 1 + count)),
            np.eye(1 + count)[0],
            sp.csc_matrix(sp.vstack([equations, signs])),
            np.concatenate([-of_Q, np.zeros(count)]),
            cones,
            settings,
        )
        return np.array(solver.solve().x)

    def _lacking(self, x: Array, A: Array, of_Q: Array, of_D: Array) -> float:
        """By how much a solution may fall short of a certificate: scaled variables, and monomials, are at most 1."""
        if not np.all(np.isfinite(x)):
            return np.inf
        short = float(np.abs(A @ x[1:] - x[0] * of_D + of_Q).sum())
        first = 1
        for size in self._sizes:
            count = size * (size + 1) // 2
            lowest = float(np.linalg.eigvalsh(matrix_of(x[first : first + count], size))[0])
            short += size * max(0.0, -lowest)
            first += count
        largest = np.abs(A[:, self._free :]).sum(axis=0)
        return short + float(largest @ np.maximum(-x[1 + self._free :], 0.0))


def _bounds(signs: Array) -> list[Polynomial]:
    """Linear bounds on v and a, and the products of all pairs of them."""
    linear: list[Polynomial] = []
    for i, sign in enumerate(signs.tolist()):
        a = signs.size + i
        linear += [{(i,): sign}, {(): 1.0, (i,): -sign}, {(): 1.0, (a,): 1.0}, {(): 1.0, (a,): -1.0}]
    return [*linear, *(_product(a, b) for a, b in combinations_with_replacement(linear, 2))]


def _column(polynomial: Polynomial, places: dict[tuple[int, ...], int]) -> Array:
    column = np.zeros(len(places))
    for key, value in polynomial.items():
        column[places[key]] += value
    return column


def _gram(names: list[tuple[int, ...]], size: int, factor: Polynomial) -> list[Polynomial]:
    """Polynomials ``m' E m`` times a factor, of the basis matrices E of the first monomials."""
    polynomials = []
    for E in triangle_basis(size):
        total: Polynomial = {}
        for i, j in zip(*np.nonzero(E), strict=True):
            for key, value in _product({tuple(sorted(names[i] + names[j])): float(E[i, j])}, factor).items():
                total[key] = total.get(key, 0.0) + value
        polynomials.append(total)
    return polynomials
