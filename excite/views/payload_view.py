"""What is shown of an identified payload: mass, centre and inertia with their intervals."""

from __future__ import annotations

from excite.payload.payload_result import PayloadResult
from excite.views.view import Column, Format, View, ViewTable

_ROWS = (
    ("mass", 1.0, "kg"),
    *((f"centre {axis}", 1e3, "mm") for axis in "xyz"),
    *((f"inertia {pair}", 1.0, "kg m^2") for pair in ("xx", "xy", "xz", "yy", "yz", "zz")),
)


def payload_view(payload: PayloadResult) -> View:
    """View of a payload."""
    body, (low, high) = payload.body, payload.intervals[0]
    where = ", ".join(f"{1e3 * value:.1f}" for value in body.centre)
    held = f"The robot holds {body.mass:.4g} kg ({low:.4g} to {high:.4g} kg, 99 %), centre at {where} mm"
    return View(
        title=f"payload of {payload.robot.name}",
        verdict=f"{held}; doubt: {payload.doubts[0]}" if payload.doubts else held,
        holds=not payload.doubts,
        summary=tuple(f"doubt: {doubt}" for doubt in payload.doubts[1:]),
        against=payload.doubts,
        remarks=payload.notes,
        tables=(_numbers(payload),),
    )


def _numbers(payload: PayloadResult) -> ViewTable:
    columns = (
        Column(f"payload, by its {payload.source}", Format.TEXT, brief=True),
        Column("value", brief=True, digits=4),
        Column("unit", Format.UNIT, brief=True),
        Column("from", brief=True, digits=4),
        Column("to", brief=True, digits=4),
    )
    rows = tuple(
        (name, factor * value, unit, factor * low, factor * high)
        for (name, factor, unit), value, (low, high) in zip(
            _ROWS, payload.body.listed.tolist(), payload.intervals.tolist(), strict=True
        )
    )
    return ViewTable("payload", "Payload with its 99 % intervals", columns, rows)
