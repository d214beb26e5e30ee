"""The energy-integral model: energies against Pinocchio, laws of mechanics, windows, and friction's integrals."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cache
from itertools import pairwise

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import Polynomials, gauss, order_of, path_of_polynomial, random_sines
from pinocchio_chains import chain_model
from public_arms import ARMS, Arm, reference
from slow_dynamics import driven_chain, energy, random_chain, thetas_of

from excite.information.target import moving_robot
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.models.base import base_parameters, random_states
from regressors.models.columns import Terms
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.windows import Window, WindowModel
from regressors.readers.library import built_in
from regressors.readers.urdf import read_urdf
from regressors.robot.gears import BallScrew, ConstantRatio
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Drive, Limits, Robot, Structure, Transmission
from regressors.samples import Array, Samples

INERTIAL = Terms.inertial_only()
MASSES = Terms(coulomb=False, viscous=False)
EVERYTHING = Terms(offset=True)
KINDS = st.text(alphabet="rp", min_size=1, max_size=4)
SEED = st.integers(0, 2**32 - 1)
SCREW = BallScrew(pitch=0.005, square=0.0779, cosine=-0.0293, sine=-0.0609)
CHOSEN = ("panda-hand", "ur10", "kinova", "tiago-torso-arm", "pr2-torso-right", "talos-right-arm")  # two with sliders
PUBLIC = [arm for arm in ARMS if arm.id in CHOSEN]


@cache
def three_axes() -> Robot:
    """The IRp-6 in the paper's 13 parameters."""
    return moving_robot(built_in("irp6"), Task("irp6"))


def general(robot: Robot) -> Robot:
    return robot.replace(structure=Structure())


def with_screws(robot: Robot) -> Robot:
    old = robot.transmission
    assert old is not None
    drives = tuple(dataclasses.replace(d, ratio=SCREW if k in (1, 2) else d.ratio) for k, d in enumerate(old.drives))
    return robot.replace(transmission=dataclasses.replace(old, drives=drives))


ROBOTS: dict[str, Callable[[], Robot]] = {
    "irp6-13": three_axes,
    "irp6-five": lambda: built_in("irp6"),
    "irp6-five-general": lambda: general(built_in("irp6")),
    "irp6-full": lambda: built_in("irp6-full"),  # true screws, bars of the parallelogram beside the chain
    "irp6-screws": lambda: with_screws(general(three_axes())),
    "panda": lambda: built_in("panda"),
    "sliders": lambda: random_chain("rprp", np.random.default_rng(0)),
    "coupled": lambda: driven_chain([ConstantRatio(-80.0), SCREW, SCREW], np.random.default_rng(1), "rpr"),
}


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return ROBOTS[request.param]()


def energies(model: EnergyModel, q: Array, dq: Array) -> Array:
    """Energy per parameter at some states, shape (N, p)."""
    symbols = [ca.SX.sym(name, model.robot.n) for name in ("q", "dq")]
    function = ca.Function("h", symbols, [ca.densify(model.state(*symbols))])
    return np.vstack([np.array(function(*state)) for state in zip(q, dq, strict=True)])


def columns(model: WindowModel, *names: str) -> list[int]:
    return [model.names.index(name) for name in names]


# --- laws ------------------------------------------------------------------------------------------------------------


def assert_rate_is_power(robot: Robot, states: Samples) -> None:
    rate = EnergyModel(robot, EVERYTHING).instants(states)
    Y = DifferentialModel(robot, EVERYTHING).instants(states).reshape(states.time.size, robot.n, -1)
    parts = np.abs(states.dq[:, :, None] * Y).sum(axis=1).max(axis=0)
    error = np.abs(rate - np.einsum("ni,nip->np", states.dq, Y)).max(axis=0)
    assert np.all(error <= 1e-12 * parts + 1e-15 * parts.max())  # some columns vanish but for rounding


def test_rate_of_the_energy_is_the_power_of_the_torques(robot: Robot) -> None:
    """``dh/dt theta = dq' Y theta``, and what friction takes is ``dq' tau_f``, column by column [KD96] eq. (19)."""
    assert_rate_is_power(robot, random_states(robot, 200, seed=1))


