"""What is shown of friction: the plan of its measurements, and the curves that are fitted to them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np

from excite.design.friction_runs.friction_plan import FIGURE, KIND, ORDER, UNITS, CoordinatePlan, FrictionPlan
from excite.design.friction_runs.schedule import LONGEST, Schedule
from excite.design.stated_limits import kept_headline
from excite.friction.constant_speed_windows import FitSettings
from excite.friction.friction_fit import FIGURE as FRICTION_FIGURE, KIND as FRICTION_FIT, Characteristic, FrictionFit
from excite.views.view import Drawing, View, ViewTable, headed

_LONG = 600.0  # total duration that counts as long [s]
_MOVES = 1e-9  # of a limit, that is used
_GRAVITY_OF_PLAN = {"subtracted": "subtracted by the model", "stated": "cancels, as `balanced` states"}
_SCHEDULE = {
    "percent": "speeds [% of the largest]", "rate": "samples per second [Hz]", "shortest": "windows last at least [s]",
    "longest": "windows last at most [s]", "stroke": "stroke to each side [rad or m]", "warm_up": "warm-up [s]",
    "repeats": "repeats of each speed", "creep": "creep speed [% of the largest]", "creeping": "creeping lasts [s]",
    "breakaways": "break-away tests in each direction", "pause": "pause at rest [s]",
    "ramping": "ramp of torque lasts [s]",
}  # fmt: skip


def friction_plan_view(plan: FrictionPlan) -> View:
    """View of a plan of friction measurements."""
    coordinates = plan.coordinates
    first, *others = _environment(plan)
    each = ", ".join(f"{percent:g}" for percent in coordinates[0].order)
    return View(
        kind="friction plan",
        title=f"friction measurements of {plan.robot.name}",
        verdict=_plan_verdict(plan),
        holds=plan.holds,
        summary=(first,),
        remarks=(
            *(note for c in coordinates for note in _coordinate(plan, c)),
            *others,
            *_length(plan),
            *_ramp_notes(plan),
            f"order, to keep the temperature steady: warm-up, stiction, then {each} % there and back",
        ),
        asked=(("robot", plan.robot.name), *_asked(plan.schedule)),
        tables=(
            _coordinates(coordinates),
            _limits(coordinates),
            *_distances(coordinates),
            *_ramps(coordinates),
            _windows(coordinates),
        ),
        figures=(Drawing("Runs", FIGURE, "friction_plots.friction_plan_figure", (plan,)),),
        filed=KIND,
        facts={"robot": plan.robot.name, "robot_sha256": plan.robot.sha256(), "order": ORDER, "units": UNITS},
    )


def _asked(schedule: Schedule) -> tuple[tuple[str, str], ...]:
    known = {each.name: getattr(schedule, each.name) for each in fields(schedule)}
    texts = {name: ", ".join(f"{v:g}" for v in np.atleast_1d(value)) for name, value in known.items()}
    return tuple((_SCHEDULE[name], text) for name, text in texts.items() if text != "inf")


def _plan_verdict(plan: FrictionPlan) -> str:
    names, windows = ", ".join(c.label for c in plan.coordinates), sum(len(c.windows) for c in plan.coordinates)
    what = (
        f"The plan measures friction of {names} in {windows} windows of constant speed; it lasts "
        f"{plan.duration / 60:.1f} min."
    )
    broken = [use.label for c in plan.coordinates for use in (*c.broken, *(d.use for d in c.too_near))]
    if broken := list(dict.fromkeys(broken)):
        return f"{what} It breaks {len(broken)} limit{'s' * (len(broken) > 1)}: {', '.join(broken)}."
    unchecked = [each.limit for each in plan.unchecked] or ["collisions"] * (plan.world is None)
    unchecked += [f"torques of {c.label}" for c in plan.coordinates if c.torques_unchecked]
    except_for = f"; not checked: {', '.join(unchecked)}" if unchecked else ""
    kept = kept_headline([each.limit for each in plan.unchecked], "every limit that was checked is kept")
    return f"{what} {kept[:1].upper()}{kept[1:]}{except_for}."


def _environment(plan: FrictionPlan) -> Iterator[str]:
    """Notes on collision checks, and on transfers from pose to pose."""
    yours = "you move the robot from one pose to the next"
    for each in plan.unchecked:
        yield f"not checked: {each}; watch the strokes"
    if plan.world is None:
        yield f"collisions are not checked; {yours}"
        return
    free = [f"{p.start} to {p.end}" for p in plan.passages if not p.obstacle]
    lines_free = f"; straight lines in joint space are free from {', '.join(free)}" if free else ""
    hold = "distances hold in every position that a run passes"
    if any(c.too_near for c in plan.coordinates):
        hold = "distances do not hold"
    elif not any(c.distances for c in plan.coordinates):
        hold = "no two bodies that are known can collide, so no distance is checked"
    yield f"{hold}; {yours}{lines_free}"
    yield from plan.notes
    for p in plan.passages:
        if p.obstacle:
            where = f"{p.start} to {p.end}: on the straight line in joint space"
            yield f"{where} {p.obstacle} are too close; go around them"


def _coordinate(plan: FrictionPlan, c: CoordinatePlan) -> Iterator[str]:
    """Notes on one coordinate."""
    if c.left_out:
        each = ", ".join(f"{left.percent:g}" for left in c.left_out)
        at = f" at {c.left_out[0].percent:g} %" if len(c.left_out) > 1 else ""
        yield f"{c.label}: {each} % left out: {c.left_out[0].reason}{at}; a lower `shortest` allows shorter windows"
    if c.gravity == "subtracted":
        nowhere = "no pose in which it cancels has room for the runs"
        nowhere = "it does not cancel about the pose" if plan.given_pose else nowhere
        yield f"{c.label}: gravity: {nowhere}; `fit_friction` subtracts it by the model"
    for use in c.broken:
        excess = f"{use.extreme:.4g} {use.unit} beyond {use.bound:.4g} at {use.time:.2f} s"
        cure = "lower `acceleration`, or where the weight alone exceeds it, give another `pose` or check the limit"
        yield f"{c.label}: {use.label} does not hold: {excess}; {cure}"
    yield from _nearness(plan, c)
    if c.torques_unchecked:
        yield f"{c.label}: torque limits are not checked: {c.torques_unchecked}"
    if len(c.turns) > 1:
        yield f"{c.label} moves {', '.join(c.turns)}: the runs measure the sum of their friction"
    if c.pace.assumed:
        known = " and ".join(f"{what} {getattr(c.pace, what):.3g}" for what in c.pace.assumed)
        yield f"{c.label}: no limit is known; assumed: {known} (SI)"


def _nearness(plan: FrictionPlan, c: CoordinatePlan) -> Iterator[str]:
    """Notes on bodies that come too near, or on the nearest ones."""
    other = "leave out `pose` to let the plan choose one, or give another one"
    cure = other if plan.given_pose else "give another `pose`"
    for d in c.too_near:
        apart = f"{d.use.extreme:.3g} m apart" if d.use.extreme > 0.0 else "in collision"
        apart = (
            apart if d.use.unit == "m" else f"at {d.use.extreme:.3g} {d.use.unit}"
        )  # of a joint that keeps them apart
        yield (
            f"{c.label}: {d.use.label} are {apart} at {c.label} = {d.at:.4g} {c.unit} ({d.use.time:.2f} s), "
            f"{d.use.bound:.3g} {d.use.unit} must be kept"
        )
    if c.too_near:
        yield f"{c.label}: {cure}, or move the obstacle, in the robot's cell and in the world file"
    between = [each for each in c.distances or () if each.use.unit == "m"]
    if c.too_near or not between:
        return
    d = min(between, key=lambda each: each.use.margin)
    bounds = f"; that bounds the stroke to {c.place.half:.3g} {c.unit}" if c.place.obstacle else ""
    yield (
        f"{c.label}: nearest is {d.use.label}, {d.use.extreme:.3g} m apart at {c.label} = {d.at:.4g} {c.unit}, "
        f"{d.use.bound:.3g} m is kept{bounds}"
    )


def _length(plan: FrictionPlan) -> Iterator[str]:
    longest = plan.schedule.longest
    if plan.duration > _LONG and longest > LONGEST:
        shorter = plan.lasting(LONGEST) / 60
        bound = f"at most {longest:g} s long" if np.isfinite(longest) else "as long as the range allows"
        yield (
            f"windows are {bound}; `longest={LONGEST:g}` shortens the plan to {shorter:.1f} min "
            "and keeps the temperature steadier: the gears cool in long slow runs"
        )


def _ramp_notes(plan: FrictionPlan) -> Iterator[str]:
    """Largest torques of the ramps, or reasons for none."""
    origins: dict[str, list[str]] = {}
    reasons: dict[str, list[str]] = {}
    for c in plan.coordinates:
        if c.ramps is None:
            reasons.setdefault(c.no_ramps, []).append(c.label)
        else:
            origins.setdefault(c.ramps.origin, []).append(f"{c.label} to {c.ramps.largest:.3g} {c.ramps.unit}")
    if origins:
        each = "; ".join(f"{', '.join(torques)} ({origin})" for origin, torques in origins.items())
        yield (
            f"ramps of torque, for robots with a torque interface, over {plan.schedule.ramping:g} s in "
            f"NAME.stiction.csv: {each}; the controller adds gravity in the pose"
        )
    for reason, labels in reasons.items():
        yield f"no ramps of torque for {', '.join(labels)}: {reason}"


def _coordinates(coordinates: tuple[CoordinatePlan, ...]) -> ViewTable:
    columns = headed(
        "*moves:text, *gravity:text, *to each side, *unit:unit, *top speed, *unit:unit, *gravity torque, "
        "*unit:unit, drives that turn:text, pose of the joints:text, windows, *lasts [s], *limits:text, "
        "file:text"
    )
    rows = []
    for c in coordinates:
        gravity, unit = _GRAVITY_OF_PLAN.get(c.gravity, c.gravity), "N" if c.unit == "m" else "Nm"
        moves = (c.label, gravity, c.stroke, c.unit, c.top_speed, f"{c.unit}/s", c.largest_gravity, unit)
        pose = " ".join(f"{value + 0.0:.4g}" for value in c.pose.values())
        rows.append((*moves, ", ".join(c.turns), pose, len(c.windows), c.runs.duration, _held(c), c.file))
    return ViewTable("coordinates", "Coordinates", columns, tuple(rows))


def _held(c: CoordinatePlan) -> str:
    """Whether the known limits hold."""
    if c.broken or c.too_near:
        return "broken"
    doubts = [*(["some assumed"] if c.pace.assumed else []), *(["torques unchecked"] if c.torques_unchecked else [])]
    return f"hold; {', '.join(doubts)}" if doubts else "hold"


def _limits(coordinates: tuple[CoordinatePlan, ...]) -> ViewTable:
    columns = headed("coordinate:text, limit:text, used:%, margin, extreme, bound, unit:unit, at [s], holds:kept")
    rows = tuple(
        (c.label, use.label, use.use, use.margin, use.extreme, use.bound, use.unit, use.time, use.holds)
        for c in coordinates
        for use in c.limits
        if abs(use.use) > _MOVES
    )
    return ViewTable("limits", "Margins of the limits of what moves", columns, rows)


def _distances(coordinates: tuple[CoordinatePlan, ...]) -> tuple[ViewTable, ...]:
    columns = headed(
        "coordinate:text, bodies:text, least distance [m], clearance [m], margin [m], at position, holds:kept"
    )
    rows = tuple(
        (c.label, d.use.label, d.use.extreme, d.use.bound, d.use.margin, d.at, d.use.holds)
        for c in coordinates
        for d in c.distances or ()
    )
    return (ViewTable("distances", "Distances", columns, rows),) if rows else ()


def _ramps(coordinates: tuple[CoordinatePlan, ...]) -> tuple[ViewTable, ...]:
    columns = headed(
        "coordinate:text, drive:text, up to, unit:unit, ramps, lasts [s], source of the torque:text, file:text"
    )
    known = [(c.label, c.ramps) for c in coordinates if c.ramps is not None]
    rows = tuple((label, r.drive, r.largest, r.unit, len(r.ramps), r.duration, r.origin, r.file) for label, r in known)
    title = "Ramps of torque from rest, for robots with a torque interface"
    return (ViewTable("ramps", title, columns, rows),) if rows else ()


def _windows(coordinates: tuple[CoordinatePlan, ...]) -> ViewTable:
    columns = headed(
        "coordinate:text, part of the largest speed [%], speed, from [s], to [s], from position, to position"
    )
    rows = tuple((c.label, w.percent, w.speed, w.start, w.end, w.first, w.last) for c in coordinates for w in c.windows)
    return ViewTable("windows", "Windows of constant speed", columns, rows, folded=True)


_GRAVITY = {"model": "subtracted by a model", "symmetric": "cancelled by both directions"}
_CURVES = Drawing("Friction over speed", FRICTION_FIGURE, "friction_plots.friction_figure")
_SCATTER = 1.5  # of the points over their noise: what is more is said


def friction_fit_view(fit: FrictionFit) -> View:
    """View of a fit of friction curves."""
    drives = fit.characteristics
    return View(
        kind="friction",
        title=f"friction of {fit.robot}",
        verdict=_verdict(drives),
        summary=("coulomb and viscous friction with 99 % intervals; scatter: of the points, over what noise explains",),
        remarks=(
            *(f"{d.drive}: gravity is {_GRAVITY.get(d.gravity, d.gravity)}" for d in drives),
            *(f"{d.drive}: {note}" for d in drives for note in (*d.notes, *_scatter(d))),
            *(f"{d.drive}: {form} is not fitted: {why}" for d in drives for form, why in d.failed.items()),
            *(f"{log.file}: {each}" for log in fit.logs for each in log.left_out),
            "friction of other drives is identified with the masses",
        ),
        asked=(("robot", fit.robot), *_settings(fit.settings)),
        tables=(_drives(drives), _parameters(drives), _compared(drives), *_break_aways(drives), _points(drives)),
        figures=(_CURVES.of(fit.robot, drives),),
        filed=FRICTION_FIT,
        facts={
            "robot": fit.robot,
            "robot_sha256": fit.sha256,
            **{f"log {log.file} sha256": log.sha256 for log in fit.logs},
            **fit.provenance,
        },
    )


def _verdict(drives: tuple[Characteristic, ...]) -> str:
    fitted = [(d.drive, d.fit) for d in drives if d.fit is not None]
    words = [f"{drive} by {fit.form.name}" for drive, fit in fitted]
    words += [f"{d.drive} by a table of its points" for d in drives if d.fit is None]
    held = [f"{drive} {name}" for drive, fit in fitted for name in fit.held]
    not_known = f" The points bound, but do not determine: {', '.join(held)}." if held else ""
    points, count = sum(len(d.points) for d in drives), len(drives)
    begin = f"Friction curves of {count} drive{'s' * (count > 1)} from {points} windows of constant speed"
    return f"{begin}: {'; '.join(words)}.{not_known}"


def _scatter(d: Characteristic) -> tuple[str, ...]:
    if d.fit is None or d.fit.scatter <= _SCATTER:
        return ()
    return (
        f"the points scatter {d.fit.scatter:.2g} times as much as noise within the windows explains; "
        "the intervals allow for it",
    )


def _settings(settings: FitSettings) -> tuple[tuple[str, str], ...]:
    default = FitSettings()
    given = ((each.name, getattr(settings, each.name), getattr(default, each.name)) for each in fields(default))
    return tuple((name.replace("_", " "), f"{value}") for name, value, usual in given if value not in (None, usual))


def _units(unit: str) -> dict[str, str]:
    """Unit of each parameter of a drive."""
    speed, viscous = ("rad/s", "Nm s/rad") if unit == "Nm" else ("m/s", "N s/m")
    units = dict.fromkeys(("coulomb", "stiction", "offset"), unit) | {"viscous": viscous, "stribeck": speed}
    return {**units, "coulomb_temperature": f"{unit}/K", "viscous_temperature": f"{viscous}/K"}


def _drives(drives: tuple[Characteristic, ...]) -> ViewTable:
    columns = headed("*drive:text, *equation:text, *points, *Coulomb:text, *viscous:text, *scatter")
    rows = []
    for d in drives:
        equation, scatter = ("table", None) if d.fit is None else (d.fit.form.name, d.fit.scatter)
        rows.append((d.drive, equation, len(d.points), _value(d, "coulomb"), _value(d, "viscous"), scatter))
    return ViewTable("drives", "Curves", columns, tuple(rows))


def _value(d: Characteristic, parameter: str) -> str:
    """A parameter with its interval; in the backward direction where the two differ."""
    known = {} if d.fit is None else d.fit.parameters
    named = [each for name, each in known.items() if name.rpartition(".")[2] == parameter]
    if not named:
        return "-"
    half = named[-1]["interval99"] or 0.0
    return f"{named[-1]['value']:.4g} +- {half:.1g} {_units(d.unit)[parameter]}"


def _parameters(drives: tuple[Characteristic, ...]) -> ViewTable:
    columns = headed("drive:text, parameter:text, value, lower?held, upper?held, unit:unit, curve:text")
    title = "Parameters of the curves with their 99 % intervals; held: the points bound it but do not determine it"
    return ViewTable("friction", title, columns, tuple(row for d in drives for row in _parameter_rows(d)))


def _parameter_rows(d: Characteristic) -> Iterator[tuple[Any, ...]]:
    if d.fit is None:
        return
    units = _units(d.unit)
    for name, each in d.fit.parameters.items():
        value, half = each["value"], each["interval99"]
        ends = (None, None) if half is None or value is None else (value - half, value + half)
        yield d.drive, name.replace("_", " "), value, *ends, units.get(name.rpartition(".")[2], ""), d.fit.form.name


def _compared(drives: tuple[Characteristic, ...]) -> ViewTable:
    columns = headed("drive:text, curve:text, BIC, AICc, scatter over noise, taken:text")
    rows = tuple(
        (d.drive, fit.form.name, fit.bic, fit.aicc, fit.scatter, "yes" if fit.form == d.fit.form else "no")
        for d in drives
        if d.fit is not None
        for fit in d.others
    )
    return ViewTable("compared", "Curves that were compared: smaller criteria are better", columns, rows)


def _break_aways(drives: tuple[Characteristic, ...]) -> tuple[ViewTable, ...]:
    columns = headed("drive:text, direction:text, torque, half of its interval, unit:unit, tests")
    rows = tuple(
        (d.drive, "forward" if mean.direction > 0 else "backward", mean.torque, mean.interval99, d.unit, mean.count)
        for d in drives
        for mean in d.means
    )
    return (ViewTable("break-away", "Break-away torques, means", columns, rows),) if rows else ()


def _points(drives: tuple[Characteristic, ...]) -> ViewTable:
    columns = headed("drive:text, speed, torque, deviation, begins [s], lasts [s], temperature [°C]")
    rows = tuple(
        (d.drive, p.speed, p.torque, p.deviation, p.time, p.duration, p.temperature) for d in drives for p in d.points
    )
    return ViewTable("points", "Windows of constant speed", columns, rows, folded=True)
