"""A grid of designs from the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from excite.cli.command import Command
from excite.cli.interrupts import one_interrupt
from excite.cli.literal_console import console
from excite.cli.option_types import Folder
from excite.cli.options import FigureChoice, executor_options, figure_options
from excite.cli.progress import progress_of_cells
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark, say
from excite.cli.summary import Summary
from excite.cli.view_text import brief_table, print_view
from excite.storage.result_folder import result_folder
from excite.sweeps.run_sweep import CellsLeft, run_sweep
from excite.sweeps.sweep_file import read_sweep_file
from excite.sweeps.sweep_table import JSON, TABLE, SweepTable, load_sweep
from excite.views.campaign_view import cells_view, leading_cells

_PAGE = "campaign.html"


@dataclass(frozen=True)
class SweepRun:
    """What a run has left."""

    table: SweepTable
    files: tuple[Path, ...]
    interrupted: bool = False


def run_and_write(
    file: Path, out: Path, *, executor: str, workers: int | None, figures: FigureChoice, report: bool, force: bool
) -> SweepRun:
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
            interrupted, table = True, _saved(out)
            say("excite: interrupted; finished cells are saved, and the same command continues with the others")
        files = _write(table, out, figures, report=report and not interrupted)
    return SweepRun(table, files, interrupted)


def _saved(out: Path) -> SweepTable:
    """The table of a run that was interrupted; before there was any, the interruption goes on."""
    if not (out / "campaign.json").exists():
        raise KeyboardInterrupt
    return load_sweep(out)


def _write(table: SweepTable, out: Path, figures: FigureChoice, *, report: bool) -> tuple[Path, ...]:
    files = [out / TABLE, out / JSON]
    if figures:
        from excite.plots import write_figures

        tell("drawing")
        files += write_figures(table, out, **figures.how)
    if report:
        from excite.report.write_report import write_report

        tell("writing the page")
        files.append(write_report(table, out / _PAGE, replace=True))
    return tuple(files)


def sweep_summary(table: SweepTable, files: Sequence[Path], out: Path) -> Summary:
    """The verdict, the best cells of every group, and the first reasons of those without a design."""
    view, leading = cells_view(table), leading_cells(table)
    options = sum(column.brief for column in leading.columns[: 1 + len(table.varied)])
    more = len(table.rows) - len(leading.rows)
    return Summary(
        verdict=view.verdict,
        holds=view.holds,
        facts=[
            *view.summary,
            *brief_table(leading, left=1 + options, most=len(leading.rows)),
            *([f"{more} more cells: {out / TABLE}"] * (more > 0)),
        ],
        notes=view.against,
        files=files,
        next_steps=[_next(table, out)],
        all_in=str(out / TABLE),
    )


def _next(table: SweepTable, out: Path) -> str:
    best = next((row.cell for rows in table.groups.values() for row in rows), None)
    if best is None:
        return f"read the reasons in {out / TABLE}, and change the file"
    return f"excite report {out} --out campaign.html; each cell is a design: {out / 'cells' / best}"


def print_sweep(table: SweepTable, files: Sequence[Path]) -> None:
    """Print every cell."""
    print_view(cells_view(table))
    console().print(f"written: {', '.join(map(str, files))}", soft_wrap=True)


_GROUPS = {"Execution": ("executor", "workers")}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="run",
    epilog="""\b
Examples:
  excite sweep run sweep.yaml --out sweeps/arms
  excite sweep run sweep.yaml --out sweeps/arms --report --figures svg
  excite sweep run sweep.yaml --out sweeps/arms --executor dask://10.0.0.1:8786

\b
Contents of FILE (YAML; options are the keys of a task file, see --task of 'excite design'):
  common: {starts: 4, harmonics: 5}                  options of every cell
  grid:                                              every combination of these is a cell
    robot: [irp6, panda]
    trajectory: [fourier, cosine]
    limits: {slow: {velocity: 0.5}, fast: {velocity: 1.0}}    labels of long values
    seed: [0, 1, 2]
  exclude: [{robot: panda, limits: slow}]            combinations that are left out
  include: [{robot: ur10e, limits: {acceleration: 3}}]        further cells

\b
What is written to DIR:
  cells/NAME     of every cell, such as robot=irp6,seed=0, an ordinary folder of a design
  campaign.csv   one line per cell: options, status, every criterion, tightest limit, time; campaign.json likewise
  campaign.png   the condition numbers by each option
  campaign.html  with --report

\b
Cells run on all cores, each with its starts one after the other. The same command again continues where it stopped.
Exit status: 0 every cell has a design within its limits; 1 at least one has not, and the table says why.""",
)
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@executor_options("Where the cells run.", "Number of processes.  [default: one per core]")
@figure_options()
@click.option("--report", is_flag=True, help="Write campaign.html too: table and figure as one page.")
@click.option("--force", is_flag=True, help="Replace cells of the same names that have other options.")
def command(
    file: Path, out: Path, executor: str, workers: int | None, figures: FigureChoice, report: bool, force: bool
) -> None:
    """Design every cell of the sweep FILE, or those that are left, and write all of them in one table."""
    import sys

    from excite.cli.interrupts import interrupted_status
    from excite.cli.main import NOT_HELD
    from excite.cli.summary import show
    from excite.storage.records import json_of

    ran = run_and_write(file, out, executor=executor, workers=workers, figures=figures, report=report, force=force)
    show(
        sweep_summary(ran.table, ran.files, out),
        lambda: {"out": str(out), "counts": ran.table.counts, **json_of(ran.table)},
        lambda: print_sweep(ran.table, ran.files),
    )
    if ran.interrupted:
        sys.exit(interrupted_status())
    sys.exit(0 if ran.table.holds else NOT_HELD)
