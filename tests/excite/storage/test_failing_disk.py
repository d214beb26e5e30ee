"""Whatever call to the disk a command is stopped at, its folder holds the old result or the new one, whole."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
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


@dataclass
class Trial:
    """One command, over an older result or in a folder that is not there yet.

    Parameters
    ----------
    command : Command
    over : bool
        True if there is an older result.
    folder : Path
        Where folders are made.
    patch, capfd
        Fixtures of pytest.
    """

    command: Command
    over: bool
    folder: Path
    patch: pytest.MonkeyPatch
    capfd: pytest.CaptureFixture[str]

    def place(self, name: str) -> Path:
        """A folder with what there is before the command."""
        place = self.folder / name
        place.mkdir()
        if self.over:
            assert self.command.run(place, "old", self.patch, force=False) in (0, 1)
        return place

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


def check_every_call(trial: Trial, how: str, step: int = 1) -> int:
    """Stop a command at every call; number of calls."""
    calls, before, after = trial.clean()
    assert len(calls) > 20
    assert data_of(before) != data_of(after)
    for at in range(0, len(calls), step):
        place = trial.place(f"{how}{at}")
        status = trial.run(Disk(place, at, how))
        said = trial.capfd.readouterr().err
        if how not in FAULTS:
            assert status == CRASHED, calls[at]
        elif status == 2:
            assert FAULTS[how] in said, (calls[at], said)
            assert len([line for line in said.splitlines() if not line.endswith(" ...")]) == 1  # beside its steps
            assert f"{place}/" in said.replace(f"{place}:", f"{place}/:")
            assert not any(hidden in said for hidden in ("/.s", "/.c", "/.n", "/.l", "/.w")), said
        else:
            assert status in (0, 1), calls[at]
        found = trial.read(place)
        files = hashes(place)
        check_state(files, [before, after], trial.over)
        assert found == bool(data_of(files)), calls[at]
        again = data_of(files) != {}
        assert trial.command.run(place, "new", trial.patch, force=again) in (0, 1), (
            calls[at],
            trial.capfd.readouterr(),
        )
        assert files_below(place) == files_below(trial.folder / "clean"), calls[at]
        assert data_of(hashes(place)) == data_of(after), calls[at]
    return len(calls)


@pytest.fixture
def patch() -> Iterator[pytest.MonkeyPatch]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield patch


@pytest.mark.parametrize("over", [False, True], ids=["fresh", "force"])
@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.slow
def test_every_call_of_every_command(
    name: str, how: str, over: bool, tmp_path: Path, patch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    step = 3 if name.startswith("design, ") else 1  # the calls of a design differ by their figures only
    count = check_every_call(Trial(COMMANDS[name], over, tmp_path, patch, capfd), how, step)
    with suppress(Exception), capfd.disabled():
        print(f"{name}, {how}, {'force' if over else 'fresh'}: {count} calls")


@pytest.mark.parametrize("how", ["killed", "full"])
def test_some_calls_of_a_fit(
    how: str, tmp_path: Path, patch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    check_every_call(Trial(COMMANDS["friction fit"], True, tmp_path, patch, capfd), how, step=8)
