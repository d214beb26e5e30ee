"""Plan of the friction measurements of a robot: for each coordinate where, how fast, in which order [KD96] section 5.2.

One coordinate moves at a time, about a pose in which gravity cancels (`excite.design.friction_runs.pose`) and free of
collisions (`excite.design.friction_runs.pose`). After a warm-up it creeps out of rest in both directions for the
break-away tests, then moves there and back at every speed, alternating fast and slow ones, so that the power that heats
the gear stays about the same throughout. Ramps of the drive's torque in the same pose are a motion of their own
(`excite.design.friction_runs.schedule`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from constraints.geometry import World
from constraints.linear import LinearConstraint, linear_limits
from constraints.world_file import read_world
from excite.design.friction_runs.friction_plan import (
    CoordinatePlan,
    Distance,
    FrictionPlan,
    Passage,
    SkippedSpeed,
    Window,
)
from excite.design.friction_runs.pose import CollisionChecks, Place, PlaceSearch, gravity_of
from excite.design.friction_runs.runs import Part, Runs, certificates, pace_of, torque_uses
from excite.design.friction_runs.schedule import Schedule, check_size, scheduled_runs, torque_ramps, turning_drives
from excite.design.stated_limits import Unchecked, gravest_first, stated_world
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.robot_of_task import robot_and_task
from excite.tasks.task import Task
from excite.trajectories.transfer import check_pose
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.partial import PartialMotion, drive_names, of_drives, of_joints
from regressors.numerical import numerical_work
from regressors.quantities import check
from regressors.readers.description import refuse_missing_ranges
from regressors.robot.robot import Robot
from regressors.samples import Array


@checked
@numerical_work(
    "the friction plan",
    "speeds or limits of very different sizes are the likely cause: "
    "check `percent`, `creep` and the limits of the joints",
)
def plan_friction(
    robot: Robot | Task | str,
    schedule: Schedule | None = None,
    *,
    joints: Sequence[str] | None = None,
    drives: Sequence[str] | None = None,
    limits: LimitChoice | None = None,
    pose: Sequence[float] | Array | None = None,
    balanced: bool = False,
    world: World | str | Path | None = None,
    torque_ramp: Sequence[float] | None = None,
    seed: int = 0,
) -> FrictionPlan:
    """Plan the runs that measure the friction of a robot's joints or drives.

    Parameters
    ----------
    robot : Robot, Task or str
        A robot, or the name or file of one, or a task that states how it is installed.
    schedule : Schedule, optional
        Speeds, windows, warm-up, break-away tests, order.
    joints, drives : sequence of str, optional
        Those to measure; all drives if neither is given.
    limits : LimitChoice, optional
        Limits of joints that replace those of the description, and what bodies keep apart where no world is given.
    pose : sequence of float, length n, optional
        Middle of every run; one about which gravity cancels is searched for if not given [rad or m].
    balanced : bool
        True if gravity is known to cancel about the given pose, although inertias are unknown.
    world : World or path, optional
        Shape of the robot and its environment, which the robot must not touch; if not given, its links, as far as they
        have shapes, and the floor, as `design_trajectory` has them.
    torque_ramp : sequence of float, optional
        Largest torque of the break-away ramps, one for all or one per coordinate [Nm or N].
    seed : int
        Of the random poses that are tried.

    Returns
    -------
    FrictionPlan

    Raises
    ------
    InputError
        Unknown names, both joints and drives, an invalid pose, no room for any window, gravity that is not known, a
        world that does not fit the robot, or torques beyond the limits.
    """
    for quantity, value in (("seed", seed), ("pose", pose)):
        check(quantity, value)
    described, task = robot_and_task(robot)
    described.check_open("a plan of runs at constant speed")
    limits = LimitChoice() if limits is None else limits
    if isinstance(world, str | Path):
        world = read_world(Path(world), task.robot if isinstance(task.robot, str) else "")
    world = limits.known_world if world is None else world
    stated = stated_world(described, replace(task, limits=replace(limits, world=world)))
    if world is not None:
        surface = () if stated.world is None else stated.world.obstacles
        stated = replace(stated, world=replace(world, obstacles=(*world.obstacles, *surface)))
    robot, schedule = limits.applied(described), Schedule() if schedule is None else schedule
    kept = linear_limits(robot)
    if pose is None and balanced:
        raise InputError("`balanced` states that gravity cancels about the pose, but no pose is given; give `pose` too")
    about = None if pose is None else _checked_pose(pose, robot, kept)
    motions = _motions(robot, joints, drives)
    check_size(robot, schedule)
    for motion in motions:
        refuse_missing_ranges(robot, motion.chosen)
    largest = _largest_torques(torque_ramp, [motion.labels[0] for motion in motions])
    checks, gravity = None if stated.world is None else CollisionChecks(robot, stated.world), gravity_of(robot)
    searches = [PlaceSearch(robot, gravity, motion, kept, checks) for motion in motions]
    placed = partial(_placed, schedule=schedule, about=about, balanced=balanced, seed=seed)
    pairs = zip(searches, largest, strict=True)
    planned = tuple(_coordinate_plan(search, schedule, *placed(search), torque) for search, torque in pairs)
    passages, notes = ((), ()) if checks is None else (_passages(robot, planned, checks), checks.notes)
    notes = (*notes, *stated.notes)
    unchecked = gravest_first((*stated.unchecked, *itertools.starmap(Unchecked, checks.unchecked if checks else ())))
    return FrictionPlan(robot, planned, stated.world, passages, notes, pose is not None, unchecked)


_POSITIONS = 101


def _motions(robot: Robot, joints: Sequence[str] | None, drives: Sequence[str] | None) -> list[PartialMotion]:
    """One motion per coordinate, in the order asked for."""
    if joints is not None and drives is not None:
        raise InputError("give joints or drives, not both")
    if joints is not None:
        motions = [of_joints(robot, [robot.joint_index(name)]) for name in joints]
    else:
        motions = [of_drives(robot, [name]) for name in (drive_names(robot) if drives is None else drives)]
    labels = [motion.labels[0] for motion in motions]
    if len(set(labels)) < len(labels):
        raise InputError(f"duplicate coordinates: {', '.join(labels)}")
    return motions


def _checked_pose(given: Sequence[float] | Array, robot: Robot, limits: Sequence[LinearConstraint]) -> Array:
    pose = np.asarray(given, dtype=float)
    if pose.shape != (robot.n,):
        names = ", ".join(robot.joint_names)
        raise InputError(f"pose needs {robot.n} numbers, one per joint {names}; given {pose.size}")
    check_pose(pose, "pose", limits)
    return pose


def _largest_torques(given: Sequence[float] | None, labels: Sequence[str]) -> list[float | None]:
    """Torque at the end of each coordinate's ramps, None for the default."""
    if given is None:
        return [None] * len(labels)
    check("torque_ramp", given)
    if len(given) not in (1, len(labels)):
        names = ", ".join(labels)
        raise InputError(f"torque ramp: expected one torque, or one for each of {names}; given {len(given)}")
    return [float(torque) for torque in (given if len(given) == len(labels) else [given[0]] * len(labels))]


