"""Built-in robots: their limits, and their kinematics and inertias against closed forms and against Pinocchio."""

import json
import sys
import types
import xml.etree.ElementTree as ET
from importlib import metadata
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in, built_in_names, load_robot
from regressors.robot.gears import ConstantRatio
from regressors.robot.inertia import parameter_names, pseudo_inertia, skew, transport
from regressors.robot.robot import Robot

NAMES = ("iiwa7", "irp6", "irp6-full", "panda", "ur10e")
INF = np.inf
UR10E_URDF = Path(__file__).resolve().parents[4] / "shared" / "data" / "ur10e" / "ur10e.urdf"
EXAMPLE_ROBOTS = Path("cmeel.prefix", "share", "example-robot-data", "robots")


def example_urdf(*parts: str) -> Path:
    return Path(str(metadata.distribution("example-robot-data").locate_file(EXAMPLE_ROBOTS.joinpath(*parts))))


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


def pinocchio_configuration(model: pin.Model, names: tuple[str, ...], q: np.ndarray) -> np.ndarray:
    full = pin.neutral(model)
    for name, position in zip(names, q, strict=True):
        full[model.joints[model.getJointId(name)].idx_q] = position
    return full


def pinocchio_axis_lines(model: pin.Model, names: tuple[str, ...], q: np.ndarray) -> np.ndarray:
    data = model.createData()
    J = pin.computeJointJacobians(model, data, pinocchio_configuration(model, names, q))
    return np.column_stack([J[:, model.joints[model.getJointId(name)].idx_v] for name in names])


def random_positions(n: int, count: int = 20) -> np.ndarray:
    return np.random.default_rng(7).uniform(-np.pi, np.pi, (count, n))


def test_names() -> None:
    assert built_in_names() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_built_in_robot_is_complete(name: str) -> None:
    robot = built_in(name)
    assert robot.name == name
    assert robot.source
    assert np.array_equal(robot.gravity, [0.0, 0.0, -9.81])
    assert json.loads(json.dumps(robot.description()))["name"] == name
    assert load_robot(name).sha256() == robot.sha256()


@pytest.mark.parametrize("name", ["irp6", "irp6-full", "panda", "ur10e"])
def test_known_links_are_physically_possible(name: str) -> None:
    for link in built_in(name).links:
        assert link.theta is not None
        assert np.linalg.eigvalsh(pseudo_inertia(link.theta))[0] > 0


def test_iiwa7_links_are_unknown() -> None:
    assert all(link.theta is None for link in built_in("iiwa7").links)


# In degrees where the data sheet is: position, velocity, acceleration, jerk, torque.
LIMITS = {
    "panda": (
        [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973],
        [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973],
        [2.175] * 4 + [2.61] * 3,
        [15, 7.5, 10, 12.5, 15, 20, 20],
        [7500, 3750, 5000, 6250, 7500, 10000, 10000],
        [87] * 4 + [12] * 3,
    ),
    "ur10e": (
        np.deg2rad([-360] * 6),
        np.deg2rad([360] * 6),
        np.deg2rad([120, 120, 180, 180, 180, 180]),
        [INF] * 6,
        [INF] * 6,
        [330, 330, 150, 56, 56, 56],
    ),
    "iiwa7": (
        np.deg2rad([-170, -120, -170, -120, -170, -120, -175]),
        np.deg2rad([170, 120, 170, 120, 170, 120, 175]),
        np.deg2rad([98, 98, 100, 130, 140, 180, 180]),
        [INF] * 7,
        [INF] * 7,
        [176, 176, 110, 110, 110, 40, 40],
    ),
    "irp6": (
        [-2.96706, -0.69813, -0.69813, -1.57080, -3.14159],
        [2.96706, 0.69813, 0.69813, 1.60570, 3.14159],
        *([[INF] * 5] * 4),
    ),
}
LIMITS["irp6-full"] = LIMITS["irp6"]


