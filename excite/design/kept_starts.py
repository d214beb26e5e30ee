"""Resuming a search: the starts that an earlier run of the same problem has finished are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from excite.design.formulation import Formulation
from excite.design.problem_identity import ProblemIdentity
from excite.design.start_results import RUNNING, Origin, read_start, start_files
from excite.storage.content_hash import EditedError
from regressors.errors import InputError

_REMEDY = "`fresh` removes them, or choose another `folder`"


@dataclass(frozen=True)
class KeptStarts:
    """Finished starts of a problem in a folder, and those that are left.

    Parameters
    ----------
    folder : Path
    count : int
        Number of starts of the task.
    done : frozenset of int
        Numbers of those that are finished.
    best : float
        Least value among them.
    cpu : float
        Processor time that they took [s].
    notes : tuple of str
        What was found, in sentences.
    """

    folder: Path
    count: int
    done: frozenset[int] = frozenset()
    best: float = float("inf")
    cpu: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def left(self) -> Sequence[int]:
        """Numbers of the starts that are still to run."""
        every = range(self.count)
        return [index for index in every if index not in self.done] if self.done else every


def keep_starts(
    folder: Path, formulation: Formulation, *, fresh: bool = False, shown: Path | None = None
) -> KeptStarts:
    """Find the finished starts of a problem in a folder, and remove files of starts that did not end.

    Parameters
    ----------
    folder : Path
        An existing folder of starts.
    formulation : Formulation
    fresh : bool
        Remove all starts instead.
    shown : Path, optional
        The folder as messages name it.

    Raises
    ------
    InputError
        The folder holds starts of another problem.
    """
    shown = folder if shown is None else shown
    remove_temporary(folder)
    files = start_files(folder)
    count, identity = formulation.task.search.starts, formulation.identity
    if fresh:
        remove_starts(folder)
        return KeptStarts(folder, count)
    done, unfinished, edited, unreadable, best, cpu = [], [], 0, 0, float("inf"), 0.0
    for index, path in files:
        try:
            start, origin = read_start(path)
        except InputError as error:
            edited += isinstance(error, EditedError)
            unreadable += not isinstance(error, EditedError)
            unfinished.append(path)
            continue
        _check_origin(origin, identity, shown)
        if start.status == RUNNING or start.index != index or identity.sha256 is None:
            unfinished.append(path)
        elif index < count:
            done.append(index)
            best, cpu = min(best, start.value), cpu + start.cpu
    _remove(unfinished)
    notes = tuple(_notes(shown, count, len(done), edited, unreadable))
    if identity.doubt and unfinished:
        notes = (*notes, f"the starts in {shown} are not reused: {identity.doubt}")
    return KeptStarts(folder, count, frozenset(done), best, cpu, notes)


def _notes(shown: Path, count: int, done: int, edited: int, unreadable: int) -> list[str]:
    notes = []
    if done:
        left = count - done
        notes.append(f"{done} of {count} starts {_are(done)} already done in {shown}; {left} {_are(left)} left")
    if edited:
        files, starts = _files(edited)
        written = "was changed after it was written" if edited == 1 else "were changed after they were written"
        notes.append(f"{edited} {files} in {shown} {written}; {starts} again")
    if unreadable:
        files, starts = _files(unreadable)
        notes.append(f"{unreadable} {files} in {shown} cannot be read; {starts} again")
    return notes


def _files(count: int) -> tuple[str, str]:
    return ("file", "its start runs") if count == 1 else ("files", "their starts run")


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _check_origin(origin: Origin | None, identity: ProblemIdentity, shown: Path) -> None:
    """Refuse a start of another problem; of one that cannot be compared, it is not known."""
    if origin is None:
        raise InputError(f"{shown} holds starts that do not state their problem; {_REMEDY}")
    if origin.sha256 == identity.sha256:
        return
    told = identity.differences(origin.problem)
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
