"""Searches that combine motions: the same motion wherever they run, and however often they were interrupted."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import excite
from excite.design.formulation import formulate
from excite.design.initial_guesses import combinations, random_motion
from excite.design.problem import Problem
from excite.design.start_results import StartResult, read_starts
from excite.registry import instance
from excite.tasks.task import Task
from regressors.readers.library import load_robot

SMALL: dict[str, Any] = {"joints": ("1",), "harmonics": 3, "rate": 20.0, "torque_margin": "none"}


def design(folder: Path, **options: Any) -> excite.Design:
    folder.mkdir(exist_ok=True)
    return excite.design_trajectory(
        Task("irp6", **SMALL, **{"rounds": 3, "executor": "serial", **options}), folder=folder
    )


def ends(results: Sequence[StartResult]) -> list[tuple[Any, ...]]:
    return [(r.index, r.x, r.value, r.parents, r.lineage) for r in results]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> excite.Design:
    return design(tmp_path_factory.mktemp("undisturbed"))


def problem_of(**options: Any) -> Problem:
    return formulate(load_robot("irp6"), Task("irp6", **options)).problem


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [{"harmonics": 3}, {"harmonics": 3, "tool_speed": 0.3}, {"trajectory": "sines", "harmonics": 3}],
    ids=["linear limits", "a nonlinear limit", "a nonlinear family"],
)
def test_combinations_keep_the_limits(options: dict[str, Any]) -> None:
    problem = problem_of(**options)
    rng = np.random.default_rng(1)
    parents = [random_motion(problem, rng) for _ in range(2)]
    for motions in (parents, parents[:1]):
        for x in combinations(problem, motions, rng, 12):
            assert x.shape == parents[0].shape
            assert problem.violation(x) <= 1e-9
            assert problem.nonlinear_hold(x)


def test_joints_are_exchanged_mirrored_and_renewed() -> None:
    """Without limits in the way, each coordinate of a combination is that of a parent, mirrored, new, or in between."""
    problem = problem_of(harmonics=3, velocity=(50.0,), acceleration=(500.0,))
    rng = np.random.default_rng(3)
    a, b = (problem.drawn(random_motion(problem, rng), 0.1) for _ in range(2))
    seen = set()
    for x in combinations(problem, [a, b], rng, 60):
        of_a, of_b = (np.isclose(x, parent, atol=1e-12).all(axis=1) for parent in (a, b))
        mirrored = np.isclose(x - problem.rest, problem.rest - a, atol=1e-12).all(axis=1)
        seen.add((int(of_a.sum()), int(of_b.sum()), int(mirrored.sum())))
    assert {(2, 1, 0), (1, 2, 0)} & seen, "exchanged"
    assert (2, 0, 1) in seen, "mirrored"
    assert (2, 0, 0) in seen, "renewed"
    assert (0, 0, 0) in seen, "between"


def test_combinations_of_local_minima_are_solved_to_others() -> None:
    problem, method = problem_of(harmonics=3), instance("solver", "sqp")
    rng = np.random.default_rng(0)
    known = [method.solve(problem, [random_motion(problem, rng)]).x for _ in range(2)]
    result = method.combine(problem, combinations(problem, known, rng), known)
    assert problem.violation(result.x) <= 0.0
    assert result.value == pytest.approx(problem.criterion_value(problem.point(result.x, 64.0)))
    refined = method.refine(problem, result.x)
    assert refined.value <= result.value


@pytest.mark.slow
def test_the_search_is_the_same_in_processes(undisturbed: excite.Design, tmp_path: Path) -> None:
    for workers in (1, 2):
        other = design(tmp_path / str(workers), executor="process", workers=workers)
        assert ends(other.starts) == ends(undisturbed.starts)
    kinds = [len(start.parents) for start in undisturbed.starts]
    assert kinds[:4] == [0, 0, 0, 0]
    assert max(kinds[4:-1], default=1) > 0
    assert kinds[-1] == 1
    assert undisturbed.search is not None
    assert undisturbed.search.rounds == 3


def test_finished_starts_of_any_round_are_kept(undisturbed: excite.Design, tmp_path: Path) -> None:
    design(tmp_path)
    files = {path.name: path.read_bytes() for path in sorted(tmp_path.iterdir())}
    for name in ("start-0002.json", "start-0009.json"):
        (tmp_path / name).unlink()
    ran: list[int] = []
    task = Task("irp6", **SMALL, rounds=3, executor="serial")
    again = excite.design_trajectory(task, folder=tmp_path, progress=lambda result: ran.append(result.index))
    assert sorted(ran) == [2, 9]
    assert ends(again.starts) == ends(undisturbed.starts)
    untouched = [path for path in tmp_path.iterdir() if path.name not in ("start-0002.json", "start-0009.json")]
    assert all(path.read_bytes() == files[path.name] for path in untouched)


def test_starts_that_descend_from_others_run_again(undisturbed: excite.Design, tmp_path: Path) -> None:
    """After 9 random starts, numbers 4 to 8 are no combinations; the others are reused."""
    design(tmp_path, starts=9, rounds=None)
    assert [start.parents for start in read_starts(tmp_path)] == [()] * 9
    ran: list[int] = []
    task = Task("irp6", **SMALL, rounds=3, executor="serial")
    again = excite.design_trajectory(task, folder=tmp_path, progress=lambda result: ran.append(result.index))
    assert ends(again.starts) == ends(undisturbed.starts)
    assert min(ran) == 4


def test_random_starts_of_a_later_population_are_those_of_their_number(tmp_path: Path) -> None:
    assert ends(design(tmp_path / "a", starts=2, rounds=None).starts) == ends(design(tmp_path / "b").starts)[:2]


@pytest.mark.slow
def test_a_budget_is_stored_as_its_rounds_and_gives_the_same_motion_again(tmp_path: Path) -> None:
    first = design(tmp_path / "a", rounds=None, budget=0.5)
    assert first.task.search.budget is None
    assert first.search is not None
    assert first.task.search.rounds == first.search.rounds
    again = excite.design_trajectory(first.task)
    assert ends(again.starts) == ends(first.starts)


def test_what_a_session_has_computed_before_is_not_of_the_budget(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = time.process_time
    monkeypatch.setattr(time, "process_time", lambda: own() + 1e6)
    found = design(tmp_path, rounds=None, budget=1.0)
    assert found.search is not None
    assert found.search.rounds > 0


def test_what_is_left_is_in_the_file(undisturbed: excite.Design, tmp_path: Path) -> None:
    undisturbed.save(tmp_path / "d")
    assert undisturbed.search is not None
    assert excite.load_design(tmp_path / "d").search == undisturbed.search
