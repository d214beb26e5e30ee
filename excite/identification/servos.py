"""Servos identified from what was commanded and what was measured: known masses take the place of torques.

The linear form of `regressors.models.servo` gives values to start from; then the response of each servo, simulated
over windows that begin as measured, is fitted to the measured positions. Residuals that stand out, such as those of an
arm that touched something, count less. Intervals are from the scatter between windows.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy
from threadpoolctl import threadpool_limits

from excite.identification.estimator import CONFIDENCE
from excite.identification.procedure import LogLike, read_logs
from excite.identification.result import provenance_of
from excite.identification.servo_result import ServoResult, motion_fits
from excite.identification.servo_windows import (
    Places,
    ServoMotion,
    moves,
    servo_motion,
    start_values,
    windows_in,
    windows_of,
)
from excite.logs.log import Log
from excite.logs.mapping import LogMapping
from excite.tasks.installation import Installation
from excite.tasks.robot_of_task import robot_and_task
from regressors.arguments import checked
from regressors.errors import listed_names
from regressors.models.servo import ServoModel
from regressors.models.servo_response import COARSE, QUANTITIES, SYMBOLS, Windows, arm_torques, response
from regressors.numerical import numerical_work
from regressors.quantities import Tips
from regressors.robot.robot import Robot
from regressors.samples import Array


@checked
@numerical_work(
    "the identification of the servos",
    "commands and positions of very different sizes are the likely cause: check the units of the logs",
)
def identify_servos(
    robot: Robot | str,
    logs: LogLike | Sequence[LogLike],
    /,
    *,
    mapping: LogMapping | str | Path | None = None,
    drop: Iterable[str] = (),
    base_link: str | None = None,
    tip: Tips = None,
    snap_angles: bool = True,
    xacro: bool = False,
    installation: Installation | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> ServoResult:
    """Identify position-controlled servos from commanded and measured positions.

    Parameters
    ----------
    robot : Robot or str
        The arm, whose masses are known: they set the scale of all torques.
    logs : Log, frame, dict of columns, path, or a sequence of them
        With commanded positions.
    mapping : LogMapping or path, optional
        How foreign files are laid out.
    drop : iterable of str
        Faulty rows of files to leave out, see `excite.logs.log_reading.read_log`.
    base_link, tip, snap_angles, xacro, installation
        See `excite.identify`.
    progress : callable
        Called with a description of each step.

    Returns
    -------
    ServoResult

    Raises
    ------
    InputError
        Logs without commands, or too short; a robot whose masses are not known, or whose drives are coupled.
    """
    began, cpu = time.monotonic(), time.process_time()
    whole, _ = robot_and_task(robot, base_link, tip, installation, snap_angles, xacro)
    motions = [servo_motion(log, whole) for log in read_logs(logs, whole, mapping, tuple(drop), progress)]
    places = windows_in(motions)
    with threadpool_limits(1):
        windows, estimates = _fit_all(motions, places, whole, progress)
    values, deviation = (np.array([getattr(e, name) for e in estimates]) for name in ("values", "deviation"))
    quantile = scipy.special.stdtrit(len(places.first) - len(QUANTITIES), 0.5 + CONFIDENCE / 2)
    unloaded = [_is_unloaded(each, estimate) for each, estimate in zip(windows, estimates, strict=True)]
    deviation[np.outer(unloaded, [q.scales for q in QUANTITIES])] = np.inf
    units = [unit for _, unit in ServoModel(whole).row_labels]
    spent = time.monotonic() - began, time.process_time() - cpu
    result = ServoResult(
        whole,
        values,
        quantile * deviation,
        motion_fits(_predicted(motions, places, estimates), units),
        tuple(motion.log.reference for motion in motions),
        len(places.first),
        provenance=provenance_of(spent, mapping, tuple(drop), 0),
    )
    return replace(result, notes=_notes(result), doubts=_doubts(result))


def _fit_all(
    motions: Sequence[ServoMotion], places: Places, robot: Robot, progress: Callable[[str], None]
) -> tuple[list[Windows], list[ServoEstimate]]:
    """Windows and estimates of every joint: first along the measured motion, then along that of the fitted servos."""
    start, estimates = start_values(motions, robot), []
    windows = [windows_of(motions, places, j) for j in range(robot.n)]
    for name, each, first in zip(robot.joint_names, windows, start, strict=True):
        progress(f"fitting the servo of {name}")
        estimates.append(fit_servo(each, first) if moves(each) else ServoEstimate.unknown(each, first))
    for _ in range(_REPEATS):
        progress("fitting all servos together")
        windows = along_response(windows, estimates, robot)
        pairs = zip(windows, estimates, start, strict=True)
        estimates = [
            fitted(each, estimate.values, first, _AGAIN) if moves(each) else estimate for each, estimate, first in pairs
        ]
    return windows, estimates


def _predicted(
    motions: Sequence[ServoMotion], places: Places, estimates: Sequence[ServoEstimate]
) -> list[tuple[Log, Array]]:
    """Each log with the positions that the servos have in the windows; NaN elsewhere."""
    paths = [np.full_like(motion.log.q, np.nan) for motion in motions]
    left = np.stack([estimate.residuals for estimate in estimates], axis=-1)
    for k, rows, each in zip(places.log, places.rows, left, strict=True):
        paths[k][rows] = motions[k].log.q[rows] + each
    return [(motion.log, path) for motion, path in zip(motions, paths, strict=True)]


_LOADED = 0.03  # of the motor's torque, from which on the known arm tells its scale


def _is_unloaded(windows: Windows, estimate: ServoEstimate) -> bool:
    """Whether what the described arm needs is lost in the torque of the motor."""
    path = windows.measured + estimate.residuals
    ddq = np.gradient(np.gradient(path, axis=1), axis=1) / windows.step[:, None] ** 2
    needed = windows.load + windows.inertia * ddq
    values = dict(zip(SYMBOLS, estimate.values, strict=True))
    own = np.hypot(values["J"] * np.std(ddq), values["Fc"])
    return bool(np.std(needed) + np.abs(needed.mean()) < _LOADED * own)


def _notes(result: ServoResult) -> tuple[str, ...]:
    """Which servos are not shown at all, and whose torques have no scale."""
    names, unknown = np.array(result.robot.joint_names), np.isinf(result.half_width)
    no_motion, no_load = unknown.all(axis=1), unknown[:, _K] & ~unknown.all(axis=1)
    little = ~result.known.any(axis=1) & ~no_motion & ~no_load
    still, unloaded, hardly = (names[which].tolist() for which in (no_motion, no_load, little))
    notes = []
    if hardly:
        notes.append(
            f"{listed_names(hardly)}: nothing of the servo is known to half of its value; give logs in which gravity "
            "loads the joint differently, of slow and fast motions"
        )
    if still:
        notes.append(f"{listed_names(still)}: the joint hardly moves, so that nothing of its servo is shown")
    if unloaded:
        notes.append(
            f"{listed_names(unloaded)}: the described arm hardly loads the joint, so that of stiffness, damping, "
            "inertia, friction and torque limit only the ratios are shown; hold a known mass in further logs, and "
            "state it by `payload`"
        )
    return tuple(notes)


def _doubts(result: ServoResult) -> tuple[str, ...]:
    """Joints whose command with a delay predicts better."""
    worse = [fit for fit in result.fits if fit.moves and not fit.better]
    return tuple(
        f"{fit.joint}: the servo predicts the logs that it is identified from within {fit.position_error:.3g} "
        f"{fit.unit}, the command alone, {fit.delay:.3g} s late, within {fit.delayed_error:.3g} {fit.unit}"
        for fit in worse
    )


def along_response(windows: Sequence[Windows], estimates: Sequence[ServoEstimate], robot: Robot) -> list[Windows]:
    """The windows with what the arm needs along the motion of the fitted servos, whose derivatives have no noise."""
    q = np.stack([w.measured + e.residuals for w, e in zip(windows, estimates, strict=True)], axis=-1)  # (w, T, n)
    step = windows[0].step[:, None, None]
    dq = np.gradient(q, axis=1) / step
    ddq = np.gradient(dq, axis=1) / step
    needed = arm_torques(robot)(*(each.reshape(-1, robot.n) for each in (q, dq, ddq)))
    load, inertia = (each.reshape(q.shape) for each in needed)
    return [replace(w, load=load[..., j], inertia=inertia[..., j]) for j, w in enumerate(windows)]


@dataclass(frozen=True, eq=False)
class ServoEstimate:
    """Unknowns of one servo."""

    values: Array  # (p,)
    deviation: Array  # (p,)
    residuals: Array  # (w, T) simulated less measured [rad or m]

    @classmethod
    def unknown(cls, windows: Windows, values: Array) -> ServoEstimate:
        """Of a joint that does not move: values of which nothing is known."""
        return cls(values, np.full_like(values, np.inf), np.zeros_like(windows.measured))


_GUESSES, _SPREAD = 192, 1.0  # values to start from, and the deviation of their logarithms
_LIMITED = 0.025  # of twice the largest torque of the motor: the least torque limit to start from
_TRIED, _TAKEN = 3, 12  # of the guesses, and iterations
_GRID = 15  # torque limits
_CONTINUED, _REPEATS, _AGAIN = 30, 2, 10  # iterations, and those with the motion of the fitted servos
_LIMITS = tuple(np.array([getattr(q, end) for q in QUANTITIES]) for end in ("least", "most"))
_SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.25, 1.5])  # of a delay, tried in its place
_K, _D, _J, _L, _DELAY = (SYMBOLS.index(symbol) for symbol in "KDJLd")
_FRICTION, _DEAD = SYMBOLS.index("Fc"), SYMBOLS.index("delta")
_LATER = [SYMBOLS.index(symbol) for symbol in ("Fs", "mu", "delta")]  # what is small, and fitted after the rest


def fit_servo(windows: Windows, start: Array) -> ServoEstimate:
    """Fit the simulated response to the measured positions by robust least squares.

    Values to start from are the best of many about those of the linear form, seeded. Where no load tells the scale of
    torques, the stiffness stays about that of the start, within a factor of e.
    """
    fine, windows = windows, replace(windows, longest_step=COARSE)
    rng = np.random.default_rng(0)
    factors = np.exp(_SPREAD * rng.standard_normal((_GUESSES, start.size)))
    factors[:, _L] = factors[:, _K] * _LIMITED ** rng.uniform(0.0, 1.0, _GUESSES)
    factors[:, _LATER] = 1.0
    factors[0] = 1.0
    guesses = np.clip(start * factors, *_LIMITS)
    errors = np.concatenate([np.abs(_residuals(windows, few)).mean(axis=(1, 2)) for few in np.split(guesses, 4)])
    best = guesses[np.argsort(errors, kind="stable")[:_TRIED]]
    tried = np.array([_descend(windows, each, start[_K], _TAKEN, _LATER)[0] for each in best])
    x = _best(windows, tried)
    for _ in range(_TRIED):
        x = _descend(windows, _best_limit(windows, x, start), start[_K], _TAKEN)[0]
    other = _descend(windows, _other_delay(windows, x), start[_K], _CONTINUED)[0]
    x = _best(windows, np.stack([x, other]))
    plain = _descend(windows, _without_dead_band(x), start[_K], _TAKEN, [_DEAD])[0]
    worse, least = np.abs(_residuals(windows, np.stack([plain, x]))).mean(axis=(1, 2))
    x = plain if worse < _REACHED * least else x
    scaled = [_descend(windows, each, start[_K], _TAKEN)[0] for each in _of_other_scales(x)]
    return fitted(fine, _best(windows, np.stack([x, *scaled])), start, _CONTINUED)


def _of_other_scales(x: Array) -> Array:
    """The values with smaller and larger torques, shape (2, p): little load says little about their scale."""
    scales = np.array([q.scales for q in QUANTITIES])
    return np.clip(np.where(scales, np.array([[0.6], [1.7]]) * x, x), *_LIMITS)


def _without_dead_band(x: Array) -> Array:
    """The values with friction in the place of a dead band; on joints of little load, either explains the other."""
    plain = x.copy()
    plain[_FRICTION] += x[_K] * x[_DEAD]
    plain[_DEAD] = 0.0
    return plain


def _best(windows: Windows, trials: Array) -> Array:
    """Of several values, shape (B, p), those that predict best."""
    return np.asarray(trials[np.argmin(np.abs(_residuals(windows, trials)).mean(axis=(1, 2)))])


def _other_delay(windows: Windows, x: Array) -> Array:
    """The values with the next best delay, of some: inertia and delay take each other's place, for a lag of J / D."""
    delays = x[_DELAY] * _SHARES
    trials = np.repeat(x[None], len(delays), axis=0)
    trials[:, _DELAY], trials[:, _J] = delays, x[_J] + x[_D] * (x[_DELAY] - delays)
    return _best(windows, np.clip(trials, *_LIMITS))


