"""Frames and dicts of columns are identified from and verified on directly, as the logs that they are read as."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from refused import refusal

import excite
from excite.identification.procedure import log_of, read_logs
from excite.logs.layout import CHANNELS
from excite.logs.log import channels_of
from excite.logs.mapping import LogMapping
from regressors.errors import InputError
from regressors.readers.library import built_in

QUICK: dict[str, Any] = {"choose": False, "estimator": "weighted"}


@pytest.fixture(scope="module")
def frames() -> list[Any]:
    """Two logs of one motion, as frames."""
    search = excite.Search(starts=1, seed=0, executor="serial")
    choice = excite.TrajectoryChoice(harmonics=3, period=4.0)
    design = excite.design_trajectory("irp6", trajectory=choice, search=search)
    return [frame_of(excite.simulate(design, rate=100.0, noise=1.0, seed=seed).measured) for seed in (1, 2)]


def frame_of(log: excite.Log) -> Any:
    columns = {"time": log.time}
    for name, values in channels_of(log).items():
        columns |= {f"{joint}.{CHANNELS[name]}": values[:, k] for k, joint in enumerate(log.joints)}
    return pa.table(columns)


def test_a_frame_stands_for_its_log(frames: list[Any]) -> None:
    frame, other = frames
    log = excite.Log.from_frame(frame)
    results = [excite.identify("irp6", given, **QUICK) for given in (frame, frame.to_pydict(), log)]
    for result in results:
        np.testing.assert_array_equal(result.coefficients, results[0].coefficients, strict=True)
        assert [*result.training] == [log.sha256]
        for seen in (frame, frame.to_pydict(), log):
            refusal(excite.verify, result, seen, begins="frame is a log that the result was identified from")
    check = excite.verify(results[0], other)
    assert check.holds
    assert (check.log.file, check.log.sha256) == ("frame", excite.Log.from_frame(other).sha256)


def test_several_frames_are_numbered_and_given_once(frames: list[Any]) -> None:
    robot = built_in("irp6")
    logs = read_logs(frames, robot, None, (), lambda _: None)
    assert [log.source for log in logs] == ["frame 1", "frame 2"]
    assert [log.joints for log in logs] == [("q1", "q2", "q3")] * 2
    with pytest.raises(InputError, match=r"^frame 3 has the same content as frame 1; give each log once"):
        read_logs([*frames, frames[0].to_pydict()], robot, None, (), lambda _: None)


def test_rows_and_mapping_of_the_call_apply(frames: list[Any]) -> None:
    robot, frame = built_in("irp6"), frames[0]
    renamed = frame.rename_columns([name.replace(".", " ") for name in frame.column_names])
    columns = {suffix: [f"q{k} {suffix}" for k in (1, 2, 3)] for suffix in ("position", "effort")}
    content: dict[str, Any] = {"time": {"column": "time"}, "joints": ["q1", "q2", "q3"]}
    content |= {
        name: {"columns": columns[name], "unit": unit} for name, unit in (("position", "rad"), ("effort", "Nm"))
    }
    log = log_of(renamed, robot, LogMapping.model_validate(content), only=(3, 50))
    np.testing.assert_array_equal(log.q, excite.Log.from_frame(frame).q[2:50], strict=True)
    np.testing.assert_array_equal(log.row_numbers, np.arange(3, 51))
    assert log.dq is None


def test_what_is_no_log_is_refused() -> None:
    with pytest.raises(InputError, match=r"^logs: expected a Log, .*a simulation, a DataFrame, a mapping or a list"):
        excite.identify("irp6", 3)
    refusal(log_of, 3, None, begins="expected a log, the name of its file, a simulation, a frame or a dict of col")
