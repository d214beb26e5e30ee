"""Families of motions, linear in their coefficients and not, and random motions of theirs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from excite.trajectories import Fourier
from excite.trajectories.bspline import BSpline
from excite.trajectories.family import Family
from excite.trajectories.fourier import Cosine, FourierQuintic
from excite.trajectories.polynomial import Polynomial
from excite.trajectories.sines import Sines
from excite.trajectories.waypoints import Waypoints
from regressors.samples import Array

LINEAR: dict[str, Callable[[], Family]] = {
    "fourier": lambda: Fourier(7.0, 5),
    "cosine": lambda: Cosine(7.0, 4),
    "fourier-quintic": lambda: FourierQuintic(7.0, 3),
    "fourier-quintic, many": lambda: FourierQuintic(20.0, 10),
    "one harmonic": lambda: FourierQuintic(0.5, 1),
    "cubic": lambda: BSpline(5.0, 8, 4),
    "quartic": lambda: BSpline(5.0, 9, 5),
    "quintic": lambda: BSpline(5.0, 12, 6),
    "fewest intervals": lambda: BSpline(60.0, 3, 6),
    "polynomial of degree 9": lambda: Polynomial(7.0, 1),
    "polynomial of degree 53": lambda: Polynomial(30.0, 12),
}
NONLINEAR: dict[str, Callable[[], Family]] = {
    "waypoints": lambda: Waypoints(7.0, 5),
    "fewest waypoints": lambda: Waypoints(0.8, 2),
    "sines": lambda: Sines(7.0, 4),
    "one sine": lambda: Sines(20.0, 1),
}


def motion(family: Family, seed: int, count: int = 3) -> Array:
    """A random motion of so many coordinates; of a random shape, where the family has shapes."""
    rng = np.random.default_rng(seed)
    x = family.resting(rng.normal(size=count), rng)
    family.split(x)[0][:] += rng.normal(size=(count, family.size))
    return x
