"""Commanded motion at the instants of a log, free of measurement noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.optimize

from excite.identification.equations import equations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.samples import Array, Samples

_FEW = 300  # instants that suffice to find the shift
FAR = 0.2  # of the motion's size: a log that deviates more did not follow the commanded motion


def commanded(trajectory: Trajectory, part: PreparedLog) -> Samples:
    """Commanded motion at the instants of a prepared log, shifted in time so that it fits best."""
    time, q = part.samples.time, part.samples.q
    period = trajectory.family.duration

    def at(delay: float) -> Samples:
        wrapped = trajectory.samples(np.mod(time - delay, period))
        return replace(wrapped, time=time)

    few = slice(None, None, max(1, time.size // _FEW))

    def misfit(delay: float) -> float:
        return float(np.sum((trajectory.samples(np.mod(time[few] - delay, period)).q - q[few]) ** 2))

    start = float(time[0])
    coarse = start + np.linspace(-period / 2, period / 2, 201)
    nearest = coarse[int(np.argmin([misfit(delay) for delay in coarse]))]
    step = period / 200
    minimum = scipy.optimize.minimize_scalar(misfit, bounds=(nearest - step, nearest + step), method="bounded")
    motion = at(float(minimum.x))
    size = float(np.linalg.norm(q - q.mean(axis=0)))
    astray = float(np.linalg.norm(motion.q - q)) / size if size > 0 else np.inf
    if astray > FAR:
        raise InputError(
            f"{part.log.source} does not follow the design's motion: "
            f"it deviates by {100 * astray:.0f} % of the size of the motion"
        )
    return motion


def instruments(
    trajectory: Trajectory, target: IdentificationTarget, parts: tuple[PreparedLog, ...], recipe: Recipe
) -> Array:
    """Regressor of the commanded motion, with the same rows as the measured one, shape (m, p)."""
    played = [replace(part, samples=commanded(trajectory, part)) for part in parts]
    return equations(target, played, recipe).matrix
