"""A delta robot, and a quadruped on four ideal feet, as MJCF, played by MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from regressors.samples import Array

_HEAD = """<mujoco model="{name}"><compiler angle="radian"/>
<option timestep="{step}" integrator="implicitfast" gravity="0 0 -9.81"><flag contact="disable"/></option>
<default><equality solref="{soft} 1" solimp="0.9999 0.9999 0.001"/></default><worldbody>"""

BASE, ARM, ROD, PLATFORM = 0.2, 0.3, 0.6, 0.05  # radius, lengths and radius of the delta [m]
_SLOPE = np.arccos((PLATFORM - BASE - ARM) / ROD)  # of the rods where the file puts them
_DELTA_ARM = """<body name="arm{k}" pos="{x} {y} 0" euler="0 0 {turn}">
<joint name="q{k}" axis="0 1 0" armature="0.02" range="-0.7 0.9"/>
<inertial pos="0.13 0 0.01" mass="0.8" diaginertia="0.001 0.008 0.008"/>
<body name="rod{k}" pos="{arm} 0 0" euler="0 {slope} 0">
<joint name="p{k}" axis="0 1 0"/><joint name="s{k}" axis="0 0 1"/>
<inertial pos="0.3 0 0" mass="0.3" diaginertia="0.0004 0.009 0.009"/></body></body>"""


def delta() -> str:
    """Three driven arms, whose rods carry a platform that slides and does not turn."""
    turns = 2 * np.pi / 3 * np.arange(3)
    places = zip((1, 2, 3), BASE * np.cos(turns), BASE * np.sin(turns), turns, strict=True)
    arms = "".join(_DELTA_ARM.format(k=k, x=x, y=y, turn=turn, arm=ARM, slope=_SLOPE) for k, x, y, turn in places)
    slides = "".join(f'<joint name="{axis}" type="slide" axis="{line}"/>' for axis, line in _LINES)
    drives = "".join(f'<motor joint="q{k}"/>' for k in (1, 2, 3))
    held = "".join(f'<connect body1="rod{k}" body2="platform" anchor="{ROD} 0 0"/>' for k in (1, 2, 3))
    return (
        f"{_HEAD.format(name='delta', step=0.0002, soft=0.0004)}{arms}"
        f'<body name="platform" pos="0 0 {-ROD * np.sin(_SLOPE)}">{slides}<inertial pos="0 0 0" mass="0.6" '
        f'diaginertia="0.001 0.001 0.002"/></body></worldbody><equality>{held}</equality>'
        f"<actuator>{drives}</actuator></mujoco>"
    )


_LINES = (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"))
HIPS = {"fl": (0.19, 0.05), "fr": (0.19, -0.05), "rl": (-0.19, 0.05), "rr": (-0.19, -0.05)}  # on the trunk [m]
THIGH, CALF, BENT = 0.21, 0.22, 0.9  # lengths [m], and how far the file bends the legs
HEIGHT, AHEAD = (THIGH + CALF) * np.cos(BENT), (CALF - THIGH) * np.sin(BENT)  # of the trunk; of the feet to the hips
LEGS = tuple(f"{leg}{k}" for leg in HIPS for k in (1, 2, 3))
_LEG = """<body name="{leg}_hip" pos="{x} {y} 0"><joint name="{leg}1" axis="1 0 0" armature="0.004" range="-0.5 0.5"/>
<inertial pos="0.01 {out} 0" mass="0.7" diaginertia="0.0006 0.0008 0.0005"/>
<body name="{leg}_thigh" euler="0 {bent} 0"><joint name="{leg}2" axis="0 1 0" armature="0.004" range="-0.5 0.5"/>
<inertial pos="-0.005 {out} -0.04" mass="1.1" diaginertia="0.005 0.005 0.001"/>
<body name="{leg}_calf" pos="0 0 -{thigh}" euler="0 {knee} 0">
<joint name="{leg}3" axis="0 1 0" armature="0.006" range="-0.6 0.6"/>
<inertial pos="0.006 0 -0.11" mass="0.25" diaginertia="0.002 0.002 0.00004"/></body></body></body>"""


def quadruped() -> str:
    """A trunk that moves freely, on four legs of three drives each, whose feet stay where they stand."""
    legs = "".join(
        _LEG.format(leg=leg, x=x, y=y, out=0.2 * y, bent=BENT, knee=-2 * BENT, thigh=THIGH)
        for leg, (x, y) in HIPS.items()
    )
    feet = "".join(f'<connect body1="{leg}_calf" body2="world" anchor="0 0 -{CALF}"/>' for leg in HIPS)
    drives = "".join(f'<motor joint="{joint}"/>' for joint in LEGS)
    return (
        f"{_HEAD.format(name='quadruped', step=0.0005, soft=0.001)}"
        f'<body name="trunk" pos="0 0 {HEIGHT}"><freejoint/><inertial pos="0.02 0 0.005" mass="6.9" '
        f'diaginertia="0.025 0.1 0.11"/>{legs}</body></worldbody><equality>{feet}</equality>'
        f"<actuator>{drives}</actuator></mujoco>"
    )


_WAYS = (
    *((f"trunk_{axis}", "slide", line) for axis, line in _LINES),
    *((f"trunk_turn_{a}", "hinge", x) for a, x in _LINES[::-1]),
)
_FREE = "".join(f'<joint name="{name}" type="{kind}" axis="{axis}"/>' for name, kind, axis in _WAYS)


def _leg_angles(foot: Array) -> Array:
    """Angles of a leg, zero where the file puts it, with its foot at a point in the hip's axes, shape (N, 3)."""
    x, y, z = foot.T
    down = np.hypot(y, z)
    knee = np.arccos((x**2 + down**2 - THIGH**2 - CALF**2) / (2 * THIGH * CALF))
    thigh = np.arctan2(-x, down) + np.arctan2(CALF * np.sin(knee), THIGH + CALF * np.cos(knee))
    return np.column_stack([np.arctan2(y, -z), thigh - BENT, 2 * BENT - knee])


