"""The differential load model: K against Pinocchio's body regressor, the paper's equations, and a moved body."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from load_sensors import KINDS, ROBOTS, SEED, shifted
from pinocchio_chains import chain_model, inertia
from public_arms import ARMS, THETA_FROM_PINOCCHIO, Arm, reference
from slow_dynamics import cross_matrix, pose_rates, poses, random_body, random_chain

from regressors.errors import InputError, UnknownName
from regressors.models.base import base_parameters, random_states
from regressors.models.load import EQUATIONS, LoadModel, Sensor
from regressors.readers.library import built_in
from regressors.readers.urdf import read_urdf
from regressors.robot.inertia import transport
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return ROBOTS[request.param]()


def regressors(robot: Robot, sensor: Sensor | None, states: Samples) -> Array:
    """K at every state, shape (N, 6, 10)."""
    return LoadModel(robot, sensor).assemble(states).reshape(states.time.size, -1, 10)


def close(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, atol=1e-12 * max(1.0, float(np.abs(expected).max())))


# --- against Pinocchio -----------------------------------------------------------------------------------------------


def pinocchio_regressor(model: object, joint: int, placement: object, q: Array, dq: Array, ddq: Array) -> Array:
    """`pin.bodyRegressor` of a frame on a joint, its spatial acceleration less gravity; columns in our order."""
    data = model.createData()
    pin.forwardKinematics(model, data, q, dq, ddq)
    pose = data.oMi[joint] * placement
    up = pose.actInv(model.gravity)  # gravity is a spatial acceleration like any other
    v, a = placement.actInv(data.v[joint]), placement.actInv(data.a[joint])
    return pin.bodyRegressor(v, a - up)[:, THETA_FROM_PINOCCHIO]


@pytest.mark.parametrize("link", [None, "1", "2", "4"])
@pytest.mark.parametrize("turned", [False, True], ids=["on-the-link", "turned"])
def test_regressor_is_pinocchios(robot: Robot, link: str | None, turned: bool) -> None:
    sensor = shifted(link) if turned else Sensor(link)
    model = chain_model(robot)
    placement = pin.SE3(np.array(sensor.rotation), np.array(sensor.translation))
    states = random_states(robot, 20, seed=1)
    joint = int(link) if link else robot.n
    expected = [
        pinocchio_regressor(model, joint, placement, *state)
        for state in zip(states.q, states.dq, states.ddq, strict=True)
    ]
    close(regressors(robot, sensor, states), np.array(expected))


@pytest.mark.parametrize("arm", [arm for arm in ARMS if arm.id in ("tiago-torso-arm", "kinova", "ur10")], ids=str)
def test_regressor_is_pinocchios_on_public_robots(arm: Arm) -> None:
    """Built from the URDF by Pinocchio itself; the first has a slider, the second has joints without limits."""
    theirs, robot = reference(arm), read_urdf(arm.path, base=arm.base, tip=arm.tip)
    rows = [theirs.joint(name).idx_v for name in robot.joint_names]
    states, sensor = random_states(robot, 5, seed=2), shifted(None, 3)
    placement = pin.SE3(np.array(sensor.rotation), np.array(sensor.translation))
    expected = []
    for q, dq, ddq in zip(states.q, states.dq, states.ddq, strict=True):
        v, a = np.zeros((2, robot.n))
        v[rows], a[rows] = dq, ddq
        configuration = theirs.configuration(dict(zip(robot.joint_names, q, strict=True)))
        joint = theirs.joint(robot.joint_names[-1]).id
        expected.append(pinocchio_regressor(theirs.model, joint, placement, configuration, v, a))
    close(regressors(robot, sensor, states), np.array(expected))


@pytest.mark.parametrize("link", [None, "2"])
def test_moving_a_known_body(robot: Robot, link: str | None) -> None:
    """What a body on the sensor adds to the force that the sensor's joint transmits is K phi."""
    sensor, phi = shifted(link, 4), random_body(np.random.default_rng(5))
    joint = int(link) if link else robot.n
    placement = pin.SE3(np.array(sensor.rotation), np.array(sensor.translation))
    bare, loaded = chain_model(robot), chain_model(robot)
    loaded.appendBodyToJoint(joint, inertia(phi), placement)
    states = random_states(robot, 10, seed=6)
    K = regressors(robot, sensor, states)
    for K_k, *state in zip(K, states.q, states.dq, states.ddq, strict=True):
        forces = []
        for model in (bare, loaded):
            data = model.createData()
            pin.rnea(model, data, *state)
            forces.append(data.f[joint])
        wrench = placement.actInv(forces[1] - forces[0]).vector
        np.testing.assert_allclose(K_k @ phi, wrench, atol=1e-11 * np.abs(forces[1].vector).max())


