"""Estimate of the period of a periodic motion."""

from __future__ import annotations

import numpy as np
import scipy.fft
import scipy.interpolate
import scipy.optimize

from excite.signals.method import spacing
from regressors.errors import InputError
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
    """Mean square difference of q and q shifted by k samples, summed over joints; by FFT.

    For k = 0 ... N/2 + 1, so that a lag of half the time has neighbours on both sides.
    """
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
