"""Inverse dynamics of files by the programs that load them, Pinocchio and MuJoCo, and chains written for them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from public_arms import Reference
from scipy.spatial.transform import Rotation

from regressors.samples import Array, Samples

OFF = ("mjDSBL_CONTACT", "mjDSBL_LIMIT", "mjDSBL_EQUALITY")


@dataclass(frozen=True, eq=False)
class Reloaded:
    """Torques of some joints.

    Parameters
    ----------
    rigid, friction : ndarray, shape (N, n)
    """

    rigid: Array
    friction: Array


def by_pinocchio(
    path: Path, joints: Sequence[str], samples: Samples, rest: Mapping[str, float] | None = None
) -> Reloaded:
    """Torques of a URDF: `rnea`, and friction from the joints' ``damping`` and ``friction``; other joints at rest."""
    import pinocchio as pin

    model = pin.buildModelFromXML(path.read_bytes().decode("utf-8"))
    data = model.createData()
    ids = [model.getJointId(name) for name in joints]
    assert max(ids) < model.njoints
    chosen = [model.joints[k] for k in ids]
    v = [joint.idx_v for joint in chosen]
    rigid, start = np.empty((samples.time.size, len(ids))), pin.neutral(model)
    for joint in ET.parse(path).getroot().findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") != "fixed":  # Pinocchio leaves it to move by itself
            start[model.joints[model.getJointId(joint.get("name", ""))].idx_q] = float(mimic.get("offset", 0.0))
    for name, position in (rest or {}).items():
        start[model.joints[model.getJointId(name)].idx_q] = position
    dq, ddq = np.zeros(model.nv), np.zeros(model.nv)
    for i in range(samples.time.size):
        q = start.copy()
        for joint, value in zip(chosen, samples.q[i], strict=True):
            values = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
            q[joint.idx_q : joint.idx_q + joint.nq] = values
        dq[v], ddq[v] = samples.dq[i], samples.ddq[i]
        rigid[i] = pin.rnea(model, data, q, dq, ddq)[v]
    coulomb = np.asarray(model.upperDryFrictionLimit)[v]
    friction = np.asarray(model.damping)[v] * samples.dq + coulomb * np.sign(samples.dq)
    return Reloaded(rigid, friction)


@dataclass(frozen=True, eq=False)
class Inverse(Reloaded):
    """Torques of some joints, with the instants at which all friction is outside of MuJoCo's stick zone.

    Parameters
    ----------
    outside : ndarray of bool, shape (N,)
    """

    outside: NDArray[np.bool_]


def by_mujoco(path: Path, joints: Sequence[str], samples: Samples, *, friction: bool = False) -> Inverse:
    """Torques of an MJCF by `mj_inverse`, with or without damping and friction loss; other joints at rest.

    An instant is outside of the stick zone where the force of every friction loss is at its bound, in the direction of
    the velocity: the soft constraint asks for ``a + b v``, b = 2 / (0.95 * 0.02 s) by default.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    for name in OFF:
        model.opt.disableflags |= getattr(mujoco.mjtDisableBit, name)
    if not friction:
        for name in ("dof_damping", "dof_frictionloss", "tendon_damping", "tendon_frictionloss"):
            getattr(model, name)[:] = 0.0
    data = mujoco.MjData(model)
    ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in joints]
    q, v = model.jnt_qposadr[ids], model.jnt_dofadr[ids]
    rigid, resisting = np.empty((2, samples.time.size, len(ids)))
    outside = np.zeros(samples.time.size, dtype=bool)
    for i in range(samples.time.size):
        data.qpos[q], data.qvel[v], data.qacc[v] = samples.q[i], samples.dq[i], samples.ddq[i]
        mujoco.mj_inverse(model, data)
        resisting[i] = -(data.qfrc_passive + data.qfrc_constraint)[v]
        rigid[i] = data.qfrc_inverse[v] - resisting[i]
        force, bound, speed = data.efc_force, data.efc_frictionloss, data.efc_vel
        moving = speed != 0.0
        outside[i] = friction and np.array_equal(force[moving], (-np.sign(speed) * bound)[moving])
    return Inverse(rigid, resisting, outside)


def words(values: Any) -> str:
    """Numbers as text that reads back to the same numbers."""
    return " ".join(repr(float(value)) for value in np.ravel(values))


def place(rotation: np.ndarray, translation: np.ndarray) -> str:
    """Attributes ``pos`` and ``quat`` of a body."""
    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return f'pos="{words(translation)}" quat="{words([w, x, y, z])}"'


def chain_xml(reference: Reference) -> str:
    """MJCF of a chain; its joints have the names of the chain's, their bodies the same with ``_body``."""
    import pinocchio as pin

    model = reference.model
    to_base = pin.SE3(np.linalg.inv(reference.base_pose()))
    opened = []
    for k, name in enumerate(reference.joints, 1):
        inertia, placement = model.inertias[k], to_base * model.jointPlacements[k]
        to_base = pin.SE3.Identity()
        data = model.joints[k].createData()
        model.joints[k].calc(data, pin.neutral(model)[model.joints[k].idx_q :][: model.joints[k].nq])
        slide, axis = (bool(np.any(data.S[:3])), np.ravel(data.S[:3]) + np.ravel(data.S[3:]))
        I, c = inertia.inertia, inertia.lever
        full = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
        opened.append(
            f'<body name="{name}_body" {place(placement.rotation, placement.translation)}>'
            f'<inertial pos="{words(c)}" mass="{inertia.mass!r}" fullinertia="{words(full)}"/>'
            f'<joint name="{name}" type="{"slide" if slide else "hinge"}" axis="{words(axis)}"/>'
        )
    gravity = words(reference.base_pose()[:3, :3].T @ model.gravity.linear)
    bodies = "".join(opened) + "</body>" * len(opened)
    option = f'<compiler angle="radian" balanceinertia="true"/><option gravity="{gravity}"/>'
    return f'<mujoco model="chain">{option}<worldbody>{bodies}</worldbody></mujoco>'


def inverse_dynamics(model: Any, joints: tuple[str, ...], q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """MuJoCo's torques of some joints, the others at rest at zero, shapes (N, n)."""
    import mujoco

    data, torques = mujoco.MjData(model), []
    numbers = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in joints]
    positions, dofs = model.jnt_qposadr[numbers], model.jnt_dofadr[numbers]
    hinges = np.isin(model.jnt_type, [int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)])
    for state in zip(q, dq, ddq, strict=True):
        mujoco.mj_resetData(model, data)
        data.qpos[model.jnt_qposadr[hinges]] = 0.0
        data.qpos[positions], data.qvel[dofs], data.qacc[dofs] = state
        mujoco.mj_inverse(model, data)
        torques.append(data.qfrc_inverse[dofs])
    return np.array(torques)
