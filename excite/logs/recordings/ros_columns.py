"""Names and meanings of the numbers of a ROS message; the names follow PlotJuggler's."""

from __future__ import annotations

from dataclasses import dataclass

from excite.logs.recordings.recording import Meaning
from excite.logs.recordings.ros_layout import MessageLayout, NumberPlace

MESSAGE_TIME = "message_time"
STAMP = "header/stamp"
_COUNTER = "header/seq"  # of ROS 1
JOINT_STATE = "sensor_msgs/msg/JointState"
CONTROLLER_STATE = "control_msgs/msg/JointTrajectoryControllerState"
TEMPERATURE = "sensor_msgs/msg/Temperature"
_SINGULAR = {"positions": "position", "velocities": "velocity", "accelerations": "acceleration"}
_UNITS = {"position": "rad", "velocity": "rad/s", "effort": "Nm"}
_MEASURED = {JOINT_STATE: ("",), CONTROLLER_STATE: ("feedback", "actual")}  # parts of a message that were measured
_WRENCHES = {"geometry_msgs/msg/WrenchStamped": "wrench/", "geometry_msgs/msg/Wrench": ""}


@dataclass(frozen=True)
class RosColumn:
    """A column of a topic."""

    name: str
    place: NumberPlace
    index: int  # in the place
    meaning: Meaning | None = None


def layout_columns(topic: str, kind: str, layout: MessageLayout) -> list[RosColumn]:
    """Columns of the messages of one layout, without the time at which they were recorded."""
    columns: list[RosColumn] = []
    names = layout.names if len(set(layout.names)) == len(layout.names) else ()
    for path, place in layout.places.items():
        if path == _COUNTER:
            continue
        if not place.array:
            columns.append(RosColumn(_joined(topic, path), place, 0, _wrench(kind, path)))
        elif place.count == len(names) and "[" not in path:
            part, _, last = path.rpartition("/")
            last = _SINGULAR.get(last, last)
            for k, name in enumerate(names):
                columns.append(RosColumn(_joined(topic, name, part, last), place, k, _joint(kind, part, last, name)))
        else:
            columns += [RosColumn(f"{_joined(topic, path)}[{k}]", place, k) for k in range(place.count)]
    return columns


def _joined(*parts: str) -> str:
    return "/".join(part for part in parts if part)


def _joint(kind: str, part: str, quantity: str, name: str) -> Meaning | None:
    if quantity not in _UNITS or part not in _MEASURED.get(kind, ()):
        return None
    return Meaning(quantity, name, _UNITS[quantity], _short(kind))


def _wrench(kind: str, path: str) -> Meaning | None:
    prefix = _WRENCHES.get(kind)
    if prefix is None or not path.startswith((f"{prefix}force/", f"{prefix}torque/")):
        return None
    return Meaning("wrench", path.removeprefix(prefix).replace("/", "."), "N", _short(kind))


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")
