"""Covariance of an estimate with correlated residuals, as from filtered or oversampled logs, and their density."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from excite.identification.estimator import Estimate, LinearSolution, solve_triangular_system
from excite.identification.estimators.robust import THRESHOLD
from excite.identification.noise import (
    NoiseGroup,
    NoisePaths,
    autoregressive_covariance,
    noise_paths,
    residual_diagnostics,
)
from excite.identification.observations import GroupFactors, Observations, row_stretches, rows_of_groups
from excite.identification.streamed_rows import Rows
from excite.information.half_widths import residual_degrees_of_freedom
from regressors.errors import InputError, UnknownName
from regressors.samples import Array, Index

_EQUAL = ("least-squares", "recursive")  # methods that weight all rows equally
_WEIGHTED = ("weighted", "huber", "physical")
METHODS = (*_EQUAL, *_WEIGHTED)
_SCALED = "the noise of each window is taken to be that of the measurements times what multiplies them there"
_BLOCK = 2**13  # rows that are multiplied at once
_SHOWN = 1e-3  # share of its mean by which a stretch of rows must show a direction


def robust_covariance(
    estimate: Estimate,
    observations: Observations,
    kind: str = "robust",
    cumulated: bool = False,
    channels: Array | None = None,
) -> Estimate:
    """Replace an estimate's covariance by one that allows for residuals correlated in time and across equations.

    ``newey-west``: ``(W' V W)^-1 S (W' V W)^-1`` with ``S = sum_|k|<B (1 - |k|/B) sum_t g_t g_{t+k}'`` over the
    instants t of each log, ``g_t`` the sum of ``w_i v_i e_i`` over the rows i of the instant [Newey, West 1987]. B is
    chosen per log as for first-order autocorrelated residuals [Andrews 1991] eq. (6.2), (6.4).
    ``autoregressive``: that of stationary noise, see `excite.identification.noise`. ``robust``: the
    latter, each deviation at least that of ``newey-west``, which allows for noise that changes with the motion.
    """
    if kind not in _KINDS:
        raise UnknownName("kind of robust covariance", kind, _KINDS)
    if estimate.method not in METHODS:
        raise InputError(
            f"robust covariance is not implemented for the estimator {estimate.method}; "
            f"expected one of {', '.join(METHODS)}"
        )
    paths = noise_paths(estimate, observations, cumulated, channels)
    covariance, note = _KINDS[kind](estimate, observations, paths)
    seen = np.isfinite(np.diag(estimate.covariance))
    kept = np.where(np.outer(seen, seen), covariance, estimate.covariance)
    spent = observations.y.size - estimate.degrees_of_freedom
    freedom = residual_degrees_of_freedom(paths.effective, spent, len(observations.equations))
    notes = (note,) if channels is None else (note, _SCALED)
    return replace(estimate, covariance=kept, degrees_of_freedom=freedom, notes=(*estimate.notes, *notes))


def group_scale(estimate: Estimate) -> Array:
    """Noise of each group, 1 where it is unknown, shape (groups,)."""
    noise = estimate.noise.ravel()
    return np.asarray(np.where(np.isfinite(noise) & (noise > 0), noise, 1.0))


def divisors(estimate: Estimate) -> Array:
    """Divisor of each group's rows in the method of an estimate, one of `METHODS`, shape (groups,)."""
    scale = group_scale(estimate)
    return scale if estimate.method in _WEIGHTED else np.ones_like(scale)


def _newey_west(estimate: Estimate, observations: Observations, paths: NoisePaths) -> tuple[Array, str]:
    bread, score = _problem(estimate, observations, paths, divisors(estimate))
    spread = np.zeros((bread.half.shape[1], bread.half.shape[1]))
    widths = []
    for log in range(len(observations.logs)):
        blocks = list(observations.blocks(log))
        if not blocks:
            continue
        time = observations.time[blocks[0].start : blocks[-1].stop]
        width = bandwidth(float(paths.lag_one[log]), 1 + int(np.count_nonzero(time[1:] != time[:-1])))
        widths.append(width)
        sums = (_instant_sums(paths.sums[k] * score[k, None], observations.time[k]) @ bread.half for k in blocks)
        spread += _bartlett(sums, width)
    m = observations.y.size
    spread *= m / max(1, estimate.degrees_of_freedom)
    over = " to ".join(str(width) for width in sorted({min(widths), max(widths)}))
    note = f"the noise is correlated: {m} rows count as {paths.effective:.0f} (Newey and West over {over} instants)"
    return np.asarray(bread.half @ spread @ bread.half.T), note


