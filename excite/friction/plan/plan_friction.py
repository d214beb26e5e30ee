"""Planning of friction measurements, for the command line and scripts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from constraints.collision.geometry import World
from excite.friction.plan.friction_plan import FrictionPlan
from excite.friction.plan.plan import friction_plan
from excite.friction.plan.schedule import Schedule
from excite.registry import built_in
from excite.tasks.limit_choice import LimitChoice
from regressors.arguments import checked
from regressors.numerical import numerical_work
from regressors.quantities import check
from regressors.readers.library import load_robot
from regressors.robot.robot import Robot


@checked
@numerical_work(
    "the friction plan",
    "speeds or limits of very different sizes are the likely cause: "
    "check `percent`, `creep` and the limits of the joints",
)
def plan_friction(
    robot: Robot | str,
    schedule: Schedule | None = None,
    *,
    joints: Sequence[str] | None = None,
    drives: Sequence[str] | None = None,
    limits: LimitChoice | None = None,
    pose: Sequence[float] | None = None,
    balanced: bool = False,
    world: World | str | Path | None = None,
    torque_ramp: Sequence[float] | None = None,
    seed: int = 0,
) -> FrictionPlan:
    """Plan the runs that measure the friction of a robot's joints or drives.

    Parameters
    ----------
    robot : Robot or str
        A robot, or the name or file of one.
    schedule : Schedule, optional
        Speeds, windows, warm-up, break-away tests, order.
    joints, drives : sequence of str, optional
        Those to measure; all drives if neither is given.
    limits : LimitChoice, optional
        Limits of joints that replace those of the description.
    pose : sequence of float, length n, optional
        Middle of every run; one about which gravity cancels is searched for if not given [rad or m].
    balanced : bool
        True if gravity is known to cancel about the given pose, although inertias are unknown.
    world : World or path, optional
        Shape of the robot and its environment, which the robot must not touch.
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
        See `excite.friction.plan.plan.friction_plan`.
    """
    for quantity, value in (("seed", seed), ("pose", pose)):
        check(quantity, value)
    name = robot if isinstance(robot, str) else None
    described = load_robot(robot) if isinstance(robot, str) else robot
    described = described if limits is None else limits.applied(described)
    known: World | None = built_in("reader", "world")(Path(world), name) if isinstance(world, str | Path) else world
    return friction_plan(
        described,
        schedule,
        joints=joints,
        drives=drives,
        pose=None if pose is None else np.asarray(pose, dtype=float),
        balanced=balanced,
        world=known,
        torque_ramp=torque_ramp,
        seed=seed,
    )
