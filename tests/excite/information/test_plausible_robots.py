"""The worst of plausible robots: drawn values by hand, finite differences, and a design."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from criterion_laws import check_design_pays, check_gradient, information_matrix
from hypothesis import given, settings
from hypothesis import strategies as st

import excite
from excite.information.goal import WorstRobot, goal_of
from excite.information.target import target_of
from excite.registry import instance
from excite.tasks.objective import Belief
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import load_robot
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)
NAMES = ("condition", "trace", "max-deviation", "sigma-min")
RELATIVE = {"criterion": "trace", "scale": "value", "noise": (2.0, 8.0, 4.0)}


def ratios_and_matrix(seed: int, b: int = 4) -> tuple[Array, Array]:
    return np.exp(np.random.default_rng(seed).normal(size=(6, b))), information_matrix(seed, b)


@settings(max_examples=30)
@given(SEED, st.sampled_from(NAMES))
def test_value_is_the_worst_one(seed: int, name: str) -> None:
    ratios, M = ratios_and_matrix(seed)
    criterion = instance("criterion", name)
    values = [criterion.value(np.diag(r) @ M @ np.diag(r)) for r in ratios]
    worst = WorstRobot(criterion, ratios)
    assert worst.value(M) == pytest.approx(max(values), rel=1e-9)
    stand_in = [worst.smooth(M, p)[0] for p in worst.stages]
    assert min(stand_in) >= np.log(max(values)) - 1e-9
    exact = max(criterion.smooth(np.diag(r) @ M @ np.diag(r), 64.0)[0] for r in ratios)
    assert stand_in[-1] == pytest.approx(exact, abs=np.log(6) / 256 + 1e-12)


@settings(max_examples=30)
@given(SEED, st.sampled_from(NAMES), st.sampled_from([1.0, 4.0]))
def test_gradient_is_that_of_finite_differences(seed: int, name: str, p: float) -> None:
    ratios, M = ratios_and_matrix(seed)
    check_gradient(WorstRobot(instance("criterion", name), ratios), M, seed, p, 1e-3)


def test_robots_are_drawn_from_the_prior() -> None:
    """Of parameters that are columns themselves: ``|value + deviation z| / |value|``, at least their prior share."""
    known = (Belief("X7", 8.0, 0.8), Belief("F2c", 20.0, 30.0))
    task = Task("irp6", prior=known, plausible_robots=400, **RELATIVE)
    target = target_of(load_robot("irp6"), task)
    ratios = goal_of(target, task).ratios
    assert ratios.shape == (401, 13)
    assert ratios[0] == pytest.approx(np.where(np.array(target.base.names) == "F2c", 1.5, 1.0))
    by_name = dict(zip(target.base.names, ratios[1:].T, strict=True))
    assert np.mean(by_name["X7"]) == pytest.approx(1.0, abs=0.02)
    assert np.std(by_name["X7"]) == pytest.approx(0.1, rel=0.1)
    assert by_name["F2c"].min() == pytest.approx(1.5)  # its deviation over its value
    assert by_name["X1"] == pytest.approx(1.0)  # nothing is said of it
    again = goal_of(target, task).ratios
    np.testing.assert_array_equal(again, ratios)


@pytest.mark.parametrize("options", [{"prior": 0.2}, {"scale": "value"}, {"prior": 0.2, "scale": "prior"}], ids=str)
def test_needs_values_that_are_not_certain(options: dict[str, object]) -> None:
    with pytest.raises(InputError, match="`plausible_robots` are drawn from prior knowledge"):
        Task("irp6", plausible_robots=5, **options)


def test_not_for_torques() -> None:
    task = Task("irp6", prior=0.2, plausible_robots=5, **{**RELATIVE, "criterion": "torque-deviation"})
    with pytest.raises(InputError, match="leave `plausible_robots` out"):
        goal_of(target_of(load_robot("irp6"), task), task)


@pytest.mark.slow
def test_designs(tmp_path: Path) -> None:
    options = {**RELATIVE, "harmonics": 3, "starts": 1, "executor": "serial", "prior": 0.2}
    plain = excite.design_trajectory(Task("irp6", **options))
    worst = excite.design_trajectory(Task("irp6", plausible_robots=8, begin=plain, **options))
    check_design_pays(worst, plain, tmp_path / "design")
