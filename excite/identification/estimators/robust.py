"""Estimators for outliers and noisy regressors: Huber, instrumental variables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from excite.identification.equations import equations
from excite.identification.estimator import (
    TOLERANCE,
    Context,
    Estimate,
    Estimator,
    LinearSolution,
    solve_triangular_system,
    stated_estimate,
)
from excite.identification.estimators.least_squares import residual_noise, scaled_covariance, weighting
from excite.identification.observations import GroupFactors, Observations
from excite.identification.preparation import PreparedLog
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.numerical import column_lengths
from regressors.samples import Array, Index, Samples

THRESHOLD = 1.345  # 95 % efficiency for normal noise
_NORMAL = 1.482602218505602  # standard deviation over median magnitude of a normal variable
_ITERATIONS = 300
_TOLERANCE = 1e-9  # last step over standard deviation
_FLOOR = 1e-11


def huber(observations: Observations, threshold: float = THRESHOLD) -> Estimate:
    """Huber's M-estimate: the solution of ``sum_i psi((y_i - w_i beta) / sigma_g) w_i / sigma_g = 0``.

    ``psi(u) = u`` up to the threshold, constant beyond; sigma_g is known, or 1.4826 times the median magnitude of the
    group's residuals. The same equation as that of iteratively reweighted least squares, with weights
    ``min(1, k / |u|)``; solved with modified residuals [Huber 1981, section 7.8], so that W is factored only once. The
    covariance is Huber's, ``K^2 (sum psi^2 / (m - p)) / mean(psi')^2 (W' Sigma^-1 W)^-1`` with
    ``K = 1 + p/m (1 - mean psi') / mean psi'`` [Huber 1981, section 7.6].
    """
    if not threshold > 0:
        raise InputError(f"huber: the threshold must be greater than zero, given {threshold}")
    solution, values, scale, ratio, step = _fit(observations, threshold)
    count = observations.y.size
    freedom = count - solution.rank
    inside = float(np.mean(np.abs(ratio) <= threshold))
    psi = np.clip(ratio, -threshold, threshold)
    variance = np.nan
    if freedom > 0 and inside > 0:
        correction = 1 + solution.rank / count * (1 - inside) / inside
        variance = correction**2 * float(psi @ psi) / freedom / inside**2
    notes: tuple[str, ...] = (
        f"residuals beyond {threshold:g} standard deviations are given less weight: {1 - inside:.2%} of {count} rows",
        "the noise is estimated from the median magnitude of the residuals"
        if observations.noise is None
        else "the threshold uses the given noise",
    )
    if step > _TOLERANCE:
        notes += (
            f"not converged: the last of {_ITERATIONS} iterations changed the estimate by {step:.1e} "
            "standard deviations",
        )
    covariance = scaled_covariance(solution.half, variance)
    noise = scale if observations.noise is None else observations.noise.ravel()
    return stated_estimate("huber", observations, solution, variance, values, covariance, noise, notes)


def _fit(observations: Observations, threshold: float) -> tuple[LinearSolution, Array, Array, Array, float]:
    """Solution of the whitened rows, the values, scale of each group, residuals divided by it, and the last step."""
    problem = weighting(observations)
    factors, scale, solution = problem.factors, problem.scale, problem.solution
    values, group = solution.values.copy(), observations.group
    members = [np.flatnonzero(group == g) for g in range(scale.size)]
    floor = _FLOOR * np.where(factors.sizes() > 0, factors.sizes(), 1.0)
    step = np.inf
    for _ in range(_ITERATIONS):
        residual = observations.y - observations.W @ values
        if observations.noise is None:
            spare = factors.count - factors.leverages(solution.half) / scale**2
            scale = np.maximum(_median_scale(residual, members, factors.count / np.maximum(spare, 1.0)), floor)
            solution = solve_triangular_system(factors.stacked(scale))
        ratio = residual / scale[group]
        if step <= _TOLERANCE:
            break
        modified = np.clip(ratio, -threshold, threshold) / scale[group]
        change = solution.half.T @ (modified @ observations.matrix)  # in standard deviations
        values = values + solution.half @ change
        step = float(np.linalg.norm(change))
    return solution, values, scale, ratio, step


def _median_scale(residual: Array, members: list[Index], inflation: Array) -> Array:
    medians = [np.median(np.abs(residual[rows])) if rows.size else 1.0 for rows in members]
    return np.asarray(_NORMAL * np.array(medians) * np.sqrt(inflation))


class Huber(Estimator):
    """Weighted least squares in which rows far from the rest count less."""

    name = "huber"

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `huber`."""
        return huber(observations)


_ROUNDS = 200
_SETTLED = 1e-9  # relative change of the noise


def instrumental(observations: Observations, instruments: Array) -> Estimate:
    """Instrumental-variable estimate ``beta = (Z' Sigma^-1 W)^-1 Z' Sigma^-1 y``.

    The triangular factor of ``[Z W y]`` holds ``Q'W`` and ``Q'y`` of ``Z = Q T`` in its first rows; with them
    ``beta = (Q'W)^-1 Q'y`` has the covariance ``(Q'W)^-1 (Q'W)^-T``, rows divided by their noise. The noise of
    each group is that of its residuals at this estimate, iterated until it converges.
    """  # instruments (m, p)
    Z = np.asarray(instruments, dtype=float)
    if Z.shape != observations.W.shape:
        raise InputError(f"instruments have shape {Z.shape}, the observations' W has {observations.W.shape}")
    if not np.all(np.isfinite(Z)):
        raise InputError("instruments must hold finite numbers")
    factors = GroupFactors.of(observations, front=Z)
    start = weighting(observations, factors)
    spare = np.maximum(factors.count * (1 - start.solution.rank / factors.rows), 1e-6 * factors.count + 1e-300)
    scale, solution = start.scale, _projected(factors.stacked(start.scale))
    floor = _FLOOR * np.where(factors.sizes() > 0, factors.sizes(), 1.0)
    for _ in range(_ROUNDS if observations.noise is None else 0):
        noise = np.maximum(np.sqrt(factors.squares(solution.values) / spare), floor)
        change = float(np.abs(np.log(noise / scale)).max())
        scale, solution = noise, _projected(factors.stacked(noise))
        if change < _SETTLED:
            break
    freedom = factors.rows - solution.rank
    variance = 1.0 if freedom > 0 or observations.noise is not None else np.nan
    values, covariance = solution.values, scaled_covariance(solution.half, variance)
    noise = residual_noise(observations, factors, values, factors.count - spare)
    notes = ("instruments taken as free of the noise of the rows", start.note)
    return stated_estimate("instrumental", observations, solution, variance, values, covariance, noise, notes)


def _projected(R: Array) -> LinearSolution:
    """Solution of ``Q'W beta = Q'y``, Q an orthonormal basis of the instruments, from the factor of ``[Z W y]``."""
    p = R.shape[1] // 2
    T = R[:p, :p]
    U, s, _ = np.linalg.svd(T / column_lengths(T))
    basis = U[:, s > TOLERANCE * s[0]]
    return solve_triangular_system(basis.T @ R[:p, p:])


class Instrumental(Estimator):
    """Instrumental variables: the regressor along the commanded motion, for noisy measured ones."""

    name = "instrumental"

    def check(self, commanded: Trajectory | None) -> None:
        """Check that the commanded motion is known."""
        if commanded is None:
            raise InputError("the estimator instrumental needs the commanded motion: name the `design` that was played")

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `instrumental`."""
        commanded = None if context is None else context.commanded
        self.check(commanded)
        assert context is not None
        assert commanded is not None
        return instrumental(observations, instruments(commanded, context))


_FEW = 300  # instants that suffice to find the shift
FAR = 0.2  # of the motion's size: a log that deviates more did not follow the commanded motion


def commanded(trajectory: Trajectory, part: PreparedLog) -> Samples:
    """Commanded motion at the instants of a prepared log, shifted in time so that it fits best."""
    time, q = part.samples.time, part.samples.q
    period = trajectory.family.duration

    few = slice(None, None, max(1, time.size // _FEW))

    def misfit(delay: float) -> float:
        return float(np.sum((trajectory.samples(np.mod(time[few] - delay, period)).q - q[few]) ** 2))

    start = float(time[0])
    coarse = start + np.linspace(-period / 2, period / 2, 201)
    nearest = coarse[int(np.argmin([misfit(delay) for delay in coarse]))]
    step = period / 200
    minimum = scipy.optimize.minimize_scalar(misfit, bounds=(nearest - step, nearest + step), method="bounded")
    motion = replace(trajectory.samples(np.mod(time - float(minimum.x), period)), time=time)
    size = float(np.linalg.norm(q - q.mean(axis=0)))
    astray = float(np.linalg.norm(motion.q - q)) / size if size > 0 else np.inf
    if astray > FAR:
        raise InputError(
            f"{part.log.source} does not follow the design's motion: "
            f"it deviates by {100 * astray:.0f} % of the size of the motion"
        )
    return motion


def instruments(trajectory: Trajectory, context: Context) -> Array:
    """Regressor of the commanded motion, with the same rows as the measured one, shape (m, p)."""
    played = [replace(part, samples=commanded(trajectory, part)) for part in context.prepared]
    return equations(context.target, played, context.recipe).matrix
