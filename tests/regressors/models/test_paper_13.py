"""The thirteen parameters of [KD96]: in both models, by the corrected table of shared/paper/errata.md."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from motions import Polynomials, path_of_polynomial, random_sines
from slow_dynamics import table_energies, three_axes

from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.windows import Window
from regressors.robot.columns import Terms
from regressors.robot.robot import Structure
from regressors.samples import Array

NAMES = (*(f"X{k}" for k in range(1, 8)), "F1c", "F2c", "F3c", "F1v", "F2v", "F3v")
MASSES = Terms(coulomb=False, viscous=False)
L2, N1, N2, N3 = 0.455, 158.0, 167.5, 167.5

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


def energies(q: Array, dq: Array) -> Array:
    """d_1 ... d_7 at some states, shape (N, 7)."""
    return np.column_stack(table_energies(q.T, dq.T))


def table_regressor() -> ca.Function:
    """Torques per parameter: Lagrange's equation for X1 ... X7, Rayleigh's dissipation function for friction."""
    q, dq, ddq = (ca.SX.sym(letter, 3) for letter in ("q", "dq", "ddq"))
    columns = []
    for total, V in zip(table_energies(q, dq, ca), table_energies(q, ca.SX(3, 1), ca), strict=True):
        momentum, T = ca.gradient(ca.SX(total), dq), total - V
        rate = ca.jtimes(momentum, q, dq) + ca.jtimes(momentum, dq, ddq)
        columns.append(rate - ca.gradient(ca.SX(T), q) + ca.gradient(ca.SX(V), q))
    dz = [dq[0], dq[1], dq[1] + dq[2]]  # |dz| is homogeneous of degree one, dz^2 of degree two
    columns += [ca.gradient(P, dq) for P in (*map(ca.fabs, dz), *(w**2 / 2 for w in dz))]
    return ca.Function("table", [q, dq, ddq], [ca.densify(ca.horzcat(*columns))])


def test_default_form_has_the_papers_thirteen_parameters() -> None:
    model = DifferentialModel(three_axes())
    assert model.names == NAMES
    units = [*["kg m^2"] * 5, *["kg m"] * 2, *["Nm"] * 3, *["Nm s/rad"] * 3]
    assert [c.unit for c in model.columns] == units
    assert model.row_labels == (("q1", "Nm"), ("q2", "Nm"), ("q3", "Nm"))


def test_regressor_is_the_lagrangian_derivative_of_the_corrected_table() -> None:
    model = DifferentialModel(three_axes())
    states = random_states(model.robot, 200, seed=1)
    W = model.assemble(states)
    expected = np.vstack([np.array(table_regressor()(*x)) for x in zip(states.q, states.dq, states.ddq, strict=True)])
    assert np.abs(W - expected).max() <= 1e-12 * np.abs(expected).max()
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_array_less(np.abs(W - expected).max(axis=0), 1e-12 * np.maximum(scale, 1.0))


def test_parameters_are_those_combinations_of_standard_ones() -> None:
    definition, standard = DifferentialModel(three_axes()).definition()
    for row, terms in zip(definition, AGGREGATES.values(), strict=False):
        found = {name: value for name, value in zip(standard, row, strict=True) if value != 0.0}
        assert found == pytest.approx(terms, rel=1e-12)
    for row, name in zip(definition[7:], NAMES[7:], strict=True):
        assert {standard[k]: row[k] for k in np.flatnonzero(row)} == {name: 1.0}


def test_values_of_the_parameters_are_the_published_ones() -> None:
    """X_3dof of the facts, with the rotor of drive 4 in X3 and X4; X7 = 8.125 kg m, X3 - X4 = 5.5 kg m^2 [KD96]."""
    robot = three_axes()
    model = DifferentialModel(robot, MASSES)
    definition, standard = model.definition()
    rotors = [d.rotor_inertia for d in robot.transmission.drives[:3]]
    values = np.concatenate([*(link.theta for link in robot.links), rotors])
    assert standard[30:] == ("Ia1", "Ia2", "Ia3")
    X = definition @ values
    along = 128.0**2 * 4.0e-5  # with the hand held, drive 4 turns with drive 3
    np.testing.assert_allclose(X, [5.5368, 1.2590, 9.7435 + along, 4.2437 + along, 2.0223, 0.59, 8.125], atol=1e-4)
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


# --- how many parameters there are: base_parameter_counts of shared/facts/irp6.yaml, and ranks of errata.md ----------
# Counts with the bodies of a parallelogram are those of a robot with branches: test_branches.py.


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


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
@pytest.mark.parametrize("seed", range(2))
def test_d1_to_d7_are_changes_of_the_tables_energies(window: Window, seed: int) -> None:
    motion, time = random_sines(3, seed), 0.01 * np.arange(201)
    samples = motion.samples(time)
    W = EnergyModel(three_axes(), window=window).assemble(samples)
    assert_equal(W[:, :7], differences(energies(samples.q, samples.dq), window))


def polynomial_motion(window: Window, seed: int, count: int) -> tuple[Array, Array, Array]:
    """Energy regressor of random polynomials of time, the drives' coefficients, and the instants."""
    coefficients, time = np.random.default_rng(seed).normal(size=(count, 3)), 0.01 * np.arange(201)
    W = EnergyModel(three_axes(), window=window).assemble(Polynomials(coefficients).samples(time))
    return W, coefficients @ np.array([[1, 0, 0], [0, 1, 1], [0, 0, 1]]), time


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
@pytest.mark.parametrize("seed", range(2))
def test_d8_to_d10_are_paths_of_the_drives(window: Window, seed: int) -> None:
    """For random cubics of time, which turn inside windows; the path is known in closed form."""
    W, drives, time = polynomial_motion(window, seed, 4)
    paths = np.array([[path_of_polynomial(z, 0.0, t) for z in drives.T] for t in time])
    assert_equal(W[:, 7:10], differences(paths, window))


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS.keys())
@pytest.mark.parametrize("seed", range(2))
def test_d11_to_d13_are_integrals_of_squared_velocities(window: Window, seed: int) -> None:
    """For random parabolas of time, where Simpson's rule is exact."""
    W, drives, time = polynomial_motion(window, seed, 3)
    integrals = []
    for z in drives.T:
        velocity = np.polynomial.polynomial.polyder(z)
        square = np.polynomial.polynomial.polyint(np.polynomial.polynomial.polymul(velocity, velocity))
        integrals.append(np.polynomial.polynomial.polyval(time, square))
    assert_equal(W[:, 10:], differences(np.column_stack(integrals), window))
