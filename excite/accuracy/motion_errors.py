"""Errors of an estimate by noise in the measured motion: encoders, position noise, and what the recorder does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from excite.accuracy.rehearsal import Rehearsal, motion_settings
from excite.identification.covariance import divisors
from excite.identification.factors import GroupFactors
from excite.identification.observations import Observations
from excite.identification.solution import solve_triangular_system
from excite.simulation.settings import SimulationSettings
from regressors.samples import Array


def motion_errors(
    rehearsal: Rehearsal, count: int, seed: int, progress: Callable[[int, int], None] = lambda *_: None
) -> Array:
    """Errors of the estimate from measured motions and exact torques, shape (count, p).

    Each measured motion passes the filter and the derivatives of the identification and gives its own regressor W, so
    that parameters are also pulled towards zero, ``(W' V W)^-1 W' V (y - W beta)``. Encoders count from a random phase:
    a repeat of the motion that is not the same to within a count meets other steps.

    Parameters
    ----------
    rehearsal : Rehearsal
    count : int
        Samples of the noise.
    seed : int
    progress : callable
        Called with the number of samples done, and `count`.
    """
    settings, rng, errors = motion_settings(rehearsal.settings), np.random.default_rng([seed, 1]), []
    divisor = divisors(rehearsal.result.estimate)
    half = solve_triangular_system(GroupFactors.of(rehearsal.exact).stacked(divisor)).half
    widest = _widest_step(settings, rehearsal.simulation.robot.n)
    for k in range(count):
        one = replace(settings, seed=int(rng.integers(2**31)))
        log = rehearsal.log(one, widest * rng.random(widest.size))
        errors.append(_error(rehearsal.observations(log), divisor, half, rehearsal.values))
        progress(k + 1, count)
    return np.array(errors)


def _widest_step(settings: SimulationSettings, joints: int) -> Array:
    """Step of the positions of each joint, or more where gears reduce it, shape (n,)."""
    step = np.broadcast_to(settings.degradation.position_step, joints)
    if settings.encoder is None:
        return np.asarray(step)
    return np.maximum(step, 2 * np.pi / np.broadcast_to(settings.encoder, joints))


def _error(rows: Observations, divisor: Array, half: Array, values: Array) -> Array:
    """``(W' V W)^-1 W' V (y - W values)``; the columns of ``W half`` are nearly orthonormal."""
    normal, side = np.zeros(2 * (half.shape[1],)), np.zeros(half.shape[1])
    for block in rows.blocks():
        scale = divisor[rows.group[block]]
        W = rows.W[block]
        X = W @ half / scale[:, None]
        normal += X.T @ X
        side += X.T @ ((rows.y[block] - W @ values) / scale)
    return np.asarray(half @ np.linalg.solve(normal, side))
