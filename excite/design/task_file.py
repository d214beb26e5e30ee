"""Task files: the options of ``excite design`` as YAML, and a task's options as the plain values of ``design.json``."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, create_model

from constraints.balance import Balance, balance_of, read_support
from constraints.geometry import World
from constraints.world_file import read_world, world_of
from excite.registry import BUILT_IN, OwnPart, name_of, place_of
from excite.tasks.friction_file import friction_content, friction_of_content, known_beforehand, read_friction
from excite.tasks.limit_choice import OF_JOINTS, LimitChoice
from excite.tasks.model_options import options_of_model
from excite.tasks.objective import Belief
from excite.tasks.option import NONE, Kind, Option, options_of, rule_of_option
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.stored_files import TaskMotion, TaskServos, UnopenedFile
from excite.tasks.task import PARTS, Task
from regressors.arguments import Unfit
from regressors.quantities import QUANTITIES, shown
from regressors.readers.documents import read_document, validate, within
from regressors.robot.friction.curves import FrictionCurves

_CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False)
_FORMERLY = {
    "reflected_rotors": False,
    "velocity_scaling": 1.0,
}  # what files of results without these options were made with
_REMOVED = dict.fromkeys([("solver", "slsqp"), ("solver", "ipopt")], "sqp")  # parts of older files, and what is taken
_FILES = (
    "world", "support", "friction_curves", "payload", "task_motion", "servos", "begin"
)  # options that may be names of files  # fmt: skip
_OF_ROBOT_FILE: dict[str, Kind] = {  # how the robot's file is read
    "robot": "name", "base_link": "name", "tip": "names", "snap_angles": "flag", "xacro": "flag"
}  # fmt: skip
_ENDS = ("base_link", "tip")  # of what moves, beside the options of the parts


def _as_written(option: Option) -> Any:
    """Type of an option's value, which stays as it is written where Python takes it too."""
    convert, expected = rule_of_option(option)

    def fitting(value: object) -> object:
        try:
            convert(value)
        except Unfit as error:
            raise ValueError(f"should be {expected}, given {shown(value)}") from error
        return value

    return Annotated[Any, AfterValidator(fitting)]


def _type(name: str, option: Option) -> Any:
    """Type of an option's value; of numbers also their range."""
    if option.kind == "prior":
        return Annotated[Any, AfterValidator(known_beforehand)]
    checked = name in QUANTITIES and option.kind != "precision"
    return Annotated[_as_written(option), AfterValidator(within(name))] if checked else _as_written(option)


def option_types() -> dict[str, Any]:
    """Types of the values of every option of a task file by name; limits of joints are below ``limits``."""
    types = {name: _as_written(Option(kind, "")) for name, kind in _OF_ROBOT_FILE.items()}
    limits: dict[str, Any] = {}
    for part in PARTS.values():
        for field, option in options_of(part):
            joints = part is LimitChoice and field.name in OF_JOINTS
            (limits if joints else types)[field.name] = _type(field.name, option)
    return {**types, "limits": options_schema("Limits", limits)}


def options_schema(name: str, types: Mapping[str, Any]) -> type[BaseModel]:
    """Schema with options of given types, none of them required."""
    fields: dict[str, Any] = {option: (kind | None, None) for option, kind in types.items()}
    return create_model(name, __config__=_CONFIG, **fields)


