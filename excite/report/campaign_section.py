"""The section of a campaign of partial motions."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from excite.design.campaign import Campaign, Step
from excite.design.designed_motion import DesignedMotion
from excite.registry import name_of
from excite.report.sections import ReportCell, ReportSection, ReportTable, kept, number
from excite.storage.records import complete
from regressors.models.partial import drive_names


def campaign_of(content: Mapping[str, Any], path: Path) -> Campaign:
    """The campaign that the JSON of ``excite plan`` describes."""
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


def campaign_section(campaign: Campaign, designs: Sequence[DesignedMotion] = ()) -> ReportSection:
    """Everything that a page says of a campaign."""
    made = [[each for each in designs if _is_of(each, campaign, step)] for step in campaign.steps]
    count = len(campaign.steps)
    motions = f"{count} motion{'s' * (count != 1)} identif{'y' if count != 1 else 'ies'}"
    joints = ", ".join(campaign.joints)
    what = f"all {campaign.rank} parameters of the {campaign.model} model of joints {joints}"
    return ReportSection(
        kind="campaign",
        title=f"campaign for {campaign.robot}",
        verdict=f"{motions} {what}.{_designed(made) if designs else ''}",
        holds=all(_holds(each) for each in made if each) if any(made) else True,
        asked=(("robot", campaign.robot), ("model", campaign.model), ("joints", joints)),
        assumed=("drives that do not move hold their own coordinate, as brakes and position control do",),
        tables=(_steps(campaign), *_designs(campaign, made), _selections(campaign)),
        commands=tuple(_design(campaign, number, step) for number, step in enumerate(campaign.steps, 1)),
    )


def designs_of(campaign: Campaign, designs: Sequence[DesignedMotion]) -> list[DesignedMotion]:
    """Designs of the motions of a campaign."""
    return [each for each in designs if any(_is_of(each, campaign, step) for step in campaign.steps)]


def _is_of(design: DesignedMotion, campaign: Campaign, step: Step) -> bool:
    """Whether a design is for the robot, the model and the drives of a motion."""
    model = design.task.model
    alike = design.robot.name == campaign.robot and name_of(model.model) == campaign.model
    return alike and {_drive(design, each) for each in model.drives or ()} == set(step.drives)


def _drive(design: DesignedMotion, given: str) -> str:
    """Name of a drive that is given by its name or its number."""
    names = drive_names(design.robot)
    return names[int(given) - 1] if given not in names and given.isdigit() and 0 < int(given) <= len(names) else given


def _holds(designs: Sequence[DesignedMotion]) -> bool:
    return any(not design.broken for design in designs)


def _designed(made: Sequence[Sequence[DesignedMotion]]) -> str:
    count = sum(bool(each) for each in made)
    broken = sum(not _holds(each) for each in made if each)
    end = f", of which {broken} break{'s' * (broken == 1)} limits" if broken else ""
    return f" {count} of them {'is' if count == 1 else 'are'} designed here{end}."


def _designs(campaign: Campaign, made: Sequence[Sequence[DesignedMotion]]) -> tuple[ReportTable, ...]:
    rows = tuple(
        (
            number(k), ReportCell(", ".join(step.drives)), ReportCell(design.name),
            number(design.condition_number), number(design.trajectory.duration), kept(not design.broken),
        )
        for k, (step, designs) in enumerate(zip(campaign.steps, made, strict=True), 1) for design in designs
    )  # fmt: skip
    columns = ("motion", "drives that move", "design", "condition number", "duration [s]", "limits hold")
    return (ReportTable("Designs of the motions", columns, rows, name="motions-designed"),) if rows else ()


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
