"""A finished log as it would be after the given degradations; one simulation serves many such logs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from excite.logs.log import Log
from excite.simulation.degradation.coloured_noise import first_order_noise
from excite.simulation.degradation.degradation import Degradation
from excite.simulation.degradation.friction_warming import warming
from excite.simulation.degradation.row_dropping import dropped_rows
from excite.simulation.degradation.row_holding import held_rows
from excite.simulation.degradation.stamp_jitter import late_stamps
from excite.simulation.degradation.torque_lag import lagging
from excite.simulation.settings import one_each
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.samples import Array

_NOISE, _HOLD, _CLOCK, _DROP = range(2, 6)  # streams of random numbers, so that one option changes nothing of another


@checked
def degrade(log: Log, degradation: Degradation, seed: int = 0, friction: Array | None = None) -> Log:
    """The log after all degradations; the same seed gives the same log.

    Parameters
    ----------
    log : Log
        Sampled regularly, such as that of a simulation.
    degradation : Degradation
    seed : int
    friction : ndarray, shape (N, n), optional
        Torque of friction in each row, such as ``simulation.run.friction``, for `friction_drift` [Nm or N].

    Raises
    ------
    InputError
        See `Degradation`; another number of joints, a step outside `clock_jitter`, or `friction_drift` without the
        friction.
    """
    return recorded(with_sensed_torques(log, degradation, seed, friction), degradation, seed)


def with_sensed_torques(log: Log, degradation: Degradation, seed: int = 0, friction: Array | None = None) -> Log:
    """The log with the degradations of its torques alone: see `degrade`."""
    if log.effort is None:
        return log
    n, effort = len(log.joints), log.effort
    if degradation.friction_drift:
        if friction is None:
            raise InputError("`friction_drift` needs the friction in each row; simulate with it")
        effort = effort + warming(log.time, degradation.friction_drift)[:, None] * friction
    effort = effort * np.array(one_each(degradation.torque_gain, n, "torque_gain"))
    if any(degradation.delay):
        effort = lagging(log.time, effort, one_each(degradation.delay, n, "delay"))
    if any(degradation.coloured_noise):
        deviation = one_each(degradation.coloured_noise, n, "coloured_noise")
        effort = effort + first_order_noise(log.time, deviation, degradation.noise_corner, _stream(seed, _NOISE))
    return replace(log, effort=effort)


def recorded(log: Log, degradation: Degradation, seed: int = 0) -> Log:
    """The log with the degradations of the recorder alone: see `degrade`."""
    if any(degradation.position_step):
        step = np.array(one_each(degradation.position_step, len(log.joints), "position_step"))
        whole = np.where(step > 0, step, 1.0)
        log = replace(log, q=np.where(step > 0, np.round(log.q / whole) * whole, log.q))
    for change in _of_rows(degradation, seed):
        log = change(log)
    return log


def _of_rows(degradation: Degradation, seed: int) -> Iterator[Callable[[Log], Log]]:
    if degradation.hold:
        yield lambda log: held_rows(log, degradation.hold, _stream(seed, _HOLD))
    if (between := degradation.clock_jitter) is not None:
        yield lambda log: late_stamps(log, between, _stream(seed, _CLOCK))
    if degradation.drop_rows:
        yield lambda log: dropped_rows(log, degradation.drop_rows, _stream(seed, _DROP))


def _stream(seed: int, number: int) -> np.random.Generator:
    return np.random.default_rng([seed, number])
