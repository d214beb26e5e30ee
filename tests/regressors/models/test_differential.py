"""The differential model: against Pinocchio on public robots, and against the laws of mechanics on random chains."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from public_arms import ARMS, THETA_FROM_PINOCCHIO, Arm, reference
from slow_dynamics import driven_chain, energy, random_body, random_chain, random_rotation, rate_of, thetas_of, torques

from regressors.models.columns import Terms
from regressors.models.differential import DifferentialModel
from regressors.readers.library import built_in
from regressors.readers.urdf import read_urdf
from regressors.robot.gears import BallScrew, ConstantRatio, GearFunction
from regressors.robot.inertia import parameter_names
from regressors.robot.robot import Aggregates, Drive, Limits, Robot, Structure, Transmission
from regressors.samples import Array, Samples

INERTIAL = Terms.inertial_only()
KINDS = st.text(alphabet="rp", min_size=1, max_size=4)
SEED = st.integers(0, 2**32 - 1)
SCREW = BallScrew(pitch=0.005, square=0.0779, cosine=-0.0293, sine=-0.0609)


def regressor(model: DifferentialModel, q: Array, dq: Array, ddq: Array) -> Array:
    """Y at one instant."""
    motion = (np.atleast_2d(x).astype(float) for x in (q, dq, ddq))
    return model.assemble(Samples(np.zeros(1), *motion, np.zeros((1, len(q)))))


def random_state(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    return tuple(rng.uniform(-2.0, 2.0, (3, robot.n)))


# --- public robots against Pinocchio ---------------------------------------------------------------------------------


@pytest.mark.parametrize("arm", ARMS, ids=str)
def test_regressor_and_torques_equal_pinocchio(arm: Arm) -> None:
    expected, robot = reference(arm), read_urdf(arm.path, base=arm.base, tip=arm.tip, snap_angles=False)
    model, data = DifferentialModel(robot, INERTIAL), expected.model.createData()
    # our columns and joints in Pinocchio's order; it orders joints as the chain does, but stores them by number
    rows = [expected.joint(name).idx_v for name in robot.joint_names]
    columns = [10 * (expected.joint(name).id - 1) + k for name in robot.joint_names for k in THETA_FROM_PINOCCHIO]
    theta = np.concatenate([expected.theta(name) for name in robot.joint_names])
    rng = np.random.default_rng(11)
    for _ in range(3):
        q, dq, ddq = random_state(robot, rng)
        configuration = expected.configuration(dict(zip(robot.joint_names, q, strict=True)))
        v, a = np.zeros((2, robot.n))
        v[rows], a[rows] = dq, ddq
        Y = pin.computeJointTorqueRegressor(expected.model, data, configuration, v, a).reshape(robot.n, 10 * robot.n)
        Y = Y[np.ix_(rows, columns)]
        tau = pin.rnea(expected.model, data, configuration, v, a)[rows]
        M = pin.crba(expected.model, data, configuration)[np.ix_(rows, rows)]
        ours = regressor(model, q, dq, ddq)
        assert np.abs(ours - Y).max() <= 1e-11 * np.abs(Y).max()
        np.testing.assert_allclose(ours @ theta, tau, rtol=1e-9, atol=1e-9 * np.abs(tau).max())
        still = DifferentialModel(robot.replace(gravity=np.zeros(3)), INERTIAL)
        ours = np.column_stack([regressor(still, q, 0 * q, unit) @ theta for unit in np.eye(robot.n)])
        np.testing.assert_allclose(ours, M, rtol=1e-9, atol=1e-9 * np.abs(M).max())


def test_enough_public_robots_are_compared() -> None:
    assert len(ARMS) >= 20


# --- laws, on random chains ------------------------------------------------------------------------------------------


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=40)
def test_any_parameters_give_the_torques_of_lagranges_equation(kinds: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng)
    state = random_state(robot, rng)
    thetas = rng.normal(size=(robot.n, 10))  # linear in the parameters whether or not a body could have them
    expected = torques(robot, thetas, *state)
    found = regressor(DifferentialModel(robot, INERTIAL), *state) @ thetas.ravel()
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=20)
def test_each_column_is_the_torque_of_a_unit_parameter(kinds: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng)
    state = random_state(robot, rng)
    units = np.eye(10 * robot.n).reshape(-1, robot.n, 10)
    expected = np.column_stack([torques(robot, unit, *state) for unit in units])
    model = DifferentialModel(robot, INERTIAL)
    np.testing.assert_allclose(regressor(model, *state), expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())
    assert model.names == tuple(name for k in range(robot.n) for name in parameter_names(k + 1))


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=20)
def test_inertia_matrix_is_symmetric_positive_definite_and_gives_the_kinetic_energy(kinds: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng).replace(gravity=np.zeros(3))
    q, dq, _ = random_state(robot, rng)
    model, theta = DifferentialModel(robot, INERTIAL), thetas_of(robot).ravel()
    M = np.column_stack([regressor(model, q, 0 * q, unit) @ theta for unit in np.eye(robot.n)])
    np.testing.assert_allclose(M, M.T, atol=1e-11 * np.abs(M).max())
    assert np.linalg.eigvalsh(M)[0] > 0
    kinetic = float(np.real(energy(robot, thetas_of(robot), q, dq)))
    assert dq @ M @ dq / 2 == pytest.approx(kinetic, rel=1e-11)


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=20)
def test_power_of_the_torques_is_the_rate_of_the_energy(kinds: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng)
    q, dq, ddq = random_state(robot, rng)
    Y, thetas = regressor(DifferentialModel(robot, INERTIAL), q, dq, ddq), thetas_of(robot)
    rate = rate_of(lambda q, dq: energy(robot, thetas, q, dq), (q, dq), (dq, ddq))
    parts = np.abs(dq[:, None] * Y * thetas.ravel()).sum()
    assert dq @ Y @ thetas.ravel() == pytest.approx(rate, abs=1e-12 * parts)


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=20)
def test_held_still_the_torques_are_the_slope_of_the_potential_energy(kinds: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng)
    q, _, _ = random_state(robot, rng)
    thetas, rest = thetas_of(robot), np.zeros(robot.n)
    slope = [rate_of(lambda q: energy(robot, thetas, q, rest), (q, unit)) for unit in np.eye(robot.n)]
    found = regressor(DifferentialModel(robot, INERTIAL), q, rest, rest) @ thetas.ravel()
    np.testing.assert_allclose(found, slope, rtol=1e-10, atol=1e-10 * np.abs(thetas).max())


@given(kinds=KINDS, seed=SEED, pace=st.floats(-3.0, 3.0))
@settings(max_examples=20)
def test_without_gravity_torques_scale_with_the_square_of_the_pace(kinds: str, seed: int, pace: float) -> None:
    """The same path at another pace, backwards too: dq -> s dq, ddq -> s^2 ddq takes Y -> s^2 Y."""
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng).replace(gravity=np.zeros(3))
    q, dq, ddq = random_state(robot, rng)
    model = DifferentialModel(robot, INERTIAL)
    Y = regressor(model, q, dq, ddq)
    np.testing.assert_allclose(regressor(model, q, pace * dq, pace**2 * ddq), pace**2 * Y, atol=1e-12 * np.abs(Y).max())


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=12)
def test_torques_depend_on_gravity_linearly_and_not_on_the_base_frame(kinds: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng)
    state = random_state(robot, rng)
    Y = regressor(DifferentialModel(robot, INERTIAL), *state)

    def with_gravity(g: Array) -> Array:
        return regressor(DifferentialModel(robot.replace(gravity=g), INERTIAL), *state)

    none = with_gravity(np.zeros(3))
    parts = [robot.gravity[k] * (with_gravity(np.eye(3)[k]) - none) for k in range(3)]
    np.testing.assert_allclose(none + sum(parts), Y, atol=1e-11 * np.abs(Y).max())

    R, first = random_rotation(rng), robot.joints[0]
    turned = dataclasses.replace(first, rotation=R @ first.rotation, translation=rng.normal(size=3))
    elsewhere = robot.replace(joints=(turned, *robot.joints[1:]), gravity=R @ robot.gravity)
    found = regressor(DifferentialModel(elsewhere, INERTIAL), *state)
    np.testing.assert_allclose(found, Y, atol=1e-11 * np.abs(Y).max())


def test_a_slider_pulls_its_weight() -> None:
    """Closed form: a vertical prismatic joint takes m (ddq + g); a mass on a turning rail takes m (ddr - r w^2)."""
    rng = np.random.default_rng(3)
    robot = random_chain("rp", rng)
    turn, slide = robot.joints
    turn = dataclasses.replace(turn, rotation=np.eye(3), translation=np.zeros(3), axis=np.array([0.0, 0.0, 1.0]))
    slide = dataclasses.replace(slide, rotation=np.eye(3), translation=np.zeros(3), axis=np.array([1.0, 0.0, 0.0]))
    robot = robot.replace(joints=(turn, slide), gravity=np.array([0.0, 0.0, -9.81]))
    q, dq, ddq = random_state(robot, rng)
    Y = regressor(DifferentialModel(robot, INERTIAL), q, dq, ddq)
    m = DifferentialModel(robot, INERTIAL).names.index("m2")
    assert Y[1, m] == pytest.approx(ddq[1] - q[1] * dq[0] ** 2, rel=1e-12)
    assert Y[0, m] == pytest.approx(q[1] ** 2 * ddq[0] + 2 * q[1] * dq[1] * dq[0], rel=1e-12)
    upright = robot.replace(joints=(turn, dataclasses.replace(slide, axis=np.array([0.0, 0.0, 1.0]))))
    assert regressor(DifferentialModel(upright, INERTIAL), q, dq, ddq)[1, m] == pytest.approx(ddq[1] + 9.81, rel=1e-12)


def test_rows_are_labelled_with_joints_and_units() -> None:
    robot = random_chain("rpr", np.random.default_rng(0))
    assert DifferentialModel(robot).row_labels == (("j1", "Nm"), ("j2", "N"), ("j3", "Nm"))


def test_stacks_the_instants_in_order_however_many() -> None:
    """More instants than one pass holds, and a last pass that is shorter."""
    robot = random_chain("rr", np.random.default_rng(5))
    model, rng = DifferentialModel(robot), np.random.default_rng(6)
    q, dq, ddq = rng.normal(size=(3, 4100, 2))
    W = model.assemble(Samples(np.arange(4100.0), q, dq, ddq, 0 * q))
    assert W.shape == (8200, len(model.columns))
    for k in (0, 1, 4095, 4096, 4099):
        np.testing.assert_array_equal(W[2 * k : 2 * k + 2], regressor(model, q[k], dq[k], ddq[k]))


# --- drives ----------------------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Case:
    """One gear function and its motor angle phi = F(z), written out."""

    gear: GearFunction
    angle: object  # of a CasADi expression


GEARS = {
    "constant": Case(ConstantRatio(120.0), lambda z: 120.0 * z),
    "reversed": Case(ConstantRatio(-77.5), lambda z: -77.5 * z),
    "screw": Case(
        SCREW, lambda z: 2 * ca.pi / 0.005 * ca.sqrt(0.0779 - 0.0293 * ca.cos(z) - 0.0609 * ca.sin(z))
    ),
}  # fmt: skip


def group(model: DifferentialModel, *names: str) -> list[int]:
    return [model.names.index(name) for name in names]


@pytest.mark.parametrize("case", GEARS.values(), ids=GEARS.keys())
def test_ratio_is_the_slope_of_the_motor_angle(case: Case) -> None:
    z = ca.SX.sym("z")
    difference = ca.Function("d", [z], [case.gear.ratio(z) - ca.gradient(ca.SX(case.angle(z)), z)])
    for position in np.linspace(-0.7, 0.7, 15):
        assert abs(float(difference(position))) <= 1e-10
    angle = ca.Function("F", [z], [case.angle(z)])
    ratio = ca.Function("r", [z], [case.gear.ratio(z)])
    slope = (float(angle(0.2 + 1e-5)) - float(angle(0.2 - 1e-5))) / 2e-5
    assert float(ratio(0.2)) == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("name", GEARS)
def test_rotor_columns_follow_from_the_rotors_kinetic_energy(name: str) -> None:
    """Lagrange's equation for ``1/2 (d/dt F(z))^2`` per unit inertia, by automatic differentiation of F."""
    rng = np.random.default_rng(8)
    robot = driven_chain([GEARS[name].gear] * 3, rng)
    assert robot.transmission is not None
    q, dq, ddq = (ca.SX.sym(letter, 3) for letter in ("q", "dq", "ddq"))
    columns = []
    for k in range(3):
        z = ca.mtimes(ca.DM(robot.transmission.coupling[k : k + 1]), q) + robot.transmission.offset[k]
        kinetic = ca.jtimes(ca.SX(GEARS[name].angle(z)), q, dq) ** 2 / 2
        momentum = ca.gradient(kinetic, dq)
        columns.append(ca.jtimes(momentum, q, dq) + ca.jtimes(momentum, dq, ddq) - ca.gradient(kinetic, q))
    expected = ca.Function("tau", [q, dq, ddq], [ca.horzcat(*columns)])
    model = DifferentialModel(robot, Terms(reflected=False))
    rotors = group(model, "Ia1", "Ia2", "Ia3")
    for _ in range(10):
        state = rng.uniform(-0.4, 0.4, (3, 3))
        tau = np.array(expected(*state))
        np.testing.assert_allclose(regressor(model, *state)[:, rotors], tau, rtol=1e-9, atol=1e-11 * np.abs(tau).max())


