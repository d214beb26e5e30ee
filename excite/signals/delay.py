"""Motion at the instants that measured torques belong to, where they are recorded later than the positions."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from regressors.samples import Samples

_QUANTITIES = ("q", "dq", "ddq", "dddq")


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
    return samples if delay == 0.0 else DelayedMotion(samples).by(delay)


class DelayedMotion:
    """Motion to be delayed by one time after another, see `delayed`.

    Parameters
    ----------
    samples : Samples
        Uniform and filtered.
    """

    def __init__(self, samples: Samples) -> None:
        self.samples = samples

    @cached_property
    def _splines(self) -> list[CubicSpline | None]:
        """Of the quantities that are known."""
        values = (getattr(self.samples, name) for name in _QUANTITIES)
        return [CubicSpline(self.samples.time, x) if np.all(np.isfinite(x)) else None for x in values]

    def by(self, delay: float) -> Samples:
        """The motion as it was some time before [s]; see `delayed`."""
        samples = self.samples
        if delay == 0.0:
            return samples
        at = np.clip(samples.time - delay, samples.time[0], samples.time[-1])
        unknown = np.full_like(samples.q, np.nan)
        return Samples(samples.time, *(unknown if spline is None else spline(at) for spline in self._splines))
