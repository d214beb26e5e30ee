"""Records in folders: read back the same, also from the files of older versions; the user's own files stay."""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from written_results import result, verification

from excite.design.sweeps.sweep_table import load_sweep
from excite.friction.fit.friction_fit import load_friction_fit
from excite.friction.plan.friction_plan import load_friction_plan
from excite.friction.plan.plan_friction import plan_friction
from excite.friction.plan.schedule import Schedule
from excite.optimality.design_bound import DesignBound
from excite.payload.payload_result import load_payload
from excite.storage.records import json_of, read_curves, read_record, write_curves
from excite.study.predict_accuracy import load_accuracy
from excite.study.time_study import TimeCourse, TimeStudy, load_time_study
from excite.verification.verification import Verification, load_verification
from excite.views.friction_plan_view import friction_plan_view
from regressors.errors import InputError

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
CURVES = ("time", "measured", "predicted", "motion", "replay", "step", "robot")


def same_entries(one: Verification, other: Verification) -> None:
    """All but the curves, to the last bit."""
    for each in dataclasses.fields(Verification):
        if each.name not in CURVES:
            assert getattr(one, each.name) == getattr(other, each.name), each.name


def test_a_verification_is_read_as_written(tmp_path: Path) -> None:
    new = verification("old")
    new.save(tmp_path)
    (path,) = tmp_path.glob("verification-*.json")
    read = load_verification(path)
    same_entries(read, new)
    assert read.robot is not None
    assert read.robot.sha256() == new.robot.sha256()
    assert (repr(read), read.holds, read.windows) == (repr(new), new.holds, new.windows)
    np.testing.assert_array_equal(read.time, new.time)
    np.testing.assert_allclose(read.measured, new.measured, rtol=1e-6)
    np.testing.assert_allclose(read.predicted, new.predicted, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(read.motion.q, new.motion.q, rtol=1e-6, atol=1e-7)
    assert read.replay.bounds == new.replay.bounds
    np.testing.assert_allclose(read.replay.q, new.replay.q, rtol=1e-6, atol=1e-7)
    assert json_of(read) == json_of(new)


def test_what_was_read_is_written_again_the_same(tmp_path: Path) -> None:
    verification("old").save(tmp_path / "a", name="verification-run")
    load_verification(tmp_path / "a" / "verification-run.json").save(tmp_path / "b", name="verification-run")
    one, other = (json.loads((tmp_path / folder / "verification-run.json").read_text()) for folder in "ab")
    assert one == other
    arrays, again = (read_curves(tmp_path / folder / "verification-run_curves.npz") for folder in "ab")
    assert arrays.keys() == again.keys()
    for name in arrays:
        np.testing.assert_array_equal(arrays[name], again[name])


def test_long_logs_are_stored_in_part(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    new = verification("old")
    monkeypatch.setattr("excite.verification.verification.every", lambda *_: 4)
    new.save(tmp_path, name="verification-run")
    read = load_verification(tmp_path / "verification-run.json")
    assert read.step == 4
    np.testing.assert_array_equal(read.time, new.time[::4])
    kept = [(read.replay.time[a], read.replay.time[b - 1]) for a, b in read.replay.bounds]
    assert kept == [(new.replay.time[a], new.replay.time[b - 1]) for a, b in new.replay.bounds]
    assert read.replay.time.size < 0.5 * new.replay.time.size


def test_without_its_curves_everything_else_is_read(tmp_path: Path) -> None:
    new = verification("old")
    new.save(tmp_path, name="verification-run")
    (tmp_path / "verification-run_curves.npz").unlink()
    read = load_verification(tmp_path / "verification-run.json")
    same_entries(read, new)
    assert (read.time.size, read.motion.joints, read.replay) == (0, (), None)


def test_a_study_is_read_as_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    values, deviation = rng.normal(size=(5, 2)), rng.random((5, 2))
    values[0], deviation[0] = np.nan, np.inf
    course = TimeCourse(
        "run", ("a", "b"), ("kg", ""), np.arange(5.0), values, deviation, 2.6, np.r_[np.inf, np.arange(4.0)],
        np.array([1.0, np.nan]), "truth",
    ).with_repetitions(rng.normal(size=(3, 5, 2)), ("noted",))  # fmt: skip
    TimeStudy("irp6", "hash", (course, course), 0.05).save(tmp_path)
    read = load_time_study(tmp_path / "study.json")
    assert (read.robot, read.sha256, read.below, len(read.courses)) == ("irp6", "hash", 0.05, 2)
    for name in TimeCourse.__dataclass_fields__:
        one, other = getattr(read.courses[1], name), getattr(course, name)
        if name == "repeated":
            np.testing.assert_allclose(one, other, rtol=1e-6)
        else:
            np.testing.assert_array_equal(one, other)


def test_only_some_repetitions_are_in_a_file_and_the_scatter_is_of_all(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("excite.study.time_study.NUMBERS", 6)
    one = np.ones((3, 1))
    course = TimeCourse("run", ("a",), ("kg",), np.arange(3.0), one, one, 2.6, one[:, 0], one[0], "truth")
    course = course.with_repetitions(np.random.default_rng(0).normal(size=(7, 3, 1)), ())
    TimeStudy("irp6", "", (course,), 0.05).save(tmp_path)
    (read,) = load_time_study(tmp_path / "study.json").courses
    assert (read.repeated.shape, read.repetitions) == ((2, 3, 1), 7)
    np.testing.assert_array_equal(read.scatter, course.scatter)


# --- files of schema 1


def test_a_study_of_schema_1_is_the_same(tmp_path: Path) -> None:
    shutil.copytree(SAMPLES / "study-1", tmp_path / "old")
    content, read = (
        json.loads((tmp_path / "old" / "study.json").read_text()),
        load_time_study(tmp_path / "old" / "study.json"),
    )
    assert content["schema"] == "excite.study/1"
    assert (read.robot, read.sha256) == (content["robot"]["name"], content["robot"]["sha256"])
    (course,), (known,) = read.courses, content["courses"]
    assert (course.names, course.repetitions) == (tuple(known["names"]), known["repetitions"])
    for values, name in ((course.values, "values"), (course.scatter, "scatter"), (course.time, "time")):
        np.testing.assert_array_equal(values, np.array(known[name], dtype=float))
    below = np.array(known["time_below"], dtype=float)
    np.testing.assert_array_equal(course.time_below(content["below"]), below)
    half = np.array(known["half_width_99"], dtype=float)
    seen = np.isfinite(half)
    assert seen.any()
    np.testing.assert_allclose(course.half_width[seen], half[seen], rtol=1e-12)


@pytest.fixture
def older(tmp_path: Path) -> Path:
    shutil.copytree(SAMPLES / "verification-1", tmp_path / "old")
    return tmp_path / "old" / "verification-run.json"


def test_a_file_of_schema_1_is_the_same_verification(older: Path) -> None:
    content, read = json.loads(older.read_text()), load_verification(older)
    assert content["schema"] == "excite.verification/1"
    assert (read.holds, read.verdict.text) == (content["holds"], content["verdict"])
    assert (read.relative_error, read.training_error) == (content["relative_error"], content["training_error"])
    assert read.windows == content["windows"]
    assert [t.name for t in read.torques] == [t["name"] for t in content["torques"]]
    assert [t.limited_by for t in read.torques] == [t["limited_by"] for t in content["torques"]]
    assert [dataclasses.asdict(c) for c in read.corrected] == [t["corrected"] for t in content["torques"]]
    assert read.motions is not None
    assert [dataclasses.asdict(m) for m in read.motions] == content["motions"]
    assert read.robot is not None
    assert read.robot.sha256() == content["robot"]["sha256"]
    curves = read_curves(older.with_name("verification-run_curves.npz"))
    np.testing.assert_array_equal(read.measured, curves["measured"])
    assert read.replay is not None
    np.testing.assert_array_equal(read.replay.q, curves["replay_q"])
    np.testing.assert_array_equal(read.motion.q, curves["replay_measured"])
    assert np.all(np.isnan(read.replay.dq))


def test_a_bound_of_schema_1_is_the_same(tmp_path: Path) -> None:
    path = shutil.copytree(SAMPLES / "bound-1", tmp_path / "design") / "bound.json"
    content, read = json.loads(path.read_text()), read_record(path, DesignBound, "bound")
    assert (read.name, read.problem, read.coefficients) == ("design", content["problem"], content["coefficients"])
    assert [each.efficiency for each in read.criteria] == [each["efficiency"] for each in content["criteria"]]
    assert read.sensitivity is not None
    assert [dataclasses.asdict(row) for row in read.sensitivity.rows] == content["sensitivity"]["rows"]


def test_an_accuracy_of_schema_1_is_the_same(tmp_path: Path) -> None:
    path = shutil.copytree(SAMPLES / "accuracy-1", tmp_path / "design") / "accuracy.json"
    content, read = json.loads(path.read_text()), load_accuracy(path)
    assert (read.name, read.count, read.precision) == (content["design"], content["samples"], content["precision"])
    assert [{**dataclasses.asdict(p), "error": p.error} for p in read.parameters] == content["parameters"]
    assert read.notes == tuple(content["notes"])


def test_a_friction_fit_of_schema_1_is_the_same(tmp_path: Path) -> None:
    path = shutil.copytree(SAMPLES / "friction-fit-1", tmp_path / "fit") / "fit.json"
    content, read = json.loads(path.read_text()), load_friction_fit(path)
    (one,), (drive,) = read.characteristics, content["drives"]
    assert (read.robot, read.sha256) == (content["robot"]["name"], content["robot"]["sha256"])
    assert [dataclasses.asdict(log) for log in read.logs] == [{**log, "left_out": ()} for log in content["logs"]]
    assert (one.drive, dataclasses.asdict(read.settings)) == (drive["name"], content["settings"])
    assert one.fit is not None
    known = drive["fit"]["parameters"]
    assert one.fit.parameters.keys() == known.keys()
    for name, parameter in one.fit.parameters.items():
        assert parameter == pytest.approx(known[name], rel=1e-9)
    assert [dataclasses.asdict(point) for point in one.points] == drive["points"]
    assert [dataclasses.asdict(mean) for mean in one.means] == drive["break_away"]
    assert isinstance(one.curve.torque(0.5), float | np.ndarray)


def test_a_friction_plan_of_schema_1_is_the_same(tmp_path: Path) -> None:
    path = shutil.copytree(SAMPLES / "friction-plan-1", tmp_path / "plan") / "plan.json"
    content, read = json.loads(path.read_text()), load_friction_plan(path.parent)
    assert read.world is not None
    assert (read.world.to_dict(), read.robot.sha256()) == (content["world"], content["robot"]["sha256"])
    assert [dataclasses.asdict(passage) for passage in read.passages] == content["passages"]
    for c, known in zip(read.coordinates, content["trajectories"], strict=True):
        assert (c.label, c.place.pose.tolist()) == (known["coordinate"], list(known["pose"].values()))
        assert (c.runs.duration, c.stroke, c.order) == (known["duration"], known["stroke"], known["order"])
        assert c.tests == known["stiction"]
        assert [dataclasses.asdict(each) for each in c.left_out] == known["left_out"]
        assert [use.to_dict() for use in c.limits] == known["limits"]
        assert [{**d.use.to_dict(), "at": d.at} for d in c.distances or ()] == known["distances"]
        assert c.ramps is not None
        assert (c.ramps.duration, c.ramps.file) == (known["torque_ramps"]["duration"], known["torque_ramps"]["file"])
    read.save(tmp_path / "again")
    again = json.loads((tmp_path / "again" / "plan.json").read_text())
    assert again["schedule"] == {**content["schedule"], "longest": "inf", "stroke": "inf"}
    for known, new in zip(content["trajectories"], again["trajectories"], strict=True):
        assert {name: new[name] for name in known if name != "torque_ramps"} == {
            name: value for name, value in known.items() if name != "torque_ramps"
        }


def test_a_sweep_table_of_schema_1_is_the_same(tmp_path: Path) -> None:
    path = shutil.copytree(SAMPLES / "campaign-1", tmp_path / "campaign") / "campaign.json"
    content, read = json.loads(path.read_text()), load_sweep(path.parent)
    assert [dataclasses.asdict(row) for row in read.rows] == content["rows"]
    rows = [*content["rows"], {**content["rows"][0], "cell": "c", "status": "failed", "group": 0, "facts": {}}]
    path.write_text(json.dumps({**content, "rows": rows}))
    read = load_sweep(path)
    assert (read.rows[2].facts, read.counts) == (None, {"designed": 2, "failed": 1})
    read.save(tmp_path / "again")
    assert load_sweep(tmp_path / "again") == read


def test_gravity_that_is_not_known_is_read_from_null(tmp_path: Path) -> None:
    content = json.loads((SAMPLES / "friction-plan-1" / "plan.json").read_text())
    first = content["trajectories"][0]
    first["largest_gravity"] = first["torque_ramps"]["gravity"] = first["windows"][0]["gravity"] = None
    (tmp_path / "plan.json").write_text(json.dumps(content))
    c = load_friction_plan(tmp_path).coordinates[0]
    assert c.ramps is not None
    assert np.isnan([c.largest_gravity, c.ramps.gravity, c.windows[0].gravity]).all()


@pytest.mark.parametrize("drives", [("2", "3"), ("5",)])
def test_a_friction_plan_is_read_as_written(drives: tuple[str, ...], tmp_path: Path) -> None:
    schedule = Schedule(percent=(20.0, 100.0), warm_up=1.0, breakaways=1, creeping=1.0, rate=50.0)
    new = plan_friction("irp6", schedule, drives=drives)
    new.save(tmp_path / "a")
    read = load_friction_plan(tmp_path / "a")
    assert (json_of(read), repr(read), read.holds) == (json_of(new), repr(new), new.holds)
    read.save(tmp_path / "b")
    for each in (tmp_path / "a").iterdir():
        if each.name != "manifest.json":
            assert each.read_bytes() == (tmp_path / "b" / each.name).read_bytes(), each.name
    assert friction_plan_view(read).tables == friction_plan_view(new).tables


def test_a_payload_of_schema_1_is_refused_with_the_reason() -> None:
    with pytest.raises(InputError, match=r"has intervals, but not the covariance .* identify the payload again"):
        load_payload(SAMPLES / "payload-1" / "payload.json")


def test_it_is_written_in_the_schema_of_today(older: Path, tmp_path: Path) -> None:
    load_verification(older).save(tmp_path / "new", name="verification-run")
    assert json.loads((tmp_path / "new" / "verification-run.json").read_text())["schema"] == "excite.verification/2"
    same_entries(load_verification(tmp_path / "new" / "verification-run.json"), load_verification(older))


def test_without_its_result_it_has_no_robot(older: Path) -> None:
    (older.parent / "result.json").unlink()
    assert load_verification(older).robot is None


def test_what_was_not_finite_is_infinite(older: Path) -> None:
    content = json.loads(older.read_text())
    content["relative_error"] = content["torques"][1]["relative"] = None
    content["torques"][0]["corrected"] = None
    older.write_text(json.dumps(content))
    read = load_verification(older)
    assert (read.relative_error, read.torques[1].relative) == (np.inf, np.inf)
    assert read.corrected == ()


# --- what is refused


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.update(schema="excite.verification/3"), "expected schema excite.verification/2, given"),
        (lambda c: c.pop("tolerances"), r"run.json: not a complete verification: 'tolerances' is missing"),
        (lambda c: c["torques"][0].pop("unit"), r"torques\[0\]: 'unit' is missing"),
        (lambda c: c["log"].update(rows="many"), "log.rows: expected int, given 'many'"),
        (lambda c: c.update(remarks=[1]), r"remarks\[0\]: expected str, given 1"),
        (lambda c: c["robot"].update(sha256="0"), "does not have the hash that the file states"),
        (lambda c: c.update(torques=c["torques"][:2], corrected=[]), "torques of 2 equations"),
        (lambda c: c["motion"].update(joints=["q1"]), "positions of every joint"),
    ],
)
def test_damage_is_named(change: Callable[[dict[str, Any]], object], message: str, tmp_path: Path) -> None:
    verification("old").save(tmp_path, name="verification-run")
    (tmp_path / "manifest.json").unlink()
    path = tmp_path / "verification-run.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=message):
        load_verification(path)