def test_power_of_the_rotor_columns_is_the_rate_of_the_rotors_energy() -> None:
    """The same by finite differences in time of ``1/2 (F'(z) dz)^2``."""
    rng = np.random.default_rng(9)
    robot = driven_chain([ConstantRatio(120.0), SCREW, SCREW], rng)
    transmission = robot.transmission
    assert transmission is not None

    def energies(q: Array, dq: Array) -> Array:
        z, dz = transmission.coupling @ q + transmission.offset, transmission.coupling @ dq
        length = np.sqrt(SCREW.square + SCREW.cosine * np.cos(z) + SCREW.sine * np.sin(z))
        ratio = np.pi / SCREW.pitch * (SCREW.sine * np.cos(z) - SCREW.cosine * np.sin(z)) / length
        ratio[0] = 120.0
        return (ratio * dz) ** 2 / 2

    model = DifferentialModel(robot, Terms(reflected=False))
    rotors = group(model, "Ia1", "Ia2", "Ia3")
    for q, dq, ddq in rng.uniform(-0.4, 0.4, (5, 3, 3)):

        def at(t: float, q: Array = q, dq: Array = dq, ddq: Array = ddq) -> Array:
            return energies(q + t * dq + t**2 * ddq / 2, dq + t * ddq)

        h = 1e-4
        rate = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
        np.testing.assert_allclose(dq @ regressor(model, q, dq, ddq)[:, rotors], rate, rtol=1e-7, atol=1e-7)


