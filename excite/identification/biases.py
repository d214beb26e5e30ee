"""Errors of an estimate that are not noise, found by estimating once more, and intervals that allow for them.

An estimate that changes by d where it should not has an error of about d beside the noise: ``Cov + d d'``.

Near standstill friction may hold a drive: its torque is then what the rest of the drive's torque asks for, no function
of the motion, and the filter blurs it into the rows beside. With a right model, leaving out rows of slow drives changes
an estimate by noise alone; where friction holds, by the bias as well [Hausman 1978]. So the change counts where rows
near standstill show that the model fails there: because they are left out, from those of drives faster than twice that
speed; or because their residuals are larger than the others'.

Noise of the positions, or the steps of encoders, passes the filter and enters the regressor, whose noise pulls
parameters towards zero; more equations do not help. Its size is known from what was filtered out. Adding as much noise
once more, with both signs, which cancels what is linear in it, repeats the bias [Cook, Stefanski 1994]:
``d = (b(x + n) + b(x - n)) / 2 - b(x)``. Where h of the signal's power is noise, estimates are pulled by the factor
``1 - h``, and by ``(1 - h) / (1 + h)`` with twice the noise, so that the bias is ``d (1 + h) / (1 - h)``. Noise is
largest in the highest derivative, and is added there alone: at reversals, steps of an encoder do not disturb the sign
of the velocity as white noise would.

The model's friction is a few terms per drive; real friction is a curve over speed. What the curve has beside the terms
is written as bumps, ``g_k = exp(-(dz / v_k)^2) s`` with the direction of motion s, at three speeds v_k of each drive's
fastest. With them the equations are ``y = W beta + G c``, whose solution differs from the model's by
``d = -(W'VW)^-1 W'VG c``. Where c is more than noise explains, the error of the estimate has about the second moments
``d d' + (W'VW)^-1 W'VG Cov(c) G'VW (W'VW)^-1`` beside the covariance for noise [Hausman 1978, Econometrica 46, 1251],
with the covariance of c by the residuals that the bumps leave, which are the noise's.

A constant torque of one joint, the offset of a sensor, is no noise either. Where it shows clearly, it is identified
along; else a parameter of gravity may take it up. With a prior deviation of such constants o, and what the log tells of
them beside the parameters, a mean m and a covariance P, an estimate that changes by ``R o`` has the covariance
``Cov + R (m m' + P) R'`` about the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from excite.identification.covariance import METHODS, divisors, group_scale, with_covariance
from excite.identification.equations import (
    constants,
    drive_directions,
    equations,
    friction_drives,
    instant_columns,
    nearest,
    nuisance_columns,
)
from excite.identification.estimator import (
    CONFIDENCE,
    Context,
    Estimate,
    Estimator,
    allowing_for,
    largest_share,
    noted,
)
from excite.identification.estimators.least_squares import weighted
from excite.identification.noise import autocorrelation, effective_samples, noise_origin
from excite.identification.observations import GroupFactors, Observations, row_stretches
from excite.identification.preparation import PreparedLog, chosen_method
from excite.identification.recipe import Recipe
from excite.identification.streamed_rows import StreamedRows
from excite.information.half_widths import BIAS_SHARE, OFFSET_SHARE
from excite.information.target import IdentificationTarget, least_speeds, typical_speed
from excite.logs.event import within
from excite.logs.excitation import runs
from excite.logs.signals.method import Method, resample
from regressors.errors import ExciteError, InputError, percent
from regressors.models.base import triangular_factor
from regressors.numerical import column_lengths
from regressors.robot.columns import COULOMB, OFFSET
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.samples import Array, Samples

_SLOW = 0.1  # of the typical speed: rows of slower drives are compared with the others
_SLOW_WINDOW = 0.05  # the same of windows, which hold the work of all drives
_FASTER = 2.0  # of the speed below which rows are left out
_INSTANTS = 100_000  # of a log, that the typical speed is found from
_SAID = 0.5  # change over deviation that is worth a note


def allowing_for_standstill(
    estimate: Estimate, estimator: Estimator, observations: Observations, context: Context
) -> Estimate:
    """Extend the covariance of an estimate by its change without rows near standstill, where friction holds there."""
    target, recipe = context.target, context.recipe
    if estimate.method not in METHODS or not _may_be_held(target):
        return estimate
    shown = _held(observations)
    share = _SLOW if target.model.window is None else _SLOW_WINDOW
    speed = _FASTER * recipe.standstill if recipe.standstill else share * typical_speed(target.robot, _thinned(context))
    fast = fast_rows(shown, context, speed)
    # of windows, whose noise grows with the work of each channel
    channels = noise_origin(context)[1] if shown is observations else None
    if fast.all() or not (recipe.standstill or fails_near_standstill(estimate, shown, fast, channels)):
        return estimate
    try:
        before = estimate if shown is observations else estimator.estimate(shown, context)
        other = estimator.estimate(shown.rows(np.flatnonzero(fast)), context)
    except ExciteError:
        return noted(
            estimate,
            f"rows of drives faster than {speed:.3g} rad/s (m/s) are too few to tell what friction near standstill "
            "does",
        )
    # what moving drives do not show is known from rows near standstill alone
    change = np.where(np.isfinite(other.values), other.coefficients - before.coefficients, estimate.coefficients)
    worst, share = largest_share(estimate, change)
    note = (
        f"without the rows of drives slower than {speed:.3g} rad/s (m/s), where friction is uncertain, "
        f"{estimate.names[worst]} changes most, by {share:.2g} standard deviations, which the intervals include"
    )
    return allowing_for(estimate, change, *((note,) if share >= _SAID else ()))


def _may_be_held(target: IdentificationTarget) -> bool:
    """Whether the equations have friction of drives, and are of single instants or of short windows."""
    if (window := target.model.window) is None:
        return None not in (target.model.torque_equations(), target.model.coulomb_friction())
    return window.kind == "short" and any(target.base.columns[int(k)].kind == COULOMB for k in target.base.index)


def _held(observations: Observations) -> Observations:
    """The observations themselves; of streamed ones, stretches that stand for all."""
    if not isinstance(observations.W, StreamedRows):
        return observations
    rows = [np.arange(stretch.start, stretch.stop) for stretch in row_stretches(observations)]
    return observations.rows(np.concatenate(rows))


def _thinned(context: Context) -> list[Samples]:
    """Few instants of the logs."""
    samples = [part.samples for part in context.prepared]
    return [each.rows(slice(None, None, max(1, each.time.size // _INSTANTS))) for each in samples]


def fast_rows(observations: Observations, context: Context, speed: float) -> NDArray[np.bool_]:
    """Rows of the equations whose drives are faster than a speed, shape (m,)."""
    fast = np.ones(observations.y.size, dtype=bool)
    for log, part in enumerate(context.prepared):
        rows = np.flatnonzero(observations.log == log)
        if (window := context.target.model.window) is not None:
            speeds = np.abs(part.samples.dq @ friction_rows(context.target.robot).T)
            slowest = speeds[:, speeds.max(axis=0) > speed].min(axis=1, initial=np.inf)
            ends, time = window.ends(part.samples.time), context.target.model.row_times(part.samples.time)
            fast[rows] = np.minimum(*(slowest[k] for k in ends))[nearest(time, observations.time[rows])] >= speed
            continue
        instants, which = np.unique(nearest(part.samples.time, observations.time[rows]), return_inverse=True)
        speeds = least_speeds(context.target, part.samples.rows(instants))
        fast[rows] = speeds[which, observations.equation[rows]] >= speed
    return fast


def fails_near_standstill(
    estimate: Estimate, observations: Observations, fast: NDArray[np.bool_], channels: Array | None = None
) -> bool:
    """True if residuals are larger in rows near standstill than in the others, beyond what noise does in 1 % of cases.

    Their mean squares in units of each group's noise are compared, with a normal distribution of variance
    ``2 / n_slow + 2 / n_fast`` in effective rows, see `excite.identification.noise`.
    """  # fast (m,); channels (m, c)
    residual, group = estimate.residual(observations), observations.group
    residual = residual if channels is None else residual / np.maximum(np.linalg.norm(channels, axis=1), 1e-300)
    squares = (residual / group_scale(estimate)[group]) ** 2
    share = np.ones(observations.y.size)
    for g in np.flatnonzero(np.bincount(group)):
        rows = group == g
        count = int(np.count_nonzero(rows))
        share[rows] = effective_samples(autocorrelation(residual[rows]), count) / count
    slow, quick = (max(2.0, float(share[rows].sum())) for rows in (~fast, fast))
    if not np.any(fast):
        return False
    excess = float(squares[~fast].mean() / squares[fast].mean()) - 1.0
    return excess > float(scipy.special.ndtri(CONFIDENCE)) * float(np.sqrt(2 / slow + 2 / quick))


SPEEDS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)  # candidates, of the typical speed of the drives that move
_OF_SLOWEST = 0.5  # of the largest speed of a drive: more would leave out nearly all of its rows
_TURNS = 2e-3  # rad or m: the travel in a log of a drive that does not rest


def without_standstill(part: PreparedLog, target: IdentificationTarget, speed: float | None) -> PreparedLog:
    """The log with the stretches of each equation in which a drive whose torque it contains hardly moves."""
    if not speed:
        return part
    equations = target.model.torque_equations()
    if equations is None:
        raise InputError("`standstill` is for models of joint torques at single instants")
    slow = least_speeds(target, part.samples) < speed
    labels = [name for name, _ in target.model.row_labels]
    each = ", ".join(f"{percent(share)} of {name}" for name, share in zip(labels, slow.mean(axis=0), strict=True))
    note = f"rows left out while a drive is slower than {speed:.3g} rad/s (m/s), where friction may hold it: {each}"
    time = part.samples.time
    spans = tuple(tuple((float(time[a]), float(time[b - 1])) for a, b in runs(column)) for column in slow.T)
    return replace(part, standing=spans, notes=(*part.notes, note))


def standstill_candidates(target: IdentificationTarget, parts: Sequence[PreparedLog]) -> tuple[float, ...]:
    """Speeds for `without_standstill` to choose from, `SPEEDS` times the typical speed of the drives that move.

    None is above half the largest speed of a drive that turns: a slow one among faster ones would lose its rows.
    """
    if target.model.torque_equations() is None:
        return (0.0,)
    rows, samples = friction_rows(target.robot), [part.samples for part in parts]
    largest = np.max([np.abs(each.dq @ rows.T).max(axis=0) for each in samples], axis=0)
    turns = np.max([np.ptp(each.q @ rows.T, axis=0) for each in samples], axis=0) > _TURNS
    typical, most = typical_speed(target.robot, samples), _OF_SLOWEST * largest[turns].min(initial=np.inf)
    return tuple(share * typical for share in SPEEDS if share * typical <= most) if typical > 0 else (0.0,)


SHARE = 0.01  # noise over signal of an acceleration below which parameters are pulled by less than 1e-4
_MOST = 0.99  # of the signal's power that may be noise
_BIAS_SAID = 0.1  # bias over deviation that is worth a note
_NOISE_STRETCH = 2**16  # instants of a long log that its noise is determined from
_SIGNALS = ("butterworth", "savitzky-golay", "fourier", "differences")  # linear in the positions


def motion_noise(
    part: PreparedLog, target: IdentificationTarget, recipe: Recipe, what: str, seed: int = 0
) -> tuple[Array, float] | None:
    """Draw noise of a derivative, of the size that was filtered out of a log's positions, shape (N, n).

    It is as random as the measured one after the filter, and zero in long logs where it is below `SHARE`; the second
    is the largest ratio of noise to noisy signal, over the joints.
    """
    if recipe.average or recipe.measured_velocity or recipe.signals not in _SIGNALS:
        return None
    uniform = resample(part.log).log
    method, count = chosen_method(recipe).settled(uniform.time, uniform.q), len(part.samples.time)
    whole = recipe.signals == "fourier" or uniform.count <= _NOISE_STRETCH
    first = 0 if whole else (uniform.count - _NOISE_STRETCH) // 2  # the middle of a long log
    uniform = uniform if whole else uniform.rows(slice(first, first + _NOISE_STRETCH))
    rng = np.random.default_rng(seed)
    smooth = method.motion(uniform.time, uniform.q).samples  # not those of the part, which may be delayed
    white = rng.normal(size=uniform.q.shape)
    k = len(target.robot.base_joints)
    white[:, :k] = _integrated(white[:, :k], uniform.q[:, :k], uniform.time, method)
    passed = method.motion(uniform.time, white)
    if whole and passed.samples.q.shape != part.samples.q.shape:
        return None
    # impacts and gaps are no noise, and neither is how a drive sticks and slips
    moving = np.all(np.abs(smooth.dq @ friction_rows(target.robot).T) >= (recipe.standstill or 0.0), axis=1)
    used = ~within(passed.samples.time, part.left_out) & moving
    left = np.std((uniform.q[passed.kept] - smooth.q)[used], axis=0) if np.any(used) else np.zeros(white.shape[1])
    taken = np.std(white[passed.kept] - passed.samples.q, axis=0)
    size = np.divide(left, taken, out=np.zeros_like(left), where=taken > 1e-6 * np.std(white, axis=0))
    values = size * getattr(passed.samples, what)
    signal = np.sqrt(np.mean(_in_rows(target, part.samples, getattr(part.samples, what)) ** 2, axis=0))
    noise = np.std(_in_rows(target, passed.samples, values), axis=0)
    share = np.divide(noise, signal, out=np.zeros_like(signal), where=signal > 0)
    most = float(share.max(initial=0.0))
    if most < SHARE and not whole:
        values = np.broadcast_to(0.0, part.samples.q.shape)
    while len(values) < count:  # as random in every stretch
        more = method.motion(uniform.time, rng.normal(size=white.shape))
        values = np.concatenate([values, size * getattr(more.samples, what)])
    return values[:count], most


def _integrated(white: Array, q: Array, time: Array, method: Method) -> Array:
    """White noise, or its sums, or those of its sums, by what of positions the filter takes out, shape (N, k).

    Positions of a base are integrals where an IMU measures it, and their noise then grows with the period.
    """  # white, q (N, k)
    candidates = [white, np.cumsum(white, axis=0), np.cumsum(np.cumsum(white, axis=0), axis=0)]

    def pace(x: Array) -> Array:
        """Size of the changes from row to row in what is filtered out, of its size."""
        passed = method.motion(time, x)
        left = x[passed.kept] - passed.samples.q
        return np.asarray(np.log(np.std(np.diff(left, axis=0), axis=0) / np.std(left, axis=0)))

    away = [np.abs(pace(x) - pace(q)) for x in candidates] if q.size else [np.zeros(0)]
    return np.asarray(np.choose(np.argmin(away, axis=0), candidates)) if q.size else white


def _in_rows(target: IdentificationTarget, samples: Samples, values: Array) -> Array:
    """A derivative as the rows hold it: at every instant, or its difference over every window.

    The difference of velocities over a short window is an acceleration, of which noise is a far larger share.
    """  # values (N, n)
    if target.model.window is None:
        return values
    first, last = target.model.window.ends(samples.time)
    return np.asarray(values[last] - values[first])


def allowing_for_motion_noise(estimate: Estimate, estimator: Estimator, context: Context) -> Estimate:
    """Extend the covariance of an estimate by the bias that noise in the motion causes, where there is any."""
    if estimate.method not in METHODS:
        return estimate
    what = "ddq" if context.target.model.window is None else "dq"
    noises = [
        motion_noise(part, context.target, context.recipe, what, seed) for seed, part in enumerate(context.prepared)
    ]
    known = [noise for noise in noises if noise is not None]
    k = len(context.target.robot.base_joints)
    floats = k > 0 and not any(part.measured[:, :k].any() for part in context.prepared)  # no wrench outweighs its noise
    if len(known) < len(noises) or (share := max(share for _, share in known)) < SHARE * (not floats):
        return estimate
    try:
        shifted = [_estimated_with(estimator, context, what, [sign * n for n, _ in known]) for sign in (1.0, -1.0)]
    except ExciteError:  # so much noise that nothing can be estimated
        return noted(
            estimate, "noise of the positions is too large to determine what it does: the intervals leave it out"
        )
    bias = _motion_bias(estimate, shifted, share)
    bias = np.where(np.isfinite(bias), bias, 0.0)
    worst, deviations = largest_share(estimate, bias)
    parts = f"{percent(abs(bias[worst] / estimate.values[worst]))} or " if estimate.values[worst] else ""
    note = (
        f"noise of the positions shifts {estimate.names[worst]} most, by about {parts}{deviations:.2g} standard "
        "deviations, which the intervals include; a lower `cutoff` reduces it"
    )
    return allowing_for(estimate, bias, *((note,) if deviations > _BIAS_SAID else ()))


def _motion_bias(estimate: Estimate, shifted: Sequence[Array], share: float) -> Array:
    """Bias of an estimate by noise in the motion, from the estimates with that noise of either sign, shape (p,)."""
    h = min(share**2, _MOST)
    return np.asarray((1 + h) / (1 - h) * ((shifted[0] + shifted[1]) / 2 - estimate.coefficients))


def _estimated_with(estimator: Estimator, context: Context, what: str, noises: Sequence[Array]) -> Array:
    """Estimate with the noise of a derivative once more, shape (p,)."""
    motions = (
        replace(p.samples, **{what: getattr(p.samples, what) + n})
        for p, n in zip(context.prepared, noises, strict=True)
    )
    parts = tuple(replace(part, samples=motion) for part, motion in zip(context.prepared, motions, strict=True))
    observations = equations(context.target, parts, context.recipe)
    observations = observations.held() if estimator.holds_rows else observations
    return estimator.estimate(observations, replace(context, prepared=parts)).coefficients


BUMP_SPEEDS = (0.05, 0.15, 0.45)  # of each drive's fastest
_LARGEST = 2**28  # bytes of a regressor
_CHANCE = 1e-3  # of noise alone being taken for a mismatch
_SHOWN = 1e-6  # of a bump's length that neither the model nor the other bumps explain


def friction_mismatch(estimate: Estimate, observations: Observations, context: Context) -> Array | None:
    """Second moments of the error that friction of other forms causes, shape (p, p)."""
    if estimate.method not in METHODS or observations.W.nbytes > _LARGEST:
        return None
    model, base = context.target.model, context.target.base
    friction = model.coulomb_friction()
    if model.window is not None or friction is None or not np.isin(friction.columns, base.index).any():
        return None
    G = bumps(context.target, context.prepared, context.recipe) * _likely_bumps(estimate, observations, context)
    beside = _Beside.fitted(estimate, observations, G, context)
    if beside is None or not len(beside.c):
        return None
    c, C, rank = beside.c, beside.C, len(beside.c)
    bound = rank * scipy.special.fdtri(rank, beside.freedom, 1 - _CHANCE)
    if c @ np.linalg.pinv(C, hermitian=True) @ c <= bound:
        return None
    return beside.moments()


_BUMP = 0.2  # of a drive's friction: deviation of a bump beforehand


def _likely_bumps(estimate: Estimate, observations: Observations, context: Context) -> Array:
    """Deviation of every bump of every drive beforehand, by the size of its directed friction, shape (k,)."""
    friction = friction_drives(context.target, context.prepared[0].samples)
    of_drive = np.array(friction.drives) == np.array(list(dict.fromkeys(friction.drives)))[:, None]
    squares = np.zeros(len(of_drive))
    for rows in observations.blocks():
        torques = observations.W[rows][:, friction.columns] * estimate.coefficients[list(friction.columns)]
        squares += ((torques @ of_drive.T) ** 2).sum(axis=0)
    sizes = np.sqrt(squares * len(observations.equations) / observations.y.size)
    return np.repeat(_BUMP * sizes, len(BUMP_SPEEDS))


@dataclass(frozen=True, eq=False)
class _Beside:
    """Columns G beside those of the parameters: what they explain that these do not, and what they do to these."""

    sums: Array  # (k, r) sums of the columns of unit length and independent of each other
    shown: Array  # (r, k) of errors of the columns, those that show as these sums
    reach: Array  # (p, k) change of the estimate by an error of each column
    c: Array  # (r,) of the sums, as identified beside the parameters
    C: Array  # (r, r) and its covariance
    freedom: int

    @classmethod
    def fitted(cls, estimate: Estimate, observations: Observations, G: Array, context: Context) -> _Beside | None:
        """Identify the columns, shape (m, k), beside the parameters; None where residuals do not tell their noise."""
        seen = np.isfinite(np.diag(estimate.covariance))
        rows = observations
        if not seen.all():
            names, units = (tuple(np.array(x)[seen].tolist()) for x in (observations.names, observations.units))
            rows = replace(observations, W=observations.matrix[:, seen], names=names, units=units)
        sums, shown, own = _unexplained(rows, G, divisors(estimate))
        reach = np.zeros((seen.size, G.shape[1]))
        reach[seen] = own
        if not (rank := sums.shape[1]):
            return cls(sums, shown, reach, np.zeros(0), np.zeros((0, 0)), 1)
        wider = rows.beside(G @ sums, [f"beside {k}" for k in range(1, rank + 1)])
        other = with_covariance(weighted(wider), wider, context.recipe.covariance, *noise_origin(context))
        c, C = other.values[-rank:], other.covariance[-rank:, -rank:]
        return cls(sums, shown, reach, c, C, max(other.degrees_of_freedom, 1)) if np.all(np.isfinite(C)) else None

    def moments(self) -> Array:
        """Second moments of the estimate's error by errors of the columns of variance one beforehand, shape (p, p)."""
        gain = self.shown.T @ np.linalg.pinv(self.shown @ self.shown.T + self.C, hermitian=True)
        mean, left = gain @ self.c, np.eye(len(gain)) - gain @ self.shown
        return np.asarray(self.reach @ (np.outer(mean, mean) + left) @ self.reach.T)


