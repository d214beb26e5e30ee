"""The IRp-6 in the form of [KD96]: its 13 parameters, the energy they come from, and how many there are without it."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import pytest

from excite.information.target import moving_robot
from excite.tasks.task import Task
from regressors.models.base import base_parameters, random_states
from regressors.models.columns import Terms
from regressors.models.differential import DifferentialModel
from regressors.readers.library import load_robot
from regressors.robot.gears import BallScrew
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Robot, Structure, Transmission
from regressors.samples import Array, Samples

NAMES = (*(f"X{k}" for k in range(1, 8)), "F1c", "F2c", "F3c", "F1v", "F2v", "F3v")
INERTIAL = Terms.inertial_only()
MASSES = Terms(coulomb=False, viscous=False)
L2, N1, N2, N3, G = 0.455, 158.0, 167.5, 167.5, 9.81

# [KD96] section 5.1 with its misprints corrected (shared/paper/errata.md): X_i in standard parameters.
AGGREGATES = {
    "X1": {"I1zz": 1, "Ia1": N1**2, "I2xx": 1, "I3yy": 1},
    "X2": {"I2yy": 1, "I2xx": -1, "m3": L2**2, "I3yy": -1, "I3xx": 1},
    "X3": {"I2zz": 1, "Ia2": N2**2, "I3zz": 1, "Ia3": N3**2, "m3": L2**2},
    "X4": {"I3zz": 1, "Ia3": N3**2},
    "X5": {"I3yy": 1, "I3xx": -1},
    "X6": {"m3c3x": 1},
    "X7": {"m2c2x": 1, "m3": L2},
}

# Ball screws of the published geometry (shared/facts/irp6.yaml), in metres: square + cosine cos z + sine sin z.
ARM_SCREW = BallScrew(pitch=0.005, square=0.07789525, cosine=-0.02934668, sine=-0.06090255)
FOREARM_SCREW = BallScrew(pitch=0.005, square=0.07789525, cosine=-0.0441, sine=-0.05124)


def three_axes() -> Robot:
    return moving_robot(load_robot("irp6"), Task("irp6"))


def symbols() -> tuple[ca.SX, ca.SX, ca.SX]:
    return tuple(ca.SX.sym(letter, 3) for letter in ("q", "dq", "ddq"))


def energies(q: ca.SX, dq: ca.SX) -> tuple[list[ca.SX], list[ca.SX]]:
    """Kinetic and potential energy per parameter X1 ... X7: the table's d_1 ... d_7, parted."""
    q2, q3, w1, w2, w3 = q[1], q[2], dq[0], dq[1], dq[2]
    kinetic = [
        w1**2 / 2,
        w1**2 * ca.sin(q2) ** 2 / 2,
        w2**2 / 2,
        w3**2 / 2 + w2 * w3,
        -(ca.sin(q3) ** 2 * ca.cos(2 * q2) + ca.sin(2 * q2) * ca.sin(2 * q3) / 2) * w1**2 / 2,
        L2 * ca.sin(q3) * (w2 + w3) * w2 - L2 * ca.sin(q2) * ca.cos(q2 + q3) * w1**2,
        ca.SX(0),
    ]
    potential = [*[ca.SX(0)] * 5, G * ca.sin(q2 + q3), G * ca.cos(q2)]
    return kinetic, potential


def dissipated(dq: ca.SX) -> list[ca.SX]:
    """Integrands of d_8 ... d_13: power lost to friction per parameter."""
    dz = [dq[0], dq[1], dq[1] + dq[2]]
    return [*(ca.fabs(w) for w in dz), *(w**2 for w in dz)]


def table_regressor() -> ca.Function:
    """Torques per parameter: Lagrange's equation for X1 ... X7, Rayleigh's dissipation function for friction."""
    q, dq, ddq = symbols()
    columns = []
    for T, V in zip(*energies(q, dq), strict=True):
        momentum = ca.gradient(T, dq)
        rate = ca.jtimes(momentum, q, dq) + ca.jtimes(momentum, dq, ddq)
        columns.append(rate - ca.gradient(T, q) + ca.gradient(V, q))
    power = dissipated(dq)
    columns += [ca.gradient(P, dq) for P in power[:3]]  # tau = d|dz|/d(dq): P is homogeneous of degree one
    columns += [ca.gradient(P, dq) / 2 for P in power[3:]]
    return ca.Function("table", [q, dq, ddq], [ca.densify(ca.horzcat(*columns))])


def stacked(function: ca.Function, states: Samples) -> Array:
    return np.vstack([np.array(function(*state)) for state in zip(states.q, states.dq, states.ddq, strict=True)])


def test_default_form_has_the_papers_thirteen_parameters() -> None:
    model = DifferentialModel(three_axes())
    assert model.names == NAMES
    assert [c.unit for c in model.columns] == [
        *["kg m^2"] * 5, *["kg m"] * 2, *["Nm"] * 3, *["Nm s/rad"] * 3
    ]  # fmt: skip
    assert model.row_labels == (("q1", "Nm"), ("q2", "Nm"), ("q3", "Nm"))


