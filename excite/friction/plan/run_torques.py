"""Torques of the runs of one coordinate, checked against the limits of joints and drives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from constraints.bounds.certificate import LimitUse, worst_of_each
from constraints.bounds.enclosure import enclose
from constraints.limits.torque import torque_limits
from excite.friction.plan.runs import Part, Runs
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.models.partial import PartialMotion
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_SAME = 9  # digits in which two parts are the same motion


def torque_uses(robot: Robot, runs: Runs, pose: Array, motion: PartialMotion) -> tuple[list[LimitUse], str]:
    """Certificates of all torque limits over continuous time, with the friction of the robot's file."""  # pose (n,)
    try:
        limits = torque_limits(robot, standard_values(robot), 0.0, replace(motion, offset=pose))
    except InputError as error:
        return [], str(error)
    torques_used = []
    for part in _different(runs):
        assert part.law is not None
        jerk = np.abs(part.law.derivative(3)).max() * abs(part.end - part.start)
        for limit in limits:
            uses = enclose(limit, _motion(part), part.law.duration, np.array([jerk])).uses(limit)
            torques_used += [replace(use, time=use.time + part.begin) for use in uses]
    return worst_of_each(torques_used), ""


def _different(runs: Runs) -> list[Part]:
    """Each motion once, where it is first played."""
    different: dict[tuple[float, ...], Part] = {}
    for part in runs.parts:
        if part.law is not None:
            key = tuple(round(value, _SAME) for value in (part.start, part.end, part.law.duration))
            different.setdefault(key, part)
    return list(different.values())


def _motion(part: Part) -> Callable[[Array], Samples]:
    def samples(time: Array) -> Samples:
        return Samples(time, *(row[:, None] for row in part.values(time + part.begin)))

    return samples
