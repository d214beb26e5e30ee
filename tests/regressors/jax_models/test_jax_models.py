"""Every model in JAX, against the symbolic model that it is written beside."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from motions import random_sines
from refused import refusal
from slow_dynamics import random_body, random_chain, random_rotation

from regressors.errors import InputError
from regressors.jax_models import JaxModel
from regressors.jax_models.jax_drives import path_lengths
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.load import LoadIntegralModel, LoadModel, Sensor
from regressors.models.model import PartialModel, RegressorModel
from regressors.models.partial import of_drives
from regressors.models.windows import Window
from regressors.readers.library import built_in
from regressors.robot.columns import Terms
from regressors.robot.gears import BallScrew, ConstantRatio, GearFunction
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import BASE, Branch, Drive, Limits, Link, Robot, Transmission
from regressors.samples import Array, Samples

SCREW = BallScrew(pitch=0.005, square=0.0779, cosine=-0.0293, sine=-0.0609)


@pytest.fixture(autouse=True, scope="module")
def quick_compilation() -> Iterator[None]:
    """These programs run once each: compiling them well takes longer than running them."""
    jax.config.update("jax_disable_most_optimizations", True)
    yield
    jax.config.update("jax_disable_most_optimizations", False)


def bar(parent: str, name: str, kinds: str, row: list[float], rng: np.random.Generator) -> Branch:
    (joint,) = random_chain(kinds, rng).joints
    return Branch(parent, dataclasses.replace(joint, name=name), Link(name, random_body(rng)), np.array(row), 0.3)


@cache
def sliders() -> Robot:
    """Prismatic joints and bars, bars on the base, on a link and on each other, coupled drives, one of them at rest."""
    rng = np.random.default_rng(5)
    robot = random_chain("rprp", rng)
    rod = bar(BASE, "rod", "p", [0.0, 0.7, 0.0, 0.0], rng)
    lever = bar("rod", "lever", "r", [-1.0, 0.0, 0.5, 0.0], rng)
    bars = (rod, lever, bar(robot.links[1].name, "rocker", "r", [0.0, 0.0, 0.0, 1.7], rng))
    still = Drive("z4", ConstantRatio(10.0), 1e-4, rests=True)
    turning, screws = Drive("z1", ConstantRatio(-50.0), 1e-4), (Drive("z3", SCREW, 2e-4), Drive("z5", SCREW, 1e-4))
    drives = (turning, Drive("z2"), screws[0], still, screws[1])
    coupling = np.vstack([np.eye(4), [0.0, 1.0, 1.0, -0.5]])
    transmission = Transmission(coupling, drives, Limits.none(5), np.array([0.1, -0.2, 0.3, 0.0, 0.4]))
    return robot.replace(branches=bars, transmission=transmission)


ROBOTS: dict[str, Callable[[], Robot]] = {
    **{name: (lambda name=name: built_in(name)) for name in ("irp6", "irp6-full", "panda", "ur10e")},
    "irp6-axes-1-3": lambda: with_locked_joints(built_in("irp6"), [0, 1, 2]),
    "sliders": sliders,
}
SENSOR = Sensor("2", random_rotation(np.random.default_rng(0)), np.array([0.1, -0.2, 0.3]), ("fz", "nx", "fx"))
SOME = Terms(coulomb=(1, 3), viscous=(5,), offset=(2, 3))
MODELS: dict[str, Callable[[Robot], RegressorModel]] = {
    "differential": lambda robot: DifferentialModel(robot, Terms(offset=True)),
    "energy": lambda robot: EnergyModel(robot, Terms(offset=True)),
    "further friction": lambda robot: DifferentialModel(
        robot, Terms(offset=(1, 2), load_share=(1, 3), root=(2,), asymmetry=True, stribeck=True), sign_width=0.2
    ),
    "energy of further friction": lambda robot: EnergyModel(
        robot, Terms(offset=(3,), root=(2,), asymmetry=True, stribeck=(1,)), sign_width=0.2
    ),
    "differential of some drives": lambda robot: DifferentialModel(robot, SOME),
    "energy of some drives": lambda robot: EnergyModel(robot, SOME),
    "load": lambda robot: LoadModel(robot, SENSOR),
    "load-integral": lambda robot: LoadIntegralModel(robot),
}
CASES = [
    *(("differential", name) for name in ("irp6", "irp6-full", "panda", "ur10e", "sliders")),
    *(("energy", name) for name in ("irp6-axes-1-3", "sliders")),
    *(("further friction", name) for name in ("irp6", "ur10e")),
    ("energy of further friction", "irp6-axes-1-3"),
    *((f"{kind} of some drives", "sliders") for kind in ("differential", "energy")),
    ("load", "sliders"),
    ("load-integral", "sliders"),
]


def rows(jax_model: JaxModel, samples: Samples) -> Array:
    with jax.enable_x64(True):
        return np.asarray(jax.jit(jax_model.rows)(samples.q, samples.dq, samples.ddq))


def expected_rows(model: RegressorModel, samples: Samples) -> Array:
    return model.instants(samples).reshape(samples.time.size, -1, len(model.columns))


def assert_columns_equal(found: Array, expected: Array, tolerance: float = 1e-10) -> None:
    """Every column to a part of its largest entry."""
    assert found.shape == expected.shape
    size = np.abs(expected).max(axis=tuple(range(expected.ndim - 1)))
    worst = np.abs(found - expected).max(axis=tuple(range(expected.ndim - 1)))
    assert np.all(worst <= tolerance * np.where(size > 1e-12 * size.max(), size, size.max()))


def test_importing_the_twin_leaves_numbers_as_they_were() -> None:
    assert jnp.ones(1).dtype == jnp.float32


# --- rows ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "name"), CASES)
@pytest.mark.slow
def test_rows_are_those_of_the_model(kind: str, name: str) -> None:
    model = MODELS[kind](ROBOTS[name]())
    states = random_states(model.robot, 40, seed=3)
    assert_columns_equal(rows(JaxModel(model), states), expected_rows(model, states))


def test_a_partial_motion_and_a_selection_of_columns() -> None:
    robot = with_locked_joints(built_in("irp6"), [0, 1, 2])
    model = PartialModel(DifferentialModel(robot), of_drives(robot, ["z2", "z3"]), ["z3"])
    base = base_parameters(model)
    states = random_states(robot, 20)
    jax_model = JaxModel(model, base.index)
    assert jax_model.names == base.names
    assert_columns_equal(rows(jax_model, states), expected_rows(model, states)[:, :, base.index])


@pytest.mark.slow
def test_rows_are_mapped_and_differentiated() -> None:
    """A batch is all of its instants; the derivative of its rows is that of central differences."""
    model = DifferentialModel(random_chain("r", np.random.default_rng(3)), Terms.inertial_only())
    jax_model, h = JaxModel(model), 1e-5
    q, dq, ddq = np.random.default_rng(4).normal(size=(3, 2, 3, 1))

    @jax.jit
    def rows_and_slope(q: jax.Array) -> tuple[jax.Array, jax.Array]:
        return jax_model.rows(q, dq, ddq), jax.grad(lambda q: jnp.sum(jnp.sin(jax_model.rows(q, dq, ddq))))(q)

    flat = Samples(np.arange(6.0), *(x.reshape(6, 1) for x in (q, dq, ddq, ddq)))
    step = np.zeros_like(q)
    step[1, 2, 0] = h
    with jax.enable_x64(True):
        (Y, slope), (ahead, _), (behind, _) = (rows_and_slope(x) for x in (q, q + step, q - step))
    np.testing.assert_allclose(Y, expected_rows(model, flat).reshape(2, 3, 1, 10), rtol=1e-12, atol=1e-12)
    difference = (np.sum(np.sin(ahead)) - np.sum(np.sin(behind))) / (2 * h)
    np.testing.assert_allclose(slope[1, 2, 0], difference, rtol=1e-7)


# --- whole motions ---------------------------------------------------------------------------------------------------

WINDOWS = {"overlapping": Window("short", 0.1, 0.05), "long": Window("long")}


@pytest.mark.parametrize(("kind", "window", "count"), [("energy", "long", 82), ("load", "overlapping", 81)])
def test_windows_are_those_of_the_model(kind: str, window: str, count: int) -> None:
    """Simpson's rule for odd and even numbers of samples, paths of the drives, and work or impulse measured."""
    robot, of = sliders(), WINDOWS[window]
    model = LoadIntegralModel(robot, SENSOR, of) if kind == "load" else EnergyModel(robot, Terms(), of)
    time = np.arange(count) * 0.0125
    samples = random_sines(robot.n, 6).samples(time)
    measured = np.random.default_rng(7).normal(size=(count, 6 if kind == "load" else robot.n))
    jax_model = JaxModel(model)

    def equations(q: jax.Array, dq: jax.Array, ddq: jax.Array, tau: jax.Array) -> tuple[jax.Array, jax.Array]:
        return jax_model.assemble(time, q, dq, ddq), jax_model.right_side(time, q, dq, tau)

    batch = (np.stack([x, x[::-1]]) for x in (samples.q, samples.dq, samples.ddq, measured))
    with jax.enable_x64(True):
        W, y = (np.asarray(x)[0] for x in jax.jit(equations)(*batch))
    assert_columns_equal(W.reshape(-1, len(model.columns)), model.assemble(samples))
    np.testing.assert_allclose(y.ravel(), model.right_side(samples, measured), rtol=1e-10, atol=1e-12)


