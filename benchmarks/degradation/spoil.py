"""A simulated log as it would be after what spoils logs between the robot and the file; one simulation serves many."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from excite.logs.log import Log
from excite.simulation.sensors import sensed_torques, stepped
from excite.simulation.settings import SimulationSettings, one_each
from regressors.errors import InputError
from regressors.samples import Array

_HOLD, _CLOCK, _DROP = range(3, 6)  # streams of random numbers, so that one option changes nothing of another
_RECORDED = ("q", "dq", "effort", "temperature", "wrench")
_LOAD = 0.5  # of the long waits that the host could just catch up with


@dataclass(frozen=True)
class Degradation:
    """What happens to a log; nothing does by default.

    First come the torques: friction that drifts, a wrong gain, a delay, noise that is not white; then what the recorder
    does with whole rows: positions in steps, rows held, rows stamped late, rows dropped. Of one joint or all: `delay`,
    by which torques are recorded later than positions [s], and what is called as in `SimulationSettings`.
    """

    friction_drift: float = 0.0
    torque_gain: tuple[float, ...] = (1.0,)
    delay: tuple[float, ...] = (0.0,)
    coloured_noise: tuple[float, ...] = (0.0,)
    noise_corner: float = 5.0
    position_step: tuple[float, ...] = (0.0,)
    hold: float = 0.0  # share of the rows that repeat the numbers of the row before
    clock_jitter: tuple[float, float] | None = None  # shortest and longest time between two stamps [s]
    drop_rows: float = 0.0  # share of the rows that are missing


def degrade(log: Log, degradation: Degradation, seed: int = 0, friction: Array | None = None) -> Log:
    """The log after all degradations; the same seed gives the same log.

    ``friction`` is its torque in each row, such as ``simulation.run.friction``, for `friction_drift` [Nm or N].
    """
    d = degradation
    if log.effort is not None:
        log = replace(log, effort=_torques(log, log.effort, d, seed, friction))
    log = replace(log, q=stepped(log.q, d.position_step))
    if d.hold:
        log = held_rows(log, d.hold, np.random.default_rng([seed, _HOLD]))
    if d.clock_jitter is not None:
        log = late_stamps(log, d.clock_jitter, np.random.default_rng([seed, _CLOCK]))
    if d.drop_rows:
        log = dropped_rows(log, d.drop_rows, np.random.default_rng([seed, _DROP]))
    return log


def _torques(log: Log, effort: Array, d: Degradation, seed: int, friction: Array | None) -> Array:
    """Torques with drift and gain, as they were ``delay`` before their row, and with slow noise."""
    if d.friction_drift and friction is None:
        raise InputError("`friction_drift` needs the friction in each row; simulate with it")
    none = np.zeros_like(effort)
    gained = SimulationSettings(friction_drift=d.friction_drift, torque_gain=d.torque_gain)
    effort = sensed_torques(log.time, effort, none if friction is None else friction, gained)
    delay = one_each(d.delay, len(log.joints), "delay")
    if any(delay):  # before the first row they are those of it
        effort = np.column_stack(
            [np.interp(log.time - late, log.time, column) for late, column in zip(delay, effort.T, strict=True)]
        )
    noisy = SimulationSettings(coloured_noise=d.coloured_noise, noise_corner=d.noise_corner, seed=seed)
    return sensed_torques(log.time, effort, none, noisy)


def held_rows(log: Log, share: float, rng: np.random.Generator) -> Log:
    """The same log, a share of whose rows repeat the numbers of the row before under their own stamps."""
    last = np.arange(log.count)
    last[1 + rng.choice(log.count - 1, round(share * (log.count - 1)), replace=False)] = 0
    return _with_rows(log, log.time, np.maximum.accumulate(last))


def late_stamps(log: Log, between: tuple[float, float], rng: np.random.Generator) -> Log:
    """The same rows, stamped late: ``t_k + w_k``, with ``w_k = max(w_{k-1} - (step - shortest), e_k)``.

    A host reads rows that were sampled regularly from a buffer. Most rows wait a little, ``e_k`` uniform up to
    ``step - shortest``; a few wait until ``longest`` after the one before, and the rows behind them are read at the
    host's fastest, ``shortest`` apart, until it has caught up.
    """
    shortest, longest = between
    step = log.duration / max(log.count - 1, 1)
    if not 0 < shortest < step < longest:
        raise InputError(f"rows are sampled every {step:g} s, expected between {shortest:g} and {longest:g} s")
    gain, late = step - shortest, longest - step
    share = _LOAD * gain / (gain + late / 2)
    waits = np.where(rng.random(log.count) < share, rng.uniform(0, late, log.count), rng.uniform(0, gain, log.count))
    row = np.arange(log.count) * gain
    return replace(log, time=log.time + np.maximum.accumulate(waits + row) - row)


def dropped_rows(log: Log, share: float, rng: np.random.Generator) -> Log:
    """The same log without a share of its rows, never the first or the last."""
    lost = 1 + rng.choice(log.count - 2, round(share * (log.count - 2)), replace=False)
    kept = np.setdiff1d(np.arange(log.count), lost)
    return _with_rows(log, log.time[kept], kept)


def _with_rows(log: Log, time: Array, rows: np.ndarray[Any, Any]) -> Log:
    """The log with the numbers of other rows under given stamps."""
    channels: dict[str, Any] = {
        name: channel[rows] for name in _RECORDED if (channel := getattr(log, name)) is not None
    }
    return replace(log, time=time, **channels)
