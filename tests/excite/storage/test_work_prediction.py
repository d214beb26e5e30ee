"""Predictions of memory: the cap, what is said beyond it, and the value that fits."""

import numpy as np
import pytest

from excite.design.blueprint import check_richness, design_prediction, search_seconds
from excite.design.campaign import campaign_prediction
from excite.friction.plan.schedule import Schedule, plan_prediction
from excite.identification.identify import rows_prediction
from excite.identification.recipe import repetition_prediction
from excite.information.target import target_of
from excite.logs.log import Log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulation_prediction
from excite.storage.work_prediction import BASE, MemoryPart, WorkPrediction, in_time
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import Task
from regressors.errors import InputError, TooLargeError
from regressors.memory_cap import memory_cap, value_cap
from regressors.readers.library import built_in, built_in_names


def of_rate(rate: float, power: float = 1.0) -> WorkPrediction:
    part = MemoryPart("samples", 1e6 * rate**power, 2, 1e8 * rate**power, "rate", rate, power)
    return WorkPrediction("the work", (part,), seconds=7200.0)


def test_what_fits_is_done() -> None:
    of_rate(38.0).check()


@pytest.mark.parametrize(("rate", "power", "fits"), [(100.0, 1.0, "38"), (100.0, 2.0, "6.2"), (100, 1.0, "38")])
def test_what_does_not_fit_is_refused_with_a_value_that_does(rate: float, power: float, fits: str) -> None:
    with pytest.raises(TooLargeError, match=rf"more than the cap of 4 GB: .*`rate=100`.*`rate={fits}` would do"):
        of_rate(rate, power).check()
    of_rate(float(fits), power).check()


def test_memory_and_time_are_said() -> None:
    with pytest.raises(TooLargeError, match=r"^the work would take about 10\.1 GB of memory and 2 h, "):
        of_rate(100.0).check()


def test_a_smaller_value_may_be_what_is_too_large() -> None:
    part = MemoryPart("windows", 1e9, 10, 1e11, "window_length", 1e-6, -1.0)
    with pytest.raises(TooLargeError, match=r"`window_length=0\.0001` would do"):
        WorkPrediction("the work", (part,)).check()


@pytest.mark.parametrize(("repeats", "columns", "fits"), [(2_000_001, 50, "2000000"), (9_000_000, 60, "1600000")])
def test_a_table_of_more_than_1e8_numbers_is_refused(repeats: int, columns: int, fits: str) -> None:
    def of(repeats: int) -> WorkPrediction:
        part = MemoryPart("repetitions", repeats, columns, float(repeats * columns), "repeats", repeats)
        return WorkPrediction("the work", (MemoryPart("a", 1, 1, 1e9), part))

    with pytest.raises(TooLargeError, match=rf"numbers in one table, more than the cap of 1e\+08: .*`repeats={fits}`"):
        of(repeats).check()
    of(int(fits)).check()


def test_the_cap_of_numbers_rises_with_that_of_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    assert value_cap() == 1e8
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "8")
    assert value_cap() == 2e8


def test_the_rest_may_leave_no_value() -> None:
    parts = (MemoryPart("a", 1, 1, 6e9, "rate", 5.0), MemoryPart("b", 1, 1, 5e9, "starts", 7))
    with pytest.raises(TooLargeError, match="a lower `rate` is needed"):
        WorkPrediction("the work", parts).check()


def test_the_cap_is_raised_by_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "12")
    assert memory_cap() == 12e9
    of_rate(100.0).check()
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "")
    assert memory_cap() == 4e9


