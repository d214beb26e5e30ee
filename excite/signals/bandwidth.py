"""Bandwidth of a sampled motion."""

from __future__ import annotations

import numpy as np

from regressors.errors import InputError
from regressors.samples import Array

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
