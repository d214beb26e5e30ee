"""A compiled MuJoCo model as the tree of links and joints that a URDF would describe.

Actuators are taken as their joints feel them: largest torque, reflected inertia and damping. Of equality constraints,
joints that follow others or are held are part of the tree; what else they tie is only listed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from regressors.readers.angles import QUATERNION, AngleReader
from regressors.readers.urdf_tree import Mimic, TreeJoint, UrdfTree
from regressors.robot.inertia import Array, from_centre_of_mass, pose_of, transport
from regressors.robot.robot import Joint

try:
    import mujoco
except ImportError:  # said by whoever compiles a model
    mujoco = None


def names_of(model: Any, kind: str) -> list[str]:
    """Names of all bodies or all joints; one without a name is called by its number."""
    body = kind == "body"
    thing, count = (mujoco.mjtObj.mjOBJ_BODY, model.nbody) if body else (mujoco.mjtObj.mjOBJ_JOINT, model.njnt)
    given = [mujoco.mj_id2name(model, thing, number) for number in range(count)]
    return [name or _free_name(f"{kind}{number}", given) for number, name in enumerate(given)]


def tree_of_model(model: Any, name: str, source: str, *, snap_angles: bool = True) -> UrdfTree:
    """Tree of a compiled model, with the frames of `Joint`: a link's frame is that of the joint that moves it.

    A link has the axes of its body and its origin in the anchor of the hinge that moves it (MuJoCo's ``pos`` of the
    joint), and in the body's origin where it slides. A body that several joints move becomes as many links, all of them
    but the last without mass.
    """
    bodies, joints = names_of(model, "body"), names_of(model, "joint")
    equal, angles = equalities(model), AngleReader(snap_angles)
    links: dict[str, Array | None] = {bodies[0]: None}
    tree: list[TreeJoint] = []
    in_link = {0: np.eye(4)}  # pose of a body in the frame of the last of its links
    for body in range(1, model.nbody):
        parent = int(model.body_parentid[body])
        R = angles.turned(rotation_of_quaternion(model.body_quat[body]), f"link {bodies[body]!r}")
        link, T = bodies[parent], in_link[parent] @ pose_of(R, model.body_pos[body])
        begin = int(model.body_jntadr[body])
        own = range(begin, begin + int(model.body_jntnum[body]))
        for joint in own:
            child = bodies[body] if joint == own[-1] else f"{bodies[body]}/{joints[joint]}"
            names = (joints[joint], link, child)
            placed, T = _joint(model, joint, names, T, equal, angles)
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
    model: Any, number: int, names: tuple[str, str, str], T: Array, equal: Equalities, angles: AngleReader
) -> tuple[TreeJoint, Array]:
    """A joint, and the pose of its body in the frame of the link that it moves."""
    (mimics, held, _), actuators = equal, joint_actuators(model)[number]
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
    start = held.get(number, 0.0) - float(model.qpos0[model.jnt_qposadr[number]])
    pose, back = T @ at_zero.motion(start), pose_of(np.eye(3), -anchor)
    if number in held:
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
        mimic=mimics.get(number),
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


def _free_name(name: str, taken: Sequence[str | None]) -> str:
    return _free_name(f"{name}_", taken) if name in taken else name


def joint_actuators(model: Any) -> list[list[int]]:
    """Numbers of the actuators that act on a joint directly, for every joint."""
    direct = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    of_joint: list[list[int]] = [[] for _ in range(model.njnt)]
    if len(model.actuator_gear) == len(model.actuator_trntype):  # actuators of several outputs count otherwise
        for actuator, kind in enumerate(model.actuator_trntype.tolist()):
            if kind in direct:
                of_joint[int(model.actuator_trnid[actuator, 0])].append(actuator)
    return of_joint


def torque_limit(model: Any, joint: int, actuators: list[int]) -> float:
    """Largest torque or force of a joint to both sides, see `read_mjcf`; infinite where there is no limit [Nm or N]."""
    of_joint = _reach(model.jnt_actfrcrange[joint]) if model.jnt_actfrclimited[joint] else np.inf
    given = sum(abs(float(model.actuator_gear[k, 0])) * _force(model, k) for k in actuators) if actuators else np.inf
    return min(of_joint, given)


def reflected(model: Any, values: str, actuators: list[int]) -> float:
    """Inertia or damping of the actuators as their joint feels it, ``sum gear^2 x value``."""
    own = getattr(model, values, None)
    return 0.0 if own is None else float(sum(model.actuator_gear[k, 0] ** 2 * own[k] for k in actuators))


def _force(model: Any, actuator: int) -> float:
    force = _reach(model.actuator_forcerange[actuator]) if model.actuator_forcelimited[actuator] else np.inf
    kinds = (model.actuator_gaintype, model.actuator_biastype, model.actuator_dyntype)
    motor = [mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtDyn.mjDYN_NONE]
    if [int(kind[actuator]) for kind in kinds] == motor and model.actuator_ctrllimited[actuator]:
        force = min(force, abs(float(model.actuator_gainprm[actuator, 0])) * _reach(model.actuator_ctrlrange[actuator]))
    return force


def _reach(bounds: Array) -> float:
    lower, upper = (float(bound) for bound in bounds)
    return min(-lower, upper) if lower < 0.0 < upper else np.inf


@dataclass(frozen=True, eq=False)
class Tie:
    """A constraint between bodies, or between joints, that is no joint of the tree."""

    label: str
    joints: list[str]
    bodies: list[str]
    # where it closes a loop: its point, or the frame that it holds, in the link of each body, shape (4, 4)
    places: tuple[Array, Array] | None = None
    weld: bool = False


# joints that follow another one, and positions at which joints are held [rad or m], by their numbers; all the others
Equalities = tuple[dict[int, Mimic], dict[int, float], list[Tie]]


def equalities(model: Any) -> Equalities:
    """Active equality constraints of a compiled model.

    MuJoCo couples two joints by ``q1 - ref1 = sum_k c_k (q2 - ref2)^k``, and holds one by ``q1 - ref1 = c_0``.
    """
    kinds, joints, bodies = mujoco.mjtEq, names_of(model, "joint"), names_of(model, "body")
    mimics: dict[int, Mimic] = {}
    held: dict[int, float] = {}
    ties: list[Tie] = []
    for number in np.flatnonzero(model.eq_active0).tolist():
        kind, first, second = (int(values[number]) for values in (model.eq_type, model.eq_obj1id, model.eq_obj2id))
        if kind == kinds.mjEQ_JOINT and second < 0:
            held[first] = float(model.qpos0[model.jnt_qposadr[first]] + model.eq_data[number][0])
        elif kind == kinds.mjEQ_JOINT:
            mimics[first] = _mimic(model, number, joints[second])
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            ends, places = _closed_at(model, number)
            weld = kind == kinds.mjEQ_WELD
            what = f"the equality <{'weld' if weld else 'connect'}>"
            ties.append(Tie(what, [], [bodies[end] for end in ends], places, weld))
        elif kind == kinds.mjEQ_TENDON:
            of_joints, of_bodies = _ends_of_tendons(model, [tendon for tendon in (first, second) if tendon >= 0])
            ties.append(Tie("the equality <tendon>", [joints[k] for k in of_joints], [bodies[k] for k in of_bodies]))
    return mimics, held, ties


def _closed_at(model: Any, number: int) -> tuple[tuple[int, int], tuple[Array, Array]]:
    """Bodies that a `connect` or a `weld` holds together, and the frame in which it does, in the link of each.

    MuJoCo keeps the points of a `connect` in both bodies; of a `weld` the point in the second body, then the one in the
    first, then the axes of the second body in those of the first.
    """
    ids, data = [int(values[number]) for values in (model.eq_obj1id, model.eq_obj2id)], model.eq_data[number]
    if int(model.eq_objtype[number]) == mujoco.mjtObj.mjOBJ_SITE:
        frames = [pose_of(rotation_of_quaternion(model.site_quat[site]), model.site_pos[site]) for site in ids]
        ids = [int(model.site_bodyid[site]) for site in ids]
    elif int(model.eq_type[number]) == mujoco.mjtEq.mjEQ_CONNECT:
        frames = [pose_of(np.eye(3), data[:3]), pose_of(np.eye(3), data[3:6])]
    else:
        frames = [pose_of(rotation_of_quaternion(data[6:10]), data[3:6]), pose_of(np.eye(3), data[:3])]
    first, second = (_in_its_link(model, body) @ frame for body, frame in zip(ids, frames, strict=True))
    return (ids[0], ids[1]), (first, second)


def _in_its_link(model: Any, body: int) -> Array:
    """Pose of a body in its link, whose origin is the anchor of the hinge that moves it, see `tree_of_model`."""
    last = int(model.body_jntadr[body]) + int(model.body_jntnum[body]) - 1
    hinged = model.body_jntnum[body] and model.jnt_type[last] == mujoco.mjtJoint.mjJNT_HINGE
    return pose_of(np.eye(3), -model.jnt_pos[last] if hinged else np.zeros(3))


def _mimic(model: Any, number: int, leader: str) -> Mimic:
    """Line through the leader's zero, where a leader off the chain rests."""
    q1, q2 = (model.qpos0[model.jnt_qposadr[ids[number]]] for ids in (model.eq_obj1id, model.eq_obj2id))
    curve = np.polynomial.Polynomial(model.eq_data[number][:5])
    slope = curve.deriv()(-q2)
    return Mimic(leader, float(slope), float(q1 + curve(-q2)), curved=bool(np.any(curve.coef[2:])))


