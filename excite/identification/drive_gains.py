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


@dataclass(frozen=True, eq=False)
class DriveGains:
    """Factors by which stated drive gains are to be multiplied."""

    equations: tuple[str, ...]
    factor: Array  # (r,)
    deviation: Array  # (r,) standard deviation of each factor, for residuals that are independent from row to row
    load: Array  # (10,) parameters of the load with these factors, the first of them the known mass [kg, kg m, kg m^2]
    beta: Array  # (p,) parameters of the robot with these factors
    stated_mass: float  # of the load with the gains as stated [kg]


def drive_gains(observations: Observations, load: Array, mass: float, *, common: bool) -> DriveGains:
    """Drive gains that make the identified mass of a load the known one.

    Least squares of ``y_j - h_j (W_j beta + K_j phi)`` over ``h = 1 / g``, beta and the rest of phi, each equation
    weighted by its residual; by the Gauss-Newton method on the equations' triangular factors.
    """  # load (m, 10)
    if not (np.isfinite(mass) and mass > 0):
        raise InputError(f"mass of the load must be a positive number of kilograms, given {mass}")
    if not np.any(load):
        raise InputError("no row is of a motion with the load")
    p = observations.W.shape[1]
    equations = tuple(name for name, _ in observations.equations)
    rows = _condensed(_rows_of(observations, load), len(equations))
    counts = np.bincount(observations.equation, minlength=len(equations))
    h, x, weight = np.ones(len(equations)), np.zeros(p + 10), np.ones(len(equations))
    for _ in range(4):
        A, y = (weight * h)[rows.equation, None] * rows.A, weight[rows.equation] * rows.y
        x = np.asarray(np.linalg.lstsq(A, y, rcond=None)[0])
        weight = rows.weights(h, x, counts)
    stated_mass = float(x[p])
    h, x = h * stated_mass / mass, x * mass / stated_mass
    for _ in range(_ROUNDS):
        step, spread = _step(rows, h, x, weight, p, common)
        h, x = h + step[: h.size], x + step[h.size :]
        weight = rows.weights(h, x, counts)
        if np.all(np.abs(step[: h.size]) < 1e-10 * np.abs(h)):
            break
    return DriveGains(equations, 1.0 / h, spread / h**2, x[p:], x[:p], stated_mass)


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


def _rows_of(observations: Observations, load: Array) -> _Rows:
    return _Rows(np.hstack([observations.matrix, load]), observations.y, observations.equation)


def _condensed(rows: _Rows, count: int) -> _Rows:
    """Triangular factors of each equation's rows."""
    both = np.column_stack([rows.A, rows.y])
    factors = [triangular_factor(both[rows.equation == j]) for j in range(count)]
    stacked = np.concatenate(factors)
    return _Rows(stacked[:, :-1], stacked[:, -1], np.repeat(np.arange(count), [len(R) for R in factors]))


def _step(rows: _Rows, h: Array, x: Array, weight: Array, p: int, common: bool) -> tuple[Array, Array]:
    """Gauss-Newton step of (h, x) with the mass held, and the standard deviation of each h."""
    of_rows, count = weight[rows.equation], 1 if common else h.size
    free = np.delete(np.arange(count + x.size), count + p)
    A = (of_rows[:, None] * rows.jacobian(h, x, common))[:, free]
    scale = np.linalg.norm(A, axis=0)
    _, sigma, V = np.linalg.svd(A / np.where(scale > 0, scale, 1.0), full_matrices=False)
    if sigma[-1] < 1e-9 * sigma[0]:
        raise InputError("the drive gains are not identifiable from the motion: the load must act on every joint")
    inverse = (V.T / sigma) / scale[:, None]
    step, spread = np.zeros(count + x.size), np.zeros(count + x.size)
    step[free] = np.linalg.lstsq(A / scale, of_rows * rows.errors(h, x), rcond=None)[0] / scale
    spread[free] = np.linalg.norm(inverse, axis=1)
    each = np.zeros(h.size, dtype=np.intp) if common else np.arange(h.size)
    return np.concatenate([step[each], step[count:]]), spread[each]


@dataclass(frozen=True)
class LogFile:
    """A log, named by its file and the hash of its content."""

    file: str
    sha256: str


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
    logs: tuple[LogFile, ...]  # with the load

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
            "logs": [dict(vars(log)) for log in self.logs],
        }


BLOCKS = 40  # of all logs together; long against the correlation of residuals, short against the motion


def block_deviation(observations: Observations, load: Array, gains: DriveGains, *, common: bool) -> Array:
    """Standard deviation of each gain, from estimates that leave out one block of time each.

    ``sum_b (B - 1)/B d_b d_b'`` with the step ``d_b = (A - A_b)^-1 s_b`` of the Gauss-Newton method without block b
    [Efron, Tibshirani 1993, ch. 11].
    """  # load (m, 10)
    h, x, count = 1.0 / gains.factor, np.concatenate([gains.beta, gains.load]), 1 if common else gains.factor.size
    whole = _rows_of(observations, load)
    weight = whole.weights(h, x, np.bincount(whole.equation, minlength=h.size)) ** 2
    free = np.delete(np.arange(count + x.size), count + gains.beta.size)  # all but the known mass
    normals, scores = [], []
    for index in _blocks(observations):
        rows = _Rows(whole.A[index], whole.y[index], whole.equation[index])
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
