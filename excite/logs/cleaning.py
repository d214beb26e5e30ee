"""A log without the rows that were not measured when their stamps say, and with the times at which the others were.

- Held rows: the recorder wrote the values of the row before again, under a new time stamp, while the robot moved.
- Time stamps that jitter although the rows are evenly spaced, such as those of a host that received samples late.
- Wrong readings of positions, see `excite.logs.impacts`.
- Positions of revolute joints that wrap around at a whole turn, as encoders of 0 to 360 deg do, go on beyond it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from excite.logs.event import CLOCK, GARBAGE, HELD, RATE, Event
from excite.logs.excitation import mean_speed, moves, quantum, runs
from excite.logs.impacts import without_spikes
from excite.logs.log import Log
from regressors.robot.robot import Robot
from regressors.samples import Array, Index

# a log whose `removed` says what was left out, and what was found of the whole log: a rate, an uneven clock
Clean: TypeAlias = tuple[Log, tuple[Event, ...]]
_FEWEST = 3


def cleaned(log: Log, robot: Robot) -> Clean:
    """Leave out held rows and wrong readings of positions, and rebuild wrapped ones and the time where it jitters."""
    if log.count <= _FEWEST:
        return log, ()
    fresh, rates = without_held_rows(_without_wraps(log, robot))
    clocked, clocks = with_true_time(fresh)
    return without_spikes(clocked, robot), (*rates, *clocks)


_TURN = 2 * np.pi
_MOVED = 0.1  # of a turn, the most that a joint moves from one row to the next


def _without_wraps(log: Log, robot: Robot) -> Log:
    """The log with revolute joints that go on where they were read within one turn, within their limits if they can."""
    q = log.q.copy()
    for k, name in enumerate(log.joints):
        if name not in robot.joint_names or robot.joints[j := robot.joint_index(name)].unit != "rad":
            continue
        step, lower, upper = np.diff(q[:, k]), robot.limits.lower[j], robot.limits.upper[j]
        if np.ptp(q[:, k]) <= _TURN:
            q[1:, k] -= _TURN * np.cumsum(np.sign(step) * (np.abs(step) > (1 - _MOVED) * _TURN))
        ends = np.array([q[:, k].min(), q[:, k].max()])
        bounded = bool(np.isfinite(upper - lower))  # more than one turn off is another unit
        turns = _TURN * np.clip(np.round((ends.mean() - (lower + upper) / 2) / _TURN), -1, 1) if bounded else 0.0
        if not lower <= ends[0] <= ends[1] <= upper and lower <= ends[0] - turns <= ends[1] - turns <= upper:
            q[:, k] -= turns
    if not (wrapped := [name for name, moved in zip(log.joints, np.any(q != log.q, axis=0), strict=True) if moved]):
        return log
    note = f"{', '.join(wrapped)}: read within one turn, positions go on where they wrapped around"
    return replace(log, q=q, left_out=(*log.left_out, note))


_STEPS = 4.0  # of the encoder that a joint should have moved between two equal rows
_ROUNDING = 1e-9  # of the largest step of a joint: a smaller one is none
_SLOW = 0.05  # share of the steps that are taken for the smallest a joint makes
_CHANGING = 0.02  # a torque that is equal in two successive rows more often is too coarse to tell
_LEAST = 20  # held rows, or as many fresh ones, that show a rate
_STILL, _BEFORE, _JUMP = 3, 20, 2.0  # rows of a standstill, rows before it, times their steps
_EVEN = 1.5  # rows by which fresh ones may be off a straight line
_MOSTLY = 0.8


def without_held_rows(log: Log) -> Clean:
    """Leave out the rows that repeat the row before while the robot moves.

    Where fresh rows come at even intervals of two rows or more, or at even intervals in all, the values were updated
    more slowly than they were recorded: that is their rate, and no event.
    """
    held = held_rows(log)
    if not held.any():
        return log, ()
    if (rate := _slower_rate(log, held)) is None:
        return log.without(HELD, held), ()
    text = f"values were updated at {rate:.4g} Hz, rows recorded at {log.rate:.4g} Hz: {held.sum()} equal rows not used"
    return log.without(RATE, held), (_of_whole(log, RATE, log.time, text),)


def _of_whole(log: Log, kind: str, time: Array, text: str) -> Event:
    rows = int(log.row_numbers[0]), int(log.row_numbers[-1])
    return Event(kind, float(time[0]), float(time[-1]), rows, text, left_out=False)


def held_rows(log: Log) -> NDArray[np.bool_]:
    """Which rows have all positions, or all torques, or one hanging position, of the row before in motion, (N,).

    Or all of both of a row further back, as where rows come in another order than they were sent.
    """
    moving = np.any(moves(log), axis=1)
    still, caught_up = _long_runs(log)
    at_once = _held_positions(log) | _held_torques(log, moving)
    return np.asarray(caught_up | _hung_joints(log) | (moving & ~still & at_once) | _rows_again(log))


_BACK = 25  # rows


def _rows_again(log: Log) -> NDArray[np.bool_]:
    """Rows to which the robot jumps back: with all positions and torques of a row before the last one."""
    torque, again = log.effort if log.effort is not None else log.wrench, np.zeros(log.count, dtype=bool)
    if torque is None:
        return again
    values = np.column_stack([log.q, torque])
    for back in range(2, min(_BACK, log.count)):
        again[back:] |= np.all(values[back:] == values[:-back], axis=1)
    jumps = np.any(np.abs(np.diff(log.q, axis=0)) > _STEPS * _grain(log.q), axis=1)
    return np.asarray(again & np.concatenate([[False], jumps]))


def _equal(x: Array) -> NDArray[np.bool_]:
    return np.concatenate([[False], np.all(x[1:] == x[:-1], axis=1)])


def _long_runs(log: Log) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Rows of equal positions, three or more: of a standstill, left without a jump, or of a motion that it makes up."""
    still, caught_up = np.zeros(log.count, dtype=bool), np.zeros(log.count, dtype=bool)
    step, least = np.abs(np.diff(log.q, axis=0)), _STEPS * _grain(log.q)
    for a, b in runs(_equal(log.q)):
        if b - a >= _STILL:
            usual = np.median(step[max(0, a - _BEFORE) : a], axis=0)
            after = step[b - 1] if b < log.count else np.zeros_like(usual)
            jump = after > _JUMP * usual
            still[a:b] = not np.any(jump)
            caught_up[a:b] = np.any(jump & (usual > 0) & (after > least))
    return still, caught_up


