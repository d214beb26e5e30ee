"""MJCF of the chains of public robots, written from Pinocchio's models with every digit, and MuJoCo's torques."""

from __future__ import annotations

from typing import Any

import numpy as np
from public_arms import Reference
from scipy.spatial.transform import Rotation


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