def test_regressor_is_the_lagrangian_derivative_of_the_corrected_table() -> None:
    model = DifferentialModel(three_axes())
    states = random_states(model.robot, 200, seed=1)
    W, expected = model.assemble(states), stacked(table_regressor(), states)
    assert np.abs(W - expected).max() <= 1e-12 * np.abs(expected).max()
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_array_less(np.abs(W - expected).max(axis=0), 1e-12 * np.maximum(scale, 1.0))


def test_power_of_each_column_is_the_rate_of_its_energy() -> None:
    """[KD96]: ``dH/dt = tau . dq`` with ``H = sum X_i d_i``, friction's d_i being integrals of what it takes."""
    q, dq, ddq = symbols()
    kinetic, potential = energies(q, dq)
    H = ca.vertcat(*(T + V for T, V in zip(kinetic, potential, strict=True)))
    rate = ca.vertcat(ca.jtimes(H, q, dq) + ca.jtimes(H, dq, ddq), *dissipated(dq))
    power = ca.Function("power", [q, dq, ddq], [rate])
    model = DifferentialModel(three_axes())
    states = random_states(model.robot, 100, seed=2)
    W = model.assemble(states).reshape(100, 3, 13)
    found = np.einsum("ni,nip->np", states.dq, W)
    np.testing.assert_allclose(found, stacked(power, states).reshape(100, 13), rtol=1e-11, atol=1e-11)


def test_the_two_forms_of_d5_are_one() -> None:
    q2, q3 = np.random.default_rng(0).uniform(-2, 2, (2, 50))
    printed = -(np.sin(q3) ** 2 * np.cos(2 * q2) + np.sin(2 * q2) * np.sin(2 * q3) / 2)
    np.testing.assert_allclose(printed, np.sin(q2) ** 2 - np.sin(q2 + q3) ** 2, atol=1e-14)


def test_parameters_are_those_combinations_of_standard_ones() -> None:
    definition, standard = DifferentialModel(three_axes()).definition()
    for row, terms in zip(definition, AGGREGATES.values(), strict=False):
        found = {name: value for name, value in zip(standard, row, strict=True) if value != 0.0}
        assert found == pytest.approx(terms, rel=1e-12)
    for row, name in zip(definition[7:], NAMES[7:], strict=True):
        assert {standard[k]: row[k] for k in np.flatnonzero(row)} == {name: 1.0}


def test_values_of_the_parameters_are_the_published_ones() -> None:
    """X_3dof of shared/facts/irp6.yaml; X7 = 8.125 kg m and X3 - X4 = 5.5 kg m^2 were measured [KD96]."""
    robot = three_axes()
    model = DifferentialModel(robot, MASSES)
    definition, standard = model.definition()
    assert robot.transmission is not None
    rotors = [d.rotor_inertia for d in robot.transmission.drives[:3]]
    values = np.concatenate([*(link.theta for link in robot.links), rotors])
    assert standard[30:] == ("Ia1", "Ia2", "Ia3")
    X = definition @ values
    np.testing.assert_allclose(X, [5.5368, 1.2590, 9.7435, 4.2437, 2.0223, 0.59, 8.125], atol=1e-4)
    assert X[2] - X[3] == pytest.approx(5.5, abs=6e-4)


def test_general_machinery_finds_the_same_seven_inertial_parameters() -> None:
    """Without the named combinations, from the zeros alone: base parameters and X1 ... X7 span the same functions."""
    robot = three_axes()
    plain = robot.replace(structure=Structure(zero=robot.structure.zero))
    model = DifferentialModel(plain, MASSES)
    base = base_parameters(model)
    assert base.rank == 7
    assert base.gap > 1e8
    assert not set(base.names) & set(AGGREGATES)
    definition, standard = model.definition()
    beta = base.D @ definition
    X = np.array([[terms.get(name, 0.0) for name in standard] for terms in AGGREGATES.values()])
    X, beta = (rows / np.linalg.norm(rows, axis=1)[:, None] for rows in (X, beta))
    for these, those in ((X, beta), (beta, X)):
        mixed = np.linalg.lstsq(those.T, these.T, rcond=None)[0]
        np.testing.assert_allclose(those.T @ mixed, these.T, atol=1e-9)


def test_torques_by_the_thirteen_are_those_by_standard_parameters() -> None:
    robot = three_axes()
    model = DifferentialModel(robot)
    plain = DifferentialModel(robot.replace(structure=Structure()), Terms(reflected=False))
    definition, standard = model.definition()
    assert standard == plain.names
    rng = np.random.default_rng(4)
    known = np.array([0.0 if name in robot.structure.zero else rng.normal() for name in standard])
    states = random_states(robot, 50, seed=3)
    expected = plain.assemble(states) @ known
    found = model.assemble(states) @ (definition @ known)
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


# --- how many parameters there are: base_parameter_counts of shared/facts/irp6.yaml, and ranks of errata.md ----------
# Counts with the bodies of a parallelogram are those of a robot with branches: test_branches.py.


def general(robot: Robot) -> Robot:
    return robot.replace(structure=Structure())


