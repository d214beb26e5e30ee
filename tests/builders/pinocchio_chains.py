"""Pinocchio's model of any of our chains, for robots that have no URDF: the tests' oracle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from public_arms import THETA_FROM_PINOCCHIO

from regressors.robot.robot import Robot


def inertia(theta: np.ndarray) -> Any:
    """Pinocchio's inertia of a body with ten parameters in our order."""
    theirs = np.empty(10)
    theirs[THETA_FROM_PINOCCHIO] = theta
    return pin.Inertia.FromDynamicParameters(theirs)


def chain_model(robot: Robot) -> Any:
    """The chain without its drives; joints and links unknown to Pinocchio but for their frames, axes and inertias.

    Parameters
    ----------
    robot : Robot
        Links without parameters count as massless.
    """
    kinds = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}
    model = pin.Model()
    model.gravity = pin.Motion(np.array(robot.gravity), np.zeros(3))
    parent = 0
    for joint, link in zip(robot.joints, robot.links, strict=True):
        placement = pin.SE3(np.array(joint.rotation), np.array(joint.translation))
        parent = model.addJoint(parent, kinds[joint.kind](np.array(joint.axis)), placement, joint.name)
        if link.theta is not None:
            model.appendBodyToJoint(parent, inertia(link.theta), pin.SE3.Identity())
    return model