@pytest.mark.parametrize("name", ["verification-run.json", "verification-run_curves.npz"])
def test_a_file_that_was_changed_since_is_refused(name: str, tmp_path: Path) -> None:
    verification("old").save(tmp_path, name="verification-run")
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes() + b" ")
    with pytest.raises(InputError, match=f"{name} has been changed"):
        load_verification(tmp_path / "verification-run.json")


def test_curves_of_other_lengths_are_refused(tmp_path: Path) -> None:
    verification("old").save(tmp_path, name="verification-run")
    (tmp_path / "manifest.json").unlink()
    path = tmp_path / "verification-run_curves.npz"
    write_curves(path, {**read_curves(path), "measured": np.zeros((3, 3))})
    with pytest.raises(InputError, match="expected measured and predicted torques of 3 equations"):
        load_verification(tmp_path / "verification-run.json")


def test_a_file_of_the_users_own_stays(tmp_path: Path) -> None:
    (tmp_path / "verification-run.json").write_text("{}")
    with pytest.raises(InputError, match="is already there, and is not a verification"):
        verification("old").save(tmp_path, name="verification-run")
    assert (tmp_path / "verification-run.json").read_text() == "{}"


def test_the_sample_is_of_the_result_beside_it() -> None:
    stored = json.loads((SAMPLES / "verification-1" / "result.json").read_text())
    assert stored["robot"]["sha256"] == result("old").robot.sha256()
