"""The same low-pass filter on both sides of ``y = W beta``, and on signals: zero phase, Butterworth."""

from __future__ import annotations

import math

import numpy as np
import scipy.signal

from excite.signals.cut import check_positive
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


def parallel_filtered(W: Array, y: Array, rate: float, cutoff: float, order: int = ORDER) -> tuple[Array, Array, slice]:
    """Both sides of ``y = W beta`` through the same filter; they then hold for the same beta."""
    # W (N, r, p); y (N, r)
    if W.ndim != 3 or W.shape[:2] != y.shape:
        raise InputError(f"low-pass: W has shape {W.shape}, y has {y.shape}; expected (N, r, p) and (N, r)")
    _check_cutoff(rate, cutoff, order)
    cut = edge(rate, cutoff)
    if y.shape[0] <= 2 * cut:
        raise InputError(f"low-pass: {y.shape[0]} samples are too few: {cut} are cut from each end")
    kept = slice(cut, y.shape[0] - cut)
    return low_passed(W, rate, cutoff, order)[kept], low_passed(y, rate, cutoff, order)[kept], kept


def decimated(
    W: Array, y: Array, rate: float, cutoff: float, every: int | None = None, order: int = ORDER
) -> tuple[Array, Array, slice]:
    """Filter both sides and decimate their rows, so that neighbouring rows are not redundant."""
    kept = kept_rows(y.shape[0], rate, cutoff, every, order)
    W, y, _ = parallel_filtered(W, y, rate, cutoff, order)
    return W[:: kept.step], y[:: kept.step], kept


def kept_rows(count: int, rate: float, cutoff: float, every: int | None = None, order: int = ORDER) -> slice:
    """Which of ``count`` uniform instants are left after a low-pass and decimation; arguments as for `decimated`."""
    _check_cutoff(rate, cutoff, order)
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
