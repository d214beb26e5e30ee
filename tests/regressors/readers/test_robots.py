"""Robots by name and by file: the built-in ones against closed forms and Pinocchio; long names, huge numbers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from public_arms import robot_file
from refused import refusal
from written_files import text_file

import excite
from regressors.errors import LONGEST_LINE, LONGEST_NAME, UnknownName
from regressors.models.differential import DifferentialModel
from regressors.readers.library import built_in, load_robot
from regressors.robot.columns import Terms
from regressors.robot.inertia import from_centre_of_mass, pseudo_inertia, transport
from regressors.robot.robot import Robot
from regressors.samples import Samples

PANDA = "panda_description/urdf/panda.urdf"
NAMES = ("iiwa7", "irp6", "irp6-full", "panda", "so101", "ur10e")


def link_poses(robot: Robot, q: np.ndarray) -> list[np.ndarray]:
    poses = [np.eye(4)]
    for joint, position in zip(robot.joints, q, strict=True):
        poses.append(poses[-1] @ joint.motion(position))
    return poses[1:]


def axis_lines(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Plücker coordinates (moment, direction) of the joint axes in the base frame, one column each.

    They do not depend on where along its axis, and how turned about it, a link's frame sits.
    """
    lines = []
    for joint, T in zip(robot.joints, link_poses(robot, q), strict=True):
        direction = T[:3, :3] @ joint.axis
        lines.append(np.concatenate([np.cross(T[:3, 3], direction), direction]))
    return np.column_stack(lines)


