"""Limits of mechanical power, and of the tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from constraints.drive_friction import DriveFriction, drive_friction
from constraints.nonlinear import Limit, NonlinearConstraint
from constraints.torque import check_inertias, drive_torque_matrix, viscous_and_carried
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.models.partial import PartialMotion
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Limits, Robot, transmission_of
from regressors.robot.symbolic.kinematics import LinkMotion, link_motions, sparse
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
        transmission, C_T = transmission_of(robot), drive_torque_matrix(robot)
        kind, limits = ("joint", robot.limits) if robot.transmission is None else ("drive", transmission.limits)
        names = [f"{kind} {drive.name}" for drive in transmission.drives]
        bound = self._bound(robot, names, limits)
        (kept,) = np.nonzero(np.isfinite(bound))
        lower, upper = -bound[kept], (bound - _losses(names, limits.velocity, friction, bound))[kept]
        torque, carried = viscous_and_carried(robot, standard_values(robot), friction)
        speeds, torques = sparse(transmission.coupling[kept]), sparse(C_T[kept])
        more = sparse(friction.share[kept][:, None] * C_T[kept])  # friction that grows with the load

        def power(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
            total = ca.mtimes(torques, torque(q, dq, ddq)) + ca.mtimes(more, carried(q, dq, ddq))
            return total * ca.mtimes(speeds, dq)

        labels = tuple(f"{names[k]} power" for k in kept)
        limit = NonlinearConstraint(
            robot.n, power, lower, upper, 0.5 * (upper - lower), labels, ("W",) * kept.size, quantity="power"
        )
        return (limit.restricted(motion),)

    def _bound(self, robot: Robot, names: Sequence[str], limits: Limits) -> Array:
        """Largest power of each drive or joint, infinite where there is none [W]."""
        if self.power is not None:
            given = np.atleast_1d(np.asarray(self.power, dtype=float))
            if given.shape not in ((1,), (len(names),)) or not np.all(given > 0):
                raise InputError(
                    f"power limits: expected a positive power, or one for each of {', '.join(names)} [W]; "
                    f"given {self.power}"
                )
            return np.asarray(np.broadcast_to(given, (len(names),)))
        if not 0 < self.share <= 1:
            raise InputError(f"power limits: share must be greater than 0 and at most 1, given {self.share}")
        bound = np.asarray(self.share * limits.torque * limits.velocity)
        if not np.any(np.isfinite(bound)):
            raise InputError(
                f"robot {robot.name!r} has no torque and velocity limits to compute power limits from; give "
                "PowerLimit(power), or state them in its file"
            )
        return bound


def _losses(names: Sequence[str], fastest: Array, friction: DriveFriction, bound: Array) -> Array:
    """Largest power lost in friction other than viscous at the velocity limits [W]."""
    rest = np.abs(friction.rest).max(axis=1)
    losses: Array = np.multiply(rest, fastest, out=np.zeros_like(rest), where=rest > 0)
    for name, force, speed, loss, power in zip(names, rest, fastest, losses, bound, strict=True):
        if np.isfinite(power) and not loss < power:
            raise InputError(
                f"{name} power: friction of {force:g} at the velocity limit {speed:g} takes all of {power:g} W; "
                "give a larger power"
            )
    return losses


AXES = ("x", "y", "z")
_NEAR = 0.2  # m: the scale of a coordinate that has only one bound


def _tool(robot: Robot, point: Array, q: ca.SX, dq: ca.SX) -> tuple[LinkMotion, ca.SX]:
    links = list(link_motions(robot, q, dq, ca.SX(robot.n, 1)))
    return links[robot.last_link("the tool")], sparse(point)


def tool_box(robot: Robot, point: Array, lower: Array, upper: Array) -> NonlinearConstraint:
    """Position of a point of the last link in the base frame, ``lower <= p + R c <= upper``; bounds may be infinite."""
    # point (3,); lower, upper (3,)
    for axis, low, high in zip(AXES, lower, upper, strict=True):
        if not low < high:
            raise InputError(f"tool box, {axis}: the lower bound {low:g} m must be below the upper one {high:g} m")
    rows = np.flatnonzero(np.isfinite(lower) | np.isfinite(upper))
    if rows.size == 0:
        raise InputError("tool box: no bound is given")
    scale = np.where(np.isfinite(upper - lower), 0.5 * (upper - lower), _NEAR)

    def position(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        link, c = _tool(robot, point, q, dq)
        return (link.origin + ca.mtimes(link.rotation, c))[rows.tolist()]

    labels = tuple(f"tool {AXES[k]}" for k in rows)
    return NonlinearConstraint(
        robot.n, position, lower[rows], upper[rows], scale[rows], labels, ("m",) * rows.size, quantity="tool"
    )


def tool_speed(robot: Robot, point: Array, speed: float) -> NonlinearConstraint:
    """Speed of a point of the last link, ``|v + omega x c| <= speed``, by its square, which is smooth at rest."""
    # point (3,)
    if not (np.isfinite(speed) and speed > 0):
        raise InputError(f"tool speed must be a positive number, given {speed}")

    def squared(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        link, c = _tool(robot, point, q, dq)
        velocity = link.v + ca.cross(link.omega, c)
        return ca.dot(velocity, velocity) / speed

    def shown(values: Array) -> Array:
        return np.asarray(np.sign(values) * np.sqrt(np.abs(values) * speed))

    bound = np.array([speed])
    none = np.array([-np.inf])
    return NonlinearConstraint(robot.n, squared, none, bound, bound.copy(), ("tool speed",), ("m/s",), shown, "tool")


@checked
@dataclass(frozen=True)
class ToolBox(Limit):
    """A box that a point of the last link stays in.

    Parameters
    ----------
    lower, upper : sequence of float, length 3
        Bounds of x, y, z in the base frame; infinite where there is none [m].
    point : tuple of float
        In the last link's frame [m].
    """

    lower: Sequence[float]
    upper: Sequence[float]
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def of_sides(cls, sides: Sequence[tuple[float | None, float | None]], point: tuple[float, float, float]) -> ToolBox:
        """Box from a lower and an upper bound for each of x, y, z, None where there is none."""
        lower = tuple(-np.inf if low is None else low for low, _ in sides)
        return cls(lower, tuple(np.inf if high is None else high for _, high in sides), point)

    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """See `tool_box`."""
        lower, upper = np.array(self.lower, dtype=float), np.array(self.upper, dtype=float)
        return (tool_box(robot, np.array(self.point), lower, upper).restricted(motion),)


@checked
@dataclass(frozen=True)
class ToolSpeed(Limit):
    """Largest speed of a point of the last link.

    Parameters
    ----------
    speed : float
        [m/s]
    point : tuple of float
        In the last link's frame [m].
    """

    speed: float
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """See `tool_speed`."""
        return (tool_speed(robot, np.array(self.point), self.speed).restricted(motion),)
