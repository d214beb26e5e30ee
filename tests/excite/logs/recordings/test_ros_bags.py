"""Bags of ROS: columns against a slow reader, bags written by rosbags and by mcap-ros2-support."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from array_files import read_all
from hypothesis import given, settings as examples, strategies as st
from refused import refusal
from ros_bags import (
    STATE_POINTS,
    STATE_TYPE,
    Joints,
    arm_messages,
    header,
    joint_state,
    slow_columns,
    typestore,
    write_bag,
    write_by_mcap,
    write_old_database,
    write_ros1_bag,
)

from excite.logs.log import channels_of
from excite.logs.log_reading import read_log
from excite.logs.mapping import read_mapping
from excite.logs.recordings.formats import format_of
from excite.logs.recordings.recording import Recording

pytest.importorskip("rosbags", reason="rosbags is not installed")

TOPIC = "/joint_states"


def assert_columns(recording: Recording, stream: str, expected: dict[str, Any]) -> None:
    columns = recording.streams[stream].columns
    assert set(columns) == set(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(columns[name], values, err_msg=name)
        assert columns[name].dtype == values.dtype


def by_rosbags(messages: list[Joints], topic: str = TOPIC) -> list[tuple[str, Any, int]]:
    types = typestore()
    return [(topic, joint_state(types, message), message.time) for message in messages]


@pytest.mark.parametrize(
    ("storage", "compression"),
    [("mcap", ""), ("mcap", "storage"), ("mcap", "message"), ("db3", ""), ("db3", "message"), ("db3", "file")],
)
def test_reordered_and_partly_empty_joint_states_of_two_publishers(tmp_path, storage, compression) -> None:
    messages = arm_messages()
    bag = write_bag(tmp_path / "bag", by_rosbags(messages), storage, compression)
    _, recording = read_all(bag)
    assert list(recording.streams) == [TOPIC, f"{TOPIC}#2"]
    assert_columns(recording, TOPIC, slow_columns(messages, "abc", TOPIC))
    assert_columns(recording, f"{TOPIC}#2", slow_columns(messages, ["finger"], TOPIC))


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_mcap_of_an_independent_writer(tmp_path: Path, compression: str) -> None:
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")
    messages = arm_messages()
    path = write_by_mcap(tmp_path / "log.data", [(TOPIC, message) for message in messages], compression)
    contents, recording = read_all(path)
    assert (contents.format, contents.notes) == ("MCAP", ())
    assert_columns(recording, TOPIC, slow_columns(messages, "abc", TOPIC))
    assert_columns(recording, f"{TOPIC}#2", slow_columns(messages, ["finger"], TOPIC))


def write_mixed(path: Path, kind: str, profile: str) -> Path:
    """MCAP with joint states of ROS 1 or 2 beside topics of other definitions."""
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC) if kind == "ros1" else typestore()
    serialize = types.serialize_ros1 if kind == "ros1" else types.serialize_cdr
    text, _ = types.generate_msgdef("sensor_msgs/msg/JointState", ros_version=1 if kind == "ros1" else 2)
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile, "test")
        form = "ros1msg" if kind == "ros1" else "ros2msg"
        states = writer.register_schema("sensor_msgs/JointState", form, text.encode())
        poses = writer.register_schema("Pose", "protobuf", bytes(range(256)))
        topics = ((TOPIC, kind, states), ("/pose", "protobuf", poses))
        channels = [writer.register_channel(*topic) for topic in topics]
        for joints in arm_messages():
            raw = bytes(serialize(joint_state(types, joints), "sensor_msgs/msg/JointState"))
            for channel, data in zip(channels, (raw, b"\1"), strict=True):
                writer.add_message(channel, joints.time, data, joints.time)
        writer.finish()
    return path


@pytest.mark.parametrize(("kind", "profile"), [("cdr", ""), ("ros1", "ros1")])
def test_mcap_of_other_profiles_with_other_definitions_beside_those_of_ros(tmp_path, kind, profile) -> None:
    pytest.importorskip("mcap", reason="mcap is not installed")
    contents, recording = read_all(write_mixed(tmp_path / "log", kind, profile))
    assert contents.notes == ("topic /pose is left out: its messages are encoded as protobuf, not as CDR",)
    assert_columns(recording, TOPIC, slow_columns(arm_messages(), "abc", TOPIC))


def test_ros1_bags(tmp_path: Path) -> None:
    from rosbags.typesys import Stores, get_typestore

    types, messages = get_typestore(Stores.ROS1_NOETIC), arm_messages()
    rows = [(TOPIC, joint_state(types, message), message.time) for message in messages]
    for compression in ("", "bz2", "lz4"):
        _, recording = read_all(write_ros1_bag(tmp_path / f"{compression}.bag", rows, compression))
        assert_columns(recording, TOPIC, slow_columns(messages, "abc", TOPIC))


def test_topics_of_too_many_layouts_are_left_out(tmp_path: Path) -> None:
    types = typestore()
    kind = types.types["std_msgs/msg/String"]
    texts = [("/text", kind("x" * k), k) for k in range(250)]
    contents, _ = read_all(write_bag(tmp_path / "bag", [*texts, *by_rosbags(arm_messages(3))]))
    assert contents.notes == ("topic /text is left out: its messages have more than 200 different layouts",)


FLOATS = st.floats(allow_nan=False, width=64)


@st.composite
def joint_states(draw: st.DrawFn) -> Joints:
    names = tuple(draw(st.lists(st.sampled_from(["a", "bb", "cä"]), min_size=1, max_size=3, unique=True)))
    numbers = st.just([]) | st.lists(FLOATS, min_size=len(names), max_size=len(names))
    arrays = [tuple(draw(numbers)) for _ in range(3)]
    stamp = draw(st.integers(0, 2**31 * 10**9 - 1))
    return Joints(names, *arrays, stamp=stamp, time=draw(st.integers(0, 2**62)))


@given(st.lists(joint_states(), min_size=1, max_size=8))
@examples(max_examples=40)
def test_any_joint_states(tmp_path_factory: pytest.TempPathFactory, messages: list[Joints]) -> None:
    linked = [Joints(("a", "bb", "cä"), (1.0, 2.0, 3.0)), *messages]  # so that all are of one stream
    bag = write_bag(tmp_path_factory.mktemp("any") / "bag", by_rosbags(linked))
    _, recording = read_all(bag)
    assert_columns(recording, TOPIC, slow_columns(linked, ["a", "bb", "cä"], TOPIC))


def test_messages_of_big_endian_computers(tmp_path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer

    types, messages = typestore(), arm_messages(8)
    kind = "sensor_msgs/msg/JointState"
    with Writer(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(TOPIC, kind, typestore=types)
        for k, message in enumerate(messages):
            raw = types.serialize_cdr(joint_state(types, message), kind, little_endian=k % 2 == 0)
            writer.write(connection, message.time, raw)
    _, recording = read_all(tmp_path / "bag")
    assert_columns(recording, TOPIC, slow_columns(messages, "abc", TOPIC))


def controller_state(types: Any, release: str, k: int) -> Any:
    point, multi = (
        types.types[f"trajectory_msgs/msg/{name}Point"] for name in ("JointTrajectory", "MultiDOFJointTrajectory")
    )
    duration = types.types["builtin_interfaces/msg/Duration"]
    points = STATE_POINTS[release]
    fields: dict[str, Any] = {"header": header(types, 10**18 + k), "joint_names": ["a", "b"]}
    for number, name in enumerate(points):
        values = np.array([k, number], dtype=float)
        fields[name] = point(values, 10 * values, np.zeros(0), 100 * values, duration(1, 500 + k))
    if release != "foxy":
        fields["multi_dof_joint_names"] = []
        fields |= {f"multi_dof_{name}": multi([], [], [], duration(0, 0)) for name in points}
    return types.types[STATE_TYPE](**fields)


@pytest.mark.parametrize("release", STATE_POINTS)
@pytest.mark.parametrize("defined", [True, False])
def test_controller_states_of_all_releases(tmp_path: Path, release: str, defined: bool) -> None:
    types = typestore(release)
    messages = [("/ctrl/state", controller_state(types, release, k), 5 + k) for k in range(4)]
    if defined:
        path = write_bag(tmp_path / "bag", messages, types=types)
    else:
        path = write_old_database(tmp_path / "old.db3", messages, types)
    contents, recording = read_all(path)
    columns = recording.streams["/ctrl/state"].columns
    for number, name in enumerate(STATE_POINTS[release]):
        np.testing.assert_array_equal(columns[f"/ctrl/state/a/{name}/position"], [0, 1, 2, 3])
        np.testing.assert_array_equal(columns[f"/ctrl/state/b/{name}/velocity"], [10 * number] * 4)
        np.testing.assert_array_equal(columns[f"/ctrl/state/{name}/time_from_start"], 1_000_000_500 + np.arange(4))
    (stream,) = contents.streams
    measured = "actual" if release == "foxy" else "feedback"
    assert stream.meanings[f"/ctrl/state/a/{measured}/effort"].unit == "Nm"
    assert not any("error" in name or "reference" in name or "desired" in name for name in stream.meanings)


def test_wrenches_temperatures_and_arrays(tmp_path: Path) -> None:
    types = typestore()
    kinds = types.types
    vector = kinds["geometry_msgs/msg/Vector3"]
    layout = kinds["std_msgs/msg/MultiArrayLayout"]([], 0)
    messages: list[tuple[str, Any, int]] = []
    for k in range(3):
        wrench = kinds["geometry_msgs/msg/Wrench"](vector(k, 1, 2), vector(3, 4, 5))
        messages += [
            ("/ft", kinds["geometry_msgs/msg/WrenchStamped"](header(types, k), wrench), k),
            ("/warm", kinds["sensor_msgs/msg/Temperature"](header(types, k), 20.0 + k, 0.0), k),
            ("/numbers", kinds["std_msgs/msg/Float64MultiArray"](layout, np.array([k, 2.0])), k),
            ("/text", kinds["std_msgs/msg/String"]("hello"), k),
        ]
    contents, recording = read_all(write_bag(tmp_path / "bag", messages))
    columns = {name: values for stream in recording.streams.values() for name, values in stream.columns.items()}
    np.testing.assert_array_equal(columns["/ft/wrench/force/x"], [0, 1, 2])
    np.testing.assert_array_equal(columns["/ft/wrench/torque/z"], [5, 5, 5])
    np.testing.assert_array_equal(columns["/warm/temperature"], [20, 21, 22])
    np.testing.assert_array_equal(columns["/numbers/data[0]"], [0, 1, 2])
    ft = next(stream for stream in contents.streams if stream.name == "/ft")
    assert [(m.quantity, m.of) for m in ft.meanings.values()][-1] == ("wrench", "torque.z")
    assert ft.clocks == ("/ft/header/stamp", "/ft/message_time")
    assert "/text" not in recording.streams
    assert any("/text" in note and "no numbers" in note for note in contents.notes)


def test_only_what_is_wanted_is_held(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", by_rosbags(arm_messages()) + by_rosbags(arm_messages(), "/other"))
    form = format_of(bag)
    recording = form.read(bag, {"/other": ["/other/b/effort"]})
    assert {name: list(stream.columns) for name, stream in recording.streams.items()} == {"/other": ["/other/b/effort"]}


def test_joint_states_agree_with_the_deserialisers_of_both_libraries(tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from rosbags.highlevel import AnyReader

    path = write_by_mcap(tmp_path / "log.mcap", [(TOPIC, message) for message in arm_messages()])
    _, recording = read_all(path)
    arm = recording.streams[TOPIC].columns
    with path.open("rb") as stream:
        decoded = make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        theirs = [message for _, _, _, message in decoded if len(message.name) == 3]
    effort = [m.effort[list(m.name).index("b")] if len(m.effort) else np.nan for m in theirs]
    np.testing.assert_array_equal(arm[f"{TOPIC}/b/effort"], effort)
    with AnyReader([path]) as reader:
        messages: list[Any] = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()]
    states = [m for m in messages if len(m.name) == 3]
    velocity = [m.velocity[m.name.index("c")] if len(m.velocity) else np.nan for m in states]
    np.testing.assert_array_equal(arm[f"{TOPIC}/c/velocity"], velocity)


def test_a_bag_is_a_log_and_a_column_that_no_topic_has_is_answered(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", by_rosbags(arm_messages(100)))
    log = read_log(bag)
    assert set(log.joints) == {"a", "b", "c"}
    assert {"dq", "effort"} <= channels_of(log).keys()
    (tmp_path / "map.yaml").write_text(
        "joints: [wrong]\ntime: {column: /joint_states/header/stamp, unit: ns}\n"
        "position: {columns: [/joint_states/wrong/position], unit: rad}\n"
    )
    told = refusal(read_log, bag, mapping=read_mapping(tmp_path / "map.yaml"))
    assert re.search("named '/joint_states/wrong/position'; did you mean .* available: .*/joint_states/a/", told)
