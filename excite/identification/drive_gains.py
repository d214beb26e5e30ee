"""Corrections of drive gains from a load of known mass, and their uncertainty.

The torque that is "measured" is current times a stated gain. Where the stated gain of equation j is to be multiplied by
``g_j``, what was measured is ``y_j = (W_j beta + K_j phi) / g_j + e_j``. Without a load every scale of (g, beta, phi)
explains the same measurements; the known mass fixes the scale.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from excite.identification.observations import Observations
from excite.identification.preparation import drives_of_torques
from regressors.errors import InputError
from regressors.models.base import triangular_factor
from regressors.robot.robot import Robot
from regressors.samples import Array, Index

_ROUNDS = 30


def drive_gains(observations: Observations, load: Array, mass: float, *, common: bool) -> tuple[Array, Array, float]:
    """Drive gains that make the identified mass of a load the known one.

    Least squares of ``y_j - h_j (W_j beta + K_j phi)`` over ``h = 1 / g``, beta and the rest of phi, each equation
    weighted by its residual; by the Gauss-Newton method on the equations' triangular factors. Factors on the stated
    gains, their standard deviations, shape (r,), and the mass of the load with the gains as stated [kg].
    """  # load (m, 10)
    if not (np.isfinite(mass) and mass > 0):
        raise InputError(f"mass of the load must be a positive number of kilograms, given {mass}")
    if not np.any(load):
        raise InputError("no row is of a motion with the load")
    p = observations.W.shape[1]
    r = len(observations.equations)
    every = _Rows(np.hstack([observations.matrix, load]), observations.y, observations.equation)
    rows = _condensed(every, r)
    counts = np.bincount(observations.equation, minlength=r)
    h, x, weight = np.ones(r), np.zeros(p + 10), np.ones(r)
    for _ in range(4):
        A, y = (weight * h)[rows.equation, None] * rows.A, weight[rows.equation] * rows.y
        x = np.asarray(np.linalg.lstsq(A, y, rcond=None)[0])
        weight = rows.weights(h, x, counts)
    stated_mass = float(x[p])
    h, x = h * stated_mass / mass, x * mass / stated_mass
    for _ in range(_ROUNDS):
        step = _step(rows, h, x, weight, p, common)
        h, x = h + step[: h.size], x + step[h.size :]
        weight = rows.weights(h, x, counts)
        if np.all(np.abs(step[: h.size]) < 1e-10 * np.abs(h)):
            break
    factor = 1.0 / h
    return factor, _block_deviation(every, factor, x, p, _blocks(observations), common), stated_mass


@dataclass(frozen=True, eq=False)
class _Rows:
    """Equations ``y = h_j A x``, or as few as have the same sums of squares."""

    A: Array  # (m, p + 10)
    y: Array  # (m,)
    equation: Index  # (m,)

    def errors(self, h: Array, x: Array) -> Array:
        """What they leave, shape (m,)."""
        return np.asarray(self.y - h[self.equation] * (self.A @ x))

    def weights(self, h: Array, x: Array, counts: Index) -> Array:
        """Inverse of the root mean square of what each equation leaves, shape (r,)."""
        return np.asarray(np.sqrt(counts / np.bincount(self.equation, self.errors(h, x) ** 2, minlength=h.size)))

    def jacobian(self, h: Array, x: Array, common: bool) -> Array:
        """Derivative of ``h_j A x`` by h, or by the common one, and by x."""
        of_gains = np.zeros((self.y.size, 1 if common else h.size))
        of_gains[np.arange(self.y.size), 0 if common else self.equation] = self.A @ x
        return np.hstack([of_gains, h[self.equation, None] * self.A])


def _condensed(rows: _Rows, count: int) -> _Rows:
    """Triangular factors of each equation's rows."""
    both = np.column_stack([rows.A, rows.y])
    factors = [triangular_factor(both[rows.equation == j]) for j in range(count)]
    stacked = np.concatenate(factors)
    return _Rows(stacked[:, :-1], stacked[:, -1], np.repeat(np.arange(count), [len(R) for R in factors]))


def _step(rows: _Rows, h: Array, x: Array, weight: Array, p: int, common: bool) -> Array:
    """Gauss-Newton step of (h, x) with the mass held."""
    of_rows, count = weight[rows.equation], 1 if common else h.size
    free = np.delete(np.arange(count + x.size), count + p)
    A = (of_rows[:, None] * rows.jacobian(h, x, common))[:, free]
    scale = np.linalg.norm(A, axis=0)
    sigma = np.linalg.svd(A / np.where(scale > 0, scale, 1.0), compute_uv=False)
    if sigma[-1] < 1e-9 * sigma[0]:
        raise InputError("the drive gains are not identifiable from the motion: the load must act on every joint")
    step = np.zeros(count + x.size)
    step[free] = np.linalg.lstsq(A / scale, of_rows * rows.errors(h, x), rcond=None)[0] / scale
    return np.concatenate([np.broadcast_to(step[:count], h.shape), step[count:]])


