"""Assignment of logs and models to drives; with a plan, of the logs that contain its runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from excite.friction.fit.breakaway_torque import break_aways
from excite.friction.fit.drive_log import Source
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.plan_match import PlanMatch, PlannedRuns, match_plan, match_ramps
from excite.friction.fit.points import DriveLog
from excite.friction.fit.rigid_torques import RigidModel
from regressors.errors import InputError
from regressors.robot.robot import Robot

Rigid = Callable[[Robot], RigidModel] | None


def sources_of(
    measured: Sequence[DriveLog], settings: FitSettings, rigid: Rigid, plan: Mapping[str, PlannedRuns] | None
) -> dict[str, list[Source]]:
    """Logs in which each drive moves; with a plan, those that contain its runs, or ramps until it breaks away."""
    sources: dict[str, list[Source]] = {}
    for number, part in enumerate(measured):
        model, unknown = _model(rigid, part.robot, settings)
        if plan is None:
            for name in part.names:
                sources.setdefault(name, []).append(Source(number, part, model, unknown))
            continue
        where = {name: match_plan(part, runs) for name, runs in plan.items() if name in part.names}
        logs_of_plan = {name: source for name, source in where.items() if source.holds}
        for name, source in logs_of_plan.items():
            sources.setdefault(name, []).append(Source(number, part, model, unknown, source))
        if logs_of_plan:
            continue
        ramps = match_ramps(part, plan)
        if ramps is not None:
            sources.setdefault(ramps[0], []).append(Source(number, part, model, unknown, None, ramps[1]))
            continue
        moved = [name for name in where if break_aways(part, name, None, controlled=False, alone=True)]
        if not moved:
            raise _no_log_of_plan(part, where, plan)
        for name in moved:
            sources.setdefault(name, []).append(Source(number, part, model, unknown))
    return sources


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
