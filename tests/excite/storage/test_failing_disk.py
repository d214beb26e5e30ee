"""Whatever call to the disk a command is stopped at, its folder holds the old result or the new one, whole."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from commands import files_below
from failing_disk import CRASHED, Disk, run_failing
from written_results import COMMANDS, Command, hashes

from regressors.errors import InputError

FAULTS = {"full": "No space left on device", "fault": "Input/output error"}
FIGURES = (".png", ".pdf", ".svg")
HOW = ("killed", "power", *FAULTS)
STOPS = 12  # of a command, in each way


@dataclass
class Trial:
    """One command, over an older result or in a folder that is not there yet."""

    command: Command
    over: bool
    folder: Path
    patch: pytest.MonkeyPatch
    capfd: pytest.CaptureFixture[str]

    def __post_init__(self) -> None:
        """Write what there is before the command."""
        (self.folder / "before").mkdir()
        if self.over:
            assert self.command.run(self.folder / "before", "old", self.patch, force=False) in (0, 1)

    def place(self, name: str) -> Path:
        """A folder with what there is before the command."""
        return shutil.copytree(self.folder / "before", self.folder / name, symlinks=True)

    def run(self, disk: Disk) -> int:
        """Run the new version."""
        self.capfd.readouterr()
        return run_failing(disk, lambda: self.command.run(disk.root, "new", self.patch, force=self.over))

    def clean(self) -> tuple[list[str], dict[str, str], dict[str, str]]:
        """Calls of a run that succeeds, and hashes of the files before and after it."""
        place = self.place("clean")
        before, disk = hashes(place), Disk(place)
        assert self.run(disk) in (0, 1)
        return disk.calls, before, hashes(place)

    def read(self, place: Path) -> bool:
        """True if the readers of the command find a result."""
        try:
            self.command.read(place / self.command.out)
        except InputError:
            return False
        return True


def data_of(files: dict[str, str]) -> dict[str, str]:
    """Files that hold data: neither figures, nor the manifest with its run's number, nor hidden ones, nor starts."""
    left_out = {name for name in files if name.endswith((*FIGURES, "manifest.json")) or "/starts/" in name}
    return {name: files[name] for name in visible(files).keys() - left_out}


def visible(files: dict[str, str]) -> dict[str, str]:
    """Files without hidden ones."""
    return {name: of for name, of in files.items() if not any(part.startswith(".") for part in Path(name).parts)}


def check_state(files: dict[str, str], states: list[dict[str, str]], over: bool) -> None:
    """Check that the data are those of one state, and figures and starts beside them no other's."""
    (state,) = [state for state in states if data_of(files) == data_of(state)]
    for name, content in visible(files).items():
        if name.endswith(FIGURES):
            assert state.get(name) == content, name
    starts = {name: content for name, content in visible(files).items() if "/starts/" in name}
    if state is states[-1] or over:
        assert starts == {name: content for name, content in state.items() if "/starts/" in name}


def check_calls(trial: Trial, ways: tuple[str, ...]) -> None:
    """Stop a command in each way at every n-th of its calls, each way at others."""
    calls, before, after = trial.clean()
    assert len(calls) > 20
    assert data_of(before) != data_of(after)
    stride = max(len(calls) // STOPS, 1)
    for number, how in enumerate(ways):
        for at in range(number * stride // len(ways), len(calls), stride):
            check_call(trial, how, at, calls[at], [before, after])


def check_call(trial: Trial, how: str, at: int, call: str, states: list[dict[str, str]]) -> None:
    """Stop a command at a call: its folder holds the old state or the new one, and the next run completes it."""
    place = trial.place(f"{how}{at}")
    status = trial.run(Disk(place, at, how))
    said = trial.capfd.readouterr().err
    if how not in FAULTS:
        assert status == CRASHED, call
    elif status == 2:
        assert FAULTS[how] in said, (call, said)
        assert len([line for line in said.splitlines() if not line.endswith(" ...")]) == 1  # beside its steps
        assert f"{place}/" in said.replace(f"{place}:", f"{place}/:")
        assert not any(hidden in said for hidden in ("/.s", "/.c", "/.n", "/.l", "/.w")), said
    else:
        assert status in (0, 1), call
    found = trial.read(place)
    files = hashes(place)
    check_state(files, states, trial.over)
    held = data_of(files) != {}
    assert found == held, call
    status = trial.command.run(place, "new", trial.patch, force=held)
    assert status in (0, 1), (call, trial.capfd.readouterr())
    assert files_below(place) == files_below(trial.folder / "clean"), call
    assert data_of(hashes(place)) == data_of(states[-1]), call


@pytest.fixture
def patch() -> Iterator[pytest.MonkeyPatch]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield patch


@pytest.mark.slow
@pytest.mark.parametrize("over", [False, True], ids=["fresh", "force"])
@pytest.mark.parametrize("name", COMMANDS)
def test_calls_of_every_command(
    name: str, over: bool, tmp_path: Path, patch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    check_calls(Trial(COMMANDS[name], over, tmp_path, patch, capfd), HOW)


def test_some_calls_of_a_fit(tmp_path: Path, patch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    check_calls(Trial(COMMANDS["friction fit"], True, tmp_path, patch, capfd), ("killed", "full"))
