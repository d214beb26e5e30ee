"""Simulated logs of four robots, and what spoils them: columns of the log are changed, by no code of the search."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

import excite
from excite.design.formulation import formulate
from excite.design.initial_guesses import random_motion
from excite.logs.log import Log
from excite.logs.log_reading import write_log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.tasks.installation import Installation
from excite.tasks.payload import installed
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.models.differential import DifferentialModel
from regressors.readers.library import load_robot
from regressors.robot.columns import BODY_KINDS
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import drives_with_friction
from regressors.robot.locked_joints import with_joint_rotors
from regressors.robot.robot import Robot
from regressors.samples import Samples

ROBOTS = ("irp6", "ur10e", "panda", "iiwa7")
COULOMB, VISCOUS, ROTOR = 0.02, 0.02, 0.002  # of the torque limit: Nm, Nm s/rad, kg m^2
CENTRES = 0.0  # standard deviation of each coordinate of the bodies' centres [m]
NOISE = 0.02  # of the root mean square of each joint's torque
MEMORY = 0.0  # of the noise [s]
STRIBECK, STRIBECK_SPEED = 0.0, 0.1  # of Coulomb friction, in no model; rad/s
KINDS = (
    "torques swapped", "torques shifted", "torque sign", "positions swapped", "position sign",
    "torque gain, 0.6 or 1.6",
    "torque gain, 1000", "magnitudes", "late", "channel late", "zero, 90 degrees", "zero, 5 degrees",
    "zero, 10 to 30 degrees", "clipped",
    "currents", "drive units", "gravity, tilted", "gravity, wall or ceiling", "moved base", "late from", "drift",
    "other lengths", "untold load", "clock jump", "lost rows", "stale rows", "repeated rows",
)  # fmt: skip
LOADS = {"irp6": 6.0, "ur10e": 10.0, "panda": 3.0, "iiwa7": 7.0}  # rated [kg]
LEVEL, DOWN = (0.0, 0.0, 0.0), np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class Spoilt:
    """A log and the fault that it has."""

    log: Log
    kind: str
    joints: tuple[str, ...]
    truth: tuple[float, ...] = ()  # factors on the torques; gravity in the axes of the base [m/s^2]


def true_robot(name: str, seed: int) -> Robot:
    """The built-in robot with friction and rotors, whose bodies differ from the description by up to 15 %."""
    robot, rng = load_robot(name), np.random.default_rng([seed, 1])
    links = tuple(
        replace(link, theta=_body(rng) if link.theta is None else link.theta * rng.uniform(0.85, 1.15))
        for link in robot.links
    )
    rng = np.random.default_rng([seed, 3])
    links = tuple(replace(link, theta=_moved(link.theta, rng.normal(0.0, CENTRES, 3))) for link in links)
    robot = robot.replace(links=links)
    if robot.transmission is not None:
        return robot
    geared = with_joint_rotors(robot)
    assert geared.transmission is not None
    drives = tuple(
        replace(drive, rotor_inertia=ROTOR * limit, coulomb=COULOMB * limit, viscous=VISCOUS * limit)
        for drive, limit in zip(geared.transmission.drives, robot.limits.torque.tolist(), strict=True)
    )
    return geared.replace(transmission=replace(geared.transmission, drives=drives))


def _moved(theta: np.ndarray, by: np.ndarray) -> np.ndarray:
    """A body whose centre is another one, with the same inertia about it."""
    m, c = theta[0], theta[1:4] / theta[0] if theta[0] > 0 else np.zeros(3)

    def about_origin(c: np.ndarray) -> np.ndarray:
        return m * ((c @ c) * np.eye(3) - np.outer(c, c))[np.triu_indices(3)]

    inertia = theta[4:] + (about_origin(c + by) - about_origin(c) if np.any(by) else 0.0)
    return np.array([m, *(theta[1:4] + m * by), *inertia])


def _body(rng: np.random.Generator) -> np.ndarray:
    """A body where the description states none: 2 to 4 kg about a point up to 10 cm off."""
    m, c = rng.uniform(2.0, 4.0), rng.uniform(-0.1, 0.1, 3)
    inertia = m * (0.06**2 * np.eye(3) + (c @ c) * np.eye(3) - np.outer(c, c))
    return np.array([m, *(m * c), *inertia[np.triu_indices(3)]])


def mount(kind: str, rng: np.random.Generator) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a base that is mounted otherwise than described."""
    if kind == "gravity, tilted":
        tilt, towards = np.deg2rad(rng.uniform(15.0, 60.0)), rng.uniform(0.0, 2 * np.pi)
        return float(tilt * np.cos(towards)), float(tilt * np.sin(towards)), 0.0
    return [(0.0, np.pi / 2, 0.0), (-np.pi / 2, 0.0, 0.0), (np.pi, 0.0, 0.0)][int(rng.integers(3))]


