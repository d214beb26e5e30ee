"""Definitions of ROS messages: from the bag where it has them, else those that its type had in the releases of ROS.

A definition is a mapping of the names of types to their fields, each a name and a descriptor, as rosbags parses them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

from excite.logs.recordings.optional_package import optional_package
from regressors.quoting import cut

Fields: TypeAlias = list[tuple[str, Any]]
Definitions: TypeAlias = Mapping[str, Fields]


class UnreadableMessage(Exception):
    """A message that does not follow its definition, or one of a kind that is not read; the text says why."""


LONGEST_TEXT = 200_000  # characters of a definition with all that it refers to
_CONTROLLER_STATE = "control_msgs/msg/JointTrajectoryControllerState"
_POINTS = "trajectory_msgs/JointTrajectoryPoint"
_MULTI = "trajectory_msgs/MultiDOFJointTrajectoryPoint"
# control_msgs is not among the types that rosbags knows. Its releases, newest first: 5 (Jazzy), 4 (Humble), 3 (Foxy).
_STATES = (
    (("reference", "feedback", "error", "output"), True),
    (("reference", "feedback", "error", "output", "desired", "actual"), True),
    (("desired", "actual", "error"), False),
)


def _state_text(points: tuple[str, ...], multi: bool) -> str:
    lines = ["std_msgs/Header header", "string[] joint_names", *(f"{_POINTS} {name}" for name in points)]
    if multi:
        lines += ["string[] multi_dof_joint_names", *(f"{_MULTI} multi_dof_{name}" for name in points)]
    return "\n".join(lines)


def definitions_of(source: Path, name: str, form: str, text: str, ros1: bool = False) -> Iterator[Definitions]:
    """Definitions that a type of message may have, the most probable first.

    No code is made from them, as the deserialisers of rosbags would do.
    """
    typesys = optional_package("rosbags.typesys", "ros", source)
    known = _known(ros1)
    if form:
        yield {**known, **_parsed(typesys, name, form, text)}
    elif name in known:
        yield known
    elif name == _CONTROLLER_STATE:
        for points, multi in _STATES:
            yield {**known, **_fields(typesys.get_types_from_msg(_state_text(points, multi), name))}


def full_name(name: str) -> str:
    """Name of a type with its folder: ``sensor_msgs/JointState`` of ROS 1 is ``sensor_msgs/msg/JointState``."""
    package, _, rest = name.partition("/")
    return name if not rest or "/" in rest else f"{package}/msg/{rest}"


@cache
def _known(ros1: bool) -> dict[str, Fields]:
    """Types that rosbags knows of the last ROS 1 or of ROS 2, in whose releases those read here are the same."""
    from rosbags.typesys import Stores, get_typestore

    return _fields(get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST).fielddefs)


def _fields(definitions: Mapping[str, tuple[Any, Fields]]) -> dict[str, Fields]:
    return {name: fields for name, (_, fields) in definitions.items()}


def _parsed(typesys: Any, name: str, form: str, text: str) -> dict[str, Fields]:
    if len(text) > LONGEST_TEXT:
        raise UnreadableMessage(f"the definition of {cut(name)} has {len(text)} characters")
    try:
        own = typesys.get_types_from_msg(text, name) if form == "msg" else typesys.get_types_from_idl(text)
    except (typesys.TypesysError, ValueError, KeyError, IndexError, AssertionError, RecursionError, TypeError) as error:
        raise UnreadableMessage(f"the definition of {cut(name)} cannot be parsed") from error
    return _fields(own)