def _best_limit(windows: Windows, x: Array, start: Array) -> Array:
    """The values with the torque limit that predicts best, of many: few rows at a limit leave no slope towards it."""
    limits = np.append(x[_L], start[_L] / start[_K] * x[_K] * np.geomspace(_LIMITED, 1.0, _GRID))
    trials = np.where(np.arange(x.size) == _L, limits[:, None], x)
    return _best(windows, trials)


def fitted(windows: Windows, x: Array, start: Array, iterations: int) -> ServoEstimate:
    """The fit that some iterations from given values lead to."""
    x, J, left, scale = _descend(windows, x, start[_K], iterations)
    deviation = _WIDER * np.sqrt(_variance(left, J, scale))
    unlimited = np.where(np.arange(x.size) == _L, _LIMITS[1], x)
    with_limit, without = _cost(np.stack([left, _residuals(windows, unlimited[None])[0]]), scale)
    if without < _REACHED * with_limit:
        x, deviation[_L] = unlimited, np.inf
    return ServoEstimate(x, deviation, left)


_REACHED = 1.01  # times the cost or error, by which no torque limit or dead band at all must be worse for one to count
_WIDER = 4.0  # intervals, by what is wrong in all windows alike: from simulated servos, see benchmarks/servo
_STEPS = 5e-3  # of the size of each quantity, for differences
_STANDS_OUT = 3.0  # deviations from which on a residual counts less
_DAMPINGS = np.array([0.0, 1e-6, 1e-4, 1e-2, 1.0, 100.0])  # of Levenberg and Marquardt, tried at once
_PROGRESS = 1e-6  # of the cost, from which on it goes on


