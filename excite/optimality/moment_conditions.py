"""Conditions on means over time that every closed motion of a family fulfils, as linear functions of a measure.

Over a closed motion every total derivative has mean zero: ``E[d/dt g(y, dy)] = 0``. The second moments of a
trigonometric polynomial are those of its harmonics, ``E[u u'] = P_0 + sum_k G_k(P_k)`` with u = (1, y, dy, ddy) and
positive semidefinite P_k: 2 n x 2 n, of the cosines and sines of harmonic k.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.optimality.limited_states import LimitedStates
from regressors.samples import Array, Index

_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class MomentConditions:
    """``E[h(s)] = B p``, p the triangles of positive semidefinite matrices."""

    states: LimitedStates
    counted: NDArray[np.bool_]  # (k,) coordinates whose bounded positions are used
    # (K,) angular frequencies of the motions' harmonics [rad/s]; none for motions without a spectrum
    frequencies: Array

    @property
    def _scales(self) -> Array:
        """Of u, shape (1 + counted + 2 k,)."""
        extents = [self.states.extent(order) for order in range(3)]
        return np.concatenate([[1.0], extents[0][self.counted], extents[1], extents[2]])

    @property
    def sizes(self) -> tuple[int, ...]:
        """Sizes of the positive semidefinite matrices."""
        if not self.frequencies.size:
            return ()
        return (1 + int(self.counted.sum()), *(2 * self.states.n for _ in self.frequencies))

    def values(self, S: Array) -> Array:
        """``h`` at every state, shape (N, m)."""
        u = self._u(S)
        products = self._products if self.frequencies.size else self._derivatives_of_products
        return np.concatenate([products(u), self._derivatives_of_speeds(S)], axis=1)

    def _u(self, S: Array) -> Array:
        y, dy, ddy = np.split(S, 3, axis=1)
        y = (y - self.states.centre)[:, self.counted]
        return np.concatenate([np.ones((len(S), 1)), y, dy, ddy], axis=1) / self._scales

    def _products(self, u: Array) -> Array:
        """The second moments, shape (N, m)."""
        return triangle(np.einsum("ni,nj->nij", u, u))

    def _derivatives_of_products(self, u: Array) -> Array:
        """``d/dt (a b)`` of all a, b among 1, y and dy, in scaled units, shape (N, m)."""
        p, k, scales = int(self.counted.sum()), self.states.n, self._scales
        velocity = 1 + p + np.arange(k)
        after = np.concatenate([velocity[self.counted], velocity + k])  # of y and dy
        before = np.arange(1, 1 + p + k)
        rate = np.zeros_like(u[:, : 1 + p + k])
        rate[:, before] = u[:, after] * scales[after] / scales[before]
        kept = u[:, : 1 + p + k]
        rows, columns = np.tril_indices(1 + p + k)
        of_products = rate[:, rows] * kept[:, columns] + kept[:, rows] * rate[:, columns]
        others = np.flatnonzero(~self.counted)  # d/dt y of those whose position does not count
        return np.concatenate([of_products[:, 1:], u[:, velocity[others]]], axis=1)

    def _derivatives_of_speeds(self, S: Array) -> Array:
        """``d/dt`` of ``|dz|``, ``|dz| dz`` and ``|dz| (z - middle)`` of every limited function z, shape (N, m)."""
        states = self.states
        y, dy, ddy = np.split(S, 3, axis=1)
        columns = []
        for index in np.flatnonzero(states.speeds & np.isfinite(states.acceleration)):
            row, middle, R = states.directions[index], states.middle[index], states.radius[index]
            V, A = states.velocity[index], states.acceleration[index]
            v, a = dy @ row, ddy @ row
            columns += [np.sign(v) * a / A, np.abs(v) * a / (A * V)]
            if np.isfinite(R) and np.all(self.counted[np.abs(row) > 0]):
                z = y @ row - middle
                columns.append((np.sign(v) * a * z + np.abs(v) * v) / (A * R + V**2))
        return np.stack(columns, axis=1) if columns else np.zeros((len(S), 0))

    def cone(self) -> Array:
        """``B``, shape (m, p); its rows for conditions without P are zero."""
        if not self.frequencies.size:
            return np.zeros((0, 0))
        n, p = self.states.n, int(self.counted.sum())
        u = 1 + p + 2 * n
        blocks = [triangle(_embedded(triangle_basis(1 + p), u) / np.outer(self._scales, self._scales))]
        basis = triangle_basis(2 * n)
        for w in self.frequencies:
            cosine, sine = self._harmonic(float(w))
            G = 0.5 * (cosine @ basis @ cosine.T + sine @ basis @ sine.T)
            blocks.append(triangle(G))
        return np.concatenate(blocks, axis=0).T

    def _harmonic(self, w: float) -> tuple[Array, Array]:
        """Factors of cos(w t) and sin(w t) in u for ``y = a cos(w t) + b sin(w t)``, by (a, b), shape (u, 2 n) each."""
        n = self.states.n
        a, b = np.eye(n, 2 * n), np.eye(n, 2 * n, n)
        rows = [(a[self.counted], b[self.counted]), (w * b, -w * a), (-(w**2) * a, -(w**2) * b)]
        scales = self._scales[1:, None] * w  # P in units of velocity
        cosine, sine = (np.concatenate([row[i] for row in rows]) / scales for i in range(2))
        zero = np.zeros((1, 2 * n))
        return np.concatenate([zero, cosine]), np.concatenate([zero, sine])

    def admitted(self, c: Array) -> Array:
        """Multipliers with ``E[c' h] >= 0`` for every motion, from those of a solver, which are so to a tolerance.

        ``B' c`` must be positive semidefinite, matrix by matrix. What is missing comes from ``u' u``, whose mean is
        positive in every harmonic.
        """
        if not self.frequencies.size:
            return c
        B = self.cone()
        of_second = len(B)
        unit = triangle(np.eye(len(self._scales))[None])[0]
        missing = 0.0
        for adjoint, strictly in zip(self._parts(B.T @ c[:of_second]), self._parts(B.T @ unit), strict=True):
            lowest = float(np.linalg.eigvalsh(adjoint)[0]) - _ROUNDING * float(np.abs(adjoint).max())
            missing = max(missing, -lowest / float(np.linalg.eigvalsh(strictly)[0]))
        changed = c.copy()
        changed[:of_second] += missing * unit
        return changed

    def _parts(self, p: Array) -> list[Array]:
        ends = np.cumsum([size * (size + 1) // 2 for size in self.sizes])
        return [matrix_of(part, size) for part, size in zip(np.split(p, ends[:-1]), self.sizes, strict=True)]


def _embedded(matrices: Array, size: int) -> Array:
    placed = np.zeros((len(matrices), size, size))
    n = matrices.shape[1]
    placed[:, :n, :n] = matrices
    return placed


def _places(size: int) -> tuple[Index, Index]:
    column, row = np.tril_indices(size)
    return row, column


def triangle(M: Array) -> Array:
    """Vectors of symmetric matrices, shape (..., n, n) to (..., n (n + 1) / 2); off-diagonal entries times sqrt 2."""
    row, column = _places(M.shape[-1])
    return np.asarray(M[..., row, column] * np.where(row == column, 1.0, np.sqrt(2.0)))


def matrix_of(v: Array, size: int) -> Array:
    """Symmetric matrix of a vector, the inverse of `triangle`, shape (size, size)."""
    row, column = _places(size)
    M = np.zeros((size, size))
    M[row, column] = M[column, row] = v / np.where(row == column, 1.0, np.sqrt(2.0))
    return M


def triangle_basis(size: int) -> Array:
    """Symmetric matrices whose vectors are unit vectors, shape (n (n + 1) / 2, size, size)."""
    return np.stack([matrix_of(e, size) for e in np.eye(size * (size + 1) // 2)])
