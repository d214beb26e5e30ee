"""Starts on a real Dask scheduler with two worker processes: as serial ones; a worker, then the scheduler, is lost."""

from __future__ import annotations

import operator
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from commands import Here, content_of
from processes import DaskProcesses, kill

from excite.design.executors.dask_cluster import DaskCluster, DaskStarts, check_versions
from excite.design.formulation import Formulation, formulate
from excite.design.kept_starts import keep_starts
from excite.design.multistart import serial
from excite.design.problem_identity import PACKAGES
from excite.design.start_results import PlannedStart, StartResult, read_starts
from excite.errors import LostWorkersError
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import load_robot

pytest.importorskip("distributed")
COUNT = 6


@pytest.fixture(scope="module")
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskProcesses]:
    with DaskProcesses(tmp_path_factory.mktemp("dask")) as processes:
        yield processes


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
        with pytest.raises(
            LostWorkersError, match=f"the Dask scheduler at {other.address} went away; what is finished"
        ):
            DaskStarts(other.address)(problem, [range(COUNT)], tmp_path / "starts", lambda _: kill(other.scheduler))
    kept = keep_starts(tmp_path / "starts", problem)
    assert 1 <= len(kept.done) < COUNT
    before = {path.name: path.read_bytes() for path in (tmp_path / "starts").iterdir()}
    DaskStarts(dask.address)(problem, [kept.left(range(COUNT))], tmp_path / "starts", lambda _: None)
    assert timeless(tmp_path / "starts") == expected
    assert all((tmp_path / "starts" / name).read_bytes() == content for name, content in before.items())


@pytest.mark.slow
def test_design_command_on_dask(
    dask: DaskProcesses, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    here, task = Here(tmp_path, monkeypatch, capfd), ("irp6", "--starts", "3", "--harmonics", "3", "--figures", "none")
    for executor, out in (("serial", "a"), (dask.address, "b")):
        ended = here.run("design", *task, "--executor", executor, "--out", out)
        assert ended.returncode == 0, ended.stderr
    a, b = (content_of(tmp_path / out) for out in "ab")
    for same in ("trajectory", "criteria", "limits", "predicted"):
        assert a[same] == b[same]
    assert here.run("compare", "a", "b").returncode == 0  # naming a scheduler, a design is read without one


@pytest.mark.slow
def test_a_start_takes_the_motions_that_it_descends_from_with_it(
    problem: Formulation, expected: list[StartResult], dask: DaskProcesses, tmp_path: Path
) -> None:
    rounds = [[PlannedStart(COUNT + k, "combination", tuple(expected[:2])) for k in range(2)]]
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
    serial(problem, rounds, tmp_path / "here", lambda _: None)
    DaskStarts(dask.address)(problem, rounds, tmp_path / "there", lambda _: None)
    assert timeless(tmp_path / "there") == timeless(tmp_path / "here")
    assert [start.parents for start in read_starts(tmp_path / "there")] == [(0, 1)] * 2


def test_other_versions_on_a_worker_are_refused() -> None:
    from importlib.metadata import version

    check_versions({name: version(name) for name in PACKAGES})
    with pytest.raises(
        InputError, match=r"a Dask worker has numpy .* instead of 0\.1; install the same versions there"
    ):
        check_versions({"numpy": "0.1"})


def test_nothing_at_the_address_is_one_line(
    problem: Formulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("excite.design.executors.dask_cluster._CONNECT", 0.3)
    with pytest.raises(InputError, match=r"no Dask scheduler answers at dask://127\.0\.0\.1:9:"):
        DaskStarts("dask://127.0.0.1:9")(problem, [range(1)], tmp_path, lambda _: None)
