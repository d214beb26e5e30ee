"""A finished identification on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.text import Text

from excite.cli.literal_console import console
from excite.cli.messages import in_options
from excite.cli.summary import Summary, compact_table, some_of
from excite.cli.view_text import print_view
from excite.files.task_file import task_content
from excite.identification.identification import Identification
from excite.views.identification_view import identification_view

_SHOWN = 5  # parameters in the summary


def estimate_summary(result: Identification, files: Sequence[Path]) -> Summary:
    """Summary of a result: whether it can be right, its residual, and the parameters that are least certain."""
    view, unseen = identification_view(result), result.estimate.unseen
    known, *repeated = view.summary
    return Summary(
        verdict=view.verdict,
        holds=not result.doubts,
        facts=[
            *view.against,
            _data(result),
            _conditions(result),
            known,
            *_least_certain(result),
            *([f"not identifiable from these logs: {some_of(unseen, 8)}"] if unseen else []),
            *repeated,
        ],
        notes=view.remarks,
        files=files,
        next_steps=_next_steps(result, files[-1].parent),
        all_in="result.json",
    )


def print_estimate(result: Identification, files: Sequence[Path]) -> None:
    """Print all of a result: doubts, choices, tables, and the next step."""
    out, view, unseen = console(), identification_view(result), result.estimate.unseen
    for text in view.against:
        out.print(Text(in_options(text), style="bold"), soft_wrap=True)
    facts, count = result.facts, len(result.facts.logs)
    out.print(
        f"{result.robot.name}: {_model(result)} model, {len(result.names)} base parameters from {facts.rows} "
        f"equations of {count} log{'s' * (count > 1)}; {result.estimate.method}",
        soft_wrap=True,
    )
    out.print(_conditions(result), soft_wrap=True)
    for choice in result.choices:
        out.print(f"chosen: {in_options(choice.reason)}", soft_wrap=True)
    print_view(view)
    for log in facts.logs:
        out.print(f"{log.file}: {log.rows} rows, {log.start:.2f} s to {log.end:.2f} s", soft_wrap=True)
    if unseen:
        out.print(f"not identifiable from these logs on their own: {', '.join(unseen)}", soft_wrap=True)
    out.print(f"written to {files[-1].parent}: {', '.join(path.name for path in files)}", soft_wrap=True)
    for step in _next_steps(result, files[-1].parent):
        out.print(f"next: {step}", soft_wrap=True)


def _data(result: Identification) -> str:
    facts = result.facts
    log = facts.logs[0]
    one = f"{log.file}, {log.start:.2f} s to {log.end:.2f} s"
    named = one if len(facts.logs) == 1 else f"{len(facts.logs)} logs"
    return f"{_model(result)} model, {facts.rows} equations of {named}; estimator {result.estimate.method}"


def _conditions(result: Identification) -> str:
    measured = result.condition_number
    text = "condition number of the measured W: " + (f"{measured:.4g}" if np.isfinite(measured) else "infinite")
    designed = np.inf if result.design is None else result.design.condition_number
    return text + (f" (designed: {designed:.4g})" if np.isfinite(designed) else "")


def _least_certain(result: Identification) -> list[Any]:
    """The parameters with the widest intervals beside their size."""
    estimate = result.estimate
    sized = np.where(np.isfinite(estimate.relative_deviation), estimate.relative_deviation, -1.0)
    rows = [
        (
            estimate.names[k],
            f"{estimate.values[k]:.4g}",
            f"+- {estimate.half_width[k]:.2g}",
            estimate.units[k],
            f"{100 * sized[k]:.2g} %" if sized[k] < 1.0 else "over 100 %",
        )
        for k in np.argsort(-sized, kind="stable")[:_SHOWN]
        if sized[k] >= 0.0
    ]
    return compact_table("least certain", "value", "99 %", "unit", "std. dev.", rows=rows)


def _next_steps(result: Identification, folder: Path) -> list[str]:
    """What to do next: the cures of the doubts, or else to verify."""
    cures = dict.fromkeys(in_options(doubt.cure) for doubt in result.doubts)
    return list(cures) or [f"excite verify {folder} OTHER.csv, with a log that was not used here"]


def _model(result: Identification) -> str:
    return str(task_content(result.task)["model"])
