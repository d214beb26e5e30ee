"""The load's integral model: K_I is the integral of K over windows, made without any acceleration."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from load_sensors import KINDS, ROBOTS, SEED, shifted
from motions import Sines, gauss, order_of, random_sines
from pinocchio_chains import chain_model, inertia
from scipy.integrate import quad_vec
from slow_dynamics import cross_matrix, pose_rates, poses, random_body, random_chain

from regressors.errors import InputError, UnknownName
from regressors.models.base import base_parameters, random_states
from regressors.models.load import EQUATIONS, LoadIntegralModel, LoadModel, Sensor
from regressors.models.windows import Window
from regressors.readers.library import built_in
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

WINDOWS = {
    "short": Window("short", 0.2),
    "overlapping": Window("short", 0.2, 0.1),
    "gaps": Window("short", 0.1, 0.3),
    "long": Window("long"),
}


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return ROBOTS[request.param]()


def differential(robot: Robot, sensor: Sensor, motion: Sines) -> Callable[[Array], Array]:
    """K of a motion, with its accelerations, as a function of time, shape (N, 6, 10)."""
    model = LoadModel(robot, sensor)
    return lambda time: model.assemble(motion.samples(time)).reshape(time.size, -1, 10)


def windows_of(samples: Samples, window: Window) -> list[tuple[float, float]]:
    first, last = window.ends(samples.time)
    return list(zip(samples.time[first], samples.time[last], strict=True))


# --- K_I is the integral of K ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
@pytest.mark.parametrize("link", [None, "2"])
def test_regressor_is_the_integral_of_the_differential_one(robot: Robot, window: Window, link: str | None) -> None:
    """Against Gauss quadrature of K, whose accelerations are exact; Simpson's rule is what is left between them."""
    sensor, motion = shifted(link, 1), random_sines(robot.n, 2, waves=2)
    model, K = LoadIntegralModel(robot, sensor, window), differential(robot, sensor, motion)
    errors = []
    for finer in (1, 2, 4):
        samples = motion.samples(np.linspace(0.0, 1.0, 40 * finer + 1))
        found = model.assemble(samples).reshape(-1, 6, 10)
        pairs = windows_of(samples, window)
        if window.kind == "long":
            found, pairs = found[finer - 1 :: 10 * finer], pairs[finer - 1 :: 10 * finer]
        expected = np.array([gauss(K, *pair, order=24) for pair in pairs])
        errors.append(float(np.abs(found - expected).max()))
    assert min(order_of(errors)) >= 3.5
    assert errors[-1] < 1e-4


def test_regressor_against_adaptive_quadrature() -> None:
    """One window of the IRp-6, finely sampled: scipy's quad of K to 1e-9."""
    robot, sensor, motion = built_in("irp6"), shifted(seed=3), random_sines(5, 4, waves=2)
    K = differential(robot, sensor, motion)
    expected, _ = quad_vec(lambda t: K(np.array([t]))[0], 0.0, 0.5, epsabs=1e-11)
    samples = motion.samples(np.linspace(0.0, 0.5, 2001))
    found = LoadIntegralModel(robot, sensor, Window("short", 0.5)).assemble(samples)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_rate_is_the_differential_regressor(robot: Robot) -> None:
    """``d/dt state + density = K`` at random states: accelerations come back where a row is differentiated."""
    for sensor in (shifted(seed=5), shifted("3", 6), Sensor()):
        states = random_states(robot, 50, seed=7)
        K = LoadModel(robot, sensor).instants(states)
        found = LoadIntegralModel(robot, sensor).instants(states)
        np.testing.assert_allclose(found, K, atol=1e-12 * np.abs(K).max())


def parts(model: LoadIntegralModel, q: Array, dq: Array) -> tuple[Array, Array]:
    symbols = [ca.SX.sym(name, model.robot.n) for name in ("q", "dq")]
    both = [ca.densify(model.state(*symbols)), ca.densify(model.density(*symbols))]
    state, density = ca.Function("parts", symbols, both)(q, dq)
    return np.array(state), np.array(density)


def test_state_changes_at_the_rate_that_the_density_leaves_of_the_regressor(robot: Robot) -> None:
    """The same by central differences of eighth order, along ``q + t dq + t^2/2 ddq``."""
    sensor, rng = shifted(seed=8), np.random.default_rng(9)
    model = LoadIntegralModel(robot, sensor)
    q, dq, ddq = rng.uniform(-1.0, 1.0, (3, robot.n))
    h, slope = 4e-3, 0.0
    for k, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), 1):
        ahead, behind = (parts(model, q + t * dq + t**2 * ddq / 2, dq + t * ddq)[0] for t in (k * h, -k * h))
        slope = slope + weight / h * (ahead - behind)
    here = Samples(np.zeros(1), q[None], dq[None], ddq[None], 0 * q[None])
    K = LoadModel(robot, sensor).assemble(here)
    np.testing.assert_allclose(slope + parts(model, q, dq)[1], K, atol=1e-9 * np.abs(K).max())


