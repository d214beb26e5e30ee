"""The largest deviation of any single parameter: brute-force NumPy, finite differences, laws, and a whole design."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from criterion_laws import check_gradient, information_matrix
from hypothesis import given
from hypothesis import strategies as st

import excite
from excite.information.weighting import minimised_text
from excite.registry import CRITERIA, instance
from excite.tasks.criteria import MaxDeviation
from excite.views.search_plot import convergence_figure

SEED = st.integers(0, 2**32 - 1)
SHARPNESS = st.sampled_from([1.0, 3.0, 16.0, 64.0])
CRITERION = MaxDeviation()


@given(SEED)
def test_value_is_the_largest_deviation_one_by_one(seed: int) -> None:
    """Parameter k alone: what column k shows beside all others, ``1 / (w_k' (E - P) w_k / N)``."""
    W = np.random.default_rng(seed).normal(size=(30, 4)) * np.logspace(-1, 1, 4)
    deviations = []
    for k in range(4):
        others = np.delete(W, k, axis=1)
        rest = W[:, k] - others @ np.linalg.lstsq(others, W[:, k])[0]
        deviations.append(np.sqrt(30) / np.linalg.norm(rest))
    assert CRITERION.value(W.T @ W / 30) == pytest.approx(max(deviations), rel=1e-9)


@given(SEED, SHARPNESS)
def test_stand_in_is_the_function_that_it_says(seed: int, p: float) -> None:
    M = information_matrix(seed)
    variances = np.diag(np.linalg.inv(M))
    most = variances.max()
    expected = (np.log(most) + np.log(np.sum((variances / most) ** p)) / p) / 2
    value, _ = CRITERION.smooth(M, p)
    assert value == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert -1e-12 <= value - np.log(CRITERION.value(M)) <= np.log(len(M)) / (2 * p) + 1e-12


@given(SEED, SHARPNESS)
def test_gradient_is_that_of_finite_differences(seed: int, p: float) -> None:
    check_gradient(CRITERION, information_matrix(seed), seed, p)


@given(SEED)
def test_it_is_between_the_mean_of_the_variances_and_the_worst_combination(seed: int) -> None:
    M = information_matrix(seed)
    mean = instance("criterion", "trace").value(M) / np.sqrt(len(M))
    worst = instance("criterion", "sigma-min").value(M)
    assert mean * (1 - 1e-9) <= CRITERION.value(M) <= worst * (1 + 1e-9)


def test_units_matter_and_the_order_of_parameters_does_not() -> None:
    M = information_matrix(3)
    order = np.array([3, 1, 4, 0, 2])
    assert CRITERION.value(M[np.ix_(order, order)]) == pytest.approx(CRITERION.value(M), rel=1e-12)
    assert CRITERION.value(4 * M) == pytest.approx(CRITERION.value(M) / 2, rel=1e-12)


@pytest.mark.parametrize("p", CRITERION.stages)
def test_singular_information(p: float) -> None:
    assert CRITERION.value(np.diag([0.0, 1.0])) == np.inf
    assert CRITERION.value(np.diag([1.0, -1e-20])) == np.inf
    value, G = CRITERION.smooth(np.diag([0.0, 1.0, 2.0]), p)
    assert value > 100
    assert np.all(np.isfinite(G))


@pytest.mark.slow
def test_a_design_for_it_has_the_least_such_deviation(tmp_path: Path) -> None:
    task = excite.Task("irp6", harmonics=3, friction=False, starts=2, executor="serial")
    designs = {name: excite.design_trajectory(task.changed(criterion=name)) for name in CRITERIA}
    best = designs[CRITERION.name]
    deviations = {name: max(p.standard_deviation for p in design.predicted) for name, design in designs.items()}
    assert min(deviations, key=lambda name: deviations[name]) == CRITERION.name
    assert minimised_text(best.task).startswith("max-deviation, base gautier")
    panel = convergence_figure(best).axes[0]
    assert panel.get_ylabel() == "max-deviation in the solver"
    assert panel.get_title(loc="left").startswith("minimised: max-deviation")
    best.save(tmp_path / "design")
    assert excite.load_design(tmp_path / "design").task == best.task
