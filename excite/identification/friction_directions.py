"""Directions of the drives' friction, each over its own velocity or distance."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from excite.identification.hysteresis import dahl_direction
from regressors.errors import InputError
from regressors.samples import Array

Sizes = float | tuple[float, ...]  # one for all drives, or one for each
_LEAST = 1e-12  # stands for zero, whose direction is the sign


def sizes(what: str, given: float | Sequence[float] | None) -> Sizes | None:
    """One size or several, as plain numbers.

    Raises
    ------
    InputError
        A number that is not zero or positive.
    """
    if given is None:
        return None
    several = isinstance(given, list | tuple)
    values = tuple(given) if isinstance(given, list | tuple) else (given,)
    for value in values:
        if not (math.isfinite(value) and value >= 0):
            raise InputError(f"{what} must be zero or a positive number, given {value}")
    return values if several else values[0]


def directions(z: Array, dz: Array, sign_width: Sizes | None, breakaway: Sizes | None) -> Array | None:
    """Direction of the friction of each drive along a motion, from -1 to 1.

    Parameters
    ----------
    z, dz : ndarray, shape (N, k)
        Drive coordinates, up to constants, and their velocities [rad, rad/s, or with m].
    sign_width : float or tuple of float, length k, optional
        w of ``tanh(dz / w)`` [rad/s or m/s].
    breakaway : float or tuple of float, length k, optional
        d of `dahl_direction`, which takes precedence [rad or m].

    Returns
    -------
    ndarray, shape (N, k), or None
        None for the exact sign of the velocity of all drives.

    Raises
    ------
    InputError
        Another number of sizes than there are drives.
    """
    for what, given in (("sign_width", sign_width), ("breakaway", breakaway)):
        if isinstance(given, tuple) and len(given) != z.shape[1]:
            raise InputError(f"`{what}` needs one value, or {z.shape[1]}, one per moving drive; given {len(given)}")
    distance, width = (np.asarray(given or 0.0) for given in (breakaway, sign_width))
    if np.any(distance):
        return dahl_direction(z, np.maximum(distance, _LEAST))
    return np.asarray(np.tanh(dz / np.maximum(width, _LEAST))) if np.any(width) else None