def beside(folder: Path, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options whose names of files are relative to the folder of the file that states them."""
    named = {name: str(folder / options[name]) for name in _FILES[:-1] if isinstance(options.get(name), str)}
    return {**options, **named}


def read_task_file(path: Path) -> dict[str, Any]:
    """Read the options of a task file, ready for `task_from_options`."""
    options = validate(read_document(path, "task file"), options_schema("Task", option_types()))
    return beside(path.parent, options.model_dump(exclude_none=True))


def task_from_options(
    options: Mapping[str, Any], *, stored: bool = False, allowed: Collection[str] = (), **own: Any
) -> Task:
    """Task from the plain options of a command line, of a task file or of ``design.json``."""
    given = {name: value for name, value in options.items() if value is not None}
    if stored:
        given = {"torque_margin": NONE, "floor": NONE, **given}  # of files that are older than "auto"
    given |= {name: value for name, value in (given.pop("limits", None) or {}).items() if value is not None}
    if stored:
        given = {**_FORMERLY, **given}
        given = {name: _stored(name, value, allowed) for name, value in given.items()}
        given.setdefault("snap_angles", False)  # files that do not say it were made of the angles as printed
    given |= {name: value for name, value in own.items() if value is not None}
    for name, content in ((name, given[name]) for name in _OF_CONTENT if isinstance(given.get(name), Mapping)):
        given[name] = _OF_CONTENT[name](content)
    for name, file in ((name, given[name]) for name in _OF_FILE if isinstance(given.get(name), str | Path)):
        given[name] = _OF_FILE[name](Path(file), given)
    return Task(**given)


def _stored(name: str, value: Any, allowed: Collection[str]) -> Any:
    if isinstance(value, str) and name in _FILES:
        return UnopenedFile(name, value)
    if isinstance(value, str) and name in BUILT_IN:
        return stored_part(name, _REMOVED.get((name, value), value), allowed)
    if name == "after":
        return tuple(UnopenedFile(name, each) if isinstance(each, str) else each for each in value)
    if name == "constraints":
        return tuple(stored_part("constraint", part, allowed) for part in value)
    return value


def stored_part(kind: str, name: str, allowed: Collection[str]) -> str | OwnPart:
    """A part named in a file of results: its name if it is built in or allowed, else a part that is not imported."""
    return OwnPart(kind, name) if ":" in name and name not in allowed else name


def _world(path: Path, options: Mapping[str, Any]) -> World:
    ends = (options.get(end) for end in _ENDS)
    robot = options["robot"] if isinstance(options["robot"], str) else ""
    return read_world(path, robot, *ends, snap_angles=options.get("snap_angles", True))


def _beliefs(prior: Mapping[str, Any]) -> tuple[Belief, ...]:
    return tuple(Belief(name, float(known["value"]), float(known["deviation"])) for name, known in prior.items())


_OF_CONTENT: Mapping[str, Callable[[Any], Any]] = {
    "prior": _beliefs,
    "world": world_of,
    "support": balance_of,
    "task_motion": TaskMotion.from_dict,
    "servos": lambda content: TaskServos(**content),
    "friction_curves": friction_of_content,
}
_OF_FILE: Mapping[str, Callable[[Path, Mapping[str, Any]], Any]] = {
    "world": _world,
    "support": lambda path, _: read_support(path),
    "friction_curves": lambda path, _: read_friction(path),
}


def _content(given: Any) -> Any:
    """Content of a world, a support polygon or of curves; the name of what is only named."""
    if isinstance(given, World | Balance | TaskMotion | TaskServos):
        return given.to_dict()
    if isinstance(given, FrictionCurves):
        return friction_content(given)
    return given if given is None or isinstance(given, tuple) else str(given)


def _part_name(kind: str, given: Any) -> str:
    """Name of a part; the place of a model object where the options beside it do not say what it was made with."""
    told = kind != "model" or isinstance(given, str | OwnPart | type) or options_of_model(given) is not None
    return name_of(given) if told else place_of(given)


def task_content(task: Task) -> dict[str, Any]:
    """Options of a task as plain values: the keys of a task file."""
    options: dict[str, Any] = {}
    for part in PARTS:
        for field, option in options_of(PARTS[part]):
            value = getattr(getattr(task, part), field.name)
            if not option.late or value != field.default:
                options[field.name] = _part_name(option.part, value) if option.part is not None else value
    if "after" in options:
        options["after"] = [str(each) for each in task.objective.after]
    options["limits"] = {name: options.pop(name) for name in OF_JOINTS}
    options["constraints"] = [place_of(limit) for limit in task.limits.constraints]  # objects have their own settings
    if task.limits.torque_margin is None:
        options["torque_margin"] = NONE
    for name in _FILES:
        if name in options:
            options[name] = _content(options[name])
    if isinstance(task.objective.prior, tuple):
        options["prior"] = {b.name: {"value": b.value, "deviation": b.deviation} for b in task.objective.prior}
    if isinstance(task.objective.precision, PrecisionTarget):
        options["precision"] = task.objective.precision.to_dict()
    tip = list(task.tip) if isinstance(task.tip, tuple) else task.tip
    described: dict[str, Any] = {"robot": task.robot_name, "base_link": task.base_link, "tip": tip}
    described |= {"snap_angles": task.snap_angles} | ({"xacro": True} if task.xacro else {})
    return {**described, **options}
