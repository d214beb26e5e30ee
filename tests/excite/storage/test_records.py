"""Records in folders: read back the same, also from the files of older versions; the user's own files stay."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refused import refusal
from written_files import assert_alike, saved
from written_results import verification

import excite
from excite.design.friction_runs.friction_plan import load_friction_plan
from excite.design.friction_runs.plan_friction import plan_friction
from excite.design.friction_runs.schedule import Schedule
from excite.design.sweeps.sweep_table import load_sweep
from excite.payload.payload_result import PayloadResult
from excite.storage.codec import content_of
from excite.storage.records import json_of, read_curves, read_record, write_curves
from excite.study.time_study import TimeCourse, TimeStudy
from excite.verification.verification import Verification
from excite.views.friction_views import friction_plan_view
from regressors.errors import InputError

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
CURVES = ("time", "measured", "predicted", "motion", "replay", "step")


def load_verification(path: Path) -> Verification:
    return read_record(path, Verification, "verification")


def test_a_verification_is_read_as_written_and_without_its_curves_all_else(tmp_path: Path) -> None:
    new = verification("old")
    new.save(tmp_path)
    (path,) = tmp_path.glob("verification-*.json")
    read = load_verification(path)
    assert_alike(read, new, *CURVES)
    assert (repr(read), read.holds, read.windows) == (repr(new), new.holds, new.windows)
    np.testing.assert_array_equal(read.time, new.time)
    np.testing.assert_allclose(read.measured, new.measured, rtol=1e-6)
    np.testing.assert_allclose(read.predicted, new.predicted, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(read.motion.q, new.motion.q, rtol=1e-6, atol=1e-7)
    assert read.replay.bounds == new.replay.bounds
    np.testing.assert_allclose(read.replay.q, new.replay.q, rtol=1e-6, atol=1e-7)
    assert json_of(read) == json_of(new)
    path.with_name(f"{path.stem}_curves.npz").unlink()
    without = load_verification(path)
    assert_alike(without, new, *CURVES)
    assert (without.time.size, without.motion.joints, without.replay) == (0, (), None)


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


def test_a_study_is_read_as_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    values, deviation = rng.normal(size=(5, 2)), rng.random((5, 2))
    values[0], deviation[0] = np.nan, np.inf
    course = TimeCourse(
        "run", ("a", "b"), ("kg", ""), np.arange(5.0), values, deviation, 2.6, np.r_[np.inf, np.arange(4.0)],
        np.array([1.0, np.nan]), "truth",
    ).with_repetitions(rng.normal(size=(3, 5, 2)), ("noted",))  # fmt: skip
    TimeStudy("irp6", "hash", (course, course), 0.05).save(tmp_path)
    read = excite.load(tmp_path / "study.json")
    assert (read.robot, read.sha256, read.below, len(read.courses)) == ("irp6", "hash", 0.05, 2)
    assert_alike(read.courses[1], course, "repeated")
    np.testing.assert_allclose(read.courses[1].repeated, course.repeated, rtol=1e-6)


def test_only_some_repetitions_are_in_a_file_and_the_scatter_is_of_all(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("excite.study.time_study.NUMBERS", 6)
    one = np.ones((3, 1))
    course = TimeCourse("run", ("a",), ("kg",), np.arange(3.0), one, one, 2.6, one[:, 0], one[0], "truth")
    course = course.with_repetitions(np.random.default_rng(0).normal(size=(7, 3, 1)), ())
    TimeStudy("irp6", "", (course,), 0.05).save(tmp_path)
    (read,) = excite.load(tmp_path / "study.json").courses
    assert (read.repeated.shape, read.repetitions) == ((2, 3, 1), 7)
    np.testing.assert_array_equal(read.scatter, course.scatter)


# --- files of schema 1


# entries of an older file that have another name today, or none because they follow from the others
OLDER: dict[str, dict[str, str | None]] = {
    "study-1/study.json": {
        "courses.reference.kind": "courses.reference_kind",
        "courses.reference.values": "courses.0.reference",
        **dict.fromkeys(("courses.time_below", "courses.half_width_99", "courses.mean_of_repetitions")),
    },
    "verification-1/verification-run.json": {"log.from": "log.start", "log.to": "log.end", "torques.limited_by": None},
    "bound-1/bound.json": {},
    "accuracy-1/accuracy.json": {"design": "name", "samples": "count"},
    "friction-fit-1/fit.json": {
        "robot.name": "robot",
        "subtracted": "gravity_source",
        "drives.name": "characteristics.drive",
        "drives.fit.model": "characteristics.fit.form.name",
        "drives.compared.model": None,
        **dict.fromkeys(f"drives.{of}.{x}" for of in ("fit", "compared") for x in ("aicc", "reference_temperature")),
    },
    "friction-plan-1/plan.json": {"schedule.longest": None, "schedule.stroke": None},
    "campaign-1/campaign.json": {},
}


def entries(content: Any, path: str = "") -> dict[str, list[Any]]:
    """Plain values of a content in their order, by the names that lead to them."""
    found: dict[str, list[Any]] = {}
    pairs = content.items() if isinstance(content, dict) else [("", each) for each in content]
    for name, value in pairs:
        place = f"{path}.{name}".strip(".")
        deeper = entries(value, place) if isinstance(value, dict | list | tuple) else {place: [value]}
        for key, values in deeper.items():
            found.setdefault(key, []).extend(values)
    return found


def alike(one: list[Any], other: list[Any]) -> bool:
    """The same texts, and numbers to rounding; null is what was not finite."""
    texts = [[x for x in some if isinstance(x, str) and x not in ("nan", "inf", "-inf")] for some in (one, other)]
    numbers = [[np.nan if x is None else float(x) for x in some if not isinstance(x, str)] for some in (one, other)]
    sizes = [len(one), *map(len, numbers)]
    return texts[0] == texts[1] and sizes[1] == sizes[2] and np.allclose(*numbers, rtol=1e-9, atol=0, equal_nan=True)


@pytest.mark.parametrize("place", OLDER)
def test_every_entry_of_schema_1_is_in_the_record_of_today(place: str, tmp_path: Path) -> None:
    path = shutil.copytree(SAMPLES / Path(place).parent, tmp_path / "old") / Path(place).name
    content, arrays = content_of(excite.load(path))
    known = entries(json.loads(json.dumps(content))) | {
        name: np.ravel(array).tolist() for name, array in arrays.items()
    }
    for name, values in entries(json.loads(path.read_text())).items():
        if name == "schema" or OLDER[place].get(name, "") is None:
            continue
        other = OLDER[place].get(name)
        here = [known[other]] if other else [v for key, v in known.items() if key.split(".")[-1] == name.split(".")[-1]]
        assert any(alike(values, each) for each in here), name


def test_what_follows_from_a_study_of_schema_1_is_the_same() -> None:
    path = SAMPLES / "study-1" / "study.json"
    (course,), (known,) = excite.load(path).courses, json.loads(path.read_text())["courses"]
    below, half = (np.array(known[name], dtype=float) for name in ("time_below", "half_width_99"))
    np.testing.assert_array_equal(course.time_below(0.05), below)
    seen = np.isfinite(half)
    assert seen.any()
    np.testing.assert_allclose(course.half_width[seen], half[seen], rtol=1e-12)


def test_a_plan_and_a_sweep_of_schema_1_are_written_again(tmp_path: Path) -> None:
    load_friction_plan(SAMPLES / "friction-plan-1").save(tmp_path / "plan")
    old, new = (
        json.loads((folder / "plan.json").read_text()) for folder in (SAMPLES / "friction-plan-1", tmp_path / "plan")
    )
    assert new["schedule"] == {**old["schedule"], "longest": "inf", "stroke": "inf"}
    content = json.loads((SAMPLES / "campaign-1" / "campaign.json").read_text())
    rows = [*content["rows"], {**content["rows"][0], "cell": "c", "status": "failed", "group": 0, "facts": {}}]
    (tmp_path / "campaign.json").write_text(json.dumps({**content, "rows": rows}))
    read = load_sweep(tmp_path / "campaign.json")
    assert (read.rows[2].facts, read.counts) == (None, {"designed": 2, "failed": 1})
    read.save(tmp_path / "again")
    assert load_sweep(tmp_path / "again") == read


@pytest.fixture
def older(tmp_path: Path) -> Path:
    shutil.copytree(SAMPLES / "verification-1", tmp_path / "old")
    return tmp_path / "old" / "verification-run.json"


def test_a_file_of_schema_1_is_the_same_verification(older: Path) -> None:
    content, read = json.loads(older.read_text()), load_verification(older)
    assert [each.limited_by for each in read.torques] == [each["limited_by"] for each in content["torques"]]
    assert read.robot.sha256() == content["robot"]["sha256"]
    curves = read_curves(older.with_name("verification-run_curves.npz"))
    np.testing.assert_array_equal(read.measured, curves["measured"])
    np.testing.assert_array_equal(read.replay.q, curves["replay_q"])
    np.testing.assert_array_equal(read.motion.q, curves["replay_measured"])
    assert np.all(np.isnan(read.replay.dq))
    read.save(older.parent / "new", name="verification-run")  # in the schema of today
    again = older.parent / "new" / "verification-run.json"
    assert json.loads(again.read_text())["schema"] == "excite.verification/2"
    assert_alike(load_verification(again), read, *CURVES)


def test_gravity_that_is_not_known_is_read_from_null(tmp_path: Path) -> None:
    content = json.loads((SAMPLES / "friction-plan-1" / "plan.json").read_text())
    first = content["trajectories"][0]
    first["largest_gravity"] = first["torque_ramps"]["gravity"] = first["windows"][0]["gravity"] = None
    (tmp_path / "plan.json").write_text(json.dumps(content))
    c = load_friction_plan(tmp_path).coordinates[0]
    assert np.isnan([c.largest_gravity, c.ramps.gravity, c.windows[0].gravity]).all()


@pytest.mark.parametrize("drives", [("2", "3"), ("5",)])
def test_a_friction_plan_is_read_as_written(drives: tuple[str, ...], tmp_path: Path) -> None:
    schedule = Schedule(percent=(20.0, 100.0), warm_up=1.0, breakaways=1, creeping=1.0, rate=50.0)
    new = plan_friction("irp6", schedule, drives=drives)
    read = load_friction_plan(saved(tmp_path / "a", new))
    assert (json_of(read), repr(read), read.holds) == (json_of(new), repr(new), new.holds)
    read.save(tmp_path / "b")
    for each in (tmp_path / "a").iterdir():
        if each.name != "manifest.json":
            assert each.read_bytes() == (tmp_path / "b" / each.name).read_bytes(), each.name
    assert friction_plan_view(read).tables == friction_plan_view(new).tables


def test_a_payload_of_schema_1_is_refused_with_the_reason() -> None:
    with pytest.raises(InputError, match=r"has intervals, but not the covariance .* identify the payload again"):
        read_record(SAMPLES / "payload-1" / "payload.json", PayloadResult, "payload")


def test_what_was_not_finite_is_infinite(older: Path) -> None:
    content = json.loads(older.read_text())
    content["relative_error"] = content["torques"][1]["relative"] = None
    content["torques"][0]["corrected"] = None
    older.write_text(json.dumps(content))
    (older.parent / "result.json").unlink()
    read = load_verification(older)
    assert read.robot is None
    assert (read.relative_error, read.torques[1].relative, read.corrected) == (np.inf, np.inf, ())


# --- what is refused


DAMAGE: tuple[tuple[Callable[[dict[str, Any]], object], str], ...] = (
    (lambda c: c.update(schema="excite.verification/3"), "expected schema excite.verification/2, given"),
    (lambda c: c.pop("tolerances"), r"run.json: not a complete verification: 'tolerances' is missing"),
    (lambda c: c["torques"][0].pop("unit"), r"torques\[0\]: 'unit' is missing"),
    (lambda c: c["log"].update(rows="many"), "log.rows: expected int, given 'many'"),
    (lambda c: c.update(remarks=[1]), r"remarks\[0\]: expected str, given 1"),
    (lambda c: c["robot"].update(sha256="0"), "does not have the hash that the file states"),
    (lambda c: c.update(torques=c["torques"][:2], corrected=[]), "torques of 2 equations"),
    (lambda c: c["motion"].update(joints=["q1"]), "positions of every joint"),
)


def test_damage_is_named(tmp_path: Path) -> None:
    verification("old").save(tmp_path, name="verification-run")
    path, curves = tmp_path / "verification-run.json", tmp_path / "verification-run_curves.npz"
    for changed in (path, curves):
        whole = changed.read_bytes()
        changed.write_bytes(whole + b" ")
        assert f"{changed.name} has been changed" in refusal(load_verification, path)
        changed.write_bytes(whole)
    (tmp_path / "manifest.json").unlink()
    text = path.read_text()
    for change, message in DAMAGE:
        content = json.loads(text)
        change(content)
        path.write_text(json.dumps(content))
        assert re.search(message, refusal(load_verification, path))
    path.write_text(text)
    write_curves(curves, {**read_curves(curves), "measured": np.zeros((3, 3))})
    assert "expected measured and predicted torques of 3 equations" in refusal(load_verification, path)
