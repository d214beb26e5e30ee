"""Every format of motions, read back by a program that others wrote, or by a parser of the manual's grammar."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
import scipy.io
import yaml
from designed import irp6, panda, ur10e
from hypothesis import example, given, strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from robot_programs import broken_rules, krl_program, rapid_moves, ur_program
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import excite
from excite.design.design import Design
from excite.errors import BrokenLimitError
from excite.export.exported import Exported
from excite.export.motions.ros2 import Ros2Yaml, quoted
from excite.logs.mapping import read_mapping
from excite.registry import MOTION_FORMATS
from regressors.readers.documents import yaml_float
from regressors.samples import Samples

SUFFIX = {
    "ros2-yaml": ".yaml", "mcap": ".mcap", "urscript": ".script", "krl": ".src", "rapid": ".mod", "npz": ".npz",
    "mujoco": ".npz", "mat": ".mat",
}  # fmt: skip
SLOW = dict.fromkeys(("urscript", "rtde", "rsi", "egm"), 125.0)
SLOW |= dict.fromkeys(("npz", "mujoco", "mat", "mcap", "ros2-yaml"), 50.0)


def exported(folder: Path, design: Design, form: str, **options: object) -> tuple[Path, Exported]:
    path = folder / f"motion{SUFFIX.get(form, '.csv')}"
    return path, excite.export_motion(design, form, path, **options)


def motion(design: Design, rate: float) -> Samples:
    """The design's formula on a grid."""
    count = int(np.ceil(design.sequence.duration * rate - 1e-9))
    return design.sequence.at(np.arange(count + 1) / rate)[0]


def table(path: Path, header: bool = True) -> tuple[list[str], np.ndarray]:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    names = lines.pop(0).split(",") if header else []
    return names, np.loadtxt(io.StringIO("\n".join(lines)), delimiter=",")


@pytest.mark.parametrize("form", [form for form in MOTION_FORMATS if form not in ("lerobot", "sage")])
def test_files_are_the_same_bytes_again_and_the_mapping_beside_reads_a_recording(form: str, tmp_path: Path) -> None:
    design = panda() if form == "franka" else ur10e()
    path, first = exported(tmp_path / "a", design, form, rate=SLOW.get(form))
    _, again = exported(tmp_path / "b", design, form, rate=SLOW.get(form))
    assert [file.name for file in first.files] == [file.name for file in again.files]
    assert all(one.read_bytes() == two.read_bytes() for one, two in zip(first.files, again.files, strict=True))
    content = path.read_bytes()
    held = content if path.suffix != ".npz" else bytes(str(np.load(path)["design_sha256"]), "ascii")
    held = held if path.suffix != ".mat" else bytes(scipy.io.loadmat(path)["design_sha256"][0], "ascii")
    assert design.file_sha256.encode() in held
    beside = first.files[-1]
    mapping = read_mapping(beside)
    assert beside.name == f"{path.name}.mapping.yaml"
    assert "start marker" in beside.read_text()
    assert (mapping.design, tuple(mapping.joints or ())) == (design.file_sha256, design.robot.joint_names)
    expected = recording(beside)
    log = excite.read_log(beside.with_name("recording.csv"), None, mapping, robot=design.robot)
    assert log.joints == design.robot.joint_names
    assert np.abs(log.q - expected).max() < 1e-12
    assert log.effort is not None
    assert log.time[1] - log.time[0] == pytest.approx(0.004)


def recording(path: Path, rows: int = 50) -> np.ndarray:
    """A recording with the columns that a mapping names, and numbers in them; positions in rad."""
    given = yaml.safe_load(path.read_text())
    names = [given["time"]["column"]]
    for section in ("position", "velocity", "effort", "current", "temperature"):
        names += given.get(section, {}).get("columns", [])
    scale = {"s": 1.0, "ms": 1e3, "ns": 1e9}[given["time"]["unit"]]
    table = np.random.default_rng(0).normal(size=(rows, len(names)))
    table[:, 0] = scale * 0.004 * np.arange(rows)
    separator = " " if given.get("separator") == "whitespace" else ","
    lines = [separator.join(names), *(separator.join(f"{value:.17g}" for value in row) for row in table)]
    path.with_name("recording.csv").write_text("\n".join(lines) + "\n")
    count = len(given["position"]["columns"])
    unit = {"rad": 1.0, "deg": np.pi / 180}[given["position"]["unit"]]
    return unit * table[:, 1 : 1 + count]


