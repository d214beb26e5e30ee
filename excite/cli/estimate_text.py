"""Summary of a finished identification on the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from excite.cli.between_logs_text import print_between_logs
from excite.cli.doubt_text import next_steps, print_doubts
from excite.cli.literal_console import console
from excite.cli.messages import in_options
from excite.cli.summary import Summary, compact_table, some_of

_SHOWN, _WELL = 5, 0.05  # parameters in the summary; relative deviation of one that is well known


def estimate_summary(content: Mapping[str, Any], files: Sequence[Path]) -> Summary:
    """Summary of a result: whether it can be right, its residual, and the parameters that are least certain."""
    doubts, warnings = content["doubts"], content["warnings"]
    between = content.get("between_logs") or {}
    said = between.get("warning")
    return Summary(
        verdict=_verdict(content),
        holds=not doubts,
        facts=[
            *(f"this result cannot be right: {doubt['what']}: {doubt['cause']}" for doubt in doubts[1:]),
            *(f"warning: {warning['what']}: {warning['cause']}; {warning['cure']}" for warning in warnings),
            *([f"warning: {said}"] if said is not None else []),
            _data(content),
            _conditions(content["condition_number"], None),
            *_least_certain(content["parameters"]),
            *_repeated(content),
        ],
        notes=[
            content["interval_scope"],
            *content["notes"],
            *(note for log in content["logs"] for note in log["notes"]),
        ],
        files=files,
        next_steps=[step.removeprefix("next: ") for step in next_steps(content, files[-1].parent)],
        all_in="result.json",
    )


def _verdict(content: Mapping[str, Any]) -> str:
    doubts, parameters = content["doubts"], content["parameters"]
    if doubts:
        return f"This result cannot be right: {doubts[0]['what']}: {doubts[0]['cause']}"
    seen = [p for p in parameters if p["seen"]]
    error = content["relative_error"]
    residual = "" if error is None else f"; residual {100 * error:.3g} % of what was measured"
    count = f"all {len(seen)}" if len(seen) == len(parameters) else f"{len(seen)} of {len(parameters)}"
    return f"Identified {count} base parameters of {content['robot']['name']}{residual}"


def _data(content: Mapping[str, Any]) -> str:
    logs = content["logs"]
    rows = f"{logs[0]['file']}, {logs[0]['from']:.2f} s to {logs[0]['to']:.2f} s"
    named = rows if len(logs) == 1 else f"{len(logs)} logs"
    return f"{content['task']['model']} model, {content['rows']} equations of {named}; estimator {content['estimator']}"


def _least_certain(parameters: Sequence[Mapping[str, Any]]) -> list[Any]:
    """The parameters with the widest intervals beside their size, and those without any."""
    seen = [p for p in parameters if p["seen"]]
    sized = sorted((p for p in seen if p["relative_deviation"] is not None), key=lambda p: -p["relative_deviation"])
    rows = [
        (p["name"], f"{p['value']:.4g}", f"+- {_half(p):.2g}", p["unit"], _share(p["relative_deviation"]))
        for p in sized[:_SHOWN]
    ]
    unseen = [p["name"] for p in parameters if not p["seen"]]
    known = sum(p["relative_deviation"] < _WELL for p in sized)
    return [
        f"{known} of {len(parameters)} parameters have a standard deviation below {100 * _WELL:g} % of their value",
        *compact_table("least certain", "value", "99 %", "unit", "std. dev.", rows=rows),
        *([f"not identifiable from these logs: {some_of(unseen, 8)}"] if unseen else []),
    ]


def _share(deviation: float) -> str:
    return f"{100 * deviation:.2g} %" if deviation < 1.0 else "over 100 %"


def _half(p: Mapping[str, Any]) -> float:
    half: float = (p["interval"][1] - p["interval"][0]) / 2
    return half


def _repeated(content: Mapping[str, Any]) -> list[str]:
    """How repetitions in simulation agree with the intervals."""
    if "repetitions" not in content:
        return []
    repeated = content["repetitions"]
    coverage = [p["coverage"] for p in repeated["parameters"]]
    return [
        f"{repeated['count']} repetitions in simulation: the 99 % intervals hold the truth in "
        f"{100 * min(coverage):.1f} % (the worst parameter) to {100 * max(coverage):.1f} % of them"
    ]


def print_estimate(content: Mapping[str, Any], files: Sequence[Path]) -> None:
    """Print a summary of a result: data, parameters, residuals, next step."""
    out = console()
    parameters = content["parameters"]
    out.print(
        Text("\n").append(content["robot"]["name"], style="bold"),
        f": {content['task']['model']} model, {len(parameters)} base parameters from {content['rows']} equations "
        f"of {len(content['logs'])} log{'s' * (len(content['logs']) > 1)}; {content['estimator']}",
        sep="",
        soft_wrap=True,
    )
    print_doubts(content)
    out.print(_conditions(content["condition_number"], content["relative_error"]), soft_wrap=True)
    for choice in content.get("choices", ()):
        out.print(f"chosen: {in_options(choice['reason'])}", soft_wrap=True)
    out.print(_parameters(parameters, content["reference"]))
    out.print(_residuals(content["residuals"]))
    for log in content["logs"]:
        out.print(f"{log['file']}: {log['rows']} rows, {log['from']:.2f} s to {log['to']:.2f} s", soft_wrap=True)
        for note in log["notes"]:
            out.print(f"  {in_options(note)}", soft_wrap=True)
    if content["unseen"]:
        out.print(f"not identifiable from these logs on their own: {', '.join(content['unseen'])}", soft_wrap=True)
    for note in content["notes"]:
        out.print(f"note: {in_options(note)}", soft_wrap=True)
    print_between_logs(out, content)
    out.print(f"written to {files[-1].parent}: {', '.join(path.name for path in files)}", soft_wrap=True)
    for step in next_steps(content, files[-1].parent):
        out.print(step, soft_wrap=True)


def _conditions(condition: Mapping[str, Any], error: float | None) -> str:
    measured, designed = condition["measured"], condition["designed"]
    text = "condition number of the measured W: " + ("infinite" if measured is None else f"{measured:.4g}")
    text += "" if designed is None else f" (designed: {designed:.4g})"
    return text + ("" if error is None else f"; residual {100 * error:.3g} % of what was measured")


def _parameters(parameters: Sequence[Mapping[str, Any]], reference: str | None) -> Table:
    table = Table(title="parameters with 99 % confidence intervals", title_justify="left")
    table.add_column("parameter")
    table.add_column("value", justify="right")
    table.add_column("+-", justify="right")
    table.add_column("unit")
    table.add_column("std. dev.", justify="right")
    table.add_column("relative", justify="right")
    behind = any("motor_side" in p for p in parameters)
    if reference is not None:
        table.add_column("truth" if reference == "truth" else "described", justify="right")
    if behind:
        table.add_column("at the motor", justify="right")
    for p in parameters:
        shown = [p["name"], "not identifiable", "", p["unit"], "", ""]
        if p["seen"]:
            half = _half(p)
            relative = p["relative_deviation"]
            shown = [
                p["name"],
                f"{p['value']:.5g}",
                f"{half:.2g}",
                p["unit"],
                f"{p['standard_deviation']:.2g}",
                "-" if relative is None else f"{100 * relative:.2g} %",
            ]
        if reference is not None:
            shown.append("-" if p["reference"] is None else f"{p['reference']:.5g}")
        table.add_row(*shown, *((_at_the_motor(p.get("motor_side")),) if behind else ()))
    return table


def _at_the_motor(side: Mapping[str, Any] | None) -> str:
    """The rotor inertia itself, where the parameter is one at the drive coordinate."""
    if side is None or side["value"] is None:
        return ""
    half = (side["interval"][1] - side["interval"][0]) / 2
    return f"{side['name']}: {side['value']:.4g} +- {half:.2g} {side['unit']}"


def _residuals(residuals: Sequence[Mapping[str, Any]]) -> Table:
    table = Table(title="residuals", title_justify="left")
    table.add_column("equation")
    table.add_column("rms", justify="right")
    table.add_column("unit")
    table.add_column("of measured", justify="right")
    table.add_column("lag-1 correlation", justify="right")
    table.add_column("white")
    for r in residuals:
        table.add_row(
            str(r["equation"]),
            f"{r['rms']:.3g}",
            str(r["unit"]),
            "-" if r["relative"] is None else f"{100 * r['relative']:.3g} %",
            "-" if r["lag_one"] is None else f"{r['lag_one']:.2f}",
            "-" if r["whiteness"] is None else ("yes" if r["whiteness"] > 0.01 else "no"),
        )
    return table
