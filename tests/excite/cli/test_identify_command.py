"""``excite identify``: what it writes and says, and what it refuses without leaving anything behind."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Here, files_below
from played import LOAD
from recordings import write_sidecar

from excite.cli import identify_run
from excite.errors import LostWorkersError
from excite.identification.result_json import load_result
from excite.storage.manifest import read_manifest
from excite.views import figures
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in

DRAW = figures.write_figures
COMPLETE = {"result.json", "curves.npz", "manifest.json", "torques.png", "residuals.png", "parameters.png"}


@pytest.fixture
def here(recorded: Here, monkeypatch: pytest.MonkeyPatch) -> Here:
    monkeypatch.setattr(figures, "write_figures", lambda *_, **__: [])
    return recorded


@pytest.fixture
def drawing(here: Here, monkeypatch: pytest.MonkeyPatch) -> Here:
    """The same, with figures."""
    monkeypatch.setattr(figures, "write_figures", DRAW)
    return here


def done(here: Here, *arguments: str, out: str = "out", status: int = 0) -> dict[str, Any]:
    """``result.json`` of ``excite identify irp6 ...``."""
    ended = here.run("identify", "irp6", *arguments, "--out", out)
    assert (ended.returncode, ended.stderr) == (status, "")
    content = json.loads((here.cwd / out / "result.json").read_text())
    return content


def values(content: dict[str, Any]) -> dict[str, float]:
    return {p["name"]: p["value"] for p in content["parameters"]}


# ---------------------------------------------------------------- what is written and said


@pytest.mark.slow
def test_a_result_holds_what_it_rests_on(drawing: Here) -> None:
    here = drawing
    ended = here.run("identify", "irp6", "run.csv", "again.csv", "--design", "design", "-v", "--out", "results/irp6")
    assert (ended.returncode, ended.stderr) == (0, "")
    folder = here.cwd / "results" / "irp6"
    assert files_below(folder) == COMPLETE
    content = json.loads((folder / "result.json").read_text())
    assert content["schema"] == "excite.result/2"
    assert content["robot"]["sha256"] == built_in("irp6").sha256()
    for log, name in zip(content["logs"], ("run.csv", "again.csv"), strict=True):
        assert (log["file"], log["sha256"]) == (name, sha256((here.cwd / name).read_bytes()).hexdigest())
    design = (here.cwd / "design" / "design.json").read_bytes()
    assert content["design"]["sha256"] == sha256(design).hexdigest()
    designed = json.loads(design)["criteria"]["condition_number"]
    assert content["condition_number"]["designed"] == pytest.approx(designed, rel=1e-12)  # of the coefficients
    assert content["condition_number"]["measured"] == pytest.approx(designed, rel=0.1)
    assert content["provenance"]["versions"]["numpy"] == np.__version__
    assert (content["provenance"]["mapping"], content["provenance"]["drop"]) == (None, [])
    assert values(content)["F1c"] == pytest.approx(28.0, rel=0.05)
    for text in (
        "differential model, ",
        "of 2 logs; estimator physical",
        "described",
        "rows 1 to 401 of 401",
        "q4, q5: not in the log, assumed to stand still",
        "written to results/irp6: ",
        "next: excite verify results/irp6 OTHER.csv",
    ):
        assert text in ended.stdout


def test_a_design_gives_the_model_and_typed_options_change_it(here: Here) -> None:
    content = done(here, "run.csv", "--design", "design", "--no-friction", "--signals", "fourier", status=1)
    assert set(values(content)) == {f"X{k}" for k in range(1, 8)}
    assert content["recipe"]["period"] == 4.0
    assert any("periodic motion of 4 s (given)" in note for note in content["logs"][0]["notes"])
    (doubt,) = content["doubts"]  # these drives have friction
    assert "the residual is" in doubt["what"]
    assert "friction of" in doubt["cause"]
    assert doubt["cure"] == "identify it too (`friction=True`)"


def test_simulated_logs_show_the_truth_as_text_and_as_json(here: Here) -> None:
    truth = {**standard_values(built_in("irp6")), "F1c": 27.5}
    write_sidecar(here.cwd / "run.csv", built_in("irp6"), truth=truth)
    assert "truth" in here.run("identify", "irp6", "run.csv", "-v", "--out", "out").stdout
    ended = here.run("identify", "irp6", "run.csv", "--out", "out", "--force", "--json")
    printed, content = json.loads(ended.stdout), json.loads((here.cwd / "out" / "result.json").read_text())
    assert content["reference"] == "truth"
    assert {p["name"]: p["reference"] for p in content["parameters"]}["F1c"] == 27.5
    assert (printed["parameters"], printed["out"]) == (content["parameters"], "out")
    assert "covariance" not in printed


def test_a_load(here: Here) -> None:
    content = done(here, "load.csv", "--model", "load", "--equations", "fx,fy,fz,nx,ny,nz", "--rows", "all")
    assert list(values(content).values()) == pytest.approx(LOAD.tolist(), abs=0.01)
    assert [name for name, _ in content["equations"]] == ["fx", "fy", "fz", "nx", "ny", "nz"]


def test_friction_curves_are_kept_word_by_word(here: Here) -> None:
    content = done(here, "run.csv", "--friction-curves", "friction.yaml", "--no-scale-friction")
    text = (here.cwd / "friction.yaml").read_bytes()
    assert content["friction"] == {"file": "friction.yaml", "sha256": sha256(text).hexdigest(), "text": text.decode()}
    assert set(values(content)) == {f"X{k}" for k in range(1, 8)}
    assert content["prediction_error"] < 0.1
    assert load_result(here.cwd / "out").friction is not None


# ---------------------------------------------------------------- what is refused

BAD = (
    ("run.csv nothing.csv", "cannot read log nothing.csv: No such file or directory"),
    ("run.csv run.csv", "run.csv has the same content as run.csv; give each log once"),
    ("run.csv --rows x", "rows must be auto, all, or FIRST:LAST such as 100:2000; given 'x'"),
    ("run.csv --estimator instrumental", "the estimator instrumental needs the commanded motion: name the --design"),
    ("run.csv --sign-width 0.1 --breakaway 0.1", "give --sign-width or --breakaway, not both"),
    ("run.csv --sign-width wide", "Invalid value for '--sign-width': expected auto or a number; expected numbers"),
    ("run.csv --mapping friction.yaml", "friction.yaml: time (line 1): is missing"),
    ("run.csv --friction-curves run.csv", "run.csv"),
    ("run.csv --friction-curves bad.yaml", "bad.yaml: no drive named 'zz'; available: z1, "),
    ("run.csv --executor serial", "--executor is for repetitions: give their number, --repeat N"),
    ("", "Missing argument 'LOG...'"),
    ("run.csv --out run.csv", "cannot write to run.csv: it is a file, not a folder"),
)


def refused(here: Here, message: str, *arguments: str, out: str = "out") -> None:
    assert message in here.refused("identify", *arguments, *(() if "--out" in arguments else ("--out", out)))


def test_bad_input_is_refused_in_one_line(here: Here) -> None:
    other = "{zz: {model: coulomb-viscous, coulomb: 1, viscous: 2}}"
    (here.cwd / "bad.yaml").write_text(f"schema: excite.friction/1\ndrives: {other}")
    for arguments, message in BAD:
        refused(here, message, "irp6", *arguments.split())


def test_another_robot_is_refused(here: Here) -> None:
    refused(here, "robot panda has none of its joints q1, q2, q3", "panda", "run.csv")
    refused(here, "design is a design for irp6 (description ", "panda", "run.csv", "--design", "design")
    write_sidecar(here.cwd / "run.csv", built_in("panda"))
    refused(here, "run.csv is a log of panda (description ", "irp6", "run.csv")
    (here.cwd / "run.json").write_text("{")
    refused(here, "run.json is not JSON", "irp6", "run.csv")


@pytest.mark.slow
def test_gaps_and_cut_off_recordings_are_refused(here: Here) -> None:
    lines = (here.cwd / "run.csv").read_text().splitlines(keepends=True)
    (here.cwd / "bad.csv").write_text("".join(lines[:200] + lines[320:]))
    refused(here, "bad.csv: gaps of 1.21 s after t = 1.98 s (row 199); split the log at its gaps", "irp6", "bad.csv")
    (here.cwd / "bad.csv").write_text("".join(lines)[:-60])
    refused(here, "ends early: ", "irp6", "bad.csv")
    assert done(here, "bad.csv", "--drop", "truncated")["logs"][0]["rows"] == 400


def test_rows_are_chosen_before_a_log_is_refused_and_events_are_written(here: Here) -> None:
    lines = (here.cwd / "run.csv").read_text().splitlines(keepends=True)
    lines = [*lines[:100], "ERROR 7\n", *lines[100:300], *["lost\n"] * 20, lines[320]]
    (here.cwd / "bad.csv").write_text("".join(lines))
    refused(here, "bad.csv, line 101 has 1 columns, expected", "irp6", "bad.csv")
    (log,) = done(here, "bad.csv", "--rows", "1:300", "--drop", "garbage")["logs"]
    assert "1 line holds no row of numbers: line 101" in log["notes"]
    assert [(event["kind"], event["rows"]) for event in log["events"]] == [("garbage", [100, 100])]
    assert log["left_out_share"] < 0.01


# ---------------------------------------------------------------- Ctrl-C, and repetitions


@pytest.mark.slow
def test_an_interrupt_while_writing_is_too_late(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: Any, **how: Any) -> list[Path]:
        signal.raise_signal(signal.SIGINT)
        return DRAW(*arguments, **how)

    monkeypatch.setattr(figures, "write_figures", interrupted)
    assert done(here, "run.csv")["schema"] == "excite.result/2"
    assert files_below(here.cwd / "out") == COMPLETE


@pytest.mark.slow
def test_repetitions_join_the_result(drawing: Here) -> None:
    here = drawing
    ended = here.run("identify", "irp6", "other.csv", "--rows", "all", "--repeat", "30", "--seed", "3", "--out", "out")
    assert ended.returncode == 0
    assert ended.stderr == "excite: 30 of 30 repetitions\n"
    assert "30 repetitions in simulation: the 99 % intervals hold the truth in " in ended.stdout
    assert "repetitions.png" in read_manifest(here.cwd / "out")["result"].files
    content = json.loads((here.cwd / "out" / "result.json").read_text())
    found = content["repetitions"]
    assert (found["count"], found["seed"]) == (30, 3)
    assert [p["name"] for p in found["parameters"]] == list(values(content))
    assert all(0.3 < p["deviation"] / p["predicted_deviation"] < 3.0 for p in found["parameters"])


def test_lost_workers_of_the_repetitions_keep_the_result(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    where: dict[str, Any] = {}

    def lost(*_: Any, **how: Any) -> None:
        where.update(how)
        raise LostWorkersError("the Dask scheduler went away", "repeat with fewer `workers`")

    monkeypatch.setattr(identify_run, "repeat_experiment", lost)
    given = ("--repeat", "9", "--executor", "dask://10.0.0.1:8786", "--workers", "3")
    ended = here.run("identify", "irp6", "run.csv", *given, "--out", "out")
    said = "excite: the Dask scheduler went away; repeat with fewer --workers; the result in out is saved, without"
    assert (ended.returncode, ended.stderr) == (1, f"{said} repetitions\n")
    assert (where["executor"], where["workers"]) == ("dask://10.0.0.1:8786", 3)
    assert json.loads((here.cwd / "out" / "result.json").read_text())["repetitions"] is None


@pytest.mark.slow
def test_repetitions_that_an_interrupt_keeps_are_not_computed_again(drawing: Here) -> None:
    here, repeat = drawing, identify_run.repeat_experiment

    def interrupted(e: Any, count: int, seed: int, progress: Callable[[int, int], None], **where: Any) -> Any:
        def counted(done: int, of: int) -> None:
            if done == 4:
                signal.raise_signal(signal.SIGINT)
            progress(done, of)

        return repeat(e, count, seed, progress=counted, **where)

    def repetitions(out: str) -> Any:
        return json.loads((here.cwd / out / "result.json").read_text())["repetitions"]

    run = ("identify", "irp6", "run.csv", "--repeat", "9")
    with here.monkeypatch.context() as patch:
        patch.setattr(identify_run, "repeat_experiment", interrupted)
        ended = here.run(*run, "--out", "out")
    said = "excite: interrupted; the result is saved, with 4 of 9 repetitions; with --force, the same command goes on"
    assert (ended.returncode, ended.stderr.splitlines()[-1]) == (130, said)
    assert repetitions("out")["count"] == 4
    assert {"repetitions.png", "repetitions-so-far.npz"} <= files_below(here.cwd / "out")
    again = here.run(*run, "--out", "out", "--force", status=0)
    assert f"excite: 4 of 9 repetitions are already done in out{os.sep}repetitions-so-far.npz" in again.stderr
    assert not (here.cwd / "out" / "repetitions-so-far.npz").exists()
    here.run(*run, "--out", "whole")
    assert repetitions("out") == repetitions("whole")
