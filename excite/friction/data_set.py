"""Friction data of one drive from logs: points of its curve from their windows, with gravity accounted for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from excite.friction.breakaway_tests import breakaway_notes, broken_loose, plausible_break_aways
from excite.friction.breakaway_torque import BreakAway, break_aways
from excite.friction.constant_speed_windows import FitSettings, Found, WindowSearch, constant_windows
from excite.friction.plan_match import PlanMatch, PlannedRuns, Source, match_plan, match_ramps, windows_of_plan
from excite.friction.points import DriveLog, Point, RigidModel, gravity_share, never_loaded, paired_points, points_of
from regressors.errors import InputError
from regressors.robot.robot import Robot

_LEAST_SHARE = 0.01  # of the largest speed in the log: below, a drive rests
_AVERAGED_TOLERANCE = 0.5
_DIFFERENT = 1.3  # speeds of one direction differ if the largest is so many times the smallest
_CANCELLED = 0.05
_STRAYS = 0.05  # of its path: largest motion of the others where one drive moves alone
_FEWEST = 3


def data_set_of(
    drive: str, sources: Sequence[Source], settings: FitSettings, runs: PlannedRuns | None, unit: str = ""
) -> tuple[tuple[Point, ...], str, tuple[BreakAway, ...], list[str]]:
    """Points of a drive's curve from all logs, how gravity was accounted for, break-aways, and notes."""
    whole = runs is not None and settings.window is None and settings.speed != "averaged"
    gravity, of_gravity = _gravity(drive, sources, settings, runs, whole=whole)
    settings = replace(settings, gravity=gravity)
    shown = [source for source in sources if runs is None or source.plan_match is not None]
    if runs is not None and not shown:
        raise _no_runs(drive, sources, runs)
    if runs is None or not whole:
        points, notes = _found_points(drive, shown, settings, runs)
    else:
        points, notes = _points_at(drive, shown, settings, runs)
        if not points:
            raise InputError(
                f"{drive}: {notes[-1]}; play the runs of {drive} in {runs.plan} again, so that they keep the planned "
                "speeds, or give a larger `tolerance`"
            )
    rests, doubts = broken_loose(drive, sources, settings, runs), list[str]()
    if gravity != "symmetric":
        rests, doubts = plausible_break_aways(rests, points, unit)
    of_tests = breakaway_notes(drive, rests, sources, runs, unit)
    return tuple(points), gravity, rests, [*of_gravity, *notes, *of_tests, *doubts]


def _no_runs(drive: str, sources: Sequence[Source], runs: PlannedRuns) -> InputError:
    """Error where no log has the drive's runs, but some have its break-away tests."""
    first = min(w.start for w in runs.windows)
    for source in sources:
        log = source.measured.log
        if source.ramped is None and log.duration < min(w.end for w in runs.windows if w.start == first):
            return InputError(
                f"{drive}: {log.source} ends after {log.duration:.4g} s, before the first window of constant speed of "
                f"{runs.plan}, which begins {first:.4g} s after its start; record the whole plan"
            )
    return InputError(
        f"{drive}: the logs contain break-away tests, but no runs at constant speed; give the log of the runs of "
        f"{runs.plan} too"
    )


def _gravity(
    drive: str, sources: Sequence[Source], settings: FitSettings, runs: PlannedRuns | None, *, whole: bool
) -> tuple[str, list[str]]:
    """How gravity is accounted for, with notes where the settings leave it open."""
    if settings.gravity != "auto":
        return settings.gravity, []
    unknown = next((source.unknown for source in sources if source.unknown is not None), None)
    models = [source.model for source in sources if source.model is not None]
    if unknown is None and models:
        return "model", [f"gravity is subtracted: {models[0].source}"]
    if runs is not None and runs.cancels(whole=whole):
        why = _GRAVITY_WORDS[runs.gravity]
        return "none", [f"masses are not known, but gravity is not needed: by {runs.plan} it {why}"]
    if all(never_loaded(source.measured, drive) for source in sources):
        return "none", ["masses are not known, but gravity does not act on the drive"]
    raise unknown or InputError("gravity is to be subtracted, but there is no model of it")


_GRAVITY_WORDS = {
    "none": "does not act on the drive",
    "cancels": "cancels over each whole window, which is symmetric about the pose",
    "stated": "was stated to cancel about the pose, over each whole window",
}


