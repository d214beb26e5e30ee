"""Task files: the options of ``excite design`` as YAML, checked against `excite.tasks.task.Task`."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, create_model

from constraints.collision.geometry import World
from excite.files.friction_file import read_friction
from excite.files.prior_file import known_beforehand
from excite.files.world_file import read_world, world_of
from excite.tasks.task import ROBOTS_HOME, Belief, LimitOverrides, Task
from regressors.errors import InputError
from regressors.readers.documents import checked, described, parse_document

_CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False)


def _schema(kind: type, **given: Any) -> type[BaseModel]:
    """Schema with the fields of a dataclass, none of them required."""
    hints = {**get_type_hints(kind), **given}
    fields: dict[str, Any] = {field.name: (hints[field.name] | None, None) for field in dataclasses.fields(kind)}
    return create_model(kind.__name__, __config__=_CONFIG, **fields)


def _several(value: object) -> object:
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else value


def _text(value: object) -> object:
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _filed(value: object) -> object:
    """The name of another file, from the task file's folder; or its content."""
    if not isinstance(value, str | dict):
        raise ValueError(f"should be the name of a file or its content, given {described(value)}")
    return value


_NUMBERS = Annotated[list[float], BeforeValidator(_several)]  # one number stands for all joints
_RANGE = Annotated[list[float], Field(min_length=2, max_length=2)]
_NAMES = list[Annotated[str, BeforeValidator(_text)]]  # or numbers of joints
_PRIOR = Annotated[Any, AfterValidator(known_beforehand)]
_FILED = Annotated[Any, AfterValidator(_filed)]
_LIMITS = _schema(
    LimitOverrides, position=list[_RANGE], **dict.fromkeys(("velocity", "acceleration", "jerk"), _NUMBERS)
)
_POSE = _NUMBERS | Literal["robot"]
_TASK = _schema(
    Task,
    **dict.fromkeys(("world", "friction_curves"), _FILED),
    **dict.fromkeys(("speed", "noise"), _NUMBERS),
    limits=_LIMITS,
    home=_POSE,
    joints=_NAMES,
    prior=_PRIOR,
)


def read_task_file(path: Path) -> dict[str, Any]:
    """Options that a task file gives, ready for `task_from_options`.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        Cannot be read, malformed (with the line), or a key or value that no task has.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read task file {path}: {getattr(error, 'strerror', None) or error}") from error
    options = checked(parse_document(text, str(path)), _TASK).model_dump(exclude_none=True)
    for name in ("world", "friction_curves"):
        if isinstance(options.get(name), str):
            options[name] = str(path.parent / options[name])
    return options


def task_from_options(options: dict[str, Any]) -> Task:
    """Task from the plain options of a task file or of ``design.json``; single numbers stand for all joints.

    Parameters
    ----------
    options : dict
        Keys of `excite.tasks.task.Task`.
    """
    options = {name: value for name, value in options.items() if value is not None}
    limits = {name: value for name, value in options.pop("limits", {}).items() if value is not None}
    if "position" in limits:
        limits["position"] = tuple((float(lower), float(upper)) for lower, upper in limits["position"])
    for name in ("velocity", "acceleration", "jerk"):
        if name in limits:
            limits[name] = _numbers(limits[name])
    for name in ("start", "require", "equations", "drives"):
        if name in options:
            options[name] = tuple(str(part) for part in options[name])
    if "tool_box" in options:
        options["tool_box"] = tuple((side[0], side[1]) for side in options["tool_box"])
    for name in ("sensor_xyz", "sensor_rpy", "tool_point"):
        if name in options:
            options[name] = tuple(float(part) for part in options[name])
    for name in ("noise", "home", "speed"):
        if name in options and options[name] != ROBOTS_HOME:
            options[name] = _numbers(options[name])
    if "via" in options:
        options["via"] = tuple(_numbers(pose) for pose in options["via"])
    if "prior" in options:
        options["prior"] = _prior(options["prior"])
    if "world" in options:
        options["world"] = _world(options)
    if isinstance(options.get("friction_curves"), str | Path):
        options["friction_curves"] = read_friction(Path(options["friction_curves"]))
    if "joints" in options:
        options["joints"] = tuple(str(name) for name in options["joints"])
    return Task(**options, limits=LimitOverrides(**limits))


def _world(options: dict[str, Any]) -> World:
    """The world itself, the content of a world file, or the name of one."""
    world = options["world"]
    if isinstance(world, str | Path):
        return read_world(Path(world), options["robot"], options.get("base_link"), options.get("tip"))
    return world if isinstance(world, World) else world_of(world)


def _prior(value: float | dict[str, dict[str, float]]) -> float | tuple[Belief, ...]:
    if isinstance(value, int | float):
        return float(value)
    return tuple(Belief(name, float(known["value"]), float(known["deviation"])) for name, known in value.items())


def _numbers(value: float | tuple[float, ...]) -> tuple[float, ...]:
    return (float(value),) if isinstance(value, int | float) else tuple(float(v) for v in value)