def test_ros2_goal_is_read_by_pyyaml_and_accepted(tmp_path: Path) -> None:
    design = panda()
    path, written = exported(tmp_path, design, "ros2-yaml")
    parameters = yaml.safe_load(written.files[1].read_text())["rosbag2_recorder"]["ros__parameters"]
    assert "/joint_states" in parameters["record"]["topics"]
    assert parameters["storage"]["custom_data"] == [f"excite_design_sha256={design.file_sha256}"]
    trajectory = yaml.load(path.read_text(), Loader=yaml.CSafeLoader)["trajectory"]
    assert broken_rules(trajectory, design.robot.joint_names) == []
    points = trajectory["points"]
    assert all(isinstance(value, float) for point in points for value in point["velocities"])
    time = np.array([point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points])
    expected, _ = design.sequence.at(time)
    for field, values in (("positions", expected.q), ("velocities", expected.dq), ("accelerations", expected.ddq)):
        error = np.abs(np.array([point[field] for point in points]) - values).max()
        assert error < 1e-5  # times in whole nanoseconds, jerks up to 1e4
    assert not any(points[0]["velocities"] + points[0]["accelerations"])
    assert not any(points[-1]["velocities"] + points[-1]["accelerations"])
    assert trajectory["header"]["frame_id"] == f"excite_design_sha256_{design.file_sha256}"


def test_mcap_is_read_by_rosbags_and_by_mcap_ros2(tmp_path: Path) -> None:
    design = ur10e()
    path, _ = exported(tmp_path, design, "mcap", rate=50.0)
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        ((_, channel, _, message),) = list(reader.iter_decoded_messages())
    assert channel.topic == "/joint_trajectory_controller/joint_trajectory"
    assert list(message.joint_names) == list(design.robot.joint_names)
    assert message.header.frame_id == f"excite_design_sha256_{design.file_sha256}"
    q = np.array([point.positions for point in message.points])
    time = np.array([point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in message.points])
    assert np.abs(q - design.sequence.at(time)[0].q).max() < 1e-8
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        ((connection, stamp, data),) = list(bag.messages())
        again: Any = bag.deserialize(data, connection.msgtype)
    assert (stamp, connection.msgtype) == (0, "trajectory_msgs/msg/JointTrajectory")
    assert np.array_equal(np.array([point.positions for point in again.points]), q)
    assert all(point.effort.size == 0 for point in again.points)


def test_urscript_keeps_the_grammar_and_the_positions(tmp_path: Path) -> None:
    design = ur10e()
    path, _ = exported(tmp_path, design, "urscript", rate=125.0)
    program = ur_program(path.read_text())
    assert program.name == "motion"
    steps = program.steps()
    expected, segments = design.sequence.at(np.arange(len(steps)) / 125.0)
    assert np.abs(np.array([q for q, _ in steps]) - expected.q).max() < 1e-9
    assert [{1: "approach", 2: "excite", 3: "return"}[marker] for _, marker in steps] == segments
    assert program.functions["step"] == ["servoj(q, 0, 0, 0.008, 0.1, 300)"]
    assert program.body[0] == "check_start()"
    assert program.body[-2:] == ["write_output_integer_register(24, 0)", "stopj(2.0)"]


