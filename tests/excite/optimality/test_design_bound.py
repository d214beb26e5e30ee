from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import excite
from excite.design.design_json import load_design
from excite.optimality.design_bound import NAME, CriterionBound, DesignBound, bounded_problem_sha256, stored_bound
from excite.views.bound_view import verdict_of
from regressors.errors import InputError, UnknownName


def design(joints: tuple[str, ...] = ("q3",), **options: object) -> excite.Design:
    task = excite.Task("irp6").changed(joints=joints, period=5.0, harmonics=3, starts=1, executor="serial", **options)
    return excite.design_trajectory(task)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("designs") / "one"
    design().save(place)
    return place


def known(name: str, problem: str | None) -> DesignBound:
    criterion = CriterionBound("condition", "condition number", 10.0, True, 11.0, 1000, 20.0, 1.0)
    return DesignBound(name, problem, (criterion,), ("assumed",))


@pytest.mark.slow
def test_bound_of_one_joint_is_proven_and_below_every_motion(folder: Path) -> None:
    (found,) = excite.bound(load_design(folder), rounds=4).criteria
    assert found.proven
    assert 1.0 < found.value <= found.estimate * (1 + 1e-3)
    assert found.estimate <= found.reached == pytest.approx(load_design(folder).condition_number)
    assert 0.2 < found.efficiency <= 1.0


def test_a_bound_is_read_again_for_the_same_problem_only(folder: Path) -> None:
    one = load_design(folder)
    bound = replace(known(str(folder), bounded_problem_sha256(one)), coefficients=one.coefficients_sha256)
    assert bound.save(folder) == [folder / NAME]
    # What the design reaches is computed, whatever the file says.
    bound = replace(bound, criteria=(replace(bound.criteria[0], reached=pytest.approx(one.condition_number)),))
    assert stored_bound(one) == bound
    for change in ({"velocity": 0.5}, {"harmonics": 4}, {"friction": False}, {"base": "pivoted"}):
        other = replace(one, task=one.task.changed(**change))
        assert stored_bound(other) is None
    searched = replace(one, task=one.task.changed(starts=7, seed=3, criterion="logdet"))
    assert stored_bound(searched) == bound


def test_another_motion_of_the_same_problem_is_judged_by_itself(folder: Path) -> None:
    one = load_design(folder)
    replace(known(str(folder), bounded_problem_sha256(one)), coefficients="other").save(folder)
    stored = stored_bound(one)
    assert stored is not None
    assert stored.criteria[0].reached == pytest.approx(one.condition_number)


def test_a_file_of_the_user_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / NAME).write_text(json.dumps({"schema": "mine"}))
    with pytest.raises(InputError, match="is not a bound"):
        known("design", None).save(tmp_path)


def test_a_damaged_bound_is_named(folder: Path) -> None:
    problem = bounded_problem_sha256(load_design(folder))
    (folder / NAME).write_text(json.dumps({"schema": "excite.bound/1", "problem": problem, "criteria": [{}]}))
    with pytest.raises(InputError, match="run `excite bound` again"):
        stored_bound(load_design(folder))
    (folder / NAME).unlink()


def test_the_verdict_says_whether_it_is_proven() -> None:
    (proven,) = known("design", None).criteria
    assert "at most 2 times the best possible" in verdict_of(proven)
    assert "is proven" in verdict_of(proven)
    assert "estimated from 1,000 states" in verdict_of(replace(proven, proven=False))


def test_models_over_time_windows_are_refused(folder: Path) -> None:
    one = load_design(folder)
    energy = replace(one, task=one.task.changed(model="energy"))
    with pytest.raises(InputError, match="time windows"):
        excite.bound(energy)
    with pytest.raises(UnknownName, match="criterion"):
        excite.bound(one, ["volume"])


@pytest.mark.slow
def test_bound_of_the_irp6_is_proven() -> None:
    one = design(("q1", "q2", "q3"))
    (found,) = excite.bound(one).criteria
    assert found.proven
    assert 0.3 * one.condition_number < found.value <= found.estimate < one.condition_number
