"""The search over many starts: seeded, on disk as it goes, and the same wherever it runs."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import ENVIRONMENT, files_below
from written_files import text_file

from excite.design.formulation import Formulation, formulate
from excite.design.multistart import ready_workers, run_in_pool, serial
from excite.design.optimisation import _unwound, certify, design_trajectory, limits_of
from excite.design.problem import Problem
from excite.design.solvers.solver import Solver, SolverResult, Status, Watcher
from excite.design.start_results import RUNNING, BestStarts, StartResult, read_starts
from excite.design.starts import optimise_starts
from excite.errors import NoFeasibleMotionError
from excite.registry import EXECUTORS, built_in, instance
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.readers.library import load_robot
from regressors.samples import Array

TASK = Task("irp6", harmonics=3, starts=4, workers=2)


@pytest.fixture(scope="module")
def made() -> Formulation:
    return formulate(load_robot("irp6"), TASK)


@pytest.fixture(scope="module")
def alone(made: Formulation) -> Formulation:
    """The same with one process to run in."""
    return replace(made, task=replace(TASK, search=replace(TASK.search, workers=1)))


def without_cpu(results: Sequence[StartResult]) -> list[dict[str, object]]:
    return [{name: value for name, value in vars(r).items() if name != "cpu"} for r in results]


# One start


def test_seed_and_number_fix_a_start_which_ends_better_than_it_began(made: Formulation, tmp_path: Path) -> None:
    method, ends = instance("solver", "sqp"), set()
    for seed, index in ((0, 0), (0, 1), (1, 3)):
        result, again = (optimise_starts(made.problem, method, seed, [index], place)[0] for place in (None, tmp_path))
        assert without_cpu([again]) == without_cpu([result])
        assert again.index == index
        ends.add(json.dumps(result.x))
        assert result.status in {status.value for status in Status}
        assert result.value < result.history[0]
        assert result.evaluations >= len(result.history) - 1
        assert result.cpu > 0.0
        assert all(use.holds for use in limits_of(made, Trajectory(made.problem.family, result.coefficients)))
        assert result.value == pytest.approx(made.problem.exact_value(result.coefficients), rel=1e-12)
    assert len(ends) == 3
    assert files_below(tmp_path) == {"start-0000.json", "start-0001.json", "start-0003.json"}


class Slow(Solver):
    """Tells three points, the second one the best, and looks at the files after each."""

    name = "slow"

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.seen: list[list[StartResult]] = []

    def solve(self, problem: Problem, starts: Sequence[Array], watch: Watcher | None = None) -> SolverResult:
        for value in (3.0, 1.0, 2.0):
            watch(starts[0] * value, value)
            self.seen.append(read_starts(self.folder))
        return SolverResult(starts[0], 1.0, Status.CONVERGED, [3.0, 1.0, 2.0], 3)


def test_the_best_point_of_an_unfinished_start_is_on_disk(
    made: Formulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (seldom, always) = (Slow(tmp_path), Slow(tmp_path / "always"))
    optimise_starts(made.problem, seldom, 0, [0], seldom.folder)
    assert seldom.seen == [[], [], []]  # less than a second went by
    monkeypatch.setattr("excite.design.starts._SAVE_EVERY", -1.0)
    always.folder.mkdir()
    (result,) = optimise_starts(made.problem, always, 0, [5], always.folder)
    first, second, third = (seen[0] for seen in always.seen)
    assert (first.index, first.status, first.value, first.history) == (5, RUNNING, 3.0, [3.0])
    assert (second.value, second.history) == (1.0, [3.0, 1.0])
    assert third == second  # a worse point does not replace it
    assert np.array_equal(3.0 * second.coefficients, first.coefficients)
    assert read_starts(always.folder) == [result]
    assert result.status == Status.CONVERGED.value


# Many starts


@pytest.mark.slow
def test_every_start_is_on_disk_when_it_is_reported_whatever_runs_it(made: Formulation, tmp_path: Path) -> None:
    results = {}
    for executor in EXECUTORS:
        folder, reported = tmp_path / executor, list[tuple[int, bool]]()
        folder.mkdir()

        def progress(result: StartResult, folder: Path = folder, seen: list[tuple[int, bool]] = reported) -> None:
            seen.append((result.index, result in read_starts(folder)))  # it is there, and finished

        built_in("executor", executor)(made, [range(TASK.search.first)], folder, progress)
        assert sorted(reported) == [(k, True) for k in range(4)]
        results[executor] = read_starts(tmp_path / executor)
        assert files_below(tmp_path / executor) == {f"start-{k:04d}.json" for k in range(4)}
    assert without_cpu(results["process"]) == without_cpu(results["serial"])


def test_an_error_is_raised_here_and_ends_the_pool(alone: Formulation, tmp_path: Path) -> None:
    with pytest.raises(Exception, match="gone"):
        run_in_pool(alone, [[0, 1, 2]], tmp_path / "gone", lambda _: None)
    with pytest.raises(ZeroDivisionError):
        run_in_pool(alone, [range(20)], tmp_path, lambda _: 1 / 0)
    assert len(read_starts(tmp_path)) < 20


def test_the_pool_leaves_the_environment_and_the_interrupt_as_they_were(
    made: Formulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = dict(os.environ), signal.getsignal(signal.SIGINT), signal.pthread_sigmask(signal.SIG_BLOCK, [])
    seen: list[dict[str, str]] = []
    run_in_pool(made, [[0]], tmp_path, lambda _: seen.append(dict(os.environ)))
    assert seen[0]["OPENBLAS_NUM_THREADS"] == seen[0]["MKL_NUM_THREADS"] == "1"
    after = dict(os.environ), signal.getsignal(signal.SIGINT), signal.pthread_sigmask(signal.SIG_BLOCK, [])
    assert after == before
    serial(made, [[0]], tmp_path, lambda _: None)
    assert signal.getsignal(signal.SIGINT) is before[1]


def test_searches_run_in_other_threads(made: Formulation, tmp_path: Path) -> None:
    done: list[StartResult] = []
    for executor in EXECUTORS:
        thread = threading.Thread(target=built_in("executor", executor), args=(made, [[0]], tmp_path, done.append))
        thread.start()
        thread.join(60)
    assert len(done) == 2


def test_workers_are_kept_from_one_call_to_the_next(made: Formulation, tmp_path: Path) -> None:
    def running() -> set[int | None]:
        return {process.pid for process in multiprocessing.active_children()}

    before, seen = running(), []
    with ready_workers(made):
        for indices in ([0, 1], [2, 3]):
            run_in_pool(made, [indices], tmp_path, lambda _: seen.append(running() - before))
    assert len(seen) == 4
    assert len(seen[0]) == 2
    assert all(pids == seen[0] for pids in seen)
    assert running() == before
    assert [result.index for result in read_starts(tmp_path)] == [0, 1, 2, 3]


# The best of them


def test_the_best_start_that_keeps_every_limit_is_taken(made: Formulation, tmp_path: Path) -> None:
    serial(made, [[0, 1, 2]], tmp_path, lambda _: None)
    results = read_starts(tmp_path)
    best = min(results, key=lambda r: r.value)
    robot = load_robot("irp6")
    assert certify(robot, made, BestStarts(tuple(results), 3, 0), {}).best_start == best.index
    # A better value outside the limits is passed over, and where nothing else is left, nothing is designed.
    outside = StartResult(9, (3.0 * best.coefficients).tolist(), 1.0, "ended", [1.0], 1, 0.0)
    assert certify(robot, made, BestStarts((*results, outside), 4, 0), {}).best_start == best.index
    with pytest.raises(NoFeasibleMotionError):
        certify(robot, made, BestStarts((outside,), 1, 0), {})
    # One that is hardly outside is made a little smaller.
    barely = replace(best, x=made.problem.drawn(best.coefficients, 1.003).tolist())
    assert any(use.use > 1.0 for use in limits_of(made, made.problem.information.trajectory(barely.coefficients)))
    assert certify(robot, made, BestStarts((barely,), 1, 0), {}).broken == ()


WIDE = {"velocity": (1.0,), "acceleration": (3.0,), "harmonics": 2, "starts": 1, "executor": "serial", "rate": 50.0}


@pytest.mark.slow
def test_whole_turns_for_nothing_are_taken_out_and_change_nothing_else() -> None:
    task = Task("ur10e", position=((-12.0, 12.0),) * 6, joints=("1", "2"), **WIDE)
    robot = load_robot("ur10e")
    made, plain = formulate(robot, task), design_trajectory(task)
    best = plain.starts[plain.best_start]
    turned = made.problem.family.moved(best.coefficients, 2 * np.pi * np.array([1.0, -1.0]))
    again = certify(robot, made, BestStarts((replace(best, x=turned.tolist()),), 1, 0), {})
    q = again.trajectory.sampled(50.0).q
    np.testing.assert_allclose(q, plain.trajectory.sampled(50.0).q, atol=1e-12)
    assert np.all(np.abs(q.min(axis=0) + q.max(axis=0)) / 2 <= np.pi + 1e-6)
    assert again.condition_number == pytest.approx(plain.condition_number, rel=1e-9)
    before = {use.label: use.extreme for use in limits_of(made, made.problem.information.trajectory(turned))}
    after = {use.label: use.extreme for use in again.limits if not use.label.endswith("position")}
    assert {label.split()[-1] for label in after} >= {"velocity", "acceleration", "torque"}
    for label, extreme in after.items():
        assert before[label] == pytest.approx(extreme, rel=1e-6, abs=1e-6), label


@pytest.mark.parametrize(
    ("position", "home", "turns"),
    [((-12.0, 12.0), None, 0.0), ((5.0, 12.0), None, 1.0), ((-12.0, 12.0), (2 * np.pi, *(0.0,) * 5), 1.0)],
    ids=["to zero", "where the limits leave no other", "to home"],
)
def test_whole_turns_stay_where_limits_or_home_need_them(
    position: tuple[float, float], home: tuple[float, ...] | None, turns: float
) -> None:
    task = Task("ur10e", position=(position, *((-12.0, 12.0),) * 5), joints=("1", "2"), home=home, floor="none", **WIDE)
    robot = load_robot("ur10e")
    made = formulate(robot, task)
    found = made.problem.family.resting(np.array([0.4 + 2 * np.pi, -0.9]))
    trajectory, _ = _unwound(robot, made, found, ())
    np.testing.assert_allclose(trajectory.sampled(50.0).q[:, 0], 0.4 + 2 * np.pi * turns, atol=1e-12)


@pytest.mark.slow
def test_a_script_without_a_guard_still_gets_its_design(tmp_path: Path) -> None:
    # The pool's processes import the script again, fail to start a pool of their own and end; this one takes over.
    search = "harmonics=3, starts=2, workers=2"
    text = f'import excite\nprint(excite.design_trajectory("irp6", {search}).condition_number)\n'
    command = [sys.executable, str(text_file(tmp_path / "script.py", text))]
    assert float(subprocess.check_output(command, cwd=tmp_path, env=ENVIRONMENT, text=True, timeout=120)) > 1.0
