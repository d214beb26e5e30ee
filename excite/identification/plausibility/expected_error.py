"""Error of predictions on other motions that the noise of the logs alone leads to one to expect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.identification.equations import measured_regressor
from excite.identification.estimate import Estimate
from excite.identification.observations import GroupFactors, Observations
from excite.identification.plausibility.large_residual import Doubt
from excite.identification.residuals import residual_diagnostics
from excite.information.target import IdentificationTarget
from regressors.samples import Array, Samples

_MOTIONS = 12
_CHUNK = 16384  # rows
_LEAST = 1e-12  # of the largest eigenvalue


@dataclass(frozen=True)
class ExpectedError:
    """Expected error of predictions on other motions, as part of the torque."""

    logs: float  # with what these logs determine
    # with one motion of their length that was chosen among some for it; None where it cannot be told
    designed: float | None


def expected_error(
    target: IdentificationTarget,
    observations: Observations,
    estimate: Estimate,
    travelled: Samples,
    seed: int = 0,
) -> ExpectedError:
    """``sqrt(sum_j tr(C W_j' W_j) / sum_j |tau_j|^2)`` over random motions of the size of the logs'.

    ``C = (sum_j W_j' W_j / s_j^2)^-1`` is the covariance of least squares from these equations, with ``s_j^2`` the mean
    square of the residuals of equation j times rows over effective rows, since they are correlated. It has no part
    from errors of the model, nor from what the estimator knows beyond the data: it says what the data determine. The
    designed motion is the one with the least error among the random ones, as long as the logs and as noisy.
    """
    rng = np.random.default_rng(seed)
    r = len(target.model.row_labels)
    motions = [measured_regressor(target, other_motion(travelled, rng)) for _ in range(_MOTIONS)]
    gram = np.sum([W.T @ W for W in motions], axis=0)
    torque = float(sum(np.sum((W @ estimate.coefficients) ** 2) for W in motions))
    noise = _effective_noise(estimate, observations)
    factors = GroupFactors.of(observations)
    weighted = factors.stacked(noise)[:, :-1]
    determined = _inverse(weighted.T @ weighted)
    if observations.equations != target.model.row_labels:  # of windows, whose noise is not that of torques
        return ExpectedError(_ratio(determined, gram, torque), None)
    counts = factors.count.reshape(-1, r)
    log_rows = counts.sum(axis=0)
    squares = np.where(counts > 0, noise.reshape(-1, r), 0.0) ** 2
    per_equation = np.sqrt((counts * squares).sum(axis=0) / log_rows)
    weight = np.tile(np.sqrt(log_rows * r / motions[0].shape[0]) / per_equation, motions[0].shape[0] // r)
    designed = min(_ratio(_inverse(_information(W, weight)), gram, torque) for W in motions)
    return ExpectedError(_ratio(determined, gram, torque), designed)


def _effective_noise(estimate: Estimate, observations: Observations) -> Array:
    """Noise that white residuals would need for the same uncertainty, per group; shape (groups,)."""
    noise = np.full(len(observations.logs) * len(observations.equations), np.inf)
    for g, one in zip(np.unique(observations.group), residual_diagnostics(estimate, observations), strict=True):
        noise[g] = one.rms * np.sqrt(one.rows / one.effective)
    least = 1e-9 * noise[np.isfinite(noise)].max(initial=0.0) or 1.0
    return np.asarray(np.maximum(noise, least))


def _information(W: Array, weight: Array) -> Array:
    """``W' diag(weight^2) W``, by parts, so that no second W is held."""
    parts = (slice(start, start + _CHUNK) for start in range(0, len(W), _CHUNK))
    weighted = (W[part] * weight[part, None] for part in parts)
    return np.asarray(sum((A.T @ A for A in weighted), np.zeros((W.shape[1], W.shape[1]))))


def _inverse(M: Array) -> Array:
    """``M^-1``, directions that M does not show having a variance as large as numbers allow."""
    sizes = np.sqrt(np.diag(M))
    sizes = np.where(sizes > 0, sizes, 1.0)
    values, vectors = np.linalg.eigh(M / np.outer(sizes, sizes))
    half = vectors / np.sqrt(np.maximum(values, _LEAST * values[-1])) / sizes[:, None]
    return np.asarray(half @ half.T)


def _ratio(C: Array, gram: Array, torque: float) -> float:
    return float(np.sqrt(np.sum(C * gram) / torque)) if torque > 0 else np.inf


HARMONICS = 5
_POINTS = 200  # in a period


def other_motion(travelled: Samples, rng: np.random.Generator) -> Samples:
    """A random band-limited motion within the ranges of positions, and the speeds and accelerations, of another.

    Every joint is a Fourier series of five harmonics with random amplitudes, about the middle of its range. It is as
    large as range, root mean square of the velocity and that of the acceleration allow; the period follows from their
    ratio.
    """
    n = travelled.q.shape[1]
    low, high = travelled.q.min(axis=0), travelled.q.max(axis=0)
    speed, acceleration = _rms(travelled.dq), _rms(travelled.ddq)
    moving = (high - low > 1e-6 * (high - low).max(initial=0.0)) & (speed > 0)
    rate = float(np.median(acceleration[moving] / speed[moving]))  # of the harmonics [rad/s]
    period = 2 * np.pi * np.sqrt(_mean_square_harmonic()) / rate
    time = np.arange(_POINTS) * (period / _POINTS)
    k = np.arange(1, HARMONICS + 1) * 2 * np.pi / period
    amplitude, phase = rng.normal(size=(n, HARMONICS)), rng.uniform(0, 2 * np.pi, (n, HARMONICS))
    angle = np.multiply.outer(time, k)[:, None, :] + phase
    q, dq, ddq = (
        np.sum(amplitude * part, axis=-1) for part in (np.sin(angle), k * np.cos(angle), -(k**2) * np.sin(angle))
    )
    allowed = [(high - low) / np.maximum(np.ptp(q, axis=0), 1e-300), speed / _rms(dq), acceleration / _rms(ddq)]
    scale = np.where(moving, np.min(allowed, axis=0), 0.0)
    middle = (low + high) / 2 - scale * (q.max(axis=0) + q.min(axis=0)) / 2
    return Samples(time, middle + scale * q, scale * dq, scale * ddq, np.zeros_like(q))


def _rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(x**2, axis=0)))


def _mean_square_harmonic() -> float:
    """Ratio of the mean squares of acceleration and velocity of the series, over the base frequency squared."""
    k = np.arange(1, HARMONICS + 1)
    return float(np.sum(k**4) / np.sum(k**2))


LARGEST = 0.10  # of the torque: the tolerance of a verdict, which the next log then exceeds by noise alone
_USEFUL = 0.8  # of the error: a designed motion that does not gain more is not proposed


def few_data(logs: int, expected: ExpectedError, method: str, excess: float = 0.0) -> Doubt | None:
    """Warning where predictions on other motions are expected to fail by the noise of the logs alone, or did fail."""
    if not max(expected.logs, excess) > LARGEST:
        return None
    what, noise = ("this log is", "its noise") if logs == 1 else (f"these {logs} logs are", "their noise")
    kept = (
        "what the estimate has beyond comes from the condition that bodies are real"
        if method == "physical"
        else "errors of the model come on top"
    )
    if excess > expected.logs:
        return Doubt(
            f"{what} too little",
            f"blocks of time that were left out are predicted by least squares with errors of {100 * excess:.2g} % of "
            f"the torque beyond those of the rows identified from, and {kept}",
            _cure(expected, method),
        )
    return Doubt(
        f"{what} too little",
        f"{noise} alone leaves errors of about {100 * expected.logs:.2g} % of the torque on other motions of the same "
        f"ranges and speeds, and {kept}",
        _cure(expected, method),
    )


def _cure(expected: ExpectedError, method: str) -> str:
    physical = "" if method == "physical" else ", or admit only parameters of real bodies with `estimator='physical'`"
    gain = expected.designed
    if gain is None or gain > _USEFUL * expected.logs:
        return f"add a log of another motion{physical}"
    return (
        f"the noise of a designed motion of the same length, ranges and speeds leaves about {100 * gain:.2g} %, that "
        f"of this one {100 * expected.logs:.2g} % (`design_trajectory`); or add a log of another motion{physical}"
    )