def on_joint_rates(robot: Robot) -> Robot:
    """Rotors that turn with the joints instead of the drive coordinates."""
    old = robot.transmission
    assert old is not None
    n = robot.n
    return robot.replace(transmission=Transmission(np.eye(n), old.drives[:n], old.limits.take(range(n))))


def with_screws(robot: Robot) -> Robot:
    old = robot.transmission
    assert old is not None
    screws = {1: ARM_SCREW, 2: FOREARM_SCREW}
    drives = tuple(dataclasses.replace(d, ratio=screws.get(k, d.ratio)) for k, d in enumerate(old.drives))
    return robot.replace(transmission=dataclasses.replace(old, drives=drives))


FRICTION = Terms(rotor=False)
COUNTS = {
    "serial": (general, INERTIAL, 15, 29),
    "serial_Fc_Fv": (general, FRICTION, 21, 39),
    "serial_Ia_on_joint_rates": (lambda robot: on_joint_rates(general(robot)), MASSES, 16, 32),
    "Ia_on_motor_coords_const_ratio": (general, MASSES, 15, 30),
    "Ia_on_motor_coords_screw_ratio": (lambda robot: with_screws(general(robot)), MASSES, 17, 32),
}


@pytest.mark.parametrize("count", COUNTS.values(), ids=COUNTS.keys())
def test_number_of_base_parameters_of_general_links(count: tuple) -> None:
    change, terms, three, five = count
    robot = load_robot("irp6")
    for axes, expected in ((3, three), (5, five)):
        base = base_parameters(DifferentialModel(change(with_locked_joints(robot, range(axes))), terms))
        assert base.rank == expected
        assert base.gap > 1e6


def test_number_of_base_parameters_of_the_papers_symmetric_links() -> None:
    robot = three_axes()
    for structure in (robot.structure, Structure(zero=robot.structure.zero)):
        known = robot.replace(structure=structure)
        assert base_parameters(DifferentialModel(known, MASSES)).rank == 7
        assert base_parameters(DifferentialModel(known)).rank == 13


# Angle of the axis [deg] to |ratio|: ratio_table_deg of shared/facts/irp6.yaml.
RATIOS = {
    "arm": (
        ARM_SCREW,
        {-40: 133.9, -30: 147.1, -20: 158.5, -10: 167.5, 0: 173.7, 10: 175.9, 20: 172.7, 30: 161.2, 40: 136.9},
    ),
    "forearm": (
        FOREARM_SCREW,
        {-40: 153.0, -30: 163.3, -20: 171.0, -10: 175.4, 0: 175.1, 10: 168.2, 20: 151.0, 25: 136.9},
    ),
}


@pytest.mark.parametrize("screw", RATIOS.values(), ids=RATIOS.keys())
def test_ball_screws_have_the_published_ratios(screw: tuple[BallScrew, dict[int, float]]) -> None:
    gear, table = screw
    z = ca.SX.sym("z")
    ratio = ca.Function("ratio", [z], [gear.ratio(z)])
    for degrees, expected in table.items():
        assert abs(float(ratio(np.deg2rad(degrees)))) == pytest.approx(expected, abs=0.051)


JOINTS = {(0, 1, 2): 13, (0, 1): 10, (0, 2): 8, (1, 2): 8, (2,): 4}


@pytest.mark.parametrize("joints", JOINTS, ids=lambda joints: "".join(str(k + 1) for k in joints))
def test_rank_of_the_joints_that_move(joints: tuple[int, ...]) -> None:
    """The others are held, so the arm and a resting forearm are one body."""
    assert base_parameters(DifferentialModel(with_locked_joints(three_axes(), joints))).rank == JOINTS[joints]


# Motor 2 alone keeps the forearm's orientation, dq3 = -dq2. With z3 held at one value, X5 of motors 1 and 2 cannot be
# told from X1 and X2: they show 9, not the 10 of the joints 1 and 2.
MOTORS = {(0, 1, 2): 13, (1,): 4, (2,): 4, (0, 2): 8, (1, 2): 8, (0, 1): 9}


@pytest.mark.parametrize("motors", MOTORS, ids=lambda motors: "".join(str(k + 1) for k in motors))
def test_rank_seen_by_the_motors_that_move(motors: tuple[int, ...]) -> None:
    """The others stand; what each moving motor feels is ``tau_z = C^-T tau_q``."""
    robot = three_axes()
    assert robot.transmission is not None
    C = robot.transmission.coupling[:3]
    held = np.setdiff1d(range(3), motors)
    states = random_states(robot, 300, seed=5)
    moved = []
    for motion, stand in ((states.q, 0.2), (states.dq, 0.0), (states.ddq, 0.0)):
        z = motion @ C.T
        z[:, held] = stand
        moved.append(z @ np.linalg.inv(C).T)
    W = DifferentialModel(robot).assemble(Samples(states.time, *moved, states.dddq)).reshape(300, 3, 13)
    felt = np.einsum("ij,njp->nip", np.linalg.inv(C).T, W)[:, motors].reshape(-1, 13)
    sigma = np.linalg.svd(felt, compute_uv=False)
    assert int((sigma > 1e-10 * sigma[0]).sum()) == MOTORS[motors]
