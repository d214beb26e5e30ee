from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import excite
from constraints.certificate import limit_uses
from excite.cli.main import cli
from excite.design.design_json import load_design
from excite.design.formulation import formulate
from excite.design.problem import Problem
from excite.optimality.design_bound import NAME, CriterionBound, DesignBound, bounded_problem_sha256, stored_bound
from excite.optimality.sensitivity import (
    ProblemChanges,
    Sensitivity,
    SensitivityRow,
    loosened,
    same_motion,
    sensitivity,
)
from regressors.errors import InputError

FAMILIES: dict[str, dict[str, Any]] = {
    "fourier": {"harmonics": 3},
    "cosine": {"harmonics": 4},
    "bspline": {"intervals": 8},
    "fourier-quintic": {"harmonics": 3},
}


def design(joints: tuple[str, ...] = ("q2", "q3"), **options: Any) -> excite.Design:
    chosen = {"period": 5.0, "harmonics": 3, "starts": 1, "executor": "serial", **options}
    return excite.design_trajectory(excite.Task("irp6").changed(joints=joints, **chosen))


@pytest.fixture(scope="module")
def one() -> excite.Design:
    return design()


@pytest.fixture(scope="module")
def change(one: excite.Design) -> ProblemChanges:
    return ProblemChanges.of(one)


def of_other_options(change: ProblemChanges, **options: object) -> Problem:
    task = change.formulation.task.changed(**options)
    return replace(change.formulation.blueprint, task=task).problem()


def value_of(change: ProblemChanges, label: str, factor: float = 1.2) -> float:
    return change.looser(label, factor).best(change.solver)[1]


def test_looser_limits_are_never_worse_and_used_ones_can_be_better(change: ProblemChanges) -> None:
    gains = {use.label: change.gain(value_of(change, use.label)) for use in change.uses(change.x) if use.use > 0.99}
    assert min(gains.values()) >= -1e-9
    assert max(gains.values()) > 0.01


def test_the_better_motion_goes_beyond_the_looser_limit_alone(change: ProblemChanges) -> None:
    used = [use.label for use in change.uses(change.x) if use.use > 0.99]
    label = max(used, key=lambda label: change.gain(value_of(change, label)))
    x, _ = change.looser(label).best(change.solver)
    uses = {use.label: use.use for use in change.uses(x)}
    assert 1.0 < uses.pop(label) <= 1.2
    assert max(uses.values()) <= 1.0


def test_a_limit_that_is_not_used_brings_nothing(change: ProblemChanges) -> None:
    unused = min(change.uses(change.x), key=lambda use: use.use)
    assert unused.use < 0.6
    assert value_of(change, unused.label) == pytest.approx(change.reference, rel=1e-3)


def test_a_factor_of_one_and_an_unknown_label_change_nothing(change: ProblemChanges) -> None:
    label = max(change.uses(change.x), key=lambda use: use.use).label
    same = value_of(change, label, 1.0)
    assert same == pytest.approx(change.reference, rel=1e-12)
    assert value_of(change, "no such limit") == same


def test_richer_and_longer_motions_keep_the_limits_at_every_instant(change: ProblemChanges) -> None:
    for changed in (change.richer(), change.longer(), change.longer(5)):
        assert changed is not None
        x, value = changed.best(change.solver)
        trajectory = changed.problem.information.trajectory(x)
        uses = [use for limit in change.formulation.limits for use in limit_uses(limit, trajectory.extrema(limit))]
        assert all(use.holds for use in uses)
        assert value == pytest.approx(changed.problem.exact_value(x), rel=1e-12)


def test_richer_motions_have_limits_as_tight_on_their_grid(change: ProblemChanges) -> None:
    richer = change.richer()
    assert richer is not None
    for limit, same in zip(change.formulation.problem.limits.linear, richer.problem.limits.linear, strict=True):
        np.testing.assert_allclose(limit.upper, same.upper, rtol=1e-12)


@pytest.mark.slow
def test_looser_bounds_are_those_of_a_task_with_looser_limits() -> None:
    task = excite.Task("irp6").changed(joints=("q2", "q3"), period=5.0, harmonics=3)
    robot = excite.load_robot("irp6")
    tight, loose = (formulate(robot, task.changed(velocity=limit)).problem.limits.linear for limit in (0.5, 0.6))
    (k,) = (k for k, limit in enumerate(tight) if "joint q2 velocity" in limit.function.constraint.labels)
    row = tight[k].function.constraint.labels.index("joint q2 velocity")
    changed = loosened(tight[k], "joint q2 velocity", 1.2)
    for name in ("lower", "upper", "scale"):
        assert getattr(changed, name)[row] == pytest.approx(getattr(loose[k], name)[row], rel=1e-12)
        np.testing.assert_array_equal(np.delete(getattr(changed, name), row), np.delete(getattr(tight[k], name), row))