@pytest.mark.parametrize("text", ["much", "-1", "0", "nan", "inf", "4 GB", "\x1b[31m"])
def test_a_cap_that_is_no_number(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("EXCITE_MEMORY_CAP", text)
    with pytest.raises(InputError, match=r"EXCITE_MEMORY_CAP: expected a number of GB greater than zero") as refused:
        memory_cap()
    assert str(refused.value).isprintable()


@pytest.mark.parametrize(("seconds", "text"), [(3.0, "3 s"), (600.0, "10 min"), (9e3, "2.5 h"), (1e6, "12 days")])
def test_times_in_words(seconds: float, text: str) -> None:
    assert in_time(seconds) == text


@pytest.mark.parametrize("name", built_in_names())
def test_the_defaults_of_every_robot_are_small(name: str) -> None:
    task = Task(name, workers=8)
    assert design_prediction(target_of(installed_robot(task), task), task).bytes < 2 * BASE
    robot = built_in(name)
    assert plan_prediction(robot, Schedule(), robot.n).bytes < 3 * BASE
    assert simulation_prediction(SimulationSettings(), 10.0, robot.n, wrench=True).bytes < 2 * BASE


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
    with pytest.raises(TooLargeError, match=rf"^the design would take about .*`{option}=.* would do, or raise"):
        check_and_predict(task)


def check_and_predict(task: Task) -> None:
    check_richness(task)
    design_prediction(target_of(installed_robot(task), task), task).check()


@pytest.mark.parametrize(("executor", "workers", "together"), [("serial", None, 1), ("process", 4, 4)])
def test_the_time_of_a_search_is_that_of_the_starts_that_are_left(executor: str, workers: int, together: int) -> None:
    task = Task("irp6", starts=100, executor=executor, workers=workers)
    target = target_of(installed_robot(task), task)
    predicted = design_prediction(target, task)
    assert predicted.seconds is not None
    assert search_seconds(target, task, 40) == pytest.approx(0.4 * predicted.seconds / together)
    assert search_seconds(target, task, 0) == 0.0


@pytest.mark.parametrize(
    ("name", "harmonics", "measured"), [("irp6", 10, 0.75), ("irp6", 60, 64.2), ("panda", 20, 5.8)]
)
def test_the_time_of_a_start_is_near_the_measured_one(name: str, harmonics: int, measured: float) -> None:
    task = Task(name, harmonics=harmonics, starts=1, executor="serial")
    assert 0.2 < search_seconds(target_of(installed_robot(task), task), task, 1) / measured < 5.0


@pytest.mark.parametrize("option", ["warm_up", "repeats", "creeping", "pause", "ramping"])
def test_what_makes_a_plan_large_is_named(option: str) -> None:
    large = 10**5 if option == "repeats" else 1e5
    with pytest.raises(TooLargeError, match=rf"^the plan would take about .*`{option}=100000`.*`{option}=\d+` would"):
        plan_prediction(built_in("irp6"), Schedule(**{option: large}), 5).check()


@pytest.mark.parametrize(("change", "option"), [({"rate": 1e7}, "rate"), ({"periods": 10_000}, "periods")])
def test_what_makes_a_simulation_large_is_named(change: dict[str, float], option: str) -> None:
    settings = SimulationSettings(**change)
    with pytest.raises(TooLargeError, match=rf"^the simulation would take about .*`{option}=\d+` would do"):
        simulation_prediction(settings, 10.0 * settings.periods, 6, wrench=False).check()


@pytest.mark.parametrize("count", [10**8, 10**24, 10**300])
def test_repetitions_are_bounded(count: int) -> None:
    with pytest.raises(TooLargeError, match=r"^the repetition would .*`repeat=\d+` would do"):
        repetition_prediction(count).check()


def test_campaigns_of_many_drives_are_bounded() -> None:
    campaign_prediction(7, 7, 84).check()
    with pytest.raises(TooLargeError, match=r"^the campaign would take about .*`at_once=1` would do"):
        campaign_prediction(60, 30, 700).check()


def test_two_million_rows_of_six_joints_are_not_refused() -> None:
    columns = np.zeros((1, 6))
    log = Log("long", "", tuple("abcdef"), np.zeros(1), columns, effort=columns)
    rows = rows_prediction("the identification", [log] * 2_000_000)
    rows.check()
    assert 1.7e9 < rows.bytes < 2.4e9  # it takes 1.7 GB