def test_rtde_targets_are_numbers_under_a_header(tmp_path: Path) -> None:
    design = ur10e()
    path, written = exported(tmp_path, design, "rtde", rate=125.0)
    head, *rows = [line.split(" ") for line in path.read_text().splitlines()]
    values = np.array([[float(cell) for cell in row] for row in rows])  # as the CSVReader of the client library
    expected = motion(design, 125.0)
    assert head[:7] == ["timestamp", *(f"target_q_{k}" for k in range(6))]
    assert np.array_equal(values[:, 1:19], np.hstack([expected.q, expected.dq, expected.ddq]) + 0.0)
    recipe = ET.fromstring(written.files[1].read_text())
    names = [field.get("name") for field in recipe.findall("recipe[@key='out']/field")]
    assert {"timestamp", "actual_q", "actual_qd", "actual_current"} <= set(names)


def test_franka_rows_are_seven_positions(tmp_path: Path) -> None:
    path, _ = exported(tmp_path, panda(), "franka")
    rows = np.loadtxt(path, delimiter=",")
    assert np.array_equal(rows, motion(panda(), 1000.0).q)
    assert not any(line.endswith(",") for line in path.read_text().splitlines())


def test_krl_keeps_the_grammar_the_positions_and_the_time(tmp_path: Path) -> None:
    path, written = exported(tmp_path, ur10e(), "krl")
    program = krl_program(path.read_bytes().decode())
    expected = motion(ur10e(), written.facts["rate"])
    assert program.name == "motion"
    assert program.start == program.points[0]
    assert np.abs(np.radians(program.points) - expected.q).max() < 1e-10
    assert program.total == pytest.approx(sum(program.parts)) == pytest.approx(expected.time[-1])


def test_rsi_rows_are_degrees_and_corrections(tmp_path: Path) -> None:
    path, written = exported(tmp_path, ur10e(), "rsi")
    names, values = table(path)
    expected = motion(ur10e(), 250.0)
    assert names == ["time", *(f"A{k}" for k in range(1, 7)), *(f"AK.A{k}" for k in range(1, 7))]
    assert np.abs(np.radians(values[:, 1:7]) - expected.q).max() < 1e-11
    assert np.abs(np.radians(values[:, 7:]) - (expected.q - expected.q[0])).max() < 1e-11
    tags = {element.get("TAG") for element in ET.fromstring(written.files[1].read_text()).iter("ELEMENT")}
    assert {"DEF_AIPos", "DEF_MACur", "AK.A1", "AK.A6"} <= tags


def test_fri_rows_are_radians_of_seven_joints(tmp_path: Path) -> None:
    names, values = table(exported(tmp_path, panda(), "rsi", rate=200.0)[0])
    assert names == ["time", *(f"J{k}" for k in range(1, 8))]
    assert np.abs(values[:, 1:] - motion(panda(), 200.0).q).max() < 1e-11


def test_rapid_keeps_the_grammar_the_positions_and_the_times(tmp_path: Path) -> None:
    path, written = exported(tmp_path, ur10e(), "rapid")
    moves = rapid_moves(path.read_text())
    expected = motion(ur10e(), written.facts["rate"])
    assert np.abs(np.radians([move.axes for move in moves]) - expected.q).max() < 1e-10
    assert moves[0].time is None
    assert [move.time for move in moves[1:]] == pytest.approx(np.diff(expected.time))
    assert [move.zone for move in moves] == ["fine", *["z1"] * (len(moves) - 2), "fine"]


def test_egm_rows_are_degrees(tmp_path: Path) -> None:
    names, values = table(exported(tmp_path, ur10e(), "egm")[0])
    expected = motion(ur10e(), 250.0)
    assert names[1] == "planned.joints[1]"
    assert np.abs(np.radians(values[:, 1:]) - np.hstack([expected.q, expected.dq])).max() < 1e-11


