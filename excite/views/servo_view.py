"""What is shown of servos: their quantities with intervals, and the errors of the motion that they predict."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.identification.servo_result import MotionFit, ServoResult, unit_of
from excite.verification.verify_servos import ServoVerification
from excite.views.view import Column, Drawing, View, ViewTable, headed, texts
from regressors.errors import listed_names
from regressors.models.servo_response import QUANTITIES, RATIOS, SYMBOLS, ServoQuantity
from regressors.samples import Array

_MOTION = Drawing("Predicted and measured motion", "motion", "verification_plots.servo_motion_figure")
_QUANTITIES, _MOTIONS = "Servos with their 99 % intervals", "Predicted motion, and what the bare command predicts"


def servos_view(result: ServoResult) -> View:
    """View of identified servos."""
    shown, ratios = (f"{int(known.sum())} of {known.size}" for known in (result.known, result.known_ratios))
    return View(
        kind="servos",
        title=f"servos of {result.robot.name}",
        verdict=f"Identified {len(result.values)} servos of {result.robot.name}: the logs show {shown} "
        f"quantities, and {ratios} ratios to the stiffness",
        holds=not result.doubts,
        numbers=(
            ("quantities shown by the logs", shown),
            ("ratios to the stiffness shown by the logs", ratios),
            ("joints better than a delayed command", f"{sum(f.better for f in result.fits)} of {len(result.fits)}"),
        ),
        against=tuple(f"doubt: {doubt}" for doubt in result.doubts),
        summary=(f"from {result.windows} windows of {listed_names([log.file for log in result.logs])}",),
        remarks=(*result.notes, *(f"{log.file}: {text}" for log in result.logs for text in log.left_out)),
        tables=(_shown(result), _ratios(result), _errors(result.fits), _quantities(result)),
        facts={"robot": result.robot.name, "robot_sha256": result.robot.sha256()},
    )


_BRIEF = ("K", "D", "J", "Fc", "d", "L")


def _shown(result: ServoResult) -> ViewTable:
    """What the logs show of each servo; a dash for what they do not."""
    linear = _linear(result)
    units = [f"{q.unit} or {q.linear_unit}" if linear else q.unit for q in QUANTITIES]
    columns = (
        *texts("joint", brief=True),
        *(Column(f"{q.symbol} [{unit}]", brief=q.symbol in _BRIEF) for q, unit in zip(QUANTITIES, units, strict=True)),
        Column("L/D [rad/s or m/s]" if linear else "L/D [rad/s]"),
    )
    speeds = np.where(result.known[:, [SYMBOLS.index(s) for s in "DL"]].all(axis=1), result.speed_limit, np.nan)
    values, known = np.column_stack([result.values, speeds]), np.column_stack([result.known, np.isfinite(speeds)])
    named = ", ".join(f"{q.symbol} {q.name}" for q in QUANTITIES)
    note = f"{named}, L/D speed limit; - is not shown"
    return ViewTable("servos", "What the logs show of each servo", columns, _rows(result, values, known), note=note)


def _ratios(result: ServoResult) -> ViewTable:
    """Ratios that the logs show, for which no mass has to be known."""
    linear, quantities = _linear(result), [QUANTITIES[k] for k in RATIOS]
    units = [" or ".join(dict.fromkeys(q.over_stiffness[: 2 if linear else 1])) for q in quantities]
    named = zip(quantities, units, strict=True)
    columns = [Column(f"{q.symbol}/K [{unit}]", brief=q.symbol in _BRIEF) for q, unit in named]
    rows, title = _rows(result, result.ratios[0], result.known_ratios), "Ratios to the stiffness, which no mass sets"
    return ViewTable("ratios", title, (*texts("joint", brief=True), *columns), rows, note="- is not shown")


def _rows(result: ServoResult, values: Array, known: NDArray[np.bool_]) -> tuple[tuple[Any, ...], ...]:
    """Name of each joint with its values, None for those that the logs do not show."""
    shown = np.where(known, values, np.array(None)).tolist()
    return tuple((joint.name, *row) for joint, row in zip(result.robot.joints, shown, strict=True))


def _linear(result: ServoResult) -> bool:
    return any(joint.kind == "prismatic" for joint in result.robot.joints)


def _quantities(result: ServoResult) -> ViewTable:
    rows = tuple(
        (joint.name, q.name, q.symbol, _stated(q, value), half, unit_of(q, joint.kind), "yes" if known else "no")
        for joint, *numbers in zip(result.robot.joints, result.values, result.half_width, result.known, strict=True)
        for q, value, half, known in zip(QUANTITIES, *(each.tolist() for each in numbers), strict=True)
    )
    columns = headed("joint:text, quantity:text, symbol:text, value:4, +-:2, unit:unit, shown:text")
    return ViewTable("quantities", _QUANTITIES, columns, rows)


def _stated(quantity: ServoQuantity, value: float) -> float | None:
    """A value; None for a limit that no motion reaches."""
    return value if value < quantity.most else None


def _errors(fits: Sequence[MotionFit]) -> ViewTable:
    rows = tuple(
        (f.joint, f.position_error, f.delayed_error, f.delay, f.command_error, f.unit, _judged(f)) for f in fits
    )
    columns = headed(
        "*joint:text, *error:3, *of the delayed command:3, *delay [s]:2, *of the command:3, *unit:unit, *this log:text"
    )
    return ViewTable("motions", _MOTIONS, columns, rows, most=12)


def _judged(fit: MotionFit) -> str:
    if not fit.moves:
        return "cannot judge"
    return "confirms" if fit.better else "contradicts"


def servo_verifications_view(judged: Sequence[ServoVerification]) -> View:
    """View of the verifications of servos on several logs, of which those that do not hold are first."""
    negative = sum(not each.holds for each in judged)
    worse = f"Do not rely on the servos: they do not hold on {negative} of {len(judged)} logs."
    better = f"The servos predict each of {len(judged)} logs: you can rely on them for motions of these kinds."
    rows = tuple(
        (v.log.file, "holds" if v.holds else "DOES NOT HOLD", listed_names(v.contradicted), *_means(v.fits))
        for v in sorted(judged, key=lambda each: each.holds)
    )
    columns = headed("*log:text, *verdict:text, *contradicted:text, *mean error:3, *of delayed commands:3")
    note = "means of all joints [rad; m of prismatic ones]"
    return View(
        kind="verification",
        title=f"verification on {len(judged)} logs",
        verdict=worse if negative else better,
        holds=not negative,
        remarks=tuple(f"{v.log.file}: {text}" for v in judged for text in v.log.left_out),
        tables=(ViewTable("logs", "Verdict on each log", columns, rows, note=note),),
    )


def _means(fits: Sequence[MotionFit]) -> tuple[float, ...]:
    return tuple(float(np.mean([getattr(f, name) for f in fits])) for name in ("position_error", "delayed_error"))


def servo_verification_view(verification: ServoVerification, name: str = "") -> View:
    """View of a verification of servos, whose files begin with a name."""
    v = verification
    name = name or f"verification-{PurePath(v.log.file).stem}"
    return View(
        kind="verification",
        title=f"verification on {v.log.file}",
        verdict=v.verdict,
        holds=v.holds,
        numbers=(
            (f"joints confirmed on {PurePath(v.log.file).stem}", f"{sum(f.better for f in v.fits)} of {len(v.fits)}"),
        ),
        summary=("errors are root mean squares of the motion that follows from the commands alone",),
        remarks=v.log.left_out,
        tables=(_errors(v.fits),),
        figures=(_MOTION.of(v),) if len(v.time) else (),
        filed=name,
        stem=f"{name}_",
        facts={"robot": v.robot.name, "robot_sha256": v.robot.sha256(), "log": v.log.file, "log_sha256": v.log.sha256},
    )