def test_the_measured_wrench_is_that_of_the_sensors_equations() -> None:
    model, still, wrench = LoadModel(sliders(), SENSOR), np.zeros((4, 4)), np.random.default_rng(0).normal(size=(4, 6))
    samples = Samples(np.arange(4.0), still, still, still, still)
    with jax.enable_x64(True):
        y = np.asarray(JaxModel(model).right_side(samples.time, still, still, wrench))
    np.testing.assert_array_equal(y.ravel(), model.right_side(samples, wrench))


def test_a_motion_that_stands_still_goes_nowhere() -> None:
    """No quotient of zeros is left in the length of its path."""
    still = np.zeros((5, 2))
    np.testing.assert_array_equal(jax.jit(path_lengths, static_argnums=2)(still, still, 0.1), still)


# --- what is refused -------------------------------------------------------------------------------------------------


class _Lever(GearFunction):
    def ratio(self, z):
        return 2 + z


def test_what_a_twin_cannot_do_is_said() -> None:
    robot = random_chain("r", np.random.default_rng(0))
    jax_model = JaxModel(DifferentialModel(robot))
    assert r"needs 64-bit numbers: call it within `with jax.enable_x64" in refusal(jax_model.rows, *np.zeros((3, 1, 1)))
    with jax.enable_x64(True), pytest.raises(InputError, match=r"\(\.\.\., 1\), given \(4, 2\), \(4, 2\), \(4, 2\)"):
        jax_model.rows(*np.zeros((3, 4, 2)))
    lever = Transmission(np.eye(1), (Drive("z1", _Lever(), 1.0),), Limits.none(1))
    with pytest.raises(InputError, match="gear function _Lever has no JAX counterpart"):
        JaxModel(DifferentialModel(robot.replace(transmission=lever)))
