"""Units of work and starts in processes and on Dask: as serial ones, though workers and schedulers are lost."""

from __future__ import annotations

import logging
import operator
import os
import signal
from collections.abc import Sequence
from concurrent.futures import CancelledError
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import DaskProcesses, dies, kill

from excite.cli.option_types import PartName
from excite.design.executors.dask_cluster import (
    ConnectedCluster,
    DaskAddress,
    DaskCluster,
    DaskStarts,
    check_versions,
    dask_address,
    unit_executor,
)
from excite.design.executors.unit_executor import InProcesses, InThisProcess, LostUnit
from excite.design.formulation import Formulation, formulate
from excite.design.initial_guesses import candidates
from excite.design.multistart import run_in_pool, serial
from excite.design.optimisation import solve
from excite.design.problem import Problem
from excite.design.problem_identity import package_versions
from excite.design.start_results import StartResult, read_starts
from excite.design.starts import keep_starts
from excite.errors import LostWorkersError, NoFeasibleMotionError
from excite.registry import EXECUTORS
from excite.tasks.search import Search
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.readers.library import load_robot
from regressors.samples import Array

GOOD = {
    "dask://127.0.0.1:8786": DaskAddress(scheduler="tcp://127.0.0.1:8786"),
    "dask://node-1.cluster:1": DaskAddress(scheduler="tcp://node-1.cluster:1"),
    "dask://[::1]:8786": DaskAddress(scheduler="tcp://[::1]:8786"),
    "dask-file:/tmp/a b.json": DaskAddress(file=Path("/tmp/a b.json")),
    "dask-local": DaskAddress(),
    "dask-local:2": DaskAddress(processes=2),
}
BAD = (
    "dask://", "dask://host", "dask://:8786", "dask://host:port", "dask://host:0", "dask://host:65536", "dask:host:1",
    "dask://host:8786/x", "dask://a@host:1", "dask-file:", "dask-file", "dask-local:", "dask-local:0", "dask-local:-1",
    "dask-local:1_0", "dask-local:٣", "dask-local:2000000", "dask-locale", "tcp://host:1",
)  # fmt: skip


def test_addresses_are_read_and_others_are_refused_with_the_three_forms() -> None:
    for text, address in GOOD.items():
        assert dask_address(text) == address
        assert str(address) == text.removesuffix(":2")
        assert Search(executor=text).executor == text
        assert PartName("executor", EXECUTORS).convert(text, None, None) == text
        assert isinstance(unit_executor(text), DaskCluster)
    for text in BAD:
        with pytest.raises(InputError, match=r"expected dask://HOST:PORT, dask-file:PATH .*, or dask-local:N"):
            dask_address(text)


def test_names_of_executors() -> None:
    assert isinstance(unit_executor("serial"), InThisProcess)
    pool = unit_executor("process", 3)
    assert (type(pool), pool.count) == (InProcesses, 3)
    assert unit_executor(pool) is pool
    for name in ("proces", "mine:Mine", "DASK://a:1"):
        with pytest.raises(UnknownName, match=r"available: .*serial.*dask://HOST:PORT"):
            unit_executor(name)


def test_a_scheduler_file_that_is_missing_is_named(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match=r"no Dask scheduler file .*none\.json"):
        list(DaskCluster(f"dask-file:{tmp_path}/none.json").run(max, 1, [2]))


class Unfetched:
    """A finished unit whose result stays where it is, since the connection breaks while it is fetched."""

    status = "finished"

    def result(self) -> None:
        raise CancelledError


def test_a_scheduler_that_goes_away_before_a_result_is_here() -> None:
    units = object.__new__(ConnectedCluster)
    units._address = dask_address("dask://127.0.0.1:9")
    with pytest.raises(LostWorkersError, match=r"^the Dask scheduler at dask://127\.0\.0\.1:9 went away; what is"):
        units._result(Unfetched())


def test_without_dask_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'excite-trajectories\[dask\]'"):
        list(DaskCluster("dask://127.0.0.1:1").run(max, 1, [2]))


@pytest.mark.slow
def test_results_come_by_number_from_every_executor() -> None:
    units = list(range(7))
    for executor in (InThisProcess(), InProcesses(2)):
        assert dict(executor.run(pow, 2, units)) == {k: 2**k for k in units}
        assert dict(executor.run(pow, 2, [])) == {}
        with pytest.raises(ZeroDivisionError):
            dict(executor.run(divmod, 1, [0]))


@pytest.mark.slow
def test_a_unit_that_kills_its_process_thrice_is_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for times in (1, 99):
        (tmp_path / str(times)).mkdir()
        with caplog.at_level(logging.WARNING):
            results = dict(InProcesses(2).run(dies, (str(tmp_path / str(times)), times), [0, 1, 2, 3]))
        assert {record.getMessage().split(" (")[0] for record in caplog.records} == {"a worker process ended"}
        assert len(caplog.records) == (1 if times == 1 else 4)
        lost = results.pop(2)
        assert results == {0: 0, 1: 1, 3: 3}
    assert isinstance(lost, LostUnit)
    assert "ended 3 times" in lost.reason


COUNT = 6


@pytest.fixture(scope="module")
def problem() -> Formulation:
    return formulate(load_robot("panda"), Task("panda", harmonics=4, starts=COUNT))