def _coordinate_plan(
    search: PlaceSearch, schedule: Schedule, place: Place, runs: Runs, torque: float | None
) -> CoordinatePlan:
    robot, motion, line, checks = search.robot, search.motion, search.line, search.checks
    label = motion.labels[0]
    pose, centre = place.pose, _coordinate(robot, motion, place.pose)
    uses, unchecked = torque_uses(robot, runs, pose, motion)
    stroke = max(runs.strokes.values())
    g = search.gravity(line, pose + np.linspace(-stroke, stroke, _POSITIONS)[:, None] * line)
    ramps, no_ramps = torque_ramps(robot, schedule, label, line, float(g[_POSITIONS // 2]), torque)
    distances = None if checks is None else _distances(checks, runs, pose, line, centre)
    return CoordinatePlan(
        label=label,
        unit=motion.units[0],
        turns=tuple(name for _, name, _ in turning_drives(robot, line)),
        pose=dict(zip(robot.joint_names, pose.tolist(), strict=True)),
        direction=dict(zip(robot.joint_names, line.tolist(), strict=True)),
        centre=centre,
        low=place.low,
        high=place.high,
        gravity=place.gravity,
        below=place.below,
        above=place.above,
        largest_gravity=float(np.abs(g).max()),
        pace=runs.pace,
        schedule=schedule,
        windows=tuple(_window(part, percent, search, pose, centre) for part, percent in runs.windowed),
        left_out=tuple(SkippedSpeed(percent, reason) for percent, reason in runs.left_out.items()),
        limits=(*certificates(runs, pose, motion, search.limits), *uses),
        torques_unchecked=unchecked,
        distances=distances,
        ramps=ramps,
        no_ramps=no_ramps,
    )


def _placed(
    search: PlaceSearch, schedule: Schedule, about: Array | None, balanced: bool, seed: int
) -> tuple[Place, Runs]:
    """Where a coordinate is measured, and its runs there."""
    label, unit, pace = search.motion.labels[0], search.motion.units[0], pace_of(search.motion, search.limits)

    def runs_at(place: Place) -> Runs:
        because = f" (beyond it, {place.obstacle} is too near)" if place.obstacle else ""
        return scheduled_runs(schedule, pace, place.half, label, unit, because)

    if about is None:
        fastest = pace.velocity * max(schedule.percent) / 100.0
        ends = (pace.ramp(fastest) + 0.5 * fastest * seconds for seconds in (schedule.shortest, schedule.longest))
        enough, wanted = (min(end, schedule.stroke) for end in ends)
        place = search.found(enough, wanted, seed)
    else:
        place = search.given(about, balanced=balanced)
    runs = runs_at(place)
    if about is not None and not runs.strokes and place.obstacle:
        place = replace(search, checks=None).given(about, balanced=balanced)
        runs = runs_at(place)
    if not runs.strokes:
        slowest = min(schedule.percent)
        raise InputError(
            f"{label}: no speed leaves a window: {runs.left_out[slowest]} at {slowest:g} %; choose another `pose`, "
            "lower speeds (`percent`), a lower `shortest`, or higher acceleration and jerk limits"
        )
    return place, runs


def _distances(checks: CollisionChecks, runs: Runs, pose: Array, line: Array, centre: float) -> tuple[Distance, ...]:
    """Least distance of each pair of bodies over all positions that the runs pass."""
    positions = runs.extrema()[0]
    low, high = float(positions.low[0]), float(positions.high[0])
    uses = checks.uses(pose, line, low, high)
    return tuple(Distance(replace(use, time=runs.first_at(low + use.time)), centre + low + use.time) for use in uses)


def _passages(robot: Robot, planned: Sequence[CoordinatePlan], checks: CollisionChecks) -> tuple[Passage, ...]:
    """Straight lines from home, if there is one, to the first pose, and from each pose to the next."""
    poses = [("home", robot.home)] if robot.home is not None else []
    poses += [(c.label, c.place.pose) for c in planned]
    passages = []
    for (start, a), (end, b) in itertools.pairwise(poses):
        stretches = checks.free(a, b - a, 0.0, 1.0)
        whole = len(stretches) == 1 and not (stretches[0].below or stretches[0].above)
        named = next((name for s in stretches for name in (s.below, s.above) if name), "")
        passages.append(Passage(start, end, "" if whole else named or checks.nearest(a, b - a)))
    return tuple(passages)


def _window(part: Part, percent: float, search: PlaceSearch, pose: Array, centre: float) -> Window:
    start, end = part.steady()
    (first, last), speed = part.values(np.array([start, end]))[0], part.values(np.array([0.5 * (start + end)]))[1, 0]
    # trapezoids on equal steps: exact for odd functions, and accurate for the mean of a smooth torque
    g = search.gravity(search.line, pose + np.linspace(first, last, _POSITIONS)[:, None] * search.line)
    mean = float(np.trapezoid(g) / (_POSITIONS - 1))
    return Window(part.segment, percent, float(speed), start, end, float(centre + first), float(centre + last), mean)


def _coordinate(robot: Robot, motion: PartialMotion, pose: Array) -> float:
    """Position of the coordinate in a pose: z of a drive, q of a joint."""
    label = motion.labels[0]
    if robot.transmission is None or label in robot.joint_names:
        return float(pose[robot.joint_names.index(label)])
    row = [drive.name for drive in robot.transmission.drives].index(label)
    return float(robot.transmission.coupling[row] @ pose + robot.transmission.offset[row])
