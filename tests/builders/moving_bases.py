"""Robots whose base moves, hung on a spring or falling freely, played by MuJoCo with noise on every channel."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from excite.logs.mapping import LogMapping
from regressors.samples import Array

STEP, EVERY = 0.001, 4  # of the simulation [s], and how many of its steps are one row
IMU, HOOK = np.array([0.03, -0.02, 0.04]), np.array([0.05, 0.02, 0.1])  # in the frame of the base [m]
POSE, GYRO, FORCE, ENCODER = 2e-4, 2e-3, 0.02, 2e-5  # deviations of noise [m, -; rad/s; m/s^2; rad]
GYRO_BIAS, FORCE_BIAS = 0.01, 0.05
TORQUE, WRENCH = 0.02, 0.005  # of the root mean square of each torque, of force and moment
_HEADS = (("p", "xyz"), ("q", "xyzw"), ("g", "xyz"), ("a", "xyz"), ("f", "xyz"), ("n", "xyz"))
_FORGOTTEN = re.compile(r"<visual>.*?</visual>|<collision>.*?</collision>|<mujoco>.*?</mujoco>", re.DOTALL)
_COMPILER = '<mujoco><compiler fusestatic="false" discardvisual="true" balanceinertia="false"/></mujoco></robot>'


def free_model(urdf: Path) -> Any:
    """MuJoCo's model of a URDF whose root link moves freely."""
    text = _FORGOTTEN.sub("", urdf.read_text(encoding="utf-8")).replace("</robot>", _COMPILER)
    spec = mujoco.MjSpec.from_string(text)
    spec.worldbody.first_body().add_freejoint()
    model = spec.compile()
    model.opt.timestep, model.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    model.dof_damping[:], model.dof_frictionloss[:] = 0.0, 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    return model


def played(urdf: Path, *, hung: bool, seed: int, seconds: float = 10.0, noise: float = 1.0) -> dict[str, Array]:
    """Columns of a log at 250 Hz while the drives follow a random motion, the base hung on a spring or falling."""
    model, rng = free_model(urdf), np.random.default_rng(seed)
    data, n, before = mujoco.MjData(model), model.nv - 6, round(1.0 / STEP)
    middle = np.where(model.jnt_limited[1:] == 1, model.jnt_range[1:].mean(axis=1), 0.0)
    data.qpos[7:] = middle
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    inertia, mass = np.diag(M), float(model.body_subtreemass[1])
    frequency = 2 * np.pi * np.array([0.3, 0.7, 1.3, 2.1, 3.1])
    share, phase = 0.6 * rng.dirichlet(np.full(5, 2.0), n), rng.uniform(0, 2 * np.pi, (n, 5))
    sway, start = 2 * np.pi * rng.uniform(0.3, 0.8, 6), rng.uniform(0, 2 * np.pi, 6)
    wrench, torque = np.zeros(6), np.zeros(n)

    def act(_: Any, now: Any) -> None:
        fade = min(1.0, now.time)
        wanted = middle + fade * np.sum(share * np.sin(frequency * now.time + phase), axis=1)
        torque[:] = inertia[6:] * (1600.0 * (wanted - now.qpos[7:]) - 80.0 * now.qvel[6:])
        R = Rotation.from_quat(now.qpos[[4, 5, 6, 3]])
        if hung:
            wrench[:] = _spring(now, R, mass, inertia[3:6], fade * np.sin(sway * now.time + start))
        F, N = wrench[:3], wrench[3:]
        now.qfrc_applied[:] = np.concatenate([R.apply(F), N + np.cross(HOOK, F), torque])

    rows: list[Array] = []
    mujoco.set_mjcb_control(act)
    try:
        for k in range(round((1.0 + seconds) / STEP) + 1):
            if k >= before and (k - before) % EVERY == 0:
                mujoco.mj_forward(model, data)
                R, omega, domega = Rotation.from_quat(data.qpos[[4, 5, 6, 3]]), data.qvel[3:6], data.qacc[3:6]
                f = R.inv().apply(data.qacc[:3] - model.opt.gravity)
                f = f + np.cross(domega, IMU) + np.cross(omega, np.cross(omega, IMU))
                pose = (data.qpos[:3], data.qpos[[4, 5, 6, 3]], omega, f, wrench)
                rows.append(np.concatenate([[data.time - 1.0], *pose, data.qpos[7:], torque]))
            mujoco.mj_step(model, data)
    finally:
        mujoco.set_mjcb_control(None)
    return _columns(model, np.array(rows), noise, rng)


def _spring(data: Any, R: Rotation, mass: float, inertia: Array, sway: Array) -> Array:
    """Force and moment at the hook, in the axes of the base."""
    place, speed = data.qpos[:3] + R.apply(HOOK), data.qvel[:3] + R.apply(np.cross(data.qvel[3:6], HOOK))
    force = mass * (20.0 * (HOOK + 0.08 * sway[:3] - place) - 3.0 * speed + np.array([0.0, 0.0, 9.81]))
    moment = inertia * (40.0 * (0.4 * sway[3:] - R.as_rotvec()) - 4.0 * data.qvel[3:6])
    return np.concatenate([R.inv().apply(force), moment])


def _columns(model: Any, rows: Array, noise: float, rng: np.random.Generator) -> dict[str, Array]:
    names = [model.joint(k).name for k in range(1, model.njnt)]
    n = len(names)
    size = np.repeat(np.sqrt((rows[:, 14:20] ** 2).reshape(-1, 2, 3).sum(axis=2).mean(axis=0)), 3)
    of_torque = np.sqrt(np.mean(rows[:, 20 + n :] ** 2, axis=0))
    parts = (np.full(7, POSE), np.full(3, GYRO), np.full(3, FORCE), WRENCH * size, np.full(n, ENCODER))
    deviation = np.concatenate([[0.0], *parts, TORQUE * of_torque])
    bias = np.zeros(rows.shape[1])
    bias[8:14] = np.repeat([GYRO_BIAS, FORCE_BIAS], 3) * rng.normal(size=6)
    measured = rows + noise * (deviation * rng.normal(size=rows.shape) + bias)
    heads = ["t", *(f"{head}{axis}" for head, axes in _HEADS for axis in axes)]
    heads += [f"{name}.position" for name in names] + [f"{name}.effort" for name in names]
    return dict(zip(heads, measured.T, strict=True))


def mapping(
    log: dict[str, Array], *, wrench: bool = True, imu: bool = True, torques: bool = True, free: bool = False
) -> LogMapping:
    """Mapping of these columns."""
    names = [head.removesuffix(".position") for head in log if head.endswith(".position")]
    base: dict[str, Any] = {
        "position": {"columns": ["px", "py", "pz"], "unit": ["m"]},
        "quaternion": {"columns": ["qx", "qy", "qz", "qw"]},
    }
    if imu:
        base["angular_velocity"] = {"columns": ["gx", "gy", "gz"], "unit": ["rad/s"]}
        base["specific_force"] = {"columns": ["ax", "ay", "az"], "unit": ["m/s^2"], "xyz": IMU.tolist()}
    if free:
        base["free"] = True
    elif wrench:
        base["wrench"] = {"columns": ["fx", "fy", "fz", "nx", "ny", "nz"], "unit": ["N"], "xyz": HOOK.tolist()}
    content: dict[str, Any] = {"joints": names, "time": {"column": "t"}, "base": base}
    content["position"] = {"columns": [f"{name}.position" for name in names], "unit": ["rad"]}
    if torques:
        content["effort"] = {"columns": [f"{name}.effort" for name in names], "unit": ["Nm"]}
    return LogMapping.model_validate(content)