@pytest.mark.parametrize("name", NAMES)
def test_limits_are_those_of_the_data_sheet(name: str) -> None:
    given = built_in(name).limits
    found = (given.lower, given.upper, given.velocity, given.acceleration, given.jerk, given.torque)
    for array, expected in zip(found, LIMITS[name], strict=True):
        assert np.array_equal(array, expected)


# irp6 ----------------------------------------------------------------------------------------------------------------


def test_irp6_drives() -> None:
    transmission = built_in("irp6").transmission
    assert transmission is not None
    q = np.array([0.1, 0.2, 0.4, 0.8, 1.6])
    assert np.allclose(transmission.coupling @ q, [0.1, 0.2, 0.6, 1.4, 1.6])
    bounds = transmission.limits
    assert np.array_equal(bounds.lower, [-INF, -INF, -0.69813, -1.60570, -INF])
    assert np.array_equal(bounds.upper, [INF, INF, 0.43633, 1.57080, INF])
    assert np.array_equal(bounds.velocity, [1.266, 1.137, 1.137, 1.563, 2.604])
    assert np.array_equal(bounds.acceleration, [2.10, 1.89, 1.89, 2.60, 4.34])
    assert np.array_equal(bounds.jerk, [INF] * 5)
    assert np.array_equal(bounds.torque, [331.8, 210.9, 215.6, 201.6, 64.5])
    drives = transmission.drives
    assert [drive.ratio for drive in drives] == [ConstantRatio(n) for n in (158.0, 167.5, 167.5, 128.0, 76.8)]
    assert [drive.rotor_inertia for drive in drives] == [7.658e-5] * 3 + [4.0e-5] * 2
    assert [drive.coulomb for drive in drives] == [28.0, 28.75, 30.0, 10.0, 5.0]
    assert [drive.viscous for drive in drives] == [25.0, 26.0, 26.0, 8.0, 4.0]


@pytest.mark.parametrize("q", random_positions(5))
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


def irp6_standard_parameters() -> dict[str, float]:
    """Standard parameters of links 1 to 3, the resting wrist riding on link 3, and of drives 1 to 3."""
    robot = built_in("irp6")
    assert robot.transmission is not None
    thetas = [link.theta for link in robot.links]
    pose = np.eye(4)
    for joint, theta in zip(robot.joints[3:], thetas[3:], strict=True):
        pose = pose @ joint.motion(0.0)
        thetas[2] = thetas[2] + transport(pose[:3, :3], pose[:3, 3]) @ theta
    values = {f"Ia{k}": drive.rotor_inertia for k, drive in enumerate(robot.transmission.drives[:3], 1)}
    for k, theta in enumerate(thetas[:3], 1):
        values |= dict(zip(parameter_names(k), theta, strict=True))
    return values


def irp6_aggregates() -> dict[str, float]:
    values = irp6_standard_parameters()
    (form,) = built_in("irp6").structure.aggregates
    assert form.joints == ("q1", "q2", "q3")
    return {name: sum(c * values[p] for p, c in terms.items()) for name, terms in form.parameters.items()}


def test_irp6_aggregates_have_the_published_values() -> None:
    X = irp6_aggregates()
    assert list(X) == ["X1", "X2", "X3", "X4", "X5", "X6", "X7"]
    assert np.isclose(X["X7"], 8.125, rtol=1e-12)
    assert np.isclose(X["X3"] - X["X4"], 5.5, rtol=1e-4)
    assert np.allclose(list(X.values()), [5.5368, 1.2590, 9.7435, 4.2437, 2.0223, 0.59, 8.125], atol=1e-4)


