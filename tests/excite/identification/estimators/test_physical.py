"""Physically possible parameters: feasibility, optimality, pulls, structure, loads."""

from __future__ import annotations

import dataclasses
import re
from functools import cache

import numpy as np
import pytest
import scipy.optimize
from observed import observations_of, robot_model, robot_observations
from refused import refusal

import excite
from excite.identification.estimator import Estimate
from excite.identification.estimators.least_squares import weighted, weighting
from excite.identification.estimators.physical import (
    LEAST,
    UNCHANGED,
    Physical,
    _lifted,
    physical,
)
from excite.identification.estimators.possible_set import StandardProblem, standard_problem
from excite.identification.observations import Observations
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.load import LOAD_PARAMETERS, LoadModel
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in
from regressors.robot.inertia import pseudo_inertia
from regressors.samples import Array

NAMES = ("panda", "ur10e", "irp6")
LOUD = (("panda", 0.5), ("ur10e", 0.5), ("irp6", 5.0))  # least squares is not possible there


@cache
def observed(name: str, noise: float) -> Observations:
    return robot_observations(name, noise)[0]


@cache
def estimated(name: str, noise: float) -> Estimate:
    model, base, _ = robot_model(name)
    return physical(observed(name, noise), model, base)


@cache
def problem(name: str, noise: float) -> StandardProblem:
    model, base, _ = robot_model(name)
    return standard_problem(weighting(observed(name, noise)), model, base)


def theta_of(estimate: Estimate, standard: StandardProblem) -> Array:
    return np.array([estimate.standard[name] for name in standard.names])


def smallest_eigenvalues(estimate: Estimate, standard: StandardProblem) -> Array:
    theta = theta_of(estimate, standard)
    return np.array([np.linalg.eigvalsh(pseudo_inertia(theta[body.index]))[0] for body in standard.bodies])


# --- possible, and best ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.5])
@pytest.mark.parametrize("name", NAMES)
def test_every_body_and_drive_is_possible(name: str, noise: float) -> None:
    estimate, standard = estimated(name, noise), problem(name, noise)
    assert len(standard.bodies) == built_in(name).n
    assert np.all(smallest_eigenvalues(estimate, standard) >= LEAST * (1 - 1e-6))
    assert np.all(theta_of(estimate, standard)[standard.positive] >= 0)
    model, base, _ = robot_model(name)
    definition, names = model.definition()
    theta = np.array([estimate.standard[parameter] for parameter in names])
    np.testing.assert_allclose(estimate.values, base.D @ definition @ theta, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_where_least_squares_is_possible_it_is_the_result(name: str) -> None:
    estimate, free = estimated(name, 1e-3), weighted(observed(name, 1e-3))
    assert UNCHANGED in estimate.notes
    np.testing.assert_allclose(estimate.values, free.values, atol=1e-8 * float(free.deviation.min()), rtol=1e-10)
    np.testing.assert_array_equal(estimate.covariance, free.covariance)


@pytest.mark.parametrize(("name", "noise"), LOUD)
def test_bounds_that_are_reached_are_named(name: str, noise: float) -> None:
    estimate = estimated(name, noise)
    assert UNCHANGED not in estimate.notes
    (held,) = [note for note in estimate.notes if "held at the nearest possible" in note]
    margins = smallest_eigenvalues(estimate, problem(name, noise))
    assert len(held.partition(":")[0].split(", ")) >= int(np.sum(margins < 2 * LEAST)) > 0
    at_zero = [note.partition(":")[0].split(", ") for note in estimate.notes if "held at zero" in note]
    assert {estimate.standard[parameter] for names in at_zero for parameter in names} == {0.0}


@pytest.mark.parametrize(("name", "noise"), LOUD)
def test_no_possible_parameters_nearby_are_better(name: str, noise: float) -> None:
    """The problem is convex: no step towards other possible parameters, the true ones among them, goes down."""
    standard, estimate = problem(name, noise), estimated(name, noise)
    theta = theta_of(estimate, standard)
    misfit, pulled = standard.G @ theta - standard.r, (theta - standard.prior) / standard.deviation
    gradient = standard.G.T @ misfit + pulled / standard.deviation
    value, rng = (misfit @ misfit + pulled @ pulled) / 2, np.random.default_rng(0)
    _, _, known = robot_model(name)
    targets = [np.array([known[parameter] for parameter in standard.names])]
    for _ in range(30):  # possible bodies of all sizes: the references, stretched by random matrices
        other = targets[0] * np.exp(rng.normal(size=targets[0].size))
        for body in standard.bodies:
            H = np.eye(4) + 0.8 * rng.normal(size=(4, 4))
            J = H @ body.reference @ H.T
            S = J[:3, :3]
            I = np.trace(S) * np.eye(3) - S
            other[body.index] = [J[3, 3], *J[:3, 3], *I[np.triu_indices(3)]]
        targets.append(standard.S @ np.linalg.pinv(standard.S) @ other if name != "irp6" else targets[0])
    for target in targets:
        assert gradient @ (target - theta) >= -1e-6 * (1 + value)


def test_what_the_data_leaves_open_stays_near_the_reference() -> None:
    """The first link turns about its own axis only: its mass and most of its inertia never show."""
    model, base, known = robot_model("ur10e")
    observations = observed("ur10e", 1e-3)
    heavy = {**known, "m1": 50.0, "I1xx": 2.0, "I1yy": 2.5, "I1zz": 3.0}
    described, given = (physical(observations, model, base, reference=values) for values in (None, heavy))
    assert described.standard["m1"] == pytest.approx(known["m1"], rel=1e-2)
    assert given.standard["m1"] == pytest.approx(50.0, rel=1e-2)
    np.testing.assert_allclose(given.values, described.values, rtol=1e-7, atol=1e-9)


def test_what_the_solver_leaves_outside_is_brought_inside() -> None:
    standard = problem("irp6", 0.05)
    theta = theta_of(estimated("irp6", 0.05), standard)
    ball = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -2e-10, 0.0, 2e-10]  # without extent, and less
    theta[standard.bodies[1].index] = ball
    theta[standard.positive] = -1e-12
    lifted = _lifted(standard, theta)
    np.testing.assert_allclose(standard.margins(lifted).min(), LEAST, rtol=1e-6)
    np.testing.assert_array_equal(lifted[standard.positive], 0.0)
    np.testing.assert_allclose(lifted, theta, atol=1e-8)
    np.testing.assert_allclose(lifted, standard.S @ np.linalg.pinv(standard.S) @ lifted, atol=1e-15)


