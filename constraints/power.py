"""Limits of mechanical power that every drive delivers to its coordinate, or absorbs while braking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from constraints.drive_friction import DriveFriction, drive_friction
from constraints.nonlinear import Limit, NonlinearConstraint
from constraints.torque import check_inertias, drive_torque_matrix, viscous_and_carried
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.models.partial import PartialMotion
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Limits, Robot
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array

SHARE = 0.5  # of torque limit times velocity limit: servo motors rarely reach both at once


@dataclass(frozen=True)
class PowerLimit(Limit):
    """Mechanical power ``|tau_z dz| <= P`` of every drive, or of every joint where the robot's file states no drives.

    Inertial, gravity and rotor torques and viscous friction come from the parameters of the robot's description. The
    remaining friction counts at its worst, at the drive's velocity limit: ``-P <= tau_z dz <= P - F_c dz_max``. Without
    a given power, as for ``--constraint power``, ``P = share tau_max dz_max`` from the description's limits, for the
    drives that have both.

    Parameters
    ----------
    power : float or sequence of float, optional
        P, one for all or one per drive [W]; from the limits of the description if not given.
    share : float
        Fraction of torque limit times velocity limit that is allowed where no power is given.
    friction : FrictionCurves, optional
        Curves of some of the drives, which replace the friction in the robot's description.
    """

    power: float | Sequence[float] | None = None
    share: float = SHARE
    friction: FrictionCurves | None = None

    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """One constraint for all drives or joints that have a bound.

        Raises
        ------
        InputError
            Powers that are not positive or of the wrong number, a robot without the limits to derive them from, links
            of unknown inertia, friction without a velocity limit or that uses up a bound, or see
            `constraints.torque.drive_torque_matrix`.
        """
        check_inertias(robot, "power limits")
        friction = drive_friction(robot, standard_values(robot), motion, self.friction)
        axes = _Axes.of(robot)
        bound = self._bound(axes)
        (kept,) = np.nonzero(np.isfinite(bound))
        lower, upper = -bound[kept], (bound - _losses(axes, friction, bound))[kept]
        torque, carried = viscous_and_carried(robot, standard_values(robot), friction)
        speeds, torques = sparse(axes.speeds[kept]), sparse(axes.torques[kept])
        more = sparse(friction.share[kept][:, None] * axes.torques[kept])  # friction that grows with the load

        def power(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
            total = ca.mtimes(torques, torque(q, dq, ddq)) + ca.mtimes(more, carried(q, dq, ddq))
            return total * ca.mtimes(speeds, dq)

        labels = tuple(f"{axes.names[k]} power" for k in kept)
        limit = NonlinearConstraint(
            robot.n, power, lower, upper, 0.5 * (upper - lower), labels, ("W",) * kept.size, quantity="power"
        )
        return (limit.restricted(motion),)

    def _bound(self, axes: _Axes) -> Array:
        """Largest power of each drive or joint, infinite where there is none [W]."""
        if self.power is not None:
            given = np.atleast_1d(np.asarray(self.power, dtype=float))
            if given.shape not in ((1,), (len(axes.names),)) or not np.all(given > 0):
                raise InputError(
                    f"power limits: expected a positive power, or one for each of {', '.join(axes.names)} [W]; "
                    f"given {self.power}"
                )
            return np.asarray(np.broadcast_to(given, (len(axes.names),)))
        if not 0 < self.share <= 1:
            raise InputError(f"power limits: share must be greater than 0 and at most 1, given {self.share}")
        bound = np.asarray(self.share * axes.limits.torque * axes.limits.velocity)
        if not np.any(np.isfinite(bound)):
            raise InputError(
                f"robot {axes.robot!r} has no torque and velocity limits to compute power limits from; give "
                "PowerLimit(power), or state them in its file"
            )
        return bound


@dataclass(frozen=True, eq=False)
class _Axes:
    """Axes whose power is limited: drives, or joints."""

    robot: str
    names: tuple[str, ...]
    limits: Limits
    speeds: Array  # matrix from joint velocities
    torques: Array  # matrix from joint torques

    @classmethod
    def of(cls, robot: Robot) -> _Axes:
        transmission = robot.transmission
        if transmission is None:
            unit = np.eye(robot.n)
            return cls(robot.name, tuple(f"joint {name}" for name in robot.joint_names), robot.limits, unit, unit)
        names = tuple(f"drive {drive.name}" for drive in transmission.drives)
        return cls(robot.name, names, transmission.limits, transmission.coupling, drive_torque_matrix(robot))


def _losses(axes: _Axes, friction: DriveFriction, bound: Array) -> Array:
    """Largest power lost in friction other than viscous at the velocity limits [W]."""
    rest, fastest = np.abs(friction.rest).max(axis=1), axes.limits.velocity
    losses: Array = np.multiply(rest, fastest, out=np.zeros_like(rest), where=rest > 0)
    for name, force, speed, loss, power in zip(axes.names, rest, fastest, losses, bound, strict=True):
        if np.isfinite(power) and not loss < power:
            raise InputError(
                f"{name} power: friction of {force:g} at the velocity limit {speed:g} takes all of {power:g} W; "
                "give a larger power"
            )
    return losses