def irp6_energy(q: np.ndarray, dq: np.ndarray) -> float:
    """Energy of all five links and the rotors of drives 1 to 3, body by body."""
    robot = built_in("irp6")
    assert robot.transmission is not None
    energy, T = 0.0, np.eye(4)
    w, v = np.zeros(3), np.zeros(3)  # in the link's frame, v of its origin
    for joint, link, position, rate in zip(robot.joints, robot.links, q, dq, strict=True):
        step = joint.motion(position)
        v, w = step[:3, :3].T @ (v + np.cross(w, step[:3, 3])), step[:3, :3].T @ w + joint.axis * rate
        T = T @ step
        m, mc, tensor = link.theta[0], link.theta[1:4], np.zeros((3, 3))
        tensor[np.triu_indices(3)] = link.theta[4:]
        tensor = tensor + tensor.T - np.diag(np.diag(tensor))
        energy += 0.5 * m * v @ v + v @ np.cross(w, mc) + 0.5 * w @ tensor @ w
        energy -= robot.gravity @ (m * T[:3, 3] + T[:3, :3] @ mc)
    dz = robot.transmission.coupling @ dq
    for drive, rate in zip(robot.transmission.drives[:3], dz, strict=False):
        energy += 0.5 * drive.rotor_inertia * (drive.ratio.value * rate) ** 2
    return float(energy)


