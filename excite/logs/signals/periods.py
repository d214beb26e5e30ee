"""Periods of a periodic motion, its bandwidth, and the noise that signals have above it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from excite.logs.log import Log, channels_of, held_values
from excite.logs.signals.method import check_positive, spacing
from regressors.errors import InputError, percent
from regressors.samples import Array

ALIKE = 0.02
_MOST = 40


def estimated_period(time: Array, q: Array) -> float:
    """Shortest lag after which a motion repeats itself [s].

    The mean square difference ``d(T)`` of ``q(t)`` and ``q(t + T)``, over all joints, is least there, relative to the
    ``2 var q`` of uncorrelated motions.
    """  # time (N,); q (N, n)
    h = spacing(time, "period", 16)
    scale = 2 * float(q.var(axis=0).sum())
    if scale == 0.0:
        raise InputError("no joint moves, so the motion has no period")
    d = _difference(q) / scale
    dips = np.flatnonzero((d[1:-1] <= d[:-2]) & (d[1:-1] <= d[2:])) + 1
    dips = np.sort(dips[np.argsort(d[dips])][:_MOST])
    spline = scipy.interpolate.make_interp_spline(time, q, axis=0)

    def unlike(lag: float) -> float:
        start = time[time <= time[-1] - lag]
        return float(np.mean(np.sum((spline(start + lag) - q[: start.size]) ** 2, axis=1))) / scale

    lags = [h * (k + _vertex(*d[k - 1 : k + 2])) for k in dips]
    differences = np.array([unlike(lag) for lag in lags])
    if not differences.size or differences.min() > ALIKE**2:
        best = f"; best after {lags[int(differences.argmin())]:.4g} s" if differences.size else ""
        raise InputError(
            f"no period: the motion does not repeat itself within {(time[-1] - time[0]) / 2:.4g} s{best}; "
            "give `period` if it is known"
        )
    first = lags[int(np.argmax(differences <= 2 * differences.min() + 1e-6))]
    result = scipy.optimize.minimize_scalar(
        unlike, bounds=(first - h, min(first + h, time[-1] - time[0])), method="bounded", options={"xatol": 1e-6 * h}
    )
    return float(result.x)


def repeats(time: Array, q: Array) -> bool:
    """True if a motion has a period, see `estimated_period`."""
    try:
        estimated_period(time, q)
    except InputError:
        return False
    return True


def _difference(q: Array) -> Array:
    """Mean square difference of q and q shifted by k = 0 ... N/2 + 1 samples, summed over joints; by FFT."""
    x = q - q.mean(axis=0)
    count, most = x.shape[0], x.shape[0] // 2 + 1
    spectrum = scipy.fft.rfft(x, scipy.fft.next_fast_len(2 * count), axis=0)
    product = scipy.fft.irfft(np.abs(spectrum) ** 2, axis=0)[: most + 1].sum(axis=1)
    squares = np.concatenate([[0.0], np.cumsum(np.sum(x**2, axis=1))])
    lag = np.arange(most + 1)
    sums = squares[count - lag] + squares[count] - squares[lag]
    return np.asarray((sums - 2 * product) / (count - lag))


def _vertex(left: float, middle: float, right: float) -> float:
    """Minimum of the parabola through three values, one sample apart; from the middle [samples]."""
    curvature = left - 2 * middle + right
    return 0.0 if curvature <= 0 else 0.5 * (left - right) / curvature


_WHOLE = 1e-3  # of a sample
_LEAST_MOTION = 0.1  # of that of the joint that moves most


def average_periods(log: Log, period: float | None = None) -> tuple[Log, float, str]:
    """Mean over the whole periods of a log, as one period at the times of the first; the period [s]; a note.

    With x_k(t) the sample at phase t of period k of K, the mean is ``m(t) = sum_k x_k(t) / K`` and the noise
    ``s^2 = sum_{k,t} (x_k(t) - m(t))^2 / (M (K - 1))`` over the M phases.
    """
    check_positive("averaging", period=period)
    h = spacing(log.time, "averaging", 16)
    length = estimated_period(log.time, log.q) if period is None else period
    count = int((log.count + 0.5) * h / length)
    if count < 2:
        raise InputError(
            f"{log.source}: {log.count * h:.4g} s hold {count} periods of {length:.4g} s; expected 2 or more"
        )
    stacked = _stacked(log, h, length, count)
    means: dict[str, Any] = {name: x.mean(axis=0) for name, x in stacked.items()}
    q = stacked["q"]
    noise = np.sqrt(np.sum((q - means["q"]) ** 2, axis=(0, 1)) / (q.shape[1] * (count - 1)))
    _check_periodic(log, length, means["q"], noise)
    samples = means["q"].shape[0]
    rest = log.count - round(count * length / h)
    time = log.time[0] + np.arange(samples) * (length / samples)
    note = (f"{rest} rows after the last whole period",) * (rest > 0)
    mean = Log(log.source, log.sha256, log.joints, time, **means, left_out=(*log.left_out, *note))
    step = f"mean of {count} periods of {length:.6g} s ({'estimated' if period is None else 'given'})"
    return mean, length, step


def _stacked(log: Log, h: float, length: float, count: int) -> dict[str, Array]:
    """Per channel the periods, shape (K, M, columns); interpolated where a period is not a whole number of samples."""
    channels, samples = channels_of(log), round(length / h)
    if abs(length / h - samples) * count <= _WHOLE:
        return {name: x[: count * samples].reshape(count, samples, -1) for name, x in channels.items()}
    time = log.time[0] + (np.arange(count)[:, None] + np.arange(samples) / samples) * length
    time = np.minimum(time, log.time[-1])
    periods = {n: np.asarray(scipy.interpolate.CubicSpline(log.time, x, axis=0)(time)) for n, x in channels.items()}
    if log.command is not None:
        periods["command"] = held_values(log.time, log.command, time)
    return periods


def _check_periodic(log: Log, length: float, mean: Array, noise: Array) -> None:
    motion = mean.std(axis=0)
    share = noise / np.maximum(motion, max(_LEAST_MOTION * motion.max(), np.finfo(float).tiny))
    worst = int(np.argmax(share))
    if share[worst] > ALIKE:
        raise InputError(
            f"{log.source}: not periodic with {length:.6g} s: {log.joints[worst]} differs by {noise[worst]:.3g} from "
            f"period to period, {percent(share[worst])} of its motion; at most {100 * ALIKE:g} % are allowed"
        )


SHARE = 0.999
_ABOVE_FLOOR = 10.0
_HIGHEST = 0.35  # of the sample rate
_TIMES = 10.0
_RESTS = 0.01


def bandwidth(q: Array, rate: float) -> float:
    """Frequency below which 99.9 % of the power of the velocity lies, in the joint where it is highest [Hz].

    The power is that of the positions, without their mean slope and through a Hann window, times ``(2 pi f)^2``.
    Lines that are not above ten times the noise floor, the median of the upper half of the spectrum, do not count, nor
    do joints that rest: those that move by less than a hundredth of the one that moves most, or mostly by noise.
    """  # q (N, n)
    count = q.shape[0]
    ramp = np.linspace(0.0, 1.0, count)[:, None]
    level = q - q[0] - ramp * (q[-1] - q[0])
    power = np.abs(np.fft.rfft((level - level.mean(axis=0)) * np.hanning(count)[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(count, 1.0 / rate)
    floor = np.median(power[frequency.size // 2 :], axis=0)
    lines = np.where(power > _ABOVE_FLOOR * floor, power, 0.0)
    strays, by_noise = power.sum(axis=0), lines.sum(axis=0) <= 0.5 * power.sum(axis=0)
    power = lines * frequency[:, None] ** 2
    moving = (strays > _RESTS**2 * strays.max()) & ~by_noise & (power.sum(axis=0) > 0.0)
    if not np.any(moving):
        raise InputError("no joint moves, so no cutoff can be chosen; give one")
    cumulated = np.cumsum(power[:, moving], axis=0)
    line = np.argmax(cumulated >= SHARE * cumulated[-1], axis=0)
    return float(frequency[line].max())


def chosen_cutoff(q: Array, rate: float) -> tuple[float, str]:
    """Cutoff for a low-pass filter of positions: ten times the bandwidth, at most 0.35 of the sample rate [Hz]."""
    highest = bandwidth(q, rate)
    cutoff = min(_TIMES * highest, _HIGHEST * rate)
    return cutoff, f"{cutoff:.3g} Hz (chosen; 99.9 % of the velocity's power lies below {highest:.3g} Hz)"


HIGHEST_MOTION = 10.0  # frequency above which the motion of a robot has no content [Hz]
_TORQUE_TIMES = 10.0  # of the bandwidth of the velocities: torques have products and jumps of them
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


def mean_rate(time: Array) -> float:
    """Mean rate of some instants, shape (N,) [Hz]."""
    return (time.size - 1) / float(time[-1] - time[0])


def motion_ends(q: Array, rate: float) -> float:
    """Frequency above which torques have no content of the motion: ten times its bandwidth, at most 10 Hz [Hz]."""
    # q (N, n)
    try:
        return min(HIGHEST_MOTION, _TORQUE_TIMES * bandwidth(q, rate))
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
