"""Repetitions in worker processes and on a real Dask scheduler: as serial ones, though workers are killed."""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
import signal
from collections.abc import Callable

import pytest
from commands import Here
from processes import DaskProcesses
from repeated_experiments import chains, plain, same

from excite.design.executors.unit_executor import InProcesses
from excite.study import repetitions as units_file
from excite.study.repetitions import repeat_experiment

pytestmark = pytest.mark.slow
COUNT = 12


@pytest.fixture(autouse=True)
def small_units(monkeypatch: pytest.MonkeyPatch) -> None:
    """Units of few repetitions, so that there are many."""
    monkeypatch.setattr(units_file, "_UNIT", 3 * units_file.repetition_seconds(plain(), 1))


@pytest.fixture
def never_short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(units_file, "SHORT", 0.0)


@pytest.mark.parametrize("name", chains())
@pytest.mark.usefixtures("never_short")
def test_every_model_is_repeated_alike_everywhere(name: str, dask: DaskProcesses) -> None:
    e = chains()[name]
    serial = repeat_experiment(e, COUNT, 5, executor="serial")
    for executor in ("process", dask.address):
        same(repeat_experiment(e, COUNT, 5, executor=executor, workers=2), serial)


def test_processes_that_inherit_nothing_repeat_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on macOS and Windows, and below a progress bar."""
    monkeypatch.setattr("excite.design.workers.can_fork", lambda: False)
    e = chains()["differential"]
    same(repeat_experiment(e, COUNT, 5, executor=InProcesses(2)), repeat_experiment(e, COUNT, 5))


def after(count: int, act: Callable[[], None]) -> Callable[[int, int], None]:
    """Progress that acts once, as soon as so many repetitions are done."""
    acted: list[int] = []

    def progress(done: int, _: int) -> None:
        if done >= count and not acted:
            acted.append(done)
            act()

    return progress


def test_a_worker_process_that_is_killed_changes_no_number(caplog: pytest.LogCaptureFixture) -> None:
    def kill_one() -> None:
        pid = multiprocessing.active_children()[0].pid
        assert pid is not None
        os.kill(pid, signal.SIGKILL)

    with caplog.at_level(logging.WARNING):
        found = repeat_experiment(plain(), 60, 0, progress=after(6, kill_one), executor=InProcesses(2))
    assert [message.split(" (")[0] for message in caplog.messages] == ["a worker process ended"]
    same(found, repeat_experiment(plain(), 60, 0))
    assert not multiprocessing.active_children()


def test_ctrl_c_ends_the_worker_processes() -> None:
    def stop() -> None:
        raise KeyboardInterrupt

    found = repeat_experiment(plain(), 60, 0, progress=after(6, stop), executor=InProcesses(2))
    assert found.interrupted
    assert 6 <= found.count < 60
    assert not multiprocessing.active_children()


def test_identify_command_on_dask(recorded: Here, dask: DaskProcesses) -> None:
    run = ("identify", "irp6", "run.csv", "--choose", "none", "--repeat", "9", "--figures", "none")
    contents = []
    for out, executor in (("a", "serial"), ("b", dask.address)):
        recorded.run(*run, "--executor", executor, "--out", out, status=0)
        contents.append(json.loads((recorded.cwd / out / "result.json").read_text())["repetitions"])
    assert contents[0] == contents[1]
