"""A short motion in a small box that shows the mass, the centre and the inertia of what a robot holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.payload.held_body import frame_numbers
from excite.storage.records import Shown
from excite.tasks.further_settings import PayloadMotionSettings
from excite.tasks.installation import Installation
from excite.tasks.limit_choice import LimitChoice, Side
from excite.tasks.model_choice import ModelChoice
from excite.tasks.objective import Objective
from excite.tasks.robot_of_task import robot_and_task
from excite.tasks.search import Output, Search
from excite.tasks.trajectory_choice import TrajectoryChoice
from regressors.arguments import checked
from regressors.errors import InputError, check_names
from regressors.quantities import Tips, check
from regressors.robot.robot import Robot, finite_ranges
from regressors.robot.symbolic.kinematics import link_motions, sparse
from regressors.samples import Array

SENSORS = {"torque": "payload", "wrench": "load"}
NOISE = 0.01  # of a torque limit: weighs the joints' torques
WRENCH_NOISE = (1.0, 1.0, 1.0, 0.05, 0.05, 0.05)  # N, Nm
WRIST = 3  # joints nearest to the load, which may turn far
ARM_SWING, WRIST_SWING = 0.35, 1.5  # rad
SLIDE_SWING = 0.1  # m
RISE = 0.5  # s: from rest to the largest velocity, where no acceleration limit is known
FASTEST = 1.0  # rad/s or m/s: where no velocity limit is known either
_INSIDE = 1e-3

Sides = tuple[Side, Side, Side]
Box = float | Sequence[float] | Sequence[Side]


@dataclass(frozen=True, eq=False)
class PayloadMotion(Shown):
    """A motion that shows a payload.

    Parameters
    ----------
    design : Design
    pose : ndarray, shape (n,)
        That it is about [rad or m].
    box : tuple of (float, float)
        Bounds of x, y, z of the tool point in the base frame, None where there is none [m].
    notes : tuple of str
        What was assumed.
    """

    design: Design
    pose: Array
    box: Sides | None
    notes: tuple[str, ...]


@checked
def design_payload_motion(
    robot: Robot | str,
    box: Box | None = 0.2,
    *,
    sensor: str = PayloadMotionSettings.sensor,
    pose: Sequence[float] | None = None,
    centre: Sequence[float] | None = None,
    swing: Sequence[float] | float | None = None,
    period: float = PayloadMotionSettings.period,
    harmonics: int = PayloadMotionSettings.harmonics,
    starts: int = PayloadMotionSettings.starts,
    seed: int = 0,
    rate: float = 100.0,
    limits: LimitChoice | None = None,
    installation: Installation | None = None,
    base_link: str | None = None,
    tip: Tips = None,
    snap_angles: bool = True,
    xacro: bool = False,
    frame: Sequence[float] | None = None,
) -> PayloadMotion:
    """Find a short motion about a pose that shows the ten parameters of a load, within all limits.

    The motion minimises the sum of the variances of the parameters (A-optimality), each equation weighted by its noise,
    among Fourier series with a quintic, which start and end at rest.

    Parameters
    ----------
    robot : Robot or str
    box : float, three floats, or three pairs, optional
        The tool point stays in it: sides about the centre, one for all or one each; or lower and upper bound of x, y,
        z in the base frame, None where there is none [m].
    sensor : {"torque", "wrench"}
        What measures: the joints' torques, or a force/torque sensor that carries the load.
    pose : sequence of float, optional
        That the motion is about [rad or m]; the robot's home, or the middle of its ranges, if not given.
    centre : sequence of float, optional
        Of the box in the base frame [m]; the tool point in that pose if not given.
    swing : float or sequence of float, optional
        Largest deviation of the joints from the pose, one for all or one each [rad or m].
    period : float
        Duration [s].
    harmonics, starts, seed, rate
        See `excite.tasks.task.Task`.
    limits : LimitChoice, optional
        Limits of joints, tool, torques and distances beside those of the description.
    installation : Installation, optional
    base_link, tip, snap_angles, xacro
        See `excite.design_trajectory`.
    frame : six floats, optional
        Origin and roll, pitch, yaw of the sensor's frame in the last link's frame [m, rad].

    Returns
    -------
    PayloadMotion

    Raises
    ------
    InputError
        A pose beyond the limits, a box that it is not in, or see `excite.design_trajectory`.
    excite.errors.NoFeasibleMotionError
        No motion was found within the limits.
    """
    check_names("sensor", [sensor], SENSORS)
    check("period", period)
    described, task = robot_and_task(robot, base_link, tip, installation, snap_angles, xacro)
    described.check_open("a motion for a payload")
    limits = limits if limits is not None else LimitChoice()
    within = limits.applied(described)
    about, notes = _pose(within, pose)
    acceleration, assumed = _acceleration(within)
    point = _tool_point(within, about, limits.tool_point)
    sides = (
        limits.tool_box if box is None else _sides(box, point if centre is None else np.asarray(centre, dtype=float))
    )
    _check_inside(point, sides)
    limits = replace(limits, position=_ranges(within, about, swing), tool_box=sides, acceleration=acceleration)
    x = tuple(frame_numbers(frame).tolist())
    model = ModelChoice(model=SENSORS[sensor], friction=False, sensor_xyz=x[:3], sensor_rpy=x[3:])
    task = task.changed(
        model=model,
        trajectory=TrajectoryChoice("fourier-quintic", period=period, harmonics=harmonics),
        objective=_objective(within, sensor),
        limits=limits,
        search=Search(starts=starts, seed=seed, executor="serial"),
        output=Output(rate=rate),
    )
    return PayloadMotion(design_trajectory(task), about, sides, (*notes, *assumed))


def _objective(robot: Robot, sensor: str) -> Objective:
    """Sum of variances, each equation weighted by its noise where that is known."""
    torque = robot.limits.torque
    if sensor != "wrench" and not np.all(np.isfinite(torque)):
        return Objective(criterion="trace")
    noise = WRENCH_NOISE if sensor == "wrench" else tuple((NOISE * torque).tolist())
    return Objective(criterion="trace", noise=noise, weighted=True)


def _pose(robot: Robot, given: Sequence[float] | None) -> tuple[Array, tuple[str, ...]]:
    lower, upper = robot.limits.lower, robot.limits.upper
    if given is not None:
        pose = np.asarray(given, dtype=float)
        if pose.shape != (robot.n,) or not np.all(np.isfinite(pose)):
            raise InputError(f"`pose` needs {robot.n} finite numbers, one per joint, given {len(pose)}")
        notes: tuple[str, ...] = ()
    elif robot.home is not None:
        pose, notes = np.array(robot.home), ("the motion is about the robot's home; give `pose` for the present one",)
    else:
        low, high = finite_ranges(robot)
        pose = (low + high) / 2
        notes = ("no pose is known, so the motion is about the middle of the joints' ranges; give the present `pose`",)
    outside = np.flatnonzero((pose < lower) | (pose > upper))
    if outside.size:
        k = int(outside[0])
        raise InputError(
            f"`pose`: joint {robot.joint_names[k]} at {pose[k]:g} is beyond its limits, {lower[k]:g} to {upper[k]:g}"
        )
    return pose, notes


def _ranges(robot: Robot, pose: Array, swing: Sequence[float] | float | None) -> tuple[tuple[float, float], ...]:
    """Position limits of each joint: its own, and those about the pose."""
    far = np.array([ARM_SWING] * (robot.n - WRIST) + [WRIST_SWING] * WRIST)[-robot.n :]
    far = np.where([joint.kind == "prismatic" for joint in robot.joints], SLIDE_SWING, far)
    if swing is not None:
        given = np.atleast_1d(np.asarray(swing, dtype=float))
        if given.size not in (1, robot.n) or not np.all(given > 0) or not np.all(np.isfinite(given)):
            raise InputError(f"`swing` needs one number greater than zero, or {robot.n}, one per joint")
        far = np.broadcast_to(given, robot.n)
    lower = np.maximum(robot.limits.lower, pose - far)
    upper = np.minimum(robot.limits.upper, pose + far)
    return tuple(zip(lower.tolist(), upper.tolist(), strict=True))


def _acceleration(robot: Robot) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Acceleration limits, with those that are assumed."""
    known, velocity = robot.limits.acceleration, robot.limits.velocity
    assumed = np.where(np.isfinite(velocity), velocity, FASTEST) / RISE
    missing = [name for name, a in zip(robot.joint_names, known, strict=True) if not np.isfinite(a)]
    if not missing:
        return tuple(known.tolist()), ()
    note = (
        f"no acceleration limit is known of {', '.join(missing)}: that from rest to the largest velocity in {RISE:g} s "
        "is assumed; give `acceleration` limits to replace it"
    )
    return tuple(np.where(np.isfinite(known), known, assumed).tolist()), (note,)


