"""The section of a campaign of partial motions."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from excite.design.campaign import Campaign, Step
from excite.files.stored import complete
from excite.report.sections import ReportCell, ReportSection, ReportTable, number


def campaign_of(content: Mapping[str, Any], path: Path) -> Campaign:
    """The campaign that the JSON of ``excite plan`` describes.

    Parameters
    ----------
    content : mapping
    path : Path
        For messages.

    Raises
    ------
    InputError
        Entries that are missing or of another kind.
    """
    with complete(path, "campaign"):
        steps = tuple(
            Step(_names(step["drives"]), int(step["rank"]), _names(step["expressions"]), _names(step["parameters"]))
            for step in content["steps"]
        )
        subsets = tuple((_names(drives), int(rank)) for drives, rank in content["subsets"])
        joints, rank = _names(content["joints"]), int(content["rank"])
        return Campaign(str(content["robot"]), joints, str(content["model"]), rank, steps, subsets)


def _names(given: Any) -> tuple[str, ...]:
    if not isinstance(given, list | tuple) or not all(isinstance(each, str) for each in given):
        raise TypeError(f"expected a list of names, given {given!r}")
    return tuple(given)


def campaign_section(campaign: Campaign) -> ReportSection:
    """Everything that a page says of a campaign.

    Parameters
    ----------
    campaign : Campaign
    """
    count = len(campaign.steps)
    motions = f"{count} motion{'s' * (count != 1)} identif{'y' if count != 1 else 'ies'}"
    joints = ", ".join(campaign.joints)
    return ReportSection(
        kind="campaign",
        title=f"campaign for {campaign.robot}",
        verdict=f"{motions} all {campaign.rank} parameters of the {campaign.model} model of joints {joints}.",
        holds=True,
        asked=(("robot", campaign.robot), ("model", campaign.model), ("joints", joints)),
        assumed=("drives that do not move hold their own coordinate, as brakes and position control do",),
        tables=(_steps(campaign), _selections(campaign)),
        commands=tuple(_design(campaign, number, step) for number, step in enumerate(campaign.steps, 1)),
    )


def _steps(campaign: Campaign) -> ReportTable:
    rows = tuple(
        (
            number(k), ReportCell(", ".join(step.drives)), number(step.rank), ReportCell("; ".join(step.expressions)),
            ReportCell(", ".join(step.parameters)),
        )
        for k, step in enumerate(campaign.steps, 1)
    )  # fmt: skip
    columns = ("motion", "drives that move", "combinations", "identifies", "newly identified individually")
    return ReportTable("Motions", columns, rows, name="steps")


def _selections(campaign: Campaign) -> ReportTable:
    rows = tuple((ReportCell(", ".join(drives)), number(rank)) for drives, rank in campaign.subsets)
    columns = ("drives", "combinations")
    return ReportTable("What each selection of drives identifies", columns, rows, name="subsets")


def _design(campaign: Campaign, number: int, step: Step) -> str:
    words = ["excite", "design", campaign.robot, "--model", campaign.model, "--drives", ",".join(step.drives)]
    return shlex.join([*words, "--out", f"designs/motion-{number}"])
