"""What an identification refuses: recipes that cannot be, and logs that do not fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, LOAD, TASK, curves, found, periodic, played, three_joints
from refused import refusal

from excite.identification.recipe import Recipe
from excite.logs.log import Log
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.robot.friction.curves import FrictionCurves


def test_a_recipe_that_cannot_be_is_refused() -> None:
    for given, message in (
        ({"delay": (0.0, 1e9)}, "`delay` must be a number from -10000 to 10000 s, given"),
        ({"signals": "magic"}, "no signals named 'magic'; available: butterworth, "),
        ({"estimator": "best"}, "no estimator named 'best'; available: huber, "),
        ({"covariance": "none"}, "no covariance named 'none'; available: auto, white, robust"),
        ({"cutoff": 0.0}, "`cutoff` must be a number from 1e-06 to 10000000 Hz, given 0"),
        ({"sign_width": -0.1}, "`sign_width` must be 0 or a number from 1e-12 to 1000000 rad/s or m/s, given -0.1"),
        ({"sign_width": 0.1, "breakaway": 0.1}, "give `sign_width` or `breakaway`, not both"),
        ({"rows": "1:" + "9" * 5000}, "rows must be auto, all, or FIRST:LAST such as 100:2000; given '1:999999"),
        ({"rows": "0:9"}, "the first must be 1 or more and below the last, given '0:9'"),
    ):
        assert message in refusal(Recipe, **given)
    for name, given, message in (
        ("instrumental", {}, "needs the commanded motion: name the `design` that was played"),
        ("weighted", {"described_within": 1.0}, "`described_within` is for the estimator physical, not for weighted"),
    ):
        with pytest.raises(InputError) as refused:
            Recipe(estimator=name, **given).chosen_estimator().check(None)
        assert message in str(refused.value)
    assert Recipe(rows="1:3").stretch(10) == slice(0, 3)  # counted from one
    assert Recipe(rows="all").stretch(10) == slice(0, 10)
    assert Recipe().stretch(10) is None


def test_what_cannot_be_repeated_is_refused_before_any_work() -> None:
    for recipe, count, message in (
        (Recipe(), 1, "repeat must be 2 or more, or 0 for none, given 1"),
        (Recipe(), -3, "`repeat` must be a whole number from 0 to 1000000, given -3"),
        (Recipe(estimator="huber"), 5, "with the estimators instrumental, least-squares, weighted, not with huber"),
        (Recipe(average=True), 5, "leave out `average`"),
        (Recipe(measured_velocity=True), 5, "leave out `measured_velocity`"),
        (Recipe(standstill=0.1), 5, "leave out `standstill`"),
    ):
        assert message in refusal(recipe.check_repeatable, count)


LATER = (
    (Recipe(rows="1:999"), TASK, "LOG: rows: given 1:999, but the log has 400 rows"),
    (Recipe(rows="1:9"), TASK, "LOG: butterworth needs 16 samples or more, given 9"),
    (replace(EXACT, every=1000), TASK, "LOG: 3 equations are too few for 13 parameters"),
    (Recipe(signals="fourier"), TASK, "LOG: no period: the motion does not repeat itself within 0.99"),
    (Recipe(rows="all", low_pass=101.0), TASK, "the cutoff 101 Hz must be below half the sample rate, 100 Hz"),
    (replace(EXACT, low_pass=5.0), Task("irp6", model="energy"), "`low_pass` and `every` are for models of single"),
    (replace(EXACT, breakaway=0.1), Task("irp6", model="energy"), "`breakaway` is for the differential model"),
    (replace(EXACT, standstill=0.1), Task("irp6", model="energy"), "`standstill` is for models of joint torques at si"),
    (EXACT, Task("irp6", model="load"), "LOG has the joints q1, q2, q3, but not q4, q5, which the model moves"),
    (EXACT, Task("irp6", joints=("1", "3")), "LOG: joint q2 deviates by 0."),
)  # fmt: skip


def test_a_log_that_does_not_fit_is_refused(log: Log) -> None:
    for recipe, task, message in LATER:
        assert message in refusal(found, task, log, recipe=recipe)
    assert "no logs to identify from" in refusal(found, TASK)


def test_joints_that_the_model_holds_must_rest_and_channels_that_it_needs_be_there(log: Log) -> None:
    five = played(periodic(np.eye(5), 3), 5)
    with pytest.raises(InputError, match=r"LOG: joint q4 moves by 0\.\d+ rad, but the model holds it; moving joints"):
        found(TASK, five)
    at = played(three_joints(), 5)
    q = at.q.copy()
    q[:, 4] = 0.3
    assert "q5 rests at 0.3 rad, but the model holds it at 0 rad; record it" in refusal(found, TASK, replace(at, q=q))
    assert found(TASK, at).condition_number > 1.0
    # and channels that the model needs must be there
    with pytest.raises(InputError, match=r"LOG has no effort: the model needs the columns NAME\.effort"):
        found(TASK, replace(log, effort=None))
    with pytest.raises(InputError, match=r"LOG has no wrench: the model needs the columns wrench\.force\.x"):
        found(Task("irp6", model="load"), five)
    loaded = played(periodic(np.eye(5), 3), 5, load=LOAD)
    with pytest.raises(InputError, match="a wrench does not contain friction"):
        found(Task("irp6", model="load"), loaded, friction=FrictionCurves(curves()))
