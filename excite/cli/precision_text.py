"""What a design says of the precision that it was asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from excite.cli.summary import compact_table
from excite.study.period_search import runs_text

if TYPE_CHECKING:
    from excite.design.design import Design
    from excite.information.precision_forecast import ParameterPrecision, PrecisionForecast
    from excite.study.out_of_reach import OutOfReach

_NAMED = 3  # parameters with what they move with


def precision_lines(design: Design) -> list[str | Table]:
    """Runs, robot time and the worst parameter; nothing where no precision is asked for."""
    forecast = design.precision
    if forecast is None:
        return []
    text = runs_text(forecast.runs, forecast.seconds)
    if forecast.met:
        return [f"{text}; worst parameter {_width(forecast.worst)}"]
    wide = forecast.too_wide
    count = f"{len(wide)} of {sum(p.allowed is not None for p in forecast.parameters)} parameters"
    most = design.task.objective.max_time
    lines: list[str | Table] = [f"out of reach within {most:g} s: after {text}, {count} are too wide"]
    search = design.precision_search
    if search is None or search.out_of_reach is None:
        return [*lines, f"worst parameter {_width(wide[0])}"]
    return [*lines, *_obstacles(search.out_of_reach)]


def _obstacles(found: OutOfReach) -> list[str | Table]:
    """The widest parameters, and what would separate them."""
    lines: list[str | Table] = [parameter.text for parameter in found.parameters[:_NAMED]]
    if len(found.parameters) > _NAMED:
        lines.append(f"too wide also: {', '.join(p.name for p in found.parameters[_NAMED:])}")
    rows = [(trial.change, f"{trial.narrower:.2f} times", f"{trial.robot_seconds:.4g} s") for trial in found.trials]
    best = "nothing that was tried separates them" if found.best is None else f"what helps most is {found.best.change}"
    return [
        *lines,
        f"the same motion would take {found.robot_seconds:.4g} s of robot time; {best}",
        *compact_table("tried, one at a time", "narrower", "robot time", rows=rows),
    ]


def _width(parameter: ParameterPrecision) -> str:
    return (
        f"{parameter.name}: half-width {parameter.half_width:.3g} of {parameter.allowed:.3g} {parameter.unit} allowed"
    )


def half_width_table(forecast: PrecisionForecast) -> Table:
    """Predicted and allowed half-width of every parameter."""
    title = (
        f"half-widths of {100 * forecast.level:g} % intervals after {forecast.runs} run{'s' * (forecast.runs > 1)}, "
        f"with probability {100 * forecast.probability:g} %"
    )
    table = Table(title=title, title_justify="left")
    for heading in ("parameter", "half-width", "allowed", "unit", "used"):
        table.add_column(heading, justify="right" if heading not in ("parameter", "unit") else "left")
    for p in forecast.parameters:
        allowed = "-" if p.allowed is None else f"{p.allowed:.3g}"
        used = "-" if p.allowed is None else f"{100 * p.use:.0f} %"
        table.add_row(p.name, f"{p.half_width:.3g}", allowed, p.unit, used)
    return table
