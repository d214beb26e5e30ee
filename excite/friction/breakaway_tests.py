"""Break-away torques of a drive in all its logs: which ramps are evaluated, and which of the results count."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from excite.friction.breakaway_torque import BreakAway, break_aways
from excite.friction.constant_speed_windows import FitSettings, longest_step, position_noise, unbroken
from excite.friction.plan_match import PlannedRuns, Source
from excite.friction.points import Point
from regressors.samples import Array

_AFTER = 0.2  # [s], largest lag of a robot behind the plan
_LOW, _HIGH = 0.5, 3.0  # least and largest break-away torque, relative to the friction at the slowest speed
_SLOWEST = 1.3  # times the least speed: up to there, windows count as the slowest
_FAR, _PART = 12.0, 0.1  # standard deviations of the position noise, and part of the planned path, that count as motion
_CAUGHT = 5e-4  # [rad or m], less than a drive moves before the controller stops it again


def broken_loose(
    drive: str, sources: Sequence[Source], settings: FitSettings, runs: PlannedRuns | None
) -> tuple[BreakAway, ...]:
    """Find break-aways in all logs; with a plan, in its creeping runs and torque ramps, else where others rest."""
    breaks: list[BreakAway] = []
    balance = gravity_about(drive, sources) if settings.gravity == "none" and runs is not None else None
    for source in sources:
        spans: Sequence[tuple[float, float]] | None = source.ramped
        controlled = None if runs is None else False  # a log without runs of the plan has its torque ramps
        if source.plan_match is not None and runs is not None:
            spans, controlled = _creeps(source, runs), True
        gravity = source.model if settings.gravity == "model" else balance
        breaks += break_aways(source.measured, drive, gravity, spans, controlled=controlled, alone=spans is None)
    return tuple(breaks)


def gravity_about(drive: str, sources: Sequence[Source]) -> Callable[[Array], Array] | None:
    """Gravity about the pose over the drive's position, where it cancels over whole windows: their median slope."""
    slopes, middle = [], 0.0
    for source in sources:
        if source.plan_match is None:
            continue
        measured, middle = source.measured, source.plan_match.middle
        assert measured.log.effort is not None
        k, since = measured.names.index(drive), measured.log.time - measured.log.time[0]
        z, tau = measured.z[:, k], measured.torque(measured.log.effort)[:, k]
        for w in source.plan_match.windows:
            rows = slice(*np.searchsorted(since, [w.start, w.end]))
            if z[rows].size > 2 and np.ptp(z[rows]) > 0:
                slopes.append(float(np.polyfit(z[rows] - middle, tau[rows], 1)[0]))
    slope = float(np.median(slopes)) if slopes else 0.0
    return (lambda z: slope * (z - middle)) if slopes else None


def plausible_break_aways(
    breaks: Sequence[BreakAway], points: Sequence[Point], unit: str = ""
) -> tuple[tuple[BreakAway, ...], list[str]]:
    """Select the break-away torques that friction can explain, with remarks on the others.

    Friction resists motion: a torque against the motion that follows is rejected. So is one of less than half or more
    than three times the friction of the slowest windows of its direction; it is too small only if it is also less than
    half of the value at speed zero of a line through all windows of the direction.
    """
    against = "against the motion that follows it"
    small, large = (
        f"{x} times the friction of the slowest windows" for x in (f"less than {_LOW:g}", f"more than {_HIGH:g}")
    )
    sides: dict[str, list[BreakAway]] = {"": [], against: [], small: [], large: []}
    bounds = {way: _bounds(points, way) for way in (1, -1)}
    for candidate in breaks:
        (low, high), size = bounds[candidate.direction], candidate.direction * candidate.torque
        sides[against if size <= 0 else small if size < low else large if size > high else ""].append(candidate)
    kept, remarks = sides.pop(""), []
    for why, some in sides.items():
        if some:
            count = "1 ramp that ends" if len(some) == 1 else f"{len(some)} ramps that end"
            torques = ", ".join(f"{candidate.torque:.3g}" for candidate in some[:4]) + (" ..." if len(some) > 4 else "")
            remarks.append(f"{count} in motion not counted: torque {why} ({torques} {unit})".rstrip())
    return tuple(kept), remarks