def _found_points(
    drive: str, sources: Sequence[Source], settings: FitSettings, runs: PlannedRuns | None
) -> tuple[list[Point], list[str]]:
    """Points of the windows found in the logs."""
    points: list[Point] = []
    if settings.speed != "averaged":
        points, notes = _points_at(drive, sources, replace(settings, speed="constant"), runs)
        if settings.speed == "constant" or settings.gravity != "model" or _shows_speed(points):
            if not points:
                if settings.gravity == "symmetric":
                    raise InputError(f"{drive}: {notes[-1]}; make runs there and back over the same path at one speed")
                raise InputError(
                    f"{drive}: {notes[-1]}; make runs that keep one speed for {settings.length:g} s or longer "
                    "(`plan_friction` designs them), or give a shorter `window` or a larger `tolerance`"
                )
            return points, notes
    if settings.speed == "auto" and not all(_alone(drive, source.measured) for source in sources):
        few = f"{len(points)} windows of constant speed are too few to fit friction over speed"
        raise InputError(
            f"{drive}: {few if points else 'no windows of constant speed'}, and other drives move too; make runs of "
            "one drive at a time at constant speeds (`plan_friction` designs them), or give `speed='averaged'`: "
            "windows of changing speed then count with their mean speed, and the model subtracts the torque of "
            "acceleration"
        )
    averaged = replace(settings, speed="averaged", tolerance=max(settings.tolerance, _AVERAGED_TOLERANCE))
    more, of_source = _points_at(drive, sources, averaged, runs)
    if not _shows_speed(more):
        if points:
            return points, notes
        raise InputError(f"{drive}: {of_source[-1]}; make runs at constant speed (`plan_friction` designs them)")
    return more, [
        f"{len(points)} windows of constant speed are too few to fit friction over speed; windows of "
        "changing speed count too, with their mean speed, and the model subtracts the torque of acceleration",
        *of_source,
    ]


def _points_at(
    drive: str, sources: Sequence[Source], settings: FitSettings, runs: PlannedRuns | None
) -> tuple[list[Point], list[str]]:
    points: list[Point] = []
    notes: list[str] = []
    changing = resting = 0
    whole = runs is not None and settings.window is None and settings.speed != "averaged"
    slowest = max((_least_speed(drive, source.measured, settings.length) for source in sources), default=0.0)
    for source in sources:
        subtracted = source.model if settings.gravity == "model" else None
        alone = subtracted is None or settings.speed == "constant"
        windows, of_windows = _windows(drive, source, settings, slowest, whole=whole, alone=alone)
        notes += of_windows
        changing, resting = changing + windows.changing, resting + windows.resting
        if settings.gravity == "none":
            _check_cancelled(drive, source, windows, runs, whole=whole)
        if settings.gravity == "symmetric":
            points += paired_points(source.measured, drive, windows.windows)
        else:
            folded = whole and subtracted is None
            settling = settings.speed != "averaged"
            points += points_of(source.measured, drive, windows.windows, subtracted, folded=folded, settling=settling)
    if whole:
        return points, [*notes, _planned_windows_note(points, changing, settings)]
    what = "pairs of windows over the same path" if settings.gravity == "symmetric" else "windows"
    kind = (
        "constant speed" if settings.speed != "averaged" else f"speed that changes by {settings.tolerance:.0%} at most"
    )
    return points, [
        *notes,
        f"{len(points)} {what} of {settings.length:g} s at {kind}; left out: {changing} where speed changes, "
        f"{resting} at rest",
    ]


def _planned_windows_note(points: Sequence[Point], changing: int, settings: FitSettings) -> str:
    what = "pairs of the plan's windows" if settings.gravity == "symmetric" else "of the plan's windows"
    lengths = [point.duration / (2.0 if settings.gravity == "symmetric" else 1.0) for point in points]
    span = f" of {min(lengths):.3g} to {max(lengths):.3g} s" if lengths else ""
    return f"{len(points)} {what}{span}; left out: {changing} whose speed is not constant, or not the planned one"


def _windows(
    drive: str, source: Source, settings: FitSettings, slowest: float, *, whole: bool, alone: bool
) -> tuple[Found, list[str]]:
    plan_match, log, k = source.plan_match, source.measured.log, source.measured.names.index(drive)
    z, others = source.measured.z[:, k], np.delete(source.measured.z, k, axis=1)
    spans = None if plan_match is None else tuple((w.start, w.end) for w in plan_match.windows)
    search = WindowSearch(settings.length, settings.tolerance, slowest, spans)
    if plan_match is not None and whole:
        windows = windows_of_plan(log.time, z, others, plan_match.windows, plan_match.middle, search)
    else:
        windows = constant_windows(log.time, z, others if alone else others[:, :0], search)
    if plan_match is None:
        return windows, []
    remarks = [f"{log.source}: {_begun(plan_match.seconds)}"]
    if missing := plan_match.missing + windows.missing:
        gaps = f" or interrupted by a gap ({windows.missing})" if windows.missing else ""
        remarks.append(f"{log.source}: {missing} of the plan's windows are missing{gaps}")
    return windows, remarks


def _begun(seconds: float) -> str:
    """When the plan begins, to the millisecond."""
    if abs(seconds) < 5e-4:
        return "the plan begins with its first row"
    return f"the plan begins {abs(seconds):.3f} s {'after' if seconds > 0 else 'before'} its first row"