def irp6_energy_regressor(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """d_1 ... d_7 of [KD96] section 5.1, misprints corrected."""
    (q2, q3), (w1, w2, w3), g, l2 = q[1:3], dq[:3], 9.81, 0.455
    s2, c2, s3, s23, c23 = np.sin(q2), np.cos(q2), np.sin(q3), np.sin(q2 + q3), np.cos(q2 + q3)
    return np.array(
        [
            0.5 * w1**2,
            0.5 * w1**2 * s2**2,
            0.5 * w2**2,
            0.5 * w3**2 + w2 * w3,
            0.5 * (s2**2 - s23**2) * w1**2,
            l2 * s3 * (w2 + w3) * w2 - l2 * s2 * c23 * w1**2 + g * s23,
            g * c2,
        ]
    )


def test_irp6_aggregates_write_the_energy() -> None:
    # Up to a constant: the energy's zero is not the paper's.
    moving = np.array([1.0, 1.0, 1.0, 0.0, 0.0])
    states = [(q * moving, dq * moving) for q, dq in random_positions(10).reshape(-1, 2, 5)]
    X = np.array(list(irp6_aggregates().values()))
    difference = [irp6_energy(q, dq) - irp6_energy_regressor(q, dq) @ X for q, dq in states]
    assert np.allclose(difference, difference[0], rtol=0, atol=1e-10)


def test_irp6_zero_parameters_are_those_of_symmetric_links() -> None:
    robot = built_in("irp6")
    standard = [name for k in range(1, 6) for name in parameter_names(k)]
    assert robot.structure.zero <= set(standard)
    values = dict(zip(standard, np.concatenate([link.theta for link in robot.links]), strict=True))
    assert all(values[name] == 0.0 for name in robot.structure.zero)
    products = {f"I{k}{axes}" for k in range(1, 6) for axes in ("xy", "xz", "yz")}
    centres = {"m1c1y", "m1c1z", "m2c2y", "m2c2z", "m3c3y", "m3c3z", "m4c4x", "m4c4z", "m5c5x", "m5c5y"}
    assert robot.structure.zero == products | centres


def test_irp6_composite_forearm_is_symmetric() -> None:
    values = irp6_standard_parameters()
    for name in ("m3c3y", "m3c3z", "I3xy", "I3xz", "I3yz"):
        assert abs(values[name]) < 1e-15
    assert np.isclose(values["m3"], 13.0)


# panda ---------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def panda_urdf() -> Path:
    return example_urdf("panda_description", "urdf", "panda.urdf")


@pytest.mark.parametrize("q", random_positions(7))
def test_panda_frames_are_those_of_its_urdf(q: np.ndarray, panda_urdf: Path) -> None:
    robot = built_in("panda")
    model = pin.buildModelFromUrdf(str(panda_urdf))
    data = model.createData()
    pin.forwardKinematics(model, data, pinocchio_configuration(model, robot.joint_names, q))
    for name, pose in zip(robot.joint_names, link_poses(robot, q), strict=True):
        assert np.allclose(data.oMi[model.getJointId(name)].homogeneous, pose, atol=1e-12)
    assert np.allclose(axis_lines(robot, q), pinocchio_axis_lines(model, robot.joint_names, q), atol=1e-12)


def test_panda_limits_are_those_of_its_urdf(panda_urdf: Path) -> None:
    robot = built_in("panda")
    model = pin.buildModelFromUrdf(str(panda_urdf))
    places = [model.joints[model.getJointId(name)] for name in robot.joint_names]
    positions, rates = [j.idx_q for j in places], [j.idx_v for j in places]
    assert np.array_equal(robot.limits.lower, model.lowerPositionLimit[positions])
    assert np.array_equal(robot.limits.upper, model.upperPositionLimit[positions])
    assert np.array_equal(robot.limits.velocity, model.velocityLimit[rates])
    assert np.array_equal(robot.limits.torque, model.effortLimit[rates])


def test_panda_inertias_are_those_of_its_urdf(panda_urdf: Path) -> None:
    # Read from the document, because Pinocchio merges the hand into link 7.
    root = ET.parse(panda_urdf).getroot()
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


@pytest.mark.parametrize("q", random_positions(6))
def test_ur10e_is_its_published_table(q: np.ndarray) -> None:
    poses = link_poses(built_in("ur10e"), q)
    T = np.eye(4)
    for k, theta in enumerate(q):
        previous, T = T, T @ classic_dh(theta, UR_A[k], UR_D[k], UR_ALPHA[k])
        direction = poses[k][:3, 2]
        assert np.allclose(direction, previous[:3, 2], atol=1e-12)
        assert np.allclose(np.cross(poses[k][:3, 3] - previous[:3, 3], direction), 0, atol=1e-12)
    assert np.allclose(poses[5], T, atol=1e-12)


@pytest.mark.parametrize("q", random_positions(6, 5))
def test_ur10e_links_are_its_published_table(q: np.ndarray) -> None:
    # Where the mass is and how it is spread, in the base frame: the same in our frames and in UR's.
    robot = built_in("ur10e")
    T = np.eye(4)
    for k, (theta, ours, link) in enumerate(zip(q, link_poses(robot, q), robot.links, strict=True)):
        T = T @ classic_dh(theta, UR_A[k], UR_D[k], UR_ALPHA[k])
        m, centre, elements = UR_MASS[k], np.array(UR_CENTRE[k]), UR_INERTIA[k]
        tensor = np.zeros((3, 3))
        tensor[np.triu_indices(3)] = elements
        tensor = tensor + tensor.T - np.diag(np.diag(tensor)) - m * skew(centre) @ skew(centre)
        theirs = np.array([m, *m * centre, *tensor[np.triu_indices(3)]])
        expected = transport(T[:3, :3], T[:3, 3]) @ theirs
        assert np.allclose(transport(ours[:3, :3], ours[:3, 3]) @ link.theta, expected, atol=1e-12)


@pytest.mark.skipif(not UR10E_URDF.exists(), reason=f"needs {UR10E_URDF}, which is not redistributable")
@pytest.mark.parametrize("q", random_positions(6))
def test_ur10e_axes_are_those_of_its_urdf(q: np.ndarray) -> None:
    # The URDF's lengths are rounded to millimetres, and its base_link is turned by 180 degrees against UR's base.
    robot = built_in("ur10e")
    model = pin.buildModelFromUrdf(str(UR10E_URDF))
    turn = np.diag([-1.0, -1.0, 1.0])
    expected = np.kron(np.eye(2), turn) @ pinocchio_axis_lines(model, robot.joint_names, q)
    found = axis_lines(robot, q)
    assert np.allclose(found[3:], expected[3:], atol=1e-9)
    assert np.allclose(found[:3], expected[:3], atol=3e-3)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pinocchio_configuration(model, robot.joint_names, q))
    base, tool = (data.oMf[model.getFrameId(name)] for name in ("base", "tool0"))
    flange = (base.inverse() * tool).homogeneous
    assert np.allclose(link_poses(robot, q)[5][:3, :3], flange[:3, :3], atol=1e-9)
    assert np.allclose(link_poses(robot, q)[5][:3, 3], flange[:3, 3], atol=3e-3)


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


