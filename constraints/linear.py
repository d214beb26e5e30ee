"""The form of every constraint, and limits that are linear in the motion: bounds on A q + a0 and its rates.

A constraint depends on samples of a motion, never on the optimiser.

Joint limits have A = E, limits on drive coordinates z = C q + z0 have A = C.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from regressors.models.partial import PartialMotion
from regressors.robot.robot import Limits, Robot, linear_drives, transmission_of
from regressors.samples import Array, Samples

Selection = NDArray[np.bool_]
OTHER = "other"  # what a constraint limits, in a word, where it does not say


class Constraint(ABC):
    """A set of k bounds on functions of the motion."""

    labels: tuple[str, ...]  # name of each function, such as ``joint q2 velocity``
    units: tuple[str, ...]
    lower: Array  # (k,) bounds; infinite where there is none
    upper: Array
    quantity: str = OTHER  # what is limited, in a word, such as ``velocity``, ``torque`` or ``distance``

    @abstractmethod
    def values(self, samples: Samples) -> Array:
        """Value of every function at every instant, shape (N, k)."""


QUANTITIES = ("position", "velocity", "acceleration", "jerk")
_UNITS = ("", "/s", "/s^2", "/s^3")


@dataclass(eq=False, repr=False)
class LinearConstraint(Constraint):
    """``lower <= A q^(d) + a0 <= upper`` for one order of derivative d."""

    derivative: int
    matrix: Array
    offset: Array
    lower: Array
    upper: Array
    labels: tuple[str, ...]
    units: tuple[str, ...]

    def __post_init__(self) -> None:
        self.offset = self.offset if self.derivative == 0 else np.zeros_like(self.offset)
        self.quantity = QUANTITIES[self.derivative]

    def restricted(self, motion: PartialMotion) -> LinearConstraint:
        """The same bounds on the moving coordinates s of ``q = N s + q0``; constant functions are left out."""
        matrix, offset = motion.functions(self.matrix, self.offset)
        changed = replace(self, matrix=matrix, offset=offset)
        return changed.rows(np.any(np.abs(matrix) > 1e-12, axis=1))

    def rows(self, kept: Selection) -> LinearConstraint:
        """Some of the functions."""  # kept (k,)
        labels, units = (tuple(compress(texts, kept)) for texts in (self.labels, self.units))
        matrix, offset, lower, upper = (x[kept] for x in (self.matrix, self.offset, self.lower, self.upper))
        return LinearConstraint(self.derivative, matrix, offset, lower, upper, labels, units)

    def values(self, samples: Samples) -> Array:
        """``A q^(d) + a0`` at every instant, shape (N, k)."""
        motion = (samples.q, samples.dq, samples.ddq, samples.dddq)[self.derivative]
        return np.asarray(motion @ self.matrix.T + self.offset)


def _from_limits(
    limits: Limits, matrix: Array, offset: Array, names: tuple[str, ...], units: tuple[str, ...]
) -> Iterator[LinearConstraint]:
    moving = np.any(matrix != 0.0, axis=1)
    for derivative, quantity in enumerate(QUANTITIES):
        upper = limits.upper if derivative == 0 else getattr(limits, quantity)
        lower = limits.lower if derivative == 0 else -upper
        rows = np.flatnonzero(moving & (np.isfinite(lower) | np.isfinite(upper)))
        if rows.size:
            labels = tuple(f"{names[k]} {quantity}" for k in rows)
            row_units = tuple(units[k] + _UNITS[derivative] for k in rows)
            bounds = lower[rows], upper[rows]
            yield LinearConstraint(derivative, matrix[rows], offset[rows], *bounds, labels, row_units)


def drive_limits(robot: Robot) -> list[LinearConstraint]:
    """Limits of the drive coordinates z = C q + z0; none for a robot without a transmission."""
    transmission = transmission_of(robot)
    names = tuple(f"drive {drive.name}" for drive in transmission.drives)
    units = tuple("m" if linear else "rad" for linear in linear_drives(robot))
    return list(_from_limits(transmission.limits, transmission.coupling, transmission.offset, names, units))


def linear_limits(robot: Robot) -> tuple[LinearConstraint, ...]:
    """Limits on position, velocity, acceleration and jerk, joints first, one constraint per quantity that has any."""
    names = tuple(f"joint {name}" for name in robot.joint_names)
    units = tuple(joint.unit for joint in robot.joints)
    of_joints = _from_limits(robot.limits, np.eye(robot.n), np.zeros(robot.n), names, units)
    return (*of_joints, *drive_limits(robot))


def spanned(limits: Sequence[LinearConstraint], n: int, derivatives: tuple[int, ...]) -> list[bool]:
    """Whether each of n coordinates is bounded in one of the derivatives: lies in the span of the limited functions."""
    rows = [limit.matrix for limit in limits if limit.derivative in derivatives]
    A = np.concatenate([np.zeros((0, n)), *rows])
    projector = np.linalg.pinv(A) @ A if A.size else np.zeros((n, n))
    return [bool(ok) for ok in np.isclose(np.diag(projector), 1.0, atol=1e-9)]
