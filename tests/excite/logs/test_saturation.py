"""Torques at their limits: found in a log by its numbers alone, or read from the file beside it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import log_of, sines, write_sidecar

from excite.logs.log import Log
from excite.logs.saturation import Saturation, measured_saturation, spans_of, within
from excite.logs.sidecar import read_sidecar, saturated_torques, saturation_content, sidecar_path
from regressors.errors import InputError
from regressors.readers.library import built_in
from regressors.samples import Array

PANDA = built_in("panda")
RATE = 200.0
LIMIT = float(PANDA.limits.torque[1])
SPANS = ((0.5, 0.75), (1.0, 1.0))


def log(tau: Array) -> Log:
    """The arm moves; its second torque is given in parts of its limit."""
    time = np.arange(tau.size) / RATE
    q, dq, ddq = (np.tile(x, 3)[:, :7] * 0.5 for x in sines(time, joints=3))
    effort = 0.1 * np.sin(q) + ddq
    effort[:, 1] = LIMIT * tau
    return log_of(time, q, dq, effort, PANDA.joint_names)


def swing(size: float) -> Array:
    return size * np.sin(2 * np.pi * np.arange(1600) / 400)


@pytest.mark.parametrize("bound", [1.0, 0.9995, 1.2], ids=["at the limit", "just below", "above"])
def test_a_torque_that_is_cut_off_at_its_limit_is_found(bound: float) -> None:
    tau = np.clip(swing(1.5), -bound, bound)
    (found,) = measured_saturation(log(tau), PANDA)
    assert (found.label, found.unit, found.limit) == ("joint panda_joint2", "Nm", LIMIT)
    assert found.rows == np.count_nonzero(np.abs(tau) == bound)
    assert len(found.spans) == 8
    np.testing.assert_array_equal(within(np.arange(1600) / RATE, found.spans), np.abs(tau) == bound)


def noise(size: float) -> Array:
    return size * np.random.default_rng(0).normal(size=1600)


@pytest.mark.parametrize(
    "tau",
    [
        np.clip(swing(1.5), -0.99, 0.99),
        np.clip(swing(0.3), -0.2, 0.2),
        swing(0.999),
        swing(1.0),
        swing(1.5),
        np.round(swing(1.0), 2),
        swing(0.9) + noise(0.05),
    ],
    ids=["held below", "held far below", "a peak below", "a peak at it", "beyond it", "rounded", "noise"],
)
def test_other_torques_are_let_alone(tau: Array) -> None:
    assert measured_saturation(log(tau), PANDA) == ()


def test_a_log_without_torques_shows_nothing() -> None:
    assert measured_saturation(replace(log(swing(1.0)), effort=None), PANDA) == ()


def test_spans_of_several_torques_are_joined_where_they_meet() -> None:
    one, two = (
        Saturation("a", 1.0, "Nm", 3, ((0.0, 1.0), (4.0, 5.0))),
        Saturation("b", 1.0, "Nm", 3, ((0.5, 2.0), (5.0, 6.0), (8.0, 8.0))),
    )
    assert spans_of([one, two]) == ((0.0, 2.0), (4.0, 6.0), (8.0, 8.0))
    time = np.array([0.0, 2.0, 2.1, 3.9, 7.0, 8.0])
    assert within(time, spans_of([one, two])).tolist() == [True, True, False, False, False, True]
    assert within(time, ((2.05, 2.05),), begin=time - 1.0).tolist() == [False, False, True, False, False, False]


def beside(folder: Path, **more: object) -> dict[str, object]:
    path = folder / "log.csv"
    write_sidecar(path, PANDA)
    content = json.loads(sidecar_path(path).read_text())
    sidecar_path(path).write_text(json.dumps({**content, **more}))
    return read_sidecar(path)


def test_the_file_beside_a_log_says_when(tmp_path: Path) -> None:
    said = Saturation("drive z2", 3.5, "Nm", 52, SPANS)
    content = beside(tmp_path, saturated=[saturation_content(said)])
    assert saturated_torques(content, "log.json") == (said,)


def test_files_of_before_say_nothing_of_it(tmp_path: Path) -> None:
    assert saturated_torques(beside(tmp_path), "log.json") == ()


GOOD = saturation_content(Saturation("joint a", 1.0, "Nm", 1, SPANS))


@pytest.mark.parametrize(
    "saturated",
    [
        {"joint a": 1},
        [3],
        [{}],
        [{**GOOD, "torque": 2}],
        [{**GOOD, "limit": "much"}],
        [{**GOOD, "rows": None}],
        [{**GOOD, "spans": [[0.1]]}],
        [{**GOOD, "spans": [[0.1, "end"]]}],
        [{**GOOD, "spans": 3}],
    ],
)
def test_what_is_not_understood_is_refused(tmp_path: Path, saturated: object) -> None:
    with pytest.raises(InputError, match=r"log\.json: saturated should list objects"):
        beside(tmp_path, saturated=saturated)
