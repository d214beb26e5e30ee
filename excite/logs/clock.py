"""Time stamps that jitter although the rows are evenly spaced, such as those of a host that received samples late."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from excite.logs.event import CLOCK, GARBAGE, Event
from excite.logs.excitation import moves
from excite.logs.gaps import missed_steps
from excite.logs.log import Log
from regressors.samples import Array, Index

_EVEN = 0.02  # of a step: stamps so even are right, or near enough
_HALF = 5  # rows on either side of a fit
_DEGREE = 3
_MOST_FITS = 4000
_FEWEST_FITS = 50
_BETTER = 1.25
_LONG = 100  # rows over which the rate is judged


@dataclass(frozen=True, eq=False)
class Clocked:
    """A log with the times at which its rows were sampled."""

    log: Log
    events: tuple[Event, ...] = ()  # that the time was rebuilt; none where the stamps were kept


def with_true_time(log: Log) -> Clocked:
    """Rebuild the time of a log whose rows are evenly spaced in truth, while its stamps are not.

    They are where cubics through eleven successive positions leave more than 1.25 times the residual over the stamps
    than over the numbers of the rows, in the median over the motion. The time is then a robust line through the stamps
    over the numbers, which jumps by whole steps where the stamps show for good that rows are missing.
    """
    if log.count < 4 * _LONG:
        return Clocked(log)
    ticking = replace(log, numbers=_ticks(log))
    step = np.diff(log.time) / np.diff(ticking.row_numbers)
    if float(np.ptp(np.quantile(step, [0.05, 0.95]))) <= _EVEN * float(np.median(step)):
        return Clocked(log)
    better = smoother_over_rows(ticking)
    if better < _BETTER:
        return Clocked(log)
    time = even_time(ticking)
    jitter = float(np.std(log.time - time))
    rate = float(1.0 / np.median(np.diff(time) / np.diff(ticking.row_numbers)))
    text = (
        f"time stamps {1e3 * np.diff(log.time).min():.3g} to {1e3 * np.diff(log.time).max():.3g} ms apart jitter by "
        f"{1e3 * jitter:.2g} ms (standard deviation), but the rows were sampled evenly: positions are {better:.2g} "
        f"times smoother over row numbers; time rebuilt at {rate:.6g} Hz"
    )
    rows = int(log.row_numbers[0]), int(log.row_numbers[-1])
    event = Event(CLOCK, float(time[0]), float(time[-1]), rows, text, left_out=False)
    return Clocked(replace(log, time=time), (event,))


def _ticks(log: Log) -> Index:
    """Numbers of the rows without lines that hold none, for which no sample need have been taken."""
    garbage = [part.numbers for part in log.removed if part.kind == GARBAGE]
    lines = np.sort(np.concatenate(garbage)) if garbage else np.zeros(0, dtype=np.intp)
    return np.asarray(log.row_numbers - np.searchsorted(lines, log.row_numbers))


def smoother_over_rows(log: Log) -> float:
    """How many times smoother the positions are over the numbers of the rows than over their time stamps."""
    moving = np.any(moves(log), axis=1)
    centres = np.flatnonzero(moving[_HALF:-_HALF]) + _HALF
    centres = centres[:: max(1, centres.size // _MOST_FITS)]
    if centres.size < _FEWEST_FITS:
        return 1.0
    window = centres[:, None] + np.arange(-_HALF, _HALF + 1)
    q = log.q[window]  # (k, 11, n)
    over_time, over_rows = (_residual(x[window], q) for x in (log.time, log.row_numbers.astype(float)))
    return float(np.median(over_time) / max(float(np.median(over_rows)), np.finfo(float).tiny))


def _residual(x: Array, q: Array) -> Array:
    """Size of what cubics in x leave of q, shape (k,)."""
    centred = x - x.mean(axis=1, keepdims=True)
    powers = (centred / np.abs(centred).max(axis=1, keepdims=True))[..., None] ** np.arange(_DEGREE + 1)
    basis = np.linalg.qr(powers)[0]
    left = q - basis @ (basis.transpose(0, 2, 1) @ q)
    return np.asarray(np.sqrt(np.sum(left**2, axis=(1, 2))))


def even_time(log: Log) -> Array:
    """Times on a robust line through time stamps over row numbers, with the steps that passed without a row [s]."""
    stamps, numbers = log.time, log.row_numbers
    step = float(np.median((stamps[_LONG:] - stamps[:-_LONG]) / (numbers[_LONG:] - numbers[:-_LONG])))
    return _line((numbers + missed_steps(log, step)).astype(float), stamps)


def _line(x: Array, y: Array) -> Array:
    """Robust line through points, by least squares with Huber's weights."""
    weight = np.ones(x.size)
    for _ in range(20):
        line = np.polynomial.Polynomial.fit(x, y, 1, w=np.sqrt(weight))
        left = y - line(x)
        scale = 1.4826 * float(np.median(np.abs(left - np.median(left)))) + np.finfo(float).tiny
        weight = np.minimum(1.0, 1.5 * scale / np.maximum(np.abs(left), np.finfo(float).tiny))
    return np.asarray(line(x))
