"""Distances between a robot's capsules and what is around it by Pinocchio and Coal: the tests' oracle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from pinocchio_chains import chain_model

from constraints.geometry import Box, HalfSpace, Shape, World
from regressors.robot.robot import BASE, Robot
from regressors.robot.shapes import Capsule


def solid(shape: Shape) -> tuple[Any, pin.SE3]:
    """Coal's geometry of a shape, and its pose in the frame that the shape is given in."""
    if isinstance(shape, HalfSpace):
        return coal.Halfspace(np.array(shape.normal), shape.offset), pin.SE3.Identity()
    if isinstance(shape, Box):
        return coal.Box(np.array(shape.size)), pin.SE3(pin.rpy.rpyToMatrix(*shape.rpy), np.array(shape.centre))
    start, end = np.array(shape.start), np.array(shape.end)
    if np.array_equal(start, end):
        return coal.Sphere(shape.radius), pin.SE3(np.eye(3), start)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start).matrix()
    return coal.Capsule(shape.radius, float(np.linalg.norm(end - start))), pin.SE3(turn, (start + end) / 2)


def distance(one: Shape, pose: pin.SE3, other: Shape, others: pin.SE3) -> float:
    """Between two shapes on two frames [m]; negative where they overlap."""
    (a, A), (b, B) = solid(one), solid(other)
    place = [coal.Transform3s(T.rotation, T.translation) for T in (pose * A, others * B)]
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_max_iterations, request.gjk_tolerance = 1000, 1e-9
    return float(coal.distance(a, place[0], b, place[1], request, result))


def link_poses(robot: Robot, q: np.ndarray) -> dict[str, pin.SE3]:
    """Pose of every link, and of the base, in the base frame."""
    model = chain_model(robot)
    data = model.createData()
    angles = [q[k] for k in range(robot.n)]
    pin.forwardKinematics(model, data, np.array(angles))
    return {BASE: pin.SE3.Identity(), **{link.name: data.oMi[k] for k, link in enumerate(robot.links, 1)}}


def shapes_of(world: World, body: str) -> Sequence[Shape]:
    """Of a link, or of an obstacle."""
    capsules: list[Capsule] = [part.capsule for part in world.parts if part.link == body]
    return capsules or [obstacle.shape for obstacle in world.obstacles if obstacle.name == body]


def clearance(robot: Robot, world: World, label: str, q: np.ndarray) -> float:
    """Distance that a label such as ``link_3 to table`` means, in a pose [m]."""
    one, other = label.split(" to ", 1)
    poses = link_poses(robot, q)
    return min(
        distance(a, poses[one], b, poses.get(other, pin.SE3.Identity()))
        for a in shapes_of(world, one)
        for b in shapes_of(world, other)
    )