def _autoregressive(estimate: Estimate, observations: Observations, paths: NoisePaths) -> tuple[Array, str]:
    divisor, group, m = divisors(estimate), observations.group, observations.y.size
    bread, score = _problem(estimate, observations, paths, divisor)
    groups = []
    alike = paths.sums is paths.rows
    stretches = row_stretches(observations) if alike else [slice(0, m)]  # cumulated sums reach over the whole log
    X = [_product(paths.rows, stretch, bread.half) for stretch in stretches]
    share = sum(map(len, X)) / m
    if share < 1.0:
        frame = _whitening([x / divisor[group[stretch], None] for x, stretch in zip(X, stretches, strict=True)], share)
        X = [x @ frame for x in X]
    U = X if alike else [_product(paths.sums, stretch, bread.half) for stretch in stretches]
    for x, u, stretch in zip(X, U, stretches, strict=True):
        for g in np.flatnonzero(np.bincount(group[stretch])):
            part, weight = group[stretch] == g, 1.0 / divisor[g] ** 2
            noise, channels = score[stretch][part] / weight, paths.channels[stretch][part]
            groups.append(NoiseGroup(noise, x[part], weight * u[part], channels))
    covariance = bread.half @ autoregressive_covariance(groups, paths.effective, share) @ bread.half.T
    note = f"the noise is correlated: {m} rows count as {paths.effective:.0f} (autoregressive model)"
    return covariance, note if share == 1.0 else f"{note}; found from {sum(map(len, X))} of {m} rows"


def _product(whole: Rows, stretch: slice, half: Array) -> Array:
    """``W[stretch] @ half``, block by block."""
    edges = [*range(stretch.start, stretch.stop, _BLOCK), stretch.stop]
    return np.concatenate([whole[a:b] @ half for a, b in itertools.pairwise(edges)])


def _whitening(X: Sequence[Array], share: float) -> Array:
    """Frame in which white noise of these rows would give what that of all rows gives, shape (r, r)."""
    values, vectors = np.linalg.eigh(sum((x.T @ x for x in X), np.zeros((X[0].shape[1],) * 2)) / share)
    return np.asarray((vectors / np.sqrt(np.maximum(values, _SHOWN))) @ vectors.T)


def _robust(estimate: Estimate, observations: Observations, paths: NoisePaths) -> tuple[Array, str]:
    """That of stationary noise, scaled where that of Newey and West is larger."""
    stationary, assumed = _autoregressive(estimate, observations, paths)
    other, note = _newey_west(estimate, observations, paths)
    ratio = np.divide(np.diag(other), np.diag(stationary), out=np.ones(len(other)), where=np.diag(stationary) > 0)
    factor = np.sqrt(np.maximum(ratio, 1.0))
    stretches = assumed.partition("; ")[2]
    least = "no deviation is below that of an autoregressive model" + (stretches and f", {stretches}")
    return stationary * np.outer(factor, factor), f"{note}; {least}"


_Kind = Callable[[Estimate, Observations, NoisePaths], tuple[Array, str]]
_KINDS: dict[str, _Kind] = {"robust": _robust, "newey-west": _newey_west, "autoregressive": _autoregressive}


def _problem(
    estimate: Estimate, observations: Observations, paths: NoisePaths, divisor: Array
) -> tuple[LinearSolution, Array]:
    """Least-squares solution, whose `half` is a factor of ``(W'VW)^-1``, and ``v_i e_i`` of every row."""
    solution = solve_triangular_system(GroupFactors.of(observations).stacked(divisor))
    score, scale, inside = np.array(paths.noise), group_scale(estimate), 0
    for g, own in rows_of_groups(observations.group):
        if estimate.method == "huber":
            ratio = score[own] / scale[g]
            inside += int(np.count_nonzero(np.abs(ratio) <= THRESHOLD))
            score[own] = np.clip(ratio, -THRESHOLD, THRESHOLD) * scale[g]
        score[own] /= divisor[g] ** 2
    return solution, score if estimate.method != "huber" else score / max(inside / score.size, 1e-12)


def _instant_sums(g: Array, time: Array) -> Array:
    starts: Index = np.append(0, np.flatnonzero(np.diff(time) != 0) + 1)
    return np.asarray(np.add.reduceat(g, starts, axis=0))


