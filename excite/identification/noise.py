"""Noise of residuals: whether it is white, and autoregressive and cumulated noise, with the covariance that it gives.

Noise that is stationary in time has few parameters, which are known far better than the products of single rows that
sandwich covariances average. Fitting p parameters removes noise from the residuals, most where the noise and the
motion have the same frequencies. The noise whose residuals would have the autocovariances that were found is a fixed
point: with the estimate's error ``d = sum_g B_g n_g`` the residuals are ``n_g - X_g d``, and their covariance is
``Omega_g - X_g B_g Omega_g - (X_g B_g Omega_g)' + X_g C X_g'``, where ``C = sum_g B_g Omega_g B_g'`` is that of d.

With ``e_k = sum_{j <= k} n_j``, the estimate's error ``(W' V W)^-1 sum_k v W_k e_k`` is
``(W' V W)^-1 sum_j v U_j n_j``,
with the sums of the rows from j to the end, ``U_j = sum_{k >= j} W_k``. The differences n of the residuals are noise
like that of any other model, so everything else follows as there, with U in place of W.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from excite.identification.equations import constants, nuisance_columns
from excite.identification.estimator import Context, Estimate
from excite.identification.observations import Observations, check_observations, rows_of_groups
from excite.identification.streamed_rows import Rows
from regressors.errors import InputError
from regressors.samples import Array, Index

_ITERATIONS = 30
_SETTLED = 0.002  # relative change of the deviations
_LITTLE = 0.01  # parameters over effective rows, below which fitting removes too little noise to matter
_DIVERGES = 100.0  # times the covariance before what fitting removes
_REWEIGHTED = 3
_COLUMNS = 8  # transformed at once, which bounds the memory


@dataclass(frozen=True, eq=False)
class NoiseGroup:
    """Residuals of one equation in one log, in the order of time."""

    noise: Array  # (n,)
    rows: Array  # (n, r) X of the module's equations
    influence: Array  # (n, r) B' of the module's equations
    # (n, c) D: the noise is the sum over the channels of D times stationary noise of the same autocorrelation, as
    # where torques are multiplied by velocities; ones for noise that is stationary itself
    channels: Array


@dataclass(frozen=True, eq=False)
class AutoregressiveNoise:
    """``n_t = sum_k a_k n_{t-k} + u_t`` with white u."""

    coefficients: Array  # (order,)
    variance: float  # of u

    def spectrum(self, count: int) -> Array:
        """``variance / |1 - sum_k a_k exp(-i w k)|^2`` at the frequencies of a real transform of ``count`` values."""
        polynomial = np.append(1.0, -self.coefficients)
        return np.asarray(self.variance / np.abs(scipy.fft.rfft(polynomial, count)) ** 2)


def autoregressive_noise(autocovariance: Array, count: int) -> AutoregressiveNoise:
    """Noise by Yule and Walker, of the order with the least ``n log(variance) + order log(n)`` [Schwarz 1978]."""
    # autocovariance (lags + 1,)
    best, least = AutoregressiveNoise(np.zeros(0), float(autocovariance[0])), 0.0
    a, variance = np.zeros(0), float(autocovariance[0])
    for order in range(1, autocovariance.size):
        reflection = (autocovariance[order] - a @ autocovariance[order - 1 : 0 : -1]) / variance
        if not abs(reflection) < 1.0:
            break
        a = np.append(a - reflection * a[::-1], reflection)
        variance *= 1.0 - reflection**2
        score = count * np.log(variance / autocovariance[0]) + order * np.log(count)
        if score < least:
            best, least = AutoregressiveNoise(a, variance), score
    return best


def noise_of_residuals(residual: Array) -> AutoregressiveNoise:
    """Stationary noise of which one equation's residuals are a sample, shape (n,) in the order of time."""
    return autoregressive_noise(_autocovariance(residual, _shares(np.ones((residual.size, 1)))), residual.size)


