"""Rotors of a robot whose description says nothing of its drives: their inertia as the joints feel it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from regressors.robot.robot import Drive, Limits, Robot, Transmission

UNKNOWN = math.nan


def with_joint_rotors(robot: Robot) -> Robot:
    """The robot with a rotor on every drive, of unknown inertia where the description has none.

    Without a transmission each joint gets a drive of ratio 1: its ``Ia`` is what the rotor's inertia amounts to at the
    joint, ``Ia = ratio^2 x inertia of the rotor`` [kg m^2].
    """
    old = robot.transmission
    if old is None:
        drives = tuple(Drive(joint.name, rotor_inertia=UNKNOWN) for joint in robot.joints)
        return robot.replace(transmission=Transmission(np.eye(robot.n), drives, Limits.none(robot.n)))
    drives = tuple(d if d.rotor_inertia is not None else replace(d, rotor_inertia=UNKNOWN) for d in old.drives)
    return robot.replace(transmission=replace(old, drives=drives))
