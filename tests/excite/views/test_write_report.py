"""Pages: every number of the files, every name escaped, nothing from elsewhere, and whole or not at all."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
import re
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported import HOSTILE, ParsedPage, reported_design
from written_files import saved
from written_results import design, plan, result, verification

import excite
from excite.cli.identify_commands import identify
from excite.design.task_file import read_task_file, task_content, task_from_options
from excite.identification.result import RepeatedParameter, RepetitionSummary
from excite.information.matrix import CONVENTIONS
from excite.tasks.friction_file import write_friction
from excite.views.identification_view import side_by_side_view
from excite.views.page_text import PageSection, page_text
from excite.views.player_log import Appearance
from excite.views.sections import commands_of, comparison_section, section_of
from excite.views.write_report import report_text
from regressors.errors import InputError
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves

# Pages: every number of the files, every name escaped, nothing from elsewhere, and whole or not at all.


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("designs") / 'a "b" <i>c', reported_design())


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return report_text(folder)


@pytest.fixture(scope="module")
def parsed(page: str) -> ParsedPage:
    return ParsedPage(page)


@pytest.fixture(scope="module")
def content(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "design.json").read_text())


def test_numbers_are_those_of_the_file(parsed: ParsedPage, content: dict[str, Any]) -> None:
    def same(shown: list[list[float]], stated: list[list[float]]) -> None:
        np.testing.assert_allclose(np.array(shown, dtype=float), np.array(stated, dtype=float), rtol=1e-8, atol=1e-9)

    same(parsed.numbers("criteria"), [[value] for value in content["criteria"].values()])
    same(parsed.numbers("predicted"), [[p["standard_deviation"]] for p in content["predicted"]["parameters"]])
    for name, limits in (("limits", content["limits"]), ("limits-return", content["played"]["return"]["limits"])):
        shown = np.abs([[row[0], row[1], row[-3], row[-1]] for row in parsed.numbers(name)])
        of_file = [[u[key] for key in ("extreme", "bound", "margin", "holds")] for u in limits]
        ordered = [each[np.lexsort(each.T)] for each in (shown, np.abs(np.array(of_file, dtype=float)))]
        same(ordered[0].tolist(), ordered[1].tolist())


def test_what_was_asked_assumed_and_not_checked_is_said(parsed: ParsedPage, content: dict[str, Any]) -> None:
    text = "".join(parsed.of("main")[0].text)
    assert "not checked: jerk (no limit is stated)" in text
    assert all(f"not checked: {each['limit']} ({each['reason']})" in text for each in content["unchecked"])
    assert content["unchecked"]
    shown = ["".join(each.text) for each in parsed.of("dt")]
    assert {"robot", "harmonics", "period", "home", "world", "seed", "robot sha256"} <= set(shown)


def test_names_are_text(page: str, parsed: ParsedPage) -> None:
    assert len(parsed.of("script")) == 3  # data, sorting, player
    assert "document.title='run'</script>" not in page
    assert any("".join(each.text) == f"forearm to {HOSTILE}" for each in parsed.of("th"))
    assert not parsed.of("i")
    assert any('a "b" <i>c; report of' in "".join(each.text) for each in parsed.of("p"))


def test_nothing_comes_from_elsewhere_and_nothing_else_may_run(parsed: ParsedPage) -> None:
    for element in parsed.elements:
        for name, value in element.attributes.items():
            assert not name.startswith("on"), element
            assert name != "style"
            if name in ("href", "src", "xlink:href", "action"):
                assert str(value).startswith(("#", "data:")), element
    policy = next(each for each in parsed.of("meta") if "http-equiv" in each.attributes).attributes["content"]
    assert str(policy).startswith("default-src 'none'; script-src 'sha256-")
    for tag in ("script", "style"):
        for each in parsed.of(tag):
            if "type" not in each.attributes:
                digest = base64.b64encode(hashlib.sha256("".join(each.text).encode()).digest()).decode()
                assert f"'sha256-{digest}'" in str(policy)


def test_identifiers_are_used_once_and_references_lead_to_them(page: str, parsed: ParsedPage) -> None:
    known = [each.attributes["id"] for each in parsed.elements if "id" in each.attributes]
    assert len(known) == len(set(known)) > 100
    references = re.findall(r'(?:href="#|url\(#)([^")]+)', page)
    assert set(references) <= set(known)
    assert len(references) > 100


def test_task_file_is_the_same_task(parsed: ParsedPage, content: dict[str, Any], tmp_path: Path) -> None:
    (text,) = ("".join(each.text) for each in parsed.of("code") if each.attributes.get("class") == "task")
    (tmp_path / "task.yaml").write_text(text)
    again = task_from_options({"robot": "irp6", **read_task_file(tmp_path / "task.yaml")})
    assert json.loads(json.dumps(task_content(again))) == content["task"]


def test_identification_and_verification(tmp_path: Path) -> None:
    target = saved(tmp_path / "result", result("old"))
    verification("old").save(target, name="verification-run")
    parsed = ParsedPage(report_text([target, target / "verification-run.json"]))  # which is shown once
    content = json.loads((target / "result.json").read_text())
    verified = json.loads((target / "verification-run.json").read_text())
    columns = ("standard_deviation", "relative_deviation", "reference")
    rows = [[p["value"], *p["interval"], *(p[name] for name in columns)] for p in content["parameters"]]
    assert parsed.numbers("parameters") == rows
    expected = [[t[key] for key in ("measured", "error", "relative")] for t in verified["torques"]]
    assert [row[:3] for row in parsed.numbers("torques")] == expected
    text = "".join(parsed.of("main")[0].text)
    assert verified["verdict"] in text
    assert all(note in text for note in content["notes"])
    assert len(parsed.of("svg")) == 5  # three of one, two of the other
    assert not parsed.of("img")
    assert len(parsed.of("canvas")) == 0
    assert sum("data-motion" in each.attributes for each in parsed.elements) == 2


def test_several_results_are_compared(folder: Path) -> None:
    designs = [excite.load_design(folder)] * 2
    sections = [comparison_section(designs), PageSection(side_by_side_view([result("old"), result("new")]))]
    parsed = ParsedPage(page_text(sections))
    criteria = [judgement.criteria for judgement in excite.compare(designs)]
    assert parsed.numbers("comparison") == [[each[name] for each in criteria] for name in CONVENTIONS]
    values = np.array(parsed.numbers("side-by-side"))
    np.testing.assert_allclose(values[:, 0], result("old").estimate.values, rtol=1e-12)
    np.testing.assert_allclose(values[:, 3], result("new").estimate.half_width, rtol=1e-12)


def test_page_is_replaced_when_asked_and_only_by_a_whole_one(tmp_path: Path, folder: Path) -> None:
    page = tmp_path / "new" / "page.html"
    (tmp_path / "plan.json").write_text(json.dumps(asdict(excite.plan_campaign("irp6"))))
    assert excite.write_report(tmp_path / "plan.json", page) == page
    before = page.read_bytes()
    with pytest.raises(InputError, match="already there"):
        excite.write_report(tmp_path / "plan.json", page)
    with pytest.raises(InputError, match="holds neither"):
        excite.write_report(tmp_path, page, replace=True)
    assert page.read_bytes() == before
    (tmp_path / "plan.json").write_text(json.dumps(asdict(excite.plan_campaign("irp6", 3))))
    excite.write_report(tmp_path / "plan.json", page, replace=True)
    assert page.read_bytes() != before
    assert sorted(path.name for path in page.parent.iterdir()) == ["page.html"]


def test_bad_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.json").write_text('{"schema": "excite.other/1"}')
    (tmp_path / "plan.json").write_text('{"steps": [{"drives": "z1"}], "subsets": []}')
    for given, message in (
        ([], "none is given"),
        ([3], "an object of type int"),
        (["missing"], "there is no folder missing"),
        (["missing.json"], "missing.json"),
        (["other.json"], "expected a design, an identification, a verification, a friction plan"),
        (["plan.json"], "plan.json: not a complete campaign"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            excite.write_report(given, "page.html")
        assert not (tmp_path / "page.html").exists()
    with pytest.raises(InputError, match=r"ends in \.html"):
        excite.write_report(tmp_path, tmp_path / "page.pdf")


def test_commands_repeat_an_identification(tmp_path: Path) -> None:
    made = result("old")
    facts = dataclasses.replace(made.facts, logs=(dataclasses.replace(made.facts.logs[0], file="run.csv"),))
    recipe = dataclasses.replace(made.recipe, cutoff=12.5, estimator="least-squares")
    made = dataclasses.replace(made, kept=facts, recipe=recipe)
    (_, name, *words), _ = commands_of(dataclasses.replace(made, folder=Path("results/irp6")))
    (tmp_path / "run.csv").touch()
    given = identify.make_context(name, words).params
    assert (given["robot"], given["logs"], given["cutoff"]) == ("irp6", (Path("run.csv"),), 12.5)
    assert given["estimator"] == "least-squares"
    assert np.ravel(given["sign_width"]) == [made.recipe.sign_width]
    assert given["out"] == Path("results/irp6-again")


@pytest.mark.parametrize("entry", ["predicted", "played", "base", "conventions", "criteria"])
@pytest.mark.slow
def test_entries_that_are_missing_are_named(entry: str, folder: Path, tmp_path: Path) -> None:
    content = json.loads((folder / "design.json").read_text())
    del content[entry]
    (tmp_path / "older.json").write_text(json.dumps(content))
    if entry == "conventions":  # of an older version
        assert "Gautier 1991" in report_text(tmp_path / "older.json")
        return
    with pytest.raises(InputError, match=rf"not a complete design: .*'{entry}(\.\w+)?'.* is missing"):
        report_text(tmp_path / "older.json")


# Sections of friction plans, fits of friction curves, studies, repetitions, and campaigns with their designs.


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("plans") / "plan", plan("old"))


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
    assert "not checked: obstacles" in verdict
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
    (coordinate,) = plan("old").coordinates
    runs, _ = coordinate.samples()
    scripts = [each for each in ParsedPage(report_text(planned)).of("script") if "id" in each.attributes]
    motion = json.loads("".join(scripts[0].text))
    played = np.column_stack([np.interp(motion["time"], runs.time - runs.time[0], column) for column in runs.q.T])
    np.testing.assert_allclose(motion["q"], played, atol=1e-8)


@pytest.mark.slow
def test_a_fit_of_friction_curves(fit: excite.FrictionFit, tmp_path: Path) -> None:
    fit.save(tmp_path / "fit")
    (known,), (made,) = excite.load(tmp_path / "fit" / "fit.json").characteristics, fit.characteristics
    assert (known.fit.form, known.points, known.stiction) == (made.fit.form, made.points, made.stiction)
    v = np.linspace(-1.0, 1.0, 7)
    np.testing.assert_array_equal(known.fit.band(v), made.fit.band(v))
    assert [other.form for other in known.others] == [other.form for other in made.others]
    each = zip(made.fit.form.parameters, made.fit.values, made.fit.halfwidth, strict=True)
    shown = [[x, x - h, x + h][: 1 if name in made.fit.held else 3] for name, x, h in each]
    parsed, new = (ParsedPage(report_text(each)) for each in (tmp_path / "fit", fit))
    for page in (parsed, new):
        np.testing.assert_allclose(np.concatenate(page.numbers("friction")), np.concatenate(shown), rtol=1e-9)
    assert ["".join(e.text) for e in parsed.of("text")] == ["".join(e.text) for e in new.of("text")]


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
    page = ParsedPage(report_text([tmp_path / "plan.json", made, other]))
    kinds = [each.attributes["data-kind"] for each in page.of("article")]
    assert kinds == ["campaign", "design", "design"]  # one of another kind is nothing to compare


def test_missing_entries_of_plans_fits_and_studies_are_named(planned: Path, tmp_path: Path) -> None:
    stored = json.loads((planned / "plan.json").read_text())
    fit = {"schema": "excite.friction-fit/1", "logs": [], "settings": {}, "subtracted": None, "provenance": {}}
    study = {"schema": "excite.study/1", "robot": {"name": "a", "sha256": ""}, "below": 0.05}
    write_friction(FrictionCurves({"z1": CoulombViscous(1.0, 1.0, 0.0)}), tmp_path / "friction.yaml")
    for name, content, message in (
        ("plan.json", {**stored, "trajectories": [{}]}, r"friction plan: trajectories\[0\]: .* is missing"),
        ("plan.json", {**stored, "trajectories": []}, "not a complete friction plan"),
        ("fit.json", {**fit, "drives": [{"name": "z9"}]}, "not a complete friction fit"),
        ("study.json", {**study, "courses": [{}]}, "not a complete study"),
    ):
        (tmp_path / name).write_text(json.dumps(content))
        with pytest.raises(InputError, match=message):
            report_text(tmp_path)
        (tmp_path / name).unlink()
