"""Sections of friction plans, fits of friction curves, studies, repetitions, and campaigns with their designs."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from reported import ParsedPage
from written_results import design, plan, result

import excite
from excite.friction.fit.friction_fit import load_friction_fit
from excite.friction.plan.friction_plan import load_friction_plan
from excite.identification.result import RepeatedParameter, RepetitionSummary
from excite.study.time_study import load_time_study
from excite.tasks.friction_file import write_friction
from excite.views.page_text import page_text
from excite.views.player_log import Appearance
from excite.views.sections import section_of
from excite.views.write_report import report_text
from regressors.errors import InputError
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plans") / "plan"
    plan("old").save(folder)
    return folder


@pytest.fixture(scope="module")
def fit(planned: Path) -> excite.FrictionFit:
    log = excite.simulate(str(planned / "z3.csv"), rate=100.0, seed=0)
    return excite.fit_friction("irp6", [log], plan=planned)


def test_a_friction_plan(planned: Path) -> None:
    page = report_text(planned)
    parsed, content = ParsedPage(page), json.loads((planned / "plan.json").read_text())
    (z3,) = content["trajectories"]
    numbers = [z3["stroke"], z3["velocity"], z3["largest_gravity"], len(z3["windows"]), z3["duration"]]
    assert parsed.numbers("coordinates") == [numbers]
    windows = [[w[n] for n in ("percent", "speed", "start", "end", "first", "last")] for w in z3["windows"]]
    assert parsed.numbers("windows") == windows
    verdict = next("".join(each.text) for each in parsed.elements if each.attributes.get("class") == "verdict good")
    assert f"friction of z3 in {len(windows)} windows" in verdict
    assert "not checked: collisions" in verdict
    assert len(parsed.of("svg")) == 1


def test_limits_of_a_plan_are_those_of_its_files(planned: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(planned, tmp_path / "plan")
    (folder / "manifest.json").unlink()
    lines = (folder / "z3.csv").read_text().splitlines(keepends=True)
    k = lines[0].split(",").index("q3.velocity")
    rows = (line.split(",") for line in lines[1:])
    fast = [",".join([*row[:k], str(3 * float(row[k])), *row[k + 1 :]]) for row in rows]
    (folder / "z3.csv").write_text("".join([lines[0], *fast]))
    page = ParsedPage(report_text(folder))
    verdict = next("".join(each.text) for each in page.elements if "verdict" in str(each.attributes.get("class")))
    assert "It breaks" in verdict
    assert "velocity" in verdict


def test_the_motion_of_a_stored_plan_is_the_planned_one(planned: Path) -> None:
    (coordinate,), (stored,) = plan("old").coordinates, load_friction_plan(planned).coordinates
    (runs, segments), (known, same) = coordinate.samples(), stored.samples()
    assert segments == same
    for one, other in ((runs.time, known.time), (runs.q, known.q), (runs.dq, known.dq), (runs.ddq, known.ddq)):
        np.testing.assert_array_equal(one, other)
    motion = json.loads(
        next("".join(e.text) for e in ParsedPage(report_text(planned)).of("script") if "id" in e.attributes)
    )
    shown = np.array(motion["q"])
    played = np.column_stack([np.interp(motion["time"], runs.time - runs.time[0], column) for column in runs.q.T])
    np.testing.assert_allclose(shown, played, atol=1e-8)


@pytest.mark.slow
def test_a_fit_of_friction_curves(fit: excite.FrictionFit, tmp_path: Path) -> None:
    fit.save(tmp_path / "fit")
    stored = load_friction_fit(tmp_path / "fit" / "fit.json")
    (known,), (made,) = stored.characteristics, fit.characteristics
    assert known.fit is not None
    assert made.fit is not None
    assert (known.fit.form, known.points, known.stiction) == (made.fit.form, made.points, made.stiction)
    v = np.linspace(-1.0, 1.0, 7)
    np.testing.assert_array_equal(known.fit.band(v), made.fit.band(v))
    assert [other.form for other in known.others] == [other.form for other in made.others]
    parsed, new = (ParsedPage(report_text(each)) for each in (tmp_path / "fit", fit))
    rows = [
        [value, *([] if name in made.fit.held else [value - half, value + half])]
        for name, value, half in zip(
            made.fit.form.parameters, made.fit.values.tolist(), made.fit.halfwidth.tolist(), strict=True
        )
    ]
    for page in (parsed, new):
        np.testing.assert_allclose(np.concatenate(page.numbers("friction")), np.concatenate(rows), rtol=1e-9)
    assert ["".join(e.text) for e in parsed.of("text")] == ["".join(e.text) for e in new.of("text")]


@pytest.mark.slow
def test_a_study(tmp_path: Path) -> None:
    study = excite.study_over_time("irp6", designs=[design("old")], points=10, repeats=2, rate=100.0)
    study.save(tmp_path / "s")
    stored = load_time_study(tmp_path / "s" / "study.json")
    (known,), (made,) = stored.courses, study.courses
    np.testing.assert_array_equal(known.time_below(0.05), made.time_below(0.05))
    seen = np.isfinite(made.half_width)
    np.testing.assert_array_equal(known.half_width[seen], made.half_width[seen])
    np.testing.assert_array_equal(known.scatter, made.scatter)
    np.testing.assert_allclose(known.repeated, made.repeated, rtol=1e-6)
    parsed = ParsedPage(report_text(tmp_path / "s"))
    assert [row[0] for row in parsed.numbers("course")] == made.values[-1].tolist()
    assert len(parsed.of("svg")) == 1


@pytest.mark.slow
def test_repetitions() -> None:
    made = result("old")
    section = section_of(made, "s", Appearance())
    assert "repetitions" not in [table.name for table in section.view.tables]
    row = RepeatedParameter("a", "Nm", 1.0, 1.1, 0.1, 0.2, 0.9)
    repeated = replace(made, repetitions=RepetitionSummary(5, 3, (row,)))
    section = section_of(repeated, "s", Appearance())
    parsed = ParsedPage(page_text([section]))
    assert parsed.numbers("repetitions") == [[1.0, 1.1, 0.1, 0.2, 0.9]]
    said = "5 repetitions in simulation: the 99 % intervals hold the truth in 90.0 % (the worst"
    assert said in section.view.summary[-1]


@pytest.mark.slow
def test_a_campaign_lists_its_designs(tmp_path: Path) -> None:
    campaign = excite.plan_campaign("irp6")
    model = excite.ModelChoice(model=campaign.model, drives=campaign.steps[0].drives)
    search, motion = excite.Search(starts=1, executor="serial"), excite.TrajectoryChoice(harmonics=2, period=2.0)
    made = excite.design_trajectory(excite.Task("irp6", model=model, trajectory=motion, search=search))
    other = design("old")
    section = section_of(campaign, "s", Appearance(), [made, other])
    assert section.view.verdict.endswith(" 1 of them is designed here.")
    assert ParsedPage(page_text([section])).numbers("motions-designed")[0][:2] == [1.0, made.condition_number]
    (tmp_path / "plan.json").write_text(json.dumps(asdict(campaign)))
    kinds = [
        e.attributes["data-kind"] for e in ParsedPage(report_text([tmp_path / "plan.json", made, other])).of("article")
    ]
    assert kinds == ["campaign", "design", "design"]  # one of another kind is nothing to compare


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("plan.json", {"trajectories": [{}]}, r"not a complete friction plan: trajectories\[0\]: .* is missing"),
        ("plan.json", {"trajectories": []}, "not a complete friction plan"),
        ("fit.json", {"drives": [{"name": "z9"}]}, "not a complete friction fit"),
        ("study.json", {"courses": [{}]}, "not a complete study"),
    ],
)
def test_entries_that_are_missing_are_named(
    name: str, change: dict[str, object], message: str, planned: Path, tmp_path: Path
) -> None:
    contents = {
        "plan.json": json.loads((planned / "plan.json").read_text()),
        "fit.json": {
            "schema": "excite.friction-fit/1",
            "logs": [],
            "settings": {},
            "subtracted": None,
            "provenance": {},
        },
        "study.json": {"schema": "excite.study/1", "robot": {"name": "a", "sha256": ""}, "below": 0.05},
    }
    write_friction(FrictionCurves({"z1": CoulombViscous(1.0, 1.0, 0.0)}), tmp_path / "friction.yaml")
    (tmp_path / name).write_text(json.dumps({**contents[name], **change}))
    with pytest.raises(InputError, match=message):
        report_text(tmp_path)
