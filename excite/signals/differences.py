"""Central differences of the positions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from excite.signals.cut import cut_motion
from excite.signals.method import FilteredMotion, Method, spacing
from regressors.errors import UnknownName
from regressors.samples import Array

ACCELERATIONS = ("again", "second")


@dataclass(frozen=True)
class Differences(Method):
    """Three-point differences, as in [KD96] section 5.3.

    ``dq_k = (q_{k+1} - q_{k-1}) / 2h``, and the acceleration by the same of the velocity,
    ``ddq_k = (q_{k+2} - 2 q_k + q_{k-2}) / 4h^2``, or by second differences, ``(q_{k+1} - 2 q_k + q_{k-1}) / h^2``.
    White noise s of the positions becomes ``s / (sqrt(2) h)`` of the velocities, and ``sqrt(6) s / 4h^2`` or
    ``sqrt(6) s / h^2`` of the accelerations.
    """

    acceleration: Literal["again", "second"] = "again"

    name: ClassVar[str] = "differences"

    def __post_init__(self) -> None:
        if self.acceleration not in ACCELERATIONS:
            raise UnknownName("acceleration of differences", str(self.acceleration), ACCELERATIONS)

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Positions as they are, their differences; see `Method.motion`."""
        h = spacing(time, self.name, 7)
        velocity = central_difference(q, h)
        if self.acceleration == "again":
            acceleration, edge, origin = central_difference(velocity, h), 2, "taken again"
        else:
            acceleration, edge, origin = second_difference(q, h), 1, "second differences"
        assumed = f"positions without noise; three-point central differences over {2 * h:.4g} s, acceleration {origin}"
        return cut_motion(time, (q, velocity, acceleration), edge, assumed)


def central_difference(x: Array, h: float) -> Array:
    """``(x_{k+1} - x_{k-1}) / 2h``, shape of x; NaN in the first and the last row."""  # x (N, ...)
    return _stencil(x, np.array([-1.0, 0.0, 1.0]) / (2 * h))


def second_difference(x: Array, h: float) -> Array:
    """``(x_{k+1} - 2 x_k + x_{k-1}) / h^2``, shape of x; NaN in the first and the last row."""
    return _stencil(x, np.array([1.0, -2.0, 1.0]) / h**2)


def smooth_differences(x: Array, h: float) -> tuple[Array, Array]:
    """First and second derivative of smooth samples by seven points, exact for polynomials of degree 6."""
    # x (N, ...)
    first = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / (60 * h)
    second = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / (180 * h**2)
    return _stencil(x, first), _stencil(x, second)


def _stencil(x: Array, weights: Array) -> Array:
    half = weights.size // 2
    inner = sum(w * x[k : x.shape[0] - 2 * half + k] for k, w in enumerate(weights))
    result = np.full_like(x, np.nan, dtype=float)
    result[half : x.shape[0] - half] = inner
    return result