# --- pulls -----------------------------------------------------------------------------------------------------------


def test_quadratic_pull_is_ridge_regression_where_no_bound_is_reached() -> None:
    model, base, known = robot_model("ur10e")
    observations = observed("ur10e", 0.05)
    deviations = {parameter: 2e-3 * max(abs(value), 0.01) for parameter, value in known.items()}
    pull = {name: (value, deviations[name]) for name, value in known.items()}
    found = physical(observations, model, base, pull=pull)
    definition, names = model.definition()
    sigma = weighted(observations).noise[0][observations.equation]
    A = base.D @ definition
    prior, spread = (np.array([values[n] for n in names]) for values in (known, deviations))
    rows = np.concatenate([observations.W @ A / sigma[:, None], np.diag(1 / spread)])
    ridge = np.linalg.lstsq(rows, np.concatenate([observations.y / sigma, prior / spread]))[0]
    np.testing.assert_allclose(found.values, A @ ridge, atol=1e-5 * float(found.deviation.min()))
    assert "the bodies lie inside what is possible" in found.notes


def test_a_strong_pull_ends_at_its_values() -> None:
    model, base, known = robot_model("panda")
    inertial = {name: value for name, value in known.items() if not name.startswith("F")}
    pull = {name: (value, 1e-7) for name, value in inertial.items()}
    strong = physical(observed("panda", 1e-3), model, base, pull=pull)
    np.testing.assert_allclose([strong.standard[n] for n in inertial], list(inertial.values()), atol=1e-5)


