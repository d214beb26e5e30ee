"""The section of a campaign file's cells: all designs in one table."""

from __future__ import annotations

from excite.campaigns.campaign_table import BROKEN, DESIGNED, CampaignRow, CampaignTable
from excite.report.drawings import drawn
from excite.report.sections import ReportCell, ReportSection, ReportTable, number, percent

_REASONS = 20  # of cells without a design, as notes; the table has all


def campaign_table_section(table: CampaignTable, prefix: str) -> ReportSection:
    """Everything that a page says of the cells of a campaign."""
    from excite.plots.campaign_plot import campaign_figure

    made, told = table.counts.get(DESIGNED, 0), table.counts
    others = "".join(f"; {count} {status}" for status, count in told.items() if status != DESIGNED)
    figures, left_out = drawn({"Condition numbers by each option": lambda: campaign_figure(table)}, prefix)
    reasons = [f"{row.cell}: {row.status}: {row.reason}" for row in table.rows if row.reason]
    more = len(reasons) - _REASONS
    return ReportSection(
        kind="campaign",
        title=f"{len(table.rows)} cells of a campaign",
        verdict=f"{made} of {len(table.rows)} cells have a design within their limits{others}.",
        holds=table.holds,
        assumed=(
            "numbers are comparable within a group: the same robot, model, moving joints and base parameters",
            "criteria are in the reference base of each cell's own task, at its own rate",
            "limits of positions, velocities, accelerations and jerks were computed from the coefficients of each "
            "design when the table was made; criteria and other limits are those that the file of each design states",
        ),
        notes=(*reasons[:_REASONS], *([f"{more} more reasons are in the table"] if more > 0 else []), *left_out),
        tables=(_best(table), _cells(table)),
        figures=figures,
    )


def _best(table: CampaignTable) -> ReportTable:
    rows = tuple(
        (
            number(group), ReportCell(rows[0].cell), number(rows[0].condition, state="best"),
            number(rows[-1].condition), number(len(rows)),
        )
        for group, rows in table.groups.items()
    )  # fmt: skip
    columns = ("group", "best cell", "its condition number", "that of the worst", "cells")
    return ReportTable("The best of each group", columns, rows, name="campaign-best")


def _cells(table: CampaignTable) -> ReportTable:
    varied = table.varied
    columns = (
        "cell", *varied, "status", "group", "condition number", "criterion", "duration [s]", "tightest limit",
        "its use", "CPU [s]", "reason",
    )  # fmt: skip
    rows = tuple(_row(row, varied) for row in table.rows)
    return ReportTable("All cells", columns, rows, name="campaign-cells")


def _row(row: CampaignRow, varied: tuple[str, ...]) -> tuple[ReportCell, ...]:
    facts = row.facts
    return (
        ReportCell(row.cell), *(ReportCell(row.options.get(name, "")) for name in varied),
        ReportCell(row.status, state="" if row.status == DESIGNED else "bad"), number(row.group or None),
        number(row.condition, state="bad" if row.status == BROKEN else ""), number(facts.get("criterion")),
        number(facts.get("duration")), ReportCell(facts.get("tightest_limit") or "-"), percent(facts.get("limit_use")),
        number(facts.get("cpu_seconds")), ReportCell(row.reason),
    )  # fmt: skip
