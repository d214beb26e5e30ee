"""Repetitions in units, in processes and on Dask: kept, resumed, and the same wherever they are computed."""

from __future__ import annotations

import logging
import os
import pickle
from collections.abc import Callable
from dataclasses import replace
from multiprocessing import Process
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from played import TASK, found, noisy, played, three_joints
from repeated_experiments import OneByOne, chains, plain, same

from excite.design.executors.dask_cluster import DaskCluster
from excite.design.executors.unit_executor import InProcesses, InThisProcess
from excite.design.problem_identity import NotComparable
from excite.errors import LostWorkersError
from excite.identification.recipe import Recipe
from excite.logs.log import Log
from excite.registry import REPEATABLE
from excite.study import repetitions as units_file
from excite.study.experiment import Chain
from excite.study.moments import ESTIMATORS
from excite.study.repetitions import (
    SeededExperiment,
    effort_noise,
    executor_of_repetitions,
    position_noise,
    repeat_experiment,
)
from excite.tasks.task import Task
from regressors.errors import InputError, TooLargeError, UnknownName


@pytest.fixture(scope="module")
def noise() -> Log:
    return noisy(played(three_joints(), 3, seconds=4.005), 0.5, 1e-5, 1)


def test_repetitions_have_the_noise_of_the_torques_whatever_the_equations_are(noise: Log) -> None:
    for task, recipe in (
        (TASK, Recipe(rows="all")),
        (TASK, Recipe(rows="all", low_pass=5.0)),
        (Task("irp6", model="energy"), Recipe(rows="all")),
    ):
        result = found(task, noise, recipe=recipe)
        np.testing.assert_allclose(effort_noise(result), 0.5, rtol=0.15)
    np.testing.assert_allclose(position_noise(result), 1e-5, rtol=0.25)


COUNT = 12


