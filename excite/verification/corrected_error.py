"""Error of the model, less the noise of the measurement, with what chance makes of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.signals.measurement_noise import MeasurementNoise, measurement_noise, motion_ends
from regressors.samples import Array

_QUANTILE = 2.326  # one-sided, 99 %


@dataclass(frozen=True)
class CorrectedError:
    """Error of predictions without the noise of what was measured.

    Parameters
    ----------
    noise : float
        Root mean square of the measurement's noise [unit].
    error : float
        ``sqrt(max(0, e^2 - noise^2))``, with the root mean square e of the difference [unit].
    relative : float
        Of the measurements without their noise, ``error / sqrt(y^2 - noise^2)``; infinite where those are nothing but
        noise.
    least : float
        As `relative`, but what it is at least with a confidence of 99 %: noise is random, and known from one log.
    """

    noise: float
    error: float
    relative: float
    least: float


def noise_of_log(time: Array, q: Array, measured: Array, predicted: Array, motion_rate: float) -> MeasurementNoise:
    """Noise of the measurements of a log, by their part above the frequencies of the motion.

    Parameters
    ----------
    time : ndarray, shape (N,)
        [s]
    q : ndarray, shape (K, n)
        Positions of the joints at uniform instants [rad or m].
    measured, predicted : ndarray, shape (N, r)
    motion_rate : float
        Of the positions [Hz].
    """
    rate = (time.size - 1) / float(time[-1] - time[0])
    return measurement_noise(measured, measured - predicted, rate, motion_ends(q, motion_rate))


def corrected_errors(measured: Array, predicted: Array, noise: MeasurementNoise) -> tuple[CorrectedError, ...]:
    """Corrected error of each equation.

    Parameters
    ----------
    measured, predicted : ndarray, shape (N, r)
    noise : MeasurementNoise
        Of the measurements.
    """
    squares = np.mean((measured - predicted) ** 2, axis=0), np.mean(measured**2, axis=0)
    spread = noise.deviation**2
    return tuple(
        _corrected(float(e), float(y), float(n), float(v), float(level) / noise.duration)
        for e, y, n, v, level in zip(*squares, noise.square, spread, noise.level, strict=True)
    )


def corrected_total(measured: Array, predicted: Array, noise: MeasurementNoise) -> CorrectedError:
    """Corrected error over all equations, in their units.

    Parameters
    ----------
    measured, predicted, noise
        See `corrected_errors`.
    """
    error, size = (float(np.sum(np.mean(x**2, axis=0))) for x in (measured - predicted, measured))
    level = float(noise.level.max(initial=0.0)) / noise.duration
    return _corrected(error, size, float(noise.square.sum()), float(np.sum(noise.deviation**2)), level)


def _corrected(error: float, size: float, noise: float, variance: float, per_line: float) -> CorrectedError:
    """From mean squares; `per_line` is the noise in one frequency, which an error of the model is mixed with."""
    left, signal = max(error - noise, 0.0), max(size - noise, 0.0)
    chance = _QUANTILE * float(np.sqrt(variance + 2 * left * per_line))
    return CorrectedError(
        float(np.sqrt(noise)),
        float(np.sqrt(left)),
        _root_ratio(left, signal),
        _root_ratio(max(left - chance, 0.0), signal + chance),
    )


def _root_ratio(part: float, whole: float) -> float:
    if whole > 0:
        return float(np.sqrt(part / whole))
    return np.inf if part > 0 else 0.0
