"""The load models: K against Pinocchio's body regressor, and K_I as its integral, made without any acceleration."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from motions import Sines, gauss, order_of, random_sines
from pinocchio_chains import chain_model, held_wrench
from public_arms import THETA_FROM_PINOCCHIO
from refused import refusal
from slow_dynamics import ROBOTS, random_body, shifted

from regressors.errors import UnknownName
from regressors.models.base import base_parameters, random_states
from regressors.models.load import EQUATIONS, LoadIntegralModel, LoadModel, Sensor
from regressors.models.windows import Window
from regressors.readers.library import built_in
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
    each = zip(states.q, states.dq, states.ddq, strict=True)
    expected = [pinocchio_regressor(model, joint, placement, *state) for state in each]
    close(regressors(robot, sensor, states), np.array(expected))


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
    there = r"1 \(column\), 2 \(arm\), 3 \(forearm\), 4 \(wrist_bend\), 5 \(wrist_turn\)"
    with pytest.raises(UnknownName, match=f"{link!r}.*{there}"):
        LoadModel(built_in("irp6"), Sensor(link))


SENSORS = {
    "unknown equation": ({"equations": ("fx", "mx")}, "no equation named 'mx'; available: fx, fy, fz, nx, ny, nz"),
    "equation twice": ({"equations": ("fx", "fy", "fx")}, "expected at least one, and each once, given fx, fy, fx"),
    "no equation": ({"equations": ()}, "expected at least one, and each once, given none"),
    "plane position": ({"translation": np.zeros(2)}, "sensor position must be three finite numbers"),
    "no position": ({"translation": np.array([0.0, np.nan, 0.0])}, "sensor position must be three finite numbers"),
    "scaled axes": ({"rotation": 2.0 * np.eye(3)}, "rotation"),
    "mirrored axes": ({"rotation": np.diag([1.0, 1.0, -1.0])}, "rotation"),
    "no axes": ({"rotation": np.full((3, 3), np.nan)}, "rotation"),
}


@pytest.mark.parametrize("case", SENSORS)
def test_sensors_that_cannot_be(case: str) -> None:
    """Axes too, as of a joint's frame, whose rotation is checked; K would be wrong without a word."""
    fields, message = SENSORS[case]
    assert re.search(message, refusal(Sensor, **fields))


WINDOWS = {
    "short": Window("short", 0.2),
    "overlapping": Window("short", 0.2, 0.1),
    "gaps": Window("short", 0.1, 0.3),
    "long": Window("long"),
}


def differential(robot: Robot, sensor: Sensor, motion: Sines) -> Callable[[Array], Array]:
    """K of a motion, with its accelerations, as a function of time, shape (N, 6, 10)."""
    model = LoadModel(robot, sensor)
    return lambda time: model.assemble(motion.samples(time)).reshape(time.size, -1, 10)


def windows_of(samples: Samples, window: Window) -> list[tuple[float, float]]:
    first, last = window.ends(samples.time)
    return list(zip(samples.time[first], samples.time[last], strict=True))


# --- K_I is the integral of K ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
def test_regressor_is_the_integral_of_the_differential_one(robot: Robot, window: Window) -> None:
    """Against Gauss quadrature of K, whose accelerations are exact; Simpson's rule is what is left between them."""
    sensor, motion = shifted("2" if window.step is None else None, 1), random_sines(robot.n, 2, waves=2)
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


def test_rate_is_the_differential_regressor(robot: Robot) -> None:
    """``d/dt state + density = K`` at random states: accelerations come back where a row is differentiated."""
    for sensor in (shifted(seed=5), shifted("3", 6), Sensor()):
        states = random_states(robot, 50, seed=7)
        K = LoadModel(robot, sensor).instants(states)
        found = LoadIntegralModel(robot, sensor).instants(states)
        np.testing.assert_allclose(found, K, atol=1e-12 * np.abs(K).max())


# --- windows ---------------------------------------------------------------------------------------------------------


def test_the_base_of_windows_is_all_ten_parameters(robot: Robot) -> None:
    base = base_parameters(LoadIntegralModel(robot))
    assert base.rank == 10
    assert base.names == ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
    assert base.units == ("kg", *["kg m"] * 3, *["kg m^2"] * 6)


# --- selection of equations ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("equations", SELECTIONS, ids="-".join)
def test_any_selection_of_integrals_in_any_order(equations: tuple[str, ...]) -> None:
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
    of_link = transport(sensor.rotation, sensor.translation) @ phi
    motion, errors = random_sines(robot.n, 19, waves=2), []
    model = LoadIntegralModel(robot, sensor, window)
    for count in (40, 80, 160):
        samples = motion.samples(np.linspace(0.0, 1.0, count + 1))
        wrenches = [placement.actInv(pin.Force(each)).vector for each in held_wrench(robot, of_link, samples)]
        y = model.right_side(samples, np.array(wrenches))
        errors.append(float(np.abs(model.assemble(samples) @ phi - y).max()))
    assert min(order_of(errors)) >= 3.5
    assert errors[-1] < 1e-4 * np.abs(y).max()


# --- no acceleration, bad input --------------------------------------------------------------------------------------


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
def test_no_acceleration_is_used(robot: Robot, window: Window) -> None:
    samples = random_sines(robot.n, 20).samples(np.linspace(0.0, 1.0, 41))
    unknown = np.full_like(samples.q, np.nan)
    blind = Samples(samples.time, samples.q, samples.dq, unknown, unknown)
    model, wrench = LoadIntegralModel(robot, shifted(seed=21), window), np.sin(np.outer(samples.time, np.arange(6)))
    np.testing.assert_array_equal(model.assemble(blind), model.assemble(samples))
    np.testing.assert_array_equal(model.right_side(blind, wrench), model.right_side(samples, wrench))
