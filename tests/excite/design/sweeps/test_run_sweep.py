"""Sweeps run to their end: alike on every executor, resumed after kills and failing disks, nothing done twice."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from commands import ENVIRONMENT, Here
from failing_disk import CRASHED, Disk, run_failing
from processes import DaskProcesses, alive, kill, stderr_of, until, workers
from written_results import VERSIONS, design

import excite
from excite.design.executors.unit_executor import InThisProcess
from excite.design.problem_identity import ProblemIdentity
from excite.design.start_results import write_start
from excite.design.starts import KeptStarts
from excite.design.sweeps.cell import clear_cells, packed, place, stored_design
from excite.design.sweeps.run_sweep import run_sweep
from excite.design.sweeps.sweep_table import load_sweep
from regressors.errors import InputError

CAMPAIGN = """
common: {starts: 2, harmonics: 3}
grid:
  robot: [irp6]
  trajectory: [fourier, cosine]
  limits: {fast: {velocity: 1.0}, still: {velocity: 0.000001, acceleration: 0.0000001}}
exclude: [{trajectory: fourier, limits: still}]
"""
SLOW = """
common: {starts: 2, harmonics: 5}
grid: {robot: [panda], trajectory: [fourier, cosine], seed: [0, 1]}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    (tmp_path / "sweep.yaml").write_text(CAMPAIGN)
    (tmp_path / "slow.yaml").write_text(SLOW)
    return Here(tmp_path, monkeypatch, capfd)