def load(name: str, rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Mass of a load and its centre in the frame of the last link [kg, m]."""
    x, y, z = rng.uniform(-0.08, 0.08, 3).tolist()
    return LOADS[name] * float(rng.uniform(0.3, 0.8)), x, y, z


def relative(robot: Robot, rng: np.random.Generator) -> Robot:
    """Another robot of the family, whose arms are shorter or longer, and lighter or heavier: a UR5e has 0.6 and 0.7."""
    scale = float(rng.choice([rng.uniform(0.6, 0.8), rng.uniform(1.25, 1.6)]))
    joints = tuple(replace(j, translation=j.translation * scale * rng.uniform(0.9, 1.1)) for j in robot.joints)
    powers = scale ** np.array([2, 3, 3, 3, 4, 4, 4, 4, 4, 4])
    links = tuple(replace(k, theta=None if k.theta is None else k.theta * powers) for k in robot.links)
    return robot.replace(joints=joints, links=links, shapes=())


def gravity_torque(robot: Robot, q: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Torques that hold the robot, shape (N, n)."""
    model = DifferentialModel(robot.replace(gravity=gravity))
    still = Samples(np.arange(len(q), dtype=float), q, *np.zeros((3, *q.shape)))
    theta = np.concatenate([link.theta for link in robot.links])
    Y = model.instants(still)[:, [c.kind in BODY_KINDS for c in model.columns]]
    return (Y @ theta).reshape(q.shape)


def friction_torque(robot: Robot, log: Log, real: bool) -> np.ndarray:
    """Friction in the equation of each joint, shape (N, n); of a real robot, as identified from the log."""
    q, n = log.q, log.q.shape[1]
    if real:
        result = excite.identify(robot, log, choose=False)
        found = dict(zip(result.names, result.estimate.coefficients.tolist(), strict=True))
        dq = np.gradient(q, log.time, axis=0)
        return np.column_stack(
            [found[f"F{k + 1}c"] * np.sign(dq[:, k]) + found[f"F{k + 1}v"] * dq[:, k] for k in range(n)]
        )
    dq, curves = np.gradient(q, log.duration / (log.count - 1), axis=0), FrictionCurves.of_robot(robot)
    rows = ((name, row[:n]) for name, row in drives_with_friction(robot))  # joints that the log lacks rest
    return sum(curves.curve(name).torque(dq @ row)[:, None] * row for name, row in rows)


def stribeck_torque(robot: Robot, log: Log) -> np.ndarray:
    """What friction has more at low speeds, shape (N, n)."""
    dq, torque = np.gradient(log.q, log.duration / (log.count - 1), axis=0), np.zeros(log.q.shape)
    for name, row in drives_with_friction(robot):
        row, curve = row[: dq.shape[1]], FrictionCurves.of_robot(robot).curve(name)
        coulomb, v = float(curve.torque(np.array([1e-6]))[0]), dq @ row
        torque += STRIBECK * coulomb * (np.exp(-((v / STRIBECK_SPEED) ** 2)) * np.sign(v))[:, None] * row
    return torque


@cache
def clean_log(
    name: str, seed: int, mounted: tuple[float, float, float] = LEVEL, payload: tuple[float, ...] | None = None
) -> Log:
    """A random Fourier motion of 10 s within the limits, at 200 Hz, with noise of 2 % of each torque."""
    robot = installed(true_robot(name, seed), Installation(mount=mounted, payload=payload))
    task = Task(name, harmonics=5, period=10.0)
    problem = formulate(load_robot(name), task).problem
    x = random_motion(problem, np.random.default_rng(seed))
    settings = SimulationSettings(rate=200.0, seed=seed, position_step=(1e-5,))
    found = simulate_motion(
        robot, task, Trajectory(problem.family, x), settings, friction=FrictionCurves.of_robot(robot)
    )
    rng = np.random.default_rng([seed, 2])
    effort = found.log.effort + stribeck_torque(robot, found.log)
    size = np.sqrt(np.mean(effort**2, axis=0))
    kept = np.exp(-1 / (200.0 * MEMORY)) if MEMORY else 0.0
    noise = lfilter([np.sqrt(1 - kept**2)], [1.0, -kept], rng.standard_normal(effort.shape), axis=0)
    effort = effort + NOISE * size * noise
    label = f"{name} {seed}"
    return replace(found.log, dq=None, effort=effort, truth=None, saturated=(), source=label, sha256=label)


def _columns(x: np.ndarray, order: list[int]) -> np.ndarray:
    return np.ascontiguousarray(x[:, order])


def changed_from(log: Log, kind: str, rng: np.random.Generator, robot: str, seed: int, real: bool) -> Spoilt:
    """The log of a robot with a fault that begins at some time, or grows."""
    k, step = round(rng.uniform(0.3, 0.7) * log.count), log.duration / (log.count - 1)
    after, time, q, y = np.arange(log.count) >= k, log.time.copy(), log.q.copy(), log.effort.copy()
    truth: tuple[float, ...] = (float(time[k]),)
    match kind:
        case "moved base":
            tilt, towards = np.deg2rad(rng.uniform(10.0, 30.0)), rng.uniform(0.0, 2 * np.pi)
            mounted = (float(tilt * np.cos(towards)), float(tilt * np.sin(towards)), 0.0)
            gravity = installed(load_robot(robot), Installation(mount=mounted)).gravity
            if real:
                change = gravity_torque(load_robot(robot), q, gravity) - gravity_torque(load_robot(robot), q, DOWN)
            else:
                change = clean_log(robot, seed, mounted).effort - y
            y, truth = y + after[:, None] * change, (*truth, *gravity.tolist())
        case "late from":
            rows = round(rng.uniform(0.02, 0.08) / step) * int(rng.choice([-1, 1]))
            late = np.clip(np.arange(log.count) - rows * after, 0, log.count - 1)
            y = y[late]
        case "drift":
            falls = rng.uniform(0.3, 0.5, y.shape[1])
            own = load_robot(robot) if real else true_robot(robot, seed)
            y -= falls * np.linspace(0.0, 1.0, log.count)[:, None] * friction_torque(own, log, real)
            truth = tuple(falls.tolist())
        case "clock jump":
            time[k:] += rng.uniform(0.2, 1.0)
        case "lost rows":
            kept = np.delete(np.arange(log.count), np.arange(k, k + round(rng.uniform(0.03, 0.2) / step)))
            time, q, y = time[: kept.size], q[kept], y[kept]
        case "stale rows":
            held = np.arange(log.count)
            for start in rng.integers(50, log.count - 50, 8).tolist():
                held[start : start + int(rng.integers(3, 20))] = start
            q, y = q[held], y[held]
    label = f"{log.source} {kind}"
    log = replace(log, time=time, q=q, dq=None, effort=y, numbers=None, removed=(), source=label, sha256=label)
    return Spoilt(log, kind, (), truth)


def with_repeated_rows(log: Log, rng: np.random.Generator, folder: Path) -> Path:
    """File of the log in which some rows are written twice."""
    path = folder / "repeated.csv"
    write_log(log, path)
    head, *rows = path.read_text().splitlines()
    twice = rng.random(len(rows)) < 0.02
    lines = [line for row, again in zip(rows, twice, strict=True) for line in [row] * (1 + int(again))]
    path.write_text("\n".join([head, *lines]) + "\n")
    return path


def spoilt(log: Log, kind: str, rng: np.random.Generator, joint: int | None = None) -> Spoilt:
    """The log with a fault of some joint."""
    n = len(log.joints)
    a = int(rng.integers(n)) if joint is None else joint
    b = int((a + 1 + rng.integers(n - 1)) % n)
    names, q, y = (log.joints[a],), log.q.copy(), log.effort.copy()
    dq = None if log.dq is None else log.dq.copy()
    swap = list(range(n))
    swap[a], swap[b] = b, a
    pair = (log.joints[min(a, b)], log.joints[max(a, b)])
    step, factors = log.duration / (log.count - 1), np.ones(n)
    match kind:
        case "torques swapped":
            y, names = _columns(y, swap), pair
        case "torques shifted":
            y, names = np.roll(y, 1, axis=1), log.joints
        case "torque sign":
            y[:, a] *= -1
        case "positions swapped":
            q, dq, names = _columns(q, swap), None if dq is None else _columns(dq, swap), pair
        case "position sign":
            q[:, a] *= -1
            if dq is not None:
                dq[:, a] *= -1
        case "torque gain, 0.6 or 1.6":
            y[:, a] *= rng.choice([0.6, 1.6])
        case "torque gain, 1000":
            y[:, a] *= rng.choice([1000.0, 0.001])
        case "magnitudes":
            y, names = np.abs(y), log.joints
        case "late":
            rows = round(rng.uniform(0.005, 0.04) / step)
            y, names = np.vstack([np.repeat(y[:1], rows, axis=0), y[: len(y) - rows]]), log.joints
        case "channel late":
            rows = round(0.1 / step)
            y[:, a] = np.concatenate([np.repeat(y[0, a], rows), y[: len(y) - rows, a]])
        case "zero, 90 degrees":
            q[:, a] += rng.choice([-1, 1]) * np.pi / 2
        case "zero, 5 degrees":
            q[:, a] += rng.choice([-1, 1]) * np.deg2rad(5.0)
        case "zero, 10 to 30 degrees":
            q[:, a] += rng.choice([-1, 1]) * np.deg2rad(rng.uniform(10.0, 30.0))
        case "clipped":
            level = 0.6 * np.abs(y[:, a]).max()
            y[:, a] = np.clip(y[:, a], -level, level)
        case "currents":
            factors = np.exp(rng.uniform(np.log(0.05), np.log(0.5), n))
            y, names = y * factors, log.joints
        case "drive units":  # about 100 at the largest torque
            factors = 100.0 / np.abs(y).max(axis=0) * np.exp(rng.uniform(-0.5, 0.5, n))
            y, names = y * factors, log.joints
        case "clean":
            names = ()
    label = f"{log.source} {kind} {a}"
    log = replace(log, q=q, dq=dq, effort=y, source=label, sha256=label)
    return Spoilt(log, kind.split(",")[0], names, tuple(factors.tolist()))
