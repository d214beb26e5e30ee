"""Trajectory families, those that are linear in their coefficients, and trajectories made of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from constraints.bounds.extrema import Extrema
from constraints.constraint import Constraint
from constraints.linear import LinearConstraint
from regressors.errors import InputError
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Samples


def check_period(duration: float) -> None:
    """Raise `InputError` for a duration that no motion can have [s]."""
    if not (np.isfinite(duration) and duration > 0):
        raise InputError(f"period must be a positive number of seconds, given {duration}")


class JointMotion(ABC):
    """The motion of all joints, ``q = N y + q0`` of a family's y, at fixed instants as a function of x."""

    @abstractmethod
    def values(self, x: Array) -> list[Array]:
        """Position, velocity and acceleration, each of shape (n, T)."""

    @abstractmethod
    def pullback(self, x: Array, slopes: Sequence[Array]) -> Array:
        """Gradient with respect to x of a function whose slopes by `values` are given."""


class Family(ABC):
    """Motions of any number of joints, at rest at both ends, each of them told by an array x.

    Attributes
    ----------
    name : str
        As in ``--trajectory``.
    duration : float
        [s]
    size : int
        Number of coefficients per joint in which motions are linear.
    options : tuple of str
        Options of a task that a family is made of, after the period; attributes of the same names.
    richness_option : str
        The one that makes its motions richer.
    samples_per_term : int
        A motion of so many samples per unit of that option, or fewer, could be a poorer one.
    """

    name: str
    duration: float
    size: int
    options: ClassVar[tuple[str, ...]] = ("harmonics",)
    richness_option: ClassVar[str] = "harmonics"
    samples_per_term: ClassVar[int] = 2

    @property
    @abstractmethod
    def richness(self) -> int:
        """About how many harmonics a motion has: so finely it is to be sampled."""

    @property
    @abstractmethod
    def described(self) -> str:
        """What it is made of, such as ``5 harmonics``."""

    def grid(self, count: int) -> Array:
        """``count`` equal steps of one duration, the last instant left out [s]."""
        return np.linspace(0.0, self.duration, count, endpoint=False)

    @abstractmethod
    def motion(self, x: Array, time: Array, derivative: int) -> Array:
        """Motion x at given instants [s], 0 for position to 3 for jerk, shape (N, n)."""

    @abstractmethod
    def carried(self, x: Array, matrix: Array, offset: Array) -> tuple[Family, Array]:
        """The motion ``matrix q + offset`` as one of a family: that family, and its x."""

    @abstractmethod
    def joints(self, time: Array, motion: PartialMotion) -> JointMotion:
        """Motion of the joints of a robot that the family moves in part."""

    @abstractmethod
    def resting(self, pose: Array) -> Array:
        """The x of rest in a pose, shape (n,)."""

    @abstractmethod
    def nearest(self, time: Array, q: Array) -> Array:
        """The x of the motion nearest to positions of shape (N, n) at given instants, by least squares."""

    @abstractmethod
    def grid_factor(self, count: int, derivative: int) -> float:
        """Largest |value| on the grid of ``count`` over largest |value| over continuous time, at least.

        A function of the family whose values on the grid stay within ``factor * bound`` stays within ``bound``
        everywhere. Values are taken about the middle of the allowed range.
        """

    @abstractmethod
    def combined_extrema(self, x: Array, matrix: Array, offset: Array, derivative: int) -> Extrema:
        """Exact extrema over continuous time of ``matrix q + offset`` or of a derivative of it."""

    @abstractmethod
    def to_dict(self, x: Array) -> dict[str, object]:
        """The motion in the family's own terms, for JSON, in SI."""

    @abstractmethod
    def stored(self, series: Mapping[str, Any], joints: int) -> Trajectory:
        """The motion of so many joints that `to_dict` made entries of.

        Raises
        ------
        InputError
            Numbers of another shape, or not finite.
        """


