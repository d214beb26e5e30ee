"""The energy-integral model: energies against Pinocchio, laws of mechanics, windows, lengths of drives' paths."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given, settings, strategies as st
from motions import Polynomials, Sines, gauss, order_of, path_of_polynomial, random_sines
from pinocchio_chains import chain_model
from public_arms import ARMS, Arm, reference
from slow_dynamics import driven_chain, general, random_chain, thetas_of, three_axes

from regressors.errors import InputError, UnknownName
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel, path_lengths
from regressors.models.windows import Window, WindowModel
from regressors.readers.library import built_in
from regressors.readers.urdf import read_urdf
from regressors.robot.columns import Terms
from regressors.robot.gears import BallScrew, ConstantRatio
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Drive, Limits, Robot, Transmission
from regressors.samples import Array, Samples

INERTIAL = Terms.inertial_only()
MASSES = Terms(coulomb=False, viscous=False)
EVERYTHING = Terms(offset=True)
SCREW = BallScrew(pitch=0.005, square=0.0779, cosine=-0.0293, sine=-0.0609)
CHOSEN = ("panda-hand", "tiago-torso-arm", "pr2-torso-right", "talos-right-arm")
PUBLIC = [arm for arm in ARMS if arm.id in CHOSEN]


def with_screws(robot: Robot) -> Robot:
    old = robot.transmission
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


def test_rate_of_the_energy_is_the_power_of_the_torques(robot: Robot) -> None:
    """``dh/dt theta = dq' Y theta``, and what friction takes is ``dq' tau_f``, column by column [KD96] eq. (19)."""
    states = random_states(robot, 200, seed=1)
    rate = EnergyModel(robot, EVERYTHING).instants(states)
    Y = DifferentialModel(robot, EVERYTHING).instants(states).reshape(states.time.size, robot.n, -1)
    parts = np.abs(states.dq[:, :, None] * Y).sum(axis=1).max(axis=0)
    error = np.abs(rate - np.einsum("ni,nip->np", states.dq, Y)).max(axis=0)
    assert np.all(error <= 1e-12 * parts + 1e-15 * parts.max())  # some columns vanish but for rounding


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


def test_columns_are_those_of_the_differential_model(robot: Robot) -> None:
    for terms in (Terms(), EVERYTHING, INERTIAL, Terms(rotor=False, coulomb=False), Terms(viscous=False)):
        ours, theirs = EnergyModel(robot, terms), DifferentialModel(robot, terms)
        assert ours.columns == theirs.columns
        assert ours.row_labels == (("work", "J"),)
        for one, other in zip(ours.definition(), theirs.definition(), strict=True):
            np.testing.assert_array_equal(one, other)
        assert ours.instants(random_states(robot, 2)).shape == (2, len(theirs.columns))


# --- windows ---------------------------------------------------------------------------------------------------------


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


# --- Coulomb friction: the length of the drives' paths --------------------------------


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
    drives = [d for d in robot.transmission.drives if not d.rests]
    rotor = np.array([d.rotor_inertia or 0.0 for d in drives])
    coulomb, viscous = rng.uniform(1.0, 30.0, (2, len(drives)))
    return thetas_of(robot).ravel(), rotor, coulomb, viscous


def torques(robot: Robot, samples: Samples, rotor: Array, coulomb: Array, viscous: Array) -> Array:
    """Inverse dynamics of Pinocchio, with reflected rotors of constant ratio and friction on the drives' side."""
    model = chain_model(robot)
    data, C = model.createData(), couplings(robot)
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


@pytest.mark.parametrize("what", ["length", "step"])
@pytest.mark.parametrize("value", [-0.005, 0.0, np.nan, np.inf])
def test_windows_of_no_length(what: str, value: float) -> None:
    with pytest.raises(InputError, match=f"window {what} must be a positive number of seconds, given"):
        Window(**{what: value})
    with pytest.raises(UnknownName, match=r"no window named 'medium'; available: short, long"):
        Window("medium")


# --- ranks -----------------------------------------------------------------------------------------------------------


def on_joint_rates(robot: Robot) -> Robot:
    """Rotors that turn with the joints instead of the drive coordinates."""
    old = robot.transmission
    n = robot.n
    return robot.replace(transmission=Transmission(np.eye(n), old.drives[:n], old.limits.take(range(n))))


