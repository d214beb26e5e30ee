"""The differential model: against Pinocchio on public robots, and against the laws of mechanics on random chains."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st
from public_arms import ARMS, SOME_TREES, THETA_FROM_PINOCCHIO, Arm, reference
from slow_dynamics import driven_chain, random_body, random_chain, torques

from regressors.models.differential import DifferentialModel
from regressors.readers.urdf import read_urdf
from regressors.robot.columns import Terms
from regressors.robot.gears import BallScrew, ConstantRatio
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


@pytest.mark.parametrize("arm", [*ARMS, *SOME_TREES], ids=str)
def test_regressor_and_torques_equal_pinocchio(arm: Arm) -> None:
    expected, robot = reference(arm), read_urdf(arm.path, base=arm.base, tip=arm.tip, snap_angles=False)
    model, data = DifferentialModel(robot, INERTIAL), expected.model.createData()
    # our columns and joints in Pinocchio's order; it orders joints as the chain does, but stores them by number
    rows = [expected.joint(name).idx_v for name in robot.joint_names]
    columns = [10 * (expected.joint(name).id - 1) + k for name in robot.joint_names for k in THETA_FROM_PINOCCHIO]
    theta = np.concatenate([expected.theta(name) for name in robot.joint_names])
    rng, still = np.random.default_rng(11), DifferentialModel(robot.replace(gravity=np.zeros(3)), INERTIAL)
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
        ours = np.column_stack([regressor(still, q, 0 * q, unit) @ theta for unit in np.eye(robot.n)])
        np.testing.assert_allclose(ours, M, rtol=1e-9, atol=1e-9 * np.abs(M).max())


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


GEARS = {  # and their motor angles phi = F(z), written out
    "constant": (ConstantRatio(120.0), lambda z: 120.0 * z),
    "reversed": (ConstantRatio(-77.5), lambda z: -77.5 * z),
    "screw": (SCREW, lambda z: 2 * ca.pi / 0.005 * ca.sqrt(0.0779 - 0.0293 * ca.cos(z) - 0.0609 * ca.sin(z))),
}


def group(model: DifferentialModel, *names: str) -> list[int]:
    return [model.names.index(name) for name in names]


@pytest.mark.parametrize("name", GEARS)
def test_rotor_columns_follow_from_the_rotors_kinetic_energy(name: str) -> None:
    """Lagrange's equation for ``1/2 (d/dt F(z))^2`` per unit inertia, by automatic differentiation of F."""
    rng = np.random.default_rng(8)
    gear, angle = GEARS[name]
    robot = driven_chain([gear] * 3, rng)
    q, dq, ddq = (ca.SX.sym(letter, 3) for letter in ("q", "dq", "ddq"))
    columns = []
    for k in range(3):
        z = ca.mtimes(ca.DM(robot.transmission.coupling[k : k + 1]), q) + robot.transmission.offset[k]
        kinetic = ca.jtimes(ca.SX(angle(z)), q, dq) ** 2 / 2
        momentum = ca.gradient(kinetic, dq)
        columns.append(ca.jtimes(momentum, q, dq) + ca.jtimes(momentum, dq, ddq) - ca.gradient(kinetic, q))
    expected = ca.Function("tau", [q, dq, ddq], [ca.horzcat(*columns)])
    model = DifferentialModel(robot, Terms(reflected=False))
    rotors = group(model, "Ia1", "Ia2", "Ia3")
    for _ in range(10):
        state = rng.uniform(-0.4, 0.4, (3, 3))
        tau = np.array(expected(*state))
        np.testing.assert_allclose(regressor(model, *state)[:, rotors], tau, rtol=1e-9, atol=1e-11 * np.abs(tau).max())


def test_friction_columns_act_on_drive_coordinates() -> None:
    rng = np.random.default_rng(10)
    robot = driven_chain([ConstantRatio(120.0)] * 3, rng)
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
    assert DifferentialModel(robot).row_labels == (("j1", "Nm"), ("j2", "N"))
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
