"""Fit of the simulated response of servos to measured positions, of all joints at once, by robust least squares.

The linear form of `regressors.models.servo` gives values to start from. First each joint is fitted along the measured
motion, over windows that begin as measured; then along the motion of the fitted servos of all joints, whose
derivatives have no noise, over windows that begin where that motion is. Residuals that stand out, such as those of an
arm that touched something, count less. Intervals are from the scatter between windows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from excite.identification.estimator import CONFIDENCE
from excite.identification.servo_result import encoder_step
from excite.identification.servo_windows import Places, moves, start_values, windows_of
from regressors.models.servo_response import COARSE, QUANTITIES, SYMBOLS, Windows, arm_response, response
from regressors.robot.robot import Robot
from regressors.samples import Array, Index

_LIMITS = tuple(np.array([getattr(q, end) for q in QUANTITIES]) for end in ("least", "most"))
_SCALES = np.array([q.scales for q in QUANTITIES])
_SIZES = np.array([q.size for q in QUANTITIES])
_K, _D, _J, _L, _DELAY = (SYMBOLS.index(symbol) for symbol in "KDJLd")
_FRICTION, _DEAD, _OFFSET = (SYMBOLS.index(symbol) for symbol in ("Fc", "delta", "b"))
_LATER = [SYMBOLS.index(symbol) for symbol in ("Fs", "mu", "delta")]  # what is small, and fitted after the rest


@dataclass(frozen=True, eq=False)
class ServoFit:
    """Unknowns of the servos of all joints."""

    values: Array  # (n, p)
    half_width: Array  # (n, p) of 99 % intervals; infinite of what is not shown
    ratio_half_width: Array  # (n, p) of torques over the stiffness
    residuals: Array  # (n, w, T) simulated less measured [rad or m]


_REPEATS = 2  # along the motion of the fitted servos
_ITERATIONS, _AGAIN = 30, 10  # of the first of these, and of the others
_PASSES = 3  # of the motion of all joints


def fit_servos(places: Places, robot: Robot, progress: Callable[[str], None]) -> ServoFit:
    """Fit the servos of all joints in some windows of logs; those of joints that hardly move stay unknown."""
    start, windows = start_values(places.motions, robot), windows_of(places)
    moving = np.flatnonzero([moves(each) for each in np.split(windows.measured, robot.n)])
    values, half_width, of_ratios = start.copy(), np.full_like(start, np.inf), np.full_like(start, np.inf)
    residuals = np.zeros((robot.n, len(places.first), places.count))
    if not moving.size:
        return ServoFit(values, half_width, of_ratios, residuals)
    progress("searching for the servo of each joint")
    few = np.unique(np.linspace(0, len(places.first) - 1, _SEARCHED).round().astype(int))
    values[moving] = _search(_some(windows, robot.n, moving, few), start[moving])
    for number in range(_REPEATS):
        progress("fitting the servos of all joints")
        windows = along_response(windows, places, robot, _stuck(values, moving))
        those = _some(windows, robot.n, moving)
        if not number:
            values[moving] = _from_each(those, _of_other_scales(values[moving]), start[moving])
        fit = _descend(those, values[moving], start[moving, _K], _AGAIN if number else _ITERATIONS)
        values[moving] = fit.values
    values[moving], half_width[moving], of_ratios[moving] = _judged(those, fit)
    residuals[moving] = fit.left.reshape(len(moving), -1, places.count)
    return ServoFit(values, half_width, of_ratios, residuals)


def along_response(windows: Windows, places: Places, robot: Robot, values: Array) -> Windows:
    """The windows along the motion of some servos, which begins some rows before each window as measured."""
    command = places.stretches(lambda m: m.command, places.lead + places.settle)
    first = places.stretches(lambda m: m.log.q, places.settle)
    speed = places.stretches(lambda m: m.samples.dq, places.settle)[:, 0]
    arm = arm_response(robot, values, command, places.steps, first, speed, _PASSES)
    begin = places.settle * arm.substeps

    def cut(each: Array) -> Array:
        return np.concatenate(np.moveaxis(each[:, begin:], -1, 0))

    q, dq = cut(arm.q), cut(arm.dq)
    return replace(windows, start=q[:, 0], speed=dq[:, 0], load=cut(arm.load), inertia=cut(arm.inertia))


def _stuck(values: Array, moving: Index) -> Array:
    """The values, with friction that holds every joint that hardly moves."""
    stuck = values.copy()
    stuck[np.setdiff1d(np.arange(len(values)), moving), _FRICTION] = _LIMITS[1][_FRICTION]
    return stuck


def _some(windows: Windows, n: int, joints: Index, few: Index | slice = slice(None)) -> Windows:
    """The windows of some of n joints, that may stand more than once; of each, all or a few."""

    def of_each(values: Array) -> Array:
        chosen = values.reshape(n, -1, *values.shape[1:])[joints][:, few]
        return np.ascontiguousarray(chosen.reshape(-1, *values.shape[1:]))

    arrays = ("step", "command", "load", "inertia", "measured", "start", "speed")
    some: dict[str, Any] = {name: of_each(getattr(windows, name)) for name in arrays}
    return replace(windows, **some)


# --- search ----------------------------------------------------------------------------------------------------------

_SEARCHED = 40  # windows at most
_GUESSES, _SPREAD = 192, 1.0  # values to start from, and the deviation of their logarithms
_OTHER_START = 30.0  # the largest factor of all torques together
_LIMITED = 0.025  # of twice the largest torque of the motor: the least torque limit to start from
_RANGES, _TAKEN = 6, 12  # of the factor, of each of which the best guess is followed, and iterations
_ROUNDS = 3  # of other limits of torque
_GRID = 15  # torque limits
_OTHER_SCALES = np.array([0.25, 0.6, 1.0, 1.7, 4.0])
_SHARES = np.array([0.0, 0.3, 0.6, 1.4])  # of a delay, tried in its place
_REACHED = 1.01  # times the cost or error, by which no torque limit or dead band at all must be worse for one to count


def _search(windows: Windows, start: Array) -> Array:
    """Values that predict best, from many about those of the linear form, seeded, shape (m, p).

    Where no load tells the scale of torques, the stiffness stays about that of the start, within a factor of e.
    """
    windows = replace(windows, longest_step=COARSE)
    rng = np.random.default_rng(0)
    factors = np.exp(_SPREAD * rng.standard_normal((_GUESSES, start.shape[1])))
    factors[:, _SCALES] *= _OTHER_START ** np.linspace(-1.0, 1.0, _GUESSES)[:, None]
    factors[:, _L] = factors[:, _K] * _LIMITED ** rng.uniform(0.0, 1.0, _GUESSES)
    factors[:, _LATER] = 1.0
    guesses = np.clip(start * factors[:, None], *_LIMITS)
    best = np.stack([_best(windows, some) for some in np.split(guesses, _RANGES)])
    x = _from_each(windows, np.concatenate([start[None], best]), start, _LATER)
    for _ in range(_ROUNDS):
        x = _from_each(windows, _best(windows, _of_other_limits(x, start))[None], start)
    x = _from_each(windows, np.stack([x, *_of_other_delays(x)]), start)
    x = _from_each(windows, _of_other_scales(x), start)
    plain = _from_each(windows, _without_dead_band(x)[None], start, [_DEAD])
    worse, least = _errors(windows, np.stack([plain, x]))
    return np.where((worse < _REACHED * least)[:, None], plain, x)


def _from_each(windows: Windows, trials: Array, start: Array, fixed: Sequence[int] = ()) -> Array:
    """Of several values of each joint, shape (C, m, p), what some iterations make of the best, shape (m, p)."""
    count, m, p = trials.shape
    several = _some(windows, m, np.tile(np.arange(m), count))
    about = np.tile(start[:, _K], count)
    ends = _descend(several, trials.reshape(-1, p), about, _TAKEN, fixed).values.reshape(trials.shape)
    return _best(windows, ends)


def _of_other_limits(x: Array, start: Array) -> Array:
    """The values, and those with other torque limits: few rows at a limit leave no slope towards it."""
    limits = start[:, _L] / start[:, _K] * x[:, _K] * np.geomspace(_LIMITED, 1.0, _GRID)[:, None]
    trials = np.repeat(x[None], _GRID + 1, axis=0)
    trials[1:, :, _L] = limits
    return trials


def _of_other_delays(x: Array) -> Array:
    """The values with other delays in the place of inertia, for a lag of J / D, and of damping, for one of D / K."""
    delays = x[:, _DELAY] * _SHARES[:, None]
    of_inertia, of_damping = (np.repeat(x[None], len(delays), axis=0) for _ in range(2))
    of_inertia[..., _J] += x[:, _D] * (x[:, _DELAY] - delays)
    of_damping[..., _D] += x[:, _K] * (x[:, _DELAY] - delays)
    trials = np.concatenate([of_inertia, of_damping])
    trials[..., _DELAY] = np.tile(delays, (2, 1))
    return np.clip(trials, *_LIMITS)


def _of_other_scales(x: Array) -> Array:
    """The values with smaller and larger torques: little load says little about their scale; shape (C, m, p)."""
    return np.clip(np.where(_SCALES, _OTHER_SCALES[:, None, None] * x, x), *_LIMITS)


def _without_dead_band(x: Array) -> Array:
    """The values with friction in the place of a dead band; on joints of little load, either explains the other."""
    plain = x.copy()
    plain[:, _FRICTION] += x[:, _K] * x[:, _DEAD]
    plain[:, _DEAD] = 0.0
    return plain


def _best(windows: Windows, trials: Array) -> Array:
    """Of several values of each joint, shape (C, m, p), those that predict best, shape (m, p)."""
    best = np.argmin(_errors(windows, trials), axis=0)
    return np.asarray(np.take_along_axis(trials, best[None, :, None], axis=0)[0])


def _errors(windows: Windows, trials: Array) -> Array:
    """Mean absolute errors of several values of each joint, shape (C, m)."""
    return np.asarray(np.abs(_residuals(windows, trials)).mean(axis=-1))


# --- descent ---------------------------------------------------------------------------------------------------------
#
# Coordinates of a servo are the logarithm of its stiffness, torques as shares of the stiffness, and the rest as it is:
# what only masses tell, the scale of all torques, is then one of them.

_RATIOS = _SCALES & (np.arange(_SCALES.size) != _K)
_STEPS = 5e-3 * np.where(_RATIOS, _SIZES / _SIZES[_K], _SIZES)  # for differences
_STEPS[_K] = 0.05
_BOUNDS = tuple(np.where(_RATIOS, end, limit) for end, limit in zip((0.0, 1e6), _LIMITS, strict=True))
_STANDS_OUT = 3.0  # deviations from which on a residual counts less
_DAMPINGS = np.array([0.0, 1e-6, 1e-4, 1e-2, 1.0, 100.0])  # of Levenberg and Marquardt, tried at once
_LONGEST = 1.0  # step of the logarithm of the stiffness
_PROGRESS = 1e-6  # of the cost, from which on it goes on


@dataclass(frozen=True, eq=False)
class _Descent:
    """Where a descent of m servos ended."""

    values: Array  # (m, p)
    slopes: Array  # (m, N, p) of the residuals, by the coordinates
    left: Array  # (m, N) residuals [rad or m]
    scale: Array  # (m,) from which on a residual counts less


def _coordinates(values: Array) -> Array:
    z = np.where(_RATIOS, values / values[..., _K, None], values)
    z[..., _K] = np.log(values[..., _K])
    return z


def _values(z: Array) -> Array:
    x = z.copy()
    x[..., _K] = np.exp(z[..., _K])
    return np.clip(np.where(_RATIOS, x * x[..., _K, None], x), *_LIMITS)


def _descend(windows: Windows, values: Array, about: Array, iterations: int, fixed: Sequence[int] = ()) -> _Descent:
    """Values after some steps, of each the best of several lengths; those at a limit stay while the cost falls beyond.

    Stiffnesses stay about some, within a factor of e where nothing else tells them.
    """
    m, about = len(values), np.log(about)
    z, noise_of = _coordinates(np.clip(values, *_LIMITS)), _noise_of(windows, m)
    left = _residuals(windows, _values(z)[None])[0]
    active, stalled = np.arange(m), np.zeros(m, dtype=bool)
    for _ in range(iterations):
        some = windows if active.size == m else _some(windows, m, active)
        scale = _STANDS_OUT * noise_of(left, active)
        slopes = _slopes(some, z[active], left[active], scale)
        each = zip(z[active], left[active], slopes, scale, about[active], strict=True)
        trials = np.stack([_steps(*one, fixed) for one in each], axis=1)
        paths = _residuals(some, _values(trials))
        costs = _cost(paths, scale) + (trials[..., _K] - about[active]) ** 2 / 2
        before = _cost(left[active], scale) + (z[active, _K] - about[active]) ** 2 / 2
        best, every = np.argmin(costs, axis=0), np.arange(active.size)
        after = costs[best, every]
        lower = after < before
        z[active[lower]], left[active[lower]] = trials[best, every][lower], paths[best, every][lower]
        slow = after > (1.0 - _PROGRESS) * before
        done = slow & stalled[active]
        stalled[active] |= slow
        active = active[~done]
        if not active.size:
            break
    scale = _STANDS_OUT * noise_of(left, np.arange(m))
    return _Descent(_values(z), _slopes(windows, z, left, scale), left, scale)


def _steps(z: Array, left: Array, J: Array, scale: float, about: float, fixed: Sequence[int]) -> Array:
    """Coordinates of one servo after steps of several lengths, shape (C, p)."""
    least, most = (_coordinates(np.where(_RATIOS, limit * np.exp(z[_K]), limit)) for limit in _BOUNDS)
    weight = 1.0 / (1.0 + (left / scale) ** 2)
    gradient, H = J.T @ (weight * left) / scale**2, J.T @ (weight[:, None] * J) / scale**2
    shown = np.diag(H) > 0
    gradient[_K] += z[_K] - about
    H[_K, _K] += 1.0
    held = ((z <= least) & (gradient > 0)) | ((z >= most) & (gradient < 0)) | ~shown
    held[list(fixed)] = True
    free, trials = np.flatnonzero(~held), np.repeat(z[None], len(_DAMPINGS), axis=0)
    if not free.size:
        return trials
    size = np.sqrt(np.diag(H)[free])
    value, vector = np.linalg.eigh(H[np.ix_(free, free)] / np.outer(size, size))
    along = vector.T @ (gradient[free] / size)
    for trial, damping in zip(trials, _DAMPINGS, strict=True):
        trial[free] -= vector @ (along / np.maximum(value + damping, _FLAT * value[-1])) / size
    trials[:, _K] = np.clip(trials[:, _K], z[_K] - _LONGEST, z[_K] + _LONGEST)
    return np.clip(trials, least, most)


def _cost(left: Array, scale: Array) -> Array:
    """Cauchy's ``sum(log(1 + (r / s)^2)) / 2`` of each servo, shape (..., m)."""  # left (..., m, N)
    return np.asarray(np.log1p((left / scale[:, None]) ** 2).sum(axis=-1) / 2)


