"""Measurement noise on positions and efforts, and quantisation of encoders. Seeded, one draw per repetition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import InputError
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of an experiment; a single number applies to every channel."""

    # (c,) standard deviation of white Gaussian noise on each measured torque, or component of the wrench [Nm or N]
    effort: ArrayLike = 0.0
    position: ArrayLike = 0.0  # (n,) of white Gaussian noise on each joint's position [rad or m]
    # (n,) step of each joint's encoder [rad or m]; 0 for none. The phase of the steps is random in every repetition
    count: ArrayLike = 0.0

    def __post_init__(self) -> None:
        for what in ("effort", "position", "count"):
            values = np.asarray(getattr(self, what), dtype=float)
            if not np.all(np.isfinite(values) & (values >= 0)):
                raise InputError(f"noise, {what}: expected finite numbers, zero or more, given {values.tolist()}")
            object.__setattr__(self, what, values)

    @property
    def moves(self) -> bool:
        """True if positions are not measured exactly."""
        return bool(np.any(self.position) or np.any(self.count))

    def spread(self, joints: int, channels: int) -> tuple[Array, Array, Array]:
        """Deviation of the efforts, shape (c,), of the positions and steps of the encoders, shape (n,)."""
        sizes = {"effort": channels, "position": joints, "count": joints}
        for what, size in sizes.items():
            if getattr(self, what).shape not in ((), (1,), (size,)):
                raise InputError(f"noise, {what}: expected 1 number or {size}, given {getattr(self, what).size}")
        effort, position, count = (np.broadcast_to(getattr(self, what), (size,)) for what, size in sizes.items())
        return effort, position, count


class Draw(NamedTuple):
    """Random numbers of one repetition."""

    effort: Array  # (N, c) standard normal
    position: Array  # (N, n) standard normal
    phase: Array  # (n,) uniform in [0, 1): the phase of the encoders' steps


def drawn(seed: int, repetition: int, instants: int, joints: int, channels: int) -> Draw:
    """Random numbers of a repetition: the same for the same seed and number, whatever else is drawn."""
    rng = np.random.default_rng([seed, repetition])
    phase = rng.random(joints)
    return Draw(rng.standard_normal((instants, channels)), rng.standard_normal((instants, joints)), phase)


def measured_position(q: Array, draw: Draw, deviation: Array, step: Array) -> Array:
    """Positions as an encoder measures them, ``step (round((q + noise) / step + phase) - phase)``, shape (N, n)."""
    # q (N, n); deviation, step (n,)
    noisy = q + deviation * draw.position
    whole = np.where(step > 0, step, 1.0)
    counted = whole * (np.round(noisy / whole + draw.phase) - draw.phase)
    return np.where(step > 0, counted, noisy)
