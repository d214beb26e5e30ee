"""Planar linkages as MJCF, played by MuJoCo, and the closed form of a four-bar."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
from written_files import text_file

from regressors.readers.library import load_robot
from regressors.robot.robot import Robot
from regressors.samples import Array

# lengths of crank, coupler, rocker and ground [m]: Grashof's crank turns all round
FOUR_BAR = (0.12, 0.35, 0.25, 0.4)
PARALLELOGRAM = (0.25, 0.3, 0.25, 0.3)
START = np.deg2rad(60.0)  # of the crank where the file puts it
STEP = 0.0002  # of MuJoCo [s]

_MJCF = """<mujoco model="{name}"><compiler angle="radian"/>
<option timestep="0.0002" integrator="implicitfast" gravity="0 0 -9.81"/>
<default><equality solref="0.0004 1" solimp="0.9999 0.9999 0.001"/></default>
<worldbody>
<body name="crank" euler="0 {crank} 0"><joint name="q1" axis="0 -1 0" armature="0.01" {limits}/>
<inertial pos="{a2} 0 0.01" mass="1.5" diaginertia="0.002 0.006 0.006"/>
<body name="coupler" pos="{a} 0 0" euler="0 {coupler} 0"><joint name="q2" axis="0 -1 0" {passive}/>
<inertial pos="{b2} 0 0.02" mass="1.1" diaginertia="0.001 0.014 0.014"/></body></body>
<body name="rocker" pos="{d} 0 0" euler="0 {rocker} 0"><joint name="q3" axis="0 -1 0" {passive}/>
<inertial pos="{c2} 0 -0.015" mass="0.9" diaginertia="0.001 0.007 0.007"/></body>
</worldbody>
<equality><connect body1="coupler" body2="rocker" anchor="{b} 0 0"/></equality>
<actuator><motor joint="q1"/></actuator></mujoco>"""


def closed_form(lengths: tuple[float, ...], crank: Array) -> tuple[Array, Array]:
    """Absolute angles of coupler and rocker of a four-bar at angles of its crank, by circles that intersect."""
    a, b, c, d = lengths
    x, y = d - a * np.cos(crank), -a * np.sin(crank)  # from the crank's end to the rocker's pivot
    s = np.hypot(x, y)
    coupler = np.arctan2(y, x) + np.arccos((b**2 + s**2 - c**2) / (2 * b * s))
    end = a * np.exp(1j * crank) + b * np.exp(1j * coupler) - d
    return coupler, np.angle(end)


def joint_angles(lengths: tuple[float, ...], q1: Array) -> Array:
    """Angles of all three joints, zero where the file puts them, by the closed form, shape (N, 3)."""
    at, start = closed_form(lengths, START + q1), closed_form(lengths, np.array(START))
    turned = [np.unwrap(one - zero) for one, zero in zip(at, start, strict=True)]
    return np.column_stack([q1, turned[0] - q1, turned[1]])


def linkage(name: str, lengths: tuple[float, ...], *, friction: float = 0.0, limits: str = "") -> str:
    """MJCF of a linkage in the x-z plane, driven at its crank; friction of the passive joints is viscous [Nm s/rad]."""
    a, b, c, d = lengths
    coupler, rocker = (float(angle) for angle in closed_form(lengths, np.array(START)))
    words = {"crank": -START, "coupler": START - coupler, "rocker": -rocker, "limits": limits}
    passive = f'damping="{friction}"' if friction else ""
    halves = {"a2": 0.45 * a, "b2": 0.5 * b, "c2": 0.55 * c}
    return _MJCF.format(name=name, a=a, b=b, c=c, d=d, **halves, **words, passive=passive)


def robot_of_text(name: str, text: str) -> Robot:
    """The robot that a text in MJCF describes."""
    with TemporaryDirectory() as folder:
        return load_robot(text_file(Path(folder) / f"{name}.xml", text))


def played(
    lengths: tuple[float, ...],
    text: str,
    noise: float,
    seed: int,
    *,
    middle: float,
    swing: float,
    period: float = 4.0,
) -> dict[str, Array]:
    """What MuJoCo's linkage does while its crank follows a random motion: a log at 500 Hz with noisy torques.

    Beside it the torques of the closure at all joints, without noise.
    """
    rng, numbers, step = np.random.default_rng(seed), np.arange(1, 5), STEP
    w, phases = 2 * np.pi / period * numbers, rng.uniform(0, 2 * np.pi, 4)
    size = swing / np.sum(1.0 / numbers) / numbers
    angles = w * (np.arange(round(period / step) + 1) * step)[:, None] + phases
    wanted = middle + np.sin(angles) @ size, np.cos(angles) @ (size * w), -np.sin(angles) @ (size * w**2)
    return followed(lengths, text, noise, rng, *wanted)


def followed(
    lengths: tuple[float, ...], text: str, noise: float, rng: np.random.Generator, *wanted: Array
) -> dict[str, Array]:
    """The same of a given motion of the crank: positions, velocities and accelerations at MuJoCo's steps."""
    model, rows, step = mujoco.MjModel.from_xml_string(text), [], STEP
    data = mujoco.MjData(model)
    before = joint_angles(lengths, wanted[0][0] + np.array([-1e-6, 0.0, 1e-6]))
    data.qpos[:], data.qvel[:] = before[1], (before[2] - before[0]) / 2e-6 * wanted[1][0]
    for k, (q, dq, ddq) in enumerate(zip(*wanted, strict=True)):
        data.ctrl[0] = 60.0 * (q - data.qpos[0]) + 4.0 * (dq - data.qvel[0]) + 0.05 * ddq
        before = [k * step, *data.qpos, data.ctrl[0]]
        mujoco.mj_step(model, data)
        if k % 10 == 0:
            rows.append([*before, *data.qfrc_constraint])  # at the same instant
    table = np.array(rows)
    table[:, 4] += noise * rng.normal(size=len(table))
    names = ("time", "q1.position", "q2.position", "q3.position", "q1.effort", *(f"q{k}.closure" for k in (1, 2, 3)))
    return dict(zip(names, table.T, strict=True))
