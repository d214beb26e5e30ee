"""Noise of one channel of a log, by name: unit variance, shape (k, N, n) for k repetitions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.signal

from regressors.samples import Array

CORRELATION = 0.9  # of the autoregressive noise, from one sample to the next
SLOW = 3.0  # cutoff of the low-frequency noise [Hz]
_SETTLING = 400  # samples before the first one that is used


def white(rng: np.random.Generator, shape: tuple[int, int, int], rate: float) -> Array:
    """Independent normal noise."""
    return rng.normal(size=shape)


def autoregressive(rng: np.random.Generator, shape: tuple[int, int, int], rate: float) -> Array:
    """``e_t = 0.9 e_{t-1} + u_t``, whatever the rate is."""
    u = rng.normal(size=(shape[0], shape[1] + _SETTLING, shape[2]))
    e = scipy.signal.lfilter([np.sqrt(1 - CORRELATION**2)], [1.0, -CORRELATION], u, axis=1)
    return np.asarray(e[:, _SETTLING:])


def slow(rng: np.random.Generator, shape: tuple[int, int, int], rate: float) -> Array:
    """White noise through a Butterworth low-pass of second order at 3 Hz."""
    b, a = scipy.signal.butter(2, SLOW, fs=rate)
    u = rng.normal(size=(shape[0], shape[1] + _SETTLING, shape[2]))
    e = scipy.signal.lfilter(b, a, u, axis=1)[:, _SETTLING:]
    impulse = scipy.signal.lfilter(b, a, np.eye(1, 20 * _SETTLING)[0])
    return np.asarray(e / np.linalg.norm(impulse))


NOISES: dict[str, Callable[[np.random.Generator, tuple[int, int, int], float], Array]] = {
    "white": white,
    "autoregressive": autoregressive,
    "slow": slow,
}
