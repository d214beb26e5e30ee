"""Robots and sensors of the force and moment on a load, for the tests of the load models."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from hypothesis import strategies as st
from slow_dynamics import random_chain, random_rotation

from regressors.models.load import EQUATIONS, Sensor
from regressors.readers.library import built_in
from regressors.robot.robot import Robot

KINDS = st.text(alphabet="rp", min_size=1, max_size=4)
SEED = st.integers(0, 2**32 - 1)


@cache
def sliders() -> Robot:
    return random_chain("rprpr", np.random.default_rng(0))


ROBOTS: dict[str, Callable[[], Robot]] = {
    "irp6": lambda: built_in("irp6"),
    "panda": lambda: built_in("panda"),
    "sliders": sliders,
}


def shifted(link: str | None = None, seed: int = 0, equations: tuple[str, ...] = EQUATIONS) -> Sensor:
    """A sensor whose frame is turned and away from the link's."""
    rng = np.random.default_rng(seed)
    return Sensor(link, random_rotation(rng), rng.normal(0.0, 0.2, 3), equations)