@pytest.fixture(scope="module")
def expected(problem: Formulation, tmp_path_factory: pytest.TempPathFactory) -> list[StartResult]:
    folder = tmp_path_factory.mktemp("serial")
    serial(problem, [range(COUNT)], folder, lambda _: None)
    return timeless(folder)


@pytest.mark.slow
def test_units_of_which_few_are_sent_at_a_time_all_run(dask: DaskProcesses, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("excite.design.executors.dask_cluster._AHEAD", 3)
    assert sorted(DaskCluster(dask.address).run(operator.add, 1, range(10))) == [(k, k + 1) for k in range(10)]


def timeless(folder: Path) -> list[StartResult]:
    """All starts of a folder, without the time that they took."""
    return [replace(start, cpu=0.0) for start in read_starts(folder)]


@pytest.mark.slow
def test_results_are_the_serial_ones_though_a_worker_is_killed(
    problem: Formulation, expected: list[StartResult], tmp_path: Path
) -> None:
    pytest.importorskip("distributed")
    ended = []
    with DaskProcesses(tmp_path / "dask") as dask:

        def progress(result: StartResult) -> None:
            ended.append(result.index)
            if len(ended) == 2:
                kill(dask.workers[0])

        (tmp_path / "starts").mkdir()
        DaskStarts(f"dask-file:{dask.file}")(problem, [range(COUNT)], tmp_path / "starts", progress)
    assert sorted(ended) == list(range(COUNT))
    assert timeless(tmp_path / "starts") == expected


@pytest.mark.slow
def test_finished_starts_are_kept_where_the_scheduler_goes_away(
    problem: Formulation, expected: list[StartResult], tmp_path: Path, dask: DaskProcesses
) -> None:
    with DaskProcesses(tmp_path / "dask") as other:
        (tmp_path / "starts").mkdir()
        with pytest.raises(LostWorkersError, match=f"scheduler at {other.address} went away; what is finished"):
            DaskStarts(other.address)(problem, [range(COUNT)], tmp_path / "starts", lambda _: kill(other.scheduler))
    kept = keep_starts(tmp_path / "starts", problem)
    assert 1 <= len(kept.done) < COUNT
    before = {path.name: path.read_bytes() for path in (tmp_path / "starts").iterdir()}
    DaskStarts(dask.address)(problem, [kept.left(range(COUNT))], tmp_path / "starts", lambda _: None)
    assert timeless(tmp_path / "starts") == expected
    assert all((tmp_path / "starts" / name).read_bytes() == content for name, content in before.items())


def test_other_versions_on_a_worker_are_refused() -> None:
    pytest.importorskip("distributed")
    check_versions(package_versions())
    with pytest.raises(InputError, match=r"worker has numpy .* instead of 0\.1; install the same versions there"):
        check_versions({"numpy": "0.1"})


ROBOT = load_robot("irp6")


def deadly(poison: Array | None) -> Any:
    """A solver that ends its process where a search begins at some point, or anywhere; sent to processes by value."""
    from excite.design.solvers.solver import Solver, SolverResult, Status

    class Deadly(Solver):
        name = "deadly"

        def solve(self, problem: Problem, starts: Sequence[Array], watch: object = None) -> SolverResult:
            if poison is None or np.array_equal(starts[0], poison):
                os.kill(os.getpid(), signal.SIGKILL)
            return SolverResult(starts[0], 1.0, Status.CONVERGED, [1.0], 1)

    return Deadly()


def first_guess(index: int) -> Array:
    problem = formulate(ROBOT, Task("irp6", harmonics=3)).problem
    return candidates(problem, index, np.random.default_rng([0, index]))[0]


@pytest.mark.slow
def test_a_start_that_ends_its_process_is_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    task = Task("irp6", harmonics=3, starts=4, workers=2, solver=deadly(first_guess(1)))
    reported: list[StartResult] = []
    with caplog.at_level(logging.WARNING):
        design = solve(ROBOT, formulate(ROBOT, task), tmp_path, reported.append)
    assert sorted(result.index for result in reported) == [0, 2, 3]
    assert [start.index for start in design.starts] == [0, 2, 3]
    assert "1 of 4 starts are left out: their processes ended each time" in design.notes
    told = [record.getMessage() for record in caplog.records]
    assert [text.partition("; ")[0] for text in told] == 3 * [
        "a worker process ended at start 1 (signal 9, which is often a lack of memory) and is replaced"
    ]
    assert [text.partition("; ")[2] for text in told] == [
        "the start runs again",
        "the start runs alone after the others, since this is the second time",
        "the start is left out, since this is the third time",
    ]


@pytest.mark.slow
def test_replacements_of_workers_are_bounded(tmp_path: Path) -> None:
    made = formulate(ROBOT, Task("irp6", harmonics=3, starts=9, workers=1, solver=deadly(None)))
    with pytest.raises(LostWorkersError, match="7 worker processes ended one after the other"):
        run_in_pool(made, [range(9)], tmp_path, lambda _: None)


@pytest.mark.slow
def test_no_start_at_all_is_an_error(tmp_path: Path) -> None:
    made = formulate(ROBOT, Task("irp6", harmonics=3, starts=1, workers=1, solver=deadly(None)))
    with pytest.raises(NoFeasibleMotionError, match="no start has a result"):
        solve(ROBOT, made, tmp_path)
