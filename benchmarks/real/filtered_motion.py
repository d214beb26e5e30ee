"""The rivals' own way from a log to motion and torques: fixed Butterworth filter, central differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from excite.logs.log import Log
from regressors.samples import Samples

Array = NDArray[np.float64]
ORDER = 4


@dataclass(frozen=True, eq=False)
class FilteredLog:
    """Motion and torques of a whole log at uniform instants, both through the same zero-phase filter.

    Parameters
    ----------
    samples : Samples
    torque : ndarray, shape (N, n)
        [Nm]
    """

    samples: Samples
    torque: Array


def filtered(log: Log, cutoff: float) -> FilteredLog:
    """Positions by cubic splines and torques linearly on uniform instants, filtered to and fro, differenced twice.

    Parameters
    ----------
    log : Log
    cutoff : float
        Of the Butterworth filter of order 4 [Hz].
    """
    assert log.effort is not None
    time = np.linspace(log.time[0], log.time[-1], log.count)
    step = time[1] - time[0]
    filter_ = butter(ORDER, cutoff, fs=1 / step, output="sos")
    q = sosfiltfilt(filter_, CubicSpline(log.time, log.q)(time), axis=0)
    torque = sosfiltfilt(filter_, at(time, log.time, log.effort), axis=0)
    dq = np.gradient(q, step, axis=0)
    ddq = np.gradient(dq, step, axis=0)
    return FilteredLog(Samples(time, q, dq, ddq, np.zeros_like(q)), torque)


def at(time: Array, known: Array, values: Array) -> Array:
    """Values interpolated linearly between their instants."""
    return np.column_stack([np.interp(time, known, column) for column in values.T])