@given(kinds=KINDS, seed=SEED)
@settings(max_examples=20)
def test_brackets_and_integrands_are_the_papers(kinds: str, seed: int) -> None:
    """[KD96] eq. (12), (13): v, omega and R g in the sensor's axes, from derivatives of homogeneous matrices."""
    rng = np.random.default_rng(seed)
    robot, sensor = random_chain(kinds, rng), shifted(None, seed)
    q, dq = rng.uniform(-2.0, 2.0, (2, robot.n))
    S = np.eye(4)
    S[:3, :3], S[:3, 3] = sensor.rotation, sensor.translation
    T, dT = np.real(poses(robot, q)[-1]) @ S, np.real(pose_rates(robot, q, dq, 0 * dq)[-1][0]) @ S
    R = T[:3, :3].T
    turning = R @ dT[:3, :3]
    w, v, g = np.array([turning[2, 1], turning[0, 2], turning[1, 0]]), R @ dT[:3, 3], R @ robot.gravity
    state, density = np.zeros((2, 6, 10))
    state[:3, 0], state[:3, 1:4] = v, cross_matrix(w)
    state[3:, 1:4], state[3:, 4:] = -cross_matrix(v), products(w)
    fall = np.cross(w, v) - g
    density[:3, 0], density[:3, 1:4] = fall, cross_matrix(w) @ cross_matrix(w)
    density[3:, 1:4], density[3:, 4:] = -cross_matrix(fall), cross_matrix(w) @ products(w)
    found = parts(LoadIntegralModel(robot, sensor), q, dq)
    np.testing.assert_allclose(found[0], state, atol=1e-11 * max(1.0, np.abs(state).max()))
    np.testing.assert_allclose(found[1], density, atol=1e-11 * max(1.0, np.abs(density).max()))


def products(w: Array) -> Array:
    """``[. w]`` with ``I w = [. w] (Ixx, Ixy, Ixz, Iyy, Iyz, Izz)``: one unit tensor at a time."""
    columns = []
    for i, j in zip(*np.triu_indices(3), strict=True):
        tensor = np.zeros((3, 3))
        tensor[i, j] = tensor[j, i] = 1.0
        columns.append(tensor @ w)
    return np.column_stack(columns)


# --- windows ---------------------------------------------------------------------------------------------------------


def test_sum_of_joined_short_windows_is_the_long_one(robot: Robot) -> None:
    samples, sensor = random_sines(robot.n, 10).samples(np.linspace(0.0, 1.2, 121)), shifted(seed=11)
    long = LoadIntegralModel(robot, sensor, Window("long")).assemble(samples).reshape(120, 6, 10)
    for count in (1, 3, 8):
        W = LoadIntegralModel(robot, sensor, Window("short", 0.01 * count)).assemble(samples).reshape(-1, 6, 10)
        np.testing.assert_allclose(np.cumsum(W, axis=0), long[count - 1 :: count], atol=1e-12 * np.abs(long).max())


def test_windows_may_overlap_or_leave_gaps() -> None:
    robot, sensor = built_in("irp6"), shifted(seed=12)
    samples = random_sines(5, 13).samples(np.linspace(0.0, 1.0, 101))
    long = LoadIntegralModel(robot, sensor, Window("long")).assemble(samples).reshape(100, 6, 10)
    long = np.concatenate([np.zeros((1, 6, 10)), long])
    for step in (1, 3, 7, 20):
        model = LoadIntegralModel(robot, sensor, Window("short", 0.07, 0.01 * step))
        starts = np.arange(0, 94, step)
        W = model.assemble(samples).reshape(-1, 6, 10)
        np.testing.assert_allclose(W, long[starts + 7] - long[starts], atol=1e-12 * np.abs(long).max())


def test_the_base_of_windows_is_all_ten_parameters(robot: Robot) -> None:
    base = base_parameters(LoadIntegralModel(robot))
    assert base.rank == 10
    assert base.names == ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
    assert base.units == ("kg", *["kg m"] * 3, *["kg m^2"] * 6)


# --- selection of equations ------------------------------------------------------------------------------------------

SELECTIONS = [("fx",), ("nz", "fx"), ("fy", "fz", "ny"), EQUATIONS[::-1]]