def _tool_point(robot: Robot, pose: Array, point: Sequence[float]) -> Array:
    symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
    last = list(link_motions(robot, *symbols))[robot.last_link("a payload")]
    place = ca.Function("place", symbols, [last.origin + ca.mtimes(last.rotation, sparse(np.asarray(point)))])
    none = np.zeros(robot.n)
    return np.asarray(place(pose, none, none), dtype=float).ravel()


def _sides(box: Box, centre: Array) -> Sides:
    """Bounds of x, y, z in the base frame."""
    if centre.shape != (3,) or not np.all(np.isfinite(centre)):
        raise InputError("`centre` needs three finite numbers, x, y, z [m]")
    sides: Any = (float(box),) * 3 if isinstance(box, int | float) else tuple(box)
    if len(sides) != 3:
        raise InputError(f"`box` needs one side, or three: x, y, z; given {len(sides)}")
    if all(isinstance(side, int | float) for side in sides):
        half = np.array(sides, dtype=float) / 2
        if not (np.all(np.isfinite(half)) and np.all(half > 0)):
            raise InputError(f"`box`: its sides must be lengths greater than zero, given {', '.join(map(str, sides))}")
        sides = zip((centre - half).tolist(), (centre + half).tolist(), strict=True)
    elif any(isinstance(side, int | float) or len(side) != 2 for side in sides):
        raise InputError("`box` needs three sides, or a lower and an upper bound for each of x, y, z")
    x, y, z = ((low, high) for low, high in sides)
    return x, y, z


def _check_inside(point: Array, sides: Sides | None) -> None:
    if sides is None:
        return
    for axis, x, (low, high) in zip("xyz", point, sides, strict=True):
        if (low is not None and x < low - _INSIDE) or (high is not None and x > high + _INSIDE):
            bounds = f"{-np.inf if low is None else low:.4g} to {np.inf if high is None else high:.4g}"
            raise InputError(
                f"`box`: in the pose that the motion is about, the tool point has {axis} = {x:.4g} m, outside of "
                f"{bounds} m; give the `pose` that the robot is in, or a box about it"
            )
