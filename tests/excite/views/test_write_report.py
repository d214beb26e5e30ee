"""Pages: every number of the files, every name escaped, nothing from elsewhere, and whole or not at all."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported import HOSTILE, ParsedPage, reported_design, saved
from written_results import result, verification

import excite
from excite.design.task_file import read_task_file, task_content, task_from_options
from excite.information.matrix import CONVENTIONS
from excite.views.page_text import page_text
from excite.views.sections import commands_of, comparison_section, parameters_section
from excite.views.write_report import report_text
from regressors.errors import InputError


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
    read: dict[str, Any] = json.loads((folder / "design.json").read_text())
    return read


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


def test_what_was_asked_assumed_and_not_checked_is_said(page: str, content: dict[str, Any]) -> None:
    parsed = ParsedPage(page)
    text = "".join(parsed.of("main")[0].text)
    assert "every limit that was checked is kept; not checked: jerk" in text
    assert all(f"not checked: {each['limit']} ({each['reason']})" in text for each in content["unchecked"])
    assert content["unchecked"]
    shown = ["".join(each.text) for each in parsed.of("dt")]
    assert {"robot", "harmonics", "period", "home", "world", "seed", "robot sha256"} <= set(shown)


def test_names_are_text(page: str, parsed: ParsedPage) -> None:
    assert len(parsed.of("script")) == 3  # data, sorting, player
    assert "document.title='run'</script>" not in page
    assert any("".join(each.text) == f"forearm to {HOSTILE}" for each in parsed.of("th"))
    assert not parsed.of("i")
    assert "".join(parsed.of("h1")[0].text).endswith('a "b" <i>c')


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


def test_a_loaded_design_is_the_design(folder: Path) -> None:
    stored, design = excite.load_design(folder), reported_design()
    samples = (vars(each.sequence.sampled()[0]).values() for each in (stored, design))
    for new, old in zip(*samples, strict=True):
        np.testing.assert_allclose(new, old, rtol=0, atol=1e-9 * max(1.0, float(np.abs(old).max())))
    assert stored.transfer_limits.keys() == design.transfer_limits.keys()
    both = zip(*([each.limits, *each.transfer_limits.values()] for each in (stored, design)), strict=True)
    for new, old in ((n, o) for some in both for n, o in zip(*some, strict=True)):
        assert abs(new.extreme) == pytest.approx(abs(old.extreme), rel=1e-9, abs=1e-9)
        assert (new.label, new.method, new.holds) == (old.label, old.method, old.holds)
    for new, old in zip(stored.predicted, design.predicted, strict=True):
        assert (new.name, new.expression) == (old.name, old.expression)
        assert new.standard_deviation == pytest.approx(old.standard_deviation, rel=1e-9)
    assert stored.rows == design.rows
    assert [limit.labels for limit in stored.nonlinear] == [limit.labels for limit in design.nonlinear]


def test_identification_and_verification(tmp_path: Path) -> None:
    target = saved(tmp_path / "result", result("old"))
    verification("old").save(target, name="verification-run")
    parsed = ParsedPage(report_text(target))
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
    assert len(parsed.of("svg")) == 6  # three of each
    assert not parsed.of("img")
    assert len(parsed.of("canvas")) == 0
    assert sum("data-motion" in each.attributes for each in parsed.elements) == 2


def test_new_identification_is_drawn_whole() -> None:
    parsed = ParsedPage(report_text(result("old")))
    assert len(parsed.of("svg")) == 3


def test_several_results_are_compared(folder: Path) -> None:
    designs = [excite.load_design(folder)] * 2
    sections = [comparison_section(designs), parameters_section([result("old"), result("new")])]
    parsed = ParsedPage(page_text(sections))
    criteria = [judgement.criteria for judgement in excite.compare(designs)]
    assert parsed.numbers("comparison") == [[each[name] for each in criteria] for name in CONVENTIONS]
    values = np.array(parsed.numbers("side-by-side"))
    np.testing.assert_allclose(values[:, 0], result("old").estimate.values, rtol=1e-12)
    np.testing.assert_allclose(values[:, 3], result("new").estimate.half_width, rtol=1e-12)


def test_campaign(tmp_path: Path) -> None:
    campaign = excite.plan_campaign("irp6")
    (tmp_path / "plan.json").write_text(json.dumps(asdict(campaign)))
    parsed = ParsedPage(report_text(tmp_path / "plan.json"))
    assert parsed.numbers("steps") == [[k, step.rank] for k, step in enumerate(campaign.steps, 1)]
    assert parsed.numbers("subsets") == [[rank] for _, rank in campaign.subsets]
    assert not parsed.of("canvas")
    assert len(parsed.of("script")) == 1  # no player without a motion


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


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([], "none is given"),
        ([3], "an object of type int"),
        (["missing"], "there is no folder missing"),
        (["missing.json"], "missing.json"),
        (["other.json"], "expected a design, an identification, a verification, a friction plan"),
        (["plan.json"], "plan.json: not a complete campaign"),
    ],
)
def test_bad_input(given: list[object], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.json").write_text('{"schema": "excite.other/1"}')
    (tmp_path / "plan.json").write_text('{"steps": [{"drives": "z1"}], "subsets": []}')
    with pytest.raises(InputError, match=re.escape(message)):
        excite.write_report(given, "page.html")
    assert not (tmp_path / "page.html").exists()


def test_other_endings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"ends in \.html"):
        excite.write_report(tmp_path, tmp_path / "page.pdf")


def test_edited_results_are_refused(tmp_path: Path) -> None:
    target = saved(tmp_path / "design", reported_design())
    text = (target / "design.json").read_text()
    (target / "design.json").write_text(text.replace('"feasible": true', '"feasible": false'))
    with pytest.raises(InputError, match="has been changed"):
        report_text(target)


def test_commands_repeat_an_identification(tmp_path: Path) -> None:
    from excite.cli.identify_command import command

    made = result("old")
    facts = dataclasses.replace(made.facts, logs=(dataclasses.replace(made.facts.logs[0], file="run.csv"),))
    recipe = dataclasses.replace(made.recipe, cutoff=12.5, estimator="least-squares")
    made = dataclasses.replace(made, kept=facts, recipe=recipe)
    (_, name, *words), _ = commands_of(dataclasses.replace(made, folder=Path("results/irp6")))
    (tmp_path / "run.csv").touch()
    given = command.make_context(name, words).params
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
