"""Noise that is correlated in time."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array


def first_order_noise(time: Array, deviation: tuple[float, ...], corner: float, rng: np.random.Generator) -> Array:
    """Gaussian noise through a first-order low-pass, ``n_k = a n_{k-1} + sqrt(1 - a^2) e_k``, shape (N, n).

    ``a = exp(-2 pi corner step)``, and n has the given standard deviation from the first row on.
    """  # time (N,); deviation (n,)
    from scipy.signal import lfilter

    step = float(time[-1] - time[0]) / max(time.size - 1, 1)
    a = np.exp(-2 * np.pi * corner * step)
    white = rng.standard_normal((time.size, len(deviation)))
    white[1:] *= np.sqrt(1 - a**2)
    return np.asarray(lfilter([1.0], [1.0, -a], white, axis=0) * np.array(deviation))
