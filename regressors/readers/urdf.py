"""Readers of URDF files: what moves of a tree of links, as a `Robot`; and of xacro, URDF written with macros.

Macros are expanded without ROS, in a process without rights.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from regressors import input_files
from regressors.errors import InputError, reading
from regressors.input_files import read_bytes
from regressors.quantities import Tips
from regressors.readers.description import range_of
from regressors.readers.health import health
from regressors.readers.moving_part import MovingPart, carried, kind_of, moving_part, resting_rotation
from regressors.readers.urdf_tree import TreeJoint, UrdfTree, parse_tree
from regressors.robot.closures import MimicJoint
from regressors.robot.inertia import Array, transport
from regressors.robot.robot import Drive, Joint, Limits, Link, Robot, Transmission

_GRAVITY = np.array([0.0, 0.0, -9.81])
_NOISE = 1e-12


def read_urdf(path: str | Path, *, base: str | None = None, tip: Tips = None, snap_angles: bool = True) -> Robot:
    """Read what moves between a base and one or several last links of a URDF file, as a `Robot`; see `parse_urdf`."""
    path = Path(path)
    return parse_urdf(urdf_content(path), name_of_source=path.name, base=base, tip=tip, snap_angles=snap_angles)


def urdf_content(path: Path) -> str | bytes:
    """Content of a URDF, which a file whose name ends in ``.xacro`` expands to."""
    if path.suffix.lower() == ".xacro":
        return expand_xacro(path)
    with reading(f"the URDF file {str(path)!r}"):
        return read_bytes(path)


def parse_urdf(
    text: str | bytes,
    *,
    name_of_source: str = "text",
    base: str | None = None,
    tip: Tips = None,
    snap_angles: bool = True,
) -> Robot:
    """Read what moves between a base and one or several last links of a URDF document, as a `Robot`.

    The joints from the base to each tip that are revolute, continuous or prismatic become the robot's joints, with the
    frames of URDF: a link's frame is the frame of the joint that moves it. One tip makes a chain, several a tree; where
    none is given, all limbs move, see `regressors.readers.moving_part`. Everything else stands still and no mass is
    lost:

    - Whatever hangs on a moving link by other joints (sensors, flanges, a gripper, the arm beyond the tip) is merged
      into it. These joints rest at position zero, whatever their limits say, and mimic joints where that puts them (at
      their offset). A mimic joint of one that moves moves too: it is a closure, and no drive acts on it.
    - The base, what else hangs on it and what is above it does not move: its mass is ignored. Joints above the base
      rest at zero as well, and gravity, 9.81 m/s^2 along -z of the root link, is expressed in the axes of the base.
    - A link with which no ``<inertial>`` was merged has unknown parameters (``theta`` is None).

    Limits: an effort or velocity of zero, or not stated, means no limit. If one of ``lower`` and ``upper`` is stated,
    the other is zero as URDF says. A joint with neither, or with both zero, has no position limits here and a note:
    no motion is designed for it until its range is given. Continuous joints have no position limits.
    URDF has no limits on acceleration and jerk. ``<safety_controller>`` is not read.

    Angles of ``rpy`` with four decimals or more that are a multiple of pi/4 or pi/6, rounded or cut off to these
    decimals, are taken for that multiple, see `regressors.readers.angles`: otherwise parallel axes would not be
    parallel, and the rounding would show parameters that are none.

    Tags and attributes that are misspelt are refused if they matter; others that are unknown are not read.

    Friction of ``<dynamics>`` becomes one drive per joint, if any of it is not zero.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # absurd sizes end as "must be finite"
        return robot_of_tree(parse_tree(text, name_of_source, snap_angles=snap_angles), base, tip)


def robot_of_tree(tree: UrdfTree, base: str | None, tip: Tips) -> Robot:
    """What moves of a tree of links, see `parse_urdf`."""
    part = moving_part(tree, base, tip)
    moving = part.moving
    joints, parents = _joints(part)
    mimics = ((joint.name, joint.mimic) for joint in moving)
    tied = tuple(MimicJoint((name, m.joint), m.multiplier, m.offset) for name, m in mimics if m is not None)
    try:
        return Robot(
            name=tree.name,
            joints=joints,
            links=tuple(Link(j.child, _merged_parameters(tree, j.child, part.moving_names)) for j in moving),
            limits=_limits(moving),
            transmission=_transmission(moving),
            gravity=_gravity(tree, part.base),
            source=f"URDF {tree.source}",
            parents=parents,
            closures=tied,
            passive=tuple(each.joints[0] for each in tied),
            notes=health(tree, part),
        )
    except InputError as error:
        message = " ".join(str(error).split())  # an array in it may have been printed on several lines
        raise InputError(f"{tree.source}: {message}; correct the file") from error


def _tidy(values: Array) -> Array:
    """Values without rounding noise about 0, 1 and -1, which would swell symbolic expressions."""
    nearest = np.clip(np.round(values), -1.0, 1.0)
    return np.where(np.abs(values - nearest) < _NOISE, nearest, values) + 0.0