@pytest.mark.parametrize("equations", SELECTIONS, ids="-".join)
def test_any_selection_of_equations_in_any_order(equations: tuple[str, ...]) -> None:
    """Rows, labels and right side; the measured wrench may be whole, or selected already."""
    robot, window = built_in("irp6"), Window("short", 0.04)
    samples = random_sines(5, 14).samples(np.linspace(0.0, 0.4, 41))
    model = LoadIntegralModel(robot, shifted(seed=15, equations=equations), window)
    whole = LoadIntegralModel(robot, shifted(seed=15), window)
    rows = [EQUATIONS.index(name) for name in equations]
    assert model.row_labels == tuple((name, "N s" if name[0] == "f" else "Nm s") for name in equations)
    expected = whole.assemble(samples).reshape(-1, 6, 10)[:, rows]
    np.testing.assert_array_equal(model.assemble(samples), expected.reshape(-1, 10))
    wrench = np.random.default_rng(16).normal(size=(41, 6))
    y = whole.right_side(samples, wrench).reshape(-1, 6)[:, rows].ravel()
    np.testing.assert_array_equal(model.right_side(samples, wrench), y)
    if len(equations) < 6:  # six columns are the whole wrench in its own order
        np.testing.assert_array_equal(model.right_side(samples, wrench[:, rows]), y)


# --- right side ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
def test_integrated_wrench_of_a_known_body(robot: Robot, window: Window) -> None:
    """``int [F; N] dt = K_I phi`` for wrenches of Pinocchio: what a body adds to the force through its joint."""
    sensor, phi = shifted(seed=17), random_body(np.random.default_rng(18))
    placement = pin.SE3(np.array(sensor.rotation), np.array(sensor.translation))
    bare, loaded = chain_model(robot), chain_model(robot)
    loaded.appendBodyToJoint(robot.n, inertia(phi), placement)
    motion, errors = random_sines(robot.n, 19, waves=2), []
    model = LoadIntegralModel(robot, sensor, window)
    for count in (40, 80, 160):
        samples = motion.samples(np.linspace(0.0, 1.0, count + 1))
        wrenches = [added_wrench(bare, loaded, placement, *state) for state in states_of(samples)]
        y = model.right_side(samples, np.array(wrenches))
        errors.append(float(np.abs(model.assemble(samples) @ phi - y).max()))
    assert min(order_of(errors)) >= 3.5
    assert errors[-1] < 1e-4 * np.abs(y).max()


def states_of(samples: Samples) -> list[tuple[Array, Array, Array]]:
    return list(zip(samples.q, samples.dq, samples.ddq, strict=True))


def added_wrench(bare: object, loaded: object, placement: object, q: Array, dq: Array, ddq: Array) -> Array:
    forces = []
    for model in (bare, loaded):
        data = model.createData()
        pin.rnea(model, data, q, dq, ddq)
        forces.append(data.f[model.njoints - 1])
    return placement.actInv(forces[1] - forces[0]).vector


# --- no acceleration, bad input --------------------------------------------------------------------------------------


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
def test_no_acceleration_is_used(robot: Robot, window: Window) -> None:
    samples = random_sines(robot.n, 20).samples(np.linspace(0.0, 1.0, 41))
    unknown = np.full_like(samples.q, np.nan)
    blind = Samples(samples.time, samples.q, samples.dq, unknown, unknown)
    model, wrench = LoadIntegralModel(robot, shifted(seed=21), window), np.sin(np.outer(samples.time, np.arange(6)))
    np.testing.assert_array_equal(model.assemble(blind), model.assemble(samples))
    np.testing.assert_array_equal(model.right_side(blind, wrench), model.right_side(samples, wrench))


@pytest.mark.parametrize(
    ("window", "message"),
    [
        (Window("short", 0.005), "shorter than the sample time"),
        (Window("short", 0.025), "not a whole number of samples"),
        (Window("short", 2.0), "longer than the motion"),
    ],
    ids=["shorter", "no multiple", "longer"],
)
def test_windows_that_do_not_fit_the_samples(window: Window, message: str) -> None:
    samples = random_sines(5, 22).samples(np.linspace(0.0, 1.0, 101))
    model = LoadIntegralModel(built_in("irp6"), window=window)
    with pytest.raises(InputError, match=message):
        model.assemble(samples)
    with pytest.raises(InputError, match=message):
        model.right_side(samples, np.zeros((101, 6)))


def test_a_sensor_off_the_chain() -> None:
    with pytest.raises(UnknownName, match="no link of the chain for the sensor named 'hand'"):
        LoadIntegralModel(built_in("irp6"), Sensor("hand"))
