"""Motion at the instants that measured torques belong to, where they are recorded later than the positions."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from regressors.samples import Array, Samples


def delayed(samples: Samples, delay: float) -> Samples:
    """Motion as it was some time before each instant.

    A torque that is recorded at t, but acted at ``t - delay``, belongs to the motion at ``t - delay``. The motion is
    smooth, so it is what is interpolated, by cubic splines, and not the torque.

    Parameters
    ----------
    samples : Samples
        Uniform and filtered.
    delay : float
        Negative where torques are recorded before the positions [s].

    Returns
    -------
    Samples
        At the same instants; held at its first or last value where the motion is not known.
    """
    if delay == 0.0:
        return samples
    at = np.clip(samples.time - delay, samples.time[0], samples.time[-1])

    def shifted(values: Array) -> Array:
        if not np.all(np.isfinite(values)):
            return np.full_like(values, np.nan)
        return np.asarray(CubicSpline(samples.time, values)(at))

    return Samples(samples.time, *(shifted(getattr(samples, name)) for name in ("q", "dq", "ddq", "dddq")))