def _descend(
    windows: Windows, x: Array, about: float, iterations: int, fixed: Sequence[int] = ()
) -> tuple[Array, Array, Array, float]:
    """Values, derivatives and residuals there, and the residual that stands out, after some steps.

    Of each step the best of several lengths is taken. Values at a limit stay there while the cost falls beyond it.
    """
    least, most = _LIMITS
    x = np.clip(x, least, most)
    left, scale, stalled = _residuals(windows, x[None])[0], 0.0, False
    for _ in range(iterations):
        J, scale = _slopes(windows, x, left), _STANDS_OUT * _noise(left)
        weight = 1.0 / (1.0 + (left.ravel() / scale) ** 2)
        gradient, H = J.T @ (weight * left.ravel()) / scale**2, J.T @ (weight[:, None] * J) / scale**2
        shown = np.diag(H) > 0
        gradient[_K] += np.log(x[_K] / about) / x[_K]
        H[_K, _K] += 1.0 / x[_K] ** 2
        held = ((x <= least) & (gradient > 0)) | ((x >= most) & (gradient < 0)) | ~shown
        held[list(fixed)] = True
        free = np.flatnonzero(~held)
        if not free.size:
            break
        trials = np.repeat(x[None], len(_DAMPINGS), axis=0)
        size = np.sqrt(np.diag(H)[free])
        value, vector = np.linalg.eigh(H[np.ix_(free, free)] / np.outer(size, size))
        along = vector.T @ (gradient[free] / size)
        for trial, damping in zip(trials, _DAMPINGS, strict=True):
            trial[free] -= vector @ (along / np.maximum(value + damping, _FLAT * value[-1])) / size
        trials = np.clip(trials, least, most)
        paths = _residuals(windows, trials)
        costs = _cost(paths, scale) + np.log(trials[:, _K] / about) ** 2 / 2
        best, before = int(np.argmin(costs)), float(_cost(left[None], scale)[0] + np.log(x[_K] / about) ** 2 / 2)
        if costs[best] < before:
            x, left = trials[best], paths[best]
        if costs[best] > (1.0 - _PROGRESS) * before:
            if stalled:
                break
            stalled = True
    return x, _slopes(windows, x, left), left, scale


