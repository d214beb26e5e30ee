"""Time-optimal S-curves from 0 to 1, from rest to rest, within bounds on velocity, acceleration and jerk.

Of all laws s(t) with ``|ds| <= V``, ``|dds| <= A``, ``|ddds| <= J`` the one of least duration has seven phases of
constant jerk; Ruckig finds their durations [Berscheid, Kroeger 2021].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Trajectory

from regressors.samples import Array

_RESERVE = 1e-5  # of the duration of a phase: what a controller's clock takes from a jerk that ends between its ticks
_LOOSE = 1.0  # with J = 1 neither velocity nor acceleration ever reaches 1 between 0 and 1, so this bound is inactive


@dataclass(frozen=True, eq=False)
class SCurve:
    """A law s(t) from s(0) = 0 to s(T) = 1, piecewise cubic, at rest at both ends."""

    breaks: Array  # (m + 1,) ends of the pieces, from 0 to T [s]
    coefficients: Array  # (4, m) ``s = sum_p coefficients[p, i] (t - breaks[i])^(3 - p)`` on piece i

    @classmethod
    def of_jerks(cls, breaks: Sequence[float] | Array, jerks: Sequence[float] | Array) -> SCurve:
        """The law from rest at 0 whose jerk is constant between breaks."""
        pieces, s, ds, dds = [], 0.0, 0.0, 0.0
        for h, j in zip(np.diff(breaks), jerks, strict=True):
            pieces.append([j / 6, dds / 2, ds, s])
            s, ds, dds = s + h * (ds + h * (dds / 2 + h * j / 6)), ds + h * (dds + h * j / 2), dds + h * j
        return cls(np.array(breaks, dtype=float), np.array(pieces).T)

    @property
    def duration(self) -> float:
        """T [s]."""
        return float(self.breaks[-1])

    def derivative(self, order: int) -> Array:
        """Coefficients of a derivative on each piece, shape (4 - order, m)."""
        c = self.coefficients
        for _ in range(order):
            c = c[:-1] * np.arange(c.shape[0] - 1, 0, -1.0)[:, None]
        return c

    def values(self, time: Array) -> Array:
        """Values of s and its three derivatives; 0 before the start and 1 after the end, exactly at rest."""
        # time (N,)
        i = np.clip(np.searchsorted(self.breaks, time, side="right") - 1, 0, self.breaks.size - 2)
        local = time - self.breaks[i]
        orders = np.stack([_polynomial(self.derivative(order)[:, i], local) for order in range(4)])
        orders[:, time <= 0.0] = 0.0
        orders[:, time >= self.duration] = [[1.0], [0.0], [0.0], [0.0]]
        return orders

    def stretched(self, duration: float) -> SCurve:
        """The same law over another duration, ``s(t T / duration)``."""
        factor = duration / self.duration
        powers = factor ** -np.arange(3.0, -1.0, -1.0)
        breaks = self.breaks * factor
        breaks[-1] = duration
        return replace(self, breaks=breaks, coefficients=self.coefficients * powers[:, None])

    def on_grid(self, period: float) -> SCurve:
        """The same kind of law with phases of whole sampling periods, never faster: what interpolates it is exact.

        From rest to rest, the velocity is one over T1, averaged over T2 and then over T3, where the largest velocity,
        acceleration and jerk are ``1 / T1``, ``1 / (T1 T2)`` and ``1 / (T1 T2 T3)``; all three are rounded up.
        """
        jerk = np.abs(self.derivative(3)).max()
        acceleration = np.abs(self.derivative(2)[-1]).max()
        velocity = self.values(np.array([self.duration / 2]))[1, 0]
        phases = np.array([acceleration / jerk, velocity / acceleration, 1.0 / velocity])
        n3, n2, n1 = (int(n) for n in np.ceil(phases / period * (1.0 + _RESERVE)))
        n2 = max(n2, n3)
        n1 = max(n1, n2 + n3)
        ticks = np.unique([0, n3, n2, n2 + n3, n1, n1 + n3, n1 + n2, n1 + n2 + n3])
        signs = np.zeros(ticks.size - 1)
        for sign, begin in ((1, 0), (-1, n2), (-1, n1), (1, n1 + n2)):
            signs += sign * ((ticks[:-1] >= begin) & (ticks[:-1] < begin + n3))
        return SCurve.of_jerks(ticks * period, signs / (n1 * n2 * n3 * period**3))


def _polynomial(coefficients: Array, x: Array) -> Array:
    value = np.zeros_like(x)
    for row in coefficients:
        value = value * x + row
    return value


def time_optimal(velocity: float, acceleration: float, jerk: float) -> SCurve:
    """Time-optimal law from 0 to 1, from rest to rest."""
    unit = jerk ** (-1.0 / 3.0)  # unit of time in which J = 1: Ruckig's tolerances are absolute
    given, trajectory = InputParameter(1), Trajectory(1)
    given.current_position, given.target_position = [0.0], [1.0]
    given.max_velocity = [min(velocity * unit, _LOOSE)]
    given.max_acceleration = [min(acceleration * unit**2, _LOOSE)]
    given.max_jerk = [1.0]
    result = Ruckig(1).calculate(given, trajectory)
    if result is not Result.Working:
        raise RuntimeError(f"Ruckig ends with {result} for limits {velocity:g}, {acceleration:g}, {jerk:g}")
    profile = trajectory.profiles[0][0]
    kept = np.flatnonzero(np.array(profile.t) > 0.0)
    t, j = np.array(profile.t)[kept], np.array(profile.j)[kept]
    p, v, a = (np.array(values)[kept] for values in (profile.p, profile.v, profile.a))
    end = profile.p[-1]  # 1 up to rounding
    law = SCurve(np.concatenate([[0.0], np.cumsum(t)]), np.stack([j / 6.0, a / 2.0, v, p]) / end)
    return law.stretched(law.duration * unit)
