"""A family's motion at instants as a function of x: of all joints at given instants, of coordinates on a grid."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from regressors.samples import Array, Index


class JointMotion(ABC):
    """The motion of all joints, ``q = N y + q0`` with a family's y, at fixed instants as a function of x."""

    @abstractmethod
    def values(self, x: Array) -> list[Array]:
        """Position, velocity and acceleration, each of shape (n, T)."""

    @abstractmethod
    def pullback(self, x: Array, slopes: Sequence[Array]) -> Array:
        """Gradient with respect to x of a function, from its derivatives with respect to `values`."""


class MotionTangent(ABC):
    """Some derivatives of the k coordinates' motion at T instants of a grid, linearised about one x."""

    @abstractmethod
    def rows(self, weights: Array, place: Index) -> Array:
        """Derivatives of weighted sums, each at one instant, with respect to the flat x."""
        # weights (rows, derivatives, k); place (rows,)


class GridMotion(ABC):
    """The motion y of a family's k coordinates on a grid of N instants, as a function of x.

    Attributes
    ----------
    linear : bool
        Whether it is linear in x, so that tangents are the same for every x.
    """

    linear: bool

    @abstractmethod
    def factor(self, derivative: int) -> float:
        """Lower bound of the largest |value| on the grid over the largest |value| over continuous time."""

    @abstractmethod
    def values(self, x: Array, derivative: int, instants: Index | None = None) -> Array:
        """``y^(d)`` at all or some instants, shape (N, k)."""

    @abstractmethod
    def combined(self, x: Array, matrix: Array, derivative: int) -> Array:
        """``A y^(d)`` for a matrix A of shape (m, k), shape (m, N)."""

    @abstractmethod
    def tangent(self, x: Array, derivatives: Sequence[int], instants: Index) -> MotionTangent:
        """Some derivatives of the motion at some instants, linearised about x."""
