"""Bias of an estimate by noise in the measured motion (errors in variables), and intervals that allow for it.

Noise of the positions, or the steps of encoders, passes the filter and enters the regressor, whose noise pulls
parameters towards zero; more equations do not help. Its size is known from what was filtered out. Adding as much noise
once more, with both signs, which cancels what is linear in it, repeats the bias [Cook, Stefanski 1994]:
``d = (b(x + n) + b(x - n)) / 2 - b(x)``. Where h of the signal's power is noise, estimates are pulled by the factor
``1 - h``, and by ``(1 - h) / (1 + h)`` with twice the noise, so that the bias is ``d (1 + h) / (1 - h)``. The estimate
stays; the bias enters the covariance, ``Cov + bias bias'``.

Noise is largest in the highest derivative, and is added there alone: at reversals, steps of an encoder do not disturb
the sign of the velocity as white noise would.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from excite.identification.covariance import METHODS
from excite.identification.equations import equations
from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.preparation import PreparedLog, chosen_method
from excite.identification.recipe import Recipe
from excite.logs.saturation import within
from excite.signals.resampling import resample
from regressors.errors import ExciteError
from regressors.samples import Array, Samples

SHARE = 0.01  # noise over signal of an acceleration below which parameters are pulled by less than 1e-4
_MOST = 0.99  # of the signal's power that may be noise
_SAID = 0.1  # bias over deviation that is worth a note
_STRETCH = 2**16  # instants of a long log that its noise is determined from
_SIGNALS = ("butterworth", "savitzky-golay", "fourier", "differences")  # linear in the positions


@dataclass(frozen=True, eq=False)
class MotionNoise:
    """Noise of one log's motion, as random as the measured one, after the filter."""

    what: str  # which derivative
    # (N, n) its noise at the instants of the log's samples [rad/s^2 or rad/s, or with m]; zero in long logs where it
    # is below `SHARE`
    values: Array
    share: float  # largest ratio of noise to noisy signal, over the joints


def motion_noise(part: PreparedLog, recipe: Recipe, what: str, seed: int = 0) -> MotionNoise | None:
    """Draw noise of the size that was filtered out of a log's positions."""
    if recipe.average or recipe.measured_velocity or recipe.signals not in _SIGNALS:
        return None
    uniform = resample(part.log).log
    method, count = chosen_method(recipe).settled(uniform.time, uniform.q), len(part.samples.time)
    whole = recipe.signals == "fourier" or uniform.count <= _STRETCH
    uniform = uniform if whole else uniform.rows(_middle(uniform.count))
    rng = np.random.default_rng(seed)
    white = rng.normal(size=uniform.q.shape)
    passed = method.motion(uniform.time, white)
    if whole and passed.samples.q.shape != part.samples.q.shape:
        return None
    smooth = method.motion(uniform.time, uniform.q).samples.q  # not that of the part, which may be delayed
    used = ~within(passed.samples.time, part.left_out)  # impacts and gaps are no noise
    left = np.std((uniform.q[passed.kept] - smooth)[used], axis=0) if np.any(used) else np.zeros(white.shape[1])
    size = left / np.maximum(np.std(white[passed.kept] - passed.samples.q, axis=0), 1e-6)
    values = size * getattr(passed.samples, what)
    signal = np.sqrt(np.mean(getattr(part.samples, what) ** 2, axis=0))
    share = np.divide(np.std(values, axis=0), signal, out=np.zeros_like(signal), where=signal > 0)
    most = float(share.max(initial=0.0))
    if most < SHARE and not whole:
        values = np.broadcast_to(0.0, part.samples.q.shape)
    while len(values) < count:  # as random in every stretch
        more = method.motion(uniform.time, rng.normal(size=white.shape))
        values = np.concatenate([values, size * getattr(more.samples, what)])
    return MotionNoise(what, values[:count], most)


def _middle(count: int) -> slice:
    first = (count - _STRETCH) // 2
    return slice(first, first + _STRETCH)


def allowing_for_motion_noise(estimate: Estimate, estimator: Estimator, context: Context) -> Estimate:
    """Extend the covariance of an estimate by the bias that noise in the motion causes, where there is any."""
    if estimate.method not in METHODS:
        return estimate
    what = "ddq" if context.target.model.window is None else "dq"
    noises = [motion_noise(part, context.recipe, what, seed) for seed, part in enumerate(context.prepared)]
    known = [noise for noise in noises if noise is not None]
    if len(known) < len(noises) or max(noise.share for noise in known) < SHARE:
        return estimate
    try:
        bias = motion_bias(estimate, estimator, context, known)
    except ExciteError:  # so much noise that nothing can be estimated
        return replace(estimate, notes=(*estimate.notes, "the bias by noise in the motion could not be determined"))
    seen = np.isfinite(np.diag(estimate.covariance)) & np.isfinite(bias)
    bias = np.where(seen, bias, 0.0)
    relative = np.divide(
        np.abs(bias), estimate.deviation, out=np.zeros_like(bias), where=seen & (estimate.deviation > 0)
    )
    notes = estimate.notes
    if relative.max(initial=0.0) > _SAID:
        worst = int(np.argmax(relative))
        notes = (*notes, _note(estimate, worst, float(bias[worst]), float(relative[worst])))
    return replace(estimate, covariance=estimate.covariance + np.outer(bias, bias), notes=notes)


def _note(estimate: Estimate, worst: int, bias: float, relative: float) -> str:
    share = f"{100 * abs(bias / estimate.values[worst]):.2g} % or " if estimate.values[worst] else ""
    return (
        f"noise in the motion biases {estimate.names[worst]} most, by about {share}{relative:.2g} of its deviations; "
        "the intervals allow for that. A lower `cutoff` lessens it"
    )


def motion_bias(estimate: Estimate, estimator: Estimator, context: Context, noises: Sequence[MotionNoise]) -> Array:
    """Bias of an estimate by noise in the motion, shape (p,)."""
    shifted = [_estimated(estimator, context, noises, sign) for sign in (1.0, -1.0)]
    h = min(max(noise.share for noise in noises) ** 2, _MOST)
    return np.asarray((1 + h) / (1 - h) * ((shifted[0] + shifted[1]) / 2 - estimate.coefficients))


def _estimated(estimator: Estimator, context: Context, noises: Sequence[MotionNoise], sign: float) -> Array:
    """Estimate with the noise once more, shape (p,)."""
    parts = tuple(_shifted(part, noise, sign) for part, noise in zip(context.prepared, noises, strict=True))
    observations = equations(context.target, parts, context.recipe)
    observations = observations.held() if estimator.holds_rows else observations
    return estimator.estimate(observations, replace(context, prepared=parts)).coefficients


def _shifted(part: PreparedLog, noise: MotionNoise, sign: float) -> PreparedLog:
    moved = {field.name: getattr(part.samples, field.name) for field in fields(Samples)}
    moved[noise.what] = moved[noise.what] + sign * noise.values
    return replace(part, samples=Samples(**moved))