_NEAR = 5  # rows on either side of a hang
_MADE_UP = 0.5  # share of the motion meanwhile that the jump at its end may be off


def _hung_joints(log: Log) -> NDArray[np.bool_]:
    """Rows in which one joint has three or more equal positions and then jumps by what it moved meanwhile."""
    hung, least = np.zeros(log.count, dtype=bool), _STEPS * _grain(log.q)
    for q, smallest in zip(log.q.T, least, strict=True):
        step = np.diff(q)
        for a, b in runs(_equal(q[:, None])):
            if b - a < _STILL or a <= _NEAR or b + _NEAR >= log.count:
                continue
            speeds = np.median(step[a - 1 - _NEAR : a - 1]), np.median(step[b : b + _NEAR])
            meanwhile = 0.5 * (speeds[0] + speeds[1]) * (b - a + 1)
            hung[a:b] |= abs(step[b - 1] - meanwhile) < _MADE_UP * abs(meanwhile) and abs(meanwhile) > smallest
    return hung


def _held_positions(log: Log) -> NDArray[np.bool_]:
    step = float(np.median(np.diff(log.time)))
    return np.asarray(_equal(log.q) & np.any(np.abs(mean_speed(log)) * step > _STEPS * _grain(log.q), axis=1))


def _grain(q: Array) -> Array:
    """Smallest step that each position makes, shape (n,); of coupled encoders it is more than that of its values."""
    steps = [step[step > _ROUNDING * step.max(initial=0.0)] for step in np.abs(np.diff(q, axis=0)).T]
    slow = [np.quantile(step, _SLOW) if step.size else 0.0 for step in steps]
    return np.maximum(quantum(q), slow)


def _held_torques(log: Log, moving: NDArray[np.bool_]) -> NDArray[np.bool_]:
    torque = log.effort if log.effort is not None else log.wrench
    if torque is None or torque.shape[1] < 2:  # one alone may be at its limit
        return np.zeros(log.count, dtype=bool)
    equal = _equal(torque)
    fresh = moving & ~equal
    if not equal.any() or not fresh[1:].any():
        return np.zeros(log.count, dtype=bool)
    unchanged = (np.diff(torque, axis=0) == 0)[fresh[1:]].mean(axis=0)
    return np.asarray(equal & bool(np.any(unchanged <= _CHANGING)))


def _slower_rate(log: Log, held: NDArray[np.bool_]) -> float | None:
    """Rate of the fresh rows, where they come at even intervals [Hz]."""
    moving = np.flatnonzero(np.any(moves(log), axis=1))
    part = slice(int(moving[0]), int(moving[-1]) + 1)
    fresh = np.flatnonzero(~held[part])
    if np.count_nonzero(held) < _LEAST or fresh.size < _LEAST:
        return None
    order, step = np.arange(fresh.size), np.diff(fresh)
    line, usual = np.polyval(np.polyfit(order, fresh, 1), order), int(np.median(step))
    if np.abs(fresh - line).max() <= _EVEN or (usual >= 2 and np.mean(step == usual) >= _MOSTLY):
        return float(log.rate * fresh.size / (part.stop - part.start))
    return None