def _sines(time: Array, swing: Array, period: float, rng: np.random.Generator) -> Array:
    """Random motions of four sines each, shape (N, k)."""
    w, share = 2 * np.pi / period * np.arange(1, 5), rng.dirichlet(np.full(4, 2.0), swing.size)
    phases = rng.uniform(0, 2 * np.pi, (swing.size, 4))
    waves = (np.sin(np.outer(time, w) + phase) @ part for phase, part in zip(phases, share, strict=True))
    return np.column_stack(list(waves)) * swing


def _standing(time: Array, seed: int, period: float) -> Array:
    """Angles of all legs while the trunk sways, shape (N, 12)."""
    pose = _sines(time, np.array([0.05, 0.04, 0.04, 0.2, 0.2, 0.25]), period, np.random.default_rng(seed))
    turned = Rotation.from_euler("ZYX", pose[:, 3:]).inv()
    feet = (np.array([x + AHEAD, y, -HEIGHT]) - pose[:, :3] for x, y in HIPS.values())
    hips = (np.array([x, y, 0.0]) for x, y in HIPS.values())
    return np.hstack([_leg_angles(turned.apply(foot) - hip) for foot, hip in zip(feet, hips, strict=True)])


def played(name: str, noise: float, seed: int, *, period: float = 4.0) -> tuple[dict[str, Array], dict[str, Array]]:
    """A log at 500 Hz of what a mechanism does while its drives follow a random motion, with noisy torques [Nm].

    Beside it, without noise, positions of the joints that no drive moves and the torques of the closures at all joints.
    """
    text = delta() if name == "delta" else quadruped().replace("<freejoint/>", _FREE)
    model = mujoco.MjModel.from_xml_string(text)
    data, rng, step = mujoco.MjData(model), np.random.default_rng([seed, 1]), model.opt.timestep
    time = np.arange(-round(1.0 / step), round(period / step) + 1) * step
    fade = np.clip(time + 1.0, 0.0, 1.0)[:, None] ** 3  # from where the file puts it, before the log begins
    if name == "delta":
        wanted, gains = (
            fade * _sines(time, np.array([0.5, 0.5, 0.5]), period, np.random.default_rng(seed)),
            (150.0, 6.0),
        )
    else:
        wanted, gains = _standing(time, seed, period), (400.0, 8.0)
    speed, driven, rows = np.gradient(wanted, step, axis=0), model.actuator_trnid[:, 0], list[list[float]]()
    for k, now in enumerate(time):
        data.ctrl[:] = gains[0] * (wanted[k] - data.qpos[driven]) + gains[1] * (speed[k] - data.qvel[driven])
        before = [now, *data.ctrl, *data.qpos]
        mujoco.mj_step(model, data)
        if now >= -0.5 * step and k % round(0.002 / step) == 0:
            rows.append([*before, *data.qfrc_constraint])  # at the same instant
    joints, table = [model.joint(k).name for k in range(model.njnt)], np.array(rows)
    drives = [joints[k] for k in driven]
    table[:, 1 : 1 + len(drives)] += noise * rng.normal(size=(len(table), len(drives)))
    whats = {"effort": drives, "position": joints, "closure": joints}
    columns = ("time", *(f"{joint}.{what}" for what, names in whats.items() for joint in names))
    everything = dict(zip(columns, table.T, strict=True))
    of_drives = {f"{joint}.{what}" for joint in drives for what in ("effort", "position")}
    return tuple(
        {name: x for name, x in everything.items() if (name in {"time", *of_drives}) == own} for own in (True, False)
    )