# --- structure and loads ---------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_structural_zeros_and_equalities_hold() -> None:
    robot = built_in("irp6")
    zero = [name for name in robot.structure.zero if name in estimated("irp6", 0.05).standard]
    assert len(zero) == 25
    assert all(estimated("irp6", 0.05).standard[name] == 0.0 for name in zero)
    alike = dataclasses.replace(robot.structure, equal=(("I4xx", "I4zz"), ("m4", "m5")))
    model = DifferentialModel(robot.replace(structure=alike))
    base = base_parameters(model)
    known = {**robot_model("irp6")[2], "m4": 1.0, "m5": 1.0}
    definition, names = model.definition()
    states = random_states(robot, 100)
    W = model.assemble(states)[:, base.index]
    y = W @ base.D @ definition @ np.array([known[n] for n in names])
    y += 0.3 * np.random.default_rng(0).normal(size=y.size) * np.tile(np.std(y.reshape(-1, 5), axis=0), 100)
    observations = dataclasses.replace(observations_of(W, y, 5), names=base.names, units=base.units)
    standard = physical(observations, model, base).standard
    assert standard["I4xx"] == pytest.approx(standard["I4zz"], abs=1e-12)
    assert standard["m4"] == pytest.approx(standard["m5"], abs=1e-12)


def test_a_load_is_possible_and_the_optimum_is_scipys() -> None:
    """Ten parameters: SLSQP with the four leading principal minors as constraints, from the true body."""
    model = LoadModel(built_in("irp6"))
    phi = np.array([1.75, 0.02, -0.03, 0.09, 0.012, 0.0005, -0.001, 0.011, 0.0008, 0.004])
    W = model.assemble(random_states(model.robot, 60))
    exact = (W @ phi).reshape(-1, 6)
    y = exact + 0.5 * exact.std(axis=0) * np.random.default_rng(2).normal(size=exact.shape)
    observations = dataclasses.replace(observations_of(W, y.ravel(), 6), names=LOAD_PARAMETERS)
    found = physical(observations, model, base_parameters(model))
    free = weighted(observations)
    assert np.linalg.eigvalsh(pseudo_inertia(free.values))[0] < 0 < np.linalg.eigvalsh(pseudo_inertia(found.values))[0]
    assert any(note.startswith("load: the data alone give an impossible body; ") for note in found.notes)
    sigma = free.noise[0][observations.equation]
    R = np.linalg.qr(np.column_stack([observations.W / sigma[:, None], observations.y / sigma]), mode="r")
    size = np.abs(phi)

    def misfit(x: Array) -> float:
        return float(np.sum((R[:10, :10] @ (size * x) - R[:10, 10]) ** 2)) / 2

    possible = {"type": "ineq", "fun": lambda x: 1e3 * np.linalg.eigvalsh(pseudo_inertia(size * x))}
    settings = {"method": "SLSQP", "constraints": possible, "options": {"maxiter": 500, "ftol": 1e-13}}
    best = scipy.optimize.minimize(misfit, np.sign(phi), **settings)
    assert misfit(found.values / size) <= best.fun * (1 + 1e-5) + 1e-6
    assert dict(zip(LOAD_PARAMETERS, found.values, strict=True)) == pytest.approx(dict(found.standard))


# --- bad input -------------------------------------------------------------------------------------------------------


def test_bad_settings() -> None:
    model, base, _ = robot_model("irp6")
    for name, pull, message in (
        ("panda", None, "observations have the parameters .*, the base of the model has I1zz"),
        ("irp6", {"m99": (1.0, 1.0)}, "no standard parameter named 'm99'; available: m1, m1c1x"),
    ):
        assert re.search(message, refusal(physical, observed(name, 0.05), model, base, pull=pull))
    for within in (0.0, -1.0, np.nan, np.inf):
        assert "described_within must be a positive number" in refusal(Physical, described_within=within)


@pytest.mark.slow
def test_described_values_are_those_of_the_robot_with_its_locked_joints() -> None:
    """What a locked joint carries belongs to the link that carries it: the pull aims there, not at the bare link."""
    task = excite.Task("ur10e", joints=("1", "2", "3"), friction=False, rotor=False)
    options = {"harmonics": 2, "period": 4.0, "starts": 1, "executor": "serial", "acceleration": (5.0,)}
    design = excite.design_trajectory(task.changed(**options))
    log = excite.simulate(design, rate=200.0, noise=2.0, seed=1)
    recipe = {"choose": False, "estimator": "physical", "described_within": 1e-3}
    result = excite.identify(design.task, log, design=design, **recipe)
    described = standard_values(result.target.robot)
    assert described["m3"] > 2 * standard_values(result.robot)["m3"]
    assert result.estimate.standard["m3"] == pytest.approx(described["m3"], rel=0.05)