def autoregressive_covariance(groups: Sequence[NoiseGroup], effective: float, share: float = 1.0) -> Array:
    """Covariance C of the module's equations, shape (r, r)."""
    scaled = [np.asarray(group.channels * _sizes(group)) for group in groups]
    shares = [_shares(D) for D in scaled]
    found = [_autocovariance(group.noise, share) for group, share in zip(groups, shares, strict=True)]
    aim = found
    C = np.zeros((groups[0].rows.shape[1],) * 2)
    first: Array | None = None
    for _ in range(_ITERATIONS):
        fitted = [autoregressive_noise(r, group.noise.size) for r, group in zip(aim, groups, strict=True)]
        spread = [_spread(*each) for each in zip(groups, scaled, fitted, strict=True)]
        before, C = C, np.asarray(sum(covariance for _, covariance in spread)) / share
        first = C if first is None else first
        if np.trace(C) > _DIVERGES * np.trace(first):  # almost as many parameters as effective rows: as for white noise
            C = first * effective / max(effective - C.shape[0], 1.0)
            break
        settled = np.allclose(np.diag(before), np.diag(C), rtol=2 * _SETTLED, atol=0.0)
        if settled or C.shape[0] < _LITTLE * effective:
            break
        C = _positive(C)
        parts = zip(found, groups, spread, shares, strict=True)
        aim = [r + _removed(group.rows, carried, C, of_lag) for r, group, (carried, _), of_lag in parts]
    return _positive(C)


def _positive(C: Array) -> Array:
    """A covariance without what rounding makes negative."""
    values, vectors = np.linalg.eigh(C)
    half = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(half @ half.T)


def _sizes(group: NoiseGroup) -> Array:
    """Deviation of each channel's noise by least squares of ``n_t^2 = sum_c (s_c D_tc)^2``, relative to the largest."""
    squares, target = group.channels**2, group.noise**2
    if squares.shape[1] == 1:
        return np.ones(1)
    weight = 1.0 / np.maximum(squares.sum(axis=1), 1e-9 * squares.sum(axis=1).max())  # n^2 varies as its mean does
    for _ in range(_REWEIGHTED):
        variances, _ = scipy.optimize.nnls(squares * weight[:, None], target * weight)
        mean = squares @ variances
        weight = 1.0 / np.maximum(mean, 1e-3 * mean.mean())
    return (
        np.asarray(np.sqrt(variances / variances.max(initial=0.0))) if np.any(variances) else np.ones(squares.shape[1])
    )


def _spread(group: NoiseGroup, channels: Array, noise: AutoregressiveNoise) -> tuple[Array, Array]:
    """Effect of the noise of one group: ``Omega B'``, shape (n, r), and ``B Omega B'``, shape (r, r)."""
    carried = np.zeros_like(group.influence)
    for D in channels.T[np.any(channels, axis=0)]:
        carried += D[:, None] * _toeplitz_product(noise, D[:, None] * group.influence)
    covariance = group.influence.T @ carried
    return carried, (covariance + covariance.T) / 2


def _removed(X: Array, carried: Array, C: Array, shares: Array) -> Array:
    """Autocovariance that the fit takes from the residuals, at the first lags.

    ``x_t' o_{t+k} + o_t' x_{t+k} - x_t' C x_{t+k} = x_t' z_{t+k} + z_t' x_{t+k}`` with ``z = o - C x / 2``.
    """
    z = carried - X @ (C / 2)
    return np.array([_shifted(X, z, k) + _shifted(z, X, k) for k in range(shares.size)]) / shares


def _shifted(x: Array, y: Array, lag: int) -> float:
    """Sum over t and columns of ``x_t y_(t + lag)``."""
    return float(x[: len(x) - lag].ravel() @ y[lag:].ravel())


def _toeplitz_product(noise: AutoregressiveNoise, x: Array) -> Array:
    """Covariance of n instants of stationary noise times x, shape (n, r)."""
    n = x.shape[0]
    length = scipy.fft.next_fast_len(2 * n, real=True)
    spectrum, product = noise.spectrum(length)[:, None], np.empty_like(x)
    for first in range(0, x.shape[1], _COLUMNS):
        some = slice(first, first + _COLUMNS)
        product[:, some] = scipy.fft.irfft(spectrum * scipy.fft.rfft(x[:, some], length, axis=0), length, axis=0)[:n]
    return product


def _autocovariance(e: Array, shares: Array) -> Array:
    """Autocovariance of the channels' noise, of deviation one in the largest, from the products at each lag."""
    return np.array([e[: e.size - k] @ e[k:] for k in range(shares.size)]) / shares


