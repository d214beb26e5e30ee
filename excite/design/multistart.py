"""The starts of a search: optimised beside each other, and written to disk as soon as they end, where they go."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, cast
from weakref import WeakKeyDictionary

import cloudpickle

from excite.design.design_folder import DESIGN, KIND, STARTS, check_no_design, data_files, starts_folder
from excite.design.formulation import Formulation
from excite.design.interruption import deferred_interruption
from excite.design.search_rounds import Rounds
from excite.design.start_results import RUNNING, Progress, Starts, read_start, start_files
from excite.design.starts import KeptStarts, keep_starts, optimise_starts, remove_temporary
from excite.design.workers import NotPreparedError, Workers, environment_of_workers, work_on_starts
from excite.registry import FIGURE_FORMATS, instance
from excite.storage.atomic import read_json, replacing, shown, writing
from excite.storage.manifest import read_manifest
from excite.tasks.search import Search
from regressors.errors import InputError

StartsOfRounds = Iterable[Starts]
_TOGETHER = 4  # starts that are optimised together: what is measured of them comes when all have ended
_log = logging.getLogger(__name__)


def pickled(*content: Any) -> bytes:
    """Functions, a blueprint and more, pickled for other processes, with classes of the user's script by value."""
    try:
        return bytes(cloudpickle.dumps(content))
    except Exception as error:
        raise InputError(
            f"a part of this task cannot be sent to other processes ({error}); Search(executor='serial') keeps it in "
            "this one"
        ) from error


def serial(formulation: Formulation, rounds: StartsOfRounds, folder: Path, progress: Progress) -> None:
    """Optimise the starts of each round in this process."""
    search, origin = formulation.task.search, formulation.identity.origin
    with deferred_interruption() as answer:
        problem, method = formulation.problem, instance("solver", search.solver)
        answer()
        for starts in rounds:
            for some in shares(starts, 1, formulation):
                for result in optimise_starts(problem, method, search.seed, some, folder, answer, origin):
                    progress(result)
                answer()


