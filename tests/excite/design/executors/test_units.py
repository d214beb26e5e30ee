"""Units of work give the same wherever they run; a process that ends is replaced."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest
from processes import dies

from excite.design.executors.unit_executor import InProcesses, InThisProcess, LostUnit
from excite.errors import LostWorkersError

pytestmark = pytest.mark.slow


def test_results_come_by_number_from_every_executor() -> None:
    units = list(range(7))
    for executor in (InThisProcess(), InProcesses(2)):
        assert dict(executor.run(pow, 2, units)) == {k: 2**k for k in units}
        assert dict(executor.run(pow, 2, [])) == {}


def test_a_unit_that_kills_its_process_once_runs_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        results = dict(InProcesses(2).run(dies, (str(tmp_path), 1), [0, 1, 2, 3]))
    assert results == {0: 0, 1: 1, 2: 2, 3: 3}
    assert [record.getMessage().split(" (")[0] for record in caplog.records] == ["a worker process ended"]


def test_a_unit_that_always_kills_its_process_is_left_out(tmp_path: Path) -> None:
    results = dict(InProcesses(2).run(dies, (str(tmp_path), 99), [0, 1, 2, 3]))
    lost = results.pop(2)
    assert results == {0: 0, 1: 1, 3: 3}
    assert isinstance(lost, LostUnit)
    assert "ended 3 times" in lost.reason


def test_replacements_are_bounded(tmp_path: Path) -> None:
    with pytest.raises(LostWorkersError, match="what is finished is kept"):
        dict(InProcesses(1).run(dies, (str(tmp_path), 99), [2] * 9))


def test_an_error_of_a_unit_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        dict(InProcesses(1).run(divmod, 1, [0]))