def motions(out: Path) -> dict[str, Any]:
    """What the designs of all cells say, by cell, without times and places."""
    contents = {path.parent.name: json.loads(path.read_text()) for path in sorted(out.glob("cells/*/design.json"))}
    told = ("trajectory", "criteria", "limits", "predicted", "notes")
    return {cell: [content[name] for name in told] for cell, content in contents.items()}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Motions of the slow sweep, in this process."""
    folder = tmp_path_factory.mktemp("serial")
    (folder / "slow.yaml").write_text(SLOW)
    excite.run_sweep(folder / "slow.yaml", folder / "out", executor="serial")
    return motions(folder / "out")


def started(here: Here, *options: str, **how: Any) -> subprocess.Popen[Any]:
    words = ["-m", "excite", "sweep", "run", "slow.yaml", "--out", "out", "--figures", "none"]
    command = [sys.executable, *words, *options]
    return subprocess.Popen(command, cwd=here.cwd, env=ENVIRONMENT, **how)


def files(out: Path, pattern: str) -> dict[str, bytes]:
    return {str(path.relative_to(out)): path.read_bytes() for path in out.glob(pattern) if path.is_file()}


@pytest.mark.slow
def test_command_writes_table_figure_and_page_and_does_nothing_twice(here: Here) -> None:
    command = ("sweep", "run", "sweep.yaml", "--out", "out", "--executor", "serial", "--report")
    ended = here.run(*command)
    out = here.cwd / "out"
    assert ended.returncode == 1
    assert ended.stdout.startswith("2 of 3 cells have a design within their limits; 1 infeasible.\n")
    assert "robot=irp6,trajectory=cosine,limits=still: infeasible: no start found a motion" in ended.stdout
    assert {path.name for path in out.glob("[!.]*")} == {
        "campaign.csv", "campaign.json", "campaign.png", "campaign.html", "cells", "manifest.json",
    }  # fmt: skip
    before = files(out, "cells/**/*.*")
    again = here.run(*command, "--json", status=1)
    assert "excite: 3 of 3 cells are already done in out\n" in again.stderr
    assert json.loads(again.stdout)["counts"] == {"designed": 2, "infeasible": 1}
    assert files(out, "cells/**/*.*") == before

    cells = sorted(str(path) for path in out.glob("cells/*fast*"))
    assert here.run("compare", *cells).returncode == 0
    assert here.run("export", cells[0], "--format", "npz", "--out", "motion.npz").returncode == 0
    assert here.run("report", "out", "--out", "page.html").returncode == 0

    (here.cwd / "sweep.yaml").write_text(CAMPAIGN.replace("starts: 2", "starts: 1, noise: 2"))
    refused = here.run(*command, status=2)
    assert "3 cells of the same names have other options or versions" in refused.stderr
    assert "--force runs them again" in refused.stderr
    assert files(out, "cells/**/*.*") == before
    here.run(*command, "--force", "--figures", "none", status=1)
    assert json.loads((out / cells[0] / "design.json").read_text())["task"]["noise"] == [2.0]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks at processes through /proc")
def test_killed_at_once_and_a_worker_killed(here: Here, undisturbed: dict[str, Any]) -> None:
    out = here.cwd / "out"

    def start() -> subprocess.Popen[Any]:
        with (here.cwd / "stderr").open("wb") as stderr:
            return started(here, "--workers", "2", stderr=stderr, start_new_session=True)

    process = start()
    until(lambda: files(out, "cells/*/design.json"))
    until(lambda: len(finished_starts(out)) > 2)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    until(lambda: not alive(process.pid))
    designs, starts = files(out, "cells/*/[!.]*"), finished_starts(out)
    assert 1 <= len(files(out, "cells/*/design.json")) < 4
    process = start()
    until(lambda: len(finished_starts(out)) > len(starts))
    os.kill(workers(process.pid)[0], signal.SIGKILL)
    assert process.wait(120) == 0
    assert "a worker process ended (signal 9, which is often a lack of memory) and is replaced" in stderr_of(here.cwd)
    assert "of 4 cells are already done in out" in stderr_of(here.cwd)
    kept = [name for name in designs if f"{Path(name).parent}/design.json" in designs]
    assert {name: designs[name] for name in kept} == {name: (out / name).read_bytes() for name in kept}
    assert {name: (out / name).read_bytes() for name in starts} == starts
    assert motions(out) == undisturbed


def finished_starts(out: Path) -> dict[str, bytes]:
    found = files(out, "cells/*/starts/start-*.json")
    return {name: content for name, content in found.items() if b"best point so far" not in content}


@pytest.mark.slow
def test_dask_scheduler_gone(here: Here, undisturbed: dict[str, Any]) -> None:
    pytest.importorskip("distributed")
    out, ended = here.cwd / "out", list[str]()
    with DaskProcesses(here.cwd / "dask") as dask:
        process = started(here, "--executor", dask.address, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        until(lambda: files(out, "cells/*/design.json"))
        kill(dask.scheduler)
        stdout, stderr = process.communicate(timeout=120)
    assert process.returncode == 1
    assert [line for line in stderr.splitlines() if line.startswith("excite: the Dask")] == [
        f"excite: the Dask scheduler at {dask.address} went away; what is finished is kept, and the same command "
        "continues with the rest"
    ]
    assert "Traceback" not in stderr + stdout
    before = files(out, "cells/*/design.json")
    assert 1 <= len(before) < 4
    table = run_sweep(here.cwd / "slow.yaml", out, executor="serial", progress=lambda each: ended.append(each.cell))
    assert table.holds
    assert len(ended) == 4 - len(before)
    assert {name: (out / name).read_bytes() for name in before} == before
    assert motions(out) == undisturbed


@pytest.mark.slow
def test_interrupted_sweep_writes_the_table(here: Here) -> None:
    process = started(here, "--executor", "serial", stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    until(lambda: files(here.cwd / "out", "cells/*/design.json"))
    process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "excite: interrupted; finished cells are saved, and the same command continues with the others" in stderr
    assert "not run" in stdout
    counts = load_sweep(here.cwd / "out").counts
    assert counts["designed"] + counts["not run"] == 4
    assert counts["designed"] >= 1


def test_names_of_tasks_are_checked(tmp_path: Path) -> None:
    for cells, what in (({}, "at least one cell"), ({"a/b": excite.Task("irp6")}, "given 'a/b'")):
        with pytest.raises(InputError, match=what):
            run_sweep(cells, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_folders_are_put_in_place_whole(tmp_path: Path) -> None:
    cells = tmp_path / "cells"
    place({"a.txt": b"1", "starts/b.txt": b"2"}, cells / "one")
    assert packed(cells / "one") == {"a.txt": b"1", "starts/b.txt": b"2"}
    place({"c.txt": b"3"}, cells / "one")
    assert packed(cells / "one") == {"c.txt": b"3"}
    (cells / "one").rename(cells / ".old-one")  # killed between the two renames
    (cells / ".new-one").mkdir()
    clear_cells(cells)
    assert {path.name for path in cells.iterdir()} == {"one"}
    assert packed(cells / "one") == {"c.txt": b"3"}


def test_nothing_is_left_where_no_scheduler_answers(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("excite.design.executors.dask_cluster._CONNECT", 0.3)
    for command in (("design", "irp6", "--harmonics", "3"), ("sweep", "run", "sweep.yaml")):
        ended = here.run(*command, "--out", "out", "--executor", "dask://127.0.0.1:9", status=2)
        assert ended.stderr.splitlines()[-1].startswith("excite: no Dask scheduler answers at dask://127.0.0.1:9: ")
        assert not (here.cwd / "out").exists()


STEP = 11  # every so many calls


def cells() -> dict[str, excite.Task]:
    """Tasks by name."""
    return {name: design(name).task for name in VERSIONS}


class Elsewhere(InThisProcess):
    """Runs cells here, but as a worker that does not see the disk."""

    shares_disk = False


@pytest.fixture
def no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Searches that end at once."""

    def formulate(_: object, task: Any) -> Any:
        version = VERSIONS[task.search.seed]
        identity = ProblemIdentity({"version": version}, run=version)
        return SimpleNamespace(task=task, identity=identity, made=design(version))

    def solve(_: object, formulation: Any, kept: KeptStarts) -> Any:
        for start in formulation.made.starts:
            write_start(kept.folder, start, formulation.identity.origin)
        return formulation.made

    monkeypatch.setattr("excite.design.sweeps.cell.formulate", formulate)
    monkeypatch.setattr("excite.design.sweeps.cell.solve", solve)