class LinearFamily(Family):
    """Motions ``q_j(t) = basis(t) x_j`` of any number of joints, at rest at both ends.

    The conditions at the ends are built into the basis, so every x of shape (n, size) is a motion of the family.

    Attributes
    ----------
    parts : tuple of str
        Entries of a file that hold the physical coefficients, side by side.
    """

    parts: ClassVar[tuple[str, ...]] = ("coefficients",)
    _Z: Array  # physical coefficients of the free ones, (physical, size)

    def coefficients(self, x: Array) -> Array:
        """Physical coefficients per joint, of free ones of shape (n, size)."""
        return np.asarray(x @ self._Z.T)

    def from_coefficients(self, coefficients: Array) -> Array:
        """Free coefficients of given physical ones; the nearest motion at rest at both ends."""
        return np.asarray(coefficients @ np.linalg.pinv(self._Z).T)

    def to_dict(self, x: Array) -> dict[str, object]:
        """Family, period, options, and the physical coefficients of each joint."""
        options = {name: getattr(self, name) for name in self.options}
        return {"family": self.name, "period": self.duration, **options, "coefficients": self.coefficients(x).tolist()}

    def stored(self, series: Mapping[str, Any], joints: int) -> Trajectory:
        """The motion of so many joints, from its physical coefficients."""
        coefficients = np.column_stack([np.array(series[part], dtype=float) for part in self.parts])
        expected = (joints, self.coefficients(self.constant[None]).shape[1])
        if coefficients.shape != expected or not np.all(np.isfinite(coefficients)):
            raise InputError(
                f"trajectory: expected {expected[1]} finite coefficients for each of {expected[0]} joints, "
                f"given an array of shape {coefficients.shape}"
            )
        return Trajectory(self, self.from_coefficients(coefficients))

    @abstractmethod
    def basis(self, time: Array, derivative: int) -> Array:
        """Basis functions or their derivatives at given instants.

        Parameters
        ----------
        time : ndarray, shape (N,)
            [s]
        derivative : int
            0 for position to 3 for jerk.

        Returns
        -------
        ndarray, shape (N, size)
        """

    @property
    @abstractmethod
    def constant(self) -> Array:
        """Coefficients of the motion that rests at position 1, shape (size,)."""

    @abstractmethod
    def extrema(self, x: Array, derivative: int) -> Extrema:
        """Exact extrema over continuous time.

        Parameters
        ----------
        x : ndarray, shape (k, size)
            Coefficients of k functions.
        derivative : int
        """

    def motion(self, x: Array, time: Array, derivative: int) -> Array:
        """``basis x'``, shape (N, n)."""
        return np.asarray(self.basis(time, derivative) @ x.T)

    def carried(self, x: Array, matrix: Array, offset: Array) -> tuple[LinearFamily, Array]:
        """The same family, with other coefficients."""
        return self, np.asarray(matrix @ x + np.outer(offset, self.constant))

    def joints(self, time: Array, motion: PartialMotion) -> JointMotion:
        """By the basis, evaluated once."""
        return _BasisJoints(self, time, motion)

    def resting(self, pose: Array) -> Array:
        """Multiples of the constant."""
        return np.outer(pose, self.constant)

    def nearest(self, time: Array, q: Array) -> Array:
        """Linear least squares."""
        return np.asarray(np.linalg.lstsq(self.basis(time, 0), q, rcond=None)[0].T)

    def combined_extrema(self, x: Array, matrix: Array, offset: Array, derivative: int) -> Extrema:
        """Those of the functions with the combined coefficients."""
        return self.extrema(matrix @ x + np.outer(offset, self.constant), derivative)


class _BasisJoints(JointMotion):
    def __init__(self, family: LinearFamily, time: Array, motion: PartialMotion) -> None:
        self._basis = [family.basis(time, d) for d in range(3)]
        self._N, self._held = motion.matrix, np.outer(motion.offset, family.constant)

    def values(self, x: Array) -> list[Array]:
        joints = self._N @ x + self._held
        return [np.ascontiguousarray(joints @ B.T) for B in self._basis]

    def pullback(self, x: Array, slopes: Sequence[Array]) -> Array:
        return np.asarray(self._N.T @ sum(s @ B for s, B in zip(slopes, self._basis, strict=True)))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One motion of a family.

    Parameters
    ----------
    family : Family
    x : ndarray
        What tells the motion: for a linear family coefficients of each joint, shape (n, size).
    """

    family: Family
    x: Array

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.family.duration

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s]; exactly at rest at both ends, where rounding would leave a sign to friction."""
        samples = Samples(time, *(self.family.motion(self.x, time, d) for d in range(4)))
        ends = (time == 0.0) | (time == self.duration)
        samples.dq[ends] = samples.ddq[ends] = 0.0
        return samples

    def sampled(self, rate: float) -> Samples:
        """Motion at a uniform rate [Hz] from 0 to the duration, both included."""
        return self.samples(np.linspace(0.0, self.duration, round(self.duration * rate) + 1))

    def extrema(self, constraint: Constraint) -> Extrema:
        """Exact extrema of a constraint's functions over continuous time."""
        if not isinstance(constraint, LinearConstraint):
            raise TypeError(f"no exact extrema for {type(constraint).__name__}")
        return self.family.combined_extrema(self.x, constraint.matrix, constraint.offset, constraint.derivative)

    @property
    def jerk(self) -> Array:
        """Largest |jerk| of every joint, shape (n,)."""
        n = self.family.motion(self.x, np.zeros(1), 0).shape[1]
        third = self.family.combined_extrema(self.x, np.eye(n), np.zeros(n), 3)
        return np.maximum(np.abs(third.low), np.abs(third.high))

    def carried(self, matrix: Array, offset: Array) -> Trajectory:
        """The motion ``matrix q + offset``."""
        return Trajectory(*self.family.carried(self.x, matrix, offset))
