"""A family's motion at given instants as a function of x: of all joints at fixed ones, of the coordinates on a grid."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from regressors.samples import Array, Index


class JointMotion(ABC):
    """The motion of all joints, ``q = N y + q0`` of a family's y, at fixed instants as a function of x."""

    @abstractmethod
    def values(self, x: Array) -> list[Array]:
        """Position, velocity and acceleration, each of shape (n, T)."""

    @abstractmethod
    def pullback(self, x: Array, slopes: Sequence[Array]) -> Array:
        """Gradient with respect to x of a function whose slopes by `values` are given."""


class MotionTangent(ABC):
    """Some derivatives of the k coordinates' motion at T instants of a grid, linear about one x."""

    @abstractmethod
    def changes(self, step: Array) -> Array:
        """Changes by a flat step, shape (T, derivatives, k)."""

    @abstractmethod
    def rows(self, weights: Array, place: Index) -> Array:
        """Derivatives by the flat x of weighted sums, each at one instant.

        Parameters
        ----------
        weights : ndarray, shape (rows, derivatives, k)
        place : ndarray of int, shape (rows,)
            Place among the T instants.

        Returns
        -------
        ndarray, shape (rows, x.size)
        """


class GridMotion(ABC):
    """The motion y of a family's k coordinates on a grid of N instants, as a function of x.

    Attributes
    ----------
    linear : bool
        Whether it is linear in x: then tangents are the same for every x.
    """

    linear: bool

    @abstractmethod
    def factor(self, derivative: int) -> float:
        """Largest |value| on the grid over largest |value| over continuous time, at least."""

    @abstractmethod
    def values(self, x: Array, derivative: int, instants: Index | None = None) -> Array:
        """``y^(d)`` at all instants or at some, shape (N, k)."""

    @abstractmethod
    def combined(self, x: Array, matrix: Array, derivative: int) -> Array:
        """``A y^(d)`` for a matrix A of shape (m, k), shape (m, N)."""

    @abstractmethod
    def tangent(self, x: Array, derivatives: Sequence[int], instants: Index) -> MotionTangent:
        """Some derivatives of the motion at some instants, linear about x."""
