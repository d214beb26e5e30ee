"""What is shown of an identified payload: mass, centre and inertia with their intervals."""

from __future__ import annotations

from dataclasses import replace

from excite.payload.payload_motion import PayloadMotion
from excite.payload.payload_result import PayloadResult
from excite.views.design_view import design_view
from excite.views.view import BRIEF_UNIT, View, ViewTable, numbers, texts

_ROWS = (
    ("mass", 1.0, "kg"),
    *((f"centre {axis}", 1e3, "mm") for axis in "xyz"),
    *((f"inertia {pair}", 1.0, "kg m^2") for pair in ("xx", "xy", "xz", "yy", "yz", "zz")),
)


def payload_motion_view(motion: PayloadMotion) -> View:
    """View of a motion that identifies a payload: of its design, with its own remarks."""
    view = design_view(motion.design)
    return replace(view, remarks=(*motion.notes, *view.remarks))


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
        *texts(f"payload, by its {payload.source}", brief=True),
        *numbers("value", brief=True, digits=4),
        BRIEF_UNIT,
        *numbers("from", "to", brief=True, digits=4),
    )
    rows = tuple(
        (name, factor * value, unit, factor * low, factor * high)
        for (name, factor, unit), value, (low, high) in zip(
            _ROWS, payload.body.listed.tolist(), payload.intervals.tolist(), strict=True
        )
    )
    return ViewTable("payload", "Payload with its 99 % intervals", columns, rows)
