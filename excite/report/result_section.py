"""The section of an identification."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, cast

from excite.files.result_curves import CURVES, read_result_curves, result_curves
from excite.files.result_json import KIND, result_content
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.identification.result import IdentificationResult, StoredResult
from excite.report.drawings import drawn, no_pictures, pictures
from excite.report.identify_commands import commands_of
from excite.report.player_log import Appearance, logged_rows, played
from excite.report.provenance_facts import facts
from excite.report.restored_result import stored_estimate, stored_fit, with_history
from excite.report.sections import (
    ReportCell,
    ReportFigure,
    ReportSection,
    ReportTable,
    number,
    percent,
    raised,
    text_of,
    unit,
)
from excite.report.stored_curves import stored_curves
from excite.report.task_text import asked
from excite.storage.curves_file import Arrays

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PARAMETERS = "Parameters with their 99 % intervals"
_TITLES = {
    "torques.png": "Measured and predicted",
    "residuals.png": "Residuals",
    "estimates.png": "Estimates over time",
    "repetitions.png": "Repetitions in simulation and predicted intervals",
}


def result_section(result: IdentificationResult, prefix: str, looks: Appearance) -> ReportSection:
    """Everything that a page says of an identification."""
    content = result.content if isinstance(result, StoredResult) else result_content(cast(Identification, result))
    arrays, unknown = _curves(result, content)
    figures, missing = _figures(result, arrays, prefix)
    motion: Mapping[str, Any] | None = None
    unseen: tuple[str, ...] = ()
    if arrays is not None:
        files, equations = [log["file"] for log in content["logs"]], [tuple(each) for each in content["equations"]]
        motion, unseen = played(logged_rows(arrays, files, equations), result.robot, result.task, looks)
    doubts = tuple(_sentence(each) for each in (*content["doubts"], *content.get("warnings", ())))
    scope = (content["interval_scope"],) if content.get("interval_scope") else ()
    logs = tuple(f"{log['file']}: {note}" for log in content["logs"] for note in log["notes"])
    return ReportSection(
        kind="identification",
        title=result.name,
        verdict=_verdict(content),
        holds=False if content["doubts"] else None,
        asked=(*asked(content["task"], ("robot", "model")), *_recipe(content["recipe"])),
        assumed=(*scope, *content["notes"], *logs),
        notes=(*doubts, *unknown, *unseen, *missing),
        tables=(
            _parameters(content),
            *_standard(content),
            *_repetitions(content),
            _residuals(content),
            _conditions(content),
        ),
        figures=figures,
        motion=motion,
        facts=facts(content["provenance"], robot=content["robot"]["name"], **_hashes(content)),
        commands=commands_of(content, str(result.folder or "results/this")),
    )


def _sentence(doubt: Mapping[str, Any]) -> str:
    """A reason why a result cannot be right, or what its logs do not determine, in its own words."""
    return " ".join(text_of(value) for value in doubt.values() if isinstance(value, str) and " " in value)


def _curves(result: IdentificationResult, content: Mapping[str, Any]) -> tuple[Arrays | None, tuple[str, ...]]:
    """What its figures draw; None and a sentence where its folder has no such file."""
    if isinstance(result, Identification):
        return result_curves(result), ()
    assert isinstance(result, StoredResult)
    counts = len(content["logs"]), len(content["equations"])
    arrays, note = stored_curves(result.folder, KIND, CURVES, lambda path: read_result_curves(path, *counts))
    return arrays, (note,) if note else ()


def _figures(
    result: IdentificationResult, arrays: Arrays | None, prefix: str
) -> tuple[tuple[ReportFigure, ...], tuple[str, ...]]:
    """All of them drawn; of an older result in a folder the parameters are, the rest is as it was written."""
    if isinstance(result, Identification):
        return drawn(_new(result), prefix)
    assert isinstance(result, StoredResult)
    if arrays is not None:
        figures, missing = drawn(_restored(result, arrays), prefix)
        repeated = {name: title for name, title in _TITLES.items() if name.startswith("repetitions.")}
        return (*figures, *pictures(result.folder, KIND, repeated)), missing
    figures, missing = drawn({_PARAMETERS: lambda: _stored_parameters(result)}, prefix)
    left_out = no_pictures(result.folder, KIND, _TITLES)
    return (*figures, *pictures(result.folder, KIND, _TITLES)), (*missing, *left_out)


def _stored_parameters(result: StoredResult) -> Figure:
    from excite.plots.parameters_plot import parameters_figure

    known = stored_estimate(result)
    return parameters_figure(cast(Identification, known), known.reference)


def _restored(result: StoredResult, arrays: Arrays) -> dict[str, Callable[[], Figure]]:
    from excite.plots import estimates_figure, residuals_figure, torques_figure

    fit = cast(Identification, stored_fit(result, arrays))
    figures: dict[str, Callable[[], Figure]] = {
        _PARAMETERS: lambda: _stored_parameters(result),
        _TITLES["torques.png"]: partial(torques_figure, fit),
        _TITLES["residuals.png"]: partial(residuals_figure, fit),
    }
    if "history" in arrays:
        known = with_history(stored_estimate(result), arrays)
        figures[_TITLES["estimates.png"]] = partial(estimates_figure, cast(Identification, known), known.reference)
    return figures


def _new(result: Identification) -> dict[str, Callable[[], Figure]]:
    from excite.plots import estimates_figure, parameters_figure, residuals_figure, torques_figure

    figures: dict[str, Callable[[], Figure]] = {
        _PARAMETERS: partial(parameters_figure, result, result.reference),
        _TITLES["torques.png"]: partial(torques_figure, result),
        _TITLES["residuals.png"]: partial(residuals_figure, result),
    }
    if result.estimate.history is not None:
        figures[_TITLES["estimates.png"]] = partial(estimates_figure, result, result.reference)
    return figures


def _verdict(content: Mapping[str, Any]) -> str:
    parameters = content["parameters"]
    sure = sum(_is_clear(each) for each in parameters)
    error = content["relative_error"]
    fits = "" if error is None else f" They explain what was measured within {100 * error:.3g} %, on the same logs."
    if content["doubts"]:
        begin = "This result cannot be right; the reasons are below."
    else:
        begin = "Nothing in this result is implausible; whether it predicts other logs, a verification says."
    count = f"{sure} of {len(parameters)}"
    return f"{begin} The intervals of {count} parameters do not contain zero.{fits}{_repeated(content)}"


def _repeated(content: Mapping[str, Any]) -> str:
    repeated = content.get("repetitions")
    known = [each["coverage"] for each in (repeated or {}).get("parameters", ()) if each["coverage"] is not None]
    if not repeated or not known:
        return ""
    share = f"{100 * sum(known) / len(known):.3g} %"
    return f" In {repeated['count']} repetitions in simulation, {share} of the 99 % intervals contain the truth."


def _is_clear(parameter: Mapping[str, Any]) -> bool:
    low, high = parameter["interval"]
    return low is not None and high is not None and (low > 0 or high < 0)


def _parameters(content: Mapping[str, Any]) -> ReportTable:
    compared = content["reference"] is not None
    columns = ("parameter", "value", "lower", "upper", "unit", "relative deviation")
    return ReportTable(
        _PARAMETERS,
        (*columns, *((str(content["reference"]),) if compared else ()), "combination"),
        tuple(_parameter(each, compared=compared) for each in content["parameters"]),
        "Marked: intervals that contain zero. A dash stands for what the logs do not determine on its own.",
        "parameters",
    )


def _parameter(each: Mapping[str, Any], *, compared: bool) -> tuple[ReportCell, ...]:
    low, high = each["interval"]
    state = "" if _is_clear(each) or low is None else "bad"
    known = (number(each["reference"]),) if compared else ()
    ends = number(low, state=state), number(high, state=state)
    relative = percent(each["relative_deviation"])
    return (
        ReportCell(each["name"]), number(each["value"]), *ends, unit(each["unit"]), relative, *known,
        ReportCell(raised(each["expression"])),
    )  # fmt: skip


def _standard(content: Mapping[str, Any]) -> tuple[ReportTable, ...]:
    """Standard parameters, where the estimator has them."""
    known = dict(content["standard"])
    rows = tuple((ReportCell(name), number(value)) for name, value in known.items())
    return (ReportTable("Standard parameters, SI", ("parameter", "value"), rows, name="standard"),) if rows else ()


def _repetitions(content: Mapping[str, Any]) -> tuple[ReportTable, ...]:
    """Repetitions of the experiment in simulation, where they were asked for."""
    repeated = content.get("repetitions")
    if not repeated:
        return ()
    rows = tuple(
        (
            ReportCell(each["name"]), number(each["deviation"]), number(each["predicted_deviation"]),
            number(each["bias"]), number(each["bias_error"]), unit(each["unit"]), percent(each["coverage"]),
        )
        for each in repeated["parameters"]
    )  # fmt: skip
    columns = ("parameter", "scatter", "predicted", "bias", "its deviation", "unit", "truth in its 99 % interval")
    note = f"Seed {repeated['seed']}; the scatter is what the predicted standard deviation claims to be."
    title = f"{repeated['count']} repetitions of the experiment in simulation"
    return (ReportTable(title, columns, rows, note, "repetitions"),)


def _residuals(content: Mapping[str, Any]) -> ReportTable:
    rows = tuple(
        (
            ReportCell(each["log"]), ReportCell(each["equation"]), number(each["rms"]), number(each["worst"]),
            unit(each["unit"]), percent(each["relative"]), number(each["lag_one"]),
        )
        for each in content["residuals"]
    )  # fmt: skip
    columns = ("log", "equation", "rms", "worst", "unit", "relative", "correlation of neighbours")
    return ReportTable("Residuals", columns, rows, name="residuals")


def _conditions(content: Mapping[str, Any]) -> ReportTable:
    condition = content["condition_number"]
    rows = (
        (ReportCell("measured"), number(condition["measured"])),
        (ReportCell("designed"), number(condition["designed"])),
    )
    return ReportTable(
        "Condition of the equations", ("equations", "value"), rows, f"{condition['convention']}.", "condition"
    )


def _recipe(recipe: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    default = Recipe().to_dict()
    return tuple(
        (name.replace("_", " "), text_of(value))
        for name, value in recipe.items()
        if value is not None and value != default.get(name)
    )


def _hashes(content: Mapping[str, Any]) -> dict[str, Any]:
    logs = {f"log {log['file']} sha256": log["sha256"] for log in content["logs"]}
    design = content["design"] or {}
    return {"robot_sha256": content["robot"]["sha256"], "design": design.get("file"), **logs}