def by_pinocchio(model: pin.Model, robot: Robot, q: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Poses of the joints' frames and lines of their axes; what comes after them, such as fingers, rests."""
    assert tuple(model.names)[1 : robot.n + 1] == robot.joint_names
    data, whole = model.createData(), np.concatenate([q, pin.neutral(model)[robot.n :]])
    lines = pin.computeJointJacobians(model, data, whole)[:, : robot.n]
    return [data.oMi[k].homogeneous for k in range(1, robot.n + 1)], lines


def random_positions(n: int, count: int = 20) -> np.ndarray:
    return np.random.default_rng(7).uniform(-np.pi, np.pi, (count, n))


@pytest.mark.parametrize("name", NAMES)
def test_built_in_robot_is_complete(name: str) -> None:
    robot = built_in(name)
    assert (robot.name, load_robot(name).sha256()) == (name, robot.sha256())
    assert robot.source
    assert np.array_equal(robot.gravity, [0.0, 0.0, -9.81])
    known = [link.theta for link in robot.links if link.theta is not None]
    assert len(known) == (0 if name == "iiwa7" else robot.n)
    assert all(np.linalg.eigvalsh(pseudo_inertia(theta))[0] > 0 for theta in known)


# irp6 ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("q", random_positions(5, 4))
def test_irp6_kinematics_are_those_of_the_paper(q: np.ndarray) -> None:
    q1, q2, z3, z4 = q[0], q[1], q[1] + q[2], q[1] + q[2] + q[3]
    radial, up = np.array([np.cos(q1), np.sin(q1), 0.0]), np.array([0.0, 0.0, 1.0])
    arm = -np.sin(q2) * radial + np.cos(q2) * up
    forearm = np.cos(z3) * radial + np.sin(z3) * up
    hand = np.cos(z4) * radial + np.sin(z4) * up
    shoulder = 0.70 * up
    poses = link_poses(built_in("irp6"), q)
    elbow, wrist = shoulder + 0.455 * arm, shoulder + 0.455 * arm + 0.67 * forearm
    for pose, origin in zip(poses[1:], [shoulder, elbow, wrist, wrist + 0.095 * hand], strict=True):
        assert np.allclose(pose[:3, 3], origin, atol=1e-12)
    assert np.allclose(poses[1][:3, 0], arm, atol=1e-12)
    assert np.allclose(poses[2][:3, 0], forearm, atol=1e-12)
    assert np.allclose(poses[4][:3, 2], hand, atol=1e-12)


# panda ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("q", random_positions(7, 4))
def test_panda_frames_are_those_of_its_urdf(q: np.ndarray) -> None:
    robot = built_in("panda")
    model = pin.buildModelFromUrdf(str(robot_file(PANDA)))
    poses, lines = by_pinocchio(model, robot, q)
    assert np.allclose(link_poses(robot, q), poses, atol=1e-12)
    assert np.allclose(axis_lines(robot, q), lines, atol=1e-12)


def test_panda_inertias_are_those_of_its_urdf() -> None:
    # Read from the document, because Pinocchio merges the hand into link 7.
    root = ET.parse(robot_file(PANDA)).getroot()
    for link in built_in("panda").links:
        inertial = root.find(f"link[@name='{link.name}']/inertial")
        mass = float(inertial.find("mass").get("value"))
        centre = np.array(inertial.find("origin").get("xyz").split(), dtype=float)
        numbers = {key: float(value) for key, value in inertial.find("inertia").attrib.items()}
        tensor = np.array([[numbers[f"i{min(a, b)}{max(a, b)}"] for b in "xyz"] for a in "xyz"])
        about_origin = tensor + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        assert inertial.find("origin").get("rpy") == "0 0 0"
        expected = [mass, *mass * centre, *about_origin[np.triu_indices(3)]]
        assert np.allclose(link.theta, expected, rtol=1e-12, atol=1e-15)


# ur10e ---------------------------------------------------------------------------------------------------------------

UR_A = (0.0, -0.6127, -0.57155, 0.0, 0.0, 0.0)
UR_D = (0.1807, 0.0, 0.0, 0.17415, 0.11985, 0.11655)
UR_ALPHA = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
UR_MASS = (7.369, 13.051, 3.989, 2.1, 1.98, 0.615)
UR_CENTRE = (
    (0.021, 0.0, 0.027), (0.38, 0.0, 0.158), (0.24, 0.0, 0.068), (0.0, 0.007, 0.018), (0.0, 0.007, 0.018),
    (0.0, 0.0, -0.026),
)  # fmt: skip
# xx, xy, xz, yy, yz, zz about the centres of mass
UR_INERTIA = (
    (0.0341, 0.0, -0.0043, 0.0353, 0.0001, 0.0216),
    (0.0281, 0.0001, -0.0156, 0.7707, 0.0, 0.7694),
    (0.0101, 0.0001, 0.0092, 0.3093, 0.0, 0.3065),
    (0.0030, 0.0, 0.0, 0.0022, -0.0002, 0.0026),
    (0.0030, 0.0, 0.0, 0.0022, -0.0002, 0.0026),
    (0.0004, 0.0, 0.0, 0.0004, 0.0, 0.0003),
)


def classic_dh(theta: float, a: float, d: float, alpha: float) -> np.ndarray:
    """Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    (ct, st), (ca, sa) = (np.cos(theta), np.sin(theta)), (np.cos(alpha), np.sin(alpha))
    return np.array([[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1]])


@pytest.mark.parametrize("q", random_positions(6, 4))
def test_ur10e_is_its_published_table(q: np.ndarray) -> None:
    """Axes, tool, and where the mass is and how it is spread, in the base frame: the same in our frames and in UR's."""
    robot, T = built_in("ur10e"), np.eye(4)
    for k, (theta, ours, link) in enumerate(zip(q, link_poses(robot, q), robot.links, strict=True)):
        previous, T = T, T @ classic_dh(theta, UR_A[k], UR_D[k], UR_ALPHA[k])
        direction = ours[:3, 2]
        assert np.allclose(direction, previous[:3, 2], atol=1e-12)
        assert np.allclose(np.cross(ours[:3, 3] - previous[:3, 3], direction), 0, atol=1e-12)
        xx, xy, xz, yy, yz, zz = UR_INERTIA[k]
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        expected = transport(T[:3, :3], T[:3, 3]) @ from_centre_of_mass(UR_MASS[k], UR_CENTRE[k], tensor)
        assert np.allclose(transport(ours[:3, :3], ours[:3, 3]) @ link.theta, expected, atol=1e-12)
    assert np.allclose(ours, T, atol=1e-12)


# iiwa7 ---------------------------------------------------------------------------------------------------------------

# Places of the joints as in the URDF of github.com/IFL-CAMP/iiwa_stack: xyz [m], rpy as multiples of pi / 2.
IIWA7_ORIGINS = (
    ((0, 0, 0.15), (0, 0, 0)), ((0, 0, 0.19), (1, 0, 2)), ((0, 0.21, 0), (1, 0, 2)), ((0, 0, 0.19), (1, 0, 0)),
    ((0, 0.21, 0), (-1, 2, 0)), ((0, 0.0607, 0.19), (1, 0, 0)), ((0, 0.081, 0.0607), (-1, 2, 0)),
)  # fmt: skip
IIWA7_FLANGE = 0.045


def iiwa7_urdf() -> str:
    text = '<robot name="iiwa7"><link name="link_0"/>'
    for k, (xyz, rpy) in enumerate(IIWA7_ORIGINS, 1):
        place = f'xyz="{" ".join(map(str, xyz))}" rpy="{" ".join(str(x * np.pi / 2) for x in rpy)}"'
        text += f'<link name="link_{k}"/><joint name="A{k}" type="revolute"><origin {place}/><axis xyz="0 0 1"/>'
        text += f'<parent link="link_{k - 1}"/><child link="link_{k}"/>'
        text += '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
    return text + "</robot>"


@pytest.mark.parametrize("q", random_positions(7, 4))
def test_iiwa7_axes_are_those_of_its_urdf(q: np.ndarray) -> None:
    robot = built_in("iiwa7")
    model = pin.buildModelFromXML(iiwa7_urdf())
    poses, lines = by_pinocchio(model, robot, q)
    assert np.allclose(axis_lines(robot, q), lines, atol=1e-12)
    assert np.allclose(link_poses(robot, q)[6][:3, 3], (poses[6] @ [0.0, 0.0, IIWA7_FLANGE, 1.0])[:3], atol=1e-12)


# so101 ---------------------------------------------------------------------------------------------------------------


def test_so101_has_the_numbers_of_its_urdf() -> None:
    robot, path = built_in("so101"), robot_file("so_arm_description/urdf/so101.urdf")
    read = load_robot(str(path), tip="moving_jaw_so101_v1_link")
    assert robot.joint_names == read.joint_names
    for ours, theirs in zip(robot.joints, read.joints, strict=True):
        np.testing.assert_array_equal(ours.translation, theirs.translation)
        np.testing.assert_allclose(ours.rotation, theirs.rotation, atol=1e-15)
        np.testing.assert_array_equal(ours.axis, theirs.axis)
    for ours, theirs in zip(robot.links, read.links, strict=True):
        dummy = 1e-9 if ours.name == "gripper_link" else 0.0  # [kg], of a link that is fixed to it
        np.testing.assert_allclose(ours.theta, theirs.theta, rtol=1e-15, atol=1e-22 + dummy)
    np.testing.assert_array_equal([robot.limits.lower, robot.limits.upper], [read.limits.lower, read.limits.upper])
    np.testing.assert_allclose(robot.limits.velocity, 45 * 2 * np.pi / 60)
    np.testing.assert_allclose(robot.limits.torque, 0.3 * 9.81, rtol=2e-3)


def test_so101_torques_are_those_of_its_urdf() -> None:
    text = robot_file("so_arm_description/urdf/so101.urdf").read_text(encoding="utf-8")
    for printed, meant in (("1.5708", repr(np.pi / 2)), ("3.14159", repr(np.pi)), ("-5.24284e-08", "0"), ("1e-9", "0")):
        text = text.replace(printed, meant)
    robot, model = built_in("so101"), pin.buildModelFromXML(text)
    assert tuple(model.names)[1:] == robot.joint_names
    rng, theta = np.random.default_rng(4), np.concatenate([link.theta for link in robot.links])
    q = np.vstack([np.zeros(6), rng.uniform(robot.limits.lower, robot.limits.upper, (50, 6))])
    dq, ddq = rng.uniform(-4.7, 4.7, q.shape), rng.uniform(-50, 50, q.shape)
    bodies = DifferentialModel(robot, Terms.inertial_only())
    ours = bodies.assemble(Samples(np.arange(51.0), q, dq, ddq, 0 * ddq)) @ theta
    data = model.createData()
    np.testing.assert_allclose(
        ours.reshape(51, 6), [pin.rnea(model, data, *state).copy() for state in zip(q, dq, ddq, strict=True)], atol=1e-9
    )


# library -------------------------------------------------------------------------------------------------------------

MINIMAL = "name: one\njoints:\n  - {name: a, mdh: {d: 1.0}}\n"


def test_unknown_built_in_tells_what_there_is() -> None:
    with pytest.raises(UnknownName, match=r"no built-in robot named 'kr6'; available: iiwa7, irp6, irp6-full, panda"):
        built_in("kr6")


@pytest.mark.parametrize("suffix", [".yaml", ".yml", ".YAML", ".urdf", ".xml", ".URDF"])
def test_files_are_read_by_their_endings(tmp_path: Path, suffix: str) -> None:
    path, yaml = tmp_path / f"one{suffix}", suffix.lower() in (".yaml", ".yml")
    path.write_text(MINIMAL if yaml else iiwa7_urdf(), encoding="utf-8")
    if yaml:
        assert load_robot(str(path)).name == "one"
    else:
        assert load_robot(str(path), base="link_2", tip="link_5").joint_names == ("A3", "A4", "A5")


def test_built_in_name_wins_over_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("irp6").write_text(MINIMAL, encoding="utf-8")
    assert load_robot("irp6").n == 5


@pytest.mark.parametrize(
    ("spec", "base", "message"),
    [
        ("kr6", None, "no robot 'kr6': built-in robots are iiwa7, irp6, irp6-full, panda, so101, ur10e, and a file"),
        ("robot.txt", None, "'robot.txt': a robot's file ends in .yaml, .yml, .urdf, .xml, .xacro, .mjcf, .csv"),
        ("folder.yaml", None, "cannot read 'folder.yaml'"),
        ("nul\0.yaml", None, "spec: expected text or a path that a file can have, given"),
        ("robot.yaml", "base", "`base` and `tip` choose a part of a URDF, xacro or MJCF file, but 'robot.yaml' is no"),
    ],
)
def test_load_robot_refuses(
    spec: str, base: str | None, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("robot.txt").write_text(MINIMAL, encoding="utf-8")
    Path("robot.yaml").write_text(MINIMAL, encoding="utf-8")
    Path("folder.yaml").mkdir()
    refusal(load_robot, spec, base=base, begins=message)


LONG = "x" * 1_000_000
BODY = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
LIMIT = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
URDF = (
    f'<robot name="ROBOT"><link name="base"/><link name="LINK">{BODY}</link><link name="SIDE"/>'
    f'<joint name="JOINT" type="revolute"><parent link="base"/><child link="LINK"/><axis xyz="0 0 1"/>{LIMIT}</joint>'
    '<joint name="FIXED" type="fixed"><parent link="LINK"/><child link="SIDE"/></joint></robot>'
)
MJCF = (
    '<mujoco model="ROBOT"><worldbody><body name="LINK"><joint name="JOINT" type="hinge" range="-1 1" limited="true"/>'
    '<geom size="0.1"/></body></worldbody></mujoco>'
)
DH = "# convention: modified\nname,alpha,a,d,theta,lower,upper\nJOINT,0,0,0,0,-1,1\n"
YAML = "name: ROBOT\njoints: [{name: JOINT, mdh: {}}]\nlinks: [{name: LINK}]\ndrives: [{name: FIXED}]\n"
FILES = {"arm.urdf": URDF, "arm.xml": MJCF, "arm.csv": DH, "arm.yaml": YAML}


def read(folder: Path, file: str, **names: str) -> object:
    text = FILES[file]
    for what in ("ROBOT", "LINK", "SIDE", "JOINT", "FIXED"):
        text = text.replace(what, names.get(what, what.lower()))
    (folder / file).write_text(text)
    return excite.load_robot(folder / file)


@pytest.mark.parametrize(
    ("file", "what"),
    [(file, what) for file in FILES for what in ("ROBOT", "LINK", "SIDE", "JOINT", "FIXED") if what in FILES[file]],
)
def test_a_name_of_a_megabyte_is_refused(file: str, what: str, tmp_path: Path) -> None:
    if file == "arm.xml":
        pytest.importorskip("mujoco")
    told = refusal(read, tmp_path, file, **{what: LONG})
    assert f"at most {LONGEST_NAME} characters, given " in told
    assert len(told) < LONGEST_LINE


@pytest.mark.parametrize("file", FILES)
def test_the_longest_names_are_read(file: str, tmp_path: Path) -> None:
    if file == "arm.xml":
        pytest.importorskip("mujoco")
    assert read(tmp_path, file, JOINT="j" * LONGEST_NAME) is not None


ROBOT = """
name: one
joints: [{{name: a, mdh: {{}}, limits: {{position: [-1, 1], velocity: 1, acceleration: 1}}}}]
links: [{{name: A, mass: {mass}, com: [{com}, 0.1, 0.1], inertia: {{about: {about}, xx: 1, yy: 1, zz: 1}}}}]
"""


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("about", ["centre-of-mass", "origin"])
@pytest.mark.parametrize(("mass", "com"), [("1e200", "1e200"), ("2.0", "1e308")])
def test_products_beyond_floats_are_refused(mass: str, com: str, about: str, tmp_path) -> None:
    path = text_file(tmp_path / "one.yaml", ROBOT.format(mass=mass, com=com, about=about))
    assert "link 'A': inertial parameters must be finite" in refusal(load_robot, path)
