"""``excite study``: its files, its table, and what it refuses."""

from __future__ import annotations

import json

import pytest
from commands import Here, files_below

from excite.study.time_study import load_time_study


def test_motions_side_by_side(recorded: Here) -> None:
    given = ("irp6", "run.csv", "--design", "design", "--rate", "100", "--repeats", "2", "--points", "20")
    ended = recorded.run("study", *given, "--below", "10", "-v", "--out", "study")
    assert ended.returncode == 0
    for text in ("all below 10 % [s]", "run.csv", "2 repetitions scatter by", "written:"):
        assert text in ended.stdout
    assert files_below(recorded.cwd / "study") == {
        "study.json",
        "study_curves.npz",
        "manifest.json",
        "estimates_over_time.png",
    }
    study = json.loads((recorded.cwd / "study" / "study.json").read_text(encoding="utf-8"))
    assert study["schema"] == "excite.study/2"
    assert [course["name"] for course in study["courses"]] == ["design", "run.csv"]
    assert [len(course.time) for course in load_time_study(recorded.cwd / "study" / "study.json").courses] == [20, 20]
    refused = recorded.run("study", *given, "--out", "study")
    assert (refused.returncode, "--force" in refused.stderr) == (2, True)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "a study needs logs, or designs that it simulates (--design"),
        (("run.csv", "--repeats", "30"), "repetitions are simulated from designs (--design"),
        (("run.csv", "--points", "1"), "points must be 2 or more"),
        (("nowrecorded.csv",), "nowrecorded.csv"),
        (("run.csv", "--workers", "2"), "--workers is for repetitions: give their number, --repeats N"),
        (
            ("--design", "design", "--repeats", "2", "--executor", "dask:nowhere"),
            "'dask:nowhere' is not one of process, serial, dask://HOST:PORT",
        ),
    ],
)
def test_what_is_refused(recorded: Here, arguments: tuple[str, ...], said: str) -> None:
    assert said in recorded.refused("study", "irp6", *arguments, "--out", "study")
