"""Motion of an identified model under measured torques, as compared with the measured motion in [KD96] Fig. 17.

``M(q) ddq = tau - b(q, dq) - C' f(C dq)`` with ``Y beta = M ddq + b``, hence ``M = d(Y beta) / d ddq``. Such an
open-loop motion drifts away from the measured one; restarting it from the measured state after each horizon keeps the
errors readable.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import casadi as ca
import numpy as np

from excite.simulation.integration import rk4_step
from excite.simulation.model_motion import ModelMotion
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.samples import Array

_REACH = 1.5  # of substep times fastest rate; the method is stable up to 2.78
_MOST_SUBSTEPS = 20
_FAR = 1e3  # rad or m: beyond this a motion counts as diverged


class Outcome(Enum):
    """How a replay ended."""

    DONE = "the whole motion was integrated"
    NOT_POSITIVE = "the mass matrix of the estimate is not positive definite, so no real robot has it"
    RAN_AWAY = "the motion diverges"


@dataclass(frozen=True, eq=False)
class Replay:
    """Motion under measured torques.

    Parameters
    ----------
    outcome : Outcome
        Outcome of the first window that failed, if one did.
    time : ndarray, shape (N,)
        [s]
    q, dq : ndarray, shape (N, n)
        [rad, rad/s, or with m]; NaN from where a window failed until the next one starts.
    starts : tuple of int
        Indices at which a window starts from the given state.
    failed_at : float or None
        First instant at which a window failed [s].
    sign_width : float
        Drive velocity over which friction changed its sign [rad/s or m/s].
    """

    outcome: Outcome
    time: Array
    q: Array
    dq: Array
    starts: tuple[int, ...]
    failed_at: float | None
    sign_width: float

    @property
    def ok(self) -> bool:
        """True if the whole motion was integrated."""
        return self.outcome is Outcome.DONE


def forward_motion(
    model: RegressorModel,
    beta: Array,
    base: Base,
    time: Array,
    torque: Array,
    q0: Array,
    dq0: Array,
    *,
    friction: FrictionCurves | None = None,
    sign_width: float | None = None,
) -> Replay:
    """Motion under measured joint torques from one initial state.

    Parameters
    ----------
    model : RegressorModel
        A differential model, or its restriction to a partial motion.
    beta : ndarray, shape (b,)
        Estimated base parameters.
    base : Base
        Base of the model.
    time : ndarray, shape (N,)
        Uniform [s].
    torque : ndarray, shape (N, n)
        Measured joint torques [Nm or N], interpolated by cubics.
    q0, dq0 : ndarray, shape (n,)
        Position and velocity at the first instant [rad, rad/s, or with m].
    friction : FrictionCurves, optional
        Curves that were subtracted from the torques when beta was estimated.
    sign_width : float, optional
        Drive velocity over which friction changes its sign [rad/s or m/s]; chosen so that the steps are stable if not
        given.

    Returns
    -------
    Replay
        A failure is reported by its outcome, not raised.

    Raises
    ------
    InputError
        Another kind of model, shapes that do not fit, times that are not uniform, or a sign width too small.
    """
    q, dq = (np.asarray(x, dtype=float)[None] for x in (q0, dq0))
    return _replayed(ModelMotion(model, beta, base, friction), time, torque, q, dq, (0,), sign_width)


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
) -> Replay:
    """Motion under measured joint torques, restarted from the measured state after each horizon.

    Parameters
    ----------
    model, beta, base, time, torque, friction, sign_width
        See `forward_motion`.
    q, dq : ndarray, shape (N, n)
        Measured position and velocity [rad, rad/s, or with m].
    horizon : float
        Length of a window, at least one sample [s].

    Returns
    -------
    Replay

    Raises
    ------
    InputError
        See `forward_motion`, or a horizon that is shorter than a sample.
    """
    step = _step(time)
    if not (np.isfinite(horizon) and round(horizon / step) >= 1):
        raise InputError(f"replay: a horizon of {horizon:g} s is shorter than a sample of {step:g} s")
    starts = tuple(range(0, max(time.size - 1, 1), round(horizon / step)))
    if np.shape(q) != np.shape(dq) or len(q) != time.size:
        raise InputError(f"replay: {time.size} instants, but q of shape {np.shape(q)} and dq of shape {np.shape(dq)}")
    at, rates = list(starts), ModelMotion(model, beta, base, friction)
    return _replayed(rates, time, torque, np.asarray(q, float)[at], np.asarray(dq, float)[at], starts, sign_width)


def _step(time: Array) -> float:
    if time.size < 2:
        raise InputError(f"replay needs two instants or more, given {time.size}")
    step = float(time[-1] - time[0]) / (time.size - 1)
    if not step > 0 or float(np.abs(np.diff(time) - step).max()) > 1e-6 * step:
        raise InputError("replay needs uniform sample times: resample first")
    return step


def _replayed(
    rates: ModelMotion, time: Array, torque: Array, q: Array, dq: Array, starts: tuple[int, ...], width: float | None
) -> Replay:
    n, step = rates.robot.n, _step(time)
    if torque.shape != (time.size, n) or q.shape[1:] != (n,) or dq.shape != q.shape:
        raise InputError(
            f"replay: expected torques of shape {(time.size, n)} and states of {n} joints, given {torque.shape}, "
            f"{q.shape[1:]} and {dq.shape[1:]}"
        )
    x0 = np.hstack([rates.to_moving(q, True), rates.to_moving(dq, False)])
    substeps, width = _substeps(rates, x0, step, width)
    length = max(np.diff([*starts, time.size - 1]))
    inputs = _inputs(torque @ rates.N, starts, int(length), substeps)
    integrated, least = _integrated(rates.function(width), x0, inputs, int(length), step / substeps, substeps)
    states = np.concatenate([x0[:, None], integrated], axis=1)
    return _result(rates, time, starts, states, least, width)


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
    width = 1e-3
    for _ in range(30):
        needed = int(np.ceil(max(rates.fastest(probes, width) * step / _REACH, 1.0)))
        if needed <= 4:
            break
        width *= 1.5
    return min(needed, _MOST_SUBSTEPS), width


def _inputs(torque: Array, starts: tuple[int, ...], length: int, substeps: int) -> Array:
    """Torques at steps and half steps, shape (k, windows * length * (2 substeps + 1)); beyond the end, the last."""
    fine = _refined(torque, 2 * substeps)
    first = np.array(starts)[:, None, None] + np.arange(length)[None, :, None]
    index = first * 2 * substeps + np.arange(2 * substeps + 1)
    return np.asarray(fine[np.minimum(index, len(fine) - 1).reshape(-1)].T)


def _refined(values: Array, parts: int) -> Array:
    """Values on a grid ``parts`` times as fine: cubics through two samples on either side (Catmull and Rom)."""
    padded = np.vstack([2 * values[:1] - values[1:2], values, 2 * values[-1:] - values[-2:-1]])
    before, start, end, after = padded[:-3], padded[1:-2], padded[2:-1], padded[3:]
    s = (np.arange(parts) / parts)[None, :, None]
    slope, curve = (end - before)[:, None] / 2, (2 * before - 5 * start + 4 * end - after)[:, None] / 2
    cubic = (3 * (start - end) + after - before)[:, None] / 2
    fine = start[:, None] + s * (slope + s * (curve + s * cubic))
    return np.vstack([fine.reshape(-1, values.shape[1]), values[-1:]])


def _integrated(
    rate: ca.Function, x0: Array, inputs: Array, length: int, h: float, substeps: int
) -> tuple[Array, Array]:
    """States after each sample, shape (windows, length, 2k), and smallest pivots before it, (windows, length)."""
    k = rate.size1_in(1)
    x, tau = ca.MX.sym("x", 2 * k), ca.MX.sym("tau", k, 2 * substeps + 1)
    advanced = rk4_step(lambda state, given: rate(state, given)[0], x, tau, h, substeps)
    step = ca.Function("step", [x, tau], [advanced, rate(x, tau[:, 0])[1]])
    windows = step.mapaccum("window", length).map(len(x0))
    states, least = windows(x0.T, inputs)
    return np.array(states).T.reshape(len(x0), length, 2 * k), np.array(least).reshape(len(x0), length)


def _result(
    rates: ModelMotion, time: Array, starts: tuple[int, ...], states: Array, least: Array, width: float
) -> Replay:
    """Join the windows up to failures; `states`, (windows, length + 1, 2k), begin with the given ones."""
    motion = np.full((time.size, 2 * rates.k), np.nan)
    failures: list[tuple[int, Outcome]] = []
    for first, window, pivots in zip(starts, states, least, strict=True):
        count = min(len(window), time.size - first)
        lost = ~np.all(np.abs(window[:count]) < _FAR, axis=1)
        not_positive = ~(pivots[: count - 1] > 0)
        good = count
        if np.any(lost) or np.any(not_positive):
            good = min(int(np.argmax(failed)) if np.any(failed) else count for failed in (lost, not_positive))
            failures.append(
                (first + good, Outcome.NOT_POSITIVE if np.any(not_positive[: good + 1]) else Outcome.RAN_AWAY)
            )
        motion[first : first + count] = np.where(np.arange(count)[:, None] < max(good, 1), window[:count], np.nan)
    at, outcome = min(failures, key=lambda failure: failure[0], default=(0, Outcome.DONE))
    return Replay(
        outcome=outcome,
        time=time,
        q=motion[:, : rates.k] @ rates.N.T + rates.q0,
        dq=motion[:, rates.k :] @ rates.N.T,
        starts=starts,
        failed_at=float(time[at]) if failures else None,
        sign_width=width,
    )
