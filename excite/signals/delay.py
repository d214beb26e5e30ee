"""Motion at the instants that measured torques belong to, where they are recorded later than the positions."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from regressors.samples import Samples

_QUANTITIES = ("q", "dq", "ddq", "dddq")
_STRETCH = 2**16  # instants of a long motion whose splines are held at once
_FORGOTTEN = 64  # instants after which a cubic spline does not depend on its end, to 1e-16


def delayed(samples: Samples, delay: float) -> Samples:
    """Motion as it was some time before each instant.

    A torque that is recorded at t, but acted at ``t - delay``, belongs to the motion at ``t - delay``. The motion is
    smooth, so it is what is interpolated, by cubic splines, and not the torque.
    """
    if delay == 0.0:
        return samples
    if samples.time.size <= _STRETCH:
        return DelayedMotion(samples).by(delay)
    moved = {name: np.empty_like(samples.q) for name in _QUANTITIES}
    beside = _FORGOTTEN + int(np.ceil(abs(delay) / float(samples.time[1] - samples.time[0])))
    for first in range(0, samples.time.size, _STRETCH):
        begin, stop = max(first - beside, 0), first + _STRETCH
        part = DelayedMotion(samples.rows(slice(begin, stop + beside))).by(delay)
        for name in _QUANTITIES:
            moved[name][first:stop] = getattr(part, name)[first - begin : stop - begin]
    return Samples(samples.time, **moved)


class DelayedMotion:
    """Motion to be delayed by one time after another, see `delayed`."""

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