def _ends_of_tendons(model: Any, tendons: Sequence[int]) -> tuple[list[int], list[int]]:
    """Joints and bodies that tendons run over."""
    joints: list[int] = []
    bodies: list[int] = []
    for tendon in tendons:
        begin = int(model.tendon_adr[tendon])
        for place in range(begin, begin + int(model.tendon_num[tendon])):
            kind, what = int(model.wrap_type[place]), int(model.wrap_objid[place])
            if kind == mujoco.mjtWrap.mjWRAP_JOINT:
                joints.append(what)
            elif kind == mujoco.mjtWrap.mjWRAP_SITE:
                bodies.append(int(model.site_bodyid[what]))
    return joints, bodies


_SIX = (*((axis, "") for axis in "xyz"), *((axis, "_turn") for axis in "zyx"))  # slides and hinges of a free body


def on_feet(model: Any, path: Path) -> Any:
    """The model; a body that moves freely, of which a part is held to the world, is moved by six joints without drives.

    They are named such as ``trunk_x`` and ``trunk_turn_x``, and zero where the file puts the body.
    """
    held = {int(model.body_rootid[body]) for body in _held_to_world(model)}
    free = {int(model.jnt_bodyid[k]) for k in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)}
    if not held & free:
        return model
    spec, names = mujoco.MjSpec.from_file(str(path)), names_of(model, "body")
    spec.compile()  # which numbers what the file has
    for joint in [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]:
        body = joint.parent
        if body.id in held:
            spec.delete(joint)
            for axis, turn in _SIX:
                kind = mujoco.mjtJoint.mjJNT_HINGE if turn else mujoco.mjtJoint.mjJNT_SLIDE
                line = [float(axis == one) for one in "xyz"]
                body.add_joint(name=f"{names[body.id]}{turn}_{axis}", type=kind, axis=line)
    for key in list(spec.keys):  # poses of the joints as they were
        spec.delete(key)
    return spec.compile()


def feet_of(model: Any) -> tuple[str, ...]:
    """Bodies that are held to the world."""
    names = names_of(model, "body")
    return tuple(dict.fromkeys(names[body] for body in _held_to_world(model)))


def _held_to_world(model: Any) -> Iterator[int]:
    """Bodies of what has drives; a thing that is fastened to the world is none of it."""
    names = names_of(model, "body")
    driven = {int(model.body_rootid[model.jnt_bodyid[k]]) for k, own in enumerate(joint_actuators(model)) if own}
    for tie in equalities(model)[2]:
        numbers = [names.index(name) for name in tie.bodies]
        if tie.places is not None and 0 in numbers:
            yield from (number for number in numbers if number and int(model.body_rootid[number]) in driven)
