"""Directions of the drives' friction, each over its own velocity or distance."""

from __future__ import annotations

import numpy as np

from excite.identification.hysteresis import measured_direction
from excite.identification.recipe import Sizes
from regressors.errors import InputError
from regressors.friction.curves import drives_with_friction
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_LEAST = 1e-12  # stands for zero, whose direction is the sign


def listed(sizes: Sizes | None) -> str:
    """One size, or those of the moving drives, in words."""
    return ", ".join(f"{size:.3g}" for size in np.atleast_1d(sizes or 0.0).tolist())


def directions(z: Array, dz: Array, sign_width: Sizes | None, breakaway: Sizes | None) -> Array | None:
    """Direction of the friction of each drive along a motion, from -1 to 1."""  # z, dz (N, k)
    for what, given in (("sign_width", sign_width), ("breakaway", breakaway)):
        if isinstance(given, tuple) and len(given) != z.shape[1]:
            raise InputError(f"`{what}` needs one value, or {z.shape[1]}, one per moving drive; given {len(given)}")
    distance, width = (np.asarray(given or 0.0) for given in (breakaway, sign_width))
    if np.any(distance):
        return measured_direction(z, np.maximum(distance, _LEAST))
    return np.asarray(np.tanh(dz / np.maximum(width, _LEAST))) if np.any(width) else None


def drive_directions(robot: Robot, samples: Samples, sign_width: Sizes | None, breakaway: Sizes | None) -> Array | None:
    """Direction of the friction of each moving drive along a motion of the joints, see `directions`."""
    rows = drive_rows(robot)
    return directions(samples.q @ rows.T, samples.dq @ rows.T, sign_width, breakaway)


def drive_rows(robot: Robot) -> Array:
    """Rows of C of the drives that have friction, shape (k, n)."""
    return np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)
