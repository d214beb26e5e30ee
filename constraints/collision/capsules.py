"""Small capsules around given points and around cylinders."""

from __future__ import annotations

import numpy as np

from constraints.collision.geometry import Capsule, Vector
from regressors.errors import InputError
from regressors.samples import Array

_SLACK = 1e-9  # of the radius: points on the surface count as inside
_ITERATIONS = 400
_DIRECTIONS = 300


def enclosing_capsule(points: Array) -> Capsule:
    """Capsule of small volume that contains all points.

    ``radius = max_k |p_k - line|`` for the line from a to b; a and b by the simplex method of Nelder and Mead on the
    outermost points, from each of their principal axes: the smallest of three local minima, which need not be the
    global one.
    """  # points (N, 3)
    from scipy.optimize import minimize

    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[0] == 0 or not np.all(np.isfinite(points)):
        raise InputError("a capsule needs one point or more, all of them finite")
    corners = _outermost(points)
    centre = corners.mean(axis=0)
    axes = np.linalg.svd(corners - centre, full_matrices=False)[2]
    best: Array = np.concatenate([centre, centre])
    least = np.inf
    for axis in axes:
        along = (corners - centre) @ axis
        start = np.concatenate([centre + 0.7 * along.min() * axis, centre + 0.7 * along.max() * axis])
        minimum = minimize(
            _volume, start, (corners,), "Nelder-Mead", options={"maxiter": _ITERATIONS, "xatol": 1e-5, "fatol": 1e-9}
        )
        if minimum.fun < least:
            best, least = minimum.x, minimum.fun
    radius = _radius(best, points) * (1 + _SLACK)
    return Capsule(_vector(best[:3]), _vector(best[3:]), max(radius, _SLACK))


def enclosing_cylinder(radius: float, length: float) -> Capsule:
    """Capsule of least volume that contains a cylinder about the z axis, centred at the origin.

    With the line's ends a <= length / 2 from the middle, ``R^2 = radius^2 + (length / 2 - a)^2``.
    """
    from scipy.optimize import minimize_scalar

    if not (np.isfinite(radius + length) and radius > 0 and length > 0):
        raise InputError(f"a cylinder needs a radius and a length greater than zero, given {radius:g} and {length:g}")

    def volume(a: float) -> float:
        R = np.hypot(radius, length / 2 - a)
        return float(2 * R**2 * a + 4 / 3 * R**3)

    a = float(minimize_scalar(volume, bounds=(0.0, length / 2), method="bounded").x)
    return Capsule((0.0, 0.0, -a), (0.0, 0.0, a), float(np.hypot(radius, length / 2 - a)) * (1 + _SLACK))


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _outermost(points: Array) -> Array:
    """Points that are furthest in one of many directions spread evenly over the sphere (Fibonacci lattice)."""
    k = np.arange(_DIRECTIONS) + 0.5
    z, angle = 1 - 2 * k / _DIRECTIONS, np.pi * (1 + np.sqrt(5)) * k
    directions = np.array([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])
    return np.asarray(points[np.unique([int(np.argmax(points @ direction)) for direction in directions.T])])


def _radius(ends: Array, points: Array) -> float:
    a, line = ends[:3], ends[3:] - ends[:3]
    square = float(line @ line)
    t = np.clip((points - a) @ line / square, 0.0, 1.0) if square > 0 else np.zeros(len(points))
    return float(np.linalg.norm(points - a - t[:, None] * line, axis=1).max())


def _volume(ends: Array, points: Array) -> float:
    """Volume of the capsule about a line, in units of pi m^3."""
    r = _radius(ends, points)
    return float(r**2 * np.linalg.norm(ends[3:] - ends[:3]) + 4 / 3 * r**3)
