"""What is shown of sweeps, the cells of a sweep file in one table, and of campaigns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

from excite.design.campaign import Campaign, Step
from excite.design.design import Design
from excite.design.sweeps.sweep_table import DESIGNED, KIND, TABLE, SweepRow, SweepTable
from excite.logs.log import counted
from excite.registry import name_of
from excite.views.view import Column, Drawing, Format, View, ViewTable, headed, texts
from regressors.models.partial import drive_names

_LEADING = 12  # rows of a summary
_REASONS = 5  # that stand alone; the table has all
_FACTS = attrgetter("criterion", "duration", "tightest_limit", "limit_use", "cpu_seconds")
_MOST_OPTIONS = 5  # as columns of a summary; of more, the name of the cell


def cells_view(table: SweepTable) -> View:
    """View of the cells of a sweep file."""
    counts = table.counts
    others = "".join(f"; {count} {status}" for status, count in counts.items() if status != DESIGNED)
    groups, leading = len(table.groups), leading_cells(table)
    more = len(table.rows) - len(leading.rows)
    elsewhere = f"{more} more cells are in {TABLE}"
    reasons = [f"{row.cell}: {row.status}: {row.reason}" for row in table.rows if row.reason]
    if len(reasons) > _REASONS:
        reasons[_REASONS:] = [f"{len(reasons) - _REASONS} more reasons are in the table"]
    alike = "all have the same robot, model and parameters"
    apart = f"{groups} groups; only cells of the same group have comparable numbers, at the top the best of each"
    return View(
        kind="campaign",
        title=f"{len(table.rows)} cells of a sweep",
        verdict=f"{counts.get(DESIGNED, 0)} of {len(table.rows)} cells have a design within their limits{others}.",
        holds=table.holds,
        summary=(*((alike if groups == 1 else apart,) if groups else ()), *((elsewhere,) if more else ())),
        against=tuple(reasons),
        remarks=(
            "numbers are comparable within a group: the same robot, model, moving joints and base parameters",
            "criteria are in the reference base of each cell's own task, at its own rate",
            "limits of positions, velocities, accelerations and jerks were computed from the coefficients of each "
            "design when the table was made; criteria and other limits are those that the file of each design states",
        ),
        tables=(*((leading,) if leading.rows else ()), _best(table), _all_cells(table)),
        figures=(Drawing("Condition numbers by each option", "campaign", "search_plot.sweep_figure", (table,)),),
        filed=KIND,
    )


def leading_cells(table: SweepTable) -> ViewTable:
    """The rows of a summary: the best cells of each group."""
    groups = table.groups
    chosen = [row for rows in groups.values() for row in rows[: max(1, _LEADING // len(groups))]][:_LEADING]
    rows = tuple(_cell(row, table.varied) for row in chosen)
    return ViewTable("campaign-leading", "The best cells", _columns(table), rows, folded=True, most=len(rows))


def _best(table: SweepTable) -> ViewTable:
    columns = headed("group, best cell:text, its condition number, that of the worst, cells")
    rows = tuple(
        (group, rows[0].cell, rows[0].condition, rows[-1].condition, len(rows)) for group, rows in table.groups.items()
    )
    return ViewTable("campaign-best", "The best of each group", columns, rows)


def _all_cells(table: SweepTable) -> ViewTable:
    columns = tuple(replace(each, brief=False) for each in _columns(table))
    return ViewTable("campaign-cells", "All cells", columns, tuple(_cell(row, table.varied) for row in table.rows))


def _columns(table: SweepTable) -> tuple[Column, ...]:
    often = table.often_varied if len(table.often_varied) <= _MOST_OPTIONS else ()
    return (
        *texts("cell", brief=not often),
        *(Column(name, Format.TEXT, brief=name in often) for name in table.varied),
        *headed("*status:text, *group, *cond(W):4, *criterion:4, *lasts [s], tightest limit:text, *limit used:%"),
        *headed("CPU [s], reason:text"),
    )


def _cell(row: SweepRow, varied: Sequence[str]) -> tuple[Any, ...]:
    options = (row.options.get(name, "") for name in varied)
    criterion, duration, tightest, use, seconds = (None,) * 5 if row.facts is None else _FACTS(row.facts)
    begin = (row.cell, *options, row.status, row.group or None, row.condition)
    return (*begin, criterion, duration, tightest or "-", use, seconds, row.reason)


def campaign_view(campaign: Campaign, designs: Sequence[Design] = ()) -> View:
    """View of a campaign of partial motions, and of those designs that move the drives of one of them."""
    made = [[each for each in designs if _is_of(each, campaign, step)] for step in campaign.steps]
    count, joints = len(campaign.steps), ", ".join(campaign.joints)
    most = max(len(step.drives) for step in campaign.steps)
    motions = f"{counted(count, 'motion')} of at most {counted(most, 'drive')}"
    return View(
        kind="campaign",
        title=f"campaign for {campaign.robot}",
        verdict=f"{motions} identif{'y' if count != 1 else 'ies'} all {campaign.rank} parameters of "
        f"{campaign.robot} ({campaign.model} model).{_designed(made) if designs else ''}",
        holds=all(_holds(each) for each in made if each) if any(made) else True,
        summary=(f"{len(campaign.subsets)} selections of drives were compared",),
        remarks=("drives that do not move hold their own coordinate, as brakes and position control do",),
        asked=(("robot", campaign.robot), ("model", campaign.model), ("joints", joints)),
        tables=(_steps(campaign), *_designs(campaign, made), _selections(campaign)),
    )


def designs_of(campaign: Campaign, designs: Sequence[Design]) -> list[Design]:
    """Designs of the motions of a campaign."""
    return [each for each in designs if any(_is_of(each, campaign, step) for step in campaign.steps)]


def _is_of(design: Design, campaign: Campaign, step: Step) -> bool:
    """Whether a design is for the robot, the model and the drives of a motion."""
    model = design.task.model
    alike = design.robot.name == campaign.robot and name_of(model.model) == campaign.model
    return alike and {_drive(design, each) for each in model.drives or ()} == set(step.drives)


def _drive(design: Design, given: str) -> str:
    """Name of a drive that is given by its name or its number."""
    names = drive_names(design.robot)
    return names[int(given) - 1] if given not in names and given.isdigit() and 0 < int(given) <= len(names) else given


def _holds(designs: Sequence[Design]) -> bool:
    return any(not design.broken for design in designs)


def _designed(made: Sequence[Sequence[Design]]) -> str:
    count = sum(bool(each) for each in made)
    broken = sum(not _holds(each) for each in made if each)
    end = f", of which {broken} break{'s' * (broken == 1)} limits" if broken else ""
    return f" {count} of them {'is' if count == 1 else 'are'} designed here{end}."


def _steps(campaign: Campaign) -> ViewTable:
    columns = headed(
        "*motion, *drives that move:text, *combinations, identifies:text, *newly identified individually:text"
    )
    rows = tuple(
        (k, ", ".join(step.drives), step.rank, "; ".join(step.expressions), ", ".join(step.parameters))
        for k, step in enumerate(campaign.steps, 1)
    )
    return ViewTable("steps", "Motions", columns, rows)


def _designs(campaign: Campaign, made: Sequence[Sequence[Design]]) -> tuple[ViewTable, ...]:
    columns = headed("motion, drives that move:text, design:text, condition number, duration [s], limits hold:kept")
    rows = tuple(
        (k, ", ".join(step.drives), d.name, d.condition_number, d.trajectory.duration, not d.broken)
        for k, (step, designs) in enumerate(zip(campaign.steps, made, strict=True), 1)
        for d in designs
    )
    return (ViewTable("motions-designed", "Designs of the motions", columns, rows),) if rows else ()


def _selections(campaign: Campaign) -> ViewTable:
    rows = tuple((", ".join(drives), rank) for drives, rank in campaign.subsets)
    return ViewTable("subsets", "What each selection of drives identifies", headed("drives:text, combinations"), rows)
