"""Presliding of each drive over its own velocity or distance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, TASK, curves, described, found, irp6, played, three_joints

from excite.identification.equations import directions, measured_direction
from excite.identification.result_json import load_result
from excite.logs.log import Log
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array

C = irp6().transmission.coupling[:3, :3]
WIDTHS, DISTANCES = (0.2, 0.0, 0.02), (0.02, 1e-9, 0.001)


def turned(direction: Array) -> Log:
    """A log with friction whose direction is not the sign of the velocity."""
    log = played(three_joints(), 3)
    return replace(log, effort=log.effort + ([28.0, 28.75, 30.0] * (direction - np.sign(log.dq @ C.T))) @ C)


@pytest.fixture(scope="module")
def soft() -> Log:
    log = played(three_joints(), 3)
    return turned(np.tanh(log.dq @ C.T / np.maximum(WIDTHS, 1e-12)))


@pytest.fixture(scope="module")
def hysteretic() -> Log:
    return turned(measured_direction(played(three_joints(), 3).q @ C.T, np.array(DISTANCES)))


@pytest.mark.parametrize("known", [{}, {"friction": FrictionCurves({"z1": curves()["z1"]})}], ids=["columns", "curve"])
def test_widths_of_each_drive_are_taken(known: dict, soft: Log, tmp_path) -> None:
    result = found(TASK, soft, recipe=replace(EXACT, sign_width=WIDTHS), **known)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-8, atol=1e-8)
    assert "changes sign over 0.2, 0, 0.02 rad/s" in " ".join(result.estimate.notes)
    assert result.training_error < 1e-8
    result.save(tmp_path)
    assert load_result(tmp_path).recipe.sign_width == WIDTHS


def test_distances_of_each_drive_are_taken(hysteretic: Log) -> None:
    result = found(TASK, hysteretic, recipe=replace(EXACT, breakaway=DISTANCES))
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-8, atol=1e-8)


def test_one_size_each_is_one_for_all_where_they_are_equal(soft: Log) -> None:
    each, common = (found(TASK, soft, recipe=replace(EXACT, sign_width=w)) for w in ((0.1,) * 3, 0.1))
    np.testing.assert_allclose(each.estimate.values, common.estimate.values, rtol=1e-10)


@pytest.mark.parametrize(
    ("task", "changes", "message"),
    [
        (TASK, {"sign_width": (0.1, 0.1)}, "`sign_width` needs one value, or 3, one per moving drive; given 2"),
        (TASK, {"breakaway": (0.1,)}, "`breakaway` needs one value, or 3, one per moving drive; given 1"),
        (
            Task("irp6", model="energy"),
            {"sign_width": (0.1,) * 3},
            "a `sign_width` of each drive is for the differential model",
        ),
    ],
)
def test_sizes_that_do_not_fit_are_refused(task: Task, changes: dict, message: str, soft: Log) -> None:
    with pytest.raises(InputError, match=message):
        found(task, soft, recipe=replace(EXACT, **changes))


def test_zero_is_the_sign() -> None:
    dz = np.array([[0.3, -0.2], [0.0, 0.1]])
    np.testing.assert_array_equal(directions(dz, dz, (0.0, 1e-9), None), np.sign(dz))
    assert directions(dz, dz, 0.0, (0.0, 0.0)) is None
