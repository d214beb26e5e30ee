"""The thirteen columns of [KD96] in the energy model: the corrected table of shared/paper/errata.md, in plain NumPy.

That the differential model is Lagrange's derivative of the same table is tested in test_irp6_regressor.py.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import Polynomials, path_of_polynomial, random_sines

from excite.information.target import moving_robot
from excite.tasks.task import Task
from regressors.models.base import random_states
from regressors.models.columns import Terms
from regressors.models.energy import EnergyModel
from regressors.models.windows import Window
from regressors.readers.library import built_in
from regressors.robot.robot import Robot, Structure
from regressors.samples import Array, Samples

NAMES = (*(f"X{k}" for k in range(1, 8)), "F1c", "F2c", "F3c", "F1v", "F2v", "F3v")
L2, G = 0.455, 9.81
SEED = st.integers(0, 2**32 - 1)


@cache
def three_axes() -> Robot:
    return moving_robot(built_in("irp6"), Task("irp6"))


def energies(q: Array, dq: Array) -> Array:
    """d_1 ... d_7 at some states, shape (N, 7)."""
    (_, q2, q3), (w1, w2, w3) = q.T, dq.T
    return np.column_stack(
        [
            w1**2 / 2,
            w1**2 * np.sin(q2) ** 2 / 2,
            w2**2 / 2,
            w3**2 / 2 + w2 * w3,
            -(np.sin(q3) ** 2 * np.cos(2 * q2) + np.sin(2 * q2) * np.sin(2 * q3) / 2) * w1**2 / 2,
            L2 * np.sin(q3) * (w2 + w3) * w2 - L2 * np.sin(q2) * np.cos(q2 + q3) * w1**2 + G * np.sin(q2 + q3),
            G * np.cos(q2),
        ]
    )


def powers(dq: Array) -> Array:
    """Integrands of d_8 ... d_13, shape (N, 6)."""
    dz = np.column_stack([dq[:, 0], dq[:, 1], dq[:, 1] + dq[:, 2]])
    return np.hstack([np.abs(dz), dz**2])


def aggregates(p: dict[str, float]) -> Array:
    """X_1 ... X_13 from standard parameters by name, as the corrected table writes them."""
    n1, n2, n3 = 158.0, 167.5, 167.5
    return np.array(
        [
            p["I1zz"] + p["Ia1"] * n1**2 + p["I2xx"] + p["I3yy"],
            p["I2yy"] - p["I2xx"] + p["m3"] * L2**2 - p["I3yy"] + p["I3xx"],
            p["I2zz"] + n2**2 * p["Ia2"] + p["I3zz"] + n3**2 * p["Ia3"] + L2**2 * p["m3"],
            p["I3zz"] + n3**2 * p["Ia3"],
            p["I3yy"] - p["I3xx"],
            p["m3c3x"],
            p["m2c2x"] + L2 * p["m3"],
            *(p[f"F{k}c"] for k in (1, 2, 3)),
            *(p[f"F{k}v"] for k in (1, 2, 3)),
        ]
    )


def assert_equal(found: Array, expected: Array) -> None:
    """To 1e-12 of each column's largest entry."""
    assert found.shape == expected.shape
    assert np.all(np.abs(found - expected) <= 1e-12 * np.abs(expected).max(axis=0))


WINDOWS = {"short": Window("short", 0.02), "overlapping": Window("short", 0.05, 0.01), "long": Window("long")}


def differences(values: Array, window: Window) -> Array:
    """Changes over the windows of values at samples 10 ms apart."""
    if window.kind == "long":
        return values[1:] - values[0]
    length, step = round(window.length / 0.01), round((window.step or window.length) / 0.01)
    return np.array([values[k + length] - values[k] for k in range(0, len(values) - length, step)])


