"""``excite identify --choose``: what is chosen, said and written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from commands import Here
from played import link_files, noisy, played, three_joints

from excite.cli import repetition_run
from excite.logs.log_reading import write_log
from excite.views import figures


@pytest.fixture(scope="module")
def files(recorded_files: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    link_files(recorded_files, folder)
    write_log(noisy(played(three_joints(), 3, seconds=8.0), 0.2, 1e-6, 3), folder / "long.csv")
    return folder


@pytest.fixture
def here(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    link_files(files, tmp_path)
    monkeypatch.setattr(figures, "write_figures", lambda *_, **__: [])
    return Here(tmp_path, monkeypatch, capfd)


def chosen(here: Here, log: str, *arguments: str) -> tuple[list[dict[str, Any]], str]:
    """Choices as written, and what is printed."""
    ended = here.run("identify", "irp6", log, "-v", *arguments, "--out", "out", "--force")
    assert ended.returncode == 0
    content = json.loads((here.cwd / "out" / "result.json").read_text())
    return content["choices"], ended.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ("--choose none", []),
        ("--choose cutoff,delay", ["cutoff", "delay", "presliding"]),
        pytest.param("--choose load-share", ["terms", "presliding"], marks=pytest.mark.slow),
        ("--choose cutoff,delay --cutoff 10", ["delay", "presliding"]),
        ("--choose delay --sign-width 0.1", ["delay"]),
        ("--choose cutoff,signals --signals spline --sign-width 0", []),
        ("--choose delay,estimator --delay 0.001 --sign-width 0 --estimator huber", []),
        (
            "--design design --choose all --estimator weighted",
            ["cutoff", "signals", "delay", "presliding", "standstill"],
        ),
    ],
)
def test_what_is_named_is_chosen_and_what_is_given_is_kept(here: Here, arguments: str, names: list[str]) -> None:
    choices, printed = chosen(here, "run.csv" if "--design" in arguments else "long.csv", *arguments.split())
    assert [choice["name"] for choice in choices] == names
    lines = [line.removeprefix("note: ") for line in printed.splitlines()]
    said = [line for line in lines if line.startswith("chosen: ")]
    assert said == [f"chosen: {choice['reason']}" for choice in choices]
    assert all(choice["candidates"] for choice in choices)


@pytest.mark.slow
def test_all_is_the_default(here: Here) -> None:
    choices, printed = chosen(here, "long.csv")
    assert [choice["name"] for choice in choices] == [
        "cutoff",
        "signals",
        "terms",
        "delay",
        "presliding",
        "standstill",
        "estimator",
    ]
    for text in ("positions are low-passed at", "recorded at the same time", "bodies are physically possible"):
        assert f" {text}" in printed


def test_with_repetitions_the_estimator_is_one_that_can_be_repeated(
    here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(repetition_run, "repeat_and_write", lambda result, *_, **__: (result, 0))
    choices, _ = chosen(here, "run.csv", "--repeat", "9", "--choose", "delay,estimator")
    assert [choice["name"] for choice in choices] == ["delay", "presliding"]
    assert json.loads((here.cwd / "out" / "result.json").read_text())["estimator"] == "weighted"


@pytest.mark.parametrize("names", ["speed", "cutoff,speed", "", "cutoff,", "all,cutoff"])
def test_other_names_are_refused(here: Here, names: str) -> None:
    said = here.refused("identify", "irp6", "run.csv", "--choose", names, "--out", "out")
    assert "'--choose': expected all, none, or some of cutoff, signals, delay, " in said
