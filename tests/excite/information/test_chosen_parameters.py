"""Criteria on chosen parameters: the Schur complement against slow linear algebra, finite differences, and designs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from criterion_laws import check_design_pays, check_gradient, information_matrix
from criterion_laws import regressor as regressor_of
from hypothesis import given
from hypothesis import strategies as st

import excite
from excite.design.formulation import formulate
from excite.information.goal import ChosenParameters, goal_of
from excite.information.target import target_of
from excite.registry import instance
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import load_robot
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)
NAMES = ("condition", "frobenius", "sigma-min", "logdet", "trace", "max-deviation")
CHOSEN = (4, 1, 2)


def regressor(seed: int) -> Array:
    return regressor_of(seed, 6, 40)


def of_chosen(name: str = "trace", chosen: tuple[int, ...] = CHOSEN) -> ChosenParameters:
    return ChosenParameters(instance("criterion", name), chosen)


@given(SEED, st.sampled_from(NAMES))
def test_criterion_is_that_of_what_the_other_columns_do_not_explain(seed: int, name: str) -> None:
    W = regressor(seed)
    others = np.delete(W, CHOSEN, axis=1)
    rest = W[:, CHOSEN] - others @ np.linalg.lstsq(others, W[:, CHOSEN])[0]
    expected = instance("criterion", name).value(rest.T @ rest / 40)
    assert of_chosen(name).value(W.T @ W / 40) == pytest.approx(expected, rel=1e-8)


@given(SEED, st.sampled_from(NAMES), st.sampled_from([1.0, 4.0, 16.0]))
def test_gradient_is_that_of_finite_differences(seed: int, name: str, p: float) -> None:
    M, criterion = information_matrix(seed, 6, 40), of_chosen(name)
    check_gradient(criterion, M, seed, p)
    value, _, reported = criterion.smooth_and_value(M, p)
    assert (value, reported) == (criterion.smooth(M, p)[0], pytest.approx(criterion.value(M), rel=1e-12))


@given(SEED, st.sampled_from(NAMES))
def test_how_the_other_parameters_are_chosen_does_not_matter(seed: int, name: str) -> None:
    """Other nuisance parameters: combinations of them, and of the chosen ones, ``beta_N -> A beta_N + B beta_S``."""
    W, rng = regressor(seed), np.random.default_rng(seed + 1)
    others = [k for k in range(6) if k not in CHOSEN]
    T = np.eye(6)
    T[np.ix_(others, others)] = rng.normal(size=(3, 3)) + 4 * np.eye(3)
    T[np.ix_(others, CHOSEN)] = rng.normal(size=(3, 3))
    M = W.T @ W / 40
    assert of_chosen(name).value(T.T @ M @ T) == pytest.approx(of_chosen(name).value(M), rel=1e-7)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("hidden", [1, 3])
def test_singular_information(name: str, hidden: int) -> None:
    """Of a chosen parameter, or of another one."""
    W = regressor(2)
    W[:, hidden] = W[:, 0] - W[:, 5]
    M = W.T @ W / 40
    M[hidden] = M[:, hidden] = 0.0
    value, G = of_chosen(name).smooth(M, 4.0)
    assert of_chosen(name).value(M) == np.inf
    assert np.isfinite(value)
    assert np.all(np.isfinite(G))


# --- names and groups ------------------------------------------------------------------------------------------------

ALL = ("X1", "X2", "X3", "X4", "X5", "X6", "X7", "F1c", "F2c", "F3c", "F1v", "F2v", "F3v")
GROUPS = {
    ("X5", "F3c"): ("X5", "F3c"),
    ("friction",): ALL[7:],
    ("coulomb",): ALL[7:10],
    ("viscous", "F1c"): ("F1c", *ALL[10:]),
    ("inertial",): ALL[:7],
    ("gravity",): ("X6", "X7"),
    ("inertia",): ALL[:5],
}


@pytest.mark.parametrize(("interest", "expected"), GROUPS.items())
def test_names_and_groups(interest: tuple[str, ...], expected: tuple[str, ...]) -> None:
    task = Task("irp6", interest=interest)
    chosen = goal_of(target_of(load_robot("irp6"), task), task).chosen
    assert {ALL[k] for k in chosen} == set(expected)


def test_names_of_another_base() -> None:
    task = Task("panda", friction=False, base="pivoted", interest=("I2yz", "I4yy"))
    target = target_of(load_robot("panda"), task)
    for name, chosen in zip(task.objective.interest, goal_of(target, task).chosen, strict=True):
        column = target.base.D[:, target.model.names.index(name)]
        np.testing.assert_allclose(target.transforms["pivoted"][:, chosen], column, atol=1e-12)


REFUSED = {
    "no such name": ({"interest": ("X99",)}, "X99"),
    "a part of a base parameter": ({"robot": "panda", "interest": ("m4",)}, "m4 is not identifiable on its own"),
    "an empty group": ({"interest": ("rotor",)}, "no base parameter is one of the group rotor"),
    "one condition number": ({"interest": ("X5",)}, "is always 1"),
    "no single parameters": ({"interest": ("X5",), "base": "orthonormal"}, "choose another `base`"),
}


@pytest.mark.parametrize(("options", "message"), REFUSED.values(), ids=REFUSED)
def test_refused(options: dict[str, str], message: str) -> None:
    options = {"robot": "irp6", **options}
    with pytest.raises(InputError, match=message):
        formulate(load_robot(options["robot"]), Task(**options))


# --- the whole chain -------------------------------------------------------------------------------------------------


def test_the_other_parameters_stay_identifiable() -> None:
    """The best motion for gravity alone would hardly move, and leave five parameters of thirteen unknown."""
    options = {"criterion": "trace", "noise": (2.0, 8.0, 4.0), "weighted": True, "starts": 2, "executor": "serial"}
    design = excite.design_trajectory(Task("irp6", interest=("gravity",), **options))
    assert design.condition_number < 2000
    assert not design.nearly_unidentifiable


@given(SEED, st.sampled_from(NAMES))
def test_what_is_minimised_has_a_part_of_the_volume_of_all(seed: int, name: str) -> None:
    W = regressor(seed)
    M = W.T @ W / 40
    others = np.delete(W, CHOSEN, axis=1)
    rest = W[:, CHOSEN] - others @ np.linalg.lstsq(others, W[:, CHOSEN])[0]
    own = instance("criterion", name).smooth(rest.T @ rest / 40, 4.0)[0]
    volume = np.log(instance("criterion", "logdet").value(M))
    assert of_chosen(name).smooth(M, 4.0)[0] == pytest.approx(own + 0.05 * volume, rel=1e-8, abs=1e-8)


def test_designs(tmp_path: Path) -> None:
    task = Task("irp6", harmonics=3, starts=1, executor="serial", criterion="trace")
    plain = excite.design_trajectory(task)
    own = excite.design_trajectory(task.changed(interest=("X1", "friction"), begin=plain))
    chosen = {"X1", *ALL[7:]}
    variances = sum(p.standard_deviation**2 for p in own.predicted if p.name in chosen) * own.rows / 3
    assert own.minimised_value == pytest.approx(np.sqrt(variances), rel=1e-9)
    stored = check_design_pays(own, plain, tmp_path / "design")
    assert stored.minimised_value == own.minimised_value
