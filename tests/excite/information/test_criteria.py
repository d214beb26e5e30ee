"""The condition number's smooth stand-ins, and the whole chain from a motion's coefficients to the criterion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from criterion_laws import check_gradient, information_matrix, regressor
from hypothesis import given, strategies as st
from written_files import saved

import excite
from excite.information.weighting import minimised_text
from excite.registry import CRITERIA, instance
from excite.tasks.criteria import ConditionNumber, MaxDeviation, condition_number
from excite.views.search_plot import convergence_figure

SEED = st.integers(0, 2**32 - 1)
SHARPNESS = st.sampled_from([1.0, 2.0, 8.0, 32.0])
CRITERION = ConditionNumber()


# --- the criterion, as a function of M -------------------------------------------------------------------------------


def test_singular_and_very_large_matrices() -> None:
    assert condition_number(np.diag([1.0, 0.0])) == condition_number(np.diag([1.0, -1e-20])) == np.inf
    for name in CRITERIA:
        criterion = instance("criterion", name)
        assert criterion.value(np.diag([0.0, 1.0, 2.0])) > 1e100
        for p in criterion.stages:
            value, G = criterion.smooth(np.diag([0.0, 1.0, 2.0]), p)
            assert np.all(np.isfinite([value, *G.ravel()]))
    value, G = CRITERION.smooth(np.diag([1e-200, 1.0, 1e200]), 32.0)
    assert value == pytest.approx(200 * np.log(10.0), rel=1e-12)
    assert np.all(np.isfinite(G))


@given(SEED, SHARPNESS)
def test_gradient_equals_finite_differences(seed: int, p: float) -> None:
    check_gradient(CRITERION, information_matrix(seed, 6, 40), seed, p)


@given(SEED, SHARPNESS)
def test_stand_in_is_the_function_that_it_says(seed: int, p: float) -> None:
    """``(1/2p) (log tr M^p + log tr M^-p)`` by matrix powers."""
    M = information_matrix(seed, 6, 40)
    M = M / np.linalg.norm(M, 2)
    powers = [np.linalg.matrix_power(matrix, int(p)) for matrix in (M, np.linalg.inv(M))]
    expected = sum(np.log(np.trace(power)) for power in powers) / (2 * p)
    assert CRITERION.smooth(M, p)[0] == pytest.approx(expected, rel=1e-8)


@given(SEED, SHARPNESS)
def test_stand_in_is_an_upper_bound_and_tends_to_the_condition_number(seed: int, p: float) -> None:
    M = information_matrix(seed, 6, 40)
    log_cond = np.log(condition_number(M))
    value, sharper = CRITERION.smooth(M, p)[0], CRITERION.smooth(M, 2 * p)[0]
    assert log_cond - 1e-9 <= sharper <= value + 1e-12  # eigenvalues of M are good to 1e-16 of the largest
    assert value - log_cond <= np.log(len(M)) / p + 1e-12  # each trace counts the extreme eigenvalue at most b times
    assert CRITERION.smooth(M, 1e6)[0] == pytest.approx(log_cond, abs=1e-5)


# --- the other criteria ----------------------------------------------------------------------------------------------


DEFINITIONS = {
    "condition": lambda M: np.linalg.cond(np.linalg.cholesky(M).T),
    "frobenius": lambda M: np.linalg.norm(np.linalg.cholesky(M)) * np.linalg.norm(np.linalg.inv(np.linalg.cholesky(M))),
    "sigma-min": lambda M: 1 / np.linalg.svd(np.linalg.cholesky(M), compute_uv=False)[-1],
    "logdet": lambda M: np.linalg.det(M) ** (-0.5 / len(M)),
    "trace": lambda M: np.sqrt(np.trace(np.linalg.inv(M))),
}


@pytest.mark.parametrize("name", DEFINITIONS)
def test_value_is_that_of_its_definition(name: str) -> None:
    M = information_matrix(1, 6, 40)
    assert instance("criterion", name).value(M) == pytest.approx(DEFINITIONS[name](M), rel=1e-10)


@pytest.mark.parametrize("name", CRITERIA)
def test_stand_in_is_its_logarithm_in_the_end(name: str) -> None:
    M, made = information_matrix(2, 6, 40), instance("criterion", name)
    sharpest = np.inf if len(made.stages) == 1 else 4096.0
    value, _ = made.smooth(M, min(sharpest, 4096.0))
    assert value == pytest.approx(np.log(made.value(M)), abs=1e-3)
    assert made.smooth(M, made.stages[0])[0] >= np.log(made.value(M)) - 1e-12


@pytest.mark.parametrize("name", CRITERIA)
def test_gradient_of_every_stage_is_that_of_finite_differences(name: str) -> None:
    made = instance("criterion", name)
    for sharpness in made.stages:
        check_gradient(made, information_matrix(3, 6, 40), 4, sharpness)


EXPONENT = st.sampled_from([1.0, 3.0, 16.0, 64.0])
LARGEST = MaxDeviation()


@given(SEED)
def test_value_is_the_largest_deviation_one_by_one(seed: int) -> None:
    """Parameter k alone: what column k shows beside all others, ``1 / (w_k' (E - P) w_k / N)``."""
    W, deviations = regressor(seed), []
    for k in range(5):
        others = np.delete(W, k, axis=1)
        rest = W[:, k] - others @ np.linalg.lstsq(others, W[:, k])[0]
        deviations.append(np.sqrt(30) / np.linalg.norm(rest))
    assert LARGEST.value(W.T @ W / 30) == pytest.approx(max(deviations), rel=1e-9)


@given(SEED, EXPONENT)
def test_stand_in_of_the_largest_deviation_is_the_function_that_it_says(seed: int, p: float) -> None:
    M = information_matrix(seed)
    variances = np.diag(np.linalg.inv(M))
    most = variances.max()
    expected = (np.log(most) + np.log(np.sum((variances / most) ** p)) / p) / 2
    value, _ = LARGEST.smooth(M, p)
    assert value == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert -1e-12 <= value - np.log(LARGEST.value(M)) <= np.log(len(M)) / (2 * p) + 1e-12


@pytest.mark.slow
def test_a_design_for_the_largest_deviation_has_the_least(tmp_path: Path) -> None:
    task = excite.Task("irp6", harmonics=3, friction=False, starts=2, executor="serial")
    designs = {name: excite.design_trajectory(task.changed(criterion=name)) for name in CRITERIA}
    best = designs[LARGEST.name]
    deviations = {name: max(p.standard_deviation for p in design.predicted) for name, design in designs.items()}
    assert min(deviations, key=lambda name: deviations[name]) == LARGEST.name
    assert minimised_text(best.task).startswith("max-deviation, base gautier")
    panel = convergence_figure(best).axes[0]
    assert panel.get_ylabel() == "max-deviation in the solver"
    assert panel.get_title(loc="left").startswith("minimised: max-deviation")
    assert excite.load_design(saved(tmp_path / "design", best)).task == best.task