_WIDER = 1.5  # times as wide, an interval is worth a note


def allowing_for_nuisances(estimate: Estimate, observations: Observations, context: Context) -> Estimate:
    """Extend the covariance by what a model lacks: friction of another form, and constants that the logs leave open."""
    if estimate.mismatch is not None:
        moments = estimate.mismatch
        note = "friction of the logs differs over speed from what the model has, which the intervals include"
        estimate = replace(allowing_for(estimate, np.eye(len(moments)), note, covariance=moments), mismatch=None)
    if estimate.method not in METHODS or observations.W.nbytes > _LARGEST:
        return estimate
    G = _likely_constants(observations, context)
    beside = _Beside.fitted(estimate, observations, G, context) if G.size else None
    if beside is None:
        return estimate
    wider = allowing_for(estimate, np.eye(len(estimate.names)), covariance=beside.moments())
    worst, ratio = largest_share(estimate, wider.deviation)
    if ratio < _WIDER:
        return wider
    of_wrench = context.target.model.channel == "wrench"
    share, what = (BIAS_SHARE, "forces and torques") if of_wrench else (OFFSET_SHARE, "torques")
    note = (
        f"an offset of {percent(share, 1)} of the measured {what} (standard deviation) may hide in these logs, which "
        f"the intervals include: that of {estimate.names[worst]} is {ratio:.2g} times as wide"
    )
    return noted(wider, note)


