"""Sections that compare several designs, or several identifications."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import numpy as np

from excite.design.comparison import Judgement, compare
from excite.design.designed_motion import DesignedMotion
from excite.design.stated_limits import kept_headline
from excite.identification.identification import Identification
from excite.information.metrics import CONVENTIONS
from excite.report.sections import ReportCell, ReportSection, ReportTable, number, percent, plain_number, unit

_LARGER_IS_BETTER = ("smallest_singular_value", "log_det")


def comparison_section(designs: Sequence[DesignedMotion]) -> ReportSection:
    """Several designs under the metrics of the first one, see `excite.design.comparison.compare`."""
    judged = compare(designs)
    alike = len({(j.robot, j.model, j.moving, j.parameters) for j in judged}) == 1
    names = [judgement.name for judgement in judged]
    return ReportSection(
        kind="comparison",
        title=f"{len(judged)} designs",
        verdict=_verdict(judged, alike=alike),
        assumed=(
            "every design is judged under the parameters (friction, rotors) and the noise of the first one, at 100 Hz",
            *(f"{each.name}: {said}" for each in judged for said in each.believed),
        ),
        tables=(_measures(judged, alike=alike), _facts(judged)),
        commands=(shlex.join(["excite", "compare", *names]),),
    )


def _verdict(judged: Sequence[Judgement], *, alike: bool) -> str:
    if not alike:
        return "The designs are for different robots, models or moving joints; their numbers are not comparable."
    best = min(judged, key=lambda judgement: judgement.criteria["condition_number"])
    size = plain_number(best.criteria["condition_number"])
    return f"{best.name} has the smallest condition number, {size} (Gautier's base, SI)."


def _measures(judged: Sequence[Judgement], *, alike: bool) -> ReportTable:
    rows = []
    for name, meaning in CONVENTIONS.items():
        values = np.array([judgement.criteria[name] for judgement in judged])
        best = values.max() if name.startswith(_LARGER_IS_BETTER) else values.min()
        cells = [number(value, state="best" if alike and value == best else "") for value in values.tolist()]
        rows.append((ReportCell(name.replace("_", " ")), *cells, ReportCell(meaning)))
    columns = ("measure", *(judgement.name for judgement in judged), "convention")
    note = "Marked: the best of each row." if alike else ""
    return ReportTable("Measures of each design", columns, tuple(rows), note, "comparison")


def _facts(judged: Sequence[Judgement]) -> ReportTable:
    columns = ("design", "robot", "duration [s]", "parameters", "tightest limit", "its use", "limits", "not checked")
    rows = tuple(
        (
            ReportCell(j.name), ReportCell(j.robot), number(j.duration), number(j.parameters),
            ReportCell("-" if j.tightest is None else j.tightest.label),
            percent(None if j.tightest is None else j.tightest.use),
            ReportCell(kept_headline(j.unchecked, "hold")) if j.feasible else ReportCell("BROKEN", state="bad"),
            ReportCell(", ".join(j.unchecked) or "-"),
        )
        for j in judged
    )  # fmt: skip
    return ReportTable("Limits and durations", columns, rows, name="designs")


def parameters_section(results: Sequence[Identification]) -> ReportSection:
    """Parameters of several identifications side by side."""
    names = list(dict.fromkeys(name for result in results for name in result.names))
    known = [_intervals(result) for result in results]
    overlap = [name for name in names if _agree([each[name] for each in known if name in each])]
    columns = ("parameter", "unit", *(text for r in results for text in (r.name, f"{r.name}, half-width")), "agree")
    units = {name: each for result in results for name, each in zip(result.names, result.units, strict=True)}
    rows = []
    for name in names:
        pairs = [each.get(name, (np.nan, np.nan)) for each in known]
        cells = (number(x) for value, half in pairs for x in (value, half))
        agree = ReportCell("yes" if name in overlap else "NO", state="" if name in overlap else "bad")
        rows.append((ReportCell(name), unit(units[name]), *cells, agree))
    return ReportSection(
        kind="comparison",
        title=f"{len(results)} identifications",
        verdict=f"The 99 % intervals of {len(overlap)} of {len(names)} parameters overlap.",
        tables=(ReportTable("Parameters side by side", columns, tuple(rows), name="side-by-side"),),
    )


def _intervals(result: Identification) -> dict[str, tuple[float, float]]:
    """Value and half of the interval of each parameter."""
    values, halves = result.estimate.values, result.estimate.half_width
    return dict(zip(result.names, zip(values.tolist(), halves.tolist(), strict=True), strict=True))


def _agree(known: Sequence[tuple[float, float]]) -> bool:
    finite = [(value - half, value + half) for value, half in known if np.isfinite(value) and np.isfinite(half)]
    return max((low for low, _ in finite), default=0.0) <= min((high for _, high in finite), default=0.0)
