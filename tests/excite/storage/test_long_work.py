"""Long work is announced once, before it starts; the command line prints the sentence, and nothing is refused."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from commands import Here
from played import noisy, played, three_joints

import excite
from excite.design.campaign import campaign_seconds, plan_campaign, selections_of
from excite.design.optimisation import design_trajectory
from excite.identification.identify import identification_seconds
from excite.information.target import target_of
from excite.logs.log import Log
from excite.storage import work_prediction as long_work
from excite.storage.work_prediction import LONG, announce
from excite.study.repetitions import repetition_seconds, repetitions
from excite.study.study_over_time import study_over_time, study_seconds
from excite.tasks.task import Task
from excite.verification.verify import verification_seconds
from regressors.readers.library import built_in


@pytest.fixture
def said(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    """Its messages are what is announced."""
    caplog.set_level(logging.INFO, logger="excite.storage")
    return caplog


def test_only_long_work_is_announced(said: pytest.LogCaptureFixture) -> None:
    announce("the work", LONG)
    assert said.messages == []
    announce("the work", 7200.0, "a lower `rate` takes less")
    announce("the work", 40.0)
    assert said.messages == ["the work will take about 2 h; a lower `rate` takes less", "the work will take about 40 s"]


def log(seed: int = 1) -> Log:
    return noisy(played(three_joints(), 3, 200.0), 0.2, 1e-6, seed)


def _identified() -> Any:
    return excite.identify("irp6", log(), choose=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "first"),
    [
        (_identified, "the identification will take about "),
        (lambda: excite.verify(_identified(), log(2)), "the verification on LOG will take about "),
        (lambda: plan_campaign("irp6"), "the campaign will take about "),
        (lambda: repetitions(_identified(), 2, 0), "the repetitions will take about "),
        (lambda: study_over_time("irp6", [log()], points=5), "the study will take about "),
        (lambda: excite.design_payload_motion("ur10e", 0.3), "the search will take about "),
    ],
    ids=["identify", "verify", "plan", "repeat", "study", "payload"],
)
def test_work_announces_itself(
    work: Callable[[], object], first: str, said: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(long_work, "LONG", -1.0)
    work()
    assert [line for line in said.messages if line.startswith(first)]


def test_reading_announces_itself(
    tmp_path: Path, said: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time,a.position,a.effort\n" + "".join(f"{k},{k % 7},1\n" for k in range(100)))
    monkeypatch.setattr(long_work, "LONG", 0.0)
    excite.read_log(path)
    (line,) = said.messages
    assert line.startswith(f"reading {path} will take about ")


def test_the_command_line_prints_it(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    here = Here(tmp_path, monkeypatch, capfd)
    assert here.run("plan", "irp6").stderr == ""
    monkeypatch.setattr(long_work, "LONG", 0.0)
    (line,) = here.run("plan", "irp6").stderr.splitlines()
    assert line.startswith("excite: the campaign will take about 0.1")
    assert line.endswith("; a lower --at-once takes less")
    assert logging.getLogger("excite.storage").level == logging.NOTSET


def many(rows: int, joints: int, logs: int = 1) -> list[Log]:
    """Logs of which only the size counts."""
    columns = np.broadcast_to(np.zeros((1, joints)), (rows, joints))
    names = tuple("abcdefg"[:joints])
    time = 1e-6 * np.arange(rows)  # a short log is simulated as a whole
    return [Log(f"log {k}", "", names, time, columns, effort=columns) for k in range(logs)]


def lasting(log: Log, seconds: float) -> Log:
    """The same over some time."""
    return replace(log, time=np.linspace(0.0, seconds, log.count))


# CPU seconds on one core that multiplies two matrices of 1000 x 1000 numbers in 0.03 s
@pytest.mark.parametrize(
    ("predicted", "measured", "factor"),
    [
        (identification_seconds(many(800, 5), chosen=True), 1.48, 3),
        (identification_seconds(many(8000, 5), chosen=False), 0.23, 3),
        (identification_seconds(many(8000, 7), chosen=True), 5.97, 3),
        (identification_seconds(many(2000, 5, logs=5), chosen=True), 4.73, 3),
        (identification_seconds(many(100_000, 6), chosen=True), 12.9, 3),
        (identification_seconds(many(100_000, 6), chosen=False), 2.63, 3),
        (identification_seconds(many(2_000_000, 6), chosen=True), 30.3, 3),
        (verification_seconds(many(20_000, 6)[0], simulated=True), 24.3, 4),
        (verification_seconds(many(8000, 6)[0], simulated=True), 1.44, 4),
        (verification_seconds(many(8000, 7)[0], simulated=True), 21.1, 4),
        (verification_seconds(many(1000, 7)[0], simulated=True), 5.36, 4),
        (verification_seconds(lasting(many(600_000, 7)[0], 600.0), simulated=True), 14.5, 4),
        (campaign_seconds(63, 72, 6), 2.19, 3),
        (campaign_seconds(119, 84, 7), 6.19, 3),
        (campaign_seconds(127, 84, 1), 0.59, 3),
        (study_seconds([10.0], 5, 2000.0, 100, 4), 3.54, 3),
        (study_seconds([10.0], 6, 500.0, 1000, 4), 4.58, 3),
    ],
)
def test_rules_are_near_what_was_measured(predicted: float, measured: float, factor: float) -> None:
    assert 1 / factor < predicted / measured < factor


def _cpu(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


@pytest.mark.slow
@pytest.mark.parametrize("rows", [4000, 20_000])
def test_the_time_of_an_identification_and_its_repetitions(rows: int) -> None:
    long = noisy(played(three_joints(), 3, rows / 10.0, 10.0), 0.2, 1e-6, 1)
    plain = excite.identify("irp6", long, choose=False)
    again = replace(long, sha256="another")
    for chosen in (False, True):
        measured = _cpu(lambda: excite.identify("irp6", again, choose=chosen))  # noqa: B023
        assert 0.25 < identification_seconds([long], chosen=chosen) / measured < 4.0
    one, more = (_cpu(lambda: repetitions(plain, count, 0)) for count in (2, 102))  # noqa: B023
    model = plain.target.model
    experiment = SimpleNamespace(model=model, samples=plain.prepared[0].samples, low_pass=None)
    assert 0.25 < repetition_seconds(experiment, 100) / (more - one) < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("at_once", [2, 4])
def test_the_time_of_a_campaign(at_once: int) -> None:
    task = Task("panda", model="differential")
    measured = _cpu(lambda: plan_campaign(task, at_once))
    model = target_of(built_in("panda"), task).model
    predicted = campaign_seconds(selections_of(7, at_once), len(model.columns), len(model.row_labels))
    assert 0.25 < predicted / measured < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("repeats", [0, 10])
def test_the_time_of_a_study(repeats: int) -> None:
    design = design_trajectory("irp6", period=10.0, harmonics=3, starts=1, executor="serial")
    measured = _cpu(lambda: study_over_time("irp6", designs=[design], repeats=repeats))
    assert 0.25 < study_seconds([10.0], 3, 2000.0, 100, repeats) / measured < 4.0