RANKS = {
    "irp6, 13 parameters": (three_axes, Terms(), 13),
    "irp6, 3 general links": (lambda: general(three_axes()), INERTIAL, 15),
    "irp6, 3 general links, rotors": (lambda: general(three_axes()), MASSES, 15),
    "irp6, 3 general links, rotors on joints": (lambda: on_joint_rates(general(three_axes())), MASSES, 16),
    "irp6, 5 general links": (lambda: general(built_in("irp6")), INERTIAL, 29),
    "irp6, 5 general links, rotors": (lambda: general(built_in("irp6")), MASSES, 30),
    "irp6, 3 general links, screws": (lambda: with_screws(general(three_axes())), MASSES, 17),
    "irp6-full, 3 axes, rotors": (lambda: with_locked_joints(built_in("irp6-full"), range(3)), MASSES, 20),
    "irp6-full, 3 axes": (lambda: with_locked_joints(built_in("irp6-full"), range(3)), Terms(), 26),
    "irp6-full, 5 axes, rotors": (lambda: built_in("irp6-full"), MASSES, 35),
    "irp6-full, 5 axes": (lambda: built_in("irp6-full"), Terms(), 45),
    "panda": (lambda: built_in("panda"), INERTIAL, 43),
    "panda, friction": (lambda: built_in("panda"), Terms(), 43 + 14),
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


# --- instants for a design -------------------------------------------------------------------------------------------


@given(duration=st.floats(0.5, 20.0), rate=st.floats(20.0, 500.0), length=st.floats(0.002, 0.3))
@settings(max_examples=50)
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


COEFFICIENT = st.floats(-3.0, 3.0).map(lambda c: round(c, 3))
CUBIC = st.tuples(COEFFICIENT, COEFFICIENT, COEFFICIENT, COEFFICIENT)


def paths(motion: Polynomials | Sines, time: Array) -> Array:
    return path_lengths(time, motion.at(time, 0), motion.at(time, 1))


def assert_exact_path(cubic: tuple[float, ...], time: Array) -> None:
    found = paths(Polynomials(np.array(cubic)[:, None]), time)[:, 0]
    expected = [path_of_polynomial(np.array(cubic), time[0], t) for t in time]
    np.testing.assert_allclose(found, expected, atol=1e-12 * (1.0 + np.abs(cubic).max()))


@given(cubic=CUBIC, count=st.integers(2, 7))
@example(cubic=(0.0, 0.21, -0.5, 1 / 3), count=2)  # dz = (t - 0.3)(t - 0.7): there, back, and there again
@example(cubic=(0.0, 0.0, 0.25, -1 / 3), count=2)  # dz = t (1/2 - t): starts at rest, and turns before the next sample
@example(cubic=(0.0, 0.0, 0.0, 0.0), count=3)
@settings(max_examples=100)
def test_path_of_any_cubic_is_exact_however_coarse_the_sampling(cubic: tuple[float, ...], count: int) -> None:
    """Also where a drive turns twice between two samples, or leaves a rest and turns."""
    assert_exact_path(cubic, np.linspace(0.0, 1.0, count))


def path_of_sine(x: Array) -> Array:
    """``int_0^x |cos u| du`` in closed form."""
    halves = np.floor(x / np.pi + 0.5)
    return 2 * halves + np.sin(x - np.pi * halves)


@pytest.mark.parametrize("count", [9, 17, 40, 333])
def test_path_of_a_sine_is_as_good_as_its_cubics(count: int) -> None:
    """A cubic from positions and velocities is wrong by h^4/384 max|z''''| at most, twice per turning point."""
    size, frequency, phase = 0.7, 5.0, 0.4
    time = np.linspace(0.0, 3.0, count)
    motion = Sines(np.zeros(1), np.array([[size]]), np.array([frequency]), np.array([[phase]]))
    expected = size * (path_of_sine(frequency * time + phase) - path_of_sine(np.array(phase)))
    bound = 2 * (time[1] * frequency) ** 4 / 384 * size
    turns = np.floor((frequency * time + phase) / np.pi + 0.5)
    assert np.all(np.abs(paths(motion, time)[:, 0] - expected) <= bound * turns + 1e-13)
