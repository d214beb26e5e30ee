"""Motion of an identified model under measured torques, against the measured motion [KD96] Figs. 15, 16.

``M(q) ddq = tau - b(q, dq) - C' f(C dq)`` with ``Y beta = M ddq + b``, hence ``M = d(Y beta) / d ddq``. Such an
open-loop motion drifts away from the measured one; restarting it from the measured state after each horizon keeps the
errors readable.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cache

import numpy as np
from numpy.typing import NDArray

from excite.simulation.integration import rk4_step
from excite.simulation.plant import ModelMotion, Rate
from regressors.errors import InputError
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array, Index

_REACH = 1.5  # of substep times fastest rate; the method is stable up to 2.78
_FEW_SUBSTEPS, _MOST_SUBSTEPS = 4, 20
_WIDER = 1.5  # a width of the sign, over the one before it
_FAR = 1e3  # rad or m: beyond this a motion counts as diverged


class Outcome(Enum):
    """How a replay ended."""

    DONE = "the whole motion was integrated"
    NOT_POSITIVE = "the mass matrix of the estimate is not positive definite, so no real robot has it"  # as measured
    RAN_AWAY = "the motion diverges"


@dataclass(frozen=True, eq=False)
class Replay:
    """Motion under measured torques."""

    outcome: Outcome  # of the first window that failed, if one did
    time: Array  # (N,) [s]
    # (N, n) [rad, rad/s, or with m]; NaN from where a window failed until the next one starts, and between windows
    q: Array
    dq: Array  # (N, n)
    starts: tuple[int, ...]  # indices at which a window starts from the given state
    stops: tuple[int, ...]  # index before which each window ends
    failed_at: float | None  # first instant at which a window failed [s]
    sign_width: float  # drive velocity over which friction changed its sign [rad/s or m/s]
    left_out: int = 0  # windows that were not simulated, since the motion has more than were asked for

    @property
    def bounds(self) -> tuple[tuple[int, int], ...]:
        """First index of every window, and the one after its last."""
        return tuple(zip(self.starts, self.stops, strict=True))

    @property
    def rows(self) -> Index | slice:
        """Instants that windows cover."""
        if not self.left_out:
            return slice(None)
        return np.concatenate([np.arange(first, stop) for first, stop in self.bounds])

    @property
    def ok(self) -> bool:
        """True if the whole motion was integrated."""
        return self.outcome is Outcome.DONE


def windowed_motion(
    model: RegressorModel,
    beta: Array,
    base: Base,
    time: Array,
    torque: Array,
    q: Array,
    dq: Array,
    horizon: float,
    *,
    friction: FrictionCurves | None = None,
    sign_width: float | None = None,
    most: int | None = None,
) -> Replay:
    """Motion under measured joint torques, restarted from the measured state after each horizon."""  # q, dq (N, n)
    step = _step(time)
    if not (np.isfinite(horizon) and round(horizon / step) >= 1):
        raise InputError(f"replay: a horizon of {horizon:g} s is shorter than a sample of {step:g} s")
    if np.shape(q) != np.shape(dq) or len(q) != time.size:
        raise InputError(f"replay: {time.size} instants, but q of shape {np.shape(q)} and dq of shape {np.shape(dq)}")
    rates = ModelMotion(model, beta, base, friction)
    n = rates.robot.n
    if torque.shape != (time.size, n) or np.shape(q)[1:] != (n,):
        raise InputError(
            f"replay: expected torques of shape {(time.size, n)} and states of {n} joints, given {torque.shape}, "
            f"{np.shape(q)[1:]} and {np.shape(dq)[1:]}"
        )
    starts = np.arange(0, max(time.size - 1, 1), round(horizon / step))
    begin, speed = np.asarray(q, float)[starts], np.asarray(dq, float)[starts]
    states = np.hstack([rates.to_moving(begin, True), rates.to_moving(speed, False)])
    substeps, width = _substeps(rates, states, step, sign_width)
    chosen, rate = chosen_windows(starts.size, starts.size if most is None else most), rates.function(width)
    length, ends = int(np.diff(np.append(starts, time.size - 1)).max()), np.append(starts[1:], time.size)
    begun, stops = tuple(starts[chosen].tolist()), tuple(ends[chosen].tolist())
    inputs = _inputs(torque @ rates.N, begun, length, substeps)
    integrated, least = _integrated(rate, states[chosen], inputs, length, step / substeps, substeps)
    whole = np.concatenate([states[chosen][:, None], integrated], axis=1)
    motion, failures = _joined(time.size, begun, stops, whole, least)
    left_out = np.setdiff1d(np.arange(len(states)), chosen)
    failures += [(int(starts[k]), Outcome.NOT_POSITIVE) for k in left_out[~_positive(rate, states[left_out])]]
    at, outcome = min(failures, key=lambda failure: failure[0], default=(0, Outcome.DONE))
    return Replay(
        outcome=outcome,
        time=time,
        q=motion[:, : rates.k] @ rates.N.T + rates.q0,
        dq=motion[:, rates.k :] @ rates.N.T,
        starts=begun,
        failed_at=float(time[at]) if failures else None,
        sign_width=width,
        stops=stops,
        left_out=left_out.size,
    )


def _step(time: Array) -> float:
    if time.size < 2:
        raise InputError(f"replay needs two instants or more, given {time.size}")
    step = float(time[-1] - time[0]) / (time.size - 1)
    if not step > 0 or float(np.abs(np.diff(time) - step).max()) > 1e-6 * step:
        raise InputError("replay needs uniform sample times: resample first")
    return step


def _substeps(rates: ModelMotion, states: Array, step: float, width: float | None) -> tuple[int, float]:
    """Steps per sample, and the width of the sign: the given one, or the narrowest that a few steps allow."""
    probes = states[:: max(1, len(states) // 20)]
    if width is not None:
        if not width > 0:
            raise InputError(f"replay: sign_width must be greater than zero, given {width:g}")
        needed = int(np.ceil(max(rates.fastest(probes, width) * step / _REACH, 1.0)))
        if needed > _MOST_SUBSTEPS:
            raise InputError(
                f"replay: sign_width {width:g} needs {needed} steps per sample of {step:g} s, more than "
                f"{_MOST_SUBSTEPS}; expected about {width * needed / _MOST_SUBSTEPS:.2g} or more"
            )
        return needed, width
    widths = (1e-3 * _WIDER ** np.arange(31)).tolist()
    needs = cache(lambda k: rates.fastest(probes, widths[k]) * step / _REACH)
    narrow, wide, k = -1, len(widths) - 1, 4  # too narrow and wide enough; what friction needs falls like 1 / width
    while wide - narrow > 1:
        narrow, wide = (narrow, k) if needs(k) <= _FEW_SUBSTEPS else (k, wide)
        k = int(np.clip(k + np.ceil(np.emath.logn(_WIDER, max(needs(k), 1e-9) / _FEW_SUBSTEPS)), narrow + 1, wide - 1))
    return min(int(np.ceil(max(needs(wide), 1.0))), _MOST_SUBSTEPS), widths[wide]


def _inputs(torque: Array, starts: tuple[int, ...], length: int, substeps: int) -> Array:
    """Torques at steps and half steps, shape (k, windows * length * (2 substeps + 1)); beyond the end, the last."""
    fine = _refined(torque, np.array(starts)[:, None] + np.arange(length + 1), 2 * substeps)
    inputs = np.concatenate([fine[:, :-1], fine[:, 1:, :1]], axis=2)
    return np.asarray(inputs.reshape(-1, torque.shape[1]).T)


def _refined(values: Array, rows: Index, parts: int) -> Array:
    """Values at rows and between, ``parts`` times as fine, shape (*rows, parts, k), by cubics (Catmull and Rom)."""
    padded = np.vstack([2 * values[:1] - values[1:2], values, 2 * values[-1:] - values[-2:-1]])
    at = np.minimum(rows, len(values) - 2)
    before, start, end, after = (padded[at + k] for k in range(4))
    s = (np.arange(parts) / parts)[:, None]
    slope, curve = ((end - before) / 2)[..., None, :], ((2 * before - 5 * start + 4 * end - after) / 2)[..., None, :]
    cubic = ((3 * (start - end) + after - before) / 2)[..., None, :]
    fine = start[..., None, :] + s * (slope + s * (curve + s * cubic))
    fine[rows > at] = values[-1]
    return np.asarray(fine)


def _integrated(rate: Rate, x0: Array, inputs: Array, length: int, h: float, substeps: int) -> tuple[Array, Array]:
    """States after each sample, shape (windows, length, 2k), and smallest pivots before it, (windows, length)."""
    # x0 (windows, 2k); inputs (k, windows * length * (2 substeps + 1))
    states, least = np.empty((length, *x0.T.shape)), np.empty((length, len(x0)))
    given = inputs.reshape(len(inputs), len(x0), length, -1).transpose(2, 0, 3, 1)
    pivots: list[Array] = []

    def motion(state: Array, torque: Array) -> Array:
        moved, pivot = rate(state, torque)
        pivots.append(pivot)
        return moved

    x = x0.T
    with np.errstate(all="ignore"):  # a window that diverges
        for k, torque in enumerate(given):
            pivots.clear()
            states[k] = x = rk4_step(motion, x, torque, h, substeps)
            least[k] = pivots[0]
    return states.transpose(2, 0, 1), least.T


def _positive(rate: Rate, states: Array) -> NDArray[np.bool_]:
    """Whether the mass matrix is positive definite at some states, shape (N, 2k)."""
    if not len(states):
        return np.ones(0, dtype=bool)
    return rate(states.T, np.zeros((states.shape[1] // 2, len(states))))[1] > 0


def _joined(
    count: int, starts: tuple[int, ...], stops: tuple[int, ...], states: Array, least: Array
) -> tuple[Array, list[tuple[int, Outcome]]]:
    """Join the windows up to failures; `states`, (windows, length + 1, 2k), begin with the given ones."""
    motion = np.full((count, states.shape[2]), np.nan)
    failures: list[tuple[int, Outcome]] = []
    for first, stop, window, pivots in zip(starts, stops, states, least, strict=True):
        length = min(len(window), count - first)
        lost = ~np.all(np.abs(window[:length]) < _FAR, axis=1)
        lost[1:] |= ~(pivots[: length - 1] > 0)
        good = length
        if np.any(lost):
            good = int(np.argmax(lost))
            measured = not pivots[0] > 0  # only the first pose of a window is one that the robot had
            failures.append((first, Outcome.NOT_POSITIVE) if measured else (first + good, Outcome.RAN_AWAY))
        kept = np.arange(stop - first) < max(good, 1)
        motion[first:stop] = np.where(kept[:, None], window[: stop - first], np.nan)
    return motion, failures


_GOLDEN = (np.sqrt(5) - 1) / 2


def chosen_windows(count: int, most: int) -> Index:
    """Windows to simulate, one in each of as many equal stretches of the motion.

    The place within the k-th stretch is the fractional part of ``k (sqrt(5) - 1) / 2``, of which any sequence is spread
    evenly over 0 to 1: at equal distances, windows of a motion that repeats itself would all see the same part of it.
    """
    if count <= most:
        return np.arange(count)
    edges = np.arange(most + 1) * count // most
    place = np.arange(most) * _GOLDEN % 1.0
    return np.asarray(edges[:-1] + (place * np.diff(edges)).astype(int))
