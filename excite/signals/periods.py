"""Average over the periods of a periodic motion, and the noise about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.interpolate

from excite.logs.log import Log
from excite.signals.cut import check_positive
from excite.signals.method import spacing
from excite.signals.period import ALIKE, estimated_period
from regressors.errors import InputError
from regressors.samples import Array

_WHOLE = 1e-3  # of a sample
_LEAST_MOTION = 0.1  # of that of the joint that moves most
_CHANNELS = ("q", "dq", "effort", "wrench", "temperature")


@dataclass(frozen=True, eq=False)
class Averaged:
    """Mean of the periods of a log."""

    log: Log  # one period, at the times of the first
    # (columns,) per channel of the log the standard deviation of one sample about the mean; that of the mean itself
    # is less by ``sqrt(periods)`` [unit of the channel]
    noise: dict[str, Array]
    periods: int
    period: float  # [s]
    note: str  # assumptions and results


def average_periods(log: Log, period: float | None = None, tolerance: float = ALIKE) -> Averaged:
    """Mean over the whole periods of a log.

    With x_k(t) the sample at phase t of period k of K, the mean is ``m(t) = sum_k x_k(t) / K`` and the noise
    ``s^2 = sum_{k,t} (x_k(t) - m(t))^2 / (M (K - 1))`` over the M phases.
    """
    check_positive("averaging", period=period, tolerance=tolerance)
    h = spacing(log.time, "averaging", 16)
    length = estimated_period(log.time, log.q) if period is None else period
    count = int((log.count + 0.5) * h / length)
    if count < 2:
        raise InputError(
            f"{log.source}: {log.count * h:.4g} s hold {count} periods of {length:.4g} s; expected 2 or more"
        )
    stacked = _stacked(log, h, length, count)
    means: dict[str, Any] = {name: x.mean(axis=0) for name, x in stacked.items()}
    noise = {
        name: np.sqrt(np.sum((x - means[name]) ** 2, axis=(0, 1)) / (x.shape[1] * (count - 1)))
        for name, x in stacked.items()
    }
    _check_periodic(log, length, means["q"], noise["q"], tolerance)
    samples = means["q"].shape[0]
    rest = log.count - round(count * length / h)
    mean = Log(
        log.source,
        log.sha256,
        log.joints,
        log.time[0] + np.arange(samples) * (length / samples),
        **means,
        left_out=(*log.left_out, *((f"{rest} rows after the last whole period",) if rest > 0 else ())),
    )
    step = f"mean of {count} periods of {length:.6g} s ({'estimated' if period is None else 'given'})"
    return Averaged(mean, noise, count, length, step)


def _stacked(log: Log, h: float, length: float, count: int) -> dict[str, Array]:
    """Per channel the periods, shape (K, M, columns); interpolated where a period is not a whole number of samples."""
    channels = {name: x for name in _CHANNELS if (x := getattr(log, name)) is not None}
    samples = round(length / h)
    if abs(length / h - samples) * count <= _WHOLE:
        return {name: x[: count * samples].reshape(count, samples, -1) for name, x in channels.items()}
    time = log.time[0] + (np.arange(count)[:, None] + np.arange(samples) / samples) * length
    time = np.minimum(time, log.time[-1])
    return {name: np.asarray(scipy.interpolate.CubicSpline(log.time, x, axis=0)(time)) for name, x in channels.items()}


def _check_periodic(log: Log, length: float, mean: Array, noise: Array, tolerance: float) -> None:
    motion = mean.std(axis=0)
    share = noise / np.maximum(motion, max(_LEAST_MOTION * motion.max(), np.finfo(float).tiny))
    worst = int(np.argmax(share))
    if share[worst] > tolerance:
        raise InputError(
            f"{log.source}: not periodic with {length:.6g} s: {log.joints[worst]} differs by {noise[worst]:.3g} from "
            f"period to period, {100 * share[worst]:.2g} % of its motion; at most {100 * tolerance:g} % are allowed"
        )
