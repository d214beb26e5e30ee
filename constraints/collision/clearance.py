"""Distances between convex bodies as smooth functions that can be enclosed: squares, without division by variables.

The squared distance of a point from a convex body is the least of ``|p - y|^2`` over the points y of the body. Its
derivative is that of ``|p - y|^2`` with the nearest y held [Danskin 1967], so it is continuous although y is not
smooth.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from constraints.collision.frames import Pose
from constraints.collision.geometry import Box, Capsule, HalfSpace, Shape
from regressors.samples import Array
from regressors.symbolic.kinematics import sparse


@dataclass(frozen=True, eq=False)
class Gap:
    """A function whose bound keeps two bodies, or parts of them, apart."""

    # distance from a plane [m]; or squared distance of two points [m^2], one of them the nearest of a body
    value: ca.SX
    reach: float  # sum of the bodies' radii, to be subtracted from the distance [m]
    squared: bool
    # symbols in the value and their expressions, which are held constant in derivatives
    held: tuple[tuple[ca.SX, ca.SX], ...] = field(default=())


def _at(pose: Pose, point: Array) -> ca.SX:
    return pose[1] + ca.mtimes(pose[0], sparse(point))


def _squared(vector: ca.SX) -> ca.SX:
    return ca.sumsqr(vector)


def _clipped(value: ca.SX, low: Array | float, high: Array | float) -> ca.SX:
    return ca.fmin(ca.fmax(value, low), high)


def _to_line(point: ca.SX, pose: Pose, capsule: Capsule, reach: float) -> Gap:
    """Squared distance of a point from the line of a capsule."""
    start = _at(pose, np.array(capsule.start))
    if capsule.length == 0:
        return Gap(_squared(point - start), reach, True)
    line = ca.mtimes(pose[0], sparse(np.subtract(capsule.end, capsule.start)))
    t = ca.SX.sym("t")
    nearest = _clipped(ca.dot(point - start, line) / capsule.length**2, 0.0, 1.0)
    return Gap(_squared(point - start - t * line), reach, True, ((t, nearest),))


def _to_box(point: ca.SX, box: Box, reach: float) -> Gap:
    """Squared distance of a point from a fixed box in the same frame."""
    local = ca.mtimes(sparse(box.rotation.T), point - sparse(np.array(box.centre)))
    half = np.array(box.size) / 2
    y = ca.SX.sym("y", 3)
    return Gap(_squared(local - y), reach, True, ((y, _clipped(local, -half, half)),))


def gaps(capsule: Capsule, pose: Pose, shape: Shape, other: Pose, tolerance: float) -> list[Gap]:
    """Functions that together keep a capsule and another body apart; they never exceed the true distance.

    For a plane, and for a pair with a sphere, they are exact. Otherwise one body is covered by spheres, which reduces
    the distance by up to the tolerance.
    """
    ends = [capsule.start] if capsule.length == 0 else [capsule.start, capsule.end]
    if isinstance(shape, HalfSpace):
        normal = sparse(np.array(shape.normal))
        return [
            Gap(ca.dot(normal, _at(pose, np.array(end))) - shape.offset - capsule.radius, 0.0, False) for end in ends
        ]
    centres, radius = capsule.covering(tolerance)
    if isinstance(shape, Box):
        return [_to_box(_at(pose, centre), shape, radius) for centre in centres]
    others, wide = shape.covering(tolerance)
    if len(others) < len(centres):
        return [_to_line(_at(other, centre), pose, capsule, wide + capsule.radius) for centre in others]
    return [_to_line(_at(pose, centre), other, shape, radius + shape.radius) for centre in centres]
