"""Zero-phase Butterworth low-pass of positions, which also filters equations; differences; moving polynomials."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np
import scipy

from excite.logs.signals.method import FilteredMotion, Method, check_positive, cut_motion, spacing
from excite.logs.signals.periods import chosen_cutoff
from regressors.errors import InputError
from regressors.samples import Array

ORDER = 4


def low_passed(x: Array, rate: float, cutoff: float, order: int = ORDER) -> Array:
    """Signal through a Butterworth filter, forwards and backwards, so that nothing is delayed.

    The gain is ``1 / (1 + (f / cutoff)^(2 order))``: one at f = 0, a half at the cutoff.
    """  # x (N, ...)
    _check_cutoff(rate, cutoff, order)
    if x.shape[0] <= (least := edge(rate, cutoff)):
        raise InputError(f"low-pass: {x.shape[0]} samples are too few for a cutoff of {cutoff:g} Hz; needs {least + 1}")
    sections = scipy.signal.butter(order, cutoff, fs=rate, output="sos")
    padding = min(2 * edge(rate, cutoff), x.shape[0] - 1)
    return np.asarray(scipy.signal.sosfiltfilt(sections, x, axis=0, padlen=padding), dtype=float)


def edge(rate: float, cutoff: float) -> int:
    """Samples at each end that the filter's transient affects: two periods of the cutoff."""
    return math.ceil(2 * rate / cutoff)


def kept_rows(count: int, rate: float, cutoff: float, every: int | None = None) -> slice:
    """Which of some uniform instants are left after a low-pass and decimation: neighbours are then not redundant."""
    _check_cutoff(rate, cutoff, ORDER)
    step = decimation(rate, cutoff) if every is None else every
    check_positive("decimation", every=step)
    if cutoff > rate / (2 * step):
        raise InputError(
            f"decimation: every {step}th row leaves {rate / step:g} Hz, less than twice the cutoff of {cutoff:g} Hz"
        )
    cut = edge(rate, cutoff)
    if count <= 2 * cut:
        raise InputError(f"low-pass: {count} samples are too few: {cut} are cut from each end")
    return slice(cut, count - cut, step)


def _check_cutoff(rate: float, cutoff: float, order: int) -> None:
    check_positive("low-pass", cutoff=cutoff, order=order)
    if cutoff >= rate / 2:
        raise InputError(f"low-pass: the cutoff {cutoff:g} Hz must be below half the sample rate, {rate / 2:g} Hz")


def decimation(rate: float, cutoff: float) -> int:
    """Largest decimation factor after a low-pass: it keeps the cutoff at or below 0.8 of half the new rate."""
    return max(1, math.floor(0.8 * rate / (2 * cutoff)))


@dataclass(frozen=True)
class Butterworth(Method):
    """Filter forwards and backwards, see `low_passed`, then seven-point differences."""

    # frequency at which the amplitude is halved [Hz]; chosen from the positions if not given, see
    # `excite.logs.signals.periods.chosen_cutoff`
    cutoff: float | None = None
    order: int = ORDER  # of one pass

    name: ClassVar[str] = "butterworth"

    def __post_init__(self) -> None:
        check_positive(self.name, cutoff=self.cutoff, order=self.order)

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Filtered positions and their differences; see `Method.motion`."""
        h = spacing(time, self.name, 16)
        cutoff, origin = chosen_cutoff(q, 1 / h) if self.cutoff is None else (self.cutoff, f"{self.cutoff:g} Hz")
        smooth = low_passed(q, 1 / h, cutoff, self.order)
        ends = max(edge(1 / h, cutoff), 3)
        assumed = (
            f"positions low-passed at {origin}, above which no motion is taken to be (zero-phase Butterworth of order "
            f"{self.order}, twice); seven-point differences; {ends * h:.3g} s cut at each end"
        )
        return cut_motion(time, (smooth, *smooth_differences(smooth, h)), ends, assumed)

    def settled(self, time: Array, q: Array) -> Butterworth:
        """The method with the cutoff that it chooses."""
        if self.cutoff is not None:
            return self
        return replace(self, cutoff=chosen_cutoff(q, 1 / spacing(time, self.name, 16))[0])


@dataclass(frozen=True)
class Differences(Method):
    """Three-point differences, as in [KD96] section 5.3.

    ``dq_k = (q_{k+1} - q_{k-1}) / 2h``, and the acceleration by the same of the velocity,
    ``ddq_k = (q_{k+2} - 2 q_k + q_{k-2}) / 4h^2``. White noise s of the positions becomes ``s / (sqrt(2) h)`` of the
    velocities, and ``sqrt(6) s / 4h^2`` of the accelerations.
    """

    name: ClassVar[str] = "differences"

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Positions as they are, their differences; see `Method.motion`."""
        h = spacing(time, self.name, 7)
        velocity = central_difference(q, h)
        assumed = (
            f"positions without noise; three-point central differences over {2 * h:.4g} s, acceleration taken again"
        )
        return cut_motion(time, (q, velocity, central_difference(velocity, h)), 2, assumed)


def central_difference(x: Array, h: float) -> Array:
    """``(x_{k+1} - x_{k-1}) / 2h``, shape of x; NaN in the first and the last row."""  # x (N, ...)
    return _stencil(x, np.array([-1.0, 0.0, 1.0]) / (2 * h))


def smooth_differences(x: Array, h: float) -> tuple[Array, Array]:
    """First and second derivative of smooth samples by seven points, exact for polynomials of degree 6."""
    # x (N, ...)
    first = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / (60 * h)
    second = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / (180 * h**2)
    return _stencil(x, first), _stencil(x, second)


def _stencil(x: Array, weights: Array) -> Array:
    half = weights.size // 2
    inner = sum(w * x[k : x.shape[0] - 2 * half + k] for k, w in enumerate(weights))
    result = np.full_like(x, np.nan, dtype=float)
    result[half : x.shape[0] - half] = inner
    return result


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
        state = [scipy.signal.savgol_filter(q, length, self.degree, d, h, axis=0) for d in (0, 1, 2)]
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
            state = [scipy.fft.irfft(spectrum * kernel, length)[:, : time.size].T for kernel in response]
            return cut_motion(time, state, half, motion.assumed)

        return filtered

    def _half(self, q: Array, h: float) -> tuple[int, str]:
        if self.window is not None:
            return round(self.window / h / 2), "given"
        cutoff, origin = chosen_cutoff(q, 1 / h) if self.cutoff is None else (self.cutoff, f"{self.cutoff:g} Hz")
        half = round(((self.degree + 1) / (2 * h * cutoff) + 4.6) / 3.2)
        return max(half, self.degree // 2 + 1), f"for a cutoff of {origin}"
