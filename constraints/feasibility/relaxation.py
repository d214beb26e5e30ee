"""Smallest relaxation of contradicting limits that makes a pose feasible (elastic solution)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Samples

_NOTHING = 1e-4  # of a limit's scale


@dataclass(frozen=True)
class Relaxation:
    """One bound, and the amount by which it must be relaxed."""

    label: str
    unit: str
    bound: float  # its present value
    amount: float  # > 0, outwards, in the same unit

    def __str__(self) -> str:
        return f"{self.label} beyond {self.bound:.4g} {self.unit} by {self.amount:.3g} {self.unit}"


def smallest_relaxation(
    nonlinear: Sequence[NonlinearConstraint],
    linear: Sequence[LinearConstraint],
    motion: PartialMotion,
    poses: Array,
    room: float,
) -> tuple[Array, tuple[Relaxation, ...]]:
    """Least sum of relaxations, each in its limit's scale, for which a pose at rest keeps all limits.

    ``min sum e`` over poses s and ``e >= 0`` with ``lower + (room - e) scale <= g(s) <= upper - (room - e) scale`` and
    the linear position limits as they are; by sequential quadratic programming from each of the given poses.
    """  # poses (m, k); result (k,)
    from scipy.optimize import minimize

    sides = _Sides(nonlinear, motion)
    k, m = poses.shape[1], sides.count
    rows, least, most = _positions(linear, k)
    constraints = [
        {
            "type": "ineq",
            "fun": lambda x: sides.room(x[:k]) + x[k:] - room,
            "jac": lambda x: np.hstack([sides.slopes(x[:k]), np.eye(m)]),
        },
        {
            "type": "ineq",
            "fun": lambda x: np.concatenate([most - rows @ x[:k], rows @ x[:k] - least]),
            "jac": lambda x: np.hstack([np.vstack([-rows, rows]), np.zeros((2 * len(rows), m))]),
        },
    ]
    gradient = np.concatenate([np.zeros(k), np.ones(m)])
    best, where = np.full(m, np.inf), poses[0]
    for pose in poses:
        start = np.concatenate([pose, np.maximum(room - sides.room(pose), 0.0)])
        minimum = minimize(
            lambda x: float(np.sum(x[k:])), start, jac=lambda x: gradient, method="SLSQP", constraints=constraints,
            bounds=[(None, None)] * k + [(0.0, None)] * m,
        )  # fmt: skip
        e = np.maximum(room - sides.room(minimum.x[:k]), 0.0)
        if e.sum() < best.sum():
            best, where = e, minimum.x[:k]
    return where, sides.relaxations(best)


class _Sides:
    """Distances to both sides of every limit, relative to their scales."""

    def __init__(self, nonlinear: Sequence[NonlinearConstraint], motion: PartialMotion) -> None:
        self._nonlinear, self._motion = nonlinear, motion
        self._sides = [
            (limit, j, sign)
            for limit in nonlinear
            for j in range(len(limit.labels))
            for sign, bound in ((1, limit.upper[j]), (-1, limit.lower[j]))
            if np.isfinite(bound)
        ]

    @property
    def count(self) -> int:
        """Number of finite bounds."""
        return len(self._sides)

    def _still(self, pose: Array) -> Samples:
        q = (self._motion.matrix @ pose + self._motion.offset)[None]
        zero = np.zeros_like(q)
        return Samples(np.zeros(1), q, zero, zero, zero)

    def room(self, pose: Array) -> Array:
        """Relative distance to every bound, shape (count,)."""
        values = {id(limit): limit.values(self._still(pose))[0] for limit in self._nonlinear}
        return np.array(
            [
                sign * ((limit.upper if sign > 0 else limit.lower)[j] - values[id(limit)][j]) / limit.scale[j]
                for limit, j, sign in self._sides
            ]
        )

    def slopes(self, pose: Array) -> Array:
        """Derivative of the distances, shape (count, k)."""
        n, N = self._motion.matrix.shape[0], self._motion.matrix
        slopes = {id(limit): limit.slopes(self._still(pose))[0][:, :n] @ N for limit in self._nonlinear}
        return np.array([-sign * slopes[id(limit)][j] / limit.scale[j] for limit, j, sign in self._sides])

    def relaxations(self, e: Array) -> tuple[Relaxation, ...]:
        """Relaxations in their own units, the largest relative to its scale first."""
        order = np.argsort(-e)
        needed = [(e[k], *self._sides[k]) for k in order if e[k] > _NOTHING]
        return tuple(
            Relaxation(
                limit.labels[j], limit.units[j], float((limit.upper if sign > 0 else limit.lower)[j]),
                float(part * limit.scale[j]),
            )
            for part, limit, j, sign in needed
        )  # fmt: skip


def _positions(linear: Sequence[LinearConstraint], k: int) -> tuple[Array, Array, Array]:
    """Position limits as rows with their bounds; unbounded coordinates get two turns either way."""
    limits = [limit for limit in linear if limit.derivative == 0]
    rows = np.concatenate([np.eye(k), *(limit.matrix for limit in limits)])
    least = np.concatenate([np.full(k, -4 * np.pi), *(limit.lower - limit.offset for limit in limits)])
    most = np.concatenate([np.full(k, 4 * np.pi), *(limit.upper - limit.offset for limit in limits)])
    return rows, least, most
