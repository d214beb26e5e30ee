"""What ``excite campaign run`` prints at its end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from excite.campaigns.campaign_table import DESIGNED, TABLE, CampaignRow, CampaignTable
from excite.cli.summary import Summary, compact_table

_ROWS = 12
_MOST_OPTIONS = 5  # as columns of their own; of more, the name of the cell
_HEADINGS = ("group", "cond(W)", "criterion", "lasts", "limit used", "status")


def campaign_summary(table: CampaignTable, files: Sequence[Path], out: Path) -> Summary:
    """The verdict, the best cells of every group, and the first reasons of those without a design."""
    made = table.counts.get(DESIGNED, 0)
    groups = table.groups
    told = ", ".join(f"{count} {status}" for status, count in table.counts.items() if status != DESIGNED)
    verdict = f"{made} of {len(table.rows)} cells designed within their limits{f'; {told}' if told else ''}"
    alike = "all have the same robot, model and parameters" if len(groups) == 1 else ""
    apart = f"{len(groups)} groups; only cells of the same group have comparable numbers, at the top the best of each"
    shown = [row for rows in groups.values() for row in rows[: max(1, _ROWS // len(groups))]][:_ROWS]
    options = table.often_varied if len(table.often_varied) <= _MOST_OPTIONS else ()
    rows = [(*_place(row, options), *_numbers(row)) for row in shown]
    best = compact_table(*(options or ("cell",)), *_HEADINGS, rows=rows, left=max(1, len(options)), most=_ROWS)
    more = len(table.rows) - len(shown)
    return Summary(
        verdict=verdict,
        holds=table.holds,
        facts=[*([alike or apart] * bool(groups)), *best, *([f"{more} more cells: {out / TABLE}"] * (more > 0))],
        notes=[f"{row.cell}: {row.status}: {row.reason}" for row in table.rows if row.reason],
        files=files,
        next_steps=[_next(table, out)],
        all_in=str(out / TABLE),
    )


def print_campaign(table: CampaignTable, files: Sequence[Path]) -> None:
    """Print every cell."""
    from rich.table import Table

    from excite.cli.literal_console import console

    out = console()
    whole = Table()
    for heading in ("cell", *_HEADINGS):
        whole.add_column(heading, overflow="fold")
    for row in table.rows:
        whole.add_row(row.cell, *_numbers(row))
    out.print(whole)
    for row in table.rows:
        if row.reason:
            out.print(f"note: {row.cell}: {row.status}: {row.reason}", soft_wrap=True)
    out.print(f"written: {', '.join(map(str, files))}", soft_wrap=True)


def _place(row: CampaignRow, options: Sequence[str]) -> tuple[str, ...]:
    return tuple(row.options.get(name, "-") for name in options) or (row.cell,)


def _numbers(row: CampaignRow) -> tuple[str, ...]:
    if not row.group:
        return ("-", "-", "-", "-", "-", row.status)
    facts = row.facts
    criterion, use = facts["criterion"], facts["limit_use"]
    return (
        str(row.group), f"{row.condition:.4g}", "-" if criterion is None else f"{criterion:.4g}",
        f"{facts['duration']:g} s", "-" if use is None else f"{100 * use:.1f} %", row.status,
    )  # fmt: skip


def _next(table: CampaignTable, out: Path) -> str:
    best = next((row.cell for rows in table.groups.values() for row in rows), None)
    if best is None:
        return f"read the reasons in {out / TABLE}, and change the file"
    return f"excite report {out} --out campaign.html; each cell is a design: {out / 'cells' / best}"
