"""What is shown of a study over time: how soon motions determine the parameters."""

from __future__ import annotations

from typing import Any

import numpy as np

from excite.study.time_study import FIGURE, KIND, TimeCourse, TimeStudy
from excite.views.view import UNIT, Column, Drawing, View, ViewTable, numbers, percents, texts


def study_view(study: TimeStudy) -> View:
    """View of a study."""
    verdict, known = _verdict(study)
    return View(
        kind="study",
        title=f"study of {study.robot}",
        verdict=verdict,
        holds=known,
        summary=tuple(_sentence(course, study.below) for course in study.courses),
        remarks=tuple(
            f"{course.name}: {text}" for course in study.courses for text in (*_scatter(course), *course.notes)
        ),
        asked=(
            ("robot", study.robot),
            ("motions", ", ".join(course.name for course in study.courses)),
            ("deviation to fall below", f"{100 * study.below:g} %"),
        ),
        tables=(_motions(study), *(_parameters(course, study.below) for course in study.courses)),
        figures=(Drawing("Estimates over time", FIGURE, "estimates_plot.estimates_over_time_figure", (study,)),),
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
    return f"No motion determines every parameter to {share}; fewest are left by {course.name}: {left}", False


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
    columns = (
        *texts("motion", brief=True),
        *numbers("lasts [s]", brief=True),
        Column("cond(W)", brief=True, missing="rank too low"),
        Column(f"all below {share} [s]", brief=True, missing="never"),
        Column("half [s]", brief=True, missing="never"),
        *numbers("still above", brief=True),
        *numbers("parameters"),
        *texts("last", brief=True),
    )
    return ViewTable("courses", "Motions", columns, tuple(_motion(course, study.below) for course in study.courses))


def _motion(course: TimeCourse, below: float) -> tuple[Any, ...]:
    times = course.time_below(below)
    late, final = np.isnan(times), course.relative_deviation[-1]
    ranked = np.sort(np.where(late, np.inf, times))
    worst = int(np.argmax(np.where(late, 1e9 + np.nan_to_num(final, posinf=1e9), times)))
    return (
        course.name,
        float(course.time[-1]),
        float(course.condition_number[-1]),
        float(ranked[-1]),
        float(ranked[(ranked.size - 1) // 2]),
        int(late.sum()),
        late.size,
        f"{course.names[worst]}, {_last(course, worst)}",
    )


def _last(course: TimeCourse, k: int) -> str:
    """Deviation of a parameter at the end, in relation to its magnitude where it has one."""
    if np.isfinite(share := course.relative_deviation[-1, k]):
        return f"{100 * share:.3g} %"
    if np.isfinite(deviation := course.deviation[-1, k]):
        return f"{deviation:.3g} {course.units[k]} of zero"
    return "not identified"


def _parameters(course: TimeCourse, below: float) -> ViewTable:
    times = course.time_below(below)
    columns = (
        *texts("parameter"),
        *numbers("final value", "half of its interval"),
        UNIT,
        *percents("relative deviation"),
        *numbers(f"within {100 * below:g} % from [s]", missing="never"),
        *numbers(
            "true value" if course.reference_kind == "truth" else "description",
            "scatter of repetitions",
            "deviation as stated",
        ),
    )
    rows = tuple(_parameter(course, k, float(times[k])) for k in range(len(course.names)))
    return ViewTable("course", f"Parameters by {course.name}", columns, rows)


def _parameter(course: TimeCourse, k: int, time: float) -> tuple[Any, ...]:
    deviation = course.deviation[-1, k]
    scatter = (None, None) if course.scatter is None else (course.scatter[-1, k], deviation)
    return (
        course.names[k],
        course.values[-1, k],
        course.half_width[-1, k],
        course.units[k],
        course.relative_deviation[-1, k],
        time,
        course.reference[k],
        *scatter,
    )