@pytest.mark.usefixtures("no_search")
@pytest.mark.slow
@pytest.mark.parametrize("how", ["killed", "power"])
@pytest.mark.parametrize("executor", [InThisProcess(), Elsewhere()], ids=["shared disk", "sent back"])
def test_a_sweep_continues_wherever_it_was_stopped(executor: InThisProcess, how: str, tmp_path: Path) -> None:
    def run(folder: Path) -> int:
        return int(not run_sweep(cells(), folder, executor=executor).holds)

    clean = Disk(tmp_path / "clean")
    assert run_failing(clean, lambda: run(tmp_path / "clean")) == 0
    assert len(clean.calls) > 50
    expected = load_sweep(tmp_path / "clean")
    for at in range(0, len(clean.calls), STEP):
        folder = tmp_path / f"{at}"
        assert run_failing(Disk(folder, at, how), lambda folder=folder: run(folder)) == CRASHED, clean.calls[at]
        done = {name for name in cells() if stored_design(folder / "cells" / name) is not None}
        kept = {name: (folder / "cells" / name / "design.json").stat().st_mtime_ns for name in done}
        assert run(folder) == 0, clean.calls[at]
        assert load_sweep(folder) == expected, clean.calls[at]
        assert {name: (folder / "cells" / name / "design.json").stat().st_mtime_ns for name in done} == kept
        assert {path.name for path in (folder / "cells").iterdir()} == set(cells())


@pytest.mark.usefixtures("no_search")
def test_a_full_disk_is_one_error_and_the_sweep_continues(tmp_path: Path) -> None:
    full = Disk(tmp_path / "out", 40, "full")
    with pytest.raises(excite.InputError, match="No space left on device"):
        run_failing(full, lambda: int(run_sweep(cells(), tmp_path / "out", executor="serial").holds))
    assert run_sweep(cells(), tmp_path / "out", executor="serial").holds
