"""Random motions of the size of a log's, on which an estimate can be expected to be used."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array, Samples

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
