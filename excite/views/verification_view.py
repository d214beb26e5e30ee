"""What is shown of a verification: errors of torques and of the simulated motion, with the verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from excite.verification.verification import Verification
from excite.views.view import Column, Format, View, ViewTable

TITLES = {
    "torques": "Predicted and measured",
    "motion": "Simulated and measured motion",
    "parts": "What the errors are made of",
}


def verification_view(verification: Verification) -> View:
    """View of a verification."""
    v, log = verification, verification.log
    tolerances = {"torque": v.tolerances.torque, "motion": v.tolerances.motion}
    robot = {} if v.robot is None else {"robot": v.robot.name, "robot_sha256": v.robot.sha256()}
    return View(
        title=f"verification on {log.file}",
        verdict=v.verdict.text,
        holds=v.holds,
        summary=(_predicted(v),),
        against=v.verdict.against,
        remarks=(*v.verdict.remarks, *log.notes),
        asked=tuple((f"tolerance of the {name}", f"{100 * value:g} %") for name, value in tolerances.items()),
        tables=(_torques(v), _parts(v), *_motions(v), _errors(v)),
        figures=_figures(v),
        endings=tuple(TITLES),
        facts={**robot, "log": log.file, "log_sha256": log.sha256},
    )


def _predicted(v: Verification) -> str:
    identified = "" if v.training_error is None else f" ({100 * v.training_error:.3g} % where identified)"
    whole = v.corrected_total
    known = whole is not None and whole.noise != 0 and math.isfinite(whole.relative)
    less = f", within {100 * whole.relative:.3g} % without the noise of the measurement" if whole and known else ""
    return (
        f"{v.log.file}: {v.log.rows} rows; torques are predicted within {100 * v.relative_error:.3g} % of what was "
        f"measured{identified}{less}; allowed are {100 * v.tolerances.torque:g} %, and "
        f"{100 * v.tolerances.motion:g} % of a motion"
    )


def _torques(v: Verification) -> ViewTable:
    moved = {motion.name: motion.relative for motion in v.motions or ()}
    less: Sequence[float | None] = [part.relative for part in v.corrected] or [None] * len(v.torques)
    columns = (
        Column("equation", Format.TEXT, brief=True),
        Column("measured"),
        Column("torque error", brief=True),
        Column("unit", Format.UNIT, brief=True),
        Column("of measured", Format.PERCENT, brief=True),
        Column("less noise", Format.PERCENT),
        Column("simulated motion", Format.PERCENT, brief=True),
        Column("worst"),
        Column("at [s]"),
    )
    rows = tuple(
        (t.name, t.measured, t.error, t.unit, t.relative, part, moved.get(t.name), t.worst, t.worst_time)
        for t, part in zip(v.torques, less, strict=True)
    )
    return ViewTable("torques", "Predicted against measured", columns, rows)


def _parts(v: Verification) -> ViewTable:
    columns = (
        Column("equation", Format.TEXT),
        Column("noise", Format.PERCENT),
        Column("standstill", Format.PERCENT),
        Column("model", Format.PERCENT),
        Column("limited by", Format.TEXT),
    )
    rows = tuple((t.name, t.noise, t.standstill, t.systematic, t.limited_by) for t in v.torques)
    return ViewTable("parts", "What the errors are made of", columns, rows)


def _motions(v: Verification) -> tuple[ViewTable, ...]:
    if v.motions is None:
        return ()
    columns = (
        Column("joint", Format.TEXT),
        Column("travel"),
        Column("error"),
        Column("unit", Format.UNIT),
        Column("of travel", Format.PERCENT),
        Column("worst"),
        Column("at [s]"),
    )
    rows = tuple((m.name, m.travel, m.error, m.unit, m.relative, m.worst, m.worst_time) for m in v.motions)
    return (ViewTable("motions", "Simulated against measured motion", columns, rows),)


def _errors(v: Verification) -> ViewTable:
    whole = v.corrected_total
    rows = (
        ("on this log", v.relative_error),
        ("on this log, without the noise of the measurement", None if whole is None else whole.relative),
        ("on the logs of the identification", v.training_error),
    )
    columns = (Column("", Format.TEXT), Column("relative error", Format.PERCENT))
    return ViewTable("errors", "Error of the predicted torques over all equations", columns, rows)


def _figures(v: Verification) -> dict[str, Callable[[], Any]]:
    """Figures that its curves can draw."""
    drawable = [name for name in TITLES if len(v.time) and (name != "motion" or v.replay is not None)]
    return {TITLES[name]: partial(_drawn, v, name) for name in drawable}


def _drawn(v: Verification, name: str) -> Any:
    from excite.plots import error_parts_figure, predicted_torques_figure, simulated_motion_figure

    draw = {"torques": predicted_torques_figure, "motion": simulated_motion_figure, "parts": error_parts_figure}
    return draw[name](v)
