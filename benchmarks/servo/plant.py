"""Position-controlled servos in MuJoCo: logs of commands and measured positions, with a known truth."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from excite.logs.log import Log
from regressors.samples import Array

STEP = 0.00025  # of the simulation [s]
RATE = 50.0  # of the log [Hz]
ENCODER = 2 * np.pi / 4096  # its step [rad]


@dataclass(frozen=True)
class Truth:
    """Parameters of each servo, shape (n,)."""

    K: Array  # kp [Nm/rad]
    D: Array  # damping of the joint [Nm s/rad]
    J: Array  # armature [kg m^2]
    Fc: Array  # frictionloss [Nm]
    L: Array  # forcerange [Nm]
    b: Array  # of the encoder's zero [rad]
    d: float  # delay of the commands [s]


def random_truth(rng: np.random.Generator, n: int) -> Truth:
    """Servos as desktop arms have them."""

    def spread(middle: float) -> Array:
        return np.asarray(middle * np.exp(rng.uniform(-0.4, 0.4, n)))

    K = spread(15.0)
    offset = rng.uniform(-0.01, 0.01, n)
    return Truth(K, K * spread(0.04), spread(0.01), spread(0.1), spread(2.0), offset, float(rng.uniform(0.005, 0.04)))


def plant(urdf: Path, joints: tuple[str, ...], truth: Truth, held: tuple[float, ...] = ()) -> mujoco.MjModel:
    """The arm of a URDF with these servos, without contacts; held is a mass [kg] and its place in the last link [m]."""
    text = re.sub(r"<(visual|collision)>.*?</\1>", "", urdf.read_text(), flags=re.S)
    spec = mujoco.MjSpec.from_string(text)
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for k, name in enumerate(joints):
        joint = spec.joint(name)
        joint.limited, joint.actfrclimited = 0, 0
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_position(kp=truth.K[k])
        actuator.forcelimited, actuator.forcerange = 1, [-truth.L[k], truth.L[k]]
        sensor = spec.add_sensor(name=name, type=mujoco.mjtSensor.mjSENS_JOINTPOS)
        sensor.objtype, sensor.objname = mujoco.mjtObj.mjOBJ_JOINT, name
    if held:
        body = next(body for body in spec.bodies if any(joint.name == joints[-1] for joint in body.joints))
        body.add_body(mass=held[0], ipos=held[1:], inertia=[1e-9] * 3, explicitinertial=1)
    model = spec.compile()
    place = [model.joint(name).dofadr[0] for name in joints]
    model.dof_armature[place], model.dof_frictionloss[place], model.dof_damping[place] = truth.J, truth.Fc, truth.D
    model.dof_solref[place] = [2 * STEP, 1.0]  # friction as stiff as the step allows, so that it hardly creeps
    model.dof_solimp[place, :2] = 0.9999
    return model


def play(
    model: mujoco.MjModel,
    joints: tuple[str, ...],
    truth: Truth,
    command: Array,
    source: str,
    rate: float = RATE,
    encoder: float = ENCODER,
) -> Log:
    """What is measured while commands (N, n) are played, each held until the next, after two seconds at rest."""
    data = mujoco.MjData(model)
    place, dof = ([getattr(model.joint(name), adr)[0] for name in joints] for adr in ("qposadr", "dofadr"))
    each, late, before = round(1 / rate / STEP), round(truth.d / STEP), round(2.0 / STEP)
    data.qpos[place] = command[0]
    rows, effort = np.empty_like(command), np.zeros_like(command)  # torques are averaged about each row
    for k in range(-before, len(command) * each):
        if k >= 0 and k % each == 0:
            rows[k // each] = data.qpos[place]
        data.ctrl[:] = command[max(0, (k - late) // each)]
        mujoco.mj_step(model, data)
        about = (k + each // 2) // each
        if 0 <= about < len(command):
            effort[about] += (data.qfrc_actuator + data.qfrc_damper)[dof] / each
    measured = encoder * np.round((rows + truth.b) / encoder)
    return Log(source, "", joints, np.arange(len(command)) / rate, measured, effort=effort, command=command)


def replay(model: mujoco.MjModel, log: Log, speed: Array) -> Array:
    """Positions (N, n) of an arm with its servos under the commands of a log, from its first row on."""
    data, step, command = mujoco.MjData(model), model.opt.timestep, log.command
    assert command is not None
    joints = [model.joint(name) for name in log.joints]
    place, actuators = [joint.qposadr[0] for joint in joints], [_actuator_of(model, joint.id) for joint in joints]
    data.qpos[place], data.qvel[[joint.dofadr[0] for joint in joints]] = log.q[0], speed
    for k, actuator in enumerate(actuators):  # what was commanded before
        if count := model.actuator_history[actuator, 0]:
            times, commands = step * (np.arange(count) - count), np.full(count, command[0, k])
            mujoco.mj_initCtrlHistory(model, data, actuator, times, commands)
    path, ends = np.empty_like(command), np.round((log.time - log.time[0]) / step).astype(int)
    for row, each in enumerate(np.diff(ends, append=ends[-1])):
        path[row], data.ctrl[actuators] = data.qpos[place], command[row]
        mujoco.mj_step(model, data, each)
    return path


def _actuator_of(model: mujoco.MjModel, joint: int) -> int:
    return int(np.flatnonzero(model.actuator_trnid[:, 0] == joint)[0])


def motion(rng: np.random.Generator, n: int, duration: float, middle: Array) -> Array:
    """Commands: sums of sines, then transitions of 0.3 to 0.8 s between poses that are held, shape (N, n) [rad]."""
    time = np.arange(round(duration * RATE)) / RATE
    half = time.size // 2
    frequency = rng.uniform(0.1, 1.2, (4, n))
    phase, size = rng.uniform(0, 2 * np.pi, (4, n)), rng.dirichlet(np.ones(4), n).T * 0.6
    waves = (size[:, None] * np.sin(2 * np.pi * frequency[:, None] * time[:half, None] + phase[:, None])).sum(axis=0)
    poses = _poses(rng, n, time.size - half, waves[-1], (0.3, 1.5))
    return np.asarray(middle + np.concatenate([waves, poses]))


def resting(
    rng: np.random.Generator, n: int, duration: float, middle: Array, rest: tuple[float, float] = (1.0, 4.0)
) -> Array:
    """Commands: steps and transitions of up to 0.8 s between poses that are held for some time, shape (N, n) [rad]."""
    return np.asarray(middle + _poses(rng, n, round(duration * RATE), np.zeros(n), rest, fastest=0.02))


def _poses(
    rng: np.random.Generator, n: int, size: int, pose: Array, rest: tuple[float, float], fastest: float = 0.3
) -> Array:
    rows: list[Array] = []
    while sum(map(len, rows)) < size:
        count, held = round(rng.uniform(fastest, 0.8) * RATE), round(rng.uniform(*rest) * RATE)
        share = np.linspace(0.0, 1.0, count + 1)[1:, None]
        goal = rng.uniform(-0.6, 0.6, n)
        rows.append(pose + (goal - pose) * (10 * share**3 - 15 * share**4 + 6 * share**5))
        rows.append(np.repeat(goal[None], held, axis=0))
        pose = goal
    return np.concatenate(rows)[:size]