def _joints(part: MovingPart) -> tuple[tuple[Joint, ...], tuple[int, ...]]:
    """The moving joints, with the poses of the fixed ones before them merged in, and their parents."""
    joints, parents = list[Joint](), list[int]()
    placed = {part.base: (0, np.eye(4))}  # the moving link that carries each link, and its pose in that one's frame
    for joint in part.path:
        carrier, above = placed[joint.parent]
        T = above @ joint.pose
        if joint.kind != "fixed":
            joints.append(Joint(joint.name, kind_of(joint), _tidy(T[:3, :3]), _tidy(T[:3, 3]), _tidy(joint.axis)))
            parents.append(carrier)
            carrier, T = len(joints), np.eye(4)
        placed[joint.child] = carrier, T
    return tuple(joints), tuple(parents)


def _merged_parameters(tree: UrdfTree, link: str, stop: set[str]) -> Array | None:
    """Parameters of a link and all that hangs on it up to the joints to stop at, about the link frame's origin."""
    total: Array | None = None
    for name, T in carried(tree, link, stop):
        theta = tree.links[name]
        if theta is not None:
            moved = transport(T[:3, :3], T[:3, 3]) @ theta if name != link else theta
            total = moved if total is None else total + moved
    return total


def _limits(joints: Sequence[TreeJoint]) -> Limits:
    unlimited = np.full(len(joints), np.inf)
    lower, upper = zip(*(range_of(joint) for joint in joints), strict=True)
    velocity, effort = ([joint.bounds.get(key) or np.inf for joint in joints] for key in ("velocity", "effort"))
    return Limits(np.array(lower), np.array(upper), np.array(velocity), unlimited, unlimited, np.array(effort))


def _transmission(joints: Sequence[TreeJoint]) -> Transmission | None:
    if not any(joint.damping or joint.friction for joint in joints):
        return None
    drives = tuple(Drive(joint.name, coulomb=joint.friction, viscous=joint.damping) for joint in joints)
    return Transmission(np.eye(len(joints)), drives, Limits.none(len(joints)))


def _gravity(tree: UrdfTree, base: str) -> Array:
    """Gravity in the axes of the base, with the joints above it at rest."""
    magnitude = float(np.linalg.norm(_GRAVITY))
    return magnitude * _tidy(resting_rotation(tree, base).T @ (_GRAVITY / magnitude))


CPU, WALL = 20, 60.0  # seconds of computing, and of waiting, that an expansion may take
MEMORY = 10**9  # bytes that it may take
_PROCESS = "regressors.readers.xacro_expansion"


def read_xacro(
    path: str | Path,
    *,
    base: str | None = None,
    tip: Tips = None,
    arguments: Mapping[str, str] | None = None,
    snap_angles: bool = True,
) -> Robot:
    """Expand a xacro file, and read what moves of the URDF that comes out.

    A process of its own expands it, without a network and with caps on time and memory; expressions are limited to
    `regressors.readers.xacro_expressions`. It opens files of the folder of this one, of its package and of the packages
    that it names, and does not see the environment.
    """
    path = Path(path)
    text = expand_xacro(path, arguments)
    robot = parse_urdf(text, name_of_source=f"{path.name}, expanded", base=base, tip=tip, snap_angles=snap_angles)
    return robot.replace(source=f"URDF {path.name}")


def expand_xacro(path: str | Path, arguments: Mapping[str, str] | None = None) -> str:
    """Text of the URDF that a xacro file expands to; parameters as of `read_xacro`."""
    path = Path(path)
    caps = {"seconds": CPU, "memory": MEMORY, "silence": input_files.SILENCE}
    order = {"path": str(path), "arguments": dict(arguments or {}), **caps}
    answer = _answer(json.dumps(order), path)
    if "text" not in answer:
        raise InputError(answer["error"])
    return answer["text"]


def _answer(order: str, path: Path) -> dict[str, str]:
    """What the process that expands a file says."""
    command = [sys.executable, "-P", "-m", _PROCESS]  # -P: no module of the folder that it is started in
    try:
        done = subprocess.run(command, input=order.encode(), capture_output=True, timeout=WALL, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{path.name}: expanding it takes more than {WALL:g} s, the most that it may") from error
    except OSError as error:
        raise InputError(f"{path.name}: the process that expands it does not start: {error.strerror}") from error
    if done.returncode == -getattr(signal, "SIGXCPU", 0) or done.returncode == -getattr(signal, "SIGKILL", 0):
        raise InputError(f"{path.name}: expanding it takes more than {CPU} s of computing, the most that it may")
    try:
        answer: dict[str, str] = json.loads(done.stdout)
    except ValueError as error:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:] or ["no reason is given"]
        if said[0].startswith(("ImportError", "ModuleNotFoundError")):
            raise InputError(
                f"{path.name}: macros are expanded by xacro and simpleeval, of which one is not installed; pip install "
                "'excite-trajectories[xacro]'"
            ) from error
        raise InputError(
            f"{path.name}: the process that expands it ended with status {done.returncode}: {said[0]}"
        ) from error
    return answer
