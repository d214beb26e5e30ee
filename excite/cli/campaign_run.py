"""Execution of ``excite campaign run``: design the cells that are left, write table, figure and page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from excite.campaigns.campaign_file import read_campaign_file
from excite.campaigns.campaign_table import JSON, TABLE, CampaignTable, load_campaign
from excite.campaigns.run_campaign import CellsLeft, run_campaign
from excite.cli.interrupts import one_interrupt
from excite.cli.literal_console import console
from excite.cli.options import FigureChoice
from excite.cli.progress import progress_of_cells
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark, say
from excite.cli.summary import Summary
from excite.cli.view_text import brief_table, print_view
from excite.storage.result_folder import result_folder
from excite.views.campaign_view import cells_view, leading_cells

_PAGE = "campaign.html"


@dataclass(frozen=True)
class CampaignRun:
    """What a run has left."""

    table: CampaignTable
    files: tuple[Path, ...]
    interrupted: bool = False


def run_and_write(
    file: Path, out: Path, *, executor: str, workers: int | None, figures: FigureChoice, report: bool, force: bool
) -> CampaignRun:
    """Design the cells of a campaign file that are left; write the table, the figure and the page of all."""
    tell("reading the campaign")
    cells = read_campaign_file(file)
    interrupted = False
    with result_folder(out), one_interrupt() as interruption:
        try:
            with progress_of_cells() as (begin, progress):

                def left(todo: CellsLeft) -> None:
                    if todo.done:
                        count = len(todo.done) + len(todo.work)
                        remark(f"excite: {len(todo.done)} of {count} cells are already done in {out}")
                    begin(len(todo.done), len(todo.work))

                table = run_campaign(
                    cells, out, executor=executor, workers=workers, replace=force, progress=progress, left=left
                )
        except KeyboardInterrupt:
            interruption.caught()
            interrupted, table = True, _saved(out)
            say("excite: interrupted; finished cells are saved, and the same command continues with the others")
        files = _write(table, out, figures, report=report and not interrupted)
    return CampaignRun(table, files, interrupted)


def _saved(out: Path) -> CampaignTable:
    """The table of a run that was interrupted; before there was any, the interruption goes on."""
    if not (out / "campaign.json").exists():
        raise KeyboardInterrupt
    return load_campaign(out)


def _write(table: CampaignTable, out: Path, figures: FigureChoice, *, report: bool) -> tuple[Path, ...]:
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


def campaign_summary(table: CampaignTable, files: Sequence[Path], out: Path) -> Summary:
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


def _next(table: CampaignTable, out: Path) -> str:
    best = next((row.cell for rows in table.groups.values() for row in rows), None)
    if best is None:
        return f"read the reasons in {out / TABLE}, and change the file"
    return f"excite report {out} --out campaign.html; each cell is a design: {out / 'cells' / best}"


def print_campaign(table: CampaignTable, files: Sequence[Path]) -> None:
    """Print every cell."""
    print_view(cells_view(table))
    console().print(f"written: {', '.join(map(str, files))}", soft_wrap=True)