def shares(starts: Starts, workers: int, formulation: Formulation) -> list[Starts]:
    """The starts of a round in equal parts, each for one worker at a time, which optimises its starts together.

    Alone, where they are all of a search, so that each is on disk as early as can be, or where evaluations are
    expensive for other reasons than their number.
    """
    alone = not formulation.task.search.adaptive or formulation.problem.limits.nonlinear_in_x
    parts = len(starts) if alone else min(len(starts), workers * -(-len(starts) // (_TOGETHER * workers)))
    ends = [len(starts) * k // parts for k in range(parts + 1)]
    return [starts[begin:end] for begin, end in pairwise(ends)]


def run_in_pool(formulation: Formulation, rounds: StartsOfRounds, folder: Path, progress: Progress) -> None:
    """Optimise the starts of each round in worker processes; one that ends unexpectedly is announced and replaced.

    Where worker processes cannot build the problem, a warning is logged, and the starts run in this process. The
    arguments are those of `serial`.
    """
    seed = formulation.task.search.seed
    following, starts = iter(rounds), cast("Starts", ())
    with _workers(formulation) as workers:
        try:
            for starts in following:
                parts = shares(starts, workers.count, formulation)
                for result in workers.run((seed, some, folder) for some in parts):
                    progress(result)
            return
        except NotPreparedError as error:
            workers.end()
            _log.warning("worker processes cannot build the problem (%s): the starts run in this process", error)
        except BaseException:
            workers.end()
            raise
        finally:
            remove_temporary(folder)
    serial(formulation, chain([starts], following), folder, progress)


@contextmanager
def ready_workers(formulation: Formulation) -> Iterator[None]:
    """Start the worker processes of a search now, and keep them for all its calls of `run_in_pool` in the block.

    To be entered before threads are started, such as that of a progress bar: a process without threads forks its
    workers, which costs next to nothing; another one has each of them import everything and build the problem.
    """
    if formulation.task.search.executor != "process":
        yield
        return
    with _workers(formulation) as workers:
        workers.start()
        yield


_kept: WeakKeyDictionary[Formulation, Workers] = WeakKeyDictionary()


@contextmanager
def _workers(formulation: Formulation) -> Iterator[Workers]:
    """The processes of a problem, those of an outer block if there are any."""
    if formulation in _kept:
        yield _kept[formulation]
        return
    search, origin = formulation.task.search, formulation.identity.origin
    content = pickled(work_on_starts, formulation.blueprint, origin)
    with environment_of_workers():
        count = min(search.workers or os.cpu_count() or 1, Rounds(search).largest)
        workers = Workers(content, lambda: work_on_starts(formulation.blueprint, origin, formulation.problem), count)
        _kept[formulation] = workers
        try:
            yield workers
        finally:
            del _kept[formulation]
            workers.end()


def resume_search(folder: Path, formulation: Formulation, *, replace: bool = False, fresh: bool = False) -> KeptStarts:
    """Find the starts of the same problem that an earlier run has finished, in the folder where further ones go.

    A design that an interrupted run has saved is continued, and replaced when the new one is complete; so is one that
    was killed before its figures were drawn, and, if it may be replaced, one of fewer starts. Any other complete design
    is replaced by one that is made anew.
    """
    stored = _same_problem(folder, formulation)
    unfinished = _is_unfinished(folder, stored)
    check_no_design(folder, data_files(formulation.task), replace=replace or unfinished)
    starts = starts_folder(folder)
    if not fresh and (unfinished or _is_less(stored, formulation.task.search)):
        _carry_over(folder / STARTS, starts, formulation)
    return keep_starts(starts, formulation, fresh=fresh, shown=shown(starts))


def holds_unfinished_design(folder: Path) -> bool:
    """Whether a run was interrupted, or killed before its figures were drawn, so that it may be continued."""
    return _is_unfinished(folder, _stored(folder))


def _is_unfinished(folder: Path, stored: dict[str, Any]) -> bool:
    return bool(stored) and (stored.get("interrupted") is True or not _is_drawn(folder))


def _is_drawn(folder: Path) -> bool:
    """Whether a design has its figures, where any were asked for."""
    entry = None
    with suppress(InputError):
        entry = read_manifest(folder).get(KIND)
    formats = FIGURE_FORMATS if entry is None or entry.figures is None else entry.figures
    return not formats or any(any(folder.glob(f"*.{form}")) for form in formats)


def _stored(folder: Path) -> dict[str, Any]:
    """Content of ``design.json``; empty where there is none that can be read."""
    with suppress(InputError):
        return read_json(folder / DESIGN) if (folder / DESIGN).exists() else {}
    return {}


def _same_problem(folder: Path, formulation: Formulation) -> dict[str, Any]:
    """Content of ``design.json`` if it is of the same problem, else nothing."""
    stored, sha256 = _stored(folder), formulation.identity.sha256
    provenance = stored.get("provenance")
    same = sha256 is not None and isinstance(provenance, dict) and provenance.get("problem") == sha256
    return stored if same else {}


def _is_less(stored: dict[str, Any], search: Search) -> bool:
    """Whether a stored design had fewer starts than are asked for now, so that it is continued."""
    task = stored.get("task")
    if not isinstance(task, dict):
        return False
    count = task.get("starts")
    if search.adaptive:  # which rounds are in it, only their lineage says
        return isinstance(count, int) or task.get("rounds") is not None
    return isinstance(count, int) and count < search.first


def _carry_over(old: Path, new: Path, formulation: Formulation) -> None:
    """Give the finished starts of the same problem a second name in another folder.

    Those that cannot be used get one too, so that `keep_starts` says so.
    """
    if old == new or not old.is_dir():
        return
    there = {index for index, _ in start_files(new)}
    for index, path in start_files(old):
        if index not in there and path.is_file() and not _is_other(path, formulation):
            _link(path, new / path.name)


def _is_other(path: Path, formulation: Formulation) -> bool:
    """True for starts that did not end, or are of another problem."""
    with suppress(InputError):
        start, origin = read_start(path)
        return origin is None or origin["sha256"] != formulation.identity.sha256 or start.status == RUNNING
    return False


def _link(path: Path, other: Path) -> None:
    try:
        os.link(path, other)
    except OSError:  # of a file system without links
        with writing(other), replacing(other, "wb") as stream:
            stream.write(path.read_bytes())
