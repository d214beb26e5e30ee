"""Possible bodies from sums of products, described bodies as prior knowledge, and the choice between them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from observed import statistics_of

from excite.errors import ConicSolverError
from excite.identification.choices import scoring
from excite.identification.choices.left_out import BlockStatistics, least_squares_of_products, left_out, weighted_sum
from excite.identification.choices.scoring import (
    DEVIATIONS,
    best_pulled,
    choose_bodies,
    deviations_to_try,
    factor_of_products,
    of_base_columns,
    possible_estimate_of_products,
    pulled_least_squares,
)
from excite.identification.estimators import physical
from excite.identification.estimators.possible_set import near_described
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget, target_of
from excite.tasks.task import Task
from regressors.models.base import random_states
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in
from regressors.robot.columns import COULOMB
from regressors.robot.inertia import pseudo_inertia
from regressors.samples import Array


@cache
def target() -> IdentificationTarget:
    """The first three joints of the UR10e."""
    return target_of(built_in("ur10e"), Task("ur10e", joints=("1", "2", "3")))


@cache
def described() -> dict[str, float]:
    return dict(standard_values(target().robot))


def true_beta(scale: float = 1.0) -> Array:
    """Base parameters of the description, the bodies' scaled; friction where not known 1."""
    definition, names = target().model.definition()
    kinds = {c.name: c.kind for c in target().model.standard_columns}
    body = [described().get(n, 1.0) * (scale if kinds[n] not in ("coulomb", "viscous") else 1.0) for n in names]
    return np.asarray(target().base.D @ definition @ np.array(body))


def statistics(count: int, noise: float, scale: float = 1.0) -> BlockStatistics:
    """Torques at random states in five blocks, with noise relative to each joint's."""
    states = random_states(target().robot, count, 0)
    W = target().model.assemble(states)[:, target().base.index].reshape(count, -1, target().base.rank)
    y = W @ true_beta(scale)
    y = y + noise * y.std(axis=0) * np.random.default_rng(0).normal(size=y.shape)
    return statistics_of(W, y, np.arange(count) * 5 // count)


# ---------------------------------------------------------------- rows and columns


@pytest.mark.parametrize("dependent", [False, True])
def test_a_factor_has_the_same_normal_equations(dependent: bool) -> None:
    products = statistics(8 if dependent else 60, 0.1).total
    weights = np.array([1.0, 0.1, 5.0])
    both = np.tensordot(weights, products, axes=1)
    factor = factor_of_products(both)
    np.testing.assert_allclose(factor.T @ factor, both, atol=1e-10 * np.abs(both).max())


def test_parameters_that_the_data_does_not_depend_on_change_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    few, weights = statistics(20, 0.5), np.array([3.0, 0.5, 2.0])
    kept = [k for k, index in enumerate(target().base.index) if target().model.columns[index].kind != COULOMB]
    assert len(kept) < target().base.rank
    both = weighted_sum(few.of_columns(kept).total, weights)
    fit = possible_estimate_of_products(of_base_columns(target(), kept), {}, None)
    found = fit(both)
    monkeypatch.setattr(physical, "_needed", lambda standard: np.full(standard.S.shape[1], True))
    np.testing.assert_allclose(found, fit(both), atol=1e-6 * np.abs(found).max())


# ---------------------------------------------------------------- prior knowledge


@pytest.mark.parametrize("within", [0.3, 1.0, 10.0])
def test_pulled_least_squares_is_the_posterior_mean(within: float) -> None:
    """With ``beta_known ~ N(A theta0, A D^2 A')``, and nothing known of the other parameters."""
    few, weights = statistics(40, 0.3), np.array([3.0, 0.5, 2.0])
    every = range(target().base.rank)
    found = pulled_least_squares(target(), near_described(target().model, described(), within), every)(
        weighted_sum(few.total, weights)
    )
    definition, names = target().model.definition()
    A = target().base.D @ definition
    pull = near_described(target().model, described(), within)
    theta0, deviations = np.array([pull.get(name, (0.0, 0.0)) for name in names]).T
    D = np.diag(deviations)
    covariance = A @ D @ D @ A.T
    known = np.diag(covariance) > 0
    assert 0 < np.count_nonzero(~known) < known.size  # friction is not described
    normal, right = np.tensordot(weights, few.total[:, :-1, :-1], axes=1), weights @ few.total[:, :-1, -1]
    prior = np.zeros_like(normal)
    prior[np.ix_(known, known)] = np.linalg.inv(covariance[np.ix_(known, known)])
    expected = np.linalg.solve(normal + prior, right + prior @ A @ theta0)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


def test_the_best_deviation_is_taken_and_none_without_described_bodies() -> None:
    few, every = statistics(12, 0.3), range(target().base.rank)
    pulls = (near_described(target().model, described(), d) for d in (10.0, 3.0, 1.0))
    scores = [left_out(few, pulled_least_squares(target(), pull, every)).score for pull in pulls]
    assert left_out(few, best_pulled(target(), described(), few)).score == min(scores)
    both = weighted_sum(statistics(60, 0.3).total, np.ones(3))
    found = pulled_least_squares(target(), {}, every)(both)
    np.testing.assert_allclose(found, least_squares_of_products(both))
    assert (deviations_to_try(target(), {}), deviations_to_try(target(), described())) == ((None,), DEVIATIONS)


def test_deviations_are_in_the_sizes_of_a_body() -> None:
    pull = near_described(target().model, described(), 0.5)
    columns = target().model.standard_columns
    owner = next(c.owner for c in columns if c.name in pull)
    names = [c.name for c in columns if c.owner == owner and c.name in pull]
    assert len(names) == 10
    J = pseudo_inertia([described()[name] for name in names])
    mass, length = J[3, 3], np.sqrt(np.trace(J[:3, :3]) / J[3, 3])
    expected = [mass] + 3 * [mass * length] + 6 * [mass * length**2]
    np.testing.assert_allclose([pull[name][1] for name in names], 0.5 * np.array(expected))
    np.testing.assert_allclose([pull[name][0] for name in names], [described()[name] for name in names])


# ---------------------------------------------------------------- choice


def test_few_data_hold_bodies_possible_and_near() -> None:
    recipe, choice = choose_bodies(statistics(12, 0.5), target(), described(), Recipe(delay=0.001))
    assert recipe.estimator == "physical"
    assert recipe.described_within is not None
    assert recipe.delay == 0.001
    assert choice.value.startswith("physically possible, within about")
    assert len(choice.candidates) == 1 + len(DEVIATIONS)
    scores = {c.value: c.score for c in choice.candidates}
    assert scores[choice.value] < scores["weighted"]
    assert "by least squares" in choice.reason
    recipe, choice = choose_bodies(statistics(2000, 0.1), target(), described(), Recipe())  # many data predict alike
    assert recipe.estimator == "physical"
    assert np.ptp([c.score for c in choice.candidates]) < 1e-3


def test_bodies_that_are_impossible_are_not_held() -> None:
    """Least squares predicts clearly better where the torques are those of no possible body."""
    recipe, choice = choose_bodies(statistics(500, 0.02, scale=-1.0), target(), described(), Recipe())
    assert (recipe.estimator, choice.value) == ("weighted", "weighted")
    assert "not held physically possible" in choice.reason


def test_least_squares_without_a_solution_of_the_cones(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise ConicSolverError("no solution")

    monkeypatch.setattr(scoring, "possible_fit", fails)
    recipe, choice = choose_bodies(statistics(60, 0.1), target(), described(), Recipe())
    assert recipe.estimator == "weighted"
    assert "the conic solver found none" in choice.reason
