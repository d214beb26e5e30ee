"""What the robot may not do: limits of its joints given for one task, and constraints beside the robot's own limits.

The command line's help is made from the class, so what takes long to import is imported where it is used.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from excite.registry import built_in, check_part, instance
from excite.tasks.option import AUTO, NONE, essential, option, strict
from excite.tasks.stored_files import UnopenedFile
from regressors.errors import InputError

if TYPE_CHECKING:  # what describes options must be imported in no time
    from constraints.balance import Balance
    from constraints.geometry import World
    from constraints.nonlinear import Limit
    from regressors.robot.friction.curves import FrictionCurves
    from regressors.robot.robot import Robot

Content = TypeVar("Content")
Side = tuple[float | None, float | None]
TORQUE_MARGIN = 0.1  # of a torque limit: what nominal masses may be off, before the robot itself stops the motion
OF_JOINTS = ("position", "velocity", "acceleration", "jerk")


@dataclass(frozen=True)
class LimitChoice:
    """Limits of one task. Those of joints replace the description's; all others come on top.

    Parameters
    ----------
    position : tuple of (float, float), optional
        Lower and upper bound per joint [rad or m].
    velocity, acceleration, jerk : tuple of float, optional
        One per joint, or one for all [rad/s, rad/s^2, rad/s^3, or with m].
    velocity_scaling : float
        Share of the description's velocity limits that the motion may use, where `velocity` gives no others.
    torque_margin : float, "auto" or "none"
        Part of the torque limits of joints and drives that is kept in reserve. ``"auto"`` keeps 10 %, and leaves the
        limits out where the description does not state them, or no inertial parameters to check them with; a number
        imposes them in any case; ``"none"`` or None leaves them out.
    torque_uncertainty : float, optional
        Share by which every parameter of the description may be off, with which the torque limits must still hold,
        without a reserve; see `constraints.torque.PlausibleTorqueLimit`.
    tool_point : tuple of float
        Point of the robot's last link whose place and speed are limited, and which keeps off the floor, in that link's
        frame [m].
    tool_box : tuple of (float, float), optional
        Lower and upper bound of its x, y, z in the base frame, None where there is none [m].
    tool_speed : float, optional
        Largest speed of that point [m/s].
    floor : float, "auto" or "none"
        Height of the surface that the robot is mounted on above the origin of its base, along its normal [m], which all
        that moves keeps 2 cm away from; see `excite.design.stated_limits.stated_world`. ``"auto"`` puts it through the
        lowest point of the base's shape, or its origin, where the robot's description stands on it; ``"none"`` or None
        leaves it out.
    world : World, optional
        Shape of the robot and of what is around it, to stay apart. If not given, obstacles are not checked, and contact
        of the robot with itself only if its file has shapes.
    support : Balance, optional
        Where a robot that stands free touches the ground, and the mass of its stand, so that it does not tip or slide;
        the share of `torque_uncertainty` counts there too. If not given, the base is taken to stand still.
    self_collision : bool
        Whether to check that, where no world is given.
    constraints : tuple of Limit or str
        Further limits, as objects or by name: built-in ones that need no numbers, or ``module:Name``.

    Raises
    ------
    InputError
        Bounds of another number, or of a tool that nothing limits.
    """

    position: tuple[tuple[float, float], ...] | None = option(
        None, "ranges", "Position limits per joint.", metavar="L:U,...", flag="position-limit"
    )
    velocity: tuple[float, ...] | None = essential(
        None, "numbers", "Velocity limits; one for all joints, or one each.", metavar="V,...", flag="velocity-limit"
    )
    acceleration: tuple[float, ...] | None = essential(
        None, "numbers", "Acceleration limits.", metavar="A,...", flag="acceleration-limit"
    )
    jerk: tuple[float, ...] | None = option(None, "numbers", "Jerk limits.", metavar="J,...", flag="jerk-limit")
    velocity_scaling: float = option(
        1.0,
        "number",
        "Share of the description's velocity limits to use, if no others are given; 0.4 for the model servo.",
        metavar="X",
        late=True,
    )
    torque_margin: float | str | None = essential(
        AUTO,
        "margin",
        "Part of the torque limits kept in reserve; auto: 0.1 if the description has torque limits and "
        "plausible inertias; none: torques are not checked.",
        metavar="X|auto|none",
    )
    torque_uncertainty: float | None = option(
        None,
        "number",
        "Keep the torque limits for all robots whose masses, inertias and friction are off by up to this share.",
        metavar="X",
        late=True,
    )
    tool_box: tuple[Side, Side, Side] | None = option(
        None, "box", "Box in which the tool must stay, x,y,z, such as -1:1,:,0:.", metavar="L:U,L:U,L:U"
    )
    tool_speed: float | None = option(None, "number", "Largest speed of the tool.", metavar="V")
    tool_point: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), "triple", "Position of the tool in the last link's frame."
    )
    floor: float | str | None = option(
        AUTO,
        "margin",
        "Height above the base's origin of the surface that the robot is mounted on, from which it keeps 2 cm; "
        "auto: that of the base's lowest point; none: not checked.",
        metavar="HEIGHT|auto|none",
    )
    world: World | UnopenedFile | None = option(
        None, "file", "Shape of the robot and obstacles, to avoid collisions; see below.", metavar="FILE"
    )
    support: Balance | UnopenedFile | None = option(
        None, "file", "Support polygon of a robot that stands free, not to tip or slide; see below.", late=True
    )
    self_collision: bool = option(
        True, "flag", "Keep the links of a URDF with shapes from touching each other, where no world file is given."
    )
    constraints: tuple[Limit | str, ...] = option(
        (), "parts", "Further limits: torque, or module:Name; repeatable.", metavar="NAME", flag="constraint"
    )

    def __post_init__(self) -> None:
        strict(self)
        for given in self.constraints:
            check_part("constraint", given)
        if self.torque_margin == NONE:
            object.__setattr__(self, "torque_margin", None)
        if self.floor is None:
            object.__setattr__(self, "floor", NONE)
        box, point = self.tool_box, self.tool_point
        if box is not None and (len(box) != 3 or any(len(side) != 2 for side in box)):
            raise InputError("tool_box needs a lower and an upper bound for each of x, y, z")
        if any(point) and box is None and self.tool_speed is None and self.floor == NONE:
            raise InputError(
                "`tool_point` needs a limit of the tool, but none is given; give `tool_box`, `tool_speed` or `floor`"
            )

    def applied(self, robot: Robot) -> Robot:
        """The robot with these limits of its joints.

        Raises
        ------
        InputError
            A wrong count, or limits that leave no room.
        """
        import numpy as np

        changes: dict[str, Any] = {}
        for name in ("velocity", "acceleration", "jerk"):
            if (values := getattr(self, name)) is not None:
                changes[name] = np.array(_one_per_joint(values, name, robot))
        if self.velocity is None and self.velocity_scaling != 1.0:
            changes["velocity"] = self.velocity_scaling * robot.limits.velocity
        if self.position is not None:
            if len(self.position) != robot.n:
                raise InputError(f"limits: position needs {robot.n} pairs, one per joint, given {len(self.position)}")
            changes["lower"], changes["upper"] = np.array(self.position, dtype=float).T
        return robot.replace(limits=dataclasses.replace(robot.limits, **changes)) if changes else robot

    @property
    def known_world(self) -> World | None:
        """The world; raises `InputError` where a file of results names its file only."""
        return _opened("world", self.world)

    def stated_torque(self, friction: FrictionCurves | None = None) -> Limit | None:
        """Limit of torques that holds by default; None where it is given, left out, or among the constraints.

        Parameters
        ----------
        friction : FrictionCurves, optional
            That it counts, instead of the description's.
        """
        torque = built_in("constraint", "torque")
        given = any(isinstance(instance("constraint", each), torque) for each in self.constraints)
        return None if self.torque_margin != AUTO or given else torque(TORQUE_MARGIN, friction)

    def imposed(self, friction: FrictionCurves | None = None) -> tuple[Limit, ...]:
        """Every limit beside those of joints and drives.

        Parameters
        ----------
        friction : FrictionCurves, optional
            That torque limits count, instead of the description's.
        """
        limits: list[Limit] = []
        if isinstance(self.torque_margin, float):
            limits.append(built_in("constraint", "torque")(self.torque_margin, friction))
        if self.torque_uncertainty is not None:
            limits.append(built_in("constraint", "plausible-torque")(self.torque_uncertainty, friction))
        if self.tool_box is not None:
            limits.append(built_in("constraint", "tool-box").of_sides(self.tool_box, self.tool_point))
        if self.tool_speed is not None:
            limits.append(built_in("constraint", "tool-speed")(self.tool_speed, self.tool_point))
        if self.known_world is not None:
            limits.append(built_in("constraint", "collision")(self.known_world))
        if (support := _opened("support", self.support)) is not None:
            limits.append(dataclasses.replace(support, uncertainty=self.torque_uncertainty or support.uncertainty))
        own = (instance("constraint", given) for given in self.constraints)
        return (*limits, *(limit.knowing(friction) for limit in own))


def _opened(option: str, given: Content | UnopenedFile) -> Content:
    """The content of a file."""
    if isinstance(given, UnopenedFile):
        raise given.missing()
    if given is not None and not hasattr(given, "to_dict"):
        raise InputError(f"{option}: expected what `read_{option}` returns, given {given!r:.60}")
    return given


def _one_per_joint(values: tuple[float, ...], name: str, robot: Robot) -> tuple[float, ...]:
    if len(values) == 1:
        return values * robot.n
    if len(values) != robot.n:
        raise InputError(
            f"limits: {name} needs one value, or {robot.n} for the joints {', '.join(robot.joint_names)}; "
            f"given {len(values)}"
        )
    return values
