"""Friction that grows with the torque that a gear carries, such as that of harmonic drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import InputError
from regressors.friction.curve import FrictionCurve, Scaled, wrong_order
from regressors.samples import Array

Number = TypeVar("Number", Array, ca.SX)

MOST = 0.99  # largest load share that scaling may lead to


@dataclass(frozen=True)
class Loaded(FrictionCurve):
    """A curve, and a share of the carried torque in the direction of friction, ``f(v) + k s |tau|``.

    The carried torque tau is what moves the robot without friction: the measured one is ``tau + f(v) + k s |tau|``.
    Without a carried torque it is the curve alone.
    """

    layer: ClassVar[int] = 3

    curve: FrictionCurve  # f, the friction without load
    forward: float  # k for positive velocity, at least 0 and below 1
    backward: float | None = None  # k for negative velocity; as forward if not given

    def __post_init__(self) -> None:
        if self.curve.layer >= self.layer:
            raise wrong_order(self.curve, self)
        if self.backward is None:
            object.__setattr__(self, "backward", self.forward)
        for name in ("forward", "backward"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise InputError(f"friction: load {name} must be at least 0 and below 1, given {getattr(self, name):g}")

    @property
    def shares(self) -> tuple[float, float]:
        """Load shares k for positive and for negative velocity."""
        assert self.backward is not None
        return self.forward, self.backward

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """Torque of the curve without load."""
        return self.curve.torque(dz, direction)

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """Expression of the curve without load."""
        return self.curve.expression(dz, direction)

    def torque_at(self, dz: ArrayLike, temperature: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """Torque of the curve without load; the shares do not depend on temperature."""
        return self.curve.torque_at(dz, temperature, direction)

    def at(self, temperature: float | None) -> FrictionCurve:
        """The curve at one temperature, with the same shares."""
        return Loaded(self.curve.at(temperature), *self.shares)


def loading(curve: FrictionCurve, direction: Number) -> Number | float:
    """``k s``, the change of friction per unit of carried torque; zero for curves without a load share."""
    if not isinstance(curve, Loaded):
        return 0.0
    forward, backward = curve.shares
    share: Number = (1 + direction) / 2 * forward - (1 - direction) / 2 * backward
    return share


def carried(rest: Array, loading: Array | float) -> Array:
    """Carried torque tau of ``tau + k s |tau| = rest``."""  # rest (N,); loading (N,)
    return np.asarray(rest / (1.0 + loading * np.sign(rest)))


def carried_expression(rest: ca.SX, loading: ca.SX | float) -> ca.SX:
    """Carried torque as an expression, see `carried`."""
    return ca.if_else(rest >= 0, rest / (1 + loading), rest / (1 - loading))


def scaled(curve: FrictionCurve, factor: float) -> FrictionCurve:
    """A curve times a factor, with its load shares scaled likewise up to 0.99."""
    if not isinstance(curve, Loaded):
        return Scaled(curve, factor)
    shares = (min(factor * share, max(share, MOST)) for share in curve.shares)
    return Loaded(Scaled(curve.curve, factor), *shares)
