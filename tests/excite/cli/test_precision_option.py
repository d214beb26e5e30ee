"""``excite design --precision``: exit status, files, and values that are refused."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from commands import Here, content_of

import excite
from excite.cli.plan_run import plan_next_motion
from excite.study import period_search as period_search
from excite.study.next_motion import NextMotion, PrecisionInHand

FEW = ("--joints", "1,2", "--starts", "1", "--executor", "serial", "--figures", "none")
ALLOWED = {"X1": 1.0, **dict.fromkeys(("F1c", "F2c", "F3c", "F1v"), np.inf)}


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search of next to nothing."""
    monkeypatch.setattr(period_search, "_ROUNDS", 0)
    monkeypatch.setattr(period_search, "_SHORTER", 0)
    monkeypatch.setattr(period_search, "_BETWEEN", 0)


@pytest.mark.usefixtures("quick")
def test_the_shortest_experiment_and_its_files(here: Here) -> None:
    ended = here.run("design", "irp6", "--precision", "200%", *FEW, "--out", "d")
    assert ended.returncode == 0, ended.stderr
    folder = here.cwd / "d"
    stated, whole = content_of(folder)["precision"], json.loads((folder / "precision.json").read_text())
    assert f"{stated['robot_seconds']:.4g} s of robot time; worst parameter" in ended.stdout
    assert stated["met"] is True
    assert {name: whole[name] for name in stated} == stated
    assert whole["asked"]["share"] == 2.0
    assert all(p["half_width"] <= p["allowed"] for p in stated["parameters"])
    with (folder / "precision.csv").open() as stream:
        front = list(csv.DictReader(stream))
    assert [float(row["largest_use"]) for row in front] == [point["use"] for point in whole["front"]]
    assert content_of(folder)["task"]["precision"]["share"] == 2.0
    again = here.run("design", "irp6", "--precision", "200%", *FEW, "--out", "d")
    assert again.returncode == 2
    assert "--force" in again.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_out_of_reach_is_saved_with_exit_status_1(here: Here) -> None:
    (here.cwd / "p.yaml").write_text("groups: {inertia: 0.0001}\nshare: null\n")
    ended = here.run("design", "irp6", "--precision", "p.yaml", "--max-time", "8", *FEW, "--out", "d")
    assert ended.returncode == 1, ended.stderr
    stated = content_of(here.cwd / "d")["precision"]
    assert stated["met"] is False
    assert stated["robot_seconds"] <= 8.0
    assert all((p["allowed"] is None) == p["name"].startswith("F") for p in stated["parameters"] if p["unit"] != "kg m")
    assert "out of reach within 8 s" in ended.stdout
    assert "times the allowed half-width" in ended.stdout
    assert "what helps most is" in ended.stdout


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("-5%", "precision"),
        ("0%", "precision"),
        ("five", "cannot read five"),
        ("5 percent", "cannot read"),
        ("nan", "precision"),
    ],
)
def test_values_that_are_refused(here: Here, given: str, message: str) -> None:
    ended = here.run("design", "irp6", f"--precision={given}", "--out", "d")
    assert ended.returncode == 2
    assert message in ended.stderr
    assert not (here.cwd / "d").exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("shares: 0.1\n", "shares"),
        ("groups: {frictions: 0.1}\n", "frictions"),
        ("share: 5\nlevel: 99\n", "level"),
        ("parameters: {X99: 0.1}\n", "X99"),
        ("- 1\n", "p.yaml"),
        ("share: [\n", "p.yaml"),
    ],
)
def test_files_that_are_refused(here: Here, tmp_path: Path, content: str, message: str) -> None:
    (here.cwd / "p.yaml").write_text(content)
    ended = here.run("design", "irp6", "--precision", "p.yaml", "--executor", "serial", "--out", "d")
    assert ended.returncode == 2
    assert message in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("precision", "said"), [("5%", True), (excite.PrecisionTarget(None, parameters={"X1": 0.1}), False)]
)
def test_parameters_of_which_nothing_is_asked_are_named(
    precision: object, said: bool, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that a share of every parameter leaves out, not those that the user leaves out."""
    rows = [PrecisionInHand(name, name, "Nm", 1.0, allowed, 0.1, 0.1) for name, allowed in ALLOWED.items()]
    task = excite.Task("irp6", precision=precision)
    monkeypatch.setattr(excite, "next_motion", lambda *_, **__: NextMotion("irp6", tuple(rows), None, (), task))
    assert plan_next_motion(task, "measured", None, force=False) == 0
    printed = " ".join(capfd.readouterr().out.split())
    assert "Enough: stop. All 1 parameters" in printed
    assert ("nothing is asked of F1c, F2c, F3c and 1 more: their size is not described" in printed) == said