def _residuals(windows: Windows, values: Array) -> Array:
    """Simulated less measured positions of variants of m servos, shape (C, m, N)."""  # values (C, m, p)
    count, m, _ = values.shape
    each = np.repeat(values, len(windows.start) // m, axis=1)
    return np.asarray((response(each, windows) - windows.measured).reshape(count, m, -1))


def _slopes(windows: Windows, z: Array, left: Array, scale: Array) -> Array:
    """Derivatives of all residuals by the coordinates, shape (m, N, p), by differences away from the nearer limit.

    A difference that changes the residuals by more than they stand out at is made again with a smaller step: an arm
    that falls for want of torque is sensitive.
    """
    middle = np.where(_RATIOS | (np.arange(len(_STEPS)) == _K), np.inf, 0.5 * (_LIMITS[0] + _LIMITS[1]))
    steps = _STEPS * np.where(z < middle, 1.0, -1.0)
    paths = _residuals(windows, _values(z + np.eye(z.shape[1])[:, None] * steps))
    change = np.sqrt(np.mean((paths - left) ** 2, axis=-1)).T / scale[:, None]
    if (change > 1.0).any():
        steps = steps / np.maximum(1.0, change)
        paths = _residuals(windows, _values(z + np.eye(z.shape[1])[:, None] * steps))
    return np.asarray(np.moveaxis((paths - left) / steps.T[..., None], 0, -1))


_LEAST_NOISE = 1e-6  # [rad or m]


def _noise_of(windows: Windows, m: int) -> Callable[[Array, Index], Array]:
    """Deviation of the residuals (m, N) of some servos while they move, of which a few rows may stand out.

    A joint that rests is explained by anything that holds it. No deviation is below that of the encoder's steps.
    """
    steps = np.diff(windows.measured, axis=1)
    still = np.pad(steps == 0, ((0, 0), (1, 1)), constant_values=True)
    moving = ~(still[:, 1:] & still[:, :-1]).reshape(m, -1)
    moving[~moving.any(axis=1)] = True
    least = [max(_LEAST_NOISE, encoder_step(each) / np.sqrt(12)) for each in np.split(windows.measured, m)]

    def noise(left: Array, some: Index) -> Array:
        middle = np.array([np.median(np.abs(left[j, moving[j]])) for j in some])
        return np.asarray(np.maximum(np.array(least)[some], 1.4826 * middle))

    return noise


# --- intervals -------------------------------------------------------------------------------------------------------

_WIDER = 3.5  # intervals, by what is wrong in all windows alike: from simulated servos, see benchmarks/servo
_ALIKE = 0.05  # of the residuals, by which the model may be off everywhere
_NO_SCALE = 1.0  # half of the interval of the logarithm of the stiffness, from which on only ratios are shown
_LEAST_LEFT = 0.1  # to the other windows, of what one window determines
_FLAT = 1e-12  # of the steepest direction, below which a direction counts as not shown at all


def _judged(windows: Windows, fit: _Descent) -> tuple[Array, Array, Array]:
    """Values, halves of their 99 % intervals and of those of ratios, (m, p); limits that no motion reaches are none.

    Where the scale of torques is hardly shown, it may be larger by more than it may be smaller; so the larger counts.
    Offsets may be wrong by half a step of the encoder besides.
    """
    count, p, width = windows.measured.shape[1], fit.values.shape[1], []
    for x, left, slopes, scale in zip(fit.values, fit.left, fit.slopes, fit.scale, strict=True):
        residuals = left.reshape(-1, count)
        quantile = _WIDER * scipy.special.stdtrit(len(residuals) - p, 0.5 + CONFIDENCE / 2)
        T = np.diag(np.where(_SCALES, x[_K], 1.0))
        T[_SCALES, _K] = x[_SCALES]
        along, of_ratios = quantile * _deviations(residuals, slopes, scale, np.vstack([T, np.eye(p)])).reshape(2, p)
        of_scale = of_ratios[_K]
        wider = np.expm1(of_scale) / of_scale if of_scale < _NO_SCALE else np.inf
        width.append((np.where(_SCALES, wider, 1.0) * along, of_ratios))
    values, (half_width, of_ratios) = fit.values.copy(), np.moveaxis(np.array(width), 1, 0)
    steps = [encoder_step(each) for each in np.split(windows.measured, len(values))]
    half_width[:, _OFFSET] = np.hypot(half_width[:, _OFFSET], 0.5 * np.array(steps))
    unlimited = values.copy()
    unlimited[:, _L] = _LIMITS[1][_L]
    with_limit, without = _cost(np.stack([fit.left, _residuals(windows, unlimited[None])[0]]), fit.scale)
    not_reached = without < _REACHED * with_limit
    values[not_reached, _L] = _LIMITS[1][_L]
    half_width[not_reached, _L] = of_ratios[not_reached, _L] = np.inf
    return values, half_width, of_ratios


def _deviations(left: Array, J: Array, scale: float, T: Array) -> Array:
    """Deviations of some combinations (c, p) of the coordinates of a robust fit whose residuals are alike in a window.

    Of ``H^-1 (sum_w g_w g_w') H^-1``, or of what residuals that are alike in no window and a model that is off
    everywhere by a small share of them, in the worst way, would make, ``s^2 (1 + N a^2) H^-1``, whichever is larger.
    A window that determines much by itself leaves little: its g_w counts as ``(I - H_w H^-1)^-1 g_w`` [BM02].
    """
    # left (w, T); J (w T, p); BM02: R. Bell, D. McCaffrey, Survey Methodology 28 (2002) 169
    z = 1.0 + (left.ravel() / scale) ** 2
    influence, slope = left.ravel() / z, 1.0 / z
    size = np.sqrt((J**2).sum(axis=0))
    size[size == 0.0] = 1.0
    J, T = J / size, T / size
    value, vector = np.linalg.eigh(J.T @ (slope[:, None] * J))
    half = vector / np.sqrt(np.maximum(value, _FLAT * max(1.0, value[-1])))  # H^-1 is half half'
    inverse = half @ half.T
    g = (J * influence[:, None]).reshape(len(left), -1, J.shape[1]).sum(axis=1) @ half
    A = (J @ half * np.sqrt(slope)[:, None]).reshape(len(left), -1, J.shape[1])
    share, axes = np.linalg.eigh(A.swapaxes(1, 2) @ A)  # of what each window determines, (w, p) and (w, p, p)
    kept = np.einsum("wij,wkj,wk->wi", axes / np.maximum(1.0 - share, _LEAST_LEFT)[:, None], axes, g) @ half.T
    between = kept.T @ kept
    alike = (1.0 + left.size * _ALIKE**2) * np.mean(influence**2) * inverse
    return np.asarray(np.sqrt(np.maximum(*(((T @ each) * T).sum(axis=1) for each in (between, alike)))))
