"""Joints of a URDF that are held: where they rest, and what they carry."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from regressors.errors import InputError
from regressors.readers.urdf_tree import TreeJoint, UrdfTree, listing
from regressors.robot.inertia import Array
from regressors.robot.robot import Joint, JointKind


def rest(tree: UrdfTree, joint: TreeJoint) -> tuple[float, str]:
    """Position of a joint off the chain, and the name of the joint that it follows in the end (its own if none)."""
    position, gain, visited = 0.0, 1.0, {joint.name}
    by_name = {other.name: other for other in tree.above.values()} if joint.mimic else {}
    while joint.mimic is not None:
        position += gain * joint.mimic.offset
        gain *= joint.mimic.multiplier
        leader = by_name.get(joint.mimic.joint)
        if leader is None:
            return position, joint.mimic.joint
        if leader.name in visited:
            names = ", ".join(listing(sorted(visited)))
            raise InputError(f"{tree.source}: joint {joint.name!r} mimics itself by way of {names}")
        visited.add(leader.name)
        joint = leader
    return position, joint.name


def resting_pose(tree: UrdfTree, joint: TreeJoint) -> Array:
    """Pose of a joint's child in its parent's frame, at position zero or where what it mimics puts it, shape (4, 4)."""
    position, _ = rest(tree, joint)
    if position == 0.0:
        return joint.pose
    return Joint(joint.name, kind_of(joint), joint.pose[:3, :3], joint.pose[:3, 3], joint.axis).motion(position)


def kind_of(joint: TreeJoint) -> JointKind:
    """How a joint of URDF moves, as a `Joint`."""
    return "prismatic" if joint.kind == "prismatic" else "revolute"


def carried(tree: UrdfTree, link: str, stop: Collection[str]) -> Iterator[tuple[str, Array]]:
    """A link and all that hangs on it up to the joints to stop at, with the poses in its frame, shape (4, 4)."""
    todo = [(link, np.eye(4))]
    while todo:
        name, T = todo.pop()
        yield name, T
        todo.extend((j.child, T @ resting_pose(tree, j)) for j in tree.below[name] if j.name not in stop)
