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
    """Noise of an experiment; a single number applies to every channel.

    Parameters
    ----------
    effort : array_like, shape (c,)
        Standard deviation of white Gaussian noise on each measured torque, or component of the wrench [Nm or N].
    position : array_like, shape (n,)
        Of white Gaussian noise on each joint's position [rad or m].
    count : array_like, shape (n,)
        Step of each joint's encoder [rad or m]; 0 for none. The phase of the steps is random in every repetition.

    Raises
    ------
    InputError
        A number that is negative or not finite.
    """

    effort: ArrayLike = 0.0
    position: ArrayLike = 0.0
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
        """Deviation of the efforts, shape (c,), of the positions and steps of the encoders, shape (n,).

        Raises
        ------
        InputError
            Neither one number nor one for each channel.
        """
        sizes = {"effort": channels, "position": joints, "count": joints}
        for what, size in sizes.items():
            if getattr(self, what).shape not in ((), (1,), (size,)):
                raise InputError(f"noise, {what}: expected 1 number or {size}, given {getattr(self, what).size}")
        effort, position, count = (np.broadcast_to(getattr(self, what), (size,)) for what, size in sizes.items())
        return effort, position, count


class Draw(NamedTuple):
    """Random numbers of one repetition.

    Parameters
    ----------
    effort : ndarray, shape (N, c)
        Standard normal.
    position : ndarray, shape (N, n)
        Standard normal.
    phase : ndarray, shape (n,)
        Uniform in [0, 1): the phase of the encoders' steps.
    """

    effort: Array
    position: Array
    phase: Array


def drawn(seed: int, repetition: int, instants: int, joints: int, channels: int) -> Draw:
    """Random numbers of a repetition: the same for the same seed and number, whatever else is drawn.

    Parameters
    ----------
    seed, repetition : int
    instants, joints, channels : int
        N, n and c.
    """
    rng = np.random.default_rng([seed, repetition])
    phase = rng.random(joints)
    return Draw(rng.standard_normal((instants, channels)), rng.standard_normal((instants, joints)), phase)


def measured_position(q: Array, draw: Draw, deviation: Array, step: Array) -> Array:
    """Positions as an encoder measures them, ``step (round((q + noise) / step + phase) - phase)``, shape (N, n).

    Parameters
    ----------
    q : ndarray, shape (N, n)
    draw : Draw
    deviation, step : ndarray, shape (n,)
        See `Noise`.
    """
    noisy = q + deviation * draw.position
    whole = np.where(step > 0, step, 1.0)
    counted = whole * (np.round(noisy / whole + draw.phase) - draw.phase)
    return np.where(step > 0, counted, noisy)
