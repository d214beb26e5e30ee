"""Measured velocities, smoothed, and differentiated once for the acceleration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from excite.signals.cut import cut_motion
from excite.signals.method import FilteredMotion, Method
from regressors.errors import InputError
from regressors.samples import Array


@dataclass(frozen=True)
class MeasuredVelocity(Method):
    """Another method, applied to positions and to measured velocities on their own.

    The method obtains position from the positions, velocity from the velocities in place of positions, and acceleration
    as the first derivative of these; both with the settings that it chooses for the positions.
    """

    method: Method

    name: ClassVar[str] = "measured velocity"

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Position and velocity of the method, see `Method.motion`; InputError where no velocity was measured."""
        if dq is None:
            raise InputError("no velocity was measured; leave it to the method to find it from the positions")
        method = self.method.settled(time, q)
        position, velocity = method.motion(time, q), method.motion(time, dq)
        edge = max(position.kept.start, velocity.kept.start)
        state = (
            _whole(position.samples.q, position.kept, q),
            _whole(velocity.samples.q, velocity.kept, q),
            _whole(velocity.samples.dq, velocity.kept, q),
        )
        assumed = f"measured velocities; positions: {position.assumed}; velocities: {velocity.assumed}"
        return cut_motion(time, state, edge, assumed)


def _whole(part: Array, kept: slice, like: Array) -> Array:
    whole = np.full_like(like, np.nan)
    whole[kept] = part
    return whole
