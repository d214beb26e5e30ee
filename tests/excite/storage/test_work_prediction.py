"""Work that is too large is refused, and long work is announced."""

from __future__ import annotations

import logging
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
from excite.design import blueprint
from excite.design.blueprint import search_seconds
from excite.design.campaign import campaign_seconds, plan_campaign
from excite.design.formulation import formulate
from excite.design.friction_runs import schedule
from excite.design.friction_runs.schedule import Schedule
from excite.design.optimisation import announce_search
from excite.design.starts import keep_starts
from excite.identification.identify import check_rows, identification_seconds
from excite.identification.recipe import check_estimates
from excite.information.target import target_of
from excite.logs.log import Log
from excite.logs.log_reading import write_log
from excite.simulation import simulate
from excite.simulation.settings import SimulationSettings
from excite.study.repetitions import experiment_of, repeat_experiment, repetition_seconds
from excite.study.study_over_time import study_over_time, study_seconds
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import Task
from excite.verification.verify import verification_seconds
from regressors import work_prediction as long_work
from regressors.errors import InputError, TooLargeError
from regressors.readers.library import built_in, built_in_names
from regressors.work_prediction import LONG, announce, check_memory, in_time, memory_cap

# Memory: the cap, and what is refused beyond it.


def test_the_cap_is_raised_by_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    message = "^the work would take about 5 GB of memory, more than the cap of 4 GB: 7 arms"
    with pytest.raises(TooLargeError, match=message):
        check_memory("the work", 5e9, "7 arms", "take fewer")
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "12")
    assert memory_cap() == 12e9
    check_memory("the work", 5e9, "7 arms", "take fewer")
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "")
    assert memory_cap() == 4e9


def test_a_cap_that_is_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    for text in ("much", "-1", "0", "nan", "inf", "4 GB", "\x1b[31m"):
        monkeypatch.setenv("EXCITE_MEMORY_CAP", text)
        with pytest.raises(InputError, match=r"EXCITE_MEMORY_CAP: expected a number of GB greater than") as refused:
            memory_cap()
        assert str(refused.value).isprintable()
    assert [in_time(seconds) for seconds in (3.0, 112.0, 9e3, 1e6)] == ["3 s", "110 s", "2.5 h", "12 days"]


@pytest.mark.parametrize("name", built_in_names())
def test_the_defaults_of_every_robot_are_small(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.3")
    task, robot = Task(name, workers=8), built_in(name)
    blueprint.check_size(target_of(installed_robot(task), task), task)
    schedule.check_size(robot, Schedule())
    simulate.check_size(SimulationSettings(), 10.0, robot.n, wrench=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "option"),
    [
        ({"trajectory": "bspline", "intervals": 900, "workers": 2}, "intervals"),
        ({"model": "energy", "window_length": 1e-6}, "window_length"),
        ({"home": "robot", "settle": 1e5}, "settle"),
        ({"harmonics": 1000, "rate": 1000.0, "workers": 2}, "harmonics"),
    ],
)
def test_what_makes_a_design_large_is_named(options: dict[str, object], option: str) -> None:
    task = Task("irp6", **options)
    with pytest.raises(TooLargeError, match=rf"^the design would take about .*`{option}`.*, or raise the cap"):
        check_and_predict(task)


def check_and_predict(task: Task) -> None:
    blueprint.check_richness(task)
    blueprint.check_size(target_of(installed_robot(task), task), task)


@pytest.mark.parametrize(("executor", "workers", "together"), [("serial", None, 1), ("process", 4, 4)])
def test_the_time_of_a_search_is_that_of_the_starts_that_are_left(executor: str, workers: int, together: int) -> None:
    task = Task("irp6", starts=100, executor=executor, workers=workers)
    target = target_of(installed_robot(task), task)
    alone = replace(task, search=replace(task.search, executor="serial"))
    assert search_seconds(target, task, 40) == pytest.approx(search_seconds(target, alone, 40) / together)
    assert search_seconds(target, task, 40) == pytest.approx(2.0 * search_seconds(target, task, 20))
    assert search_seconds(target, task, 0) == 0.0


@pytest.mark.parametrize(
    ("name", "harmonics", "measured"), [("irp6", 10, 0.75), ("irp6", 60, 64.2), ("panda", 20, 5.8)]
)
def test_the_time_of_a_start_is_near_the_measured_one(name: str, harmonics: int, measured: float) -> None:
    task = Task(name, harmonics=harmonics, starts=1, executor="serial")
    assert 0.2 < search_seconds(target_of(installed_robot(task), task), task, 1) / measured < 5.0


def test_what_makes_plans_simulations_and_repetitions_large_is_named() -> None:
    for option in ("warm_up", "repeats", "creeping", "pause", "ramping"):
        long = Schedule(**{option: 10**5 if option == "repeats" else 1e5})
        with pytest.raises(TooLargeError, match=rf"^the plan would .*`{option}`"):
            schedule.check_size(built_in("irp6"), long)
    for settings, option in ((SimulationSettings(rate=1e7), "rate"), (SimulationSettings(periods=10_000), "periods")):
        with pytest.raises(TooLargeError, match=rf"^the simulation would take about .*`{option}`"):
            simulate.check_size(settings, 10.0 * settings.periods, 6, wrench=False)
    for count in (10**8, 10**24, 10**300):
        with pytest.raises(TooLargeError, match=r"^the repetition would .*lower `repeat`"):
            check_estimates(count)


