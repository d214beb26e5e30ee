"""Execution of ``excite design``: find the motion, write its files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

from excite.cli.interrupts import one_interrupt
from excite.cli.messages import in_options
from excite.cli.options import FigureChoice
from excite.cli.progress import progress_of_starts
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark, verbosity
from excite.design.design import Design
from excite.design.design_folder import (
    check_no_design,
    data_files,
    figure_files,
    seeks_precision,
    write_design,
    write_starts,
)
from excite.design.formulation import Formulation, formulate
from excite.design.kept_starts import KeptStarts, keep_starts
from excite.design.multistart import ready_workers
from excite.design.optimisation import announce_search, solve, starts_left
from excite.design.resumed_search import holds_unfinished_design, resume_search
from excite.design.search_rounds import design_with_harmonics
from excite.storage.atomic import writing
from excite.storage.result_folder import result_folder
from excite.study.design_for_precision import search_for_precision
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.robot.robot import Robot

_SearchUntil = Callable[[Callable[[], None]], Design]  # of what is called when only saving remains
PERIODS = "periods"  # folder of the searches at each period that a precision takes


def design_and_write(
    task: Task, out: Path, notes: tuple[str, ...], *, figures: FigureChoice, force: bool, fresh: bool
) -> tuple[Design, list[Path]]:
    """Find the best motion for a task, and write its files as soon as it is found."""
    tell("setting up the problem")
    robot = installed_robot(task)
    with result_folder(out):
        names = [*data_files(task), *figure_files(task, figures.formats)]
        check_no_design(out, names, replace=force or holds_unfinished_design(out))
        if seeks_precision(task):
            begin = _precision_search(robot, task, out, notes, force=force, fresh=fresh)
        elif task.trajectory.grows:
            begin = _harmonics_search(robot, task, out, notes, force=force, fresh=fresh)
        else:
            formulation = formulate(robot, task)
            kept = resume_search(out, formulation, replace=force, fresh=fresh)
            _print_what_is_known(formulation, kept, notes)
            begin = _plain_search(robot, formulation, kept)
        tell("looking for the best motion")
        with one_interrupt() as interruption:
            design = begin(interruption.ignore)
            interruption.ignore()
            tell("writing and drawing")
            files = write_design(design, out, figures.formats)
            if figures:
                from excite.views.figures import write_figures

                files = [*write_figures(design, out, **figures.how), *files]
    return design, files


@contextmanager
def _nothing_left(kept: KeptStarts) -> Iterator[None]:
    """Remove the folder of starts where there is none since the executor cannot be used."""
    try:
        yield
    except InputError:
        with suppress(OSError):
            kept.folder.rmdir()
        raise


def _plain_search(robot: Robot, formulation: Formulation, kept: KeptStarts) -> _SearchUntil:
    def begin(at_end: Callable[[], None]) -> Design:
        ready = ready_workers(formulation) if starts_left(kept) else nullcontext()
        with ready, progress_of_starts(kept) as progress, _nothing_left(kept):
            return solve(robot, formulation, kept, progress, at_end=at_end)

    return begin


def _harmonics_search(
    robot: Robot, task: Task, out: Path, notes: tuple[str, ...], *, force: bool, fresh: bool
) -> _SearchUntil:
    """A search that chooses the number of harmonics; only the first of its numbers continues an earlier run."""

    def prepared(formulation: Formulation, other: bool) -> KeptStarts:
        kept = resume_search(out, formulation, replace=force, fresh=fresh or other)
        if not other:
            _print_what_is_known(formulation, kept, notes)
        return kept

    def solved(formulation: Formulation, kept: KeptStarts) -> Design:
        tell(f"looking for the best motion of {formulation.task.trajectory.harmonics} harmonics")
        return _plain_search(robot, formulation, kept)(lambda: None)

    return lambda _: design_with_harmonics(robot, task, prepared, solved)


def _precision_search(
    robot: Robot, task: Task, out: Path, notes: tuple[str, ...], *, force: bool, fresh: bool
) -> _SearchUntil:
    """A search for the shortest experiment; every search that an earlier run has finished is taken from its folder."""
    for note in notes:
        remark(f"excite: note: {in_options(note)}")

    def prepared(formulation: Formulation, name: str) -> KeptStarts:
        starts = out / PERIODS / name
        with writing(starts):
            starts.mkdir(parents=True, exist_ok=True)
        try:
            return keep_starts(starts, formulation, fresh=fresh)
        except InputError:
            if not force:
                raise
            return keep_starts(starts, formulation, fresh=True)

    def solved(formulation: Formulation, kept: KeptStarts) -> Design:
        tell(f"looking for the best motion of {formulation.task.trajectory.period:g} s")
        if verbosity().verbose:
            return _plain_search(robot, formulation, kept)(lambda: None)
        with ready_workers(formulation) if starts_left(kept) else nullcontext(), _nothing_left(kept):
            return solve(robot, formulation, kept)

    def begin(at_end: Callable[[], None]) -> Design:
        design = search_for_precision(robot, task, prepared, solved, lambda text: remark(f"excite: {in_options(text)}"))
        at_end()
        write_starts(design, out)
        return design

    return begin


def _print_what_is_known(formulation: Formulation, kept: KeptStarts, notes: tuple[str, ...]) -> None:
    """Print on stderr what was assumed, what an earlier run has left, and how long the search will take."""
    for note in (*notes, *formulation.notes):
        remark(f"excite: note: {in_options(note)}")
    for found in kept.notes:
        remark(f"excite: {found}")
    announce_search(formulation, kept)
