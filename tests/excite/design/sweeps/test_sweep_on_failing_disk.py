"""Whatever call to the disk a sweep is stopped at, the same call again completes it, and keeps what was complete."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from failing_disk import CRASHED, Disk, run_failing
from written_results import VERSIONS, design

import excite
from excite.design.executors.unit_executor import InThisProcess
from excite.design.kept_starts import KeptStarts
from excite.design.problem_identity import ProblemIdentity
from excite.design.start_results import write_start
from excite.design.sweeps.cell import stored_design
from excite.design.sweeps.run_sweep import run_sweep
from excite.design.sweeps.sweep_table import load_sweep

STEP = 7  # every so many calls


def cells() -> dict[str, excite.Task]:
    """Tasks by name."""
    return {name: design(name).task for name in VERSIONS}


class Elsewhere(InThisProcess):
    """Runs cells here, but as a worker that does not see the disk."""

    shares_disk = False


@pytest.fixture(autouse=True)
def _no_search(monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_a_full_disk_is_one_error_and_the_sweep_continues(tmp_path: Path) -> None:
    full = Disk(tmp_path / "out", 40, "full")
    with pytest.raises(excite.InputError, match="No space left on device"):
        run_failing(full, lambda: int(run_sweep(cells(), tmp_path / "out", executor="serial").holds))
    assert run_sweep(cells(), tmp_path / "out", executor="serial").holds
