"""Bags of ROS, written by rosbags, by the libraries of MCAP, and by hand as older recorders laid them out."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Messages: TypeAlias = Sequence[tuple[str, Any, int]]  # topic, message and time of each
STATE_TYPE = "control_msgs/msg/JointTrajectoryControllerState"
# As in control_msgs 3 (Foxy), 4 (Humble) and 5 (Jazzy).
STATE_POINTS = {
    "foxy": ("desired", "actual", "error"),
    "humble": ("reference", "feedback", "error", "output", "desired", "actual"),
    "jazzy": ("reference", "feedback", "error", "output"),
}


@dataclass(frozen=True)
class Joints:
    """A message of sensor_msgs/JointState; times in ns."""

    names: tuple[str, ...]
    position: tuple[float, ...] = ()
    velocity: tuple[float, ...] = ()
    effort: tuple[float, ...] = ()
    stamp: int = 0
    time: int = 0


@cache
def typestore(state: str = "") -> Any:
    """Types of ROS 2 Humble, with the controller state of a release."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    if state:
        lines = ["std_msgs/Header header", "string[] joint_names"]
        lines += [f"trajectory_msgs/JointTrajectoryPoint {name}" for name in STATE_POINTS[state]]
        if state != "foxy":
            lines.append("string[] multi_dof_joint_names")
            lines += [f"trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_{name}" for name in STATE_POINTS[state]]
        types.register(get_types_from_msg("\n".join(lines), STATE_TYPE))
    return types


def header(types: Any, stamp: int, frame: str = "base") -> Any:
    """A header with a time in ns."""
    time = types.types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    fields = {"stamp": time, "frame_id": frame}
    if "seq" in types.types["std_msgs/msg/Header"].__dataclass_fields__:
        fields["seq"] = 7
    return types.types["std_msgs/msg/Header"](**fields)


def joint_state(types: Any, joints: Joints) -> Any:
    """The message of rosbags."""
    values = [np.array(part, dtype=float) for part in (joints.position, joints.velocity, joints.effort)]
    return types.types["sensor_msgs/msg/JointState"](header(types, joints.stamp), list(joints.names), *values)


def write_bag(path: Path, messages: Messages, storage: str = "mcap", compression: str = "", types: Any = None) -> Path:
    """Bag of ROS 2 by rosbags: topic, message and time of each; compression as ``message``, ``file`` or ``storage``."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    types = types or typestore()
    plugin = {"mcap": StoragePlugin.MCAP, "db3": StoragePlugin.SQLITE3}[storage]
    writer = Writer(path, version=8, storage_plugin=plugin)
    if compression:
        writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    _write_messages(writer, messages, types, types.serialize_cdr)
    return path


def _write_messages(writer: Any, messages: Messages, types: Any, serialize: Callable[[Any, str], Any]) -> None:
    with writer:
        connections: dict[str, Any] = {}
        for topic, message, time in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(connections[topic], time, serialize(message, kind))


def write_old_database(path: Path, messages: Messages, types: Any) -> Path:
    """Database as rosbag2 of Foxy to Humble wrote it, without definitions of messages."""
    base = sqlite3.connect(path)
    base.executescript(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
        " data BLOB NOT NULL); CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
    )
    topics: dict[str, int] = {}
    for topic, message, time in messages:
        kind = message.__msgtype__
        if topic not in topics:
            topics[topic] = len(topics) + 1
            base.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')", (topics[topic], topic, kind))
        raw = bytes(types.serialize_cdr(message, kind))
        base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", (topics[topic], time, raw))
    base.commit()
    base.close()
    return path


def write_ros1_bag(path: Path, messages: Messages, compression: str = "") -> Path:
    """Bag of ROS 1 by rosbags."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer(path)
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    _write_messages(writer, messages, types, types.serialize_ros1)
    return path


_JOINT_STATE_TEXT = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec"""


def write_by_mcap(
    path: Path, topics: Sequence[tuple[str, Joints]], compression: str = "zstd", chunk: int = 4096
) -> Path:
    """MCAP of joint states by ``mcap-ros2-support``, which serialises and packs on its own."""
    from mcap.writer import CompressionType
    from mcap_ros2.writer import Writer

    with path.open("xb") as stream:
        writer = Writer(stream, chunk_size=chunk, compression=CompressionType[compression.upper()])
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", _JOINT_STATE_TEXT)
        for topic, joints in topics:
            message = {
                "header": {"stamp": {"sec": joints.stamp // 10**9, "nanosec": joints.stamp % 10**9}, "frame_id": "b"},
                "name": list(joints.names),
                **{part: list(getattr(joints, part)) for part in ("position", "velocity", "effort")},
            }
            writer.write_message(topic, schema, message, log_time=joints.time, publish_time=joints.time)
        writer.finish()
    return path


def arm_messages(count: int = 50, seed: int = 0) -> list[Joints]:
    """Joint states of an arm of three joints at 1 kHz, their order and their arrays changing, and of a gripper."""
    random = np.random.default_rng(seed)
    messages = []
    for k in range(count):
        names = tuple(np.array(["a", "b", "c"])[random.permutation(3)].tolist())
        arrays = [tuple(random.normal(size=3).tolist()) if random.random() > 0.2 else () for _ in range(3)]
        stamp = 1_700_000_000_000_000_000 + 1_000_000 * k
        messages.append(Joints(names, *arrays, stamp=stamp, time=stamp + 137_000))
        if k % 5 == 0:
            messages.append(Joints(("finger",), (float(random.normal()),), stamp=stamp, time=stamp + 140_000))
    return messages


def slow_columns(messages: Sequence[Joints], joints: Sequence[str], topic: str) -> dict[str, NDArray[Any]]:
    """Columns of the messages in which one of some joints is, one number after the other."""
    own = [message for message in messages if set(message.names) & set(joints)]
    columns: dict[str, NDArray[Any]] = {
        f"{topic}/header/stamp": np.array([message.stamp for message in own]),
        f"{topic}/message_time": np.array([message.time for message in own]),
    }
    for joint in joints:
        for part in ("position", "velocity", "effort"):
            values = []
            for message in own:
                array = getattr(message, part)
                there = joint in message.names and len(array) == len(message.names)
                values.append(array[message.names.index(joint)] if there else np.nan)
            if not np.all(np.isnan(values)):
                columns[f"{topic}/{joint}/{part}"] = np.array(values)
    return columns
