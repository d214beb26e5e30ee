"""Covariance of an estimate with correlated residuals, as from filtered or oversampled logs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from excite.identification.autoregressive_noise import NoiseGroup, autoregressive_covariance
from excite.identification.cumulated_noise import NoiseOrigin, NoisePaths, noise_paths
from excite.identification.estimate import Estimate
from excite.identification.estimators.huber import THRESHOLD
from excite.identification.factors import GroupFactors
from excite.identification.observations import Observations
from excite.identification.residuals import autocorrelation, effective_samples
from excite.identification.solution import LinearSolution, solve_triangular_system
from regressors.errors import InputError, UnknownName
from regressors.samples import Array, Index

_EQUAL = ("least-squares", "recursive")  # methods that weight all rows equally
_WEIGHTED = ("weighted", "huber", "physical", "log-cholesky")
METHODS = (*_EQUAL, *_WEIGHTED)
_PER_DEGREE = 4  # effective rows of an equation, whose spectrum is estimated at the motion's frequencies alone
_LEAST = 3


def robust_covariance(
    estimate: Estimate, observations: Observations, kind: str = "robust", origin: NoiseOrigin | None = None
) -> Estimate:
    """Replace an estimate's covariance by one that allows for residuals correlated in time and across equations.

    ``newey-west``: ``(W' V W)^-1 S (W' V W)^-1`` with ``S = sum_|k|<B (1 - |k|/B) sum_t g_t g_{t+k}'`` over the
    instants t of each log, ``g_t`` the sum of ``w_i v_i e_i`` over the rows i of the instant [Newey, West 1987]. B is
    chosen per log as for first-order autocorrelated residuals [Andrews 1991] eq. (6.2), (6.4). ``effective``: the
    covariance of the estimate times rows over effective rows, see `excite.identification.residuals`.
    ``autoregressive``: that of stationary noise, see `excite.identification.autoregressive_noise`. ``robust``: the
    latter, each deviation at least that of ``newey-west``, which allows for noise that changes with the motion.

    Parameters
    ----------
    estimate : Estimate
        By least-squares, recursive (nothing forgotten), weighted, huber (default threshold), physical, log-cholesky.
    observations : Observations
        Observations that the estimate was computed from.
    kind : {"robust", "newey-west", "autoregressive", "effective"}
    origin : NoiseOrigin, optional
        Where the noise of the rows comes from, for models of time windows.

    Returns
    -------
    Estimate
        With a quarter of the effective rows per equation, less parameters, as degrees of freedom, at least 3: the
        scatter of the deviations themselves in benchmarks/coverage; the assumption is added to the notes.

    Raises
    ------
    UnknownName
        No such kind.
    InputError
        An estimation method for which this covariance is not derived.
    """
    if kind not in _KINDS:
        raise UnknownName("kind of robust covariance", kind, _KINDS)
    if estimate.method not in METHODS:
        raise InputError(
            f"robust covariance is not implemented for the estimator {estimate.method}; "
            f"expected one of {', '.join(METHODS)}"
        )
    rows = _correlation(estimate, observations, noise_paths(estimate, observations, origin or NoiseOrigin()))
    covariance, note = _KINDS[kind](estimate, observations, rows)
    seen = np.isfinite(np.diag(estimate.covariance))
    kept = np.where(np.outer(seen, seen), covariance, estimate.covariance)
    spent = observations.y.size - estimate.degrees_of_freedom
    freedom = max(_LEAST, int((rows.effective - spent) / (_PER_DEGREE * len(observations.equations))))
    return replace(estimate, covariance=kept, degrees_of_freedom=freedom, notes=(*estimate.notes, note))


def group_scale(estimate: Estimate) -> Array:
    """Noise of each group, 1 where it is unknown, shape (groups,)."""
    noise = estimate.noise.ravel()
    return np.asarray(np.where(np.isfinite(noise) & (noise > 0), noise, 1.0))


def divisors(estimate: Estimate) -> Array:
    """Divisor of each group's rows in the method of an estimate, one of `METHODS`, shape (groups,)."""
    scale = group_scale(estimate)
    return scale if estimate.method in _WEIGHTED else np.ones_like(scale)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Residuals divided by their noise, and their correlation."""

    scale: Array  # per group
    ratio: Array  # per row
    lag_one: Array  # per log: the mean of its groups
    effective: float
    paths: NoisePaths


def _correlation(estimate: Estimate, observations: Observations, paths: NoisePaths) -> _Rows:
    scale = group_scale(estimate)
    group = observations.group
    lag_one, effective = np.zeros(len(observations.logs)), 0.0
    for log in range(len(observations.logs)):
        correlations = []
        for g in np.unique(group[observations.log == log]):
            r = autocorrelation(paths.noise[group == g])
            effective += effective_samples(r)
            correlations.append(float(r[1]) if r.size > 1 else 0.0)
        lag_one[log] = np.mean(correlations) if correlations else 0.0
    return _Rows(scale, paths.noise / scale[group], lag_one, effective, paths)


def _effective(estimate: Estimate, observations: Observations, rows: _Rows) -> tuple[Array, str]:
    share = observations.y.size / rows.effective
    note = f"covariance for {rows.effective:.0f} effective rows of {observations.y.size}"
    return estimate.covariance * share, note


def _newey_west(estimate: Estimate, observations: Observations, rows: _Rows) -> tuple[Array, str]:
    bread, score = _problem(estimate, observations, rows, divisors(estimate))
    spread = np.zeros((bread.half.shape[1], bread.half.shape[1]))
    widths = []
    for log in range(len(observations.logs)):
        rows_of_log = np.flatnonzero(observations.log == log)
        if rows_of_log.size == 0:
            continue
        part = slice(rows_of_log[0], rows_of_log[-1] + 1)  # the rows of a log are contiguous
        g = _instant_sums(rows.paths.sums[part] * score[part, None], observations.time[part]) @ bread.half
        width = bandwidth(float(rows.lag_one[log]), len(g))
        widths.append(width)
        spread += _bartlett(g, width)
    m = observations.y.size
    spread *= m / max(1, estimate.degrees_of_freedom)
    over = " to ".join(str(width) for width in sorted({min(widths), max(widths)}))
    note = f"covariance by Newey and West over {over} instants, about {rows.effective:.0f} effective rows of {m}"
    return np.asarray(bread.half @ spread @ bread.half.T), note


def _autoregressive(estimate: Estimate, observations: Observations, rows: _Rows) -> tuple[Array, str]:
    divisor = divisors(estimate)
    bread, score = _problem(estimate, observations, rows, divisor)
    groups = []
    for g in np.unique(observations.group):
        part = np.flatnonzero(observations.group == g)
        weight = 1.0 / divisor[g] ** 2
        X, U = rows.paths.rows[part] @ bread.half, rows.paths.sums[part] @ bread.half
        groups.append(NoiseGroup(score[part] / weight, X, weight * U, rows.paths.channels[part]))
    covariance = bread.half @ autoregressive_covariance(groups, rows.effective) @ bread.half.T
    return covariance, f"covariance for autoregressive noise, about {rows.effective:.0f} effective rows"


def _robust(estimate: Estimate, observations: Observations, rows: _Rows) -> tuple[Array, str]:
    """That of stationary noise, scaled where that of Newey and West is larger."""
    stationary, _ = _autoregressive(estimate, observations, rows)
    other, note = _newey_west(estimate, observations, rows)
    ratio = np.divide(np.diag(other), np.diag(stationary), out=np.ones(len(other)), where=np.diag(stationary) > 0)
    factor = np.sqrt(np.maximum(ratio, 1.0))
    return stationary * np.outer(factor, factor), f"{note}; each deviation at least that for autoregressive noise"


_Kind = Callable[[Estimate, Observations, _Rows], tuple[Array, str]]
_KINDS: dict[str, _Kind] = {
    "robust": _robust,
    "newey-west": _newey_west,
    "autoregressive": _autoregressive,
    "effective": _effective,
}


def _problem(
    estimate: Estimate, observations: Observations, rows: _Rows, divisor: Array
) -> tuple[LinearSolution, Array]:
    """Least-squares solution, whose `half` is a factor of ``(W'VW)^-1``, and ``v_i e_i`` of every row."""
    solution = solve_triangular_system(GroupFactors.of(observations).stacked(divisor))
    ratio = rows.ratio
    if estimate.method == "huber":
        inside = float(np.mean(np.abs(ratio) <= THRESHOLD))
        ratio = np.clip(ratio, -THRESHOLD, THRESHOLD) / max(inside, 1e-12)
    group = observations.group
    return solution, np.asarray(ratio * rows.scale[group] / divisor[group] ** 2)


def _instant_sums(g: Array, time: Array) -> Array:
    starts: Index = np.append(0, np.flatnonzero(np.diff(time) != 0) + 1)
    return np.asarray(np.add.reduceat(g, starts, axis=0))


def bandwidth(lag_one: float, count: int) -> int:
    """Instants B of the triangular kernel, ``1.1447 (alpha n)^(1/3)``, ``alpha = 4 r^2 / ((1 - r)^2 (1 + r)^2)``.

    Parameters
    ----------
    lag_one : float
        Autocorrelation r of the residuals from one instant to the next.
    count : int
        Instants n.

    Returns
    -------
    int
        At least 1, which assumes no correlation in time; at most a quarter of the instants.
    """
    r = min(max(lag_one, -0.99), 0.99)
    alpha = 4 * r**2 / ((1 - r) ** 2 * (1 + r) ** 2)
    return max(1, min(int(np.ceil(1.1447 * (alpha * count) ** (1 / 3))), count // 4))


def _bartlett(g: Array, width: int) -> Array:
    """``sum_|k|<B (1 - |k|/B) sum_t g_t g_{t+k}'``: outer products of all sums over B instants, divided by B."""
    edge = np.zeros((1, g.shape[1]))
    total = np.concatenate([edge, np.cumsum(g, axis=0)])
    ends = np.arange(1, len(g) + width)
    sums = total[np.minimum(ends, len(g))] - total[np.maximum(ends - width, 0)]
    return np.asarray(sums.T @ sums / width)
