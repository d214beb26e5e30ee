"""Repetitions of a study: the same numbers wherever they are computed, and what becomes of those that are lost."""

from __future__ import annotations

import logging
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from played import TASK, irp6
from processes import DaskProcesses, kill
from repeated_experiments import OneByOne

from excite.design.design import Design
from excite.design.executors.unit_executor import InProcesses, UnitExecutor
from excite.design.optimisation import design_trajectory
from excite.errors import LostWorkersError
from excite.study.study_over_time import study_over_time
from regressors.errors import InputError, UnknownName


@cache
def design() -> Design:
    return design_trajectory(TASK.changed(robot=irp6(), period=3.0, harmonics=3, starts=1, executor="serial"))


def repeated(executor: str | UnitExecutor, repeats: int = 4, **how: Any) -> Any:
    study = study_over_time(
        "irp6", designs=[design()], simulation={"rate": 100.0}, repeats=repeats, points=4, executor=executor, **how
    )
    return study.courses[0].repeated


@pytest.mark.slow
def test_numbers_are_the_same_in_any_order_and_without_what_is_lost(caplog: pytest.LogCaptureFixture) -> None:
    serial = repeated("serial")
    np.testing.assert_array_equal(repeated("process"), serial)  # short: in this process
    np.testing.assert_array_equal(repeated(OneByOne(backwards=True)), serial)
    with caplog.at_level(logging.WARNING):
        np.testing.assert_array_equal(repeated(OneByOne(lost=(1,), backwards=True)), serial[[0, 2, 3]])
    assert caplog.messages == ["repetition 2 is left out: its process ended"]
    with pytest.raises(InputError, match=r"repetitions: 1 of 4 are left, since workers ended; repeat with fewer"):
        repeated(OneByOne(lost=(0, 1, 2)))


@pytest.mark.slow
def test_numbers_are_the_same_in_processes_and_on_dask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    serial = repeated("serial")
    np.testing.assert_array_equal(repeated(InProcesses(2)), serial)
    monkeypatch.setattr("excite.study.study_over_time.SHORT", 0.0)
    np.testing.assert_array_equal(repeated("process", workers=2), serial)
    pytest.importorskip("distributed")
    with DaskProcesses(tmp_path) as dask:
        np.testing.assert_array_equal(repeated(dask.address), serial)
        monkeypatch.setattr("excite.study.study_over_time._TOLD", 1)

        def end(step: str) -> None:
            if "repetition 1 of" in step:
                kill(dask.scheduler)

        monkeypatch.setattr("excite.design.executors.dask_cluster._AHEAD", 1)
        with pytest.raises(LostWorkersError, match=rf"^the Dask scheduler at {dask.address} went away; nothing of the"):
            repeated(dask.address, progress=end)


def test_workers_that_are_lost_keep_nothing() -> None:
    with pytest.raises(LostWorkersError) as lost:
        repeated(OneByOne(ends_after=1), repeats=2)
    assert str(lost.value) == (
        "the scheduler went away; nothing of the study is kept: repeat it with fewer `workers`, or with another "
        "`executor`"
    )


@pytest.mark.parametrize(
    ("executor", "how", "error"), [("proces", {}, UnknownName), ("process", {"workers": 0}, InputError)]
)
def test_where_they_cannot_run(executor: str, how: dict[str, Any], error: type[Exception]) -> None:
    with pytest.raises(error):
        repeated(executor, **how)
