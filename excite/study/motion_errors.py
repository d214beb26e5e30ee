"""Errors of an estimate by noise in the measured motion: encoders, position noise, and what the recorder does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from excite.simulation.settings import SimulationSettings
from excite.study.rehearsal import Rehearsal, motion_settings
from regressors.samples import Array


def motion_errors(
    rehearsal: Rehearsal, count: int, seed: int, progress: Callable[[int, int], None] = lambda *_: None
) -> Array:
    """Errors of the estimate from measured motions and exact torques, shape (count, p).

    Each measured motion passes the filter and the derivatives of the identification and gives its own regressor W, so
    that parameters are also pulled towards zero, ``(W' V W)^-1 W' V (y - W beta)``. Encoders count from a random phase:
    a repeat of the motion that is not the same to within a count meets other steps.
    """
    settings, rng, errors = motion_settings(rehearsal.settings), np.random.default_rng([seed, 1]), []
    exact = rehearsal.exact.solution.values
    widest = _widest_step(settings, rehearsal.simulation.robot.n)
    for k in range(count):
        one = replace(settings, seed=int(rng.integers(2**31)))
        log = rehearsal.log(one, widest * rng.random(widest.size))
        errors.append(rehearsal.equations(log).error(exact))
        progress(k + 1, count)
    return np.array(errors)


def _widest_step(settings: SimulationSettings, joints: int) -> Array:
    """Step of the positions of each joint, or more where gears reduce it, shape (n,)."""
    step = np.broadcast_to(settings.position_step, joints)
    if settings.encoder is None:
        return np.asarray(step)
    return np.asarray(np.maximum(step, 2 * np.pi / np.broadcast_to(settings.encoder, joints)))
