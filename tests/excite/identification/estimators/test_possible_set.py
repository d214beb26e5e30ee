"""Possible bodies of any data: every estimate ends, is possible, and explains the torques as the true robot does."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from observed import noise_of, observations_of
from slow_dynamics import random_chain

from excite.errors import ConicSolverError
from excite.identification.estimator import Estimate
from excite.identification.estimators import possible_set
from excite.identification.estimators.physical import physical
from excite.identification.estimators.possible_set import PossibleSet, nearest
from excite.identification.observations import Observations
from excite.payload.held_body import is_possible, nearest_possible
from regressors.models.base import Base, base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import parameter_values, standard_values
from regressors.robot.inertia import parameter_names
from regressors.samples import Array

NOISE = (0.0, 1e-9, 1e-6, 1e-3, 0.01, 0.1)  # of each joint's torques
SIZES = (1.0, 1e-4, 1e4)  # of the masses
ROBOTS = range(2, 200, 5)  # every noise, size and length among them
EXACT = 1e-6  # of a joint's torques: what noise-free data leave


def experiment(seed: int) -> tuple[Observations, DifferentialModel, Base, dict[str, float], Array]:
    """Torques of a random chain at random states; half of its friction coefficients are zero."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    robot = random_chain("".join(rng.choice(["r", "p"], n, p=[0.8, 0.2])), rng)
    size, noise = SIZES[seed // len(NOISE) % len(SIZES)], NOISE[seed % len(NOISE)]
    robot = robot.replace(links=tuple(dataclasses.replace(link, theta=size * link.theta) for link in robot.links))
    model = DifferentialModel(robot)
    base = base_parameters(model)
    friction = {name: rng.integers(2) * rng.uniform() for name in model.definition()[1] if name.startswith("F")}
    known = {**friction, **standard_values(robot)}
    count = 150
    W = model.assemble(random_states(robot, count, seed=seed))[:, base.index]
    exact = W @ parameter_values(model, base, known)
    deviations = noise * np.sqrt(np.mean(exact.reshape(-1, n) ** 2, axis=0))
    rows = observations_of(W, exact + noise_of(rng, deviations, count), n)
    return dataclasses.replace(rows, names=base.names, units=base.units), model, base, known, exact


def mass_moments(theta: Array) -> Array:
    """``int [x; 1] [x; 1]' dm`` of a body, written out."""
    m, x, y, z, xx, xy, xz, yy, yz, zz = theta
    half = (xx + yy + zz) / 2
    return np.array([[half - xx, -xy, -xz, x], [-xy, half - yy, -yz, y], [-xz, -yz, half - zz, z], [x, y, z, m]])


def assert_possible(estimate: Estimate, n: int, names: tuple[str, ...]) -> None:
    theta = estimate.standard
    for link in range(1, n + 1):
        assert np.linalg.eigvalsh(mass_moments(np.array([theta[name] for name in parameter_names(link)])))[0] > 0
    assert all(theta[name] >= 0 for name in names if name.startswith("F"))


def left_over(torques: Array, predicted: Array, n: int) -> float:
    """Largest residual of a joint, of the size of its torques."""
    by_joint = [np.linalg.norm(x.reshape(-1, n), axis=0) for x in (torques - predicted, torques)]
    return float(np.max(by_joint[0] / by_joint[1]))


def check(seed: int) -> None:
    rows, model, base, known, exact = experiment(seed)
    n = model.robot.n
    for reference in ({}, known):
        estimate = physical(rows, model, base, reference=reference)
        assert_possible(estimate, n, model.definition()[1])
        assert not any("conic solver" in note for note in estimate.notes)
        of_true = left_over(rows.y, exact, n)
        assert left_over(rows.y, rows.W @ estimate.fit, n) <= 1.2 * of_true + EXACT, (seed, reference == {})


@pytest.mark.parametrize("seed", [0, 1])
def test_a_random_robot_is_possible_and_explains_the_torques(seed: int) -> None:
    check(seed)
    if seed == 0:
        rows, model, base, *_ = experiment(0)
        assert any("hardly any noise" in note for note in physical(rows, model, base, reference={}).notes)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(3))
