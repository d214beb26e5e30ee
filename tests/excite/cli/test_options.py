"""Options that several commands share: figures, choices, precision, and how much is printed."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import ENVIRONMENT, Here, content_of, files_below
from played import noisy, played, three_joints

import excite
from excite.cli import identify_run as repetition_run
from excite.cli.study_run import plan_next_motion
from excite.design.multistart import holds_unfinished_design
from excite.logs.log_reading import write_log
from excite.storage.result_folder import replace_result, result_folder
from excite.study import period_search as period_search
from excite.study.next_motion import NextMotion, PrecisionInHand
from excite.views import figures

# ``--figures`` and ``--figure-width`` of every command that draws.


QUICK = ("design", "irp6", "--starts", "1", "--harmonics", "3", "--period", "4", "--executor", "serial", "--out", "out")


WRONG = (
    ("--figures", "jpg", "expected none, or some of png, pdf, svg separated by commas; given 'jpg'"),
    ("--figures", "", "given ''"),
    ("--figure-width", "3.5", "'3.5' is not one of 'screen', 'single', 'double'"),
)


def test_what_is_no_format_is_refused(here: Here) -> None:
    for option, value, message in WRONG:
        assert message in here.refused(*QUICK, option, value)


RUN = "import sys; from excite.cli.main import cli; cli.main(sys.argv[1:], standalone_mode=False)"


@pytest.mark.slow
@pytest.mark.parametrize(("figures", "drawn"), [("none", False), ("svg", True)])
def test_without_figures_matplotlib_stays_out(figures: str, drawn: bool, tmp_path: Path) -> None:
    code = f"import atexit, sys; atexit.register(lambda: print('matplotlib' in sys.modules, file=sys.stderr)); {RUN}"
    command = [sys.executable, "-c", code, *QUICK, "--figures", figures]
    ended = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert ended.stderr.splitlines()[-1] == str(drawn)
    assert any(name.endswith(".svg") for name in files_below(tmp_path / "out")) == drawn
    assert not any(name.endswith(".png") for name in files_below(tmp_path / "out"))


@pytest.mark.slow
def test_other_figures_are_no_other_problem(here: Here) -> None:
    tmp_path, problems = here.cwd, set()
    cases = {"--figures none": set(), "--figures pdf,svg --force": {".pdf", ".svg"}, "--force": {".png"}}
    for options, expected in cases.items():
        assert here.run(*QUICK, *options.split()).returncode == 0
        content = json.loads((tmp_path / "out" / "design.json").read_text())
        problems.add(content["provenance"]["problem"])
        assert {Path(name).suffix for name in files_below(tmp_path / "out")} - {"", ".json", ".csv"} == expected
    assert len(problems) == 1


ASKED: tuple[tuple[tuple[str, ...] | None, str | None, bool], ...] = (
    (("png",), None, True),
    (("png",), "motion.png", False),
    (("pdf", "svg"), None, True),
    (("pdf", "svg"), "motion.svg", False),
    ((), None, False),
    (None, None, True),
    (None, "motion.png", False),
    (None, "motion.pdf", False),
)


def test_a_design_is_finished_with_the_figures_that_were_asked_for(tmp_path: Path) -> None:
    for number, (asked, there, unfinished) in enumerate(ASKED):
        folder = tmp_path / str(number)
        with result_folder(folder), replace_result(folder, "design", figures=asked) as staged:
            (staged / "design.json").write_text('{"interrupted": false}')
        if there is not None:
            (folder / there).write_bytes(b"")
        assert holds_unfinished_design(folder) == unfinished, (asked, there)


# ``excite identify --choose``: what is chosen, said and written.


@pytest.fixture
def choosing(recorded: Here) -> Here:
    recorded.monkeypatch.setattr(figures, "write_figures", lambda *_, **__: [])
    return recorded


def chosen(choosing: Here, log: str, *arguments: str) -> tuple[list[dict[str, Any]], str]:
    """Choices as written, and what is printed."""
    ended = choosing.run("identify", "irp6", log, "-v", *arguments, "--out", "out", "--force", status=0)
    content = json.loads((choosing.cwd / "out" / "result.json").read_text())
    return content["choices"], ended.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ("--choose none", []),
        ("", ["cutoff", "signals", "terms", "delay", "presliding", "standstill", "estimator"]),
        ("--choose cutoff,delay", ["cutoff", "delay", "presliding"]),
        pytest.param("--choose load-share", ["terms", "presliding"], marks=pytest.mark.slow),
        ("--choose cutoff,signals --signals spline --sign-width 0", []),
        ("--choose delay,estimator --delay 0.001 --sign-width 0 --estimator huber", []),
        (
            "--design design --choose all --estimator weighted",
            ["cutoff", "signals", "delay", "presliding", "standstill"],
        ),
    ],
)
def test_what_is_named_is_chosen_and_what_is_given_is_kept(choosing: Here, arguments: str, names: list[str]) -> None:
    write_log(noisy(played(three_joints(), 3, seconds=8.0), 0.2, 1e-6, 3), choosing.cwd / "long.csv")
    choices, printed = chosen(choosing, "run.csv" if "--design" in arguments else "long.csv", *arguments.split())
    assert [choice["name"] for choice in choices] == names
    lines = [line.removeprefix("note: ") for line in printed.splitlines()]
    said = [line for line in lines if line.startswith("chosen: ")]
    assert said == [f"chosen: {choice['reason']}" for choice in choices]
    assert all(choice["candidates"] for choice in choices)
    if not arguments:
        for text in ("positions are low-passed at", "recorded at the same time", "the data alone give possible bodies"):
            assert f" {text}" in printed


def test_with_repetitions_the_estimator_is_one_that_can_be_repeated(choosing: Here) -> None:
    choosing.monkeypatch.setattr(repetition_run, "repeat_and_write", lambda result, *_, **__: (result, 0))
    choices, _ = chosen(choosing, "run.csv", "--repeat", "9", "--choose", "delay,estimator")
    assert [choice["name"] for choice in choices] == ["delay", "presliding"]
    assert json.loads((choosing.cwd / "out" / "result.json").read_text())["estimator"] == "weighted"


def test_other_names_are_refused(choosing: Here) -> None:
    for names in ("speed", "cutoff,speed", "", "cutoff,", "all,cutoff"):
        said = choosing.refused("identify", "irp6", "run.csv", "--choose", names, "--out", "out")
        assert "'--choose': expected all, none, or some of cutoff, signals, delay, " in said


# ``excite design --precision``: exit status, files, and values that are refused.


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
    ended = here.run("design", "irp6", "--precision", "200%", *FEW, "--out", "d", status=0)
    folder = here.cwd / "d"
    stated, whole = content_of(folder)["precision"], json.loads((folder / "precision.json").read_text())
    assert f"{stated['robot_seconds']:.4g} s of robot time; worst parameter" in ended.stdout
    assert stated["met"] is True
    assert {name: whole[name] for name in stated} == stated
    assert whole["asked"]["share"] == 2.0
    assert all(p["allowed"] is None or p["half_width"] <= p["allowed"] for p in stated["parameters"])
    with (folder / "precision.csv").open() as stream:
        front = list(csv.DictReader(stream))
    assert [float(row["largest_use"]) for row in front] == [point["use"] for point in whole["front"]]
    assert content_of(folder)["task"]["precision"]["share"] == 2.0
    assert "--force" in here.run("design", "irp6", "--precision", "200%", *FEW, "--out", "d", status=2).stderr


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_out_of_reach_is_saved_with_exit_status_1(here: Here) -> None:
    (here.cwd / "p.yaml").write_text("groups: {inertia: 0.0001}\nshare: null\n")
    ended = here.run("design", "irp6", "--precision", "p.yaml", "--max-time", "8", *FEW, "--out", "d", status=1)
    stated = content_of(here.cwd / "d")["precision"]
    assert stated["met"] is False
    assert stated["robot_seconds"] <= 8.0
    assert all((p["allowed"] is None) == p["name"].startswith("F") for p in stated["parameters"] if p["unit"] != "kg m")
    assert "out of reach within 8 s" in ended.stdout
    assert "times the allowed half-width" in ended.stdout
    assert "what helps most is" in ended.stdout


PRECISIONS = {"-5%": "precision", "0%": "precision", "five": "cannot read five", "5 percent": "cannot read"}
WRONG_FILES = {
    "parameters: {X99: 0.1}\n": "X99",
    "shares: 0.1\n": "shares",
    "groups: {frictions: 0.1}\n": "frictions",
    "share: 5\nlevel: 99\n": "level",
    "share: [\n": "p.yaml",
}


def test_values_and_files_that_are_refused(here: Here) -> None:
    for given, message in (*PRECISIONS.items(), ("nan", "precision")):
        assert message in here.refused("design", "irp6", f"--precision={given}", "--out", "d")
    for content, message in WRONG_FILES.items():
        (here.cwd / "p.yaml").write_text(content)
        assert message in here.refused("design", "irp6", "--precision", "p.yaml", "--executor", "serial", "--out", "d")


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


# --quiet, --verbose, --json and the older --format json mean the same before and after every command.


VERDICT = "2 motions of at most 2 drives identify all 13 parameters of irp6 (energy model).\n"


def test_quiet_verbose_and_json_mean_the_same_before_and_after_a_command(here: Here) -> None:
    for words in ("-q plan irp6", "plan -q irp6", "plan irp6 --quiet", "--quiet plan irp6"):
        ended = here.run(*words.split())
        assert (ended.returncode, ended.stdout, ended.stderr) == (0, VERDICT, "")
    for words in ("-v plan irp6", "plan irp6 --verbose"):
        shown = here.run(*words.split()).stdout
        assert shown.startswith(VERDICT)
        assert "What each selection of drives identifies" in shown
        assert f"excite {version('excite-trajectories')}, Python 3." in shown.splitlines()[-1]
    for words in ("plan irp6 --json", "plan irp6 --format json", "-q plan irp6 --json", "-v plan irp6 --json"):
        content = json.loads(here.run(*words.split()).stdout)
        assert (content["verdict"], content["rank"]) == (VERDICT.strip(), 13)


def test_what_excludes_each_other(here: Here) -> None:
    for words in ("-q -v plan irp6", "-q plan irp6 -v"):
        assert "--quiet and --verbose exclude each other" in here.refused(*words.split())


def test_verbose_names_the_files_that_are_read(here: Here) -> None:
    (here.cwd / "irp.yaml").write_text("name: irp\n")
    for words, named in ((("plan", "irp.yaml"), False), (("-v", "plan", "irp.yaml"), True)):
        here.monkeypatch.setattr("commands.without_steps", lambda text: text)
        assert ("excite: reading irp.yaml ..." in here.run(*words).stderr) == named


def test_robots_are_listed_by_name(here: Here) -> None:
    names = here.run("robots", "-q").stdout.split()
    assert names == [robot["name"] for robot in json.loads(here.run("robots", "--json").stdout)]
    assert here.run("robots", "irp6", "-q").stdout.startswith("irp6: 5 joints; ")
