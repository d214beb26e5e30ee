"""Summary of a friction plan on the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from excite.cli.literal_console import console
from excite.cli.messages import in_options
from excite.cli.summary import Summary, compact_table
from excite.friction.plan.measurements import CoordinatePlan, FrictionPlan
from excite.friction.plan.schedule import LONGEST

_LONG = 600.0  # total duration that counts as long [s]
_GRAVITY = {
    "none": "none",
    "cancels": "cancels",
    "subtracted": "subtracted by the model",
    "stated": "cancels, as --balanced states",
}


def plan_summary(plan: FrictionPlan, files: Sequence[Path], *, chosen: bool) -> Summary:
    """Summary of a plan: whether its limits hold, how long it takes, its runs."""
    count = len(plan.coordinates)
    first, *others = _environment(plan)
    rows = [
        (c.label, _gravity(c), f"{c.stroke:.3g} {c.unit}", f"{max(c.order) / 100 * c.pace.velocity:.3g} {c.unit}/s",
         f"{c.runs.duration:.0f} s", _limits(c))
        for c in plan.coordinates
    ]  # fmt: skip
    return Summary(
        verdict=f"Plan of {count} friction measurement{'s' * (count > 1)}, {plan.duration / 60:.1f} min, "
        + ("within all checked limits" if plan.holds else "that exceeds a limit or comes too near to something"),
        holds=plan.holds,
        facts=[
            first,
            *compact_table("moves", "gravity", "to each side", "top speed", "lasts", "limits", rows=rows, left=2),
        ],
        notes=[
            *(line for c in plan.coordinates for line in _coordinate(c, chosen=chosen)),
            *others,
            *_length(plan),
            *_torque_ramps(plan),
        ],
        files=files,
        next_steps=[
            "play each file and record positions and torques, then excite friction fit ROBOT LOG... --plan "
            f"{files[0].parent} --out DIR"
        ],
        all_in="plan.json",
    )


def print_plan(plan: FrictionPlan, files: Sequence[Path], *, chosen: bool) -> None:
    """Print a table of the coordinates, and notes on them."""
    out = console()
    head = f": {len(plan.coordinates)} friction measurement(s), {plan.duration / 60:.1f} min"
    out.print(Text(plan.robot.name, style="bold"), head, sep="", soft_wrap=True)
    _print_table(plan, out)
    first, *others = _environment(plan)
    out.print(Text(in_options(first), style="bold" if plan.world is None else ""), soft_wrap=True)
    for line in (
        *others,
        *_length(plan),
        *(line for c in plan.coordinates for line in _coordinate(c, chosen=chosen)),
        *_torque_ramps(plan),
        f"order, to keep the temperature steady: warm-up, stiction, then {_order(plan)} % there and back",
        f"written: {', '.join(map(str, files))}",
    ):
        out.print(in_options(line), soft_wrap=True, highlight=True)


def _print_table(plan: FrictionPlan, out: Console) -> None:
    table = Table()
    for heading in ("moves", "pose of the joints", "gravity", "speeds", "to each side", "windows", "lasts", "limits"):
        table.add_column(heading, overflow="fold")
    for c in plan.coordinates:
        lengths = [window.end - window.start for window in c.windows]
        pose = " ".join(f"{value:.4g}" for value in c.place.pose + 0.0)
        speeds = f"{len(set(c.order))} to {max(c.order) / 100 * c.pace.velocity:.3g} {c.unit}/s"
        window = f"{min(lengths):.3g} to {max(lengths):.3g} s"
        table.add_row(
            c.label, pose, _gravity(c), speeds, f"{c.stroke:.3g} {c.unit}", window,
            f"{c.runs.duration:.0f} s", _limits(c),
        )  # fmt: skip
    out.print(table)


def _limits(c: CoordinatePlan) -> str:
    """Whether the known limits hold, as text."""
    if c.broken or c.too_near:
        return "broken"
    doubts = [*(["some assumed"] if c.pace.assumed else []), *(["torques unchecked"] if c.torques_unchecked else [])]
    return f"hold; {', '.join(doubts)}" if doubts else "hold"


def _gravity(plan: CoordinatePlan) -> str:
    sentence = _GRAVITY[plan.place.gravity]
    size, torque = plan.largest_gravity, {"rad": "Nm", "m": "N"}[plan.unit]
    return sentence if plan.place.gravity == "none" or size != size else f"{sentence}; up to {size:.3g} {torque}"


def _length(plan: FrictionPlan) -> Iterator[str]:
    longest = plan.schedule.longest
    if plan.duration > _LONG and longest > LONGEST:
        shorter = plan.lasting(LONGEST) / 60
        bound = f"at most {longest:g} s long" if np.isfinite(longest) else "as long as the range allows"
        yield (
            f"windows are {bound}; --longest {LONGEST:g} shortens the plan to {shorter:.1f} min "
            "and keeps the temperature steadier: the gears cool in long slow runs"
        )


def _coordinate(c: CoordinatePlan, *, chosen: bool) -> Iterator[str]:
    """Notes on one coordinate."""
    if c.left_out:
        percent, reason = next(iter(c.left_out.items()))
        each = ", ".join(f"{p:g}" for p in c.left_out)
        at = f" at {percent:g} %" if len(c.left_out) > 1 else ""
        yield f"{c.label}: {each} % left out: {reason}{at}; a lower --shortest allows shorter windows"
    if c.place.gravity == "subtracted":
        nowhere = "no pose in which it cancels has room for the runs" if chosen else "it does not cancel about the pose"
        yield f"{c.label}: gravity: {nowhere}; 'excite friction fit' subtracts it by the model"
    for use in c.broken:
        excess = f"{use.extreme:.4g} {use.unit} beyond {use.bound:.4g} at {use.time:.2f} s"
        yield f"{c.label}: {use.label} does not hold: {excess}; lower --acceleration-limit"
    yield from _distances(c, chosen=chosen)
    if c.torques_unchecked:
        yield f"{c.label}: torque limits are not checked: {c.torques_unchecked}"
    if len(c.turns) > 1:
        yield f"{c.label} moves {', '.join(c.turns)}: the runs measure the sum of their friction"
    if c.pace.assumed:
        known = " and ".join(f"{what} {getattr(c.pace, what):.3g}" for what in c.pace.assumed)
        yield f"{c.label}: no limit is known; assumed: {known} (SI)"


def _distances(c: CoordinatePlan, *, chosen: bool) -> Iterator[str]:
    """Notes on bodies that come too near, or on the nearest ones."""
    cure = "give another --pose" if chosen else "leave out --pose to let the plan choose one, or give another one"
    for d in c.too_near:
        apart = f"{d.use.extreme:.3g} m apart" if d.use.extreme > 0.0 else "in collision"
        yield (
            f"{c.label}: {d.use.label} are {apart} at {c.label} = {d.at:.4g} {c.unit} ({d.use.time:.2f} s), "
            f"{d.use.bound:.3g} m must be kept"
        )
    if c.too_near:
        yield f"{c.label}: {cure}, or move the obstacle, in the robot's cell and in the world file"
    if c.too_near or not c.distances:
        return
    d = min(c.distances, key=lambda each: each.use.margin)
    bounds = f"; that bounds the stroke to {c.place.half:.3g} {c.unit}" if c.place.obstacle else ""
    yield (
        f"{c.label}: nearest is {d.use.label}, {d.use.extreme:.3g} m apart at {c.label} = {d.at:.4g} {c.unit}, "
        f"{d.use.bound:.3g} m is kept{bounds}"
    )


def _torque_ramps(plan: FrictionPlan) -> Iterator[str]:
    """Notes on torque ramps: largest torques, or reasons for none."""
    origins: dict[str, list[str]] = {}
    for c in plan.coordinates:
        if c.ramps is not None:
            origins.setdefault(c.ramps.origin, []).append(f"{c.label} to {c.ramps.largest:.3g} {c.ramps.unit}")
    if origins:
        each = "; ".join(f"{', '.join(torques)} ({origin})" for origin, torques in origins.items())
        yield (
            f"ramps of torque, for robots with a torque interface, over {plan.schedule.ramping:g} s in "
            f"NAME.stiction.csv: {each}; the controller adds gravity in the pose"
        )
    reasons: dict[str, list[str]] = {}
    for c in plan.coordinates:
        if c.ramps is None:
            reasons.setdefault(c.no_ramps, []).append(c.label)
    for reason, labels in reasons.items():
        yield f"no ramps of torque for {', '.join(labels)}: {reason}"


def _order(plan: FrictionPlan) -> str:
    return ", ".join(f"{percent:g}" for percent in plan.coordinates[0].order)


def _environment(plan: FrictionPlan) -> Iterator[str]:
    """Notes on collision checks, and on transfers from pose to pose."""
    yours = "you move the robot from one pose to the next"
    if plan.world is None:
        yield (
            "collisions with obstacles, the floor and the robot's own links are not checked: watch the strokes, or "
            f"give --world FILE; {yours}"
        )
        return
    free = [f"{p.start} to {p.end}" for p in plan.passages if not p.obstacle]
    lines_free = f"; straight lines in joint space are free from {', '.join(free)}" if free else ""
    hold = "distances hold in every position that a run passes"
    if any(c.too_near for c in plan.coordinates):
        hold = "distances do not hold"
    elif not any(c.distances for c in plan.coordinates):
        hold = "no two bodies of the world file can collide, so no distance is checked"
    yield f"{hold}; {yours}{lines_free}"
    yield from plan.notes
    for p in plan.passages:
        if p.obstacle:
            yield (
                f"{p.start} to {p.end}: on the straight line in joint space {p.obstacle} are too close; go around them"
            )