@pytest.mark.parametrize("arm", PUBLIC, ids=str)
def test_rate_of_the_energy_is_the_power_of_the_torques_of_public_robots(arm: Arm) -> None:
    robot = read_urdf(arm.path, base=arm.base, tip=arm.tip)
    assert_rate_is_power(robot, random_states(robot, 20, seed=2))


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=25)
def test_rate_of_the_energy_is_the_power_of_the_torques_of_any_chain(kinds: str, seed: int) -> None:
    robot = random_chain(kinds, np.random.default_rng(seed))
    assert_rate_is_power(robot, random_states(robot, 10, seed=seed))


def test_rate_is_the_derivative_of_the_state_in_time(robot: Robot) -> None:
    """By central differences of eighth order, along ``q + t dq + t^2/2 ddq``."""
    model = EnergyModel(robot, EVERYTHING)
    states = random_states(robot, 5, seed=3)
    q, dq, ddq = states.q, states.dq, states.ddq
    h, total = 4e-3, 0.0
    for k, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), 1):
        ahead, behind = (energies(model, q + t * dq + t**2 * ddq / 2, dq + t * ddq) for t in (k * h, -k * h))
        total = total + weight / h * (ahead - behind)
    lost = model.instants(states) - total
    friction = [k for k, c in enumerate(model.columns) if c.group == "friction" and not c.name.endswith("o")]
    scale = np.abs(model.instants(states)).max()
    kept = np.setdiff1d(np.arange(len(model.columns)), friction)
    np.testing.assert_allclose(lost[:, kept], 0.0, atol=1e-10 * scale)
    assert np.all(lost[:, friction] >= 0.0)  # friction only takes


# --- energies --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arm", PUBLIC, ids=str)
def test_energy_is_pinocchios_up_to_a_constant(arm: Arm) -> None:
    """The constant is the choice of height zero: the same in every state, and seen by no window."""
    expected, robot = reference(arm), read_urdf(arm.path, base=arm.base, tip=arm.tip)
    data = expected.model.createData()
    rows = [expected.joint(name).idx_v for name in robot.joint_names]
    theta = np.concatenate([expected.theta(name) for name in robot.joint_names])
    q, dq = np.random.default_rng(4).uniform(-2.0, 2.0, (2, 6, robot.n))
    q[0], dq[0] = 0.0, 0.0
    theirs = []
    for position, rate in zip(q, dq, strict=True):
        configuration = expected.configuration(dict(zip(robot.joint_names, position, strict=True)))
        v = np.zeros(robot.n)
        v[rows] = rate
        kinetic = pin.computeKineticEnergy(expected.model, data, configuration, v)
        theirs.append(kinetic + pin.computePotentialEnergy(expected.model, data, configuration))
    ours = energies(EnergyModel(robot, INERTIAL), q, dq) @ theta
    difference = ours - np.array(theirs)
    np.testing.assert_allclose(difference, difference[0], atol=1e-11 * np.abs(theirs).max())
    still = energies(EnergyModel(robot.replace(gravity=np.zeros(3)), INERTIAL), q, dq) @ theta
    potential = energies(EnergyModel(robot, INERTIAL), q, 0 * dq) @ theta
    np.testing.assert_allclose(still + potential, ours, atol=1e-11 * np.abs(ours).max())


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=25)
def test_energy_per_parameter_is_that_of_any_mass_distribution(kinds: str, seed: int) -> None:
    """Against traces of homogeneous matrices; parameters need not be those of a body."""
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng)
    q, dq = rng.uniform(-2.0, 2.0, (2, 3, robot.n))
    thetas = rng.normal(size=(robot.n, 10))
    expected = [float(np.real(energy(robot, thetas, *state))) for state in zip(q, dq, strict=True)]
    h = energies(EnergyModel(robot, INERTIAL), q, dq)
    np.testing.assert_allclose(h @ thetas.ravel(), expected, atol=1e-12 * (np.abs(h) @ np.abs(thetas).ravel()).max())


def screw_angle(z: Array) -> Array:
    """Motor angle of `SCREW`, written out."""
    return 2 * np.pi / 0.005 * np.sqrt(0.0779 - 0.0293 * np.cos(z) - 0.0609 * np.sin(z))


