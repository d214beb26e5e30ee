"""Searches that combine motions: what runs next, the same motion wherever they run and however often they stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from written_files import saved

import excite
from excite.design.formulation import formulate
from excite.design.initial_guesses import combinations, random_motion, shrunk
from excite.design.problem import Problem
from excite.design.search_rounds import Population, Rounds
from excite.design.start_results import PlannedStart, StartResult, read_starts
from excite.tasks.search import RANDOM_STARTS, Search
from excite.tasks.task import Task
from excite.views.design_view import design_view
from regressors.readers.library import load_robot


def ended(index: int, value: float) -> StartResult:
    return StartResult(index, [[value]], value, "ended", [value], 1, 0.1)


def run(
    rounds: Rounds, value: Callable[[int], float], order: Callable[[list[StartResult]], list[StartResult]] = list
) -> list[Sequence[PlannedStart | int]]:
    """All rounds of a search in which a start's end is a function of its number."""
    planned, results = list[Sequence[PlannedStart | int]](), list[StartResult]()
    while starts := rounds.following(order(results)):
        planned.append(starts)
        numbers = [start if isinstance(start, int) else start.index for start in starts]
        results = [ended(number, value(number)) for number in numbers]
        assert len(planned) < 1000
    return planned


def plain(planned: list[Sequence[PlannedStart | int]]) -> list[list[tuple[str, int, tuple[int, ...]]]]:
    def told(start: PlannedStart | int) -> tuple[str, int, tuple[int, ...]]:
        if isinstance(start, int):
            return "random", start, ()
        return start.kind, start.index, tuple(parent.index for parent in start.parents)

    return [[told(start) for start in starts] for starts in planned]


def random_value(number: int) -> float:
    return float(10.0 + np.random.default_rng(number).exponential())


def test_stated_starts_are_all_that_runs() -> None:
    assert run(Rounds(Search(starts=7)), random_value) == [range(7)]
    million = Rounds(Search(starts=10**6)).following([])
    assert isinstance(million, range)  # a million starts take no memory each


def test_numbers_go_on_from_round_to_round_and_parents_are_of_earlier_ones() -> None:
    planned = plain(run(Rounds(Search()), random_value))
    numbers = [number for starts in planned for _, number, _ in starts]
    assert numbers == list(range(len(numbers)))
    assert planned[0] == [("random", number, ()) for number in range(RANDOM_STARTS)]
    for starts in planned[1:]:
        assert all(parent < starts[0][1] for _, _, parents in starts for parent in parents)
    assert planned[-1][0][0] == "refinement"
    best = min(range(len(numbers) - 1), key=random_value)
    assert planned[-1][0][2] == (best,)


def test_every_other_combination_avoids_all_motions_so_far() -> None:
    for one in run(Rounds(Search(rounds=9)), random_value)[2]:
        assert isinstance(one, PlannedStart)
        assert len(one.parents) == 3
        assert one.avoided[:3] == (one.parents if one.index % 2 else ())
        assert (len(one.avoided) > 3) is bool(one.index % 2)
        assert one.lineage != replace(one, avoided=one.parents).lineage


@given(st.integers(0, 100))
def test_the_order_in_which_starts_end_has_no_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shuffled = run(Rounds(Search()), random_value, lambda results: [results[k] for k in rng.permutation(len(results))])
    assert plain(shuffled) == plain(run(Rounds(Search()), random_value))