# --- laws ------------------------------------------------------------------------------------------------------------


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=25)
def test_regressor_is_that_of_the_papers_equation(kinds: str, seed: int) -> None:
    """[KD96] eq. (9) block by block; omega, domega and dv from derivatives of homogeneous matrices."""
    rng = np.random.default_rng(seed)
    robot, sensor = random_chain(kinds, rng), shifted(None, seed)
    q, dq, ddq = rng.uniform(-2.0, 2.0, (3, robot.n))
    S = np.eye(4)
    S[:3, :3], S[:3, 3] = sensor.rotation, sensor.translation
    T = np.real(poses(robot, q)[-1]) @ S
    dT, ddT = (np.real(rate) @ S for rate in pose_rates(robot, q, dq, ddq)[-1])
    R = T[:3, :3].T
    turning = R @ dT[:3, :3]
    bending = R @ ddT[:3, :3]  # [domega x] + [omega x][omega x]
    w, dw = (np.array([X[2, 1], X[0, 2], X[1, 0]]) for X in (turning, bending - turning @ turning))
    fall = R @ (ddT[:3, 3] - robot.gravity)
    K = np.zeros((6, 10))
    K[:3, 0] = fall
    K[:3, 1:4] = cross_matrix(dw) + cross_matrix(w) @ cross_matrix(w)
    K[3:, 1:4] = -cross_matrix(fall)
    K[3:, 4:] = products(dw) + cross_matrix(w) @ products(w)
    states = Samples(np.zeros(1), q[None], dq[None], ddq[None], 0 * q[None])
    np.testing.assert_allclose(regressors(robot, sensor, states)[0], K, atol=1e-11 * max(1.0, np.abs(K).max()))


def products(w: Array) -> Array:
    """``[. w]`` with ``I w = [. w] (Ixx, Ixy, Ixz, Iyy, Iyz, Izz)``: one unit tensor at a time."""
    columns = []
    for i, j in zip(*np.triu_indices(3), strict=True):
        tensor = np.zeros((3, 3))
        tensor[i, j] = tensor[j, i] = 1.0
        columns.append(tensor @ w)
    return np.column_stack(columns)


def test_held_still_the_sensor_carries_the_weight(robot: Robot) -> None:
    """F = -m g and N = -mc x g in the sensor's axes; tensors do not show."""
    sensor, phi = shifted(None, 7), random_body(np.random.default_rng(8))
    states = random_states(robot, 10, seed=9)
    still = Samples(states.time, states.q, *(0 * states.q for _ in range(3)))
    K = regressors(robot, sensor, still)
    for K_k, q in zip(K, states.q, strict=True):
        up = -(np.real(poses(robot, q)[-1][:3, :3]) @ sensor.rotation).T @ robot.gravity
        expected = np.concatenate([phi[0] * up, np.cross(phi[1:4], up)])
        np.testing.assert_allclose(K_k @ phi, expected, atol=1e-12 * np.abs(expected).max())
        assert not K_k[:, 4:].any()


def test_in_free_fall_the_sensor_feels_nothing() -> None:
    """A slider along gravity that falls freely: K = 0."""
    robot = random_chain("p", np.random.default_rng(10))
    axis = robot.joints[0].rotation @ robot.joints[0].axis
    robot = robot.replace(gravity=9.81 * axis)
    fall = np.full((1, 1), 9.81)
    K = regressors(robot, shifted(None), Samples(np.zeros(1), 0.3 * fall, 0.1 * fall, fall, 0 * fall))
    np.testing.assert_allclose(K, 0.0, atol=1e-14)


def test_a_sensor_elsewhere_feels_the_same_body(robot: Robot) -> None:
    """Wrenches about two frames on one link are one wrench; parameters change by the transport of a body."""
    here, there = Sensor("3"), shifted("3", 11)
    phi = random_body(np.random.default_rng(12))
    states = random_states(robot, 10, seed=13)
    from_there = transport(there.rotation, there.translation)  # from the sensor's frame to the link's
    at_link = regressors(robot, here, states) @ (from_there @ phi)
    at_sensor = regressors(robot, there, states) @ phi
    force = at_sensor[:, :3] @ there.rotation.T
    moment = at_sensor[:, 3:] @ there.rotation.T + np.cross(there.translation, force)
    close(at_link, np.hstack([force, moment]))


def test_all_ten_parameters_are_seen(robot: Robot) -> None:
    base = base_parameters(LoadModel(robot))
    assert base.rank == 10
    assert base.names == ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")


def test_joints_beyond_the_sensor_do_not_matter() -> None:
    robot = built_in("irp6")
    states = random_states(robot, 5, seed=14)
    others = [x.copy() for x in (states.q, states.dq, states.ddq)]
    for x in others:
        x[:, 3:] += 1.0
    moved = Samples(states.time, *others, states.dddq)
    np.testing.assert_array_equal(regressors(robot, Sensor("3"), moved), regressors(robot, Sensor("3"), states))