def _bounds(points: Sequence[Point], way: int) -> tuple[float, float]:
    side = [(abs(p.speed), way * p.torque) for p in points if p.speed * way > 0]
    if not side:
        return 0.0, np.inf
    speed, friction = np.array(side).T
    slowest = float(np.median(friction[speed <= _SLOWEST * speed.min()]))
    if slowest <= 0:
        return 0.0, np.inf
    least = slowest
    if speed.max() > _SLOWEST * speed.min():
        least = min(least, float(np.polyfit(speed, friction, 1)[1]))
    return _LOW * max(least, 0.0), _HIGH * slowest


def repeated_break_aways(breaks: Sequence[BreakAway]) -> tuple[BreakAway, ...]:
    """Break-aways in directions that have two or more: a single one is not reliable."""
    count = Counter(each.direction for each in breaks)
    return tuple(each for each in breaks if count[each.direction] > 1)


def breakaway_notes(
    drive: str, breaks: Sequence[BreakAway], sources: Sequence[Source], runs: PlannedRuns | None, unit: str = ""
) -> list[str]:
    """How many of the plan's break-away tests end in a break-away, and why the others do not."""
    if runs is None:
        return []
    creeps = [(source, span) for source in sources for span in _creeps(source, runs)]
    starts = [(source, span, runs.creep * (span[1] - span[0]) * _PART) for source, span in creeps]
    ramps = [(each, span, _CAUGHT) for each in sources if each.plan_match is None for span in each.ramped or ()]
    largest = max((ramp.torque for ramp in runs.ramps), default=0.0)
    cures = (
        "hardly moved the drive (give `plan_friction` a longer `creeping`, or take a stiffer controller)",
        "moved it, but its torque rose too quickly or too unevenly to be evaluated "
        "(give `plan_friction` a lower `creep`)",
    )
    harder = (
        f"did not break it away, up to {largest:.3g} {unit} (give `plan_friction` a larger `torque_ramp`)",
        "moved it, but its torque did not rise evenly before",
    )
    return [
        *_outcome_notes(drive, "break-away tests at creeping speed", starts, breaks, cures),
        *_outcome_notes(drive, "torque ramps", ramps, breaks, harder),
    ]


_Asked = tuple[Source, tuple[float, float], float]  # a test's log, its begin and end, and the least path that is motion


def _outcome_notes(
    drive: str, what: str, asked: Sequence[_Asked], breaks: Sequence[BreakAway], cures: tuple[str, str]
) -> list[str]:
    if not asked:
        return []
    missed = [each for each in asked if not any(_in(break_away, *each[:2]) for break_away in breaks)]
    causes = Counter(_cause(drive, *each) for each in missed)
    whys = {"missing": "missing from the log, or with a gap", "still": cures[0], "quick": cures[1]}
    sentence = f"{len(asked) - len(missed)} of {len(asked)} {what} ended in a break-away"
    return [sentence + "".join(f"; {causes[key]} {why}" for key, why in whys.items() if causes[key])]


def _in(break_away: BreakAway, source: Source, span: tuple[float, float]) -> bool:
    since = break_away.time - float(source.measured.log.time[0])
    return break_away.log == source.measured.number and span[0] - _AFTER <= since <= span[1] + _AFTER


def _cause(drive: str, source: Source, span: tuple[float, float], far: float) -> str:
    """Why a ramp has no break-away torque: it is not fully recorded, it did not move the drive, or it did."""
    time = source.measured.log.time
    since, longest = time - time[0], longest_step(time)
    rows = (since >= span[0]) & (since <= span[1])
    within = span[0] >= -longest and span[1] - _AFTER <= since[-1] + longest
    if not within or rows.sum() < 2 or not unbroken(time[rows], longest):
        return "missing"
    z = source.measured.z[:, source.measured.names.index(drive)]
    noise = float(position_noise(time, z[:, None])[0])
    return "quick" if np.ptp(z[rows]) > max(far, _FAR * noise) else "still"


def _creeps(source: Source, runs: PlannedRuns) -> list[tuple[float, float]]:
    if source.plan_match is None:
        return []
    return [(source.plan_match.seconds + a, source.plan_match.seconds + b + _AFTER) for a, b in runs.creeps]
