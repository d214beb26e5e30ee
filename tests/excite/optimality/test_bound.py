"""How far a design is from the best possible: bounds that are stored, and what looser limits would gain."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from commands import Here
from written_files import saved

import excite
from constraints.certificate import limit_uses
from excite.cli.main import cli
from excite.design import interruption
from excite.design.design_json import load_design
from excite.design.formulation import formulate
from excite.design.interruption import answered_signals
from excite.design.problem import Problem
from excite.optimality import design_bound
from excite.optimality.cutting_planes import BOUNDED
from excite.optimality.design_bound import NAME, CriterionBound, DesignBound, bounded_problem_sha256, stored_bound
from excite.optimality.proven_factor import proven_factor
from excite.optimality.sensitivity import ProblemChanges, Sensitivity, SensitivityRow, same_motion, sensitivity
from excite.views.comparison_view import verdict_of
from regressors.errors import InputError, UnknownName


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("designs") / "one", design(("q3",)))


def known(design: excite.Design, folder: Path) -> DesignBound:
    """A bound of a design, as if computed, with the gain of one change."""
    criterion = CriterionBound("condition", "condition number", 10.0, True, 11.0, 1000, 20.0, 1.0)
    changes = Sensitivity("condition", 20.0, (SensitivityRow("6 harmonics instead of 3", 18.0, 0.1),), 1.5)
    hashes = bounded_problem_sha256(design), design.coefficients_sha256
    return DesignBound(str(folder), hashes[0], (criterion,), ("assumed",), hashes[1], changes)


def test_interrupted_changes_leave_the_bound(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("excite.optimality.design_bound.sensitivity", interrupted)
    found = excite.bound(load_design(folder), rounds=1)
    assert (found.sensitivity, len(found.criteria)) == (None, 1)
    assert excite.bound(load_design(folder), rounds=1, what_ifs=False).criteria[0].value == found.criteria[0].value


@pytest.mark.parametrize("stopped", ["sensitivity", "proven_factor"])
def test_a_signal_that_stopped_it_is_not_raised_again(
    stopped: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, own = list[int](), getattr(design_bound, stopped)

    def interrupted(*given: Any) -> Any:
        calls.append(1)
        return signal.raise_signal(signal.SIGTERM) if stopped == "sensitivity" or len(calls) == 2 else own(*given)

    monkeypatch.setattr(design_bound, stopped, interrupted)
    monkeypatch.setattr(interruption, "_AGAIN", 0.05)
    with answered_signals():
        found = excite.bound(load_design(folder), rounds=2)
        time.sleep(0.3)
    assert found.sensitivity is None


def test_a_stopped_command_keeps_the_bound_and_says_by_its_status_that_it_was_stopped(
    folder: Path, monkeypatch: pytest.MonkeyPatch, here: Here
) -> None:
    monkeypatch.setattr("excite.optimality.design_bound.sensitivity", lambda *_: os.kill(os.getpid(), signal.SIGTERM))
    shutil.copytree(folder, here.cwd / "one")
    assert "written: one/bound.json" in here.run("bound", "one", status=143).stdout
    assert stored_bound(load_design(here.cwd / "one")) is not None
    monkeypatch.undo()
    assert "bounds are read from bound.json; --force computes them again" in here.run("bound", "one").stdout


def test_an_interrupted_bound_is_what_was_proven_so_far(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls, proven = list[int](), design_bound.proven_factor

    def at_call(number: int) -> None:
        def interrupted(*given: Any) -> float | None:
            calls.append(1)
            if len(calls) == number:
                raise KeyboardInterrupt
            return proven(*given)

        calls.clear()
        monkeypatch.setattr(design_bound, "proven_factor", interrupted)

    at_call(2)
    bound = excite.bound(load_design(folder), rounds=2)
    assert bound.criteria[0].proven
    assert "interrupted" in bound.assumptions[-1]
    at_call(1)
    with pytest.raises(KeyboardInterrupt):
        excite.bound(load_design(folder), rounds=2)


def test_columns_that_few_coordinates_move_do_not_depend_on_the_others(one: excite.Design) -> None:
    planes = design_bound.cutting_planes(formulate(one.robot, one.task), one)
    few = planes.of_few(1, 1)
    assert few.states.n == 1 < planes.states.n
    S = planes.states.drawn(50, np.random.default_rng(0))
    (own,) = np.flatnonzero(few.rows.motion.matrix[:, 0] @ planes.rows.motion.matrix)
    Y, part = planes.rows(S), few.rows(S[:, [own, own + 2, own + 4]])
    for column in np.moveaxis(part, 2, 0):
        assert np.abs(Y - column[:, :, None]).max(axis=(0, 1)).min() < 1e-9


@pytest.mark.slow
def test_a_bound_of_seven_axes_is_proven_of_the_first_ones() -> None:
    made = excite.design_trajectory(excite.Task("panda").changed(starts=1, executor="serial", floor="none"))
    planes = design_bound.cutting_planes(formulate(made.robot, made.task), made)
    few = planes.of_few(2, 1)
    condition = BOUNDED["condition"]
    *_, (certificate, largest) = few.improving(condition, 2, np.random.default_rng(0))
    factor = proven_factor(certificate, largest, 0, lambda _: None)
    assert factor is not None
    assert 2.0 < condition.proven(certificate, factor) < made.condition_number


def test_a_bound_is_read_again_for_the_same_problem_only(one: excite.Design, tmp_path: Path) -> None:
    one.save(tmp_path)
    design, bound = load_design(tmp_path), known(one, tmp_path)
    assert bound.save(tmp_path) == [tmp_path / NAME]
    read = stored_bound(design)
    (reached,) = (each.reached for each in read.criteria)
    assert reached == pytest.approx(design.condition_number, rel=1e-12)  # of the motion, whatever the file says
    assert read == replace(bound, criteria=read.criteria)
    assert "from scratch may find more" in json.loads((tmp_path / NAME).read_text())["sensitivity"]["meaning"]
    for change in ({"velocity": 0.5}, {"harmonics": 4}, {"friction": False}, {"base": "pivoted"}):
        assert stored_bound(replace(design, task=design.task.changed(**change))) is None
    searched = replace(design, task=design.task.changed(starts=7, seed=3, criterion="logdet"))
    assert stored_bound(searched) == replace(read, sensitivity=None)  # which is of the other criterion
    for other in (
        replace(bound, coefficients="of another motion"),
        replace(bound, sensitivity=replace(bound.sensitivity, criterion="logdet")),
    ):
        other.save(tmp_path)
        assert stored_bound(design).sensitivity is None


def test_a_file_of_the_user_is_not_replaced(one: excite.Design, tmp_path: Path) -> None:
    (tmp_path / NAME).write_text(json.dumps({"schema": "mine"}))
    with pytest.raises(InputError, match="is not a bound"):
        known(one, tmp_path).save(tmp_path)


def test_the_verdict_says_whether_it_is_proven(one: excite.Design, tmp_path: Path) -> None:
    (proven,) = known(one, tmp_path).criteria
    assert "at most 2 times the best possible" in verdict_of(proven)
    assert "is proven" in verdict_of(proven)
    assert "estimated from 1,000 states" in verdict_of(replace(proven, proven=False))


def test_models_over_time_windows_are_refused(one: excite.Design) -> None:
    with pytest.raises(InputError, match="time windows"):
        excite.bound(replace(one, task=one.task.changed(model="energy")))
    with pytest.raises(UnknownName, match="criterion"):
        excite.bound(one, ["volume"])


@pytest.mark.slow
def test_bound_of_the_irp6_is_proven_and_below_every_motion() -> None:
    one = design(("q1", "q2", "q3"))
    (found,) = excite.bound(one).criteria
    assert found.proven
    assert 0.3 * one.condition_number < found.value <= found.estimate < found.reached
    assert found.reached == pytest.approx(one.condition_number)
    assert found.efficiency == pytest.approx(found.value / found.reached)


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
    return change.best(*change.looser(label, factor))[1]


def test_looser_limits_are_never_worse_and_only_used_ones_can_be_better(change: ProblemChanges) -> None:
    used = {use.label: use.use for use in change.uses(change.x)}
    gains = {label: change.gain(value_of(change, label)) for label, use in used.items() if use > 0.99}
    assert min(gains.values()) >= -1e-9
    assert max(gains.values()) > 0.01
    unused = min(used, key=lambda label: used[label])
    assert used[unused] < 0.6
    assert value_of(change, unused) == pytest.approx(change.reference, rel=1e-3)
    # the better motion goes beyond the looser limit alone
    best = max(gains, key=lambda label: gains[label])
    x, _ = change.best(*change.looser(best))
    uses = {use.label: use.use for use in change.uses(x)}
    assert 1.0 < uses.pop(best) <= 1.2
    assert max(uses.values()) <= 1.0


def test_a_factor_of_one_and_an_unknown_label_change_nothing(change: ProblemChanges) -> None:
    label = max(change.uses(change.x), key=lambda use: use.use).label
    same = value_of(change, label, 1.0)
    assert same == pytest.approx(change.reference, rel=1e-12)
    assert value_of(change, "no such limit") == same


def test_richer_and_longer_motions_keep_the_limits_at_every_instant(change: ProblemChanges) -> None:
    richer = change.richer()
    for changed in (richer, change.longer(), change.longer(5)):
        x, value = change.best(*changed)
        trajectory = changed[0].information.trajectory(x)
        uses = [use for limit in change.formulation.limits for use in limit_uses(limit, trajectory.extrema(limit))]
        assert all(use.holds for use in uses)
        assert value == pytest.approx(changed[0].exact_value(x), rel=1e-12)
    for limit, same in zip(change.formulation.problem.limits.linear, richer[0].limits.linear, strict=True):
        np.testing.assert_allclose(limit.upper, same.upper, rtol=1e-12)  # as tight on the grid of richer motions


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
    assert same_motion(problem, change.x, of_other_options(change, harmonics=2)) is None  # a poorer family


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
def test_the_command_adds_it_to_a_file_without_it_and_shows_it(one: excite.Design, tmp_path: Path) -> None:
    folder = saved(tmp_path / "one", one)
    replace(known(one, folder), sensitivity=None).save(folder)
    shown = CliRunner().invoke(cli, ["bound", str(folder)])
    assert shown.exit_code == 0, shown.output
    assert "6 harmonics instead of 3" in shown.output
    assert "not of the bound" in " ".join(shown.output.split())
    bound = stored_bound(load_design(folder))
    assert bound.criteria[0].value == 10.0
    read = json.loads(CliRunner().invoke(cli, ["bound", str(folder), "--json"]).stdout)
    assert [row["gain"] for row in read["sensitivity"]["rows"]] == [row.gain for row in bound.sensitivity.rows]


def test_a_file_without_it_is_read_and_a_damaged_one_named(one: excite.Design, tmp_path: Path) -> None:
    folder = saved(tmp_path / "one", one)
    known(one, folder).save(folder)
    content = json.loads((folder / NAME).read_text())
    del content["sensitivity"]
    (folder / "manifest.json").unlink()
    (folder / NAME).write_text(json.dumps(content))
    assert stored_bound(load_design(folder)).sensitivity is None
    (folder / NAME).write_text(json.dumps({**content, "sensitivity": {"rows": [{}]}}))
    with pytest.raises(InputError, match="run `excite bound` again"):
        stored_bound(load_design(folder))
