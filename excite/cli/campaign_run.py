"""Execution of ``excite campaign run``: design the cells that are left, write table, figure and page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from excite.campaigns.campaign_file import read_campaign_file
from excite.campaigns.campaign_table import CampaignTable, load_campaign
from excite.campaigns.run_campaign import CellsLeft, run_campaign
from excite.cli.figure_options import FigureChoice
from excite.cli.interrupts import one_interrupt
from excite.cli.progress import progress_of_cells
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark, say
from excite.storage.result_folder import result_folder

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
    from excite.campaigns.campaign_table import JSON, TABLE

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
