"""Repetitions in other processes: which run there, and what becomes of those that are lost."""

from __future__ import annotations

import logging
import pickle

import numpy as np
import pytest
from repeated_experiments import OneByOne, chains, plain, same

from excite.design.executors.dask_cluster import DaskCluster
from excite.design.executors.unit_executor import InProcesses, InThisProcess
from excite.errors import LostWorkersError
from excite.study import repetitions as units_file
from excite.study.experiment import Chain
from excite.study.repetitions import (
    SeededExperiment,
    executor_of_repetitions,
    experiment_prediction,
    repeat_experiment,
    units_of,
)
from regressors.errors import InputError, TooLargeError, UnknownName

COUNT = 10


@pytest.fixture
def in_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Units of two repetitions."""
    monkeypatch.setattr(units_file, "repetition_seconds", lambda _, count: count * units_file._UNIT / 2)


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
    seen: list[tuple[int, int]] = []
    backwards = OneByOne(backwards=True)
    there = repeat_experiment(
        plain(), COUNT, 0, progress=lambda done, count: seen.append((done, count)), executor=backwards
    )
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

    backwards = OneByOne(backwards=True)
    rest = repeat_experiment(plain(), COUNT, 0, progress=stop, executor=backwards)
    assert (rest.count, rest.interrupted, backwards.closed) == (4, True, True)
    np.testing.assert_array_equal(rest.estimates, repeat_experiment(plain(), COUNT, 0).estimates[6:])


def test_a_scheduler_that_goes_away_promises_nothing_that_is_not_kept() -> None:
    with pytest.raises(LostWorkersError, match=r"^the scheduler went away; repeat with fewer `workers`, or with"):
        repeat_experiment(plain(), COUNT, 0, executor=OneByOne(ends_after=0))


# --- where they run ---------------------------------------------------------------------------------------------------

LONG = 10**6  # repetitions of far more than `SHORT`


@pytest.fixture
def cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 8)


@pytest.mark.usefixtures("cores")
def test_short_repetitions_stay_in_this_process_and_long_ones_take_all_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(executor_of_repetitions("process", None, plain(), COUNT), InThisProcess)
    assert isinstance(executor_of_repetitions("process", 2, plain(), COUNT), InThisProcess)
    assert isinstance(executor_of_repetitions("process", 1, plain(), LONG), InThisProcess)
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


@pytest.mark.usefixtures("cores")
def test_workers_that_would_not_fit_into_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "1.5")
    pool = executor_of_repetitions("process", None, plain(), LONG)
    assert isinstance(pool, InProcesses)
    assert 1 < pool.count < 8
    experiment_prediction(plain(), pool.count).check()
    for how in (("process", 8), (InProcesses(8), None), ("dask-local:8", None), ("dask-local", None)):
        with pytest.raises(TooLargeError, match=rf"`workers=8` that .* large, `workers={pool.count}` would do"):
            executor_of_repetitions(*how, plain(), LONG)
    assert isinstance(executor_of_repetitions("dask://127.0.0.1:9", 8, plain(), LONG), DaskCluster)
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.3")
    assert isinstance(executor_of_repetitions("process", None, plain(), LONG), InThisProcess)


@pytest.mark.parametrize("count", [2, 7, 1000])
def test_units_are_all_numbers_once(count: int) -> None:
    common = SeededExperiment(plain(), 0, {})
    for executor in (InThisProcess(), InProcesses(2)):
        assert [k for unit in units_of(executor, common, range(count)) for k in unit] == list(range(count))
    assert len(units_of(InThisProcess(), common, range(count))) == count
