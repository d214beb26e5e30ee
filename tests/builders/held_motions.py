"""Motions of a robot in which some joints rest, and what their columns explain."""

from __future__ import annotations

import numpy as np

from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


def held_motion(robot: Robot, moving: list[int], rest: Array, rng: np.random.Generator, count: int = 3) -> Samples:
    """Random motion of the whole robot in which the other joints rest."""
    motion = rng.uniform(-1.5, 1.5, (3, count, robot.n))
    held = np.setdiff1d(range(robot.n), moving)
    motion[0][:, held], motion[1][:, held], motion[2][:, held] = rest[held], 0.0, 0.0
    return Samples(np.arange(float(count)), *motion, 0 * motion[0])


def moving_part(samples: Samples, moving: list[int]) -> Samples:
    return Samples(samples.time, *(x[:, moving] for x in (samples.q, samples.dq, samples.ddq, samples.dddq)))


def subset(n: int, rng: np.random.Generator) -> list[int]:
    return sorted(rng.choice(n, rng.integers(1, n + 1), replace=False).tolist())


def assert_explained(W: Array, left: Array) -> None:
    """Every column is a combination of the columns that are left."""
    W, left = (columns / np.where((s := np.linalg.norm(columns, axis=0)) > 1e-12 * s.max(), s, np.inf)
               for columns in (W, left))  # fmt: skip
    np.testing.assert_allclose(left @ np.linalg.lstsq(left, W, rcond=1e-12)[0], W, atol=1e-9)
