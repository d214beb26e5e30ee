"""One design task: a robot, and the options of a design in seven small parts."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from excite.tasks.installation import Installation
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.model_choice import ModelChoice
from excite.tasks.objective import Objective
from excite.tasks.search import Output, Search
from excite.tasks.stored_files import StoredRobot
from excite.tasks.trajectory_choice import TrajectoryChoice
from regressors.arguments import checked
from regressors.errors import InputError, UnknownName
from regressors.quantities import Tips

if TYPE_CHECKING:
    from regressors.robot.friction.curves import FrictionCurves
    from regressors.robot.robot import Robot

PARTS: Mapping[str, type] = {
    "installation": Installation,
    "model": ModelChoice,
    "trajectory": TrajectoryChoice,
    "objective": Objective,
    "limits": LimitChoice,
    "search": Search,
    "output": Output,
}
PLACE = {field.name: part for part, kind in PARTS.items() for field in dataclasses.fields(kind)}
# Options that suit what a model takes from a log, where none are given. What servos are has no size that is known
# beforehand, which a condition number needs; inertia and delay show in quick reversals, but the speed that a servo has
# without load is beyond what it reaches with one: see benchmarks/servo/designs.py
OF_CHANNEL: Mapping[str, Mapping[str, Any]] = {
    "command": {"criterion": "logdet", "harmonics": 15, "velocity_scaling": 0.4, "stops": True}
}


@checked
@dataclass(frozen=True, init=False)
class Task:
    """A design task; the defaults are those of the command line.

    Every option of a part can be given by its own name too, as on the command line and in task files:
    ``Task("irp6", period=8, starts=3)`` is ``Task("irp6", trajectory=TrajectoryChoice(period=8),
    search=Search(starts=3))``.

    Parameters
    ----------
    robot : str or Robot
        Built-in name, file, or a robot object.
    base_link : str, optional
        First link of what moves, for a URDF.
    tip : str or sequence of str, optional
        Last link of the chain, or last links of the branches of a tree; all limbs if not given.
    snap_angles : bool
        Take rounded right angles of a URDF or an MJCF for right angles.
    xacro : bool
        Expand the file as xacro although its name does not end in ``.xacro``.
    installation : Installation
        How the robot is mounted, and what it carries.
    model : ModelChoice or str
        Equations and moving joints; or the name of a model.
    trajectory : TrajectoryChoice or str
        Family of motions and duration; or the name of a family.
    objective : Objective
    limits : LimitChoice
    search : Search
    output : Output
    **options
        Options of the parts, by name.

    Raises
    ------
    UnknownName
        An option that no part has.
    InputError
        An invalid value.
    """

    robot: str | Robot | StoredRobot
    base_link: str | None
    tip: str | tuple[str, ...] | None
    snap_angles: bool
    xacro: bool
    installation: Installation
    model: ModelChoice
    trajectory: TrajectoryChoice
    objective: Objective
    limits: LimitChoice
    search: Search
    output: Output

    def __init__(
        self,
        robot: str | Robot | StoredRobot,
        *,
        base_link: str | None = None,
        tip: Tips = None,
        snap_angles: bool = True,
        xacro: bool = False,
        **options: Any,
    ) -> None:
        if tip is not None and not isinstance(tip, str):
            tip = tuple(tip) if len(tip) > 1 else next(iter(tip), None)
        own = {"robot": robot, "base_link": base_link, "tip": tip, "snap_angles": snap_angles, "xacro": xacro}
        parts = _parts(options, {name: kind() for name, kind in PARTS.items()})
        for name, value in {**own, **parts}.items():
            object.__setattr__(self, name, value)
        tool = self.limits.tool_box is not None or self.limits.tool_speed is not None
        if self.installation.locked_drives is not None and (tool or self.model.channel == "wrench"):
            raise InputError(
                "`locked_drives` is for models and limits of joint torques: the last link may follow other joints, and "
                "limits of the tool and a force/torque sensor need a last link that a joint of its own moves"
            )
        samples = self.output.rate * self.trajectory.period
        self.output.check_duration(self.trajectory.period)
        if samples <= (fewest := self.trajectory.fewest_samples):
            option, count = self.trajectory.richness
            raise InputError(
                f"{self.trajectory.period:g} s at {self.output.rate:g} Hz is {samples:g} samples, too few for {count} "
                f"{option}; expected a rate above {fewest / self.trajectory.period:g} Hz"
            )

    def changed(self, **options: Any) -> Task:
        """The task with other options, or other parts.

        Parameters
        ----------
        **options
            See `Task`.
        """
        own = ("robot", "base_link", "tip", "snap_angles", "xacro")
        described = {name: options.pop(name, getattr(self, name)) for name in own}
        parts = _parts(options, {name: getattr(self, name) for name in PARTS})
        return Task(**described, **parts)

    @property
    def robot_name(self) -> str:
        """Name or file of the robot."""
        return self.robot if isinstance(self.robot, str) else self.robot.name

    @property
    def known_friction(self) -> FrictionCurves | None:
        """Friction that is known beforehand.

        Raises
        ------
        InputError
            A file of results names its file only.
        """
        return self.model.known_friction


def _parts(options: Mapping[str, Any], parts: dict[str, Any]) -> dict[str, Any]:
    """Parts of a task from options, some of which may be complete parts."""
    if "model" in options:
        options = {**_suited(options, parts), **options}
    chosen: dict[str, dict[str, Any]] = {name: {} for name in PARTS}
    for name, value in options.items():
        if name in PARTS and isinstance(value, PARTS[name]):
            parts[name] = value
        elif name not in PLACE:
            raise UnknownName("option of a task", name, (*PARTS, *PLACE))
        else:
            chosen[PLACE[name]][name] = value
    return {name: dataclasses.replace(part, **chosen[name]) for name, part in parts.items()}


def _suited(options: Mapping[str, Any], parts: Mapping[str, Any]) -> dict[str, Any]:
    """Options that suit the model that is chosen, of parts that have their defaults."""
    model = options["model"]
    choice = model if isinstance(model, ModelChoice) else ModelChoice(model=model)
    plain = {name for name, part in parts.items() if part == PARTS[name]()} - {
        name for name, value in options.items() if name in PARTS and isinstance(value, PARTS[name])
    }
    suited = OF_CHANNEL.get(choice.channel, {})
    return {name: value for name, value in suited.items() if PLACE[name] in plain}
