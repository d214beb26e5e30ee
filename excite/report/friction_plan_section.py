"""The section of a plan of friction measurements."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from constraints.collision.collision_limits import Collisions
from constraints.linear import linear_limits
from excite.files.motion_source import read_source
from excite.files.world_file import world_of
from excite.report.drawings import drawn
from excite.report.player_data import LimitCourse, PlayedMotion, player_data, tightest
from excite.report.player_log import Appearance
from excite.report.player_motion import bodies_of, linear_courses, nearest_pairs, nonlinear_courses
from excite.report.player_shapes import matches
from excite.report.provenance_facts import facts
from excite.report.restored_friction_plan import StoredFrictionPlan, StoredRuns
from excite.report.sections import (
    ReportCell,
    ReportFigure,
    ReportSection,
    ReportTable,
    kept,
    number,
    percent,
    plain_number,
    text_of,
    unit,
)
from excite.simulation.played_limits import played_uses
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from regressors.models.partial import of_joints
from regressors.samples import Array, Index, Samples

_FRAMES = 500  # of each coordinate
_SIMPLE = 4000  # instants of a curve in the figure
_GRAVITY = {
    "none": "none",
    "cancels": "cancels over the windows",
    "subtracted": "to be subtracted by the model",
    "stated": "stated to cancel",
}
_SCHEDULE = {
    "percent": "speeds [% of the largest]", "rate": "samples per second [Hz]", "shortest": "windows last at least [s]",
    "longest": "windows last at most [s]", "stroke": "stroke to each side [rad or m]", "warm_up": "warm-up [s]",
    "repeats": "repeats of each speed", "creep": "creep speed [% of the largest]", "creeping": "creeping lasts [s]",
    "breakaways": "break-away tests in each direction", "pause": "pause at rest [s]",
    "ramping": "ramp of torque lasts [s]",
}  # fmt: skip
_MOVES = 1e-9  # of a limit, that is used
_ABOUT = (
    "The runs of the coordinates follow each other; you move the robot from one pose to the next. Torques are not "
    "shown: they are what is to be measured. Values between samples are interpolated; the certified extremes are in "
    "the table."
)


def friction_plan_section(plan: StoredFrictionPlan, prefix: str, looks: Appearance) -> ReportSection:
    """Everything that a page says of a plan of friction measurements."""
    content, robot = {**plan.content, "trajectories": _looked_at(plan)}, plan.robot
    trajectories, broken = content["trajectories"], _broken(content)
    figures, missing = _figures(plan, prefix)
    return ReportSection(
        kind="friction plan",
        title=str(plan.folder),
        verdict=_verdict(content, broken),
        holds=not broken,
        asked=(("robot", robot.name), *_asked(content["schedule"])),
        assumed=_assumed(content),
        notes=missing,
        tables=_tables(trajectories),
        figures=figures,
        motion=_motion(plan, looks),
        facts=facts({}, robot=robot.name, robot_sha256=robot.sha256(), order=content["order"], units=content["units"]),
        commands=_commands(plan),
    )  # fmt: skip


def _looked_at(plan: StoredFrictionPlan) -> list[dict[str, Any]]:
    """Trajectories of a plan, with limits of joints and drives as the samples of their files keep them."""
    sampled = {label for limit in linear_limits(plan.robot) if limit.derivative < 3 for label in limit.labels}
    known = []
    for each in plan.content["trajectories"]:
        uses, broken = played_uses(read_source(plan.folder / each["file"]))
        labels = {use.label for use in broken}
        computed = [{**use.to_dict(), "holds": use.label not in labels} for use in uses if use.label in sampled]
        stated = [use for use in each["limits"] if use["label"] not in sampled]
        known.append({**each, "limits": [*computed, *stated]})
    return known


def _asked(schedule: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    known = [(name, value) for name, value in schedule.items() if value is not None]
    return tuple((_SCHEDULE.get(name, name.replace("_", " ")), text_of(value)) for name, value in known)


def _broken(content: Mapping[str, Any]) -> list[str]:
    trajectories = content["trajectories"]
    uses = [use for each in trajectories for use in (*each["limits"], *(each["distances"] or ()))]
    passages = [f"{p['start']} to {p['end']} ({p['obstacle']})" for p in content["passages"] if p["obstacle"]]
    return [*dict.fromkeys(use["label"] for use in uses if not use["holds"]), *passages]


def _verdict(content: Mapping[str, Any], broken: Sequence[str]) -> str:
    trajectories = content["trajectories"]
    names = ", ".join(each["coordinate"] for each in trajectories)
    minutes = plain_number(round(sum(each["duration"] for each in trajectories) / 60, 1))
    windows = sum(len(each["windows"]) for each in trajectories)
    what = f"The plan measures friction of {names} in {windows} windows of constant speed; it lasts {minutes} min."
    if broken:
        return f"{what} It breaks {len(broken)} limit{'s' * (len(broken) > 1)}: {', '.join(broken)}."
    unchecked = ["collisions"] * (content["world"] is None)
    unchecked += [f"torques of {each['coordinate']}" for each in trajectories if each["torques_unchecked"]]
    said = f"; not checked: {', '.join(unchecked)}" if unchecked else ""
    return f"{what} Every limit that was checked is kept{said}."


def _assumed(content: Mapping[str, Any]) -> tuple[str, ...]:
    said = [
        "limits of joints and drives are looked at in the samples of the files; jerks, torques, distances and passages "
        "between poses are as plan.json states them",
        *content["not_looked_at"],
    ]
    if content["world"] is None:
        said.append(
            "collisions with obstacles, the floor and the robot's own links are not checked: no world file is given"
        )
    for each in content["trajectories"]:
        name = each["coordinate"]
        said += [f"{name}: torques are not checked: {each['torques_unchecked']}"] * bool(each["torques_unchecked"])
        said += [f"{name}: no limit of {what} is known; one is assumed" for what in each["assumed"]]
        said += [f"{name}: {out['percent']:g} % is left out: {out['reason']}" for out in each["left_out"]]
        said += [f"{name}: no torque ramps: {each['no_torque_ramps']}"] * bool(each["no_torque_ramps"])
    return tuple(map(str, said))


def _tables(trajectories: Sequence[Mapping[str, Any]]) -> tuple[ReportTable, ...]:
    whole = _coordinates(trajectories), _limits(trajectories)
    return (*whole, *_distances(trajectories), *_ramps(trajectories), _windows(trajectories))


def _coordinates(trajectories: Sequence[Mapping[str, Any]]) -> ReportTable:
    rows = tuple(
        (
            ReportCell(each["coordinate"]), ReportCell(", ".join(each["turns"])), number(each["stroke"]),
            unit(each["unit"]), number(each["velocity"]), ReportCell(_GRAVITY.get(each["gravity"], each["gravity"])),
            number(each["largest_gravity"]), number(len(each["windows"])), number(each["duration"]),
            ReportCell(each["file"]),
        )
        for each in trajectories
    )  # fmt: skip
    columns = (
        "coordinate", "drives that turn", "to each side", "unit", "largest speed", "gravity", "gravity torque up to",
        "windows", "lasts [s]", "file",
    )  # fmt: skip
    return ReportTable("Coordinates", columns, rows, name="coordinates")


def _limits(trajectories: Sequence[Mapping[str, Any]]) -> ReportTable:
    columns = ("coordinate", "limit", "used", "margin", "extreme", "bound", "unit", "at [s]", "holds")
    rows = tuple(
        (ReportCell(each["coordinate"]), *_use(use))
        for each in trajectories
        for use in each["limits"]
        if abs(use["use"]) > _MOVES
    )
    note = "Limits of what does not move are left out."
    return ReportTable("Margins of the limits", columns, rows, note, "limits")


def _use(use: Mapping[str, Any]) -> tuple[ReportCell, ...]:
    numbers = (number(use[name]) for name in ("margin", "extreme", "bound"))
    used = percent(use["use"], "" if use["holds"] else "bad")
    return (ReportCell(use["label"]), used, *numbers, unit(use["unit"]), number(use["time"]), kept(use["holds"]))


def _distances(trajectories: Sequence[Mapping[str, Any]]) -> tuple[ReportTable, ...]:
    rows = tuple(
        (
            ReportCell(each["coordinate"]), ReportCell(d["label"]),
            *(number(d[name]) for name in ("extreme", "bound", "margin", "at")), kept(d["holds"]),
        )
        for each in trajectories for d in each["distances"] or ()
    )  # fmt: skip
    columns = ("coordinate", "bodies", "least distance [m]", "clearance [m]", "margin [m]", "at position", "holds")
    return (ReportTable("Distances", columns, rows, name="distances"),) if rows else ()


def _ramps(trajectories: Sequence[Mapping[str, Any]]) -> tuple[ReportTable, ...]:
    known = [(each["coordinate"], each["torque_ramps"]) for each in trajectories if each["torque_ramps"]]
    rows = tuple(
        (ReportCell(name), ReportCell(r["drive"]), number(r["largest"]), unit(r["unit"]), number(len(r["ramps"])),
         number(r["duration"]), ReportCell(r["origin"]), ReportCell(r["file"]))
        for name, r in known
    )  # fmt: skip
    columns = ("coordinate", "drive", "up to", "unit", "ramps", "lasts [s]", "source of the torque", "file")
    note = "For robots with a torque interface."
    return (ReportTable("Ramps of torque from rest", columns, rows, note, "ramps"),) if rows else ()


def _windows(trajectories: Sequence[Mapping[str, Any]]) -> ReportTable:
    columns = (
        "coordinate",
        "part of the largest speed [%]",
        "speed",
        "from [s]",
        "to [s]",
        "from position",
        "to position",
    )
    rows = tuple(
        (ReportCell(each["coordinate"]), *(number(w[n]) for n in ("percent", "speed", "start", "end", "first", "last")))
        for each in trajectories for w in each["windows"]
    )  # fmt: skip
    return ReportTable("Windows of constant speed", columns, rows, name="windows", folded=True)


def _figures(plan: StoredFrictionPlan, prefix: str) -> tuple[tuple[ReportFigure, ...], tuple[str, ...]]:
    def figure() -> Any:
        from excite.plots.stored_runs_plot import stored_runs_figure

        return stored_runs_figure(plan.robot.name, [_drawn(runs) for runs in plan.runs])

    return drawn({"Runs": figure}, prefix)


def _drawn(runs: StoredRuns) -> Any:
    from excite.plots.stored_runs_plot import DrawnRuns

    c, kept = runs.content, _frames(runs, _SIMPLE)
    ramps = c["torque_ramps"]
    left_out = ", ".join(f"{each['percent']:g}" for each in c["left_out"])
    notes = [f"left out: {left_out} %"] if left_out else []
    notes += [f"in another file: ramps of torque to {ramps['largest']:.3g} {ramps['unit']}"] if ramps else []
    return DrawnRuns(
        name=str(c["coordinate"]),
        unit=str(c["unit"]),
        time=runs.time[kept],
        position=runs.s[kept],
        velocity=runs.ds[kept],
        windows=runs.windows,
        breakaways=tuple((each["start"], each["end"]) for each in c["stiction"]),
        limit=float(c["velocity"]),
        gravity=str(c["gravity"]),
        note="; ".join(notes),
    )


def _frames(runs: StoredRuns, most: int) -> Index:
    """Instants that are shown: most of them where the speed changes, some wherever it moves, few at rest."""
    step = np.diff(runs.time)
    change = np.abs(np.diff(runs.ds)) / max(float(np.abs(np.diff(runs.ds)).sum()), 1e-12)
    moves = np.abs(runs.ds[1:]) * step / max(float((np.abs(runs.ds[1:]) * step).sum()), 1e-12)
    weight = np.concatenate([[0.0], np.cumsum(0.6 * change + 0.2 * moves + 0.2 * step / step.sum())])
    found = np.searchsorted(weight, np.linspace(0.0, weight[-1], most))
    return np.unique(np.concatenate([[0], found.clip(0, runs.time.size - 1), [runs.time.size - 1]]))


def _motion(plan: StoredFrictionPlan, looks: Appearance) -> dict[str, Any]:
    """Runs of all coordinates, one after the other."""
    robot, world = plan.robot, plan.content["world"]
    known = None if world is None else world_of(world, "the world of the plan")
    limits = LimitChoice() if known is None else LimitChoice(world=known)
    task = Task(StoredRobot(robot.name, robot), limits=limits)
    time, q, dq, segments = _joined(plan.runs)
    samples = Samples(time, q, dq, np.zeros_like(q), np.zeros_like(q))
    linear = [limit for limit in linear_limits(robot) if limit.derivative < 2]
    bodies = bodies_of(robot, robot.joint_names, linear)
    moving = np.ptp(q, axis=0) > 0.0
    courses: list[LimitCourse] = []
    for limit in linear:
        labels = {label for label, row in zip(limit.labels, limit.matrix, strict=True) if row[moving].any()}
        courses += [c for c in linear_courses(limit, samples, bodies) if f"{c.owner} {c.quantity}" in labels]
    courses = tightest(courses)
    if known is not None:
        distances = Collisions(known).imposed(robot, of_joints(robot, list(range(robot.n))))
        courses += nearest_pairs([c for limit in distances for c in nonlinear_courses(limit, samples, bodies)])
    file = looks.robot_file
    shown = file if file is not None and matches(robot, task, file) else None
    shape = looks.shapes.get(robot.sha256())
    return player_data(PlayedMotion(time, q, dq, segments, courses, _ABOUT), robot, task, shape, shown)


def _joined(runs: Sequence[StoredRuns]) -> tuple[Array, Array, Array, tuple[tuple[str, float], ...]]:
    times, positions, velocities, segments, end = [], [], [], [], 0.0
    for each in runs:
        kept = _frames(each, _FRAMES)
        times.append(each.time[kept] - each.time[0] + end)
        positions.append(each.q[kept])
        velocities.append(each.dq[kept])
        end = float(times[-1][-1])
        segments.append((str(each.content["coordinate"]), end))
        end += 0.5  # from one pose to the next
    return np.concatenate(times), np.concatenate(positions), np.concatenate(velocities), tuple(segments)


def _commands(plan: StoredFrictionPlan) -> tuple[str, ...]:
    robot, folder = plan.robot.name, str(plan.folder)
    drives = ",".join(str(each["coordinate"]) for each in plan.content["trajectories"])
    return (
        shlex.join(["excite", "friction", "plan", robot, "--drives", drives, "--out", f"{folder}-again"]),
        shlex.join(["excite", "friction", "fit", robot, "LOG.csv", "--plan", folder, "--out", "friction/this"]),
    )