def test_campaigns_of_many_drives_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "5e-6")
    with pytest.raises(TooLargeError, match=r"^the campaign would take about .*lower `at_once`"):
        plan_campaign("irp6", 3)


def test_two_million_rows_of_six_joints_are_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    columns = np.zeros((2_000, 6))
    log = Log("long", "", tuple("abcdef"), np.arange(2_000.0), columns, effort=columns)
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "2.4")  # it takes 1.7 GB
    check_rows("the identification", [log] * 1_000)
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "1.6")
    with pytest.raises(TooLargeError, match="choose fewer rows with `rows`"):
        check_rows("the identification", [log] * 1_000)


# Long work is announced once, before it starts; the command line prints the sentence, and nothing is refused.


@pytest.fixture
def said(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    """Its messages are what is announced."""
    caplog.set_level(logging.INFO, logger="excite.work")
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


WORKS: dict[str, Callable[[], object]] = {
    "the identification": _identified,
    "the verification on LOG": lambda: excite.verify(_identified(), log(2)),
    "the campaign": lambda: plan_campaign("irp6"),
    "the repetitions": lambda: repeat_experiment(experiment_of(_identified(), 2), 2, 0),
    "the study": lambda: study_over_time("irp6", [log()], points=5),
    "the search": lambda: excite.design_payload_motion("ur10e", 0.3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WORKS)
def test_work_announces_itself(
    name: str, said: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(long_work, "LONG", -1.0)
    WORKS[name]()
    write_log(log(), tmp_path / "run.csv")
    excite.read_log(tmp_path / "run.csv")
    for first in (name, f"reading {tmp_path / 'run.csv'}"):
        assert [line for line in said.messages if line.startswith(f"{first} will take about ")]


SEARCHES: dict[str, tuple[dict[str, Any], str]] = {
    "default": ({}, "20 s"),
    "budget": ({"budget": 600.0}, "10 min"),
    "rounds": ({"rounds": 10, "harmonics": 40}, "min"),
    "no rounds": ({"starts": 1, "rounds": 0, "harmonics": 40}, "10 s"),
}


@pytest.mark.parametrize(("options", "told"), SEARCHES.values(), ids=SEARCHES)
def test_a_search_whose_time_is_bounded_announces_that_time(
    options: dict[str, Any], told: str, said: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(long_work, "LONG", -1.0)
    task = Task("irp6", torque_margin="none", **options)
    formulation = formulate(installed_robot(task), task)
    announce_search(formulation, keep_starts(tmp_path, formulation))
    (line,) = (line for line in said.messages if line.startswith("the search will take about "))
    assert f"{told}; Ctrl-C" in line


def test_the_command_line_prints_it(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    assert here.run("plan", "irp6").stderr == ""
    monkeypatch.setattr(long_work, "LONG", 0.0)
    (line,) = here.run("plan", "irp6").stderr.splitlines()
    assert line.startswith("excite: the campaign will take about 0.1")
    assert line.endswith("; a lower --at-once takes less")
    assert logging.getLogger("excite.work").level == logging.NOTSET


def many(rows: int, joints: int, logs: int = 1, step: float = 1e-6) -> list[Log]:
    """Logs of which only the size counts; short ones, which are simulated as a whole, unless the step is longer."""
    columns = np.broadcast_to(np.zeros((1, joints)), (rows, joints))
    names, time = tuple("abcdefg"[:joints]), step * np.arange(rows)
    return [Log(f"log {k}", "", names, time, columns, effort=columns) for k in range(logs)]


def _moved(rows: int) -> Any:
    """As much of an experiment with the irp6 as tells how long its repetitions take."""
    model = SimpleNamespace(robot=built_in("irp6"), window=None)
    return SimpleNamespace(model=model, samples=SimpleNamespace(time=np.zeros(rows)), low_pass=None)


# CPU seconds on one core that multiplies two matrices of 1000 x 1000 numbers in 0.03 s
@pytest.mark.parametrize(
    ("predicted", "measured", "factor"),
    [
        (identification_seconds(many(2000, 5, logs=5), chosen=True), 4.73, 3),
        (identification_seconds(many(100_000, 6), chosen=True), 12.9, 3),
        (identification_seconds(many(100_000, 6), chosen=False), 2.63, 3),
        (identification_seconds(many(4000, 3), chosen=False), 0.105, 3),
        (verification_seconds(many(20_000, 6)[0], simulated=True), 5.04, 4),
        (verification_seconds(many(600_000, 7, step=1e-3)[0], simulated=True), 14.5, 4),
        (campaign_seconds(63, 72, 6), 2.19, 3),
        (campaign_seconds(127, 84, 1), 0.59, 3),
        (repetition_seconds(_moved(4000), 100), 0.26, 3),
        (study_seconds([10.0], 5, 2000.0, 100, 4), 3.54, 3),
    ],
)
def test_rules_are_near_what_was_measured(predicted: float, measured: float, factor: float) -> None:
    assert 1 / factor < predicted / measured < factor