def test_friction_columns_act_on_drive_coordinates() -> None:
    rng = np.random.default_rng(10)
    robot = driven_chain([ConstantRatio(120.0)] * 3, rng)
    assert robot.transmission is not None
    C = robot.transmission.coupling
    model = DifferentialModel(robot, Terms(offset=True))
    for _ in range(10):
        q, dq, ddq = random_state(robot, rng)
        Y, dz = regressor(model, q, dq, ddq), C @ dq
        np.testing.assert_allclose(Y[:, group(model, "F1c", "F2c", "F3c")], C.T * np.sign(dz))
        np.testing.assert_allclose(Y[:, group(model, "F1v", "F2v", "F3v")], C.T * dz, atol=1e-15)
        np.testing.assert_array_equal(Y[:, group(model, "F1o", "F2o", "F3o")], C.T)


def test_coulomb_friction_vanishes_exactly_where_a_drive_stands() -> None:
    """Also where joints move and their drive does not; with a width its torque is that of a smooth step."""
    rng = np.random.default_rng(12)
    robot = driven_chain([ConstantRatio(120.0)] * 3, rng)
    exact, soft = DifferentialModel(robot), DifferentialModel(robot, sign_width=0.1)
    coulomb = group(exact, "F1c", "F2c", "F3c")
    q, ddq = rng.normal(size=(2, 3))
    standing = (([0, 0, 0], [0, 0, 0]), ([0, 0.5, 0.5], [0, 1, 0]), ([-2, 1, 0], [-1, 0, -1]))
    for dq, signs in (*standing, ([1e-300, 0, 0], [1, 1, 0])):
        Y = regressor(exact, q, np.array(dq), ddq)
        np.testing.assert_array_equal(Y[:, coulomb], robot.transmission.coupling.T * signs)
    dq = np.array([0.02, 0.05, -0.2])
    expected = robot.transmission.coupling.T * np.tanh(robot.transmission.coupling @ dq / 0.1)
    np.testing.assert_allclose(regressor(soft, q, dq, ddq)[:, coulomb], expected, rtol=1e-14, atol=1e-16)


