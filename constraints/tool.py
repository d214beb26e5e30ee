"""Limits of the tool: a box that the tool point stays in, and a largest speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from constraints.nonlinear import Limit, NonlinearConstraint
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.partial import PartialMotion
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import LinkMotion, chain, sparse
from regressors.samples import Array

AXES = ("x", "y", "z")
_NEAR = 0.2  # m: the scale of a coordinate that has only one bound


def _tool(robot: Robot, point: Array, q: ca.SX, dq: ca.SX) -> tuple[LinkMotion, ca.SX]:
    *_, last = chain(robot, q, dq, ca.SX(robot.n, 1))
    return last, sparse(point)


def tool_box(robot: Robot, point: Array, lower: Array, upper: Array) -> NonlinearConstraint:
    """Position of a point of the last link within a box of the base frame.

    ``lower <= p + R c <= upper``; bounds may be infinite, so a plane ``z >= 0`` is a box too.
    """  # point (3,); lower, upper (3,)
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
    """Speed of a point of the last link, ``|v + omega x c| <= speed``.

    The bounded function is the squared speed divided by the limit, which is smooth at rest.
    """  # point (3,)
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
