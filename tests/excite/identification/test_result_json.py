"""Predictions, references, and results as files: what comes back is what went in."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from played import TASK, described, found, irp6, mixed, periodic, played
from recordings import write_sidecar
from refused import refusal
from written_files import saved

from excite.identification.identification import Identification
from excite.identification.prediction import instantaneous_target, prediction, relative_error
from excite.identification.procedure import log_of
from excite.identification.recipe import Recipe
from excite.identification.result import FitCurves, FitFacts, IdentifiedLog, ReferenceValues, reference_of
from excite.identification.result_json import load_result, result_content
from excite.information.target import target_of
from excite.logs.log import Log
from excite.logs.log_reading import write_log
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in

SAMPLES = Path(__file__).resolve().parents[2] / "samples"


def test_the_truth_predicts_what_was_measured(log: Log) -> None:
    result = found(TASK, log)
    target = instantaneous_target(irp6(), TASK, result.recipe)
    made = prediction(target, result.prepared[0], result.recipe, result.estimate.values)
    np.testing.assert_allclose(made.predicted, log.effort, atol=1e-9)
    np.testing.assert_array_equal(made.measured, log.effort)
    np.testing.assert_allclose(made.speed, log.dq, atol=1e-9)
    assert relative_error(made.measured, 0 * made.predicted) == 1.0
    assert relative_error(0 * made.measured, made.predicted) == np.inf


def test_simulated_logs_are_compared_with_their_truth(log: Log, tmp_path: Path) -> None:
    target = found(TASK, log, log).target
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    truth = {**standard_values(irp6()), "F1c": 31.0}

    def reference() -> ReferenceValues:
        return reference_of(target, [log_of(path, irp6()) for path in paths])

    for path in paths:
        write_log(log, path)
    write_sidecar(paths[0], irp6(), truth=truth)
    assert reference().kind == "description"  # of one of them the truth is not known
    write_sidecar(paths[1], irp6(), truth=truth)
    assert reference().kind == "truth"
    assert reference().values[target.base.names.index("F1c")] == 31.0
    write_sidecar(paths[1], irp6(), truth={**truth, "F1c": 32.0})
    assert reference().kind == "description"
    write_sidecar(paths[1], built_in("panda"), truth=truth)
    assert re.search(r"b\.csv is a log of panda \(description \w{12}\), not of irp6 \(\w{12}\)", refusal(reference))


def test_what_nobody_knows_is_no_number() -> None:
    result = found(TASK.changed(offset=True, joints=("1",)), played(periodic(mixed([1.0, 0.0, 0.0]), 2), 3))
    values = dict(zip(result.estimate.names, described(result), strict=True))
    assert values["F1o"] == 0.0
    robot = built_in("panda")
    target = target_of(robot, Task("panda"))
    result = replace(result, robot=robot, data=replace(result.data, target=target))
    values = dict(zip(target.base.names, described(result), strict=True))
    assert np.isnan(values["F7c"])


@pytest.fixture(scope="module")
def whole(noise: Log) -> Identification:
    return found(TASK, noise, recipe=Recipe(rows="all"))


def test_a_result_reads_back_to_the_same_numbers(noise: Log, whole: Identification, tmp_path: Path) -> None:
    result = whole
    values = described(result)
    values[2] = np.nan
    result = replace(result, reference=ReferenceValues("description", values))
    result.save(tmp_path)
    content = result_content(result)
    read = load_result(tmp_path)
    np.testing.assert_array_equal(read.coefficients, result.estimate.coefficients)
    assert (read.names, read.units) == (result.estimate.names, result.estimate.units)
    assert (read.task, read.recipe) == (result.task, result.recipe)
    assert read.robot.sha256() == result.robot.sha256()
    assert read.training == {noise.sha256}
    assert (read.friction, read.data, read.folder) == (None, None, tmp_path)
    assert plain(read) == plain(result) == json.loads((tmp_path / "result.json").read_text())
    np.testing.assert_array_equal(content["covariance"], result.estimate.covariance)
    assert [p["reference"] for p in content["parameters"]][1:4] == [values[1], None, values[3]]
    y, residual = result.observations.y, result.estimate.residual(result.observations)
    assert content["residuals"][0]["rms"] == pytest.approx(np.std(residual[::3]), rel=0.02)
    assert content["relative_error"] == pytest.approx(np.linalg.norm(residual) / np.linalg.norm(y))
    assert read.training_error == pytest.approx(content["relative_error"], rel=1e-6)  # unfiltered equations
    assert load_result(tmp_path / "result.json").names == read.names
    with pytest.raises(InputError, match="was loaded, and its file has no logs: identify again"):
        _ = read.observations


def plain(result: Identification) -> Any:
    return json.loads(json.dumps(result_content(result), allow_nan=False))


@pytest.mark.parametrize("sample", ["result-1", "verification-1"])
def test_older_files_are_read_and_written_anew(sample: str, tmp_path: Path) -> None:
    """A recursive identification from two logs with the estimates of each, and one from one log without curves."""
    older = json.loads((SAMPLES / sample / "result.json").read_text())
    assert older["recipe"].pop("pull") == 0.0  # a setting that is gone
    # and three that are new
    older["recipe"]["bias"] = older["recipe"]["log_delays"] = older["task"]["locked_drives"] = None
    read = load_result(SAMPLES / sample)
    content = plain(read)
    assert (older["schema"], content["schema"]) == ("excite.result/1", "excite.result/2")
    for name in older.keys() - {"schema", "logs", "base", "interval_scope"}:  # the last is a sentence of today
        assert content[name] == older[name], name
    for log, before in zip(content["logs"], older["logs"], strict=True):
        assert before.items() <= log.items()
    assert (read.estimate.history is None) == (read.curves.time.size == 0) == (sample == "verification-1")
    again = load_result(saved(tmp_path, read))
    assert plain(again) == content
    np.testing.assert_array_equal(again.curves.predicted, read.curves.predicted)
    assert repr(again) == repr(read)


def test_an_older_result_says_that_it_was_identified_with_a_pull(tmp_path: Path) -> None:
    """Read, written anew and read again: the note stands once, and the estimate is as it was."""
    older = json.loads((SAMPLES / "result-1" / "result.json").read_text())
    for changed, added in ({"pull": 0.5, "estimator": "ridge"}, 1), ({"pull": 0}, 0):
        (tmp_path / "result.json").write_text(json.dumps({**older, "recipe": {**older["recipe"], **changed}}))
        read = load_result(tmp_path)
        again = load_result(saved(tmp_path / str(added), read))
        for result in (read, again):
            notes = [note for note in result.estimate.notes if note.startswith("identified with a pull of 0.5 towards")]
            assert (len(notes), len(result.estimate.notes)) == (added, len(older["notes"]) + added)
            assert [p["value"] for p in plain(result)["parameters"]] == [p["value"] for p in older["parameters"]]
            assert "pull" not in plain(result)["recipe"]
            assert plain(result)["recipe"]["estimator"] == ("weighted" if "estimator" in changed else "recursive")


def test_parameters_that_are_not_shown_are_null() -> None:
    # of a motion of the second drive alone the whole model shows combinations only
    result = found(TASK, played(periodic(mixed([0.0, 1.0, -1.0]), 2), 3))
    content = json.loads(json.dumps(result_content(result), allow_nan=False))
    unseen = [p for p in content["parameters"] if not p["seen"]]
    assert {p["name"] for p in unseen} == set(content["unseen"]) >= {"X1", "F1c"}
    assert all(p["value"] is None and np.isfinite(p["fit"]) for p in unseen)
    assert content["condition_number"]["measured"] is None
    assert content["design"] is None
    assert content["friction"] is None


def test_a_filtered_identification_is_judged_on_what_was_recorded(noise: Log, whole: Identification) -> None:
    result = found(TASK, noise, recipe=Recipe(rows="all", low_pass=5.0))
    content = result_content(result)
    of_whole = result_content(whole)
    assert content["relative_error"] < 0.5 * of_whole["relative_error"]
    assert content["prediction_error"] == pytest.approx(of_whole["prediction_error"], rel=0.05)


ROWS: dict[str, Any] = {
    "time": np.arange(4.0),
    "log": np.zeros(4, dtype=np.int16),
    "equation": np.array([0, 1, 0, 1], dtype=np.int16),
    "measured": np.ones(4),
    "predicted": np.ones(4),
    "joints": ("a", "b"),
    "motion_time": np.arange(3.0),
    "motion_log": np.zeros(3, dtype=np.int16),
    "motion_q": np.zeros((3, 2)),
}


def facts(**changes: Any) -> FitFacts:
    log, base = IdentifiedLog("run.csv", "hash", 4, 0.0, 3.0, 4, 1.0), (0, (), np.inf, ())
    equations = (("q1", "Nm"), ("q2", "Nm"))
    curves = FitCurves(**{**ROWS, **changes})
    return FitFacts((log,), equations, 4, *base, {}, 0.1, 0.1, (), None, curves=curves)


def test_curves_that_do_not_fit_are_refused() -> None:
    assert facts().curves.step == 1
    for change, message in (
        ({"measured": np.ones((4, 1))}, "a measured and a predicted value of every row"),
        ({"log": np.full(4, 7, dtype=np.int16)}, r"1 log\(s\) and 2 equation"),
        ({"equation": np.full(4, -1, dtype=np.int16)}, r"1 log\(s\) and 2 equation"),
        ({"motion_log": np.zeros(2, dtype=np.int16)}, "a log of every instant of the motion"),
        ({"motion_q": np.zeros((3, 5))}, "positions of every joint"),
    ):
        assert re.search(message, refusal(facts, **change))


def test_a_file_keeps_every_kth_instant_of_long_logs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("excite.identification.result.every", lambda _: 2)
    curves = FitCurves(**{**ROWS, "time": np.array([0.0, 0.0, 1.0, 1.0]), "measured": np.arange(4.0) / 3})
    kept = replace(curves, step=3).stored()
    assert (kept.step, kept.time.tolist(), kept.equation.tolist()) == (6, [0.0, 0.0], [0, 1])
    np.testing.assert_allclose(kept.measured, [0.0, 1 / 3], rtol=1e-6)
    assert kept.measured.dtype == np.float32
