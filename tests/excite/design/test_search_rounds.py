"""The plan of a search: what runs next depends on earlier results only, and it ends by its own estimate."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.design.search_rounds import Population, Rounds, RoundSizes
from excite.design.start_results import PlannedStart, StartResult
from excite.tasks.search import RANDOM_STARTS, Search


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
    return [
        [
            ("random", start, ())
            if isinstance(start, int)
            else (start.kind, start.index, tuple(parent.index for parent in start.parents))
            for start in starts
        ]
        for starts in planned
    ]


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


@given(st.integers(0, 100))
def test_the_order_in_which_starts_end_has_no_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shuffled = run(Rounds(Search()), random_value, lambda results: [results[k] for k in rng.permutation(len(results))])
    assert plain(shuffled) == plain(run(Rounds(Search()), random_value))


def test_it_begins_anew_where_rounds_bring_nothing() -> None:
    """Each population ends worse than the one before, so that none is found again."""
    begins = [number for number in range(200) if number % 16 == 0]
    planned = plain(
        run(
            Rounds(Search(), RoundSizes(rounds=15)),
            lambda number: 10.0 + sum(n <= number for n in begins),
        )
    )
    kinds = [starts[0][0] for starts in planned]
    assert kinds == ["random", *(["combination"] * 3 + ["random"]) * 3, *["combination"] * 3, "refinement"]


def test_it_ends_where_three_populations_come_to_the_same_end() -> None:
    planned = plain(run(Rounds(Search()), lambda _: 10.0))
    kinds = [starts[0][0] for starts in planned]
    assert kinds == ["random", *["combination"] * 3, "random", "random", "refinement"]


def test_it_ends_at_the_latest_after_the_largest_number_of_rounds() -> None:
    planned = run(Rounds(Search(), RoundSizes(rounds=7)), lambda number: 100.0 / (1.0 + number))
    assert len(planned) == 1 + 7 + 1


def test_the_estimate_is_what_leaving_out_each_population_would_cost_on_average() -> None:
    rounds = Rounds(Search())
    for ends in ([5.0, 5.5], [7.0, 5.0, 6.0], [4.0, 4.0, 9.0]):
        rounds.ends = ends
        costs = [min([*ends[:k], *ends[k + 1 :]]) / min(ends) - 1.0 for k in range(len(ends))]
        assert rounds.left == pytest.approx(np.mean(costs))
    rounds.ends = [5.0]
    assert rounds.left == np.inf


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


def test_no_motion_that_identifies_the_parameters_ends_the_search() -> None:
    assert len(run(Rounds(Search()), lambda _: np.inf)) == 1


def test_of_motions_in_one_basin_the_best_is_kept() -> None:
    population = Population()
    population.add([ended(0, 5.0), ended(1, 5.001), ended(2, 6.0), ended(3, 4.999), ended(4, np.inf)])
    assert [member.index for member in population.members] == [3, 2]


@given(st.lists(st.floats(1.0, 100.0), min_size=1, max_size=30))
def test_members_are_apart_and_the_least_is_among_them(values: list[float]) -> None:
    population = Population()
    population.add([ended(k, value) for k, value in enumerate(values)])
    kept = [member.value for member in population.members]
    assert kept == sorted(kept)
    assert kept[0] == min(values)
    assert all(b - a > 2e-3 * a for a, b in pairwise(kept))


def test_lineage_is_that_of_the_parents_motions() -> None:
    a, b = ended(0, 5.0), ended(1, 6.0)
    one = PlannedStart(4, "combination", (a, b))
    assert PlannedStart(4).lineage == ""
    assert one.lineage == PlannedStart(9, "combination", (a, b)).lineage
    others = [
        PlannedStart(4, "combination", (b, a)),
        PlannedStart(4, "combination", (a,)),
        PlannedStart(4, "refinement", (a,)),
    ]
    assert len({one.lineage, *(other.lineage for other in others)}) == 4
