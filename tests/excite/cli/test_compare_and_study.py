"""``excite compare`` and ``excite study``: tables, JSON, files, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from commands import Here, files_below

from excite.design.comparison import compare
from excite.design.design import Design
from excite.design.design_folder import save_design
from excite.design.design_json import load_design
from excite.design.optimisation import design_trajectory
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.task import Task
from excite.views.subjects import load

# ``excite compare``: designs under the same metrics, as a table and as JSON.


BARE_LIMITS = {"acceleration": (3.0,), "torque_margin": None, "self_collision": False, "floor": "none"}
PLAIN = Task("irp6", starts=1, harmonics=3, executor="serial")
TASKS = {
    "plain": PLAIN,
    "quick": PLAIN.changed(period=8.0, rate=50.0, noise=(0.5, 1.0, 2.0)),
    "bare": PLAIN.changed(friction=False, offset=False),
    "two": PLAIN.changed(joints=("1", "3"), noise=(1.0, 3.0)),
    "energy": PLAIN.changed(model="energy"),
    "ur10e": PLAIN.changed(robot="ur10e", joints=("2", "3"), limits=LimitChoice(**BARE_LIMITS)),
}


@pytest.fixture(scope="module")
def designs() -> dict[str, Design]:
    return {name: design_trajectory(task) for name, task in TASKS.items()}


@pytest.fixture(scope="module")
def saved(designs: dict[str, Design], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("saved")
    for name, design in designs.items():
        save_design(design, folder / name)
    return folder


@pytest.fixture
def comparing(saved: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    return Here(saved, monkeypatch, capfd)


def compared(comparing: Here, *arguments: str) -> list[dict[str, object]]:
    return json.loads(comparing.run("compare", *arguments, "--json", status=0, stderr="").stdout)


def cells(shown: str) -> dict[str, list[str]]:
    """Rows of a table by their first cell."""
    rows = [[cell.strip() for cell in line.strip("│┃ \n").split("│")] for line in shown.splitlines() if "│" in line]
    return {row[0]: row[1:] for row in rows}


@pytest.mark.slow
def test_a_design_is_judged_as_it_judged_itself(designs: dict[str, Design], comparing: Here) -> None:
    for name in ("plain", "bare", "energy", "ur10e", "two"):
        (found,) = compared(comparing, name)
        design = designs[name]
        assert found["criteria"] == pytest.approx(design.criteria, rel=1e-6)
        stated = [found[what] for what in ("name", "robot", "parameters", "duration", "feasible", "cpu_seconds")]
        assert stated == [name, design.robot.name, design.base.rank, 10.0, True, design.provenance["cpu_seconds"]]


@pytest.mark.slow
def test_table_shows_what_json_tells(comparing: Here) -> None:
    ended = comparing.run("compare", "-v", "plain", "quick", status=0, stderr="")
    table, found = cells(ended.stdout), compared(comparing, "plain", "quick")
    assert table["robot"] == ["irp6", "irp6"]
    assert table["moving"] == ["3: q1, q2, q3"] * 2
    assert table["base parameters"] == ["13", "13"]
    assert table["limits that were checked"] == ["hold", "hold"]
    assert table["not checked when designed"] == ["jerk, obstacles"] * 2
    for row, name in (
        ("condition number", "condition_number"),
        ("condition number column normalised", "condition_number_column_normalised"),
        ("condition number noise weighted", "condition_number_noise_weighted"),
        ("smallest singular value", "smallest_singular_value"),
        ("log det", "log_det"),
    ):
        values = [one["criteria"][name] for one in found]  # type: ignore[index]
        assert [cell.removesuffix(" *") for cell in table[row]] == [f"{value:.6g}" for value in values]
        best = np.argmax(values) if name in ("smallest_singular_value", "log_det") else np.argmin(values)
        assert [cell.endswith("*") for cell in table[row]] == [k == best for k in range(2)]
    for k, one in enumerate(found):
        assert table["tightest limit"][k] == one["tightest"]["label"]  # type: ignore[index]
    assert "not comparable" not in ended.stdout
    assert "best of each row" in ended.stdout
    alone = comparing.run("compare", "-v", "plain/design.json").stdout
    assert "*" not in alone
    assert "comparable" not in alone
    for wrong, message in (("plain/starts", "no plain/starts/design.json"), ("plain/trajectory.csv", "no design: ")):
        assert message in comparing.refused("compare", "plain", wrong)


@pytest.mark.slow
def test_all_are_judged_under_the_terms_of_the_first(designs: dict[str, Design], comparing: Here) -> None:
    with_friction = compared(comparing, "plain", "bare")
    without = compared(comparing, "bare", "plain")
    assert [one["parameters"] for one in with_friction] == [13, 13]
    assert [one["parameters"] for one in without] == [7, 7]
    assert without[0]["criteria"] == pytest.approx(designs["bare"].criteria, rel=1e-6)
    louder, plain = compared(comparing, "quick", "plain"), compared(comparing, "plain", "quick")
    name = "condition_number_noise_weighted"
    assert plain[0]["criteria"][name] == pytest.approx(plain[0]["criteria"]["condition_number"])  # type: ignore[index]
    assert louder[1]["criteria"][name] != pytest.approx(plain[0]["criteria"][name], rel=1e-3)  # type: ignore[index]
    # At one rate, whatever each was written at: the same motion written at another one is judged the same.
    slower, log_det = load_design(comparing.cwd / "quick"), louder[0]["criteria"]["log_det"]
    assert compare([slower])[0].criteria["log_det"] == pytest.approx(log_det)
    assert abs(log_det - designs["quick"].criteria["log_det"]) > 1.0


@pytest.mark.parametrize("other", ["ur10e", "two", "energy"])
def test_what_is_not_comparable_is_said(other: str, comparing: Here) -> None:
    shown = comparing.run("compare", "-v", "plain", other, status=0, stderr="").stdout
    different = "the designs are for different robots, models or moving joints"
    assert shown.startswith(f"{different}; their numbers are not comparable")
    assert "*" not in shown


def test_another_model_may_judge(designs: dict[str, Design], comparing: Here) -> None:
    both = compared(comparing, "plain", "energy", "--model", "differential")
    assert [one["model"] for one in both] == ["differential", "differential"]
    assert both[0]["criteria"] == pytest.approx(designs["plain"].criteria, rel=1e-6)
    assert "not comparable" not in comparing.run("compare", "-v", "plain", "energy", "--model", "differential").stdout


# ``excite study``: its files, its table, and what it refuses.


def test_motions_side_by_side(recorded: Here) -> None:
    given = ("irp6", "run.csv", "--design", "design", "--rate", "100", "--repeats", "2", "--points", "20")
    ended = recorded.run("study", *given, "--below", "10", "-v", "--out", "study", status=0)
    for text in ("all below 10 % [s]", "run.csv", "2 repetitions scatter by", "written to study:"):
        assert text in ended.stdout
    files = {"study.json", "study_curves.npz", "manifest.json", "estimates_over_time.png"}
    assert files_below(recorded.cwd / "study") == files
    study = json.loads((recorded.cwd / "study" / "study.json").read_text(encoding="utf-8"))
    assert study["schema"] == "excite.study/2"
    assert [course["name"] for course in study["courses"]] == ["design", "run.csv"]
    assert [len(course.time) for course in load(recorded.cwd / "study" / "study.json").courses] == [20, 20]
    assert "--force" in recorded.run("study", *given, "--out", "study", status=2).stderr


BAD = {
    "": "a study needs logs, or designs that it simulates (--design",
    "run.csv --repeats 30": "repetitions are simulated from designs (--design",
    "run.csv --workers 2": "--workers is for repetitions: give their number, --repeats N",
    "--design design --repeats 2 --executor dask:nowhere": "is not one of process, serial, dask://HOST:PORT",
}


def test_what_is_refused(recorded: Here) -> None:
    for arguments, said in BAD.items():
        assert said in recorded.refused("study", "irp6", *arguments.split(), "--out", "study")
