"""Corrections of drive gains from a load of known mass.

The torque that is "measured" is current times a stated gain. Where the stated gain of equation j is to be multiplied by
``g_j``, what was measured is ``y_j = (W_j beta + K_j phi) / g_j + e_j``. Without a load every scale of (g, beta, phi)
explains the same measurements; the known mass fixes the scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from excite.identification.observations import Observations
from regressors.errors import InputError
from regressors.models.base import triangular_factor
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
    factors = [_factor(observations, load, j) for j in range(len(equations))]
    counts = np.bincount(observations.equation, minlength=len(equations))
    h, x = np.ones(len(equations)), np.zeros(p + 10)
    weight = np.ones(len(equations))
    for _ in range(4):
        x = _linear(factors, h, weight)
        weight = _weights(factors, counts, h, x)
    h, x = h * x[p] / mass, x * mass / x[p]  # the mass as identified with the stated gains
    for _ in range(_ROUNDS):
        step, spread = _step(factors, h, x, weight, p, common)
        h, x = h + step[: h.size], x + step[h.size :]
        weight = _weights(factors, counts, h, x)
        if np.all(np.abs(step[: h.size]) < 1e-10 * np.abs(h)):
            break
    return DriveGains(equations, 1.0 / h, spread / h**2, x[p:], x[:p])


def _factor(observations: Observations, load: Array, j: int) -> Array:
    """Triangular factor of equation j's ``[W, K, y]``."""
    rows = observations.equation == j
    return triangular_factor(np.column_stack([observations.W[rows], load[rows], observations.y[rows]]))


def _weights(factors: list[Array], counts: Index, h: Array, x: Array) -> Array:
    errors = [np.linalg.norm(R[:, -1] - hj * R[:, :-1] @ x) for R, hj in zip(factors, h, strict=True)]
    return np.asarray(np.sqrt(counts) / np.array(errors))


def _linear(factors: list[Array], h: Array, weight: Array) -> Array:
    A = np.concatenate([w * hj * R[:, :-1] for R, hj, w in zip(factors, h, weight, strict=True)])
    y = np.concatenate([w * R[:, -1] for R, w in zip(factors, weight, strict=True)])
    return np.asarray(np.linalg.lstsq(A, y, rcond=None)[0])


def _step(factors: list[Array], h: Array, x: Array, weight: Array, p: int, common: bool) -> tuple[Array, Array]:
    """Gauss-Newton step of (h, x) with the mass held, and the standard deviation of each h."""
    r, width = h.size, x.size
    blocks, errors = [], []
    for j, R in enumerate(factors):
        block = np.zeros((R.shape[0], r + width))
        block[:, 0 if common else j] = R[:, :-1] @ x
        block[:, r:] = h[j] * R[:, :-1]
        blocks.append(weight[j] * block)
        errors.append(weight[j] * (R[:, -1] - h[j] * R[:, :-1] @ x))
    free = [*range(1 if common else r), *(r + k for k in range(width) if k != p)]
    A = np.concatenate(blocks)[:, free]
    scale = np.linalg.norm(A, axis=0)
    _, sigma, V = np.linalg.svd(A / np.where(scale > 0, scale, 1.0), full_matrices=False)
    if sigma[-1] < 1e-9 * sigma[0]:
        raise InputError("the drive gains are not identifiable from the motion: the load must act on every joint")
    inverse = (V.T / sigma) / scale[:, None]
    step, spread = np.zeros(r + width), np.zeros(r + width)
    step[free] = np.linalg.lstsq(A / scale, np.concatenate(errors), rcond=None)[0] / scale
    spread[free] = np.linalg.norm(inverse, axis=1)
    if common:
        step[:r], spread[:r] = step[0], spread[0]
    return step, spread[:r]


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