@pytest.mark.parametrize("options", [{"harmonics": 6}, {"period": 7.5}, {"period": 7.5, "harmonics": 5}], ids=str)
def test_the_motion_is_embedded_exactly(change: ProblemChanges, options: dict[str, object]) -> None:
    problem, other = change.formulation.problem, of_other_options(change, **options)
    x = same_motion(problem, change.x, other)
    assert x is not None
    u = np.linspace(0.0, 1.0, 77)
    before = problem.family.motion(change.x, u * problem.family.duration, 0)
    np.testing.assert_allclose(other.family.motion(x, u * other.family.duration, 0), before, atol=1e-9)
    if "period" not in options:
        assert other.exact_value(x) == pytest.approx(problem.exact_value(change.x), rel=1e-9)
        assert change.reference <= problem.exact_value(change.x)


def test_a_poorer_family_does_not_have_the_motion(change: ProblemChanges) -> None:
    assert same_motion(change.formulation.problem, change.x, of_other_options(change, harmonics=2)) is None


def test_harmonics_that_the_samples_cannot_tell_apart_are_left_out(change: ProblemChanges) -> None:
    task = change.formulation.task.changed(rate=2.0)
    coarse = replace(change, formulation=replace(change.formulation, task=task))
    assert coarse.richer() is None
    assert coarse.longer() is not None


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_rows_of_every_linear_family_are_sorted_and_richer_motions_are_no_worse(family: str) -> None:
    found = sensitivity(design(trajectory=family, **FAMILIES[family]))
    gains = [row.gain for row in found.rows]
    assert gains == sorted(gains, reverse=True)
    assert all(gain >= -1e-9 for row, gain in zip(found.rows, gains, strict=True) if " s instead" not in row.change)
    ((option, count),) = FAMILIES[family].items()
    assert f"{2 * count} {option} instead of {count}" in {row.change for row in found.rows}
    for row in found.rows:
        assert row.gain == pytest.approx(1 - row.value / found.reference, abs=1e-12)


@pytest.mark.slow
def test_the_arm_gains_by_harmonics() -> None:
    arm = design(("q1", "q2", "q3"), period=10.0, harmonics=5, starts=4)
    found = sensitivity(arm)
    assert found.reference <= arm.condition_number * (1 + 1e-12)
    rows = {row.change: row for row in found.rows}
    assert rows["10 harmonics instead of 5"].gain > 0.05
    assert {"15 s instead of 10 s", "15 s instead of 10 s, with 8 harmonics"} < set(rows)


def stored(one: excite.Design, folder: Path) -> DesignBound:
    criterion = CriterionBound("condition", "condition number", 10.0, True, 11.0, 1000, 20.0, 1.0)
    changes = Sensitivity("condition", 20.0, (SensitivityRow("6 harmonics instead of 3", 18.0, 0.1),), 1.5)
    problem, hashed = bounded_problem_sha256(one), one.coefficients_sha256
    bound = DesignBound(str(folder), problem, (criterion,), ("assumed",), hashed, changes)
    bound.save(folder)
    return bound


def test_it_is_stored_and_read_back_for_the_same_motion_only(one: excite.Design, tmp_path: Path) -> None:
    folder = tmp_path / "one"
    one.save(folder)
    bound, design = stored(one, folder), load_design(folder)
    read = stored_bound(design)
    assert read is not None
    reached = [each.reached for each in read.criteria]
    assert reached == pytest.approx([design.condition_number], rel=1e-12)  # of the motion, whatever the file says
    assert read == replace(bound, criteria=read.criteria)
    assert "from scratch may find more" in json.loads((folder / NAME).read_text())["sensitivity"]["meaning"]
    replace(bound, coefficients="of another motion").save(folder)
    assert stored_bound(design).sensitivity is None  # type: ignore[union-attr]
    replace(bound, sensitivity=replace(bound.sensitivity, criterion="logdet")).save(folder)  # type: ignore[type-var]
    assert stored_bound(design).sensitivity is None  # type: ignore[union-attr]


@pytest.mark.slow
def test_the_command_adds_it_to_a_file_without_it_and_shows_it(one: excite.Design, tmp_path: Path) -> None:
    folder = tmp_path / "one"
    one.save(folder)
    replace(stored(one, folder), sensitivity=None).save(folder)
    shown = CliRunner().invoke(cli, ["bound", str(folder)])
    assert shown.exit_code == 0, shown.output
    assert "6 harmonics instead of 3" in shown.output
    assert "not of the bound" in " ".join(shown.output.split())
    bound = stored_bound(load_design(folder))
    assert bound is not None
    assert bound.criteria[0].value == 10.0
    assert bound.sensitivity is not None
    read = json.loads(CliRunner().invoke(cli, ["bound", str(folder), "--json"]).stdout)
    assert [row["gain"] for row in read["sensitivity"]["rows"]] == [row.gain for row in bound.sensitivity.rows]


def test_a_file_without_it_is_read_and_a_damaged_one_named(one: excite.Design, tmp_path: Path) -> None:
    folder = tmp_path / "one"
    one.save(folder)
    stored(one, folder)
    content = json.loads((folder / NAME).read_text())
    del content["sensitivity"]
    (folder / "manifest.json").unlink()
    (folder / NAME).write_text(json.dumps(content))
    read = stored_bound(load_design(folder))
    assert read is not None
    assert read.sensitivity is None
    (folder / NAME).write_text(json.dumps({**content, "sensitivity": {"rows": [{}]}}))
    with pytest.raises(InputError, match="run `excite bound` again"):
        stored_bound(load_design(folder))
