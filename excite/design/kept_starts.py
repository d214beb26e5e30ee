"""Resuming a search: the starts that an earlier run of the same problem has finished are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from excite.design.formulation import Formulation
from excite.design.problem_identity import ProblemIdentity
from excite.design.start_results import RUNNING, Origin, Start, Starts, read_start, start_files
from excite.storage.manifest import EditedError
from regressors.errors import InputError

_REMEDY = "`fresh` removes them, or choose another `folder`"


@dataclass(frozen=True)
class KeptStarts:
    """Finished starts of a problem in a folder, and those that are left."""

    folder: Path
    count: int | None  # number of starts of the task; None where the search adapts it
    done: Mapping[int, str] = field(default_factory=dict)  # lineage of those that are finished, by their number
    best: float = float("inf")  # least value among them
    cpu: float = 0.0  # processor time that they took [s]
    notes: tuple[str, ...] = ()  # what was found, in sentences

    def left(self, starts: Starts) -> Starts:
        """Those of some planned starts that are still to run."""
        return [start for start in starts if not self.has(start)] if self.done else starts

    def has(self, start: Start) -> bool:
        """Whether a start is finished, and descends from what is planned now."""
        index, lineage = (start, "") if isinstance(start, int) else (start.index, start.lineage)
        return self.done.get(index) == lineage


def keep_starts(
    folder: Path, formulation: Formulation, *, fresh: bool = False, shown: Path | None = None
) -> KeptStarts:
    """Find the finished starts of a problem in a folder, and remove files of starts that did not end."""
    shown = folder if shown is None else shown
    remove_temporary(folder)
    search, identity = formulation.task.search, formulation.identity
    count = None if search.adaptive else search.first
    if fresh:
        remove_starts(folder)
        return KeptStarts(folder, count)
    done: dict[int, str] = {}
    unfinished, errors, best, cpu = list[Path](), list[InputError](), float("inf"), 0.0
    for index, path in start_files(folder):
        try:
            start, origin = read_start(path)
        except InputError as error:
            errors.append(error)
            unfinished.append(path)
            continue
        _check_origin(origin, identity, shown)
        if start.status == RUNNING or start.index != index or identity.sha256 is None:
            unfinished.append(path)
        elif count is None or (index < count and not start.lineage):
            done[index] = start.lineage
            best, cpu = min(best, start.value), cpu + start.cpu
    _remove(unfinished)
    edited = sum(isinstance(error, EditedError) for error in errors)
    notes = _notes(shown, count, len(done), edited, len(errors) - edited)
    if identity.doubt and unfinished:
        notes.append(f"the starts in {shown} are not reused: {identity.doubt}")
    return KeptStarts(folder, count, done, best, cpu, tuple(notes))


def _notes(shown: Path, count: int | None, done: int, edited: int, unreadable: int) -> list[str]:
    which = f"{done} start{'s' if done > 1 else ''}" if count is None else f"{done} of {count} starts"
    then = "the search goes on from there" if count is None else f"{count - done} {_are(count - done)} left"
    notes = [f"{which} {_are(done)} already done in {shown}; {then}"] if done else []
    for number, one, several in (
        (edited, "was changed after it was written", "were changed after they were written"),
        (unreadable, "cannot be read", "cannot be read"),
    ):
        if number == 1:
            notes.append(f"1 file in {shown} {one}; its start runs again")
        elif number:
            notes.append(f"{number} files in {shown} {several}; their starts run again")
    return notes


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _check_origin(origin: Origin | None, identity: ProblemIdentity, shown: Path) -> None:
    """Refuse a start of another problem; of one that cannot be compared, it is not known."""
    if origin is None:
        raise InputError(f"{shown} holds starts that do not state their problem; {_REMEDY}")
    if origin["sha256"] == identity.sha256:
        return
    told = identity.differences(origin["problem"])
    raise InputError(f"{shown} holds starts of another problem{f' ({told})' if told else ''}; {_REMEDY}")


def remove_starts(folder: Path) -> None:
    """Remove all starts of a folder."""
    _remove([path for _, path in start_files(folder)])


def remove_temporary(folder: Path) -> None:
    """Remove the temporary files of processes that were killed while they wrote a start."""
    _remove(list(folder.glob(".start-*")))


def _remove(paths: Sequence[Path]) -> None:
    for path in paths:
        path.unlink(missing_ok=True)