GEARS = {
    "constant": (ConstantRatio(120.0), lambda z: 120.0 * z),
    "reversed": (ConstantRatio(-77.5), lambda z: -77.5 * z),
    "screw": (SCREW, screw_angle),
}


@pytest.mark.parametrize("name", GEARS)
def test_energy_of_the_rotors(name: str) -> None:
    """``1/2 (d/dt F(z))^2`` per unit inertia, the motor's speed from F itself by the complex step."""
    gear, angle = GEARS[name]
    rng = np.random.default_rng(5)
    robot = driven_chain([gear] * 3, rng)
    assert robot.transmission is not None
    q, dq = rng.uniform(-0.4, 0.4, (2, 8, 3))
    z, dz = q @ robot.transmission.coupling.T + robot.transmission.offset, dq @ robot.transmission.coupling.T
    speed = np.imag(angle(z + 1e-30j * dz)) / 1e-30
    model = EnergyModel(robot, Terms(reflected=False))
    found = energies(model, q, dq)[:, columns(model, "Ia1", "Ia2", "Ia3")]
    np.testing.assert_allclose(found, speed**2 / 2, rtol=1e-12)


def test_columns_are_those_of_the_differential_model(robot: Robot) -> None:
    for terms in (Terms(), EVERYTHING, INERTIAL, Terms(rotor=False, coulomb=False), Terms(viscous=False)):
        ours, theirs = EnergyModel(robot, terms), DifferentialModel(robot, terms)
        assert ours.columns == theirs.columns
        assert ours.row_labels == (("work", "J"),)
        for one, other in zip(ours.definition(), theirs.definition(), strict=True):
            np.testing.assert_array_equal(one, other)
        assert ours.instants(random_states(robot, 2)).shape == (2, len(theirs.columns))


# --- windows ---------------------------------------------------------------------------------------------------------