_EVEN_STAMPS = 0.02  # of a step: stamps so even are right, or near enough
_HALF = 5  # rows on either side of a fit
_DEGREE = 3
_MOST_FITS = 4000
_FEWEST_FITS = 50
_BETTER_OVER_ROWS = 1.25
_LONG = 100  # rows over which the rate is judged


def with_true_time(log: Log) -> Clean:
    """Rebuild the time of a log whose rows are evenly spaced in truth, while its stamps are not.

    They are where cubics through eleven successive positions leave more than 1.25 times the residual over the stamps
    than over the numbers of the rows, in the median over the motion. The time is then a robust line through the stamps
    over the numbers, which jumps by whole steps where the stamps show for good that rows are missing.
    """
    if log.count < 4 * _LONG:
        return log, ()
    ticking = replace(log, numbers=_ticks(log))
    step = np.diff(log.time) / np.diff(ticking.row_numbers)
    if float(np.ptp(np.quantile(step, [0.05, 0.95]))) <= _EVEN_STAMPS * float(np.median(step)):
        return log, ()
    if (better := smoother_over_rows(ticking)) < _BETTER_OVER_ROWS:
        return log, ()
    time = even_time(ticking)
    jitter = float(np.std(log.time - time))
    rate = float(1.0 / np.median(np.diff(time) / np.diff(ticking.row_numbers)))
    text = (
        f"time stamps {1e3 * np.diff(log.time).min():.3g} to {1e3 * np.diff(log.time).max():.3g} ms apart jitter by "
        f"{1e3 * jitter:.2g} ms (standard deviation), but the rows were sampled evenly: positions are {better:.2g} "
        f"times smoother over row numbers; time rebuilt at {rate:.6g} Hz"
    )
    return replace(log, time=time), (_of_whole(log, CLOCK, time, text),)


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


_LEVEL = 50  # rows on either side of a shift of the stamps
_SHIFT = 0.5  # of a step, that the stamps are later from a row on
_BESIDE = 5  # rows before and behind the stamps' shift that are tried
_ABOUT = 6  # rows on either side of a fit
_BETTER_WITH = 1.5  # times smoother with the steps than without
_ROUGHER = 2.0  # times the usual residual, without them


def missed_steps(log: Log, step: float) -> Index:
    """Steps that passed without a row before each row, beyond those that the numbers of the rows leave out, shape (N,).

    Candidates are rows after which the stamps are later for good; a number of steps is believed where the positions
    about a row are smoother with them than without, by cubics.
    """
    numbers = log.row_numbers
    late = (log.time - log.time[0]) / step - (numbers - numbers[0])
    some = np.linspace(_LEVEL, log.count - _LEVEL - 1, min(500, log.count)).astype(np.intp)
    usual = float(np.median([_roughness(log, row, 0) for row in some]))
    missed = np.zeros(log.count, dtype=np.intp)
    shift = _shifts(late)
    for first, stop in runs(shift[_LEVEL : log.count - _LEVEL] > _SHIFT):
        row, stop = first + _LEVEL, stop + _LEVEL
        most = max(1, round(float(shift[row:stop].max())))
        where, steps = _best(log, range(row - _BESIDE, stop + _BESIDE), most, usual)
        missed[where + 1 :] += steps
    return missed


def _shifts(late: Array) -> Array:
    """By how many steps the stamps after each row are later than those up to it, shape (N,)."""
    level = scipy.ndimage.median_filter(late, _LEVEL, mode="nearest")
    half = _LEVEL // 2
    shift = np.zeros(late.size)
    shift[half : -half - 1] = level[2 * half + 1 :] - level[: -2 * half - 1]
    return shift


def _best(log: Log, rows: range, most: int, usual: float) -> tuple[int, int]:
    """Row after which steps are missing, and how many; none where the positions do not show it."""
    found, gain = (0, 0), _BETTER_WITH
    for row in rows:
        without = _roughness(log, row, 0)
        if without < _ROUGHER * usual:
            continue
        for steps in range(1, most + 2):
            better = without / max(_roughness(log, row, steps), np.finfo(float).tiny)
            if better > gain:
                found, gain = (row, steps), better
    return found


def _roughness(log: Log, row: int, steps: int) -> float:
    """What cubics over row numbers leave of the positions about a row, after which some steps are missing."""
    part = slice(max(0, row + 1 - _ABOUT), row + 1 + _ABOUT)
    x = log.row_numbers[part].astype(float) - float(log.row_numbers[row])
    x[x > 0] += steps
    basis = np.linalg.qr((x / np.abs(x).max())[:, None] ** np.arange(_DEGREE + 1))[0]
    q = log.q[part]
    return float(np.linalg.norm(q - basis @ (basis.T @ q)))