def _least_speed(drive: str, measured: DriveLog, length: float) -> float:
    """Speed below which a drive rests: a part of the largest one over a window's length [s]."""
    z, time = measured.z[:, measured.names.index(drive)], measured.log.time
    later = np.searchsorted(time, time + length).clip(max=time.size - 1)
    return max(_LEAST_SHARE * float(np.abs(z[later] - z).max()) / length, 1e-4)


def _alone(drive: str, measured: DriveLog) -> bool:
    """Whether a drive moves alone, or hardly, in a log."""
    paths, k = np.ptp(measured.z, axis=0), measured.names.index(drive)
    return bool(np.all(np.delete(paths, k) <= _STRAYS * paths[k]))


def _shows_speed(points: Sequence[Point]) -> bool:
    """Whether every direction that has points has different speeds."""
    if len(points) < _FEWEST:
        return False
    sides = [[abs(p.speed) for p in points if p.speed * sign > 0] for sign in (1, -1)]
    return all(max(side) > _DIFFERENT * min(side) for side in sides if side)


def _check_cancelled(drive: str, source: Source, windows: Found, runs: PlannedRuns | None, *, whole: bool) -> None:
    """Check that the mean of gravity over each window is negligible, where it is not subtracted."""
    cure = (
        "`gravity='model'` subtracts it (give `parameters` where the description is not good enough), "
        "`gravity='symmetric'` cancels it between both directions over the same path"
    )
    if runs is None:
        cure += ", and so does a `plan` over the whole windows of a plan that is symmetric about a pose"
    elif not whole and runs.cancels(whole=True):
        cure += f"; it cancels over the whole windows of {runs.plan}: leave out `window`"
    name = source.measured.log.source
    if source.model is None:
        if (runs is not None and runs.cancels(whole=whole)) or never_loaded(source.measured, drive):
            return
        raise InputError(f"{name}: whether gravity acts on {drive} is not known without a model; {cure}")
    share = gravity_share(source.measured, drive, windows.windows, source.model)
    if share > _CANCELLED:
        raise InputError(
            f"{name}: gravity does not cancel in the windows of {drive}: it is up to {share:.0%} of "
            f"their torques; {cure}"
        )


Rigid = Callable[[Robot], RigidModel] | None


def sources_of(
    measured: Sequence[DriveLog], settings: FitSettings, rigid: Rigid, plan: Mapping[str, PlannedRuns] | None
) -> dict[str, list[Source]]:
    """Logs in which each drive moves; with a plan, those that contain its runs, or ramps until it breaks away."""
    sources: dict[str, list[Source]] = {}
    for part in measured:
        for name, source in _sources(Source(part, *_model(rigid, part.robot, settings)), plan).items():
            sources.setdefault(name, []).append(source)
    return sources


def _sources(source: Source, plan: Mapping[str, PlannedRuns] | None) -> dict[str, Source]:
    """One log, for each drive that is to be evaluated in it."""
    part = source.measured
    if plan is None:
        return dict.fromkeys(part.names, source)
    where = {name: match_plan(part, runs) for name, runs in plan.items() if name in part.names}
    if matches := {name: replace(source, plan_match=match) for name, match in where.items() if match.holds}:
        return matches
    if (ramps := match_ramps(part, plan)) is not None:
        return {ramps[0]: replace(source, ramped=ramps[1])}
    moved = [name for name in where if break_aways(part, name, None, controlled=False, alone=True)]
    if not moved:
        raise _no_log_of_plan(part, where, plan)
    return dict.fromkeys(moved, source)


def _model(rigid: Rigid, robot: Robot, settings: FitSettings) -> tuple[RigidModel | None, InputError | None]:
    """Model for the robot of a log, or the reason why there is none where it may not be needed."""
    if rigid is None or settings.gravity == "symmetric":
        return None, None
    try:
        return rigid(robot), None
    except InputError as error:
        if settings.gravity == "model":
            raise
        return None, error


def _no_log_of_plan(part: DriveLog, where: Mapping[str, PlanMatch], plan: Mapping[str, PlannedRuns]) -> InputError:
    source = next(iter(plan.values())).plan
    nearest = min(where, key=lambda name: where[name].astray, default=None)
    if nearest is None:
        reason = f"it has none of the drives {', '.join(plan)}, but {', '.join(part.names)}"
    elif np.isinf(where[nearest].astray):
        reason = f"no window of constant speed of the plan is in the {part.log.duration:.3g} s that it lasts"
    else:
        reason = f"it deviates from the nearest runs, those of {nearest}, by {where[nearest].astray:.0%} of their size"
    return InputError(
        f"{part.log.source} does not contain the motion of {source}: {reason}; give the log of that plan, or leave out "
        "`plan` to use all windows of constant speed in the log"
    )
