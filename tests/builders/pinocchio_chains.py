"""Pinocchio's model of any of our robots, and the torques and motions it has: the tests' oracle."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from public_arms import THETA_FROM_PINOCCHIO

from regressors.models.nominal import standard_values
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


def inertia(theta: np.ndarray) -> Any:
    """Pinocchio's inertia of a body with ten parameters in our order."""
    theirs = np.empty(10)
    theirs[THETA_FROM_PINOCCHIO] = theta
    return pin.Inertia.FromDynamicParameters(theirs)


def chain_model(robot: Robot) -> Any:
    """The robot without its drives; joints and links unknown to Pinocchio but for their frames, axes and inertias.

    Parameters
    ----------
    robot : Robot
        Links without parameters count as massless.
    """
    kinds = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}
    model = pin.Model()
    model.gravity = pin.Motion(np.array(robot.gravity), np.zeros(3))
    for joint, link, parent in zip(robot.joints, robot.links, robot.parents, strict=True):
        placement = pin.SE3(np.array(joint.rotation), np.array(joint.translation))
        own = model.addJoint(parent, kinds[joint.kind](np.array(joint.axis)), placement, joint.name)
        if link.theta is not None:
            model.appendBodyToJoint(own, inertia(link.theta), pin.SE3.Identity())
    return model


def joint_torques(robot: Robot, samples: Samples, load: np.ndarray | None = None) -> Array:
    """Torques at the joints that the links take, and a load at the last one, shape (N, n) [Nm or N]."""
    model = chain_model(robot)
    if load is not None:
        model.appendBodyToJoint(robot.n, inertia(load), pin.SE3.Identity())
    data = model.createData()
    return np.array([pin.rnea(model, data, *state) for state in zip(samples.q, samples.dq, samples.ddq, strict=True)])


def held_wrench(robot: Robot, theta: np.ndarray, samples: Samples) -> Array:
    """Force and torque that the last link takes to move a body of ten parameters, in its frame, shape (N, 6)."""
    model = chain_model(robot)
    model.inertias[robot.n] = inertia(theta)
    data, wrenches = model.createData(), []
    for state in zip(samples.q, samples.dq, samples.ddq, strict=True):
        pin.rnea(model, data, *state)
        wrenches.append(data.f[robot.n].vector.copy())
    return np.array(wrenches)


def drive_torques(robot: Robot, samples: Samples) -> Array:
    """Torques of the drives without Coulomb friction: the links', rotors by Lagrange's equation, viscous friction.

    Parameters
    ----------
    robot : Robot
        With as many drives as joints.
    samples : Samples
    """
    transmission, values = robot.transmission, standard_values(robot)
    assert transmission is not None
    C = transmission.coupling
    z, dz, ddz = samples.q @ C.T + transmission.offset, samples.dq @ C.T, samples.ddq @ C.T
    torque = joint_torques(robot, samples) @ np.linalg.inv(C)
    symbol, h = ca.SX.sym("z"), 1e-5
    for k, drive in enumerate(transmission.drives):
        ratio = ca.Function("ratio", [symbol], [drive.ratio.ratio(symbol)])
        F, ahead, behind = (np.array(ratio(z[None, :, k] + step)).ravel() for step in (0.0, h, -h))
        rotor = F**2 * ddz[:, k] + F * (ahead - behind) / (2 * h) * dz[:, k] ** 2
        torque[:, k] += values.get(f"Ia{k + 1}", 0.0) * rotor + values.get(f"F{k + 1}v", 0.0) * dz[:, k]
    return torque


def tool_motion(robot: Robot, point: Array, samples: Samples) -> tuple[Array, Array]:
    """Position and velocity of a point of the last link in the base frame, shape (N, 3) each [m, m/s]."""
    model = chain_model(robot)
    frame = model.addFrame(pin.Frame("tool", robot.n, 0, pin.SE3(np.eye(3), point), pin.FrameType.OP_FRAME))
    data, position, velocity = model.createData(), [], []
    for q, dq in zip(samples.q, samples.dq, strict=True):
        pin.forwardKinematics(model, data, q, dq)
        pin.updateFramePlacement(model, data, frame)
        position.append(data.oMf[frame].translation.copy())
        velocity.append(pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear)
    return np.array(position), np.array(velocity)


def whole_motion(robot: Robot, joints: tuple[str, ...], samples: Samples) -> Samples:
    """Motion of all joints while some move and the others rest at zero, or at the nearest position limit."""
    index = [robot.joint_names.index(name) for name in joints]
    rest = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    motion = [np.tile(value, (len(samples.q), 1)) for value in (rest, 0 * rest, 0 * rest, 0 * rest)]
    for whole, part in zip(motion, (samples.q, samples.dq, samples.ddq, samples.dddq), strict=True):
        whole[:, index] = part
    return Samples(samples.time, *motion)


def gravity_along(robot: Robot, poses: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Gravity's torque on a coordinate along a line in some poses."""
    model = chain_model(robot)
    data = model.createData()
    return np.array([pin.computeGeneralizedGravity(model, data, pose).copy() for pose in poses]) @ line


def ground_wrenches(robot: Robot, samples: Samples, axes: Array | None = None, origin: Any = (0.0, 0.0, 0.0)) -> Array:
    """Force and moment of the ground in a frame of the base, shape (N, 6): what all that it carries takes."""
    model = chain_model(robot)
    data, found, place = model.createData(), [], pin.SE3(np.eye(3) if axes is None else axes, np.array(origin))
    for state in zip(samples.q, samples.dq, samples.ddq, strict=True):
        pin.rnea(model, data, *state)
        carried = [k for k in range(1, model.njoints) if model.parents[k] == 0]
        found.append(sum(place.actInv(data.liMi[k].act(data.f[k])).vector for k in carried))
    return np.array(found)
