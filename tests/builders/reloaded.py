"""Inverse dynamics of exported files by the programs that load them: Pinocchio and MuJoCo."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
