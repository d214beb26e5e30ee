"""The section of a design."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from excite.design.design import Design
from excite.design.designed_motion import DesignedMotion
from excite.design.stated_limits import Unchecked, collisions_unchecked, kept_text
from excite.design.stored_design import StoredDesign
from excite.files.design_folder import design_content
from excite.information.metrics import CONVENTIONS
from excite.optimality.design_bound import NAME as BOUND
from excite.optimality.design_bound import stored_bound
from excite.optimality.sensitivity import Sensitivity
from excite.report.drawings import drawn
from excite.report.player_data import matches, player_motion
from excite.report.restored_design import restore
from excite.report.sections import (
    ReportCell,
    ReportFigure,
    ReportSection,
    ReportTable,
    asked,
    facts,
    kept,
    number,
    percent,
    plain_number,
    raised,
    task_file,
    unit,
)
from regressors.errors import ExciteError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ASKED = ("robot", "model", "trajectory", "period", "criterion", "starts", "seed")
_TITLES = {
    "motion": "Motion and its limits over time",
    "phase": "Velocity over position",
    "spectrum": "What the motion identifies",
    "convergence": "The search",
    "clearance": "Distances over time",
    "workspace": "Tool and obstacles",
}


def design_section(design: DesignedMotion, prefix: str, robot_file: str | None = None) -> ReportSection:
    """Everything that a page says of a design."""
    content = _content(design)
    whole, missing = _whole(design)
    figures: tuple[ReportFigure, ...] = ()
    motion = None
    if whole is not None:
        figures, missing = drawn(_figures(whole), prefix)
        motion = player_motion(
            whole, robot_file if robot_file is not None and matches(whole.robot, whole.task, robot_file) else None
        )
    unchecked = tuple(f"not checked: {each}" for each in design.unchecked)
    return ReportSection(
        kind="design",
        title=design.name,
        verdict=_verdict(content, design.unchecked),
        holds=bool(content["feasible"]),
        caution=bool(collisions_unchecked(each.limit for each in design.unchecked)),
        asked=asked(content["task"], _ASKED),
        assumed=(*(design.believed if isinstance(design, StoredDesign) else ()), *unchecked, *content["notes"]),
        notes=missing,
        tables=(_conditions(content), *_bounds(design), *_limits(content), _predictions(content)),
        figures=figures,
        motion=motion,
        facts=facts(content["provenance"], robot=content["robot"]["name"], robot_sha256=content["robot"]["sha256"]),
        commands=_commands(design, content),
        task=task_file(content["task"]),
    )


def _content(design: DesignedMotion) -> Mapping[str, Any]:
    if isinstance(design, StoredDesign):
        return design.recomputed_content
    assert isinstance(design, Design)
    return design_content(design)


def _whole(design: DesignedMotion) -> tuple[Design | None, tuple[str, ...]]:
    """The design with its limits as functions; why it cannot be had, where it names parts that are not given."""
    if isinstance(design, Design):
        return design, ()
    assert isinstance(design, StoredDesign)
    try:
        return restore(design), ()
    except ExciteError as error:
        return None, (f"figures and the 3D player are left out: {error}",)


def _figures(design: Design) -> dict[str, Callable[[], Figure]]:
    from excite.plots import figures_of

    known = figures_of(design)
    names = [name for name in known if name != "convergence" or design.starts]
    return {_TITLES[name]: partial(known[name], design) for name in names}


def _verdict(content: Mapping[str, Any], unchecked: tuple[Unchecked, ...]) -> str:
    broken = [use["label"] for use in _all_limits(content) if not use["holds"]]
    limits = kept_text(unchecked, (use["quantity"] for use in content["limits"] if "quantity" in use))
    if broken:
        limits = f"the motion breaks {len(broken)} limit{'s' * (len(broken) > 1)}: {', '.join(broken)}"
    rank, condition = content["base"]["rank"], content["criteria"]["condition_number"]
    known = f"all {rank} base parameters" if rank > 1 else "its base parameter"
    size = "which is not finite" if condition is None else f"{condition:.4g}"
    stopped = " The search was interrupted." if content["interrupted"] else ""
    first = limits[:1].upper() + limits[1:]
    return f"{first}. It is designed to identify {known}, with condition number {size} (Gautier's base, SI).{stopped}"


def _all_limits(content: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    ways = [content["played"][name]["limits"] for name in ("approach", "return") if name in content["played"]]
    return [*content["limits"], *(use for limits in ways for use in limits)]


def _conditions(content: Mapping[str, Any]) -> ReportTable:
    meanings = {**CONVENTIONS, **content.get("conventions", {})}
    rows = tuple(
        (ReportCell(name.replace("_", " ")), number(value), ReportCell(meanings.get(name, "")))
        for name, value in content["criteria"].items()
    )
    return ReportTable(
        "Condition under each convention",
        ("measure", "value", "convention"),
        rows,
        f"Minimised: {content['minimised']}.",
        "criteria",
    )


def _bounds(design: DesignedMotion) -> list[ReportTable]:
    """How near the design comes to the best possible, where ``excite bound`` has been run on it."""
    bound = stored_bound(design)
    if bound is None:
        return []
    rows = tuple(
        (
            ReportCell(each.described),
            number(each.value),
            number(each.reached),
            percent(each.efficiency),
            ReportCell(each.basis),
        )
        for each in bound.criteria
    )
    head = ("criterion", "bound", "design", "efficiency", "the bound is")
    said = _sentence("; ".join((*bound.assumptions, f"the bounds are those that {BOUND} states")))
    table = ReportTable("Distance from the best possible", head, rows, said, "bound")
    return [table, *_changes(bound.sensitivity)]


def _changes(changes: Sensitivity | None) -> list[ReportTable]:
    """What changes of the problem would bring, where it is known."""
    if changes is None:
        return []
    rows = tuple((ReportCell(row.change), number(row.value), percent(row.gain)) for row in changes.rows)
    head = ("change of the problem", changes.criterion, "gain")
    said = _sentence(f"{changes.meaning}; without a change it is {changes.reference:.4g}")
    return [ReportTable("What would bring more", head, rows, said, "sensitivity")]


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _limits(content: Mapping[str, Any]) -> list[ReportTable]:
    played = content["played"]
    parts = {"": content["limits"], **{n: played[n]["limits"] for n in ("approach", "return") if n in played}}
    titles = {"": "Margins of the limits over continuous time"}
    return [
        ReportTable(
            titles.get(name, f"Margins of the limits on the {name}"),
            ("limit", "used", "margin", "extreme", "bound", "unit", "at [s]", "holds"),
            tuple(_limit(use) for use in uses),
            "An exact extreme is that of the motion at every instant; an enclosed one is a proven bound."
            if name == ""
            else "",
            f"limits{'-' * bool(name)}{name}",
            folded=name != "",
        )
        for name, uses in parts.items()
    ]


def _limit(use: Mapping[str, Any]) -> tuple[ReportCell, ...]:
    return (
        ReportCell(use["label"]),
        _used(use),
        number(use["margin"]),
        number(use["extreme"]),
        number(use["bound"]),
        unit(use["unit"]),
        number(use["time"]),
        kept(use["holds"]),
    )


def _used(use: Mapping[str, Any]) -> ReportCell:
    """Fraction of a limit that is used; far inside a limit on one side, as of a distance, it says nothing."""
    cell = percent(use["use"], "" if use["holds"] else "bad")
    return cell if cell.value is None or cell.value >= 0 else ReportCell("far from it", cell.value)


def _predictions(content: Mapping[str, Any]) -> ReportTable:
    predicted = content["predicted"]
    noise = sorted(set(predicted["noise"]))
    sizes = plain_number(noise[0]) if len(noise) == 1 else f"{plain_number(noise[0])} to {plain_number(noise[-1])}"
    units = " or ".join(dict.fromkeys(unit for _, unit in predicted["equations"]))
    rows = tuple(
        (ReportCell(p["name"]), number(p["standard_deviation"]), unit(p["unit"]), ReportCell(raised(p["expression"])))
        for p in predicted["parameters"]
    )
    return ReportTable(
        "Parameters and their predicted accuracy",
        ("parameter", "standard deviation", "unit", "combination"),
        rows,
        f"Of one run, for noise of {sizes} {units} in each row, independent from instant to instant.",
        "predicted",
    )


def _commands(design: DesignedMotion, content: Mapping[str, Any]) -> tuple[str, ...]:
    robot = str(content["task"]["robot"])
    folder = "designs/again" if design.folder is None else f"{design.folder}-again"
    return (
        shlex.join(["excite", "design", robot, "--task", "task.yaml", "--out", folder]),
        shlex.join(["excite", "compare", str(design.folder or "designs/this"), folder]),
    )
