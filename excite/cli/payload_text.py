"""Summary of an identified payload on the terminal."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from excite.cli.literal_console import console
from excite.cli.messages import in_options
from excite.cli.summary import Summary, compact_table

if TYPE_CHECKING:
    from excite.payload.payload_result import PayloadResult

_ROWS = (
    ("mass", 1.0, "kg", ".4g"),
    *((f"centre {axis}", 1e3, "mm", ".1f") for axis in "xyz"),
    *((f"inertia {pair}", 1.0, "kg m^2", ".3g") for pair in ("xx", "xy", "xz", "yy", "yz", "zz")),
)


def payload_summary(payload: PayloadResult, files: Sequence[Path]) -> Summary:
    """Summary of a payload: mass and centre, and all numbers with their intervals."""
    numbers = _numbers(payload)
    mass, *centre = numbers[:4]
    where = ", ".join(row[1] for row in centre)
    held = f"The robot holds {mass[1]} kg ({mass[2]} to {mass[3]} kg, 99 %), centre at {where} mm"
    return Summary(
        verdict=f"{held}; doubt: {payload.doubts[0]}" if payload.doubts else held,
        holds=not payload.doubts,
        facts=[
            *(f"doubt: {doubt}" for doubt in payload.doubts[1:]),
            *compact_table(f"payload, by its {payload.source}", "value", "from", "to", "unit", rows=numbers, most=10),
        ],
        notes=payload.notes,
        files=files,
        next_steps=["give mass and centre to the controller; the files hold them in its form"],
        all_in="payload.json",
    )


def _numbers(payload: PayloadResult) -> list[tuple[str, ...]]:
    """Name, value, interval and unit of each number."""
    rows = zip(_ROWS, payload.body.listed, payload.intervals, strict=True)
    return [
        (name, *(format(factor * number, form) for number in (value, low, high)), unit)
        for (name, factor, unit, form), value, (low, high) in rows
    ]


def print_payload(payload: PayloadResult, controllers: Collection[str], files: Sequence[Path]) -> None:
    """Print mass, centre and inertia with their intervals, and the controllers' forms of them."""
    out, table = console(), Table()
    for heading in ("payload", "value", "from", "to", "unit"):
        table.add_column(heading, justify="left" if heading in ("payload", "unit") else "right")
    for row in _numbers(payload):
        table.add_row(*row)
    out.print(Text("\n").append(payload.robot.name, style="bold"), f": payload by its {payload.source}, 99 % intervals")
    out.print(table)
    for note in payload.notes:
        out.print(f"note: {in_options(note)}", soft_wrap=True)
    for doubt in payload.doubts:
        out.print(Text(f"doubt: {in_options(doubt)}", style="bold red"), soft_wrap=True)
    if payload.mass > 0:
        for name in controllers:
            out.print(f"\n{name}:", style="bold")
            out.print(payload.text_for(name).rstrip(), soft_wrap=True)
    out.print("written: " + ", ".join(map(str, files)), soft_wrap=True)