@pytest.fixture
def in_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Units of two repetitions, each written at once."""
    monkeypatch.setattr(units_file, "repetition_seconds", lambda _, count: count * units_file._UNIT / 2)
    monkeypatch.setattr(units_file, "_EVERY", 0.0)


@pytest.mark.parametrize("name", chains())
def test_an_experiment_is_repeated_as_well_after_it_was_sent(name: str) -> None:
    common = SeededExperiment(chains()[name], 3, {})
    expected = units_file.repeat_numbers(common, range(2))
    sent = pickle.loads(pickle.dumps(common))
    assert isinstance(common.chain, Chain)
    assert "chain" not in vars(sent)
    for one, other in zip(units_file.repeat_numbers(sent, range(2)), expected, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.usefixtures("in_pairs")
def test_repetitions_are_in_the_order_of_their_numbers_whatever_ends_first() -> None:
    seen, backwards = list[tuple[int, int]](), OneByOne(backwards=True)
    there = repeat_experiment(plain(), COUNT, 0, progress=lambda *done: seen.append(done), executor=backwards)
    same(there, repeat_experiment(plain(), COUNT, 0, executor="serial"))
    assert seen == [(k, COUNT) for k in range(2, COUNT + 1, 2)]
    assert backwards.closed


@pytest.mark.usefixtures("in_pairs")
def test_units_that_are_lost_are_left_out(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        rest = repeat_experiment(plain(), 9, 0, executor=OneByOne(lost=(1, 4), backwards=True))
    assert caplog.messages == [
        "repetition 8 is left out: its process ended",
        "repetitions 2 to 3 are left out: its process ended",
    ]
    whole = repeat_experiment(plain(), 9, 0)
    np.testing.assert_array_equal(rest.estimates, whole.estimates[[0, 1, 4, 5, 6, 7]])
    assert not rest.interrupted
    with pytest.raises(InputError, match=r"repetitions: 1 of 3 are left, since workers ended; repeat with fewer `work"):
        repeat_experiment(plain(), 3, 0, executor=OneByOne(lost=(0,)))


@pytest.mark.usefixtures("in_pairs")
def test_ctrl_c_keeps_what_has_come_back_and_ends_the_workers() -> None:
    def stop(done: int, _: int) -> None:
        if done == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):  # there is no scatter of none
        repeat_experiment(plain(), COUNT, 0, progress=lambda *_: stop(4, 0), executor="serial")
    backwards = OneByOne(backwards=True)
    rest = repeat_experiment(plain(), COUNT, 0, progress=stop, executor=backwards)
    assert (rest.count, rest.interrupted, backwards.closed) == (4, True, True)
    np.testing.assert_array_equal(rest.estimates, repeat_experiment(plain(), COUNT, 0).estimates[COUNT - 4 :])


# --- where they run ---------------------------------------------------------------------------------------------------

LONG = 10**6  # repetitions of far more than `SHORT`


@pytest.fixture
def cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 8)


@pytest.mark.usefixtures("cores")
def test_short_repetitions_stay_in_this_process_and_long_ones_take_all_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    for workers, count in ((None, COUNT), (2, COUNT), (1, LONG)):
        assert isinstance(executor_of_repetitions("process", workers, plain(), count), InThisProcess)
    assert isinstance(executor_of_repetitions("serial", 2, plain(), LONG), InThisProcess)
    for workers, processes in ((None, 8), (3, 3)):
        pool = executor_of_repetitions("process", workers, plain(), LONG)
        assert isinstance(pool, InProcesses)
        assert pool.count == processes
    monkeypatch.setattr(units_file, "has_gpu", lambda: True)
    assert isinstance(executor_of_repetitions("process", 2, plain(), LONG), InThisProcess)


def test_what_is_asked_for_by_address_or_as_an_object_is_used() -> None:
    pool = InProcesses(2)
    assert executor_of_repetitions(pool, None, plain(), COUNT) is pool
    assert isinstance(executor_of_repetitions("dask://127.0.0.1:9", None, plain(), COUNT), DaskCluster)
    with pytest.raises(UnknownName, match="executor of units"):
        executor_of_repetitions("proces", None, plain(), COUNT)
    with pytest.raises(InputError, match="workers"):
        repeat_experiment(plain(), COUNT, 0, workers=0)
    with pytest.raises(LostWorkersError, match=r"^the scheduler went away; repeat with fewer `workers`, or with"):
        repeat_experiment(plain(), COUNT, 0, executor=OneByOne(ends_after=0))  # nothing that is not kept is promised
    assert set(REPEATABLE) == set(ESTIMATORS)


@pytest.mark.usefixtures("cores")
def test_workers_that_would_not_fit_into_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "1.5")
    pool = executor_of_repetitions("process", None, plain(), LONG)
    assert isinstance(pool, InProcesses)
    assert 1 < pool.count < 8
    for how in (("process", 8), (InProcesses(8), None), ("dask-local:8", None), ("dask-local", None)):
        with pytest.raises(TooLargeError, match=r"in 8 worker processes; .*lower `workers`"):
            executor_of_repetitions(*how, plain(), LONG)
    assert isinstance(executor_of_repetitions("dask://127.0.0.1:9", 8, plain(), LONG), DaskCluster)
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.3")
    assert isinstance(executor_of_repetitions("process", None, plain(), LONG), InThisProcess)


@pytest.fixture
def file(in_pairs: None, tmp_path: Path) -> Path:
    return tmp_path / "so-far.npz"


def lose(file: Path, experiment: Any = None, seed: int = 0) -> None:
    """Lose the executor after three units of two repetitions."""
    with pytest.raises(LostWorkersError) as lost:
        repeat_experiment(experiment or plain(), COUNT, seed, executor=OneByOne(ends_after=3), kept=file)
    assert str(lost.value) == (
        f"the scheduler went away; 6 of 12 repetitions are kept in {file}, and the same call computes the rest"
    )


@pytest.mark.parametrize("name", chains())
def test_the_same_call_computes_the_rest(name: str, file: Path, caplog: pytest.LogCaptureFixture) -> None:
    experiment = chains()[name]
    lose(file, experiment)
    rest, seen = OneByOne(), list[int]()
    with caplog.at_level(logging.INFO, "excite.study"):
        how = {"executor": rest, "kept": file, "progress": lambda done, _: seen.append(done)}
        found = repeat_experiment(experiment, COUNT, 0, **how)
    assert rest.numbers == list(range(6, COUNT))
    assert seen == [8, 10, 12]
    assert caplog.messages == [f"6 of 12 repetitions are already done in {file}"]
    same(found, repeat_experiment(experiment, COUNT, 0, executor="serial"))
    assert not file.exists()


def test_other_numbers_of_repetitions(file: Path) -> None:
    lose(file)
    content = file.read_bytes()
    for count, numbers in ((4, []), (15, list(range(6, 15)))):
        file.write_bytes(content)
        executor = OneByOne()
        same(repeat_experiment(plain(), count, 0, executor=executor, kept=file), repeat_experiment(plain(), count, 0))
        assert executor.numbers == numbers


def test_gaps_are_filled(file: Path) -> None:
    def stop(done: int, _: int) -> None:
        if done == 6:
            raise KeyboardInterrupt

    found = repeat_experiment(plain(), COUNT, 0, executor=OneByOne(lost=(1, 2)), kept=file, progress=stop)
    assert (found.count, found.interrupted) == (6, True)
    rest = OneByOne()
    same(repeat_experiment(plain(), COUNT, 0, executor=rest, kept=file), repeat_experiment(plain(), COUNT, 0))
    assert rest.numbers == [2, 3, 4, 5, 10, 11]


def _killed(file: Path) -> None:
    repeat_experiment(plain(), COUNT, 0, executor=OneByOne(), kept=file, progress=lambda done, _: _end_at(done, 8))


def _end_at(done: int, last: int) -> None:
    if done == last:
        os._exit(9)


def test_a_process_that_ends_at_once_has_kept_what_it_computed(file: Path) -> None:
    process = Process(target=_killed, args=(file,))
    process.start()
    process.join()
    assert process.exitcode == 9
    rest = OneByOne()
    same(repeat_experiment(plain(), COUNT, 0, executor=rest, kept=file), repeat_experiment(plain(), COUNT, 0))
    assert rest.numbers == [8, 9, 10, 11]


@pytest.mark.parametrize(
    ("other", "seed"),
    [
        (plain, 1),
        (lambda: replace(plain(), beta=np.nextafter(plain().beta, 9.0)), 0),
        (lambda: replace(plain(), noise=replace(plain().noise, effort=0.31)), 0),
        (lambda: chains()["differential"], 0),
    ],
)
def test_repetitions_of_another_experiment_are_not_taken(
    file: Path, other: Callable[[], Any], seed: int, caplog: pytest.LogCaptureFixture
) -> None:
    lose(file, other(), seed)
    whole = OneByOne()
    found = repeat_experiment(plain(), COUNT, 0, executor=whole, kept=file)
    assert caplog.messages == [f"{file} is of another experiment, and is replaced"]
    assert whole.numbers == list(range(COUNT))
    same(found, repeat_experiment(plain(), COUNT, 0))


def test_a_file_that_cannot_be_read_is_said(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    lose(file)
    content = file.read_bytes()
    for spoilt in (b"", content[:-100], b"PK\x03\x04", b"[1]"):
        file.write_bytes(spoilt)
        same(repeat_experiment(plain(), COUNT, 0, executor=OneByOne(), kept=file), repeat_experiment(plain(), COUNT, 0))
    assert caplog.messages == 4 * [f"{file} cannot be read; its repetitions are computed again"]


def test_what_cannot_be_compared_is_not_kept(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: Any) -> None:
        raise NotComparable("its source is not accessible")

    monkeypatch.setattr(units_file, "plain_value", refused)
    with pytest.raises(LostWorkersError, match=r"^the scheduler went away; repeat with fewer `workers`"):
        repeat_experiment(plain(), COUNT, 0, executor=OneByOne(ends_after=3), kept=file)
    assert not file.exists()
