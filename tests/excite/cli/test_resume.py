"""The same design command again: finished starts are kept, whatever ended the run before; others run again."""

import json
import os
import random
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import pytest
from commands import ENVIRONMENT, MODULE, Here, content_of, files_below, run
from processes import alive, running, stderr_of, until, workers

from excite.design.start_results import RUNNING, read_start, start_files
from excite.storage.manifest import read_manifest
from regressors.errors import InputError

SMALL = ("irp6", "--starts", "8", "--harmonics", "3", "--workers", "2")
SHORT = ("irp6", "--joints", "1", "--torque-margin", "none", "--harmonics", "3", "--executor", "serial", "--rate", "20")


def finished(folder: Path) -> dict[str, bytes]:
    """Files of the starts that have ended; none is like another, since the run and its processor time are in it."""
    content = {}
    for place in (folder / "starts", folder / ".next" / "starts"):
        for _, path in start_files(place) if place.exists() else ():
            with suppress(InputError):
                if read_start(path)[0].status != RUNNING:
                    content[path.name] = path.read_bytes()
    return content


def same_design(a: Path, b: Path) -> bool:
    contents = [content_of(folder) for folder in (a, b)]
    for content in contents:
        del content["provenance"]
        for start in content["solver"]["starts"]:
            del start["cpu_seconds"]
    return contents[0] == contents[1] and (a / "trajectory.csv").read_bytes() == (b / "trajectory.csv").read_bytes()


# Kills


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cwd = tmp_path_factory.mktemp("undisturbed")
    assert run("design", *SMALL, "--out", "out", cwd=cwd).returncode == 0
    return cwd / "out"


def killed(cwd: Path, whom: str, after: int, wait: float) -> dict[str, bytes]:
    """Run the command, and kill some of its processes some time after starts have ended; those that had."""
    with running(cwd, "design", *SMALL, "--out", "out") as process:
        until(lambda: len(finished(cwd / "out")) >= after or process.poll() is not None)
        time.sleep(wait)
        before = finished(cwd / "out")
        of_pool = workers(process.pid)
        victims = {"parent": [process.pid], "worker": of_pool[:1], "both": [process.pid, *of_pool[:1]]}[whom]
        for pid in victims:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.wait(120)
        until(lambda: not alive(process.pid), 5)
    stderr_of(cwd)
    return before


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_kill_loses_nothing(seed: int, undisturbed: Path, tmp_path: Path) -> None:
    """Nothing is computed twice, and nothing is left over."""
    rng, whom = random.Random(seed), ("parent", "worker", "both")[seed]
    before = killed(tmp_path, whom, after=rng.randint(0, 8), wait=rng.uniform(0.0, 1.5))
    ended = run("design", *SMALL, "--out", "out", cwd=tmp_path)
    complete = ended.returncode == 2 and "already holds a design" in ended.stderr
    assert ended.returncode == 0 or complete, ended.stderr
    if before and not complete:
        assert " starts are already done in out/starts; " in ended.stderr or "1 of 8 starts is" in ended.stderr
    after = finished(tmp_path / "out")
    assert {name: after[name] for name in before} == before
    assert not [name for name in files_below(tmp_path / "out") if Path(name).name.startswith(".")]
    assert same_design(tmp_path / "out", undisturbed)


# What is found


@pytest.fixture
def quick(here: Here, monkeypatch: pytest.MonkeyPatch) -> Here:
    """Runs commands without drawing."""

    def drawn(_: object, folder: Path, **__: object) -> list[Path]:
        (folder / "motion.png").write_bytes(b"")
        return []

    monkeypatch.setattr("excite.views.figures.write_figures", drawn)
    return here


def without_files(folder: Path) -> Path:
    """A folder of a design with nothing but its starts."""
    for path in folder.iterdir():
        if path.is_file():
            path.unlink()
    return folder


def stopped_before_the_end(here: Here, *options: str, keep: int = 1) -> Path:
    """Folder of a run that was killed after some starts."""
    folder = without_files(here.designed(*SHORT, *options))
    for index, path in start_files(folder / "starts"):
        if index >= keep:
            path.unlink()
    return folder


def test_finished_starts_are_kept_and_more_may_be_asked_for(quick: Here) -> None:
    folder = stopped_before_the_end(quick, "--starts", "2")
    before = finished(folder)
    (folder / "starts" / ".start-0001.json.1234").write_text("half")
    (folder / "starts" / "start-0002.json").write_text("half")
    ended = quick.run("design", *SHORT, "--starts", "3", "--out", "out", status=0)
    assert "excite: 1 of 3 starts is already done in out/starts; 2 are left\n" in ended.stderr
    assert "excite: 1 file in out/starts cannot be read; its start runs again\n" in ended.stderr
    assert "\nstart 2 of 3: " in ended.stderr or "\nstart 3 of 3: " in ended.stderr or "best so far" not in ended.stderr
    after = finished(folder)
    assert set(after) == {f"start-000{k}.json" for k in range(3)}
    assert after["start-0000.json"] == before["start-0000.json"]
    design = json.loads((folder / "design.json").read_text())
    assert design["provenance"]["cpu_seconds"] >= sum(json.loads(text)["cpu"] for text in after.values())
    assert same_design(folder, quick.designed(*SHORT, "--starts", "3", out="anew"))


def edit(start: Path) -> None:
    content = json.loads(start.read_text())
    content["value"] /= 2.0
    start.write_text(json.dumps(content))


