"""What is shown of an identification: whether it can be right, its parameters, residuals, and repetitions."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from excite.identification.between_logs import interval_scope, scatter_warning
from excite.identification.identification import Identification
from excite.views.view import Column, Format, View, ViewTable

TITLES = {
    "parameters": "Parameters with their 99 % intervals",
    "torques": "Measured and predicted",
    "residuals": "Residuals",
    "estimates": "Estimates over time",
    "repetitions": "Repetitions in simulation and predicted intervals",
}
_WELL = 0.05  # relative deviation of a parameter that is well known
_WHITE = 0.01  # least probability of residuals that are taken for white
_RARE = 0.01  # probability of a scatter between logs that noise hardly makes


def identification_view(result: Identification) -> View:
    """View of an identification."""
    logs = result.facts.logs
    several = len(logs) > 1
    return View(
        title=result.name,
        verdict=_verdict(result),
        holds=False if result.doubts else None,
        summary=(_known(result), *_repeated(result)),
        against=_against(result),
        remarks=(
            interval_scope(len(logs)),
            *result.estimate.notes,
            *(f"{log.file}: {note}" if several else note for log in logs for note in log.notes),
        ),
        tables=(
            _parameters(result),
            *_each_log(result),
            *_standard(result),
            *_repetitions(result),
            _residuals(result),
            _conditions(result),
        ),
        figures=_figures(result),
        endings=tuple(TITLES),
    )


def _verdict(result: Identification) -> str:
    if result.doubts:
        return f"This result cannot be right: {result.doubts[0].what}: {result.doubts[0].cause}"
    count, error = len(result.names), result.facts.relative_error
    seen = count - len(result.estimate.unseen)
    residual = f"; residual {100 * error:.3g} % of what was measured" if math.isfinite(error) else ""
    found = f"all {count}" if seen == count else f"{seen} of {count}"
    return f"Identified {found} base parameters of {result.robot.name}{residual}"


def _against(result: Identification) -> tuple[str, ...]:
    """Doubts after the first, which is the verdict, and what the logs do not determine."""
    scatter = None if result.scatter is None else scatter_warning(result.scatter)
    return (
        *(f"this result cannot be right: {doubt.what}: {doubt.cause}" for doubt in result.doubts[1:]),
        *(f"warning: {warning.text}" for warning in result.warnings),
        *([f"warning: {scatter}"] if scatter is not None else []),
    )


def _known(result: Identification) -> str:
    known = int(np.sum(result.estimate.relative_deviation < _WELL))
    share = f"{100 * _WELL:g} %"
    return f"{known} of {len(result.names)} parameters have a standard deviation below {share} of their value"


def _repeated(result: Identification) -> tuple[str, ...]:
    """How repetitions in simulation agree with the intervals."""
    if result.repetitions is None:
        return ()
    coverage = [each.coverage for each in result.repetitions.parameters]
    return (
        f"{result.repetitions.count} repetitions in simulation: the 99 % intervals hold the truth in "
        f"{100 * min(coverage):.1f} % (the worst parameter) to {100 * max(coverage):.1f} % of them",
    )


def _parameters(result: Identification) -> ViewTable:
    """Marked: ends of the intervals that contain zero."""
    estimate, facts = result.estimate, result.facts
    reference = result.reference
    values = np.full(len(estimate.names), np.nan) if reference is None else reference.values
    columns = (
        Column("parameter", Format.TEXT),
        Column("value", missing="not identifiable"),
        Column("lower"),
        Column("upper"),
        Column("unit", Format.UNIT),
        Column("std. dev."),
        Column("relative", Format.PERCENT),
        *((Column("truth" if reference.kind == "truth" else "described"),) if reference is not None else ()),
        *((Column("at the motor", Format.TEXT),) if facts.motor_sides else ()),
        Column("combination", Format.UNIT, wide=True),
    )
    rows, marked = [], set()
    for k, name in enumerate(estimate.names):
        low, high = estimate.interval[k].tolist()
        if low <= 0 <= high and math.isfinite(high - low):
            marked |= {(k, 2), (k, 3)}
        rows.append(
            (
                name, float(estimate.values[k]), low, high, estimate.units[k], float(estimate.deviation[k]),
                float(estimate.relative_deviation[k]), *((float(values[k]),) if reference is not None else ()),
                *((_at_the_motor(result, k),) if facts.motor_sides else ()), facts.base.expressions[k],
            )
        )  # fmt: skip
    note = "Marked: intervals that contain zero. A dash stands for what the logs do not determine on its own."
    return ViewTable("parameters", TITLES["parameters"], columns, tuple(rows), note=note, marked=frozenset(marked))


def _at_the_motor(result: Identification, k: int) -> str:
    """The rotor inertia itself, where the parameter is one at the drive coordinate."""
    estimate = result.estimate
    side = result.facts.motor_sides.get(estimate.names[k])
    if side is None or not math.isfinite(estimate.values[k]):
        return ""
    value, half = estimate.values[k] / side.factor, estimate.half_width[k] / side.factor
    return f"{side.name}: {value:.4g} +- {half:.2g} {side.unit}"


def _each_log(result: Identification) -> tuple[ViewTable, ...]:
    """The estimates of each log alone, where they were asked for."""
    scatter = result.scatter
    if scatter is None or not result.each:
        return ()
    each, estimate = scatter.each, result.estimate
    logs = tuple(f"log {k + 1}" for k in range(len(each.logs)))
    headings = ("parameter", *logs, "together", "unit", "scatter over stated")
    rows = tuple(
        (
            name,
            *(_with_deviation(each.values[k, j], each.deviations[k, j]) for k in range(len(each.logs))),
            _with_deviation(estimate.values[j], estimate.deviation[j]),
            each.units[j],
            _ratio(scatter.ratios[j], scatter.probabilities[j]),
        )
        for j, name in enumerate(each.names)
    )
    columns = tuple(Column(heading, Format.UNIT if heading == "unit" else Format.TEXT) for heading in headings)
    note = "*: less than 1 % probable from noise alone"
    return (ViewTable("each-log", "Each log alone, with its standard deviation", columns, rows, note=note),)


def _with_deviation(value: float, deviation: float) -> str:
    return f"{value:.4g} +- {deviation:.1g}" if math.isfinite(value) and math.isfinite(deviation) else "-"


def _ratio(ratio: float, probability: float) -> str:
    return f"{math.sqrt(ratio):.2f}" + ("*" if probability < _RARE else "") if math.isfinite(ratio) else "-"


def _standard(result: Identification) -> tuple[ViewTable, ...]:
    """Standard parameters, where the estimator has them."""
    rows = tuple(result.estimate.standard.items())
    columns = (Column("parameter", Format.TEXT), Column("value"))
    return (ViewTable("standard", "Standard parameters, SI", columns, rows),) if rows else ()


def _repetitions(result: Identification) -> tuple[ViewTable, ...]:
    """Repetitions of the experiment in simulation, where they were asked for."""
    repeated = result.repetitions
    if repeated is None:
        return ()
    columns = (
        Column("parameter", Format.TEXT),
        Column("scatter"),
        Column("predicted"),
        Column("bias"),
        Column("its deviation"),
        Column("unit", Format.UNIT),
        Column("truth in its 99 % interval", Format.PERCENT),
    )
    rows = tuple(
        (p.name, p.deviation, p.predicted_deviation, p.bias, p.bias_error, p.unit, p.coverage)
        for p in repeated.parameters
    )
    note = f"Seed {repeated.seed}; the scatter is what the predicted standard deviation claims to be."
    title = f"{repeated.count} repetitions of the experiment in simulation"
    return (ViewTable("repetitions", title, columns, rows, note=note),)


def _residuals(result: Identification) -> ViewTable:
    columns = (
        Column("log", Format.TEXT),
        Column("equation", Format.TEXT),
        Column("rms"),
        Column("worst"),
        Column("unit", Format.UNIT),
        Column("of measured", Format.PERCENT),
        Column("correlation of neighbours"),
        Column("white", Format.TEXT),
    )
    rows = tuple(
        (r.log, r.equation, r.rms, r.worst, r.unit, r.relative, r.lag_one, "yes" if r.whiteness > _WHITE else "no")
        for r in result.facts.residuals
    )
    return ViewTable("residuals", "Residuals", columns, rows)


def _conditions(result: Identification) -> ViewTable:
    designed = None if result.design is None else result.design.condition_number
    rows = (("measured", result.condition_number), ("designed", designed))
    note = "cond(W), columns of the left-to-right QR base (Gautier 1991), SI, unscaled."
    columns = (Column("equations", Format.TEXT), Column("value"))
    return ViewTable("condition", "Condition of the equations", columns, rows, note=note)


def _figures(result: Identification) -> dict[str, Callable[[], Any]]:
    """Figures that its estimate and its curves can draw."""
    drawable = ["parameters", *(("torques", "residuals") if result.curves.time.size else ())]
    drawable += ["estimates"] if result.estimate.history is not None else []
    return {TITLES[name]: partial(_drawn, result, name) for name in drawable}


def _drawn(result: Identification, name: str) -> Any:
    from excite.plots import estimates_figure, parameters_figure, residuals_figure, torques_figure

    if name in ("parameters", "estimates"):
        draw = parameters_figure if name == "parameters" else estimates_figure
        return draw(result, result.reference)
    return (torques_figure if name == "torques" else residuals_figure)(result)
