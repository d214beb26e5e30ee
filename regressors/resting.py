"""The robot that is left when some joints are held: resting links ride on their parents.

A held joint's link is merged into the link before it, so parameters of the remaining links mean the composite bodies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from regressors.errors import InputError
from regressors.inertia import PARAMETERS_PER_LINK, Array, parameter_names, transport
from regressors.robot import Joint, Link, Robot, Structure, Transmission


def with_resting_joints(robot: Robot, moving: Sequence[int], position: Array | None = None) -> Robot:
    """Robot of the moving joints only, the others held.

    Parameters
    ----------
    robot : Robot
    moving : sequence of int
        Indices of the joints that move, in any order.
    position : array_like, shape (n,), optional
        Where the others rest [rad or m]; zero, or the nearest position limit, if not given.

    Returns
    -------
    Robot
        With ``len(moving)`` joints. Limits on drive coordinates hold still, shifted by what the resting joints add;
        drives of resting joints keep their limits and lose their parameters.

    Raises
    ------
    InputError
        No joint moves.
    """
    keep = sorted(set(moving))
    if not keep:
        raise InputError(f"robot {robot.name!r}: no joint moves; choose from {', '.join(robot.joint_names)}")
    if len(keep) == robot.n:
        return robot
    rest = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper) if position is None else position
    joints, links, zero = _merged_chain(robot, keep, np.asarray(rest, dtype=float))
    names = tuple(joint.name for joint in joints)
    aggregates = tuple(a for a in robot.structure.aggregates if a.joints == names)
    alone = {name for k in keep if k + 1 in keep or k + 1 == robot.n for name in _names(robot, k)}
    equal = tuple(group for group in robot.structure.equal if set(group) <= alone)
    return robot.replace(
        joints=joints,
        links=links,
        limits=robot.limits.take(keep),
        transmission=_transmission(robot, keep, np.asarray(rest, dtype=float)),
        structure=Structure(zero, equal, aggregates),
    )


def _names(robot: Robot, k: int) -> tuple[str, ...]:
    return parameter_names(robot.link_numbers[k])


def _merged_chain(
    robot: Robot, keep: list[int], rest: Array
) -> tuple[tuple[Joint, ...], tuple[Link, ...], frozenset[str]]:
    joints: list[Joint] = []
    links: list[Link] = []
    zero: set[str] = set()
    pose = np.eye(4)
    k = 0
    while k < robot.n:
        if k not in keep:
            pose = pose @ robot.joints[k].motion(rest[k])
            k += 1
            continue
        joint, number = robot.joints[k], robot.link_numbers[k]
        rotation, translation = pose[:3, :3] @ joint.rotation, pose[:3, :3] @ joint.translation + pose[:3, 3]
        joints.append(Joint(joint.name, joint.kind, rotation, translation, joint.axis))
        theta, known = np.zeros(PARAMETERS_PER_LINK), True
        possible = np.zeros(PARAMETERS_PER_LINK, dtype=bool)
        first, pose = k, np.eye(4)
        while k == first or (k < robot.n and k not in keep):
            if k != first:
                pose = pose @ robot.joints[k].motion(rest[k])
            X = transport(pose[:3, :3], pose[:3, 3])
            body = robot.links[k].theta
            known = known and body is not None
            theta += X @ (np.zeros(PARAMETERS_PER_LINK) if body is None else body)
            free = np.array([name not in robot.structure.zero for name in _names(robot, k)])
            possible |= np.abs(X) @ free.astype(float) > 1e-12
            k += 1
        links.append(Link(robot.links[first].name, theta if known else None, number))
        zero |= {name for name, may in zip(parameter_names(number), possible, strict=True) if not may}
    return tuple(joints), tuple(links), frozenset(zero)


def _transmission(robot: Robot, keep: list[int], rest: Array) -> Transmission | None:
    old = robot.transmission
    if old is None:
        return None
    held = np.setdiff1d(np.arange(robot.n), keep)
    drives = tuple(replace(d, rests=d.rests or (k in held)) for k, d in enumerate(old.drives))
    offset = old.offset + old.coupling[:, held] @ rest[held]
    return Transmission(old.coupling[:, keep], drives, old.limits, offset)