@pytest.mark.slow
def test_a_start_that_was_edited_runs_again(quick: Here) -> None:
    folder = stopped_before_the_end(quick, "--starts", "2", keep=2)
    start = folder / "starts" / "start-0001.json"
    content = json.loads(start.read_text())
    start.write_text(json.dumps(dict(reversed(content.items()))))  # which is the same content
    assert read_start(start)[0].value == content["value"]
    edit(start)
    ended = quick.run("design", *SHORT, "--starts", "2", "--out", "out", status=0)
    assert "excite: 1 file in out/starts was changed after it was written; its start runs again\n" in ended.stderr
    assert read_start(start)[0].value == content["value"]
    edit(start)  # of a complete design, to which starts are added
    ended = quick.run("design", *SHORT, "--starts", "3", "--out", "out", "--force")
    assert "excite: 1 of 3 starts is already done in out/starts; 2 are left\n" in ended.stderr
    assert "excite: 1 file in out/starts was changed after it was written; its start runs again\n" in ended.stderr
    assert read_start(start)[0].value == content["value"]
    runs = {read_start(path)[1]["run"] for _, path in start_files(folder / "starts")[1:]}
    assert runs == {content_of(folder)["provenance"]["run"]} == {read_manifest(folder)["design"].run}


def test_starts_without_a_hash_of_their_content_are_kept(quick: Here) -> None:
    folder = stopped_before_the_end(quick, "--starts", "1")
    start = folder / "starts" / "start-0000.json"
    content = json.loads(start.read_text())
    del content["sha256"]
    start.write_text(json.dumps(content))
    ended = quick.run("design", *SHORT, "--starts", "1", "--out", "out")
    assert "excite: 1 of 1 starts is already done in out/starts; 0 are left\n" in ended.stderr


def test_starts_of_another_problem_are_refused(quick: Here) -> None:
    folder = stopped_before_the_end(quick, "--starts", "1")
    before = finished(folder)
    options = ("--seed", "1", "--period", "8")
    assert quick.refused("design", *SHORT, *options, "--starts", "1", "--out", "out") == (
        "excite: out/starts holds starts of another problem (search.seed 0 -> 1, trajectory.period 10.0 -> 8.0); "
        "--fresh removes them, or choose another --out\n"
    )
    assert finished(folder) == before
    quick.run("design", *SHORT, *options, "--starts", "1", "--out", "out", "--fresh", status=0)
    assert finished(folder) != before


def test_a_complete_design_is_made_anew_by_force_alone(quick: Here) -> None:
    folder = quick.designed(*SHORT, "--starts", "1")
    before = finished(folder)
    assert quick.run("design", *SHORT, "--starts", "1", "--out", "out", "--fresh").returncode == 2
    assert finished(folder) == before
    quick.designed(*SHORT, "--starts", "1", "--force")
    assert finished(folder) != before
    before = finished(folder)
    quick.designed(*SHORT, "--starts", "2", "--force")  # of more starts: those that are there count
    assert finished(folder)["start-0000.json"] == before["start-0000.json"]
    assert not (folder / ".next").exists()


def test_a_replacement_that_was_killed_is_resumed(quick: Here) -> None:
    folder = quick.designed(*SHORT, "--starts", "2")
    done = (folder / "starts" / "start-0000.json").read_bytes()
    quick.designed(*SHORT, "--starts", "2", "--force")
    old = finished(folder)
    (folder / ".next" / "starts").mkdir(parents=True)
    (folder / ".next" / "starts" / "start-0000.json").write_bytes(done)
    ended = quick.run("design", *SHORT, "--starts", "2", "--out", "out", "--force")
    assert "excite: 1 of 2 starts is already done in out/starts; 1 is left\n" in ended.stderr
    after = finished(folder)
    assert after["start-0000.json"] == done
    assert after["start-0001.json"] != old["start-0001.json"]


OWN = """\
from excite.tasks.criteria import ConditionNumber

FACTOR = 1.0


class Mine(ConditionNumber):
    def __init__(self) -> None:
        self.factor = FACTOR
"""


@pytest.mark.slow
def test_own_code_is_part_of_the_problem(here: Here) -> None:
    (here.cwd / "mine_of_resume.py").write_text(OWN)
    options = (*SHORT, "--criterion", "mine_of_resume:Mine", "--starts", "2")
    run("design", *options, "--out", "out", cwd=here.cwd, status=0)
    without_files(here.cwd / "out")
    assert "2 of 2 starts are already done" in run("design", *options, "--out", "out", cwd=here.cwd).stderr
    without_files(here.cwd / "out")
    (here.cwd / "mine_of_resume.py").write_text(OWN.replace("1.0", "2.0"))
    other = run("design", *options, "--out", "out", cwd=here.cwd, status=2)
    assert "starts of another problem (another own.mine_of_resume:Mine.source); --fresh" in other.stderr


# Streams that are closed


@pytest.mark.slow
@pytest.mark.parametrize("closed", [">&- 2>&-", "2>/dev/full"])
def test_closed_streams_cost_no_design(closed: str, tmp_path: Path) -> None:
    line = " ".join([*MODULE, "design", *SHORT, "--starts", "1", "--out", "out", closed])
    buffered = {name: value for name, value in ENVIRONMENT.items() if name != "PYTHONUNBUFFERED"}
    ended = subprocess.run(["sh", "-c", line], cwd=tmp_path, env=buffered, capture_output=True, check=False)
    assert ended.returncode == 0
    assert content_of(tmp_path / "out")["feasible"] is True