def _cost(left: Array, scale: float) -> Array:
    """Cauchy's ``sum(log(1 + (r / s)^2)) / 2`` of each variant, shape (B,)."""  # left (B, w, T)
    return np.asarray(np.log1p((left / scale) ** 2).sum(axis=(1, 2)) / 2)


def _residuals(windows: Windows, values: Array) -> Array:
    """Simulated less measured positions of B variants, shape (B, w, T)."""  # values (B, p)
    return np.asarray(response(values[:, None], windows) - windows.measured)


def _slopes(windows: Windows, x: Array, left: Array) -> Array:
    """Derivatives of all residuals, shape (w T, p), by differences away from the nearer limit."""
    least, most = _LIMITS
    size = np.array([q.size * (x[0] / QUANTITIES[0].size if q.scales else 1.0) for q in QUANTITIES])
    steps = _STEPS * size * np.where(x - least < most - x, 1.0, -1.0)
    paths = _residuals(windows, x + np.diag(steps))
    return np.asarray(((paths - left).reshape(x.size, -1) / steps[:, None]).T)


_LEAST_NOISE = 1e-6  # [rad or m]


def _noise(residuals: Array) -> float:
    """Deviation of residuals, of which a few may stand out."""
    return max(_LEAST_NOISE, 1.4826 * float(np.median(np.abs(residuals))))