# --- order, units, selection -----------------------------------------------------------------------------------------


def test_order_and_units_are_the_papers() -> None:
    """[KD96] eq. (8) and (10)."""
    model = LoadModel(built_in("irp6"))
    expected = [("m", "kg"), *((f"mc{x}", "kg m") for x in "xyz")]
    expected += [(f"I{axes}", "kg m^2") for axes in ("xx", "xy", "xz", "yy", "yz", "zz")]
    assert [(c.name, c.unit) for c in model.columns] == expected
    assert {c.group for c in model.columns} == {"inertial"}
    assert model.row_labels == (("fx", "N"), ("fy", "N"), ("fz", "N"), ("nx", "Nm"), ("ny", "Nm"), ("nz", "Nm"))
    definition, names = model.definition()
    np.testing.assert_array_equal(definition, np.eye(10))
    assert names == model.names


def test_default_sensor_sits_on_the_last_link(robot: Robot) -> None:
    states = random_states(robot, 3, seed=15)
    by_number, by_name = str(robot.n), robot.links[-1].name
    for sensor in (None, Sensor(by_number), Sensor(by_name)):
        np.testing.assert_array_equal(regressors(robot, sensor, states), regressors(robot, Sensor(), states))


SELECTIONS = [("fx",), ("nz", "fx"), ("fy", "fz", "ny"), EQUATIONS[::-1]]


@pytest.mark.parametrize("equations", SELECTIONS, ids="-".join)
def test_any_selection_of_equations_in_any_order(robot: Robot, equations: tuple[str, ...]) -> None:
    states, whole = random_states(robot, 4, seed=16), shifted(None, 17)
    sensor = Sensor(None, whole.rotation, whole.translation, equations)
    model = LoadModel(robot, sensor)
    assert [name for name, _ in model.row_labels] == list(equations)
    assert [unit for _, unit in model.row_labels] == ["N" if name[0] == "f" else "Nm" for name in equations]
    rows = [EQUATIONS.index(name) for name in equations]
    np.testing.assert_array_equal(regressors(robot, sensor, states), regressors(robot, whole, states)[:, rows])
    measured = np.random.default_rng(18).normal(size=(4, len(equations)))
    expected = measured if len(equations) < len(EQUATIONS) else measured[:, rows]  # six are the whole wrench
    np.testing.assert_array_equal(model.right_side(states, measured), expected.ravel())


# --- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("link", ["hand", "0", "6", "-1", ""])
def test_a_sensor_off_the_chain(link: str) -> None:
    with pytest.raises(UnknownName) as error:
        LoadModel(built_in("irp6"), Sensor(link))
    assert repr(link) in str(error.value)
    assert "1 (column), 2 (arm), 3 (forearm), 4 (wrist_bend), 5 (wrist_turn)" in str(error.value)


def test_an_unknown_equation() -> None:
    with pytest.raises(UnknownName, match="no equation named 'mx'; available: fx, fy, fz, nx, ny, nz"):
        Sensor(equations=("fx", "mx"))


@pytest.mark.parametrize("equations", [("fx", "fy", "fx"), ()])
def test_equations_twice_or_none(equations: tuple[str, ...]) -> None:
    given_text = ", ".join(equations) or "none"
    with pytest.raises(InputError, match=f"expected at least one, and each once, given {given_text}"):
        Sensor(equations=equations)


@pytest.mark.parametrize("position", [[0.0, 0.0], [0.0, np.nan, 0.0], [np.inf, 0.0, 0.0]])
def test_a_sensor_nowhere(position: list[float]) -> None:
    with pytest.raises(InputError, match="sensor position must be three finite numbers"):
        Sensor(translation=np.array(position))


@pytest.mark.parametrize("rotation", [2.0 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.full((3, 3), np.nan), np.eye(2)])
def test_axes_of_a_sensor_that_are_none(rotation: Array) -> None:
    """As of a joint's frame, whose rotation is checked; K would be wrong without a word."""
    with pytest.raises(InputError):
        LoadModel(built_in("irp6"), Sensor(rotation=rotation))


def test_measured_wrench_of_a_selection_may_be_whole() -> None:
    """Like the integral model: six columns are taken for the whole wrench."""
    robot = built_in("irp6")
    states = random_states(robot, 3, seed=19)
    wrench = np.random.default_rng(20).normal(size=(3, 6))
    model = LoadModel(robot, Sensor(equations=("nz", "fx")))
    np.testing.assert_array_equal(model.right_side(states, wrench), wrench[:, [5, 0]].ravel())