def test_random_robots_are_possible_and_explain_the_torques(first: int) -> None:
    for seed in ROBOTS[first::3]:
        check(seed)


@pytest.mark.parametrize("instants", [1, 2, 5])
def test_few_rows_end_with_a_possible_robot(instants: int) -> None:
    rows, model, base, *_ = experiment(3)
    n = model.robot.n
    few = rows.W[: instants * n], rows.y[: instants * n]
    cut = dataclasses.replace(observations_of(*few, n), names=base.names, units=base.units)
    assert_possible(physical(cut, model, base, reference={}), n, model.definition()[1])


# --- where the solver fails ------------------------------------------------------------------------------------------


def ending(status: str, x: float = np.nan) -> type:
    """A solver that ends with a status, and a point of equal coordinates; or that panics."""

    class PanicException(BaseException):
        """As PyO3 raises it."""

    class Solver:
        def __init__(self, P: object, q: Array, *_: object) -> None:
            self.size = len(q)

        def solve(self) -> SimpleNamespace:
            if status == "a panic":
                raise PanicException("Eigval error")
            return SimpleNamespace(status=status, x=np.full(self.size, x))

    return Solver


@pytest.mark.parametrize("status", ["NumericalError", "a panic"])
def test_without_a_solution_the_estimate_moves_towards_the_description(
    status: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows, model, base, known, _ = experiment(5)
    monkeypatch.setattr(possible_set.clarabel, "DefaultSolver", ending(status))
    estimate = physical(rows, model, base, reference=known)
    assert_possible(estimate, model.robot.n, model.definition()[1])
    assert any("moved towards the description" in note for note in estimate.notes)


def ball(width: float = 1.0) -> PossibleSet:
    """``diag(width - z)`` of one body, ``1 + z >= 0`` of one parameter."""
    return PossibleSet(width * np.eye(4)[None], -np.eye(4)[None, :, :, None], np.array([1.0]), np.ones((1, 1)))


def test_an_early_end_is_said_and_one_outside_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(possible_set.clarabel, "DefaultSolver", ending("InsufficientProgress", -0.75))
    z, notes = nearest(ball(-0.5))
    assert z == pytest.approx([-0.75])
    assert "ended with InsufficientProgress" in notes[0]
    monkeypatch.setattr(possible_set.clarabel, "DefaultSolver", ending("Solved", 0.25))
    with pytest.raises(ConicSolverError, match="ended with Solved"):
        nearest(ball(-0.5))


def test_nearest_points() -> None:
    np.testing.assert_array_equal(nearest(ball())[0], [0.0])  # possible already
    assert nearest(ball(-0.5))[0] == pytest.approx([-0.5], abs=1e-8)
    with pytest.raises(ConicSolverError, match="Infeasible"):
        nearest(ball(-1.5))


def test_a_step_inside_is_enough_and_no_longer_than_margins_ask() -> None:
    rng = np.random.default_rng(0)
    B = rng.normal(size=(2, 4, 4, 5))
    possible = PossibleSet(np.array([np.eye(4)] * 2), B + B.swapaxes(1, 2), np.ones(3), rng.normal(size=(3, 5)))
    inside = np.zeros(5)
    for z in rng.normal(size=(50, 5)):
        moved = possible.towards(z, inside)
        assert possible.margins(moved[None]).min() >= -1e-12
        assert np.linalg.norm(moved) <= np.linalg.norm(z)
        if possible.contains(z[None])[0]:
            np.testing.assert_array_equal(moved, z)


@pytest.mark.parametrize("spread", [1e-12, 1e-6, 1.0])
def test_a_held_body_of_any_covariance_is_possible(spread: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(30):
        estimate = rng.normal(size=10) * 10.0 ** rng.uniform(-4, 2)
        estimate[0] = abs(estimate[0])
        A = rng.normal(size=(10, 10)) * np.geomspace(1.0, spread, 10)
        assert is_possible(nearest_possible(estimate, A @ A.T))
