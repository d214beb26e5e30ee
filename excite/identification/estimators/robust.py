"""Estimators for outliers and noisy regressors: Huber, total least squares, instrumental variables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.optimize

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
from excite.identification.estimators.least_squares import GroupWeights, residual_noise, scaled_covariance, weighting
from excite.identification.observations import GroupFactors, Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.numerical import independent_columns
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


def total(observations: Observations, ratio: float = 1.0, column_noise: Array | None = None) -> Estimate:
    """Smallest change of both sides, ``min ||[dW N^-1, dy]||`` with ``(W + dW) beta = y + dy``.

    Rows are divided by their noise, column j by its own ``nu_j``: the standard deviation of its errors where that of y
    is one. Columns with ``nu_j = 0`` are exact (mixed least squares and total least squares). The solution is the
    singular vector of the smallest singular value of ``[W N^-1, y]``; the covariance is the large-sample one,
    ``s^2 (1 + |x|^2) (D^-1 + sigma^2 D^-1 (E + x x')^-1 D^-1)`` with ``x = N beta``, ``D = N^-1 W'W N^-1 - sigma^2 E``,
    sigma the smallest singular value, ``s^2 = sigma^2 / (m - p)`` [Gleser 1981].
    """  # column_noise (p,)
    problem = weighting(observations)
    nu, note = _column_noise(observations, problem, ratio, column_noise)
    R, p = problem.R, observations.W.shape[1]
    index = independent_columns(R[:, :-1])
    x, C, variance = _minimiser(R[:, [*index, p]], nu[index], problem.freedom)
    values, covariance = np.zeros(p), np.zeros((p, p))
    values[index] = x
    covariance[np.ix_(index, index)] = C
    return problem.stated("total", observations, variance, values, covariance, (note, *problem.notes))


def _column_noise(
    observations: Observations, problem: GroupWeights, ratio: float, given: Array | None
) -> tuple[Array, str]:
    p = observations.W.shape[1]
    if given is not None:
        nu = np.asarray(given, dtype=float)
        if nu.shape != (p,) or not np.all(np.isfinite(nu) & (nu >= 0)):
            raise InputError(f"column_noise must be {p} numbers of zero or more, given {nu.tolist()}")
        return nu, "errors of the columns over those of y as given"
    if not (np.isfinite(ratio) and ratio >= 0):
        raise InputError(f"ratio must be zero or more, given {ratio}")
    size = problem.solution.size
    nu = ratio * np.linalg.norm(problem.R[:, :-1], axis=0) / size if size > 0 else np.zeros(p)
    return nu, f"relative error of every column {ratio:g} times that of y"


def _minimiser(R: Array, nu: Array, freedom: int) -> tuple[Array, Array, float]:
    """Parameters, covariance, variance of y's errors, from the factor of ``[W y]`` with independent columns."""
    p = nu.size
    order = np.argsort(nu > 0, kind="stable")  # exact columns first: projected out by the triangular form
    exact = int(np.sum(nu == 0))
    unit = np.where(nu > 0, nu, 1.0)[order]
    T = np.asarray(np.linalg.qr(np.column_stack([R[:, order] / unit, R[:, -1]]), mode="r"))
    inner = T[exact:, exact:]
    _, s, V = np.linalg.svd(np.concatenate([inner, np.zeros((max(p + 1 - exact - len(inner), 0), p + 1 - exact))]))
    sigma, v = s[-1], V[-1]
    gap = s[-2] if s.size > 1 else np.inf
    if abs(v[-1]) < 1e-12 or (sigma > 0 and gap <= sigma * (1 + 1e-9)):
        raise InputError("total least squares has no unique solution: the columns' errors are as large as the columns")
    x = np.zeros(p)
    x[exact:] = -v[:-1] / v[-1]
    x[:exact] = scipy.linalg.solve_triangular(T[:exact, :exact], T[:exact, p] - T[:exact, exact:p] @ x[exact:])
    variance = sigma**2 / freedom if freedom > 0 else np.nan
    back = np.zeros(p, dtype=np.intp)
    back[order] = np.arange(p)
    covariance = _covariance(T[:, :p], x, exact, sigma**2, variance)
    covariance = (covariance / np.outer(unit, unit))[np.ix_(back, back)]
    return (x / unit)[back], covariance, variance


def _covariance(T: Array, x: Array, exact: int, square: float, variance: float) -> Array:
    if np.isnan(variance):
        return np.diag(np.full(x.size, np.inf))
    noisy = np.arange(x.size) >= exact
    D = np.linalg.inv(T.T @ T - square * np.diag(noisy.astype(float)))
    z = x[exact:]
    inner = np.eye(z.size) - np.outer(z, z) / (1 + z @ z)  # (E + x x')^-1
    columns = D[:, exact:]
    return np.asarray(variance * (1 + z @ z) * (D + square * columns @ inner @ columns.T))


class Total(Estimator):
    """Weighted total least squares, with errors in the regressor as well."""

    name = "total"
    holds_rows = False

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `total`."""
        return total(observations)


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
    notes = ("instruments taken as free of the noise of the rows", start.notes[0])
    return stated_estimate("instrumental", observations, solution, variance, values, covariance, noise, notes)


def _projected(R: Array) -> LinearSolution:
    """Solution of ``Q'W beta = Q'y``, Q an orthonormal basis of the instruments, from the factor of ``[Z W y]``."""
    p = R.shape[1] // 2
    T = R[:p, :p]
    sizes = np.linalg.norm(T, axis=0)
    U, s, _ = np.linalg.svd(T / np.where(sizes > 0, sizes, 1.0))
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
        Z = instruments(commanded, context.target, context.prepared, context.recipe)
        return instrumental(observations, Z)


_FEW = 300  # instants that suffice to find the shift
FAR = 0.2  # of the motion's size: a log that deviates more did not follow the commanded motion


def commanded(trajectory: Trajectory, part: PreparedLog) -> Samples:
    """Commanded motion at the instants of a prepared log, shifted in time so that it fits best."""
    time, q = part.samples.time, part.samples.q
    period = trajectory.family.duration

    def at(delay: float) -> Samples:
        wrapped = trajectory.samples(np.mod(time - delay, period))
        return replace(wrapped, time=time)

    few = slice(None, None, max(1, time.size // _FEW))

    def misfit(delay: float) -> float:
        return float(np.sum((trajectory.samples(np.mod(time[few] - delay, period)).q - q[few]) ** 2))

    start = float(time[0])
    coarse = start + np.linspace(-period / 2, period / 2, 201)
    nearest = coarse[int(np.argmin([misfit(delay) for delay in coarse]))]
    step = period / 200
    minimum = scipy.optimize.minimize_scalar(misfit, bounds=(nearest - step, nearest + step), method="bounded")
    motion = at(float(minimum.x))
    size = float(np.linalg.norm(q - q.mean(axis=0)))
    astray = float(np.linalg.norm(motion.q - q)) / size if size > 0 else np.inf
    if astray > FAR:
        raise InputError(
            f"{part.log.source} does not follow the design's motion: "
            f"it deviates by {100 * astray:.0f} % of the size of the motion"
        )
    return motion


def instruments(
    trajectory: Trajectory, target: IdentificationTarget, parts: tuple[PreparedLog, ...], recipe: Recipe
) -> Array:
    """Regressor of the commanded motion, with the same rows as the measured one, shape (m, p)."""
    played = [replace(part, samples=commanded(trajectory, part)) for part in parts]
    return equations(target, played, recipe).matrix
