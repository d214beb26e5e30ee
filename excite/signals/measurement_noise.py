"""Noise of a measured signal, from its part above the frequencies of the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.signal

from excite.signals.periods import bandwidth
from regressors.errors import InputError
from regressors.samples import Array

HIGHEST_MOTION = 10.0  # frequency above which the motion of a robot has no content [Hz]
_TIMES = 10.0  # of the bandwidth of the velocities: torques have products and jumps of them
_FEWEST = 50
_HALVES = 2.0  # Hann's window halves the number of independent frequencies


@dataclass(frozen=True)
class MeasurementNoise:
    """Noise of r signals."""

    square: Array  # (r,) mean square [unit^2]; zero where the sampling leaves nothing above the motion to see noise in
    level: Array  # (r,) density below `above`, extrapolated as white [unit^2/Hz]
    deviation: Array  # (r,) standard deviation of `square` [unit^2]
    slow_deviation: Array  # (r,) standard deviation of its part below `above`, ``above * level`` [unit^2]
    # (r,) share of the difference's mean square above `above` that is noise; the rest is noise of the predictions
    fast_share: Array
    above: float  # frequency above which there is noise only [Hz]
    duration: float  # of the signals [s]


def motion_ends(q: Array, rate: float) -> float:
    """Frequency above which torques have no content of the motion: ten times its bandwidth, at most 10 Hz [Hz]."""
    # q (N, n)
    try:
        return min(HIGHEST_MOTION, _TIMES * bandwidth(q, rate))
    except InputError:  # nothing moves
        return HIGHEST_MOTION


def measurement_noise(measured: Array, difference: Array, rate: float, above: float) -> MeasurementNoise:
    """Mean square of the noise of measured signals.

    Above the frequencies of the motion, all of a signal is noise. Below them its density S is taken as white, as in the
    octave next above them or, where that is lower, as in all frequencies above: ``sigma^2 = int_f P df + f S``. P is
    the smaller of the periodograms of the signal and of its difference from a prediction: jumps of friction are in the
    first and not in the second, noise of the predictions in the second and not in the first.

    Noise that is coloured has more at low frequencies than this shows; what is not seen counts as an error of the
    model, never the reverse.
    """  # measured, difference (N, r)
    count, r = measured.shape
    duration = count / rate
    if count < _FEWEST or rate <= 3 * above:
        nothing = np.zeros(r)
        return MeasurementNoise(nothing, nothing, nothing, nothing, nothing, above, duration)
    frequency, of_signal = scipy.signal.periodogram(measured, rate, "hann", axis=0)
    of_difference = scipy.signal.periodogram(difference, rate, "hann", axis=0)[1]
    band = frequency[1]
    fast, octave = frequency > above, (frequency > above) & (frequency <= 2 * above)
    power = np.minimum(of_signal[fast].sum(axis=0), of_difference[fast].sum(axis=0)) * band
    level = np.min([P[part].mean(axis=0) for P in (of_signal, of_difference) for part in (fast, octave)], axis=0)
    level = np.minimum(level, of_difference[~fast].mean(axis=0))  # no more than the whole difference
    free = above * duration, np.count_nonzero(octave) / _HALVES  # independent frequencies
    slow = (above * level) ** 2 * (1 / free[0] + 1 / free[1])
    deviation = np.sqrt(slow + power**2 / np.count_nonzero(fast))
    whole = of_difference[fast].sum(axis=0) * band
    share = np.divide(power, whole, out=np.zeros_like(power), where=whole > 0)
    return MeasurementNoise(power + above * level, level, deviation, np.sqrt(slow), share, above, duration)
