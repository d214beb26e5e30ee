"""Polynomials fitted in a moving window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np
import scipy.fft
import scipy.signal

from excite.logs.signals.method import FilteredMotion, Method, check_positive, cut_motion, spacing
from excite.logs.signals.periods import chosen_cutoff
from regressors.errors import InputError
from regressors.samples import Array

_LONG = 32  # samples on either side, from which on transforms are faster


@dataclass(frozen=True)
class SavitzkyGolay(Method):
    """Least-squares polynomial over a window about every sample; its derivatives are those of the motion."""

    # length of the window [s]. If not given, the one whose filter has the cutoff of
    # `excite.logs.signals.periods.chosen_cutoff`: with M samples to each side and degree d its cutoff is ``(d + 1) /
    # (3.2 M - 4.6)`` of half the sample rate [Schafer, What is a Savitzky-Golay filter?, IEEE Signal Processing
    # Magazine 28(4), 2011]
    window: float | None = None
    degree: int = 4  # of the polynomial, 2 or more
    cutoff: float | None = None  # instead of the window: the cutoff of its filter [Hz]

    name: ClassVar[str] = "savitzky-golay"

    def __post_init__(self) -> None:
        check_positive(self.name, window=self.window, cutoff=self.cutoff)
        if self.degree < 2:
            raise InputError(f"{self.name}: degree must be 2 or more, given {self.degree}")

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Values and derivatives of the polynomials in the middle of their windows; see `Method.motion`."""
        h = spacing(time, self.name, self.degree + 2)
        half, origin = self._half(q, h)
        length = 2 * half + 1
        if length > time.size:
            raise InputError(f"{self.name}: the window of {length} samples is longer than the {time.size} samples")
        if length <= self.degree:
            raise InputError(f"{self.name}: the window of {length} samples is too short for degree {self.degree}")
        state = (
            scipy.signal.savgol_filter(q, length, self.degree, deriv=0, axis=0),
            scipy.signal.savgol_filter(q, length, self.degree, deriv=1, delta=h, axis=0),
            scipy.signal.savgol_filter(q, length, self.degree, deriv=2, delta=h, axis=0),
        )
        assumed = (
            f"polynomials of degree {self.degree} over {length} samples ({2 * half * h:.3g} s, {origin}); "
            f"{half * h:.3g} s cut at each end"
        )
        return cut_motion(time, state, half, assumed)

    def settled(self, time: Array, q: Array) -> SavitzkyGolay:
        """The method with the window that it chooses."""
        h = spacing(time, self.name, self.degree + 2)
        return replace(self, window=2 * h * self._half(q, h)[0])

    def operator(self, time: Array, q: Array) -> Callable[[Array], FilteredMotion]:
        """The filters with the window that it would choose, by fast Fourier transforms where it is long."""
        settled = self.settled(time, q)
        motion, h = settled.motion(time, q), spacing(time, self.name, self.degree + 2)
        half = motion.kept.start
        if half < _LONG:
            return partial(settled.motion, time)
        length = scipy.fft.next_fast_len(time.size, real=True)  # what wraps around is cut
        weights = np.array([scipy.signal.savgol_coeffs(2 * half + 1, self.degree, d, h) for d in (0, 1, 2)])
        kernels = np.zeros((3, length))
        kernels[:, : half + 1], kernels[:, length - half :] = weights[:, half:], weights[:, :half]
        response = scipy.fft.rfft(kernels)

        def filtered(positions: Array) -> FilteredMotion:
            spectrum = scipy.fft.rfft(np.ascontiguousarray(positions.T), length)
            states = (scipy.fft.irfft(spectrum * kernel, length)[:, : time.size].T for kernel in response)
            smooth, velocity, acceleration = states
            return cut_motion(time, (smooth, velocity, acceleration), half, motion.assumed)

        return filtered

    def _half(self, q: Array, h: float) -> tuple[int, str]:
        if self.window is not None:
            return round(self.window / h / 2), "given"
        cutoff, origin = chosen_cutoff(q, 1 / h) if self.cutoff is None else (self.cutoff, f"{self.cutoff:g} Hz")
        half = round(((self.degree + 1) / (2 * h * cutoff) + 4.6) / 3.2)
        return max(half, self.degree // 2 + 1), f"for a cutoff of {origin}"
