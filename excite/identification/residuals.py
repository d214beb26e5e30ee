"""Residuals: their size, the largest of them, and whether they are the independent noise that the intervals assume."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import scipy.fft
import scipy.stats

from excite.identification.estimate import Estimate
from excite.identification.observations import Observations, check_observations, rows_of_groups
from regressors.errors import InputError
from regressors.samples import Array

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
_KNOWN: WeakKeyDictionary[Observations, dict[tuple[bytes, int], tuple[GroupResidual, ...]]] = WeakKeyDictionary()


def residual_diagnostics(estimate: Estimate, observations: Observations, lags: int = LAGS) -> tuple[GroupResidual, ...]:
    """Residuals of every log and equation that has rows."""
    check_observations(observations)
    if estimate.names != observations.names:
        raise InputError(
            f"the estimate has the parameters {', '.join(estimate.names)}, "
            f"the observations have {', '.join(observations.names)}"
        )
    if lags < 1:
        raise InputError(f"residuals: lags must be 1 or more, given {lags}")
    asked = (estimate.coefficients.tobytes(), lags)
    known = _KNOWN.setdefault(observations, {})
    if asked not in known:
        known.clear()
        known[asked] = _diagnostics(estimate.residual(observations), observations, lags)
    return known[asked]


def _diagnostics(residual: Array, observations: Observations, lags: int) -> tuple[GroupResidual, ...]:
    diagnostics = []
    for g, rows in sorted(rows_of_groups(observations.group), key=lambda one: one[0]):
        log, equation = divmod(g, len(observations.equations))
        name, unit = observations.equations[equation]
        part = np.ascontiguousarray(residual[rows])
        diagnostics.append(
            _group(observations.logs[log], name, unit, part, observations.y[rows], observations.time[rows], lags)
        )
    return tuple(diagnostics)


def effective_samples(r: Array, n: int) -> float:
    """Number of independent samples with the same information, from the autocorrelation."""
    pairs = r[: r.size - r.size % 2].reshape(-1, 2).sum(axis=1)
    last = int(np.argmax(pairs <= 0)) if np.any(pairs <= 0) else pairs.size
    spread = 2 * float(pairs[:last].sum()) - 1.0 if last else 1.0
    return n / max(spread, 1.0)


def _group(log: str, name: str, unit: str, e: Array, y: Array, time: Array, lags: int) -> GroupResidual:
    n = e.size
    rms, size = float(np.sqrt(np.mean(e**2))), float(np.sqrt(np.mean(y**2)))
    worst = int(np.argmax(np.abs(e)))
    r = autocorrelation(e)
    count = min(lags, max(1, n // 5))
    k = np.arange(1, min(count, n - 1) + 1)
    statistic = float(n * (n + 2) * np.sum(r[k] ** 2 / (n - k)))
    return GroupResidual(
        log=log,
        equation=name,
        unit=unit,
        rows=n,
        rms=rms,
        relative=rms / size if size > 0 else (0.0 if rms == 0 else np.inf),
        worst=float(e[worst]),
        worst_time=float(time[worst]),
        lag_one=float(r[1]) if n > 1 else 0.0,
        lags=k.size,
        ljung_box=statistic,
        whiteness=float(scipy.stats.chi2.sf(statistic, k.size)) if k.size else 1.0,
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
    return float(scipy.stats.chi2.sf(statistic, 2))


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