@pytest.mark.parametrize("design", [irp6, panda])
def test_arrays_are_read_by_numpy_and_scipy(design: object, tmp_path: Path) -> None:
    stored: Design = design()
    arrays = np.load(exported(tmp_path, stored, "npz", rate=300.0)[0], allow_pickle=False)
    matlab = scipy.io.loadmat(exported(tmp_path, stored, "mat", rate=300.0)[0])
    expected = motion(stored, 300.0)
    for name in ("time", "q", "dq", "ddq"):
        values = getattr(expected, name) + 0.0
        assert np.array_equal(arrays[name], values)
        assert np.array_equal(matlab[name], values.reshape(len(values), -1))
    assert tuple(arrays["joint_names"]) == stored.robot.joint_names
    assert tuple(str(name[0]) for name in matlab["joint_names"].ravel()) == stored.robot.joint_names
    head = f"MATLAB 5.0 MAT-file, coefficients sha256 {stored.coefficients_sha256}"
    assert (tmp_path / "motion.mat").read_bytes()[:116].decode() == head.ljust(116)  # no date
    assert not arrays["dq"][[0, -1]].any()
    assert not arrays["ddq"][[0, -1]].any()


def test_arrays_are_set_in_a_model_of_mujoco_by_joint(tmp_path: Path) -> None:
    arrays = np.load(exported(tmp_path, panda(), "mujoco", rate=100.0)[0], allow_pickle=False)
    names = [str(name) for name in arrays["joint_names"]]
    bodies = [f'<body><joint name="{name}" type="hinge"/><geom size="0.1"/>' for name in reversed(names)]
    actuators = "".join(f'<position name="{name}" joint="{name}"/>' for name in names)
    world = f"<worldbody>{''.join(bodies)}{'</body>' * len(names)}</worldbody>"
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{world}<actuator>{actuators}</actuator></mujoco>")
    data = mujoco.MjData(model)
    for k, name in enumerate(names):
        data.qpos[model.joint(name).qposadr] = arrays["qpos"][7, k]
        data.qvel[model.joint(name).dofadr] = arrays["qvel"][7, k]
        data.ctrl[model.actuator(name).id] = arrays["ctrl"][7, k]
    mujoco.mj_forward(model, data)
    assert np.array_equal(data.qpos[::-1], motion(panda(), 100.0).q[7])
    assert np.array_equal(data.ctrl, motion(panda(), 100.0).q[7])


@pytest.mark.parametrize("name", ["a\nEND\nb", 'q"1 --> ---', "\u00e9\U0001f916 # b: c"])
@pytest.mark.slow
def test_names_of_folders_stay_in_comments(name: str, tmp_path: Path) -> None:
    folder = tmp_path / name
    folder.mkdir()
    (folder / "design.json").write_bytes((ur10e().folder / "design.json").read_bytes())
    design = replace(ur10e(), folder=folder)
    plain = exported(tmp_path / "plain", ur10e(), "krl")[0].read_text().splitlines()
    assert len(exported(tmp_path / "k", design, "krl")[0].read_text().splitlines()) == len(plain)
    for form in ("rtde", "rsi"):
        _, written = exported(tmp_path / form, design, form, rate=125.0)
        ET.fromstring(written.files[1].read_text())
        assert read_mapping(written.files[-1]).design == design.file_sha256
    path, written = exported(tmp_path / "ros", design, "ros2-yaml", rate=50.0)
    assert yaml.load(path.read_text(), Loader=yaml.CSafeLoader)["trajectory"]["joint_names"]
    assert yaml.safe_load(written.files[1].read_text())["rosbag2_recorder"]


@pytest.mark.parametrize(("last", "refused"), [(0.0, False), (1.1e-7, False), (-1.3e-7, True)])
def test_a_goal_that_does_not_end_at_rest_is_refused(last: float, refused: bool) -> None:
    motion: Any = SimpleNamespace(samples=SimpleNamespace(dq=np.array([[1.0, 1.0], [0.0, last]])))
    with pytest.raises(BrokenLimitError, match="the velocities of the last point") if refused else nullcontext():
        Ros2Yaml().check(motion)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_pyyaml_reads_every_number_back(value: float) -> None:
    read = yaml.safe_load(yaml_float(value))
    assert isinstance(read, float)
    assert read == value


@given(st.text(st.characters(codec="utf-8", exclude_categories=("C", "Zl", "Zp")), min_size=1))
@example("no")
@example("12:30")
@example("010")
def test_pyyaml_reads_every_name_back(name: str) -> None:
    assert yaml.safe_load(f"[{quoted(name)}]") == [name]