_ALIKE = 0.05  # of the residuals, by which the model may be off everywhere
_FLAT = 1e-12  # of the steepest direction, below which a direction counts as not shown at all


def _variance(left: Array, J: Array, scale: float) -> Array:
    """Variances of a robust fit whose residuals are alike within a window, shape (p,).

    The larger of ``H^-1 (sum_w g_w g_w') H^-1``, and of what residuals that are alike in no window and a model that is
    off everywhere by a small share of them, in the worst way, would make, ``s^2 (1 + N a^2) H^-1``.
    """
    # left (w, T); J (w T, p)
    z = 1.0 + (left.ravel() / scale) ** 2
    influence, slope = left.ravel() / z, 1.0 / z
    size = np.sqrt((J**2).sum(axis=0))
    size[size == 0.0] = 1.0
    J = J / size
    value, vector = np.linalg.eigh(J.T @ (slope[:, None] * J))
    inverse = (vector / np.maximum(value, _FLAT * max(1.0, value[-1]))) @ vector.T
    g = (J * influence[:, None]).reshape(len(left), -1, J.shape[1]).sum(axis=1)
    count, p = len(left), J.shape[1]
    between = np.diag(inverse @ (g.T @ g) @ inverse) * count / max(1, count - p)
    alike = (1.0 + left.size * _ALIKE**2) * np.mean(influence**2) * np.diag(inverse)
    return np.asarray(np.maximum(between, alike) / size**2)
