"""A compiled MuJoCo model as the tree of links and joints that a URDF would describe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from regressors.readers.angles import QUATERNION, AngleReader
from regressors.readers.mjcf_actuators import joint_actuators, reflected, torque_limit
from regressors.readers.mjcf_equalities import Equalities
from regressors.readers.urdf_tree import TreeJoint, UrdfTree
from regressors.robot.inertia import Array, from_centre_of_mass, transport
from regressors.robot.robot import Joint


def names_of(model: Any, kind: str) -> list[str]:
    """Names of all bodies or all joints; one without a name is called by its number."""
    import mujoco

    thing, count = {
        "body": (mujoco.mjtObj.mjOBJ_BODY, model.nbody),
        "joint": (mujoco.mjtObj.mjOBJ_JOINT, model.njnt),
    }[kind]
    given = [mujoco.mj_id2name(model, thing, number) for number in range(count)]
    return [name or _free_name(f"{kind}{number}", given) for number, name in enumerate(given)]


def tree_of_model(model: Any, name: str, source: str, equal: Equalities, *, snap_angles: bool = True) -> UrdfTree:
    """Tree of a compiled model, with the frames of `Joint`: a link's frame is that of the joint that moves it.

    A link has the axes of its body and its origin in the anchor of the hinge that moves it (MuJoCo's ``pos`` of the
    joint), and in the body's origin where it slides. A body that several joints move becomes as many links, all of them
    but the last without mass.
    """
    bodies, joints = names_of(model, "body"), names_of(model, "joint")
    actuators, angles = joint_actuators(model), AngleReader(snap_angles)
    links: dict[str, Array | None] = {bodies[0]: None}
    tree: list[TreeJoint] = []
    in_link = {0: np.eye(4)}  # pose of a body in the frame of the last of its links
    for body in range(1, model.nbody):
        parent = int(model.body_parentid[body])
        R = angles.turned(rotation_of_quaternion(model.body_quat[body]), f"link {bodies[body]!r}")
        link, T = bodies[parent], in_link[parent] @ _pose(model.body_pos[body], R)
        begin = int(model.body_jntadr[body])
        own = range(begin, begin + int(model.body_jntnum[body]))
        for joint in own:
            child = bodies[body] if joint == own[-1] else f"{bodies[body]}/{joints[joint]}"
            names = (joints[joint], link, child)
            placed, T = _joint(model, joint, names, T, equal, actuators[joint], angles)
            tree.append(placed)
            links[child], link = np.zeros(10), child
        if not own:
            tree.append(_fixed(f"fixed {bodies[body]}", link, bodies[body], T))
            T = np.eye(4)
        links[bodies[body]] = _parameters(model, body, T)
        in_link[body] = T
    below: dict[str, list[TreeJoint]] = {link: [] for link in links}
    for placed in tree:
        below[placed.parent].append(placed)
    return UrdfTree(name, source, bodies[0], links, {joint.child: joint for joint in tree}, below, angles=angles)


def _joint(
    model: Any,
    number: int,
    names: tuple[str, str, str],
    T: Array,
    equal: Equalities,
    actuators: list[int],
    angles: AngleReader,
) -> tuple[TreeJoint, Array]:
    """A joint, and the pose of its body in the frame of the link that it moves."""
    import mujoco

    kind = int(model.jnt_type[number])
    if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        placed = _fixed(*names, T)
        if _is_object(model, number):
            return placed, np.eye(4)
        return replace(placed, kind="free" if kind == mujoco.mjtJoint.mjJNT_FREE else "ball"), np.eye(4)
    hinge = kind == mujoco.mjtJoint.mjJNT_HINGE
    anchor = model.jnt_pos[number] if hinge else np.zeros(3)
    axis = np.array(model.jnt_axis[number])
    axis = angles.axis(axis, f"joint {names[0]!r}", " ".join(f"{part:.7g}" for part in axis), QUATERNION)
    at_zero = Joint(names[0], "revolute" if hinge else "prismatic", np.eye(3), anchor, axis)
    start = equal.held.get(number, 0.0) - float(model.qpos0[model.jnt_qposadr[number]])
    pose, back = T @ at_zero.motion(start), _shift(-anchor)
    if number in equal.held:
        return _fixed(*names, pose), back
    limited = bool(model.jnt_limited[number])
    bounds = dict(zip(("lower", "upper"), model.jnt_range[number].tolist(), strict=True)) if limited else {}
    dof = int(model.jnt_dofadr[number])
    turning = "revolute" if limited else "continuous"
    placed = TreeJoint(
        *names,
        kind=turning if hinge else "prismatic",
        pose=pose,
        axis=axis,
        bounds={**bounds, "effort": torque_limit(model, number, actuators)},
        damping=float(model.dof_damping[dof]) + reflected(model, "actuator_damping", actuators),
        friction=float(model.dof_frictionloss[dof]),
        mimic=equal.mimics.get(number),
    )
    return placed, back


def _is_object(model: Any, joint: int) -> bool:
    """Whether a joint is the only one of a body in the world with all that it carries: a thing that lies around."""
    body = model.jnt_bodyid[joint]
    tree = np.flatnonzero(model.body_rootid == body)
    return bool(np.sum(model.body_jntnum[tree]) == 1)


def _fixed(name: str, parent: str, child: str, pose: Array) -> TreeJoint:
    return TreeJoint(name, parent, child, "fixed", pose, np.array([1.0, 0.0, 0.0]), {}, None, None, None)


def _parameters(model: Any, body: int, T: Array) -> Array | None:
    """Inertial parameters of a body in a frame in which its own has pose T; None of one that is a frame only."""
    mass, moments = float(model.body_mass[body]), model.body_inertia[body]
    if mass == 0.0 and not np.any(moments):
        return None
    R = rotation_of_quaternion(model.body_iquat[body])
    theta = from_centre_of_mass(mass, model.body_ipos[body], R @ np.diag(moments) @ R.T)
    return transport(T[:3, :3], T[:3, 3]) @ theta


def rotation_of_quaternion(quaternion: Array) -> Array:
    """Rotation matrix of a unit quaternion with the real part first, shape (3, 3)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def _pose(position: Array, R: Array) -> Array:
    T = _shift(position)
    T[:3, :3] = R
    return T


def _shift(position: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = position
    return T


def _free_name(name: str, taken: Sequence[str | None]) -> str:
    return _free_name(f"{name}_", taken) if name in taken else name
