"""A grid of designs from the command line."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import excite
from excite.cli.interrupts import interrupted_status, one_interrupt
from excite.cli.main import NOT_HELD
from excite.cli.options import FigureChoice
from excite.cli.progress import progress_of_cells
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark, say
from excite.cli.view_text import brief_table, show_view
from excite.design.sweeps.run_sweep import CellsLeft, read_sweep_file, run_sweep
from excite.design.sweeps.sweep_table import JSON, TABLE, SweepTable, load_sweep
from excite.storage.records import json_of
from excite.storage.result_folder import result_folder
from excite.views.campaign_view import cells_view, leading_cells

_PAGE = "campaign.html"


def run_and_write(
    file: Path, out: Path, *, executor: str, workers: int | None, figures: FigureChoice, report: bool, force: bool
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
            files.append(excite.write_report(table, out / _PAGE, replace=True))
    show_sweep(table, files, out)
    sys.exit(interrupted_status() if interrupted else 0 if table.holds else NOT_HELD)


def show_sweep(table: SweepTable, files: Sequence[Path], out: Path) -> None:
    """Show the best cells of every group, and the first reasons of those without a design; or every cell."""
    view, leading = cells_view(table), leading_cells(table)
    more = len(table.rows) - len(leading.rows)
    show_view(
        view,
        files,
        content=lambda: {"out": str(out), "counts": table.counts, **json_of(table)},
        facts=[
            *view.summary,
            *brief_table(leading, most=len(leading.rows)),
            *([f"{more} more cells: {out / TABLE}"] * (more > 0)),
        ],
        notes=view.against,
        next_steps=[_next(table, out)],
        all_in=str(out / TABLE),
    )


def _next(table: SweepTable, out: Path) -> str:
    best = next((row.cell for rows in table.groups.values() for row in rows), None)
    if best is None:
        return f"read the reasons in {out / TABLE}, and change the file"
    return f"excite report {out} --out campaign.html; each cell is a design: {out / 'cells' / best}"
