"""What is shown of experiments: predicted accuracy, studies over time, the next motion, payloads and gains."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from excite.logs.log import counted
from excite.payload.calibrate_gains import CalibratedGains
from excite.payload.payload_motion import PayloadMotion
from excite.payload.payload_result import PayloadResult
from excite.study.next_motion import NextMotion
from excite.study.predict_accuracy import AccuracyPrediction
from excite.study.time_study import FIGURE, KIND, TimeCourse, TimeStudy
from excite.tasks.precision_target import PrecisionTarget
from excite.views.design_view import design_view
from excite.views.view import Column, Drawing, View, ViewTable, headed, texts
from regressors.errors import listed_names, percent


def accuracy_view(prediction: AccuracyPrediction) -> View:
    """View of what repeats of an experiment are predicted to show."""
    worst = max(prediction.parameters, key=lambda p: float(p.deviation / abs(p.value)) if p.value else 0.0)
    return View(
        kind="accuracy",
        title=f"predicted accuracy of repeats of {prediction.name}",
        verdict=f"Least certain in repeats: {worst.name}, {worst.value:.4g} +- {worst.deviation:.2g} {worst.unit}",
        summary=(
            f"{len(prediction.parameters)} parameters of {prediction.robot}, {prediction.model} model; deviations to "
            f"{percent(prediction.precision)} ({prediction.count} samples)",
        ),
        remarks=prediction.notes,
        tables=(_predicted(prediction),),
    )


def _predicted(prediction: AccuracyPrediction) -> ViewTable:
    columns = headed("*parameter:text, *expected:4, *unit:unit, *by torques:2, *by motion:2, *deviation:2, *bias:2")
    rows = tuple(
        (p.name, p.value, p.unit, p.by_torques, p.by_motion, p.deviation, p.bias) for p in prediction.parameters
    )
    return ViewTable("accuracy", "Predicted accuracy of repeats", columns, rows, most=12)


def study_view(study: TimeStudy) -> View:
    """View of a study."""
    verdict, known = _verdict(study)
    return View(
        kind="study",
        title=f"study of {study.robot}",
        verdict=verdict,
        holds=known,
        summary=tuple(_sentence(course, study.below) for course in study.courses),
        remarks=tuple(f"{c.name}: {text}" for c in study.courses for text in (*_scatter(c), *c.notes)),
        asked=(
            ("robot", study.robot),
            ("motions", ", ".join(course.name for course in study.courses)),
            ("deviation to fall below", f"{100 * study.below:g} %"),
        ),
        tables=(_motions(study), *(_parameters(course, study.below) for course in study.courses)),
        figures=(Drawing("Estimates over time", FIGURE, "identification_plots.estimates_over_time_figure", (study,)),),
        filed=KIND,
        facts={"robot": study.robot, "robot_sha256": study.sha256},
    )


def _verdict(study: TimeStudy) -> tuple[str, bool]:
    """Which motion determines all parameters soonest, and whether one does."""
    share = f"{100 * study.below:g} %"
    times = [(float(course.time_below(study.below).max()), course.name) for course in study.courses]
    known = sorted((time, name) for time, name in times if np.isfinite(time))
    if known:
        time, name = known[0]
        return f"{name} determines every parameter to {share} soonest, after {time:.3g} s", True
    late = [(int(np.isnan(course.time_below(study.below)).sum()), course) for course in study.courses]
    count, course = min(late, key=lambda pair: pair[0])
    left = f"{count} of {len(course.names)}"
    return f"No motion determines every parameter to {share}; {course.name} leaves fewest: {left}", False


def _sentence(course: TimeCourse, below: float) -> str:
    times = course.time_below(below)
    known, count = int(np.isfinite(times).sum()), times.size
    all_of = "all" if known == count else f"{known} of"
    begin = f"{course.name} determines {all_of} {count} parameters within {100 * below:g} %"
    after = f" after {float(np.nanmax(times)):.3g} s" if known else ""
    return f"{begin}{after}, of {float(course.time[-1]):.3g} s."


def _scatter(course: TimeCourse) -> tuple[str, ...]:
    """How far repetitions scatter against what is stated."""
    if course.scatter is None:
        return ()
    seen = np.isfinite(course.deviation[-1]) & (course.deviation[-1] > 0)
    if not seen.any():
        return ()
    ratio = course.scatter[-1, seen] / course.deviation[-1, seen]
    return (
        f"{course.repetitions} repetitions scatter by {np.median(ratio):.2f} times the stated deviations (median; "
        f"{ratio.min():.2f} to {ratio.max():.2f})",
    )


def _motions(study: TimeStudy) -> ViewTable:
    share = f"{100 * study.below:g} %"
    columns = headed(
        f"*motion:text, *lasts [s], *cond(W)?rank too low, *all below {share} [s]?never, *half [s]?never, "
        "*still above, parameters, *last:text"
    )
    return ViewTable("courses", "Motions", columns, tuple(_motion(course, study.below) for course in study.courses))


def _motion(course: TimeCourse, below: float) -> tuple[Any, ...]:
    times = course.time_below(below)
    late, final = np.isnan(times), course.relative_deviation[-1]
    ranked = np.sort(np.where(late, np.inf, times))
    worst = int(np.argmax(np.where(late, 1e9 + np.nan_to_num(final, posinf=1e9), times)))
    ends = (float(x[-1]) for x in (course.time, course.condition_number, ranked))
    last = f"{course.names[worst]}, {_last(course, worst)}"
    return (course.name, *ends, float(ranked[(ranked.size - 1) // 2]), int(late.sum()), late.size, last)


def _last(course: TimeCourse, k: int) -> str:
    """Deviation of a parameter at the end, in relation to its magnitude where it has one."""
    if np.isfinite(share := course.relative_deviation[-1, k]):
        return percent(share, 3)
    if np.isfinite(deviation := course.deviation[-1, k]):
        return f"{deviation:.3g} {course.units[k]} of zero"
    return "not identified"


def _parameters(course: TimeCourse, below: float) -> ViewTable:
    known = "true value" if course.reference_kind == "truth" else "description"
    columns = headed(
        "parameter:text, final value, half of its interval, unit:unit, relative deviation:%, "
        f"within {100 * below:g} % from [s]?never, {known}, scatter of repetitions, deviation as stated"
    )
    nothing = [None] * len(course.names)
    scatter, stated = (nothing, nothing) if course.scatter is None else (course.scatter[-1], course.deviation[-1])
    value, half, relative = (x[-1] for x in (course.values, course.half_width, course.relative_deviation))
    rows = zip(
        course.names, value, half, course.units, relative, course.time_below(below), course.reference, scatter, stated,
        strict=True,
    )  # fmt: skip
    return ViewTable("course", f"Parameters by {course.name}", columns, tuple(rows))


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
        kind="payload",
        title=f"payload of {payload.robot.name}",
        verdict=f"{held}; doubt: {payload.doubts[0]}" if payload.doubts else held,
        holds=not payload.doubts,
        numbers=(("mass", f"{body.mass:.4g} kg"), ("99 %", f"{low:.4g} to {high:.4g} kg"), ("centre", f"{where} mm")),
        against=tuple(f"doubt: {doubt}" for doubt in payload.doubts[1:]),
        remarks=payload.notes,
        tables=(_numbers(payload),),
        facts={"robot": payload.robot.name, "robot_sha256": payload.robot.sha256()},
    )


def _numbers(payload: PayloadResult) -> ViewTable:
    columns = (*texts(f"payload, by its {payload.source}", brief=True), *headed("*value:4, *unit:unit, *from:4, *to:4"))
    values, intervals, rows = payload.body.listed.tolist(), payload.intervals.tolist(), []
    for (name, factor, unit), value, (low, high) in zip(_ROWS, values, intervals, strict=True):
        rows.append((name, factor * value, unit, factor * low, factor * high))
    return ViewTable("payload", "Payload with its 99 % intervals", columns, tuple(rows), most=len(rows))


def gains_view(calibrated: CalibratedGains) -> View:
    """View of the gains of drives, calibrated with a known load."""
    gains, factors = calibrated.gains, calibrated.gains.factor
    columns = (*headed("*drive:text, *factor:4"), Column("99 %, +-", brief=True, digits=2))
    deviations = (calibrated.quantile * gains.deviation).tolist()
    rows = tuple(zip(gains.drives, factors.tolist(), deviations, strict=True))
    return View(
        title=f"gains of {calibrated.robot}",
        verdict=f"Gains of {calibrated.robot} are {factors.min():.3f} to {factors.max():.3f} times those stated",
        summary=(
            f"with stated gains, the load of {calibrated.known_mass:g} kg would weigh {calibrated.stated_mass:.4g} kg",
        ),
        remarks=tuple(calibrated.notes),
        tables=(ViewTable("gains", "Factors of the stated gains", columns, rows),),
    )


def next_motion_view(step: NextMotion) -> View:
    """View of what is in hand towards a precision, and of what the next motion would bring."""
    count = sum(math.isfinite(parameter.allowed) for parameter in step.parameters)
    planned = f", once {', '.join(step.planned)} is played" if step.planned else ""
    enough = f"Enough: stop. All {count} parameters of {step.robot} are known as precisely as asked for{planned}"
    missing = f"{len(step.missing)} of {count} parameters of {step.robot} are not known as precisely as asked for"
    return View(
        kind="next motion",
        title=f"what is known of {step.robot}",
        verdict=enough if step.enough else missing,
        holds=step.enough,
        summary=_runs(step),
        remarks=(*_not_asked(step), *(() if step.design is None else step.design.notes)),
        tables=_in_hand(step),
    )


def _in_hand(step: NextMotion) -> tuple[ViewTable, ...]:
    """What is missing, or else known, and, where anything is missing, everything."""
    columns = headed("value:4, half-width, allowed, then, unit:text")
    rows = {p.name: (p.name, p.value, p.half_width, p.allowed, p.expected, p.unit) for p in step.parameters}
    wide = {parameter.name for parameter in step.missing}
    brief = tuple(replace(each, brief=True) for each in (*texts("missing" if wide else "known"), *columns))
    short = tuple(row for name, row in rows.items() if name in wide or not wide)
    title = "Half-widths of the intervals, in hand and after the next motion"
    whole = ViewTable("in-hand", title, (*texts("parameter"), *columns), tuple(rows.values()))
    return (ViewTable("missing", "What is missing", brief, short), whole) if wide else (replace(whole, columns=brief),)


def _not_asked(step: NextMotion) -> tuple[str, ...]:
    """Parameters that a share of every one leaves out, since nothing is known of their size."""
    names = [parameter.name for parameter in step.parameters if not math.isfinite(parameter.allowed)]
    asked = step.task.objective.precision
    if not names or not isinstance(asked, PrecisionTarget) or asked.share is None:
        return ()
    return (
        f"nothing is asked of {listed_names(names, 3)}: their size is not described, and what was measured of them may "
        "be zero; a YAML file for `precision` can state it, under scales",
    )


def _runs(step: NextMotion) -> tuple[str, ...]:
    forecast = step.forecast
    if forecast is None or step.design is None:
        return ()
    runs = counted(forecast.runs, "run")
    expected = "expected to be enough" if forecast.met else "which are not enough yet"
    return (f"next motion: {step.design.trajectory.duration:g} s, {runs}, {forecast.robot_seconds:g} s; {expected}",)
