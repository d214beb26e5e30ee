"""Autocorrelation of long residuals, as far as it is looked at."""

from __future__ import annotations

import numpy as np
import scipy.fft

from regressors.samples import Array

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