@dataclass(frozen=True, eq=False)
class GainCalibration:
    """Factors on the stated drive gains, with which the identified mass of a load is the known one."""

    listed: ClassVar[bool] = True

    kind: str  # one factor for each drive, or one for all
    drives: tuple[str, ...]
    factor: Array  # (k,) factors on the measured torques of the drives, and their standard deviations
    deviation: Array  # (k,)
    half_width: Array  # (k,) half of the 99 % interval
    known_mass: float  # mass of the load, and the one that is identified with the gains as stated [kg]
    stated_mass: float
    logs: tuple[Mapping[str, str], ...]  # with the load: file and hash

    @property
    def factors(self) -> dict[str, float]:
        """Factor of each drive, by name."""
        return dict(zip(self.drives, self.factor.tolist(), strict=True))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the calibration found, in words."""
        mass = f"the load weighs {self.known_mass:.4g} kg; with the stated gains it would be {self.stated_mass:.4g} kg"
        rows = zip(self.drives, self.factor, self.half_width, strict=True)
        off = [f"{name} by {factor:.3f} +- {half:.2g}" for name, factor, half in rows if abs(factor - 1) > half]
        if not off:
            return (mass, "the drive gains agree with the stated ones within their 99 % intervals")
        each = f"all by {self.factor[0]:.3f} +- {self.half_width[0]:.2g}" if self.kind == "common" else ", ".join(off)
        return (mass, f"the stated drive gains are off; measured torques are multiplied, {each}")

    def content(self) -> dict[str, Any]:
        """Plain values for ``result.json``."""
        rows = zip(self.drives, self.factor, self.deviation, self.half_width, strict=True)
        return {
            "kind": self.kind,
            "known_mass": self.known_mass,
            "stated_mass": self.stated_mass,
            "drives": {
                name: {
                    "factor": float(factor),
                    "standard_deviation": float(deviation),
                    "interval": [float(factor - half), float(factor + half)],
                }
                for name, factor, deviation, half in rows
            },
            "logs": list(map(dict, self.logs)),
        }


BLOCKS = 40  # of all logs together; long against the correlation of residuals, short against the motion


def _block_deviation(every: _Rows, factor: Array, x: Array, p: int, blocks: list[Index], common: bool) -> Array:
    """Standard deviation of each factor, from estimates that leave out one block of time each.

    ``sum_b (B - 1)/B d_b d_b'`` with the step ``d_b = (A - A_b)^-1 s_b`` of the Gauss-Newton method without block b
    [Efron, Tibshirani 1993, ch. 11].
    """
    h, count = 1.0 / factor, 1 if common else factor.size
    weight = every.weights(h, x, np.bincount(every.equation, minlength=h.size)) ** 2
    free = np.delete(np.arange(count + x.size), count + p)  # all but the known mass
    normals, scores = [], []
    for index in blocks:
        rows = _Rows(every.A[index], every.y[index], every.equation[index])
        J, of_rows = rows.jacobian(h, x, common)[:, free], weight[rows.equation]
        normals.append(J.T @ (of_rows[:, None] * J))
        scores.append(J.T @ (of_rows * rows.errors(h, x)))
    total = np.sum(normals, axis=0)
    scale = np.sqrt(np.diag(total))
    steps = [
        np.linalg.solve((total - normal) / np.outer(scale, scale), score / scale) / scale
        for normal, score in zip(normals, scores, strict=True)
    ]
    variance = (1 - 1 / len(steps)) * np.sum(np.array(steps) ** 2, axis=0)
    return np.asarray(np.broadcast_to(np.sqrt(variance[:count]), h.shape) / h**2)


def _blocks(observations: Observations) -> list[Index]:
    """Rows of each block: every log is cut into blocks of equal length, in proportion to its rows."""
    share = np.bincount(observations.log) / observations.log.size
    blocks = []
    for log, part in enumerate(share):
        rows = np.flatnonzero(observations.log == log)
        blocks += np.array_split(rows, max(2, round(BLOCKS * float(part))))
    return blocks


def corrections(robot: Robot, torque: Array, factors: Mapping[str, float], *, common: bool) -> Array:
    """Change of corrected joint torques with the factors, shape (k, N, n); k is 1 for a common factor."""
    # torque (N, n)
    if common:
        return np.asarray(torque / next(iter(factors.values())))[None]
    names, D = drives_of_torques(robot, each=True)
    at_drives = torque @ D.T
    parts = [np.outer(at_drives[:, k] / factors[name], np.linalg.inv(D)[:, k]) for k, name in enumerate(names)]
    return np.array(parts)