def test_parameters_are_the_papers() -> None:
    model = EnergyModel(three_axes())
    assert model.names == NAMES
    assert [c.unit for c in model.columns] == [*["kg m^2"] * 5, *["kg m"] * 2, *["Nm"] * 3, *["Nm s/rad"] * 3]


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
@pytest.mark.parametrize("seed", range(5))
def test_d1_to_d7_are_changes_of_the_tables_energies(window: Window, seed: int) -> None:
    motion, time = random_sines(3, seed), 0.01 * np.arange(201)
    samples = motion.samples(time)
    W = EnergyModel(three_axes(), window=window).assemble(samples)
    assert_equal(W[:, :7], differences(energies(samples.q, samples.dq), window))


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
@pytest.mark.parametrize("seed", range(5))
def test_d8_to_d10_are_paths_of_the_drives(window: Window, seed: int) -> None:
    """For random cubics of time, which turn inside windows; the path is known in closed form."""
    rng, time = np.random.default_rng(seed), 0.01 * np.arange(201)
    cubics = rng.normal(size=(4, 3))
    W = EnergyModel(three_axes(), window=window).assemble(Polynomials(cubics).samples(time))
    drives = cubics @ np.array([[1, 0, 0], [0, 1, 1], [0, 0, 1]])
    paths = np.array([[path_of_polynomial(z, 0.0, t) for z in drives.T] for t in time])
    assert_equal(W[:, 7:10], differences(paths, window))


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
@pytest.mark.parametrize("seed", range(5))
def test_d11_to_d13_are_integrals_of_squared_velocities(window: Window, seed: int) -> None:
    """For random parabolas of time, where Simpson's rule is exact."""
    rng, time = np.random.default_rng(seed), 0.01 * np.arange(201)
    parabolas = rng.normal(size=(3, 3))
    W = EnergyModel(three_axes(), window=window).assemble(Polynomials(parabolas).samples(time))
    drives = parabolas @ np.array([[1, 0, 0], [0, 1, 1], [0, 0, 1]])
    integrals = []
    for z in drives.T:
        velocity = np.polynomial.polynomial.polyder(z)
        square = np.polynomial.polynomial.polyint(np.polynomial.polynomial.polymul(velocity, velocity))
        integrals.append(np.polynomial.polynomial.polyval(time, square))
    assert_equal(W[:, 10:], differences(np.column_stack(integrals), window))


def test_rates_of_the_columns_are_those_of_the_table() -> None:
    """At random states within the robot's limits: d/dt of d_1 ... d_7 by the complex step, integrands of the others."""
    states = random_states(three_axes(), 500, seed=6)
    step = 1e-30j
    ahead = energies(states.q + step * states.dq, states.dq + step * states.ddq)
    expected = np.hstack([np.imag(ahead) / 1e-30, powers(states.dq)])
    assert_equal(EnergyModel(three_axes()).instants(states), expected)


@given(seed=SEED)
@settings(max_examples=25)
def test_energy_of_the_links_is_the_sum_of_the_aggregates(seed: int) -> None:
    """``H - sum X_i d_i = 0`` for any symmetric links: standard parameters on one side, X on the other."""
    robot = three_axes()
    window = Window("short", 0.05)
    plain = EnergyModel(robot.replace(structure=Structure()), Terms(reflected=False), window)
    rng = np.random.default_rng(seed)
    known = {name: 0.0 if name in robot.structure.zero else rng.normal() for name in plain.names}
    known |= {f"Ia{k}": rng.normal() * 1e-4 for k in (1, 2, 3)}
    samples = random_sines(3, seed).samples(0.01 * np.arange(101))
    W = plain.assemble(samples)
    expected = W @ np.array([known[name] for name in plain.names])
    X = aggregates(known)
    model = EnergyModel(robot, window=window)
    definition, standard = model.definition()
    np.testing.assert_allclose(definition @ [known[name] for name in standard], X, rtol=1e-12, atol=1e-12)
    found = model.assemble(samples) @ X
    size = np.abs(W) @ np.abs([known[name] for name in plain.names])
    np.testing.assert_allclose(found, expected, atol=1e-12 * size.max())
    by_table = differences(energies(samples.q, samples.dq), window) @ X[:7]
    np.testing.assert_allclose(by_table, expected - W[:, -6:] @ X[7:], atol=1e-12 * size.max())


def test_columns_do_not_use_the_acceleration() -> None:
    samples = random_sines(3, 7).samples(0.01 * np.arange(101))
    unknown = np.full_like(samples.q, np.nan)
    blind = Samples(samples.time, samples.q, samples.dq, unknown, unknown)
    W = EnergyModel(three_axes(), window=Window("long")).assemble(blind)
    assert_equal(W[:, :7], energies(samples.q, samples.dq)[1:] - energies(samples.q, samples.dq)[0])