def _likely_constants(observations: Observations, context: Context) -> Array:
    """Constants of the measured torques that the model has not, as large as they may be, in the rows, shape (m, k)."""
    model, base, measured = context.target.model, context.target.base, [part.measured for part in context.prepared]
    size = np.sqrt(np.mean(np.concatenate(measured) ** 2, axis=0))
    if model.channel == "wrench":
        bias = np.asarray(context.recipe.bias or ())
        if context.recipe.bias is not None and not bias.any():  # as stated
            return np.zeros((observations.y.size, 0))
        size = BIAS_SHARE / OFFSET_SHARE * np.repeat(np.linalg.norm(size.reshape(2, 3), axis=1), 3)
        size = size * (bias == 0.0) if bias.any() else size  # of what is not found
    columns = nuisance_columns(context, constants) * OFFSET_SHARE * size
    own = [k for k, index in enumerate(base.index) if base.columns[int(index)].kind == OFFSET]
    W = observations.matrix[:, own]
    left = columns - W @ np.linalg.lstsq(W, columns)[0]
    return np.asarray(columns[:, np.linalg.norm(left, axis=0) > _SHOWN * np.linalg.norm(columns, axis=0)])


def bumps(target: IdentificationTarget, parts: Sequence[PreparedLog], recipe: Recipe) -> Array:
    """Torque of every bump of every drive in the equations, shape (m, k)."""
    C = friction_rows(target.robot)
    fastest = np.max([np.abs(part.samples.dq @ C.T).max(axis=0) for part in parts], axis=0)

    def torques(part: PreparedLog) -> Array:
        friction, speed = friction_drives(target, part.samples), part.samples.dq @ C.T
        direction = drive_directions(target.robot, part.samples, recipe.sign_width, recipe.breakaway)
        s = np.sign(speed) if direction is None else direction
        shapes = [s * np.exp(-((speed / (share * np.where(fastest > 0, fastest, 1.0))) ** 2)) for share in BUMP_SPEEDS]
        rows = dict(zip(friction.drives, friction.rows, strict=True))
        return np.array([np.outer(shape[:, drive], row) for drive, row in rows.items() for shape in shapes])

    return instant_columns(Context(target, tuple(parts), recipe), torques)


def _unexplained(observations: Observations, G: Array, divisor: Array) -> tuple[Array, Array, Array]:
    """Sums, what shows of G as these, and what G does to beta, see `_Beside`."""
    k, p = G.shape[1], observations.W.shape[1]
    both = GroupFactors.of(observations, front=G).stacked(divisor)
    R = triangular_factor(np.hstack([both[:, k : k + p], both[:, :k]]))  # of the weighted [W G]
    size = column_lengths(R[:, p:])
    _, s, V = np.linalg.svd(R[p:, p:] / size, full_matrices=False)
    kept = s > _SHOWN
    shown = s[kept, None] * V[kept] * size
    sums = V[kept].T / s[kept] / size[:, None]
    return sums, shown, -np.asarray(scipy.linalg.solve_triangular(R[:p, :p], R[:p, p:]))