def test_it_begins_anew_where_rounds_bring_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each population ends worse than the one before, so that none is found again."""
    begins = [number for number in range(200) if number % 16 == 0]
    monkeypatch.setattr("excite.design.search_rounds._ROUNDS", 15)
    planned = plain(run(Rounds(Search()), lambda number: 10.0 + sum(n <= number for n in begins)))
    kinds = [starts[0][0] for starts in planned]
    assert kinds == ["random", *(["combination"] * 3 + ["random"]) * 3, *["combination"] * 3, "refinement"]


def test_it_ends_where_three_populations_end_alike_or_after_the_most_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = [starts[0][0] for starts in plain(run(Rounds(Search()), lambda _: 10.0))]
    assert kinds == ["random", *["combination"] * 3, "random", "random", "refinement"]
    assert len(run(Rounds(Search()), lambda _: np.inf)) == 1  # where no motion identifies the parameters
    monkeypatch.setattr("excite.design.search_rounds._ROUNDS", 7)
    assert len(run(Rounds(Search()), lambda number: 100.0 / (1.0 + number))) == 1 + 7 + 1


def test_the_estimate_is_what_the_next_population_gains_on_average() -> None:
    """Of ends that are equally likely above a least value."""
    rounds, ends = Rounds(Search()), np.random.default_rng(0).uniform(100.0, 101.0, (20_000, 4))
    gains = np.maximum(ends[:, :3].min(axis=1) - ends[:, 3], 0.0) / 100.0
    estimates = [rounds.left for rounds.ends in ends[:, :3].tolist()]
    assert np.mean(estimates) == pytest.approx(np.mean(gains), rel=0.05)
    assert [rounds.left for rounds.ends in ([], [5.0])] == [np.inf, np.inf]


@pytest.mark.parametrize("count", [1, 2, 9])
def test_stated_rounds_are_run_and_then_the_best_is_refined(count: int) -> None:
    planned = plain(run(Rounds(Search(rounds=count)), random_value))
    assert len(planned) == 1 + count + 1
    assert planned[:-1] == plain(run(Rounds(Search(rounds=20)), random_value))[: 1 + count]


def test_a_budget_ends_after_the_round_that_uses_it_up() -> None:
    rounds = Rounds(Search(budget=5.0))
    assert rounds.following([], 0.5) == range(RANDOM_STARTS)
    results = [ended(k, random_value(k)) for k in range(RANDOM_STARTS)]
    assert plain([rounds.following(results, 4.9)])[0][0][0] == "combination"
    assert plain([rounds.following([ended(4, 9.0)], 5.0)])[0][0] == ("refinement", 8, (4,))
    assert not rounds.following([ended(8, 8.9)], 5.1)
    assert rounds.count == 1


def test_a_budget_binds_stated_starts_and_rounds() -> None:
    rounds = Rounds(Search(starts=100, rounds=50, budget=5.0))
    assert rounds.following([], 0.0) == range(RANDOM_STARTS)
    assert rounds.following([ended(k, random_value(k)) for k in range(4)], 1.0) == range(RANDOM_STARTS, 8)
    assert plain([rounds.following([ended(4, 1.0)], 5.0)])[0][0] == ("refinement", 8, (4,))
    assert not rounds.following([ended(8, 0.9)], 5.0)


@pytest.mark.parametrize(("evaluations", "first"), [(1.0, 1), (850.0, 2), (1e6, RANDOM_STARTS)])
def test_a_search_begins_with_as_many_starts_as_its_evaluations_allow(evaluations: float, first: int) -> None:
    assert Rounds(Search(), evaluations).following([]) == range(first)
    for search in (Search(starts=7), Search(rounds=3), Search(budget=9.0)):  # which say what they want
        assert Rounds(search, evaluations).following([]) == Rounds(search).following([])


def test_evaluations_end_a_search_whose_rounds_are_not_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("excite.design.search_rounds._OF_START", 1)
    evaluations = ended(0, 1.0).evaluations
    for search, count in ((Search(), 4), (Search(rounds=9), 11)):
        planned = plain(run(Rounds(search, 2.5 * RANDOM_STARTS * evaluations), lambda number: 100.0 / (1.0 + number)))
        assert (len(planned), planned[-1][0][0]) == (count, "refinement")


@given(st.lists(st.floats(1.0, 100.0), min_size=1, max_size=30))
def test_members_are_apart_and_the_least_is_among_them(values: list[float]) -> None:
    population = Population()
    population.add([ended(k, value) for k, value in enumerate(values)])
    kept = [member.value for member in population.members]
    assert kept == sorted(kept)
    assert kept[0] == min(values)
    assert all(b - a > 2e-3 * a for a, b in pairwise(kept))


SMALL: dict[str, Any] = {"joints": ("1",), "harmonics": 3, "rate": 20.0, "torque_margin": "none"}


def design(folder: Path, **options: Any) -> excite.Design:
    progress = options.pop("progress", lambda _: None)
    folder.mkdir(exist_ok=True)
    task = Task("irp6", **SMALL, **{"rounds": 3, "executor": "serial", **options})
    return excite.design_trajectory(task, folder=folder, progress=progress)


def ends(results: Sequence[StartResult]) -> list[tuple[Any, ...]]:
    return [(r.index, r.x, r.value, r.parents, r.lineage) for r in results]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> excite.Design:
    return design(tmp_path_factory.mktemp("undisturbed"))


def problem_of(**options: Any) -> Problem:
    return formulate(load_robot("irp6"), Task("irp6", **options)).problem


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"tool_speed": 0.3}, {"trajectory": "sines"}], ids=str)
def test_combinations_keep_the_limits(options: dict[str, Any]) -> None:
    problem = problem_of(harmonics=3, **options)
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


def test_limits_that_motions_come_near_are_imposed_and_no_others() -> None:
    problem = formulate(load_robot("panda"), Task("panda", harmonics=3)).problem
    rng = np.random.default_rng(1)
    xs = [random_motion(problem, rng) for _ in range(12)]
    used = {limit for limit in problem.limits.stated if any(limit.uses(limit.values(x)).max() > 0.95 for x in xs)}
    imposed = set(problem.with_near(xs).limits.nonlinear) - set(problem.limits.nonlinear)
    assert imposed == used
    assert 0 < len(used) < len(problem.limits.stated)
    assert problem.with_near([]) is problem


@pytest.mark.slow
def test_the_search_is_the_same_in_processes(undisturbed: excite.Design, tmp_path: Path) -> None:
    assert ends(design(tmp_path / "2", executor="process", workers=2).starts) == ends(undisturbed.starts)
    kinds = [len(start.parents) for start in undisturbed.starts]
    assert kinds[:4] == [0, 0, 0, 0]
    assert max(kinds[4:-1], default=1) > 0
    assert kinds[-1] == 1


def test_finished_starts_of_any_round_are_kept(undisturbed: excite.Design, tmp_path: Path) -> None:
    design(tmp_path)
    files = {path.name: path.read_bytes() for path in sorted(tmp_path.iterdir())}
    for name in ("start-0002.json", "start-0009.json"):
        (tmp_path / name).unlink()
        del files[name]
    ran: list[int] = []
    again = design(tmp_path, progress=lambda result: ran.append(result.index))
    assert sorted(ran) == [2, 9]
    assert ends(again.starts) == ends(undisturbed.starts)
    assert all((tmp_path / name).read_bytes() == content for name, content in files.items())


def test_starts_that_descend_from_others_run_again(undisturbed: excite.Design, tmp_path: Path) -> None:
    """After 9 random starts, numbers 4 to 8 are no combinations; the others are reused."""
    design(tmp_path, starts=9, rounds=None)
    before = read_starts(tmp_path)
    assert [start.parents for start in before] == [()] * 9
    assert ends(before)[:4] == ends(undisturbed.starts)[:4]
    ran: list[int] = []
    again = design(tmp_path, progress=lambda result: ran.append(result.index))
    assert ends(again.starts) == ends(undisturbed.starts)
    assert min(ran) == 4
    assert again.search.rounds == undisturbed.search.rounds == 3
    assert excite.load_design(saved(tmp_path / "d", again)).search == again.search  # what is left is in the file


@pytest.mark.slow
def test_a_budget_is_stored_as_its_rounds_and_gives_the_same_motion_again(tmp_path: Path) -> None:
    first = design(tmp_path / "a", rounds=None, budget=0.5)
    assert first.task.search.budget is None
    assert first.task.search.rounds == first.search.rounds
    again = excite.design_trajectory(first.task)
    assert ends(again.starts) == ends(first.starts)


def test_what_was_computed_before_is_not_of_the_budget(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = time.process_time
    monkeypatch.setattr(time, "process_time", lambda: own() + 1e6)
    found = design(tmp_path, rounds=None, budget=1.0)
    assert found.search.rounds > 0


def test_a_design_is_compared_with_random_motions_within_its_limits(undisturbed: excite.Design) -> None:
    """Their condition numbers come from singular values, and the least of them is printed."""
    formulation = formulate(load_robot("irp6"), undisturbed.task)
    problem, rng = formulation.problem, np.random.default_rng(undisturbed.task.search.seed)
    model, base = undisturbed.target.model, undisturbed.base
    times = model.times(undisturbed.task.trajectory.period, undisturbed.task.output.rate)
    conditions = []
    for _ in range(20):
        x = shrunk(problem, random_motion(problem, rng))
        assert problem.violation(x) <= 1e-9
        W = model.assemble(problem.information.trajectory(x).samples(times))
        conditions.append(np.linalg.cond(W[:, base.index]))
    assert undisturbed.search is not None
    assert undisturbed.search.random == pytest.approx(min(conditions), rel=1e-9)
    assert undisturbed.search.random > undisturbed.condition_number
    assert f"(best of 20 random motions within the limits: {min(conditions):.3g})" in design_view(undisturbed).verdict
