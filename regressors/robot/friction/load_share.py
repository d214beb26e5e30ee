"""Drives whose friction depends on the torque that they carry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import InputError
from regressors.robot.friction.curve import Directed, FrictionCurve, Scaled, Wrapped, by_direction
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array

MOST = 0.99  # largest load share that scaling may lead to


@dataclass(frozen=True)
class Loaded(Wrapped):
    """A curve, and a share of the carried torque in the direction of friction, ``f(v) + k s |tau|``.

    The carried torque tau is what moves the robot without friction: the measured one is ``tau + f(v) + k s |tau|``.
    Without a carried torque it is the curve alone.
    """

    layer: ClassVar[int] = 3

    forward: float  # k for positive velocity, at least 0 and below 1
    backward: float | None = None  # k for negative velocity; as forward if not given

    def __post_init__(self) -> None:
        super().__post_init__()
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

    def torque_at(self, dz: ArrayLike, temperature: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """Torque of the curve without load; the shares do not depend on temperature."""
        return self.curve.torque_at(dz, temperature, direction)

    def at(self, temperature: float | None) -> FrictionCurve:
        """The curve at one temperature, with the same shares."""
        return Loaded(self.curve.at(temperature), *self.shares)


def loading(curve: FrictionCurve, direction: Directed) -> Directed | float:
    """``k s``, the change of friction per unit of carried torque; zero for curves without a load share."""
    return by_direction(direction, *curve.shares) if isinstance(curve, Loaded) else 0.0


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
    return Loaded(Scaled(curve.curve, factor), *scaled_shares(curve, factor))


def scaled_shares(curve: Loaded, factor: float) -> list[float]:
    """Load shares times a factor, up to 0.99 or what they are."""
    return [min(factor * share, max(share, MOST)) for share in curve.shares]


_NOTHING = 1e-12  # of a drive's velocity along a direction


def drives_with_friction(robot: Robot) -> tuple[tuple[str, Array], ...]:
    """Name and row of C of every drive whose joint moves; joints themselves where the robot has no transmission."""
    transmission = robot.transmission
    if transmission is None:
        return tuple(zip(robot.joint_names, np.eye(robot.n), strict=True))
    rows = zip(transmission.drives, transmission.coupling, strict=True)
    return tuple((drive.name, row) for drive, row in rows if not drive.rests)


def moving_drive_numbers(robot: Robot) -> dict[str, int]:
    """Number in parameter names of every drive whose joint moves, by name."""
    if robot.transmission is None:
        return dict(zip(robot.joint_names, robot.link_numbers, strict=True))
    return {drive.name: k for k, drive in enumerate(robot.transmission.drives, 1) if not drive.rests}


def drive_temperatures(robot: Robot, temperature: Array) -> Array:
    """Temperatures of the drives with friction: each takes the temperature of its own joint.

    Where there are as many drives as joints, a drive's own joint is the one of the same number, if the drive moves it,
    such as in a differential wrist ``z4 = q4 + q5, z5 = q4 - q5``; otherwise it is the last joint that the drive moves.
    """  # temperature (N, n)
    rows = [row for _, row in drives_with_friction(robot)]
    paired = len(rows) == robot.n
    own = [k if paired and row[k] != 0.0 else int(np.flatnonzero(row)[-1]) for k, row in enumerate(rows)]
    return np.asarray(temperature)[:, own]


def smooth_direction(robot: Robot, dq: ca.SX, width: ca.SX | float) -> ca.SX:
    """``tanh(dz / width)`` of every drive with friction."""  # dq (n, 1)
    rows = np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)
    return ca.densify(ca.tanh(ca.mtimes(sparse(rows), dq) / width))


def torques_at_drives(robot: Robot) -> Array:
    """Matrix from joint torques to those of the drives with friction, ``tau = C' tau_z`` solved for ``tau_z``."""
    drives = drives_with_friction(robot)
    C = np.array([row for _, row in drives]).reshape(-1, robot.n)
    if C.shape[0] != robot.n or np.linalg.matrix_rank(C) < robot.n:
        raise InputError(
            f"friction that grows with load needs one drive for each joint; here {robot.n} joints "
            f"({', '.join(robot.joint_names)}) have the drives {', '.join(name for name, _ in drives)}"
        )
    return np.asarray(np.linalg.inv(C.T))


def carried_along(robot: Robot, moved: Array) -> Array:
    """Matrix from torques along directions, ``N' tau``, to joint torques with the same load on moved drives."""
    # moved (n, r)
    C = np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)
    along = C @ moved
    turning = np.any(np.abs(along) > _NOTHING, axis=1)
    if np.count_nonzero(turning) != along.shape[1] or np.linalg.matrix_rank(along[turning]) < along.shape[1]:
        names = [name for (name, _), turns in zip(drives_with_friction(robot), turning, strict=True) if turns]
        raise InputError(
            f"friction grows with load, and torques along {along.shape[1]} direction(s) "
            "do not determine the load of each "
            f"of the drives {', '.join(names)}; take all joints, or drives that move alone"
        )
    return np.asarray(C[turning].T @ np.linalg.inv(along[turning]).T)
