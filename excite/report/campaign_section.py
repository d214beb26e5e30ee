"""The sections of campaigns: of the cells of a campaign file, and of partial motions."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from excite.design.campaign import Campaign, Step
from excite.design.designed_motion import DesignedMotion
from excite.report.drawings import drawn
from excite.report.sections import ReportSection
from excite.report.view_section import section_of
from excite.storage.codec import record_of
from excite.sweeps.sweep_table import SweepTable
from excite.views.campaign_view import campaign_view, cells_view
from regressors.errors import InputError

_REASONS = 20  # of cells without a design, as notes; the table has all


def cells_section(table: SweepTable, prefix: str) -> ReportSection:
    """Everything that a page says of the cells of a campaign; identifiers of its figures begin with the prefix."""
    view = cells_view(table)
    more = len(view.against) - _REASONS
    reasons = (*view.against[:_REASONS], *([f"{more} more reasons are in the table"] if more > 0 else []))
    return section_of(replace(view, against=reasons), "campaign", *drawn(view.figures, prefix))


def campaign_of(content: Mapping[str, Any], path: Path) -> Campaign:
    """The campaign that the JSON of ``excite plan`` describes."""
    try:
        return record_of(Campaign, content, {})
    except InputError as error:
        raise InputError(f"{path}: not a complete campaign: {error}") from error


def campaign_section(campaign: Campaign, designs: Sequence[DesignedMotion] = ()) -> ReportSection:
    """Everything that a page says of a campaign; designs of the page that move drives of its motions are listed."""
    commands = tuple(_design(campaign, number, step) for number, step in enumerate(campaign.steps, 1))
    return replace(section_of(campaign_view(campaign, designs), "campaign", ()), commands=commands)


def _design(campaign: Campaign, number: int, step: Step) -> str:
    words = ["excite", "design", campaign.robot, "--model", campaign.model, "--drives", ",".join(step.drives)]
    return shlex.join([*words, "--out", f"designs/motion-{number}"])
