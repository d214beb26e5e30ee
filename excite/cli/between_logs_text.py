"""What the intervals of a result hold for, and the estimates of each log, on the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from excite.cli.messages import in_options


def print_between_logs(out: Console, content: Mapping[str, Any]) -> None:
    """Print what the intervals hold for; of several logs, a warning, and the table of ``--each``."""
    between = content.get("between_logs")
    if between is not None:
        if any("each" in p for p in between["parameters"]):
            out.print(_table(between["logs"], between["parameters"], content["parameters"]))
        if between["warning"] is not None:
            out.print(f"warning: {in_options(between['warning'])}", soft_wrap=True)
    out.print(f"note: {in_options(content['interval_scope'])}", soft_wrap=True)


def _table(
    logs: Sequence[str], parameters: Sequence[Mapping[str, Any]], together: Sequence[Mapping[str, Any]]
) -> Table:
    table = Table(title="each log alone, with its standard deviation", title_justify="left")
    table.add_column("parameter")
    for k in range(len(logs)):
        table.add_column(f"log {k + 1}", justify="right")
    table.add_column("together", justify="right")
    table.add_column("unit")
    table.add_column("scatter over stated", justify="right")
    for p, all_logs in zip(parameters, together, strict=True):
        table.add_row(
            p["name"],
            *(_value(e["value"], e["standard_deviation"]) for e in p["each"]),
            _value(all_logs["value"], all_logs["standard_deviation"]),
            p["unit"],
            "-" if p["ratio"] is None else f"{p['ratio']:.2f}" + ("*" if _is_small(p["probability"]) else ""),
        )
    table.caption = "*: less than 1 % probable from noise alone"
    return table


def _value(value: float | None, deviation: float | None) -> str:
    return "-" if value is None or deviation is None else f"{value:.4g} +- {deviation:.1g}"


def _is_small(probability: float | None) -> bool:
    return probability is not None and probability < 0.01