def test_sum_of_joined_short_windows_is_the_long_one(robot: Robot) -> None:
    motion, time = random_sines(robot.n, 6), np.linspace(0.0, 1.2, 121)
    samples = motion.samples(time)
    long = EnergyModel(robot, EVERYTHING, Window("long")).assemble(samples)
    for length in (0.01, 0.03, 0.08):
        count = round(length / 0.01)
        short = EnergyModel(robot, EVERYTHING, Window("short", length)).assemble(samples)
        assert short.shape == (120 // count, long.shape[1])
        scale = np.abs(long).max(axis=0)
        assert np.all(np.abs(np.cumsum(short, axis=0) - long[count - 1 :: count]) <= 1e-11 * np.maximum(scale, 1.0))


@pytest.mark.parametrize("step", [1, 3, 7, 20])
def test_windows_may_overlap_or_leave_gaps(step: int) -> None:
    """Each row is the change from the start of its own window to its end, whatever the next window is."""
    robot, time = three_axes(), np.linspace(0.0, 1.0, 101)
    samples = random_sines(3, 7).samples(time)
    long = np.vstack([np.zeros(13), EnergyModel(robot, window=Window("long")).assemble(samples)])
    W = EnergyModel(robot, window=Window("short", 0.07, 0.01 * step)).assemble(samples)
    starts = np.arange(0, 94, step)
    np.testing.assert_allclose(W, long[starts + 7] - long[starts], atol=1e-11)


def test_a_window_is_the_change_of_energy_and_what_friction_took(robot: Robot) -> None:
    """Windows of two samples and more, against energies at their ends and Gauss quadrature of |dz| and dz^2."""
    motion, time = random_sines(robot.n, 8, waves=2), np.linspace(0.0, 1.0, 401)
    model = EnergyModel(robot, Terms(), Window("short", 0.1))
    W = model.assemble(motion.samples(time))
    h = energies(model, motion.at(time[::40], 0), motion.at(time[::40], 1))
    friction = np.array([c.group == "friction" for c in model.columns])
    np.testing.assert_allclose(W[:, ~friction], np.diff(h, axis=0)[:, ~friction], atol=1e-10 * np.abs(h).max())
    viscous = [k for k, name in enumerate(model.names) if name.endswith("v") and friction[k]]
    C = couplings(robot)
    power = [gauss(lambda t: (motion.at(t, 1) @ C.T) ** 2, t, t + 0.1) for t in time[:-1:40]]
    np.testing.assert_allclose(W[:, viscous], power, rtol=1e-5, atol=1e-7)


def couplings(robot: Robot) -> Array:
    """Rows of C of the drives whose joints move."""
    if robot.transmission is None:
        return np.eye(robot.n)
    return robot.transmission.coupling[[k for k, d in enumerate(robot.transmission.drives) if not d.rests]]


@pytest.mark.parametrize(
    "window", [Window("short", 0.05), Window("short", 0.2), Window("short", 0.2, 0.05), Window("long")], ids=str
)
def test_quadrature_converges_at_its_order_and_energies_are_exact(window: Window) -> None:
    """Simpson's rule: order 4 for int dz^2; what is a difference of energies does not depend on the sampling."""
    robot = three_axes()
    motion, model = random_sines(3, 9), EnergyModel(robot, window=window)
    viscous, C = columns(model, "F1v", "F2v", "F3v"), couplings(robot)
    found, errors = [], []
    for finer in (1, 2, 4, 8):
        time = np.linspace(0.0, 2.0, 40 * finer + 1)
        first, last = window.ends(time)
        common = (first % finer == 0) & (last % finer == 0)
        W = model.assemble(motion.samples(time))[common]
        ends = zip(time[first[common]], time[last[common]], strict=True)
        exact = np.array([gauss(lambda t: (motion.at(t, 1) @ C.T) ** 2, *pair, 4) for pair in ends])
        errors.append(float(np.abs(W[:, viscous] - exact).max()))
        found.append(W[:, :7])
    for W in found[1:]:
        np.testing.assert_allclose(W, found[0], atol=1e-12 * np.abs(found[0]).max())
    assert min(order_of(errors)) >= 3.5
    assert errors[-1] < 1e-5


def test_default_window_is_the_papers() -> None:
    """Joined short windows of 5 ms [KD96] section 5."""
    model = EnergyModel(three_axes())
    assert model.window == Window("short", 0.005, None)
    time = model.times(0.05, 2000.0)
    first, last = model.window.ends(time)
    np.testing.assert_allclose(time[first], 0.005 * np.arange(10), atol=1e-15)
    np.testing.assert_allclose(time[last], 0.005 * np.arange(1, 11), atol=1e-15)


# --- Coulomb friction: the length of the drives' paths, see also test_path_lengths.py --------------------------------


@pytest.mark.parametrize("samples", [4, 11, 26])
def test_coulomb_columns_are_exact_also_where_a_drive_turns_inside_a_window(samples: int) -> None:
    """Drive 3 follows q2 + q3. The motion is a cubic of time in every joint, so coarse sampling is no excuse."""
    cubics = np.array([[0.1, -0.2, 0.3], [-0.5, 0.4, 0.3], [0.2, -1.0, 0.1], [0.35, 0.6, 0.5]])
    motion, robot = Polynomials(cubics), three_axes()
    time = np.linspace(0.0, 1.5, samples)
    model = EnergyModel(robot, window=Window("short", float(time[1])))
    W = model.assemble(motion.samples(time))[:, columns(model, "F1c", "F2c", "F3c")]
    drives = cubics @ np.array([[1, 0, 0], [0, 1, 1], [0, 0, 1]])
    expected = [[path_of_polynomial(z, a, b) for z in drives.T] for a, b in pairwise(time)]
    turning = np.array(expected) - np.abs(np.diff(motion.at(time, 0) @ couplings(robot).T, axis=0))
    assert np.count_nonzero(turning > 1e-6) >= 3  # some windows do hold a turning point
    np.testing.assert_allclose(W, expected, atol=1e-13)


def test_coulomb_columns_where_the_structure_joins_or_drops_them() -> None:
    """Two drives of equal Coulomb friction share the sum of their paths; a drive without any has no column."""
    robot = three_axes()
    joined = robot.replace(structure=Structure(zero=frozenset({"F2c"}), equal=(("F1c", "F3c"),)))
    samples = random_sines(3, 10).samples(np.linspace(0.0, 1.0, 51))
    each, model = (EnergyModel(r, window=Window("short", 0.04)) for r in (robot, joined))
    assert [name for name in model.names if name.endswith("c")] == ["F1c"]
    W = each.assemble(samples)[:, columns(each, "F1c", "F3c")]
    found = model.assemble(samples)[:, columns(model, "F1c")]
    np.testing.assert_allclose(found, W.sum(axis=1, keepdims=True), rtol=1e-13)


def test_soft_sign_is_integrated_as_such_and_tends_to_the_exact_one() -> None:
    robot, motion = three_axes(), random_sines(3, 11)
    time = np.linspace(0.0, 1.0, 401)
    names = ("F1c", "F2c", "F3c")
    soft = EnergyModel(robot, window=Window("long"), sign_width=0.5)
    found = soft.assemble(motion.samples(time))[-1, columns(soft, *names)]
    C = couplings(robot)

    def power(t: Array) -> Array:
        dz = motion.at(t, 1) @ C.T
        return dz * np.tanh(dz / 0.5)

    np.testing.assert_allclose(found, gauss(power, 0.0, 1.0, 50), rtol=1e-7)
    exact = EnergyModel(robot, window=Window("long")).assemble(motion.samples(time))[-1, columns(soft, *names)]
    sharp = EnergyModel(robot, window=Window("long"), sign_width=1e-3).assemble(motion.samples(time))
    np.testing.assert_allclose(sharp[-1, columns(soft, *names)], exact, atol=1e-4)


# --- right side ------------------------------------------------------------------------------------------------------


def parameters(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Links' parameters, rotor inertias of the motors, Coulomb and viscous friction of a robot."""
    assert robot.transmission is not None
    drives = [d for d in robot.transmission.drives if not d.rests]
    rotor = np.array([d.rotor_inertia or 0.0 for d in drives])
    coulomb, viscous = rng.uniform(1.0, 30.0, (2, len(drives)))
    return thetas_of(robot).ravel(), rotor, coulomb, viscous


def torques(robot: Robot, samples: Samples, rotor: Array, coulomb: Array, viscous: Array) -> Array:
    """Inverse dynamics of Pinocchio, with reflected rotors of constant ratio and friction on the drives' side."""
    model = chain_model(robot)
    data, C = model.createData(), couplings(robot)
    assert robot.transmission is not None
    ratios = np.array([d.ratio.value for d in robot.transmission.drives if not d.rests])
    links = [pin.rnea(model, data, *state) for state in zip(samples.q, samples.dq, samples.ddq, strict=True)]
    dz, ddz = samples.dq @ C.T, samples.ddq @ C.T
    return np.array(links) + (rotor * ratios**2 * ddz + coulomb * np.sign(dz) + viscous * dz) @ C


def driven(name: str) -> Robot:
    robot = general(built_in(name))
    if robot.transmission is None or any(d.rotor_inertia is None for d in robot.transmission.drives):
        drives = tuple(Drive(f"d{k}", ConstantRatio(50.0), rotor_inertia=1e-4) for k in range(robot.n))
        robot = robot.replace(transmission=Transmission(np.eye(robot.n), drives, Limits.none(robot.n)))
    return robot


@pytest.mark.parametrize("window", [Window("short", 0.08), Window("short", 0.08, 0.04), Window("long")])
@pytest.mark.parametrize("name", ["irp6", "panda"])
def test_work_of_the_torques_is_what_the_parameters_explain(name: str, window: Window) -> None:
    """``y = W theta`` for torques of Pinocchio, up to the quadrature of tau' dq, which converges at order 4."""
    robot = driven(name)
    theta, rotor, _, viscous = parameters(robot, np.random.default_rng(12))
    model = EnergyModel(robot, Terms(coulomb=False, reflected=False), window)
    known = np.concatenate([theta, rotor, viscous])
    motion, errors, sizes = random_sines(robot.n, 13), [], []
    for count in (50, 100, 200):
        samples = motion.samples(np.linspace(0.0, 2.0, count + 1))
        y = model.right_side(samples, torques(robot, samples, rotor, 0.0 * rotor, viscous))
        W = model.assemble(samples)
        assert y.shape == (W.shape[0],)
        errors.append(float(np.abs(W @ known - y).max()))
        sizes.append(float(np.abs(y).max()))
    assert min(order_of(errors)) >= 3.5
    assert errors[-1] < 1e-4 * sizes[-1]


@pytest.mark.parametrize("name", ["irp6", "panda"])
def test_measured_coulomb_friction_costs_no_more_than_the_corners_of_its_power(name: str) -> None:
    """A corner of |dz| at a sign change costs Simpson's rule at most ``Fc |ddz| h^2``; W itself has the exact path."""
    robot = driven(name)
    theta, rotor, coulomb, viscous = parameters(robot, np.random.default_rng(14))
    model = EnergyModel(robot, Terms(reflected=False), Window("long"))
    known = np.concatenate([theta, rotor, coulomb, viscous])
    motion, C = random_sines(robot.n, 15), couplings(robot)
    for count in (400, 800, 1600):
        samples = motion.samples(np.linspace(0.0, 2.0, count + 1))
        y = model.right_side(samples, torques(robot, samples, rotor, coulomb, viscous))
        changes = np.abs(np.diff(np.sign(samples.dq @ C.T), axis=0)).sum(axis=0) / 2
        steepest = np.abs(samples.ddq @ C.T).max(axis=0)
        corners = float(np.sum(coulomb * steepest * changes)) * samples.time[1] ** 2
        error = float(np.abs(model.assemble(samples) @ known - y).max())
        assert error <= corners
    assert corners < 2e-3 * np.abs(y).max()


# --- no acceleration -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("window", [Window("short", 0.04), Window("long")])
def test_no_acceleration_is_used(robot: Robot, window: Window) -> None:
    samples = random_sines(robot.n, 16).samples(np.linspace(0.0, 0.8, 41))
    unknown = np.full_like(samples.q, np.nan)
    blind = Samples(samples.time, samples.q, samples.dq, unknown, unknown)
    for width in (0.0, 0.05):
        model = EnergyModel(robot, EVERYTHING, window, sign_width=width)
        np.testing.assert_array_equal(model.assemble(blind), model.assemble(samples))
        tau = np.sin(samples.q)
        np.testing.assert_array_equal(model.right_side(blind, tau), model.right_side(samples, tau))


# --- bad input -------------------------------------------------------------------------------------------------------

BAD_WINDOWS = {
    "shorter than a sample": (Window("short", 0.005), "window length 0.005 s is shorter than the sample time 0.01 s"),
    "no multiple": (Window("short", 0.025), "window length 0.025 s is not a whole number of samples of 0.01 s"),
    "longer than the motion": (Window("short", 1.01), "a window of 1.01 s is longer than the motion of 1 s"),
    "step shorter": (Window("short", 0.05, 0.001), "window step 0.001 s is shorter than the sample time 0.01 s"),
    "step no multiple": (Window("short", 0.05, 0.015), "window step 0.015 s is not a whole number of samples"),
}  # fmt: skip


@pytest.mark.parametrize(("window", "message"), BAD_WINDOWS.values(), ids=BAD_WINDOWS.keys())
def test_windows_that_do_not_fit_the_samples(window: Window, message: str) -> None:
    model = EnergyModel(three_axes(), window=window)
    samples = random_sines(3, 17).samples(np.linspace(0.0, 1.0, 101))
    for ask in (lambda: model.assemble(samples), lambda: model.right_side(samples, samples.q)):
        with pytest.raises(InputError) as error:
            ask()
        assert message in str(error.value)


def test_a_window_as_long_as_the_motion_is_one_row() -> None:
    samples = random_sines(3, 18).samples(np.linspace(0.0, 1.0, 101))
    W = EnergyModel(three_axes(), window=Window("short", 1.0)).assemble(samples)
    np.testing.assert_allclose(W, EnergyModel(three_axes(), window=Window("long")).assemble(samples)[-1:], rtol=1e-12)


@pytest.mark.parametrize("what", ["length", "step"])
@pytest.mark.parametrize("value", [-0.005, 0.0, np.nan, np.inf])
def test_windows_of_no_length(what: str, value: float) -> None:
    with pytest.raises(InputError, match=f"window {what} must be a positive number of seconds, given"):
        Window(**{what: value})


def test_windows_of_unknown_kind() -> None:
    with pytest.raises(UnknownName, match=r"no window named 'medium'; available: short, long"):
        Window("medium")


@pytest.mark.parametrize("window", [Window(), Window("long")])
def test_one_sample_is_no_motion(window: Window) -> None:
    """No window fits: an error that says so, or no row."""
    samples = random_sines(3, 19).samples(np.zeros(1))
    model = EnergyModel(three_axes(), window=window)
    if window.kind == "long":
        assert model.assemble(samples).shape == (0, 13)
        return
    with pytest.raises(InputError):
        model.assemble(samples)


# --- ranks -----------------------------------------------------------------------------------------------------------

RANKS = {
    "irp6, 13 parameters": (three_axes, Terms(), 13),
    "irp6, 3 general links": (lambda: general(three_axes()), INERTIAL, 15),
    "irp6, 5 general links": (lambda: general(built_in("irp6")), INERTIAL, 29),
    "irp6, 5 general links, friction": (lambda: general(built_in("irp6")), Terms(rotor=False), 39),
    "irp6, 5 general links, rotors": (lambda: general(built_in("irp6")), MASSES, 30),
    "irp6, 3 general links, screws": (lambda: with_screws(general(three_axes())), MASSES, 17),
    "irp6, 5 general links, screws": (lambda: with_screws(general(built_in("irp6"))), MASSES, 32),
    "irp6-full, 3 axes": (lambda: with_locked_joints(built_in("irp6-full"), range(3)), Terms(), 26),
    "irp6-full, 5 axes": (lambda: built_in("irp6-full"), Terms(), 45),
    "panda": (lambda: built_in("panda"), INERTIAL, 43),
    "panda, friction": (lambda: built_in("panda"), Terms(), 43 + 14),
    "ur10e, friction": (lambda: built_in("ur10e"), Terms(), 36 + 12),
    "sliders": (lambda: random_chain("rprp", np.random.default_rng(0)), Terms(), None),
}  # fmt: skip


@pytest.mark.parametrize("case", RANKS.values(), ids=RANKS.keys())
def test_base_parameters_are_those_of_the_differential_model(case: tuple) -> None:
    """Constants of H drop in the difference, so both see the same: base_parameter_counts of facts/irp6.yaml."""
    make, terms, rank = case
    robot = make()
    ours, theirs = base_parameters(EnergyModel(robot, terms)), base_parameters(DifferentialModel(robot, terms))
    assert ours.rank == theirs.rank == (rank or theirs.rank)
    assert ours.names == theirs.names
    assert ours.gap > 1e6
    np.testing.assert_allclose(ours.D, theirs.D, atol=1e-7)
    assert ours.expressions == theirs.expressions


@pytest.mark.parametrize("window", [Window("short", 0.05), Window("long")])
def test_windows_of_one_motion_show_the_base_parameters_and_no_more(window: Window) -> None:
    robot = with_locked_joints(general(built_in("irp6")), range(3))
    model = EnergyModel(robot, window=window)
    base = base_parameters(model)
    W = model.assemble(random_sines(3, 20, waves=5, size=0.8).samples(np.linspace(0.0, 8.0, 1601)))
    sigma = np.linalg.svd(W / np.maximum(np.linalg.norm(W, axis=0), 1e-9 * np.linalg.norm(W)), compute_uv=False)
    assert base.rank == 15 + 6
    assert sigma[base.rank - 1] > 1e5 * sigma[base.rank]


# --- instants for a design -------------------------------------------------------------------------------------------


@given(duration=st.floats(0.5, 20.0), rate=st.floats(20.0, 500.0), length=st.floats(0.002, 0.3))
@settings(max_examples=100)
def test_instants_of_short_windows_divide_them(duration: float, rate: float, length: float) -> None:
    """At least as many per second as asked for, two intervals or more per window, and windows join up to the end."""
    window = Window("short", length)
    time = EnergyModel(three_axes(), window=window).times(duration, rate)
    spacing = np.diff(time)
    np.testing.assert_allclose(spacing, spacing[0], rtol=1e-6)
    assert spacing[0] <= 1.0 / rate * (1 + 1e-6)
    parts = length / spacing[0]
    assert round(parts) >= 2
    assert parts == pytest.approx(round(parts), rel=1e-9)
    assert time[0] == 0.0
    assert time[-1] <= duration * (1 + 1e-9)
    assert duration - time[-1] <= spacing[0] * (1 + 1e-6)
    first, last = window.ends(time)
    np.testing.assert_allclose(time[last] - time[first], length, rtol=1e-9)
    np.testing.assert_array_equal(first[1:], last[:-1])