@pytest.mark.parametrize("q", random_positions(7))
def test_iiwa7_axes_are_those_of_its_urdf(q: np.ndarray) -> None:
    robot = built_in("iiwa7")
    model = pin.buildModelFromXML(iiwa7_urdf())
    assert np.allclose(axis_lines(robot, q), pinocchio_axis_lines(model, robot.joint_names, q), atol=1e-12)
    data = model.createData()
    pin.forwardKinematics(model, data, pinocchio_configuration(model, robot.joint_names, q))
    flange = data.oMi[7].act(np.array([0.0, 0.0, IIWA7_FLANGE]))
    assert np.allclose(link_poses(robot, q)[6][:3, 3], flange, atol=1e-12)


def test_iiwa7_stands_upright_at_zero() -> None:
    pose = link_poses(built_in("iiwa7"), np.zeros(7))[6]
    assert np.allclose(pose[:3, 3], [0.0, 0.0, 0.34 + 0.4 + 0.4 + 0.126])
    assert np.allclose(pose[:3, :3], np.eye(3))


# library -------------------------------------------------------------------------------------------------------------

MINIMAL = "name: one\njoints:\n  - {name: a, mdh: {d: 1.0}}\n"


def test_unknown_built_in_tells_what_there_is() -> None:
    with pytest.raises(UnknownName, match=r"no built-in robot named 'kr6'; available: iiwa7, irp6, irp6-full, panda"):
        built_in("kr6")


@pytest.mark.parametrize("suffix", [".yaml", ".yml", ".YAML"])
def test_load_robot_reads_a_description(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"one{suffix}"
    path.write_text(MINIMAL, encoding="utf-8")
    assert load_robot(str(path)).name == "one"


@pytest.mark.parametrize("suffix", [".urdf", ".xml", ".URDF"])
def test_load_robot_reads_a_urdf(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / f"arm{suffix}"
    path.write_text("<robot/>", encoding="utf-8")
    asked: list[object] = []

    def read_urdf(path: str, *, base: str | None, tip: str | None, snap_angles: bool) -> Robot:
        asked.extend([str(path), base, tip, snap_angles])
        return built_in("irp6")

    module = types.ModuleType("regressors.readers.urdf")
    module.read_urdf = read_urdf  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "regressors.readers.urdf", module)
    assert load_robot(str(path), base="b", tip="t").name == "irp6"
    assert asked == [str(path), "b", "t", True]


def test_built_in_name_wins_over_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("irp6").write_text(MINIMAL, encoding="utf-8")
    assert load_robot("irp6").n == 5


@pytest.mark.parametrize(
    ("spec", "base", "message"),
    [
        ("kr6", None, "no robot 'kr6': built-in robots are iiwa7, irp6, irp6-full, panda, ur10e, and a file of that n"),
        ("missing.yaml", None, "no robot 'missing.yaml': built-in robots are"),
        ("missing.urdf", "base", "no robot 'missing.urdf': built-in robots are"),
        ("../robots/irp6", None, "no robot '../robots/irp6'"),
        ("", None, "'': a robot's file ends in .yaml, .yml, .urdf, .xml, .xacro, .mjcf, .csv"),
        ("robot.txt", None, "'robot.txt': a robot's file ends in .yaml, .yml, .urdf, .xml, .xacro, .mjcf, .csv"),
        ("folder.yaml", None, "cannot read 'folder.yaml'"),
        ("nul\0.yaml", None, "spec: expected text or a path that a file can have, given"),
        ("irp6", "base", "`base` and `tip` choose a chain of a URDF, xacro or MJCF file, but 'irp6' is none"),
        ("robot.yaml", "base", "`base` and `tip` choose a chain of a URDF, xacro or MJCF file, but 'robot.yaml' is no"),
    ],
)
def test_load_robot_refuses(
    spec: str, base: str | None, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("robot.txt").write_text(MINIMAL, encoding="utf-8")
    Path("robot.yaml").write_text(MINIMAL, encoding="utf-8")
    Path("folder.yaml").mkdir()
    with pytest.raises(InputError) as raised:
        load_robot(spec, base=base)
    assert str(raised.value).startswith(message)
    assert "\n" not in str(raised.value)