def bandwidth(lag_one: float, count: int) -> int:
    """Instants B of the triangular kernel, ``1.1447 (alpha n)^(1/3)``, ``alpha = 4 r^2 / ((1 - r)^2 (1 + r)^2)``."""
    r = min(max(lag_one, -0.99), 0.99)
    alpha = 4 * r**2 / ((1 - r) ** 2 * (1 + r) ** 2)
    return max(1, min(int(np.ceil(1.1447 * (alpha * count) ** (1 / 3))), count // 4))


def _bartlett(parts: Iterable[Array], width: int) -> Array:
    """``sum_|k|<B (1 - |k|/B) sum_t g_t g_{t+k}'``: outer products of all sums over B instants, divided by B.

    The g are given in parts, one after the other; of each, the last B - 1 are carried over to the next.
    """
    carried, spread = None, np.zeros((0, 0))
    for g in itertools.chain(parts, (None,)):
        if carried is None:
            assert g is not None
            carried, spread = np.zeros((width - 1, g.shape[1])), np.zeros((g.shape[1], g.shape[1]))
        g = np.zeros_like(carried) if g is None else g  # sums that reach beyond the end
        rows = np.concatenate([carried, g])
        total = np.concatenate([np.zeros((1, rows.shape[1])), np.cumsum(rows, axis=0)])
        sums = total[width:] - total[:-width]
        spread += sums.T @ sums
        carried = rows[len(rows) - width + 1 :]
    return np.asarray(spread / width)


def with_covariance(
    estimate: Estimate, observations: Observations, kind: str, cumulated: bool = False, channels: Array | None = None
) -> Estimate:
    """Choose the covariance of an estimate by the correlation of its residuals, or as asked for.

    Noise that enters by channels is as large as these, such as velocities, and so not white where it is uncorrelated.
    """
    if kind == "auto" and not cumulated and channels is None:
        residuals = residual_diagnostics(estimate, observations)
        kind = "white" if all(one.whiteness > 0.001 or abs(one.lag_one) < 0.05 for one in residuals) else "auto"
    if kind == "white":
        return estimate
    if kind == "auto" and estimate.method not in METHODS:
        note = "the intervals are too narrow: they assume independent residuals, but these are correlated in time"
        return replace(estimate, notes=(*estimate.notes, note))
    return robust_covariance(estimate, observations, cumulated=cumulated, channels=channels)


def condition_number(observations: Observations) -> float:
    """cond(W), infinite where a column vanishes or depends on others."""
    factors = GroupFactors.of(observations)
    R = factors.stacked(np.ones(len(factors.R)))[:, :-1]
    sigma = np.linalg.svd(R, compute_uv=False)
    return float(sigma[0] / sigma[-1]) if R.shape[0] >= R.shape[1] and sigma[-1] > 1e-13 * sigma[0] else np.inf


def noise_density(estimate: Estimate, observations: Observations) -> Array:
    """Noise of each equation whose white version would give the deviations that the estimate states.

    With the residuals' deviation s_g of the n_g rows of log and equation g over T seconds, white noise would give the
    information ``J = sum_g W_g' W_g / s_g^2``. The covariance C that the estimate states allows for correlated
    residuals, scatter between logs and more; on average over all directions of the parameters it is
    ``c = (det C det J)^(1/p)`` times ``J^-1``. The density of equation j is ``sqrt(c mean_g s_g^2 T_g / n_g)``, over
    the logs.
    """
    count = np.bincount(observations.group, minlength=len(observations.logs) * len(observations.equations))
    count = count.reshape(len(observations.logs), -1)
    span = [np.ptp(observations.time[observations.log == k]) for k in range(len(observations.logs))]
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = np.where(count > 0, estimate.noise**2 * np.array(span)[:, None] / count, np.nan)
    known = np.isfinite(squares)
    mean = np.where(known, squares, 0.0).sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    return np.asarray(np.sqrt(mean * _inflation(estimate, observations)))


def _inflation(estimate: Estimate, observations: Observations) -> float:
    """Mean factor from the variances of white noise to those stated, over the parameters that are identified."""
    seen = np.flatnonzero(np.isfinite(np.diag(estimate.covariance)))
    R = GroupFactors.of(observations).stacked(group_scale(estimate))[:, : len(estimate.names)]
    if seen.size < len(estimate.names) or seen.size == 0:
        return 1.0
    size = np.linalg.norm(R, axis=0)
    stated = np.linalg.slogdet(estimate.covariance * np.outer(size, size))[1]
    white = 2.0 * np.log(np.abs(np.diag(np.linalg.qr(R / size, mode="r")))).sum()
    return float(np.exp((stated + white) / seen.size))