@pytest.mark.parametrize(
    ("terms", "names"),
    [
        (Terms(), ("Iar1", "Iar3", "F1c", "F2c", "F3c", "F1v", "F2v", "F3v")),
        (Terms(offset=True, reflected=False), ("Ia1", "Ia3", *(f"F{k}{s}" for s in "cvo" for k in (1, 2, 3)))),
        (Terms(rotor=False, coulomb=False), ("F1v", "F2v", "F3v")),
        (Terms(viscous=False, coulomb=False), ("Iar1", "Iar3")),
        (INERTIAL, ()),
    ],
)
def test_columns_are_those_asked_for_in_a_fixed_order(terms: Terms, names: tuple[str, ...]) -> None:
    robot = driven_chain([ConstantRatio(10.0)] * 3, np.random.default_rng(1))
    transmission = robot.transmission
    assert transmission is not None
    first, second, third = transmission.drives
    drives = (first, dataclasses.replace(second, rotor_inertia=None), third)
    robot = robot.replace(transmission=dataclasses.replace(transmission, drives=drives))
    model = DifferentialModel(robot, terms)
    assert model.names[30:] == names
    assert regressor(model, *np.ones((3, 3))).shape == (3, 30 + len(names))


def test_units_and_groups_of_the_drives_columns() -> None:
    robot = random_chain("rp", np.random.default_rng(2))
    drives = tuple(Drive(f"d{k}", rotor_inertia=1e-4) for k in (1, 2))
    robot = robot.replace(transmission=Transmission(np.eye(2), drives, Limits.none(2)))
    found = {c.name: (c.unit, c.group) for c in DifferentialModel(robot, Terms(offset=True)).columns[20:]}
    assert found == {
        "Ia1": ("kg m^2", "rotor"),
        "Ia2": ("kg m^2", "rotor"),
        "F1c": ("Nm", "friction"),
        "F2c": ("N", "friction"),
        "F1v": ("Nm s/rad", "friction"),
        "F2v": ("N s/m", "friction"),
        "F1o": ("Nm", "friction"),
        "F2o": ("N", "friction"),
    }


