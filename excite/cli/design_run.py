"""Execution of ``excite design`` and ``sweep``: find motions and write their files."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

import excite
from excite.cli.main import NOT_HELD
from excite.cli.options import FigureChoice, robot_file_of, split_base, typed_options
from excite.cli.progress import bar, interrupted_status, one_interrupt
from excite.cli.streams import can_move, in_options, remark, say, something_is_shown, tell, verbosity
from excite.cli.summary import show
from excite.design.design import Design
from excite.design.design_folder import (
    check_no_design,
    data_files,
    figure_files,
    seeks_precision,
    shown_content,
    write_design,
    write_starts,
)
from excite.design.design_json import load_design
from excite.design.formulation import Formulation, formulate
from excite.design.multistart import holds_unfinished_design, ready_workers, resume_search
from excite.design.optimisation import announce_search, solve, starts_left
from excite.design.search_rounds import design_with_harmonics
from excite.design.start_results import StartResult
from excite.design.starts import KeptStarts, keep_starts
from excite.design.sweeps.run_sweep import CellProgress, CellsLeft, read_sweep_file, run_sweep
from excite.design.sweeps.sweep_table import JSON, TABLE, SweepTable, load_sweep
from excite.design.task_file import read_task_file, task_from_options
from excite.registry import CONVENTIONS
from excite.storage.atomic import writing
from excite.storage.records import json_of
from excite.storage.result_folder import result_folder
from excite.tasks.limit_choice import OF_JOINTS
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import Task
from excite.views.campaign_view import cells_view
from excite.views.design_view import design_view
from regressors.errors import InputError
from regressors.readers.library import has_tree
from regressors.robot.robot import Robot

_AtEnd = Callable[[], None]  # called when only saving remains
_SearchUntil = Callable[[_AtEnd], Design]


_BASE_TOO = "--base-link names the first link of a chain; --base still takes it too"
_NEXT = (
    "play trajectory.csv several times at full speed (rehearse it slowly first), record joint positions and {}; "
    "compare candidates with excite compare DIR..."
)
_NEXT_RUNS = "play trajectory.csv {} (rehearse it slowly first), and identify from that log"


def design_from_options(robot: str, out: Path, **given: Any) -> None:
    """Find the motion for the options of a command, write its files and show it; end with the exit status."""
    task = _task(robot, given["task_file"], given["parts"])
    notes = () if split_base(given["base"])[1] is None else (_BASE_TOO,)
    figures, force, fresh = given["figures"], given["force"], given["fresh"]
    tell("setting up the problem")
    described = installed_robot(task)
    with result_folder(out):
        names = [*data_files(task), *figure_files(task, figures.formats)]
        check_no_design(out, names, replace=force or holds_unfinished_design(out))
        if seeks_precision(task):
            begin = _precision_search(described, task, out, notes, force=force, fresh=fresh)
        elif task.trajectory.grows:
            begin = _harmonics_search(described, task, out, notes, force=force, fresh=fresh)
        else:
            formulation = formulate(described, task)
            kept = resume_search(out, formulation, replace=force, fresh=fresh)
            _print_what_is_known(formulation, kept, notes)
            begin = partial(_solved, described, formulation, kept)
        tell("looking for the best motion")
        with one_interrupt() as interruption:
            design = begin(interruption.ignore)
            interruption.ignore()
            tell("writing")
            files = write_design(design, out, figures.formats)
            runs = None if design.precision is None else design.precision.runs
            measured = "commands" if design.task.model.channel == "command" else "torques"
            times = "once" if runs == 1 else f"{runs} times in one recording"
            show(
                design_view(design),
                lambda: [*figures.write(design, out), *files],
                content=lambda: {"out": str(out), **shown_content(design)},
                next_steps=[_NEXT.format(measured) if runs is None else _NEXT_RUNS.format(times)],
                all_in="design.json",
            )
    sys.exit(_status(design))


def _task(robot: str, task_file: Path | None, parts: tuple[str, ...]) -> Task:
    """The task of a file and of options, which win over it."""
    ctx = click.get_current_context()
    filed = read_task_file(task_file) if task_file else {}
    typed = {name: value for name, value in typed_options().items() if name != "base"}
    typed |= robot_file_of(ctx.params)
    if ctx.get_parameter_source("base") is not ParameterSource.DEFAULT:
        convention, link = split_base(ctx.params["base"])
        typed |= {"base": convention} if convention else {}
        typed |= {"base_link": link} if link else {}
    limits = {name: typed.pop(name) for name in OF_JOINTS if name in typed}
    options = {**filed, **typed, "limits": {**filed.get("limits", {}), **limits}, "robot": robot}
    folder = options.get("begin")  # its parts may be imported where they are named; else the folder will do
    task = task_from_options(options, begin=load_design(folder, parts) if folder is not None and parts else None)
    if task.base_link is not None and not has_tree(robot):
        raise click.UsageError(
            f"--base {task.base_link!r}: expected one of {', '.join(CONVENTIONS)}, or the base link of a URDF, a xacro "
            "or an MJCF"
        )
    return task


def _status(design: Design) -> int:
    if design.interrupted:
        say("excite: interrupted; the best feasible motion so far is saved")
        return interrupted_status()
    met = design.precision is None or design.precision.met
    return 0 if design.feasible and met else NOT_HELD


def _solved(
    robot: Robot, formulation: Formulation, kept: KeptStarts, at_end: _AtEnd = lambda: None, *, in_silence: bool = False
) -> Design:
    """The design that the starts of a problem come to."""
    ready = ready_workers(formulation) if starts_left(kept) else nullcontext()
    shown = nullcontext() if in_silence else progress_of_starts(kept)
    with ready, shown as progress:
        try:
            return solve(robot, formulation, kept, progress, at_end=at_end)
        except InputError:  # the executor cannot be used, so that there is no start
            with suppress(OSError):
                kept.folder.rmdir()
            raise


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
        return _solved(robot, formulation, kept)

    return lambda _: design_with_harmonics(robot, task, prepared, solved)


def _precision_search(
    robot: Robot, task: Task, out: Path, notes: tuple[str, ...], *, force: bool, fresh: bool
) -> _SearchUntil:
    """A search for the shortest experiment; every search that an earlier run has finished is taken from its folder."""
    from excite.study.design_for_precision import search_for_precision

    for note in notes:
        remark(f"excite: note: {in_options(note)}")

    def prepared(formulation: Formulation, name: str) -> KeptStarts:
        starts = out / "periods" / name
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
        return _solved(robot, formulation, kept, in_silence=not verbosity().verbose)

    def begin(at_end: _AtEnd) -> Design:
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


def run_and_write(
    file: Path, out: Path, executor: str, workers: int | None, figures: FigureChoice, report: bool, force: bool
) -> None:
    """Design the cells of a sweep file that are left; write the table, the figure and the page of all."""
    tell("reading the sweep")
    cells = read_sweep_file(file)
    interrupted = False
    with result_folder(out), one_interrupt() as interruption:
        try:
            with progress_of_cells() as (begin, progress):

                def left(todo: CellsLeft) -> None:
                    if todo.done:
                        count = len(todo.done) + len(todo.work)
                        remark(f"excite: {len(todo.done)} of {count} cells are already done in {out}")
                    begin(len(todo.done), len(todo.work))

                table = run_sweep(
                    cells, out, executor=executor, workers=workers, replace=force, progress=progress, left=left
                )
        except KeyboardInterrupt:
            interruption.caught()
            if not (out / JSON).exists():
                raise  # before there was any table
            interrupted, table = True, load_sweep(out)
            say("excite: interrupted; finished cells are saved, and the same command continues with the others")
        files = [out / TABLE, out / JSON, *figures.write(table, out)]
        if report and not interrupted:
            tell("writing the page")
            files.append(excite.write_report(table, out / "campaign.html", replace=True))
    show_sweep(table, files, out)
    sys.exit(interrupted_status() if interrupted else 0 if table.holds else NOT_HELD)


def show_sweep(table: SweepTable, files: Sequence[Path], out: Path) -> None:
    """Show the best cells of every group, and the first reasons of those without a design; or every cell."""
    show(
        cells_view(table),
        files,
        content=lambda: {"out": str(out), "counts": table.counts, **json_of(table)},
        next_steps=[_next(table, out)],
        all_in=str(out / TABLE),
    )


def _next(table: SweepTable, out: Path) -> str:
    best = next((row.cell for rows in table.groups.values() for row in rows), None)
    if best is None:
        return f"read the reasons in {out / TABLE}, and change the file"
    return f"excite report {out} --out campaign.html; each cell is a design: {out / 'cells' / best}"


_MANY = 100  # starts above which a line comes before the first of them has ended
_BETWEEN = 2.0  # seconds between two lines on cells


@contextmanager
def progress_of_starts(kept: KeptStarts) -> Iterator[Callable[[StartResult], None]]:
    """Report finished starts and the best value so far."""
    if verbosity().quiet:
        yield lambda _: None
    elif verbosity().verbose or not can_move(sys.stderr):
        yield _lines(kept)
    else:
        best, done = kept.best, len(kept.done)
        text, shown = "starts, best {task.fields[best]}", f"{best:.4g}" if done else "-"
        with bar(text, total=kept.count, completed=done, best=shown) as update:

            def report(result: StartResult) -> None:
                nonlocal best
                best = min(best, result.value)
                update(advance=1, best=f"{best:.4g}")

            yield report


def _lines(kept: KeptStarts) -> Callable[[StartResult], None]:
    total, best, done = kept.count, kept.best, len(kept.done)
    of_all = f" of {total}" if total is not None else ""
    if total is not None and total - done > _MANY:
        say(f"excite: {total - done} starts to run")

    def report(result: StartResult) -> None:
        nonlocal best, done
        done += 1
        better = result.value < best
        best = min(best, result.value)
        if verbosity().verbose:
            say(f"start {done}{of_all}: {result.value:.4g} in {result.cpu:.1f} s, {result.status}; best {best:.4g}")
        elif better:
            something_is_shown()
            say(f"start {done}{of_all}: best so far {best:.4g}")

    return report


@contextmanager
def progress_of_cells() -> Iterator[tuple[Callable[[int, int], None], Callable[[CellProgress], None]]]:
    """Report finished cells of a campaign, in lines at most every two seconds where there is no terminal."""
    if verbosity().quiet:
        yield (lambda _, __: None), (lambda _: None)
    elif verbosity().verbose or not can_move(sys.stderr):
        yield (lambda _, left: say(f"excite: {left} cells to run") if left else None), _lines_of_cells()
    else:
        with bar("cells, last {task.fields[last]}", remaining=True, total=None, last="-") as update:
            yield (
                lambda done, left: update(total=done + left, completed=done),
                lambda ended: update(completed=ended.done, last=_of_cell(ended)),
            )


def _of_cell(ended: CellProgress) -> str:
    return f"{ended.cell}: {ended.status}" if ended.status else f"{ended.cell}: {ended.condition or math.inf:.4g}"


def _lines_of_cells() -> Callable[[CellProgress], None]:
    shown = 0.0

    def report(ended: CellProgress) -> None:
        nonlocal shown
        now = time.monotonic()
        if verbosity().verbose or now - shown > _BETWEEN or ended.done == ended.total:
            shown = now
            something_is_shown()
            because = f", {ended.reason}" if ended.reason and verbosity().verbose else ""
            say(f"cell {ended.done} of {ended.total}: {_of_cell(ended)}{because}")

    return report
