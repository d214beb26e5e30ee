"""Trajectory families that are linear in their coefficients, and trajectories made of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from constraints.constraint import Constraint
from constraints.extrema import Extrema
from constraints.linear import LinearConstraint
from regressors.samples import Array, Samples


class LinearFamily(ABC):
    """Motions ``q_j(t) = basis(t) x_j`` of any number of joints, at rest at both ends.

    The conditions at the ends are built into the basis, so every x is a motion of the family.

    Attributes
    ----------
    name : str
        As in ``--trajectory``.
    duration : float
        [s]
    size : int
        Number of free coefficients per joint.
    """

    name: str
    duration: float
    size: int
    _Z: Array  # physical coefficients of the free ones, (physical, size)

    @property
    @abstractmethod
    def richness(self) -> int:
        """About how many harmonics a motion has: so finely it is to be sampled."""

    @property
    @abstractmethod
    def described(self) -> str:
        """What it is made of, such as ``5 harmonics``."""

    def coefficients(self, x: Array) -> Array:
        """Physical coefficients per joint, of free ones of shape (n, size)."""
        return np.asarray(x @ self._Z.T)

    def from_coefficients(self, coefficients: Array) -> Array:
        """Free coefficients of given physical ones; the nearest motion at rest at both ends."""
        return np.asarray(coefficients @ np.linalg.pinv(self._Z).T)

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
    def grid_factor(self, count: int, derivative: int) -> float:
        """Largest |value| on ``count`` equal steps over largest |value| over continuous time, at least.

        A function of the family whose values on the grid stay within ``factor * bound`` stays within ``bound``
        everywhere. Values are taken about the middle of the allowed range.
        """

    @abstractmethod
    def extrema(self, x: Array, derivative: int) -> Extrema:
        """Exact extrema over continuous time.

        Parameters
        ----------
        x : ndarray, shape (k, size)
            Coefficients of k functions.
        derivative : int
        """

    @abstractmethod
    def to_dict(self, x: Array) -> dict[str, object]:
        """The motion in the family's own terms, for JSON, shape (n, size) in; coefficients in SI out."""

    def grid(self, count: int) -> Array:
        """``count`` equal steps of one duration, the last instant left out [s]."""
        return np.linspace(0.0, self.duration, count, endpoint=False)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One motion of a family.

    Parameters
    ----------
    family : LinearFamily
    x : ndarray, shape (n, size)
        Coefficients of each joint.
    """

    family: LinearFamily
    x: Array

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.family.duration

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s]; exactly at rest at both ends, where rounding would leave a sign to friction."""
        samples = Samples(time, *(self.family.basis(time, d) @ self.x.T for d in range(4)))
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
        x = constraint.matrix @ self.x + np.outer(constraint.offset, self.family.constant)
        return self.family.extrema(x, constraint.derivative)
