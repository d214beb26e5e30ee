"""Whether a file of the user's own describes the robot whose parameters are to be written into it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from excite.export.models.identified_model import IdentifiedModel
from regressors.errors import InputError
from regressors.quoting import shortened
from regressors.readers.resting_joints import carried, kind_of
from regressors.readers.urdf_tree import TreeJoint, UrdfTree
from regressors.robot.robot import Joint, Robot
from regressors.samples import Array

_ROUNDED = 1e-3  # of a pose whose angles were snapped


def chain_in(tree: UrdfTree, robot: Robot, file: Path) -> list[TreeJoint]:
    """The joints of a robot in a file, in their order."""
    by_name = {joint.name: joint for joint in tree.above.values()}
    if missing := [name for name in robot.joint_names if name not in by_name]:
        raise InputError(
            f"{str(file)!r} is not the file of robot {robot.name!r}: it has no joint {', '.join(missing)}; its joints "
            f"are {shortened(', '.join(sorted(by_name)))}"
        )
    return [by_name[name] for name in robot.joint_names]


def pose_error(trees: tuple[UrdfTree, ...], robot: Robot, file: Path) -> float:
    """Largest difference of the poses and axes of joints in the first tree from those of the robot."""
    chain = chain_in(trees[0], robot, file)
    distances = [_distances(tree, robot) for tree in trees]
    for k, joint in enumerate(robot.joints):
        if kind_of(chain[k]) != joint.kind or min(d[k] for d in distances) > _ROUNDED:
            raise InputError(
                f"{str(file)!r} is not the file of robot {robot.name!r}: joint {joint.name!r} sits elsewhere in it, or "
                "moves otherwise; give the file that the robot was read from, or leave `robot_file` out"
            )
    return max(distances[0])


def _distances(tree: UrdfTree, robot: Robot) -> list[float]:
    """Largest difference of each joint's pose and axis from the robot's; infinite where no chain leads to it."""
    by_name = {joint.name: joint for joint in tree.above.values()}
    distances, before = [], None
    for joint in robot.joints:
        mine = by_name[joint.name]
        path = [mine] if before is None else tree.path(before, mine.child)
        distances.append(
            min((_distance(p, joint) for p in _paths(tree, path, open_above=before is None)), default=np.inf)
        )
        before = mine.child
    return distances


def _paths(tree: UrdfTree, path: list[TreeJoint] | None, *, open_above: bool) -> list[list[TreeJoint]]:
    """The path; where the robot's base is not known, with more and more of the joints above it too."""
    paths = [] if path is None else [path]
    while open_above and paths and paths[-1][0].parent in tree.above:
        paths.append([tree.above[paths[-1][0].parent], *paths[-1]])
    return paths


def _distance(path: list[TreeJoint], joint: Joint) -> float:
    T = np.eye(4)
    for step in path:
        T = T @ step.pose
    differences = (T[:3, 3] - joint.translation, T[:3, :3] - joint.rotation, path[-1].axis - joint.axis)
    return float(max(np.abs(difference).max() for difference in differences))


def moving_groups(
    tree: UrdfTree, chain: list[TreeJoint], model: IdentifiedModel
) -> Iterator[tuple[str, str, list[tuple[str, Array, Array]]]]:
    """The links of a file that moved as one, for every moving body."""  # result (10,)
    names = {joint.name for joint in chain}
    for own, name in enumerate(link.name for link in model.described.links):
        if name not in model.composites:
            continue
        parts = [
            (link, pose @ T)
            for k, (carrier, pose) in enumerate(model.carriers[: len(chain)])
            if carrier == own
            for link, T in carried(tree, chain[k].child, names)
            if link != chain[own].child
        ]
        known = [(link, theta, T) for link, T in parts if (theta := tree.links[link]) is not None]
        yield name, chain[own].child, [part for part in known if np.any(part[1])]