def _shares(channels: Array) -> Array:
    """``n / (n - k) sum_t sum_c D_tc D_(t+k)c`` at each lag k, at least half of that at lag 0."""
    n = len(channels)
    lags = min(max(1, n // 10), int(10 * np.log10(n)))
    sums = np.array([n / (n - k) * np.sum(channels[: n - k] * channels[k:]) for k in range(lags + 1)])
    return np.asarray(np.maximum(sums, 0.5 * sums[0]))


def noise_origin(context: Context) -> tuple[bool, Array | None]:
    """Whether rows hold the noise of all instants since the first one, as of long windows; and its channels.

    These are the change of each row with each measured channel, shape (m, c), by which its noise enters; for windows,
    whose noise is multiplied by velocities or rotated. None where each row holds the noise of its own channel alone.
    """
    window = context.target.model.window
    return (False, None) if window is None else (window.kind == "long", nuisance_columns(context, constants))


@dataclass(frozen=True, eq=False)
class NoisePaths:
    """How noise enters the rows and the estimate, row by row."""

    noise: Array  # (m,) its estimate n, from the residuals [units of the equations]
    rows: Rows  # (m, p) rows X of ``n = n_true - X (estimate - truth)``
    sums: Rows  # (m, p) rows U: the estimate's error is ``(W' V W)^-1 sum_i v_i U_i n_i``
    channels: Array  # (m, c) by which the noise of each channel enters
    lag_one: Array  # autocorrelation of each log's noise from one row to the next: the mean of its groups
    effective: float  # number of independent rows with as much information


def noise_paths(
    estimate: Estimate, observations: Observations, cumulated: bool = False, channels: Array | None = None
) -> NoisePaths:
    """How noise enters observations of single instants and short windows, or of long windows; see `noise_origin`."""
    noise, W, D = estimate.residual(observations), observations.W, channels
    D = np.broadcast_to(1.0, (noise.size, 1)) if D is None else D
    if not cumulated:
        return NoisePaths(noise, W, W, D, *_correlation(noise, observations))
    e, noise, rows, sums, D = noise, np.empty_like(noise), np.empty(W.shape), np.empty(W.shape), D.copy()
    group = observations.group
    for g in np.flatnonzero(np.bincount(group)):
        part = np.flatnonzero(group == g)
        of_group = W[part]
        noise[part], rows[part] = _changes(e[part]), _changes(of_group)
        sums[part] = np.cumsum(of_group[::-1], axis=0)[::-1]
        if channels is not None:
            D[part] = _changes(channels[part])
    return NoisePaths(noise, rows, sums, D, *_correlation(noise, observations))


def _correlation(noise: Array, observations: Observations) -> tuple[Array, float]:
    """Mean autocorrelation of each log's groups from one row to the next, and the effective rows of all."""
    of_logs: list[list[float]] = [[] for _ in observations.logs]
    effective = 0.0
    for g, own in sorted(rows_of_groups(observations.group), key=lambda one: one[0]):
        e = np.ascontiguousarray(noise[own])
        r = autocorrelation(e)
        effective += effective_samples(r, e.size)
        of_logs[g // len(observations.equations)].append(float(r[1]) if r.size > 1 else 0.0)
    return np.array([np.mean(one) if one else 0.0 for one in of_logs]), effective


def _changes(x: Array) -> Array:
    return np.diff(x, axis=0, prepend=np.zeros((1, *x.shape[1:])))


LAGS = 20


@dataclass(frozen=True)
class GroupResidual:
    """Residuals ``y - W beta`` of one equation in one log, in the order of time."""

    log: str
    equation: str
    unit: str
    rows: int
    rms: float  # root mean square [unit]
    relative: float  # `rms` over that of y; infinite where y is zero and the residuals are not
    worst: float  # residual of the largest magnitude [unit] and its instant [s]
    worst_time: float
    lag_one: float  # autocorrelation from one row to the next
    lags: int
    # statistic ``n (n + 2) sum_k r_k^2 / (n - k)`` over the lags, and the probability of one as large or larger under
    # white noise, by chi squared [Ljung, Box 1978]
    ljung_box: float
    whiteness: float
    # probability of a skewness and kurtosis as far or farther from those of normal noise [Jarque, Bera 1980]; a hint
    # only, since correlation makes it too small
    normality: float
    # number of independent rows with as much information on a mean: ``n / (1 + 2 sum_k r_k)``, the sum ending before
    # the first pair of autocorrelations that is not positive [Geyer 1992]; at most n
    effective: float


# of the last estimate from some observations: the covariance, the file and the summary ask for the same
_KNOWN: WeakKeyDictionary[Observations, dict[bytes, tuple[GroupResidual, ...]]] = WeakKeyDictionary()


def residual_diagnostics(estimate: Estimate, observations: Observations) -> tuple[GroupResidual, ...]:
    """Residuals of every log and equation that has rows."""
    check_observations(observations)
    if estimate.names != observations.names:
        raise InputError(
            f"the estimate has the parameters {', '.join(estimate.names)}, "
            f"the observations have {', '.join(observations.names)}"
        )
    asked = estimate.coefficients.tobytes()
    known = _KNOWN.setdefault(observations, {})
    if asked not in known:
        known.clear()
        groups = sorted(rows_of_groups(observations.group), key=lambda one: one[0])
        residual = estimate.residual(observations)
        known[asked] = tuple(_group(g, residual[rows], observations, rows) for g, rows in groups)
    return known[asked]


def effective_samples(r: Array, n: int) -> float:
    """Number of independent samples with the same information, from the autocorrelation."""
    pairs = r[: r.size - r.size % 2].reshape(-1, 2).sum(axis=1)
    last = int(np.argmax(pairs <= 0)) if np.any(pairs <= 0) else pairs.size
    spread = 2 * float(pairs[:last].sum()) - 1.0 if last else 1.0
    return n / max(spread, 1.0)


def _group(g: int, residual: Array, observations: Observations, rows: slice | Index) -> GroupResidual:
    log, equation = divmod(g, len(observations.equations))
    e, n = np.ascontiguousarray(residual), residual.size
    rms, size = float(np.sqrt(np.mean(e**2))), float(np.sqrt(np.mean(observations.y[rows] ** 2)))
    worst = int(np.argmax(np.abs(e)))
    r = autocorrelation(e)
    count = min(LAGS, max(1, n // 5))
    k = np.arange(1, min(count, n - 1) + 1)
    statistic = float(n * (n + 2) * np.sum(r[k] ** 2 / (n - k)))
    return GroupResidual(
        observations.logs[log],
        *observations.equations[equation],
        rows=n,
        rms=rms,
        relative=rms / size if size > 0 else (0.0 if rms == 0 else np.inf),
        worst=float(e[worst]),
        worst_time=float(observations.time[rows][worst]),
        lag_one=float(r[1]) if n > 1 else 0.0,
        lags=k.size,
        ljung_box=statistic,
        whiteness=float(scipy.special.chdtrc(k.size, statistic)) if k.size else 1.0,
        normality=_normality(e),
        effective=effective_samples(r, n),
    )


def _normality(e: Array) -> float:
    centred = e - e.mean()
    deviation = float(np.sqrt(np.mean(centred**2)))
    if deviation <= 1e-15 * float(np.abs(e).max()):
        return 1.0
    u = centred / deviation
    square = u * u
    statistic = e.size / 6 * (np.mean(square * u) ** 2 + (np.mean(square * square) - 3) ** 2 / 4)
    return float(scipy.special.chdtrc(2, statistic))


_LAGS = 2**14
_STRETCH = 2**16


def autocorrelation(e: Array) -> Array:
    """``r_k = sum_t e_t e_{t+k} / sum_t e_t^2`` about the mean; all zero for a constant."""  # e (n,)
    centred = e - e.mean()
    square = float(centred @ centred)
    if square <= 1e-30 * float(e @ e):
        return np.zeros(e.size)
    if e.size > _STRETCH:
        first = _leading(centred, _LAGS) / square
        if np.any(first.reshape(-1, 2).sum(axis=1) <= 0):
            return np.asarray(first)
    spectrum = scipy.fft.rfft(centred, scipy.fft.next_fast_len(2 * e.size))
    power = scipy.fft.irfft(np.abs(spectrum) ** 2, scipy.fft.next_fast_len(2 * e.size))
    return np.asarray(power[: e.size] / square)


def _leading(x: Array, lags: int) -> Array:
    """``sum_t x_t x_{t+k}`` for k = 0 ... lags - 1, from the spectra of stretches, shape (lags,)."""
    size = scipy.fft.next_fast_len(_STRETCH + lags)
    spectrum = np.zeros(size // 2 + 1, dtype=complex)
    for first in range(0, x.size, _STRETCH):
        own, beyond = x[first : first + _STRETCH], x[first : first + _STRETCH + lags]
        spectrum += np.conj(scipy.fft.rfft(own, size)) * scipy.fft.rfft(beyond, size)
    return np.asarray(scipy.fft.irfft(spectrum, size)[:lags])
