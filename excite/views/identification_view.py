"""What is shown of an identification: whether it can be right, its parameters, residuals, and repetitions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from excite.design.task_file import task_content
from excite.identification.between_logs import interval_scope, scatter_warning
from excite.identification.doubts import WELL, answers, known_text
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.identification.result_json import KIND
from excite.study.repetitions import Repetitions
from excite.views.view import Column, Drawing, Format, View, ViewTable, asked, headed, text_of, texts
from regressors.errors import percent

_DRAWN = (
    Drawing("Parameters with their 99 % intervals", "parameters", "parameters_plot.parameters_figure"),
    Drawing("Measured and predicted", "torques", "identification_plots.torques_figure"),
    Drawing("Residuals", "residuals", "identification_plots.residuals_figure"),
    Drawing("Estimates over time", "estimates", "identification_plots.estimates_figure"),
    Drawing("Repetitions in simulation and predicted intervals", "repetitions", "parameters_plot.repetitions_figure"),
)
TITLES = {each.ending: each.title for each in _DRAWN}
_SHOWN = 5  # parameters that are least certain
_WHITE = 0.01  # least probability of residuals that are taken for white
_RARE = 0.01  # probability of a scatter between logs that noise hardly makes


def identification_view(result: Identification) -> View:
    """View of an identification."""
    logs = result.facts.logs
    several = len(logs) > 1
    return View(
        kind="identification",
        title=result.name,
        verdict=_verdict(result),
        holds=False if result.doubts else None,
        numbers=(
            (f"parameters known to {100 * WELL:g} %", known_text(result).partition(" are")[0]),
            ("torques missed where identified", percent(result.facts.relative_error, 3)),
            ("condition number, measured", f"{result.condition_number:.4g}"),
        ),
        summary=(_data(result), _condition(result), *_answers(result), *_repeated(result)),
        against=_against(result),
        remarks=(
            interval_scope(len(logs)),
            *_once(result.estimate.notes, [*answers(result), *(choice.reason for choice in result.choices)]),
            *(f"{log.file}: {note}" if several else note for log in logs for note in log.notes),
            *(f"chosen: {choice.reason}" for choice in result.choices),
        ),
        tables=(
            *_least_certain(result),
            _parameters(result),
            *_each_log(result),
            *_standard(result),
            *_repetitions(result),
            _residuals(result),
            _logs(result),
        ),
        asked=(*asked(task_content(result.task), ("robot", "model")), *_recipe(result.recipe)),
        figures=identification_figures(result),
        filed=KIND,
        facts={
            "robot": result.robot.name,
            "robot_sha256": result.robot.sha256(),
            "design": None if result.design is None else result.design.file,
            **{f"log {log.file} sha256": log.sha256 for log in logs},
            **result.provenance,
        },
    )


def _verdict(result: Identification) -> str:
    if result.doubts:
        return f"This result cannot be right: {result.doubts[0].what}: {result.doubts[0].cause}"
    error = result.facts.relative_error
    residual = f"; the model misses {percent(error, 3)} of what was measured" if math.isfinite(error) else ""
    return f"Base parameters of {result.robot.name}: {known_text(result)}{residual}"


def _answers(result: Identification) -> tuple[str, ...]:
    """Without the number of known parameters, which is in a verdict without doubts."""
    return tuple(text for text in answers(result) if result.doubts or known_text(result) not in text)


def _once(notes: Sequence[str], others: Sequence[str]) -> tuple[str, ...]:
    """Notes that no other sentence begins with."""
    return tuple(note for note in notes if not any(other.startswith(note) for other in others))


def _against(result: Identification) -> tuple[str, ...]:
    """Doubts after the first, which is the verdict, and what the logs do not determine."""
    scatter = None if result.scatter is None else scatter_warning(result.scatter)
    return (
        *(f"this result cannot be right: {doubt.what}: {doubt.cause}" for doubt in result.doubts[1:]),
        *(f"warning: {warning.text}" for warning in result.warnings),
        *([f"warning: {scatter}"] if scatter is not None else []),
    )


def _data(result: Identification) -> str:
    facts = result.facts
    log, model = facts.logs[0], task_content(result.task)["model"]
    named = f"{log.file}, {log.start:.2f} s to {log.end:.2f} s" if len(facts.logs) == 1 else f"{len(facts.logs)} logs"
    return f"{model} model, {facts.rows} equations of {named}; estimator {result.estimate.method}"


def _condition(result: Identification) -> str:
    measured = result.condition_number
    text = "condition number of the measured motion: " + (f"{measured:.4g}" if math.isfinite(measured) else "infinite")
    designed = math.inf if result.design is None else result.design.condition_number
    return text + (f" (designed: {designed:.4g})" if math.isfinite(designed) else "")


def _repeated(result: Identification) -> tuple[str, ...]:
    """How repetitions in simulation agree with the intervals."""
    if result.repetitions is None:
        return ()
    coverage = [each.coverage for each in result.repetitions.parameters]
    return (
        f"{result.repetitions.count} repetitions in simulation: the 99 % intervals hold the truth in "
        f"{100 * min(coverage):.1f} % (the worst parameter) to {100 * max(coverage):.1f} % of them",
    )


def _least_certain(result: Identification) -> tuple[ViewTable, ...]:
    """The parameters with the widest intervals beside their size."""
    estimate = result.estimate
    sized = np.where(np.isfinite(estimate.deviation), estimate.relative_deviation, -1.0)
    columns = headed("*least certain:text, *value:4, *99 %:text, *unit:unit, *std. dev.:text")
    rows = []
    for k in np.argsort(-sized, kind="stable")[:_SHOWN]:
        if sized[k] >= 0.0:
            size = percent(sized[k]) if sized[k] <= 1 else "over 100 %"
            rows.append(
                (estimate.names[k], estimate.values[k], f"+- {estimate.half_width[k]:.2g}", estimate.units[k], size)
            )
    return (ViewTable("least-certain", "Parameters that are least certain", columns, tuple(rows)),) if rows else ()


def _logs(result: Identification) -> ViewTable:
    rows = tuple((log.file, log.rows, log.start, log.end) for log in result.facts.logs)
    return ViewTable("logs", "Logs", headed("log:text, rows, from [s], to [s]"), rows)


def _parameters(result: Identification) -> ViewTable:
    """Marked: ends of the intervals that contain zero."""
    estimate, facts, reference = result.estimate, result.facts, result.reference
    known = [] if reference is None else [reference.values.tolist()]
    motors = [[_at_the_motor(result, k) for k in range(len(estimate.names))]] if facts.motor_sides else []
    kind = "" if reference is None else ", truth" if reference.kind == "truth" else ", described"
    columns = (
        *headed(f"parameter:text, value?not identifiable, lower, upper, unit:unit, std. dev., relative:%{kind}"),
        *(texts("at the motor") if facts.motor_sides else ()),
        Column("combination", Format.UNIT, wide=True),
    )
    low, high = estimate.interval.T.tolist()
    rows = zip(
        estimate.names, estimate.values.tolist(), low, high, estimate.units, estimate.deviation.tolist(),
        estimate.relative_deviation.tolist(), *known, *motors, facts.expressions, strict=True,
    )  # fmt: skip
    around_zero = [a <= 0 <= b and math.isfinite(b - a) for a, b in zip(low, high, strict=True)]
    marked = {(k, column): "bad" for k, holds in enumerate(around_zero) if holds for column in (2, 3)}
    note = "Marked: intervals that contain zero. A dash stands for what the logs do not determine on its own."
    return ViewTable("parameters", TITLES["parameters"], columns, tuple(rows), note=note, marked=marked)


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
    values, deviations = (*each.values, estimate.values), (*each.deviations, estimate.deviation)
    estimates = (map(_with_deviation, x, deviation) for x, deviation in zip(values, deviations, strict=True))
    ratios = map(_ratio, scatter.ratios, scatter.probabilities)
    rows = tuple(zip(each.names, *estimates, each.units, ratios, strict=True))
    logs = (f"log {k + 1}" for k in range(len(each.logs)))
    columns = (*texts("parameter", *logs, "together"), *headed("unit:unit, scatter over stated:text"))
    note = "*: less than 1 % probable from noise alone"
    return (ViewTable("each-log", "Each log alone, with its standard deviation", columns, rows, note=note),)


def _with_deviation(value: float, deviation: float) -> str:
    return f"{value:.4g} +- {deviation:.1g}" if math.isfinite(value) and math.isfinite(deviation) else "-"


def _ratio(ratio: float, probability: float) -> str:
    return f"{math.sqrt(ratio):.2f}" + ("*" if probability < _RARE else "") if math.isfinite(ratio) else "-"


def _standard(result: Identification) -> tuple[ViewTable, ...]:
    """Standard parameters, where the estimator has them."""
    rows = tuple(result.estimate.standard.items())
    return (ViewTable("standard", "Standard parameters, SI", headed("parameter:text, value"), rows),) if rows else ()


def _repetitions(result: Identification) -> tuple[ViewTable, ...]:
    """Repetitions of the experiment in simulation, where they were asked for."""
    repeated = result.repetitions
    if repeated is None:
        return ()
    columns = headed("parameter:text, scatter, predicted, bias, its deviation, unit:unit, truth in its 99 % interval:%")
    rows = tuple(
        (p.name, p.deviation, p.predicted_deviation, p.bias, p.bias_error, p.unit, p.coverage)
        for p in repeated.parameters
    )
    note = f"Seed {repeated.seed}; the scatter is what the predicted standard deviation claims to be."
    title = f"{repeated.count} repetitions of the experiment in simulation"
    return (ViewTable("repetitions", title, columns, rows, note=note),)


def _residuals(result: Identification) -> ViewTable:
    columns = headed(
        "log:text, equation:text, rms, worst, unit:unit, of measured:%, correlation of neighbours, white:text"
    )
    rows = tuple(
        (r.log, r.equation, r.rms, r.worst, r.unit, r.relative, r.lag_one, "yes" if r.whiteness > _WHITE else "no")
        for r in result.facts.residuals
    )
    return ViewTable("residuals", "Residuals", columns, rows)


def repetitions_view(result: Identification, repeated: Repetitions) -> View:
    """View of an identification whose figure is that of its repetitions, which it keeps a summary of."""
    *_, figure = _DRAWN
    return replace(identification_view(result), figures=(figure.of(repeated, result.robot.name),))


def _recipe(recipe: Recipe) -> tuple[tuple[str, str], ...]:
    default = Recipe().to_dict()
    return tuple(
        (name.replace("_", " "), text_of(value))
        for name, value in recipe.to_dict().items()
        if value is not None and value != default.get(name)
    )


def identification_figures(result: Identification) -> tuple[Drawing, ...]:
    """Figures that its estimate and its curves can draw."""
    logged, traced = result.curves.time.size > 0, result.estimate.history is not None
    shown = {"parameters": True, "torques": logged, "residuals": logged, "estimates": traced}
    return tuple(each.of(result) for each in _DRAWN if shown.get(each.ending))


def side_by_side_view(results: Sequence[Identification]) -> View:
    """View of the parameters of several identifications."""
    names = list(dict.fromkeys(name for result in results for name in result.names))
    known = [_intervals(result) for result in results]
    units = {name: unit for result in results for name, unit in zip(result.names, result.units, strict=True)}
    overlap = [name for name in names if _agree([each[name] for each in known if name in each])]
    columns = (
        *headed("parameter:text, unit:unit"),
        *(Column(text) for r in results for text in (r.name, f"{r.name}, half-width")),
        *headed("agree:kept"),
    )
    rows = tuple(
        (name, units[name], *(x for each in known for x in each.get(name, (None, None))), name in overlap)
        for name in names
    )
    return View(
        kind="comparison",
        title=f"{len(results)} identifications",
        verdict=f"The 99 % intervals of {len(overlap)} of {len(names)} parameters overlap.",
        tables=(ViewTable("side-by-side", "Parameters side by side", columns, rows),),
    )


def _intervals(result: Identification) -> dict[str, tuple[float, float]]:
    """Value and half of the interval of each parameter."""
    pairs = zip(result.estimate.values.tolist(), result.estimate.half_width.tolist(), strict=True)
    return dict(zip(result.names, pairs, strict=True))


def _agree(known: Sequence[tuple[float, float]]) -> bool:
    finite = [(value - half, value + half) for value, half in known if np.isfinite(value) and np.isfinite(half)]
    return max((low for low, _ in finite), default=0.0) <= min((high for _, high in finite), default=0.0)