def test_without_a_transmission_every_joint_has_its_own_friction() -> None:
    robot = random_chain("rr", np.random.default_rng(4))
    model = DifferentialModel(robot)
    assert model.names[20:] == ("F1c", "F2c", "F1v", "F2v")
    dq = np.array([-0.3, 0.7])
    expected = np.hstack([np.diag(np.sign(dq)), np.diag(dq)])
    np.testing.assert_array_equal(regressor(model, dq, dq, dq)[:, 20:], expected)


# --- structure -------------------------------------------------------------------------------------------------------


def structured(structure: Structure, kinds: str = "rr") -> tuple[DifferentialModel, DifferentialModel]:
    robot = random_chain(kinds, np.random.default_rng(21))
    return DifferentialModel(robot.replace(structure=structure), INERTIAL), DifferentialModel(robot, INERTIAL)


def assert_same_torques(model: DifferentialModel, plain: DifferentialModel, theta: Array) -> None:
    """Torques by the parameters that the structure leaves are those by the standard parameters."""
    definition, standard = model.definition()
    assert standard == plain.names
    for state in np.random.default_rng(22).normal(size=(5, 3, model.robot.n)):
        expected = regressor(plain, *state) @ theta
        np.testing.assert_allclose(regressor(model, *state) @ (definition @ theta), expected, rtol=1e-9, atol=1e-9)


def test_parameters_known_to_be_zero_have_no_column() -> None:
    zero = frozenset({"m1", "m2c2y", "I2xz"})
    model, plain = structured(Structure(zero=zero))
    assert model.names == tuple(name for name in plain.names if name not in zero)
    theta = np.array([0.0 if name in zero else k + 1.0 for k, name in enumerate(plain.names)])
    assert_same_torques(model, plain, theta)


def test_equal_parameters_share_a_column() -> None:
    model, plain = structured(Structure(equal=(("I2yy", "I2zz", "I1zz"), ("m1", "m2"))))
    assert not {"I2zz", "I1zz", "m2"} & set(model.names)
    shared = {"I2zz": "I2yy", "I1zz": "I2yy", "m2": "m1"}
    values = {name: k + 1.0 for k, name in enumerate(plain.names)}
    assert_same_torques(model, plain, np.array([values[shared.get(name, name)] for name in plain.names]))


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_aggregates_as_many_as_parameters_are_still_combined(scale: float) -> None:
    names = parameter_names(1)
    combinations = {f"X{k}": {name: scale} for k, name in enumerate(reversed(names))}
    model, plain = structured(Structure(aggregates=(Aggregates(("j1",), combinations),)), "r")
    assert model.names == tuple(combinations)
    assert_same_torques(model, plain, random_body(np.random.default_rng(1)))


def test_aggregates_hold_for_their_joints_alone() -> None:
    aggregates = (Aggregates(("j1",), {"X1": {"m1": 1.0}}),)
    model, plain = structured(Structure(aggregates=aggregates), "rr")
    assert model.names == plain.names


def test_the_built_in_robots_have_models_of_their_own_standard_parameters() -> None:
    robot = built_in("panda")
    theta = thetas_of(robot).ravel()
    rng = np.random.default_rng(2)
    for _ in range(3):
        state = random_state(robot, rng)
        found = regressor(DifferentialModel(robot, INERTIAL), *state) @ theta
        np.testing.assert_allclose(found, torques(robot, thetas_of(robot), *state), rtol=1e-9, atol=1e-9)
