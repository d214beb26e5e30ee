"""What the 3D player of a page needs of a design: shapes, motion, limits."""

from __future__ import annotations

import base64
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from constraints.collision_limits import Clearance
from constraints.geometry import World
from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from constraints.shapes import urdf_meshes
from excite.design.design import Design
from excite.storage.records import chosen
from excite.tasks.task import Task
from excite.views.view import raised
from regressors.errors import InputError
from regressors.readers.urdf import read_urdf
from regressors.robot.robot import BASE, Robot, placed_bodies
from regressors.samples import Array, Samples

_JOINT_SIZE = 0.035  # of the robot's reach


@dataclass(frozen=True, eq=False)
class LimitCourse:
    """One limited function along a motion."""

    owner: str  # such as ``joint q1``, or a pair of bodies
    quantity: str
    unit: str
    lower: float  # infinite where there is no bound
    upper: float
    values: Array  # (N,)
    bodies: tuple[str, ...] = ()  # links that the function belongs to


def player_data(
    motion: Samples,
    segments: Iterable[tuple[str, float]],  # names and ends [s]
    courses: Sequence[LimitCourse],
    robot: Robot,
    task: Task,
    shape: World | None,
    robot_file: str | None,
    about: str,
) -> dict[str, Any]:
    """What the player needs of a motion of every joint, as plain values; ``about``: what to know of the functions."""
    number = {BASE: 0, **{body.name: k for k, body in enumerate(robot.bodies, 1)}}
    return {
        "bodies": body_data(robot, number),
        "time": _short(motion.time, 9),
        "q": _short(motion.q, 9),
        "dq": _short(motion.dq, 7),
        "segments": [{"name": name, "end": end} for name, end in segments],
        "limits": [_limit(course, number) for course in courses],
        "values": _short(np.array([course.values for course in courses]).reshape(len(courses), len(motion.time)).T, 5),
        "tips": [robot.links.index(link) for link in robot.tips],
        "tool": list(task.limits.tool_point),
        "joint_size": _JOINT_SIZE * max(0.1, *(_stretched(robot, limb) for limb in robot.limbs)),
        "about": about,
        **player_shapes(robot, task, shape, number, robot_file),
    }


def _stretched(robot: Robot, limb: Collection[str]) -> float:
    """Distances from joint to joint of a limb together [m]."""
    pairs = zip(robot.joints, robot.links, strict=True)
    return sum(float(np.linalg.norm(joint.translation)) for joint, link in pairs if link.name in limb)


def _short(values: Array, digits: int) -> Any:
    """Nested lists of numbers with so many significant digits, None where a number is not known."""
    if values.ndim > 1:
        return [_short(row, digits) for row in values]
    return [float(f"{value:.{digits}g}") if isfinite(value) else None for value in values.tolist()]


def body_data(robot: Robot, number: Mapping[str, int]) -> list[dict[str, Any]]:
    """Links, then branches, each with the joint that carries it."""
    return [
        {
            "name": name, "parent": number[below], "row": row.tolist(), "offset": offset, "kind": joint.kind,
            **{pose: getattr(joint, pose).tolist() for pose in ("rotation", "translation", "axis")},
        }
        for name, below, joint, row, offset in placed_bodies(robot)
    ]  # fmt: skip


def _limit(course: LimitCourse, number: Mapping[str, int]) -> dict[str, Any]:
    return {
        "owner": course.owner,
        "quantity": course.quantity,
        "unit": raised(course.unit),
        "lower": course.lower if np.isfinite(course.lower) else None,
        "upper": course.upper if np.isfinite(course.upper) else None,
        "most": max(float(np.nanmax(np.abs(course.values))), 1e-12),
        "bodies": [number[name] for name in course.bodies if name in number],
    }


def tightest(courses: Sequence[LimitCourse]) -> list[LimitCourse]:
    """One course per function: of several with the same name, as of many pieces of two bodies, the nearest ones."""
    same: dict[tuple[str, str], list[LimitCourse]] = {}
    for course in courses:
        same.setdefault((course.owner, course.quantity), []).append(course)
    return [_nearest(group) for group in same.values()]


def _nearest(group: Sequence[LimitCourse]) -> LimitCourse:
    """Several functions with the same bounds as one, at every instant the one nearest to a bound."""
    alike = [course for course in group if (course.lower, course.upper) == (group[0].lower, group[0].upper)]
    values = np.array([course.values for course in alike])
    room = np.minimum(values - group[0].lower, group[0].upper - values)
    return replace(group[0], values=values[room.argmin(axis=0), np.arange(values.shape[1])])


FRAMES = 600  # of the motion in a page; between them it is interpolated
_PAIRS = 12  # nearest pairs of bodies whose distance is shown
_ABOUT = (
    "Torques are computed from the description's parameters; their limits are less the reserve and friction. Values "
    "between samples are interpolated; the certified extremes are in the table of margins."
)


def player_motion(design: Design, robot_file: str | None = None) -> dict[str, Any]:
    """Everything that the player of a page needs of a design, as plain values."""
    robot = design.task.limits.applied(design.robot)
    samples, _ = design.sequence.sampled()
    shown = samples.rows(chosen(samples.time.size, FRAMES))
    ends = ((name, end) for name, (_, end) in design.sequence.spans().items())
    courses = limit_courses(design, robot, shown)
    return player_data(shown, ends, courses, robot, design.task, design.shape, robot_file, _ABOUT)


def limit_courses(design: Design, robot: Robot, samples: Samples) -> list[LimitCourse]:
    """Every limit of joints, drives, torques, the tool and distances along a motion."""
    # of every joint where the motion begins and ends at home, since all of them move on the way
    whole = design.approach_and_return is not None
    joints = robot.joint_names if whole else design.moving.joint_names
    motion = of_some_joints(samples, robot, joints)
    linear = linear_limits(robot if whole else design.moving)
    bodies = bodies_of(robot, joints, linear)
    courses, distances = list[LimitCourse](), list[LimitCourse]()
    limits: list[LinearConstraint | NonlinearConstraint] = [*linear]
    for limit in [*limits, *(design.imposed_on(joints) if whole else design.nonlinear)]:
        (distances if isinstance(limit, Clearance) else courses).extend(courses_of(limit, motion, bodies))
    return [*tightest(courses), *nearest_pairs(distances)]


def of_some_joints(samples: Samples, robot: Robot, joints: Sequence[str]) -> Samples:
    """Motion of some joints of a robot."""
    index = [robot.joint_names.index(name) for name in joints]
    return Samples(samples.time, *(x[:, index] for x in (samples.q, samples.dq, samples.ddq, samples.dddq)))


def nearest_pairs(distances: Sequence[LimitCourse]) -> list[LimitCourse]:
    """The nearest pairs of bodies, those that come nearest first."""
    return sorted(tightest(distances), key=lambda x: np.minimum(x.values - x.lower, x.upper - x.values).min())[:_PAIRS]


def bodies_of(robot: Robot, joints: Sequence[str], linear: Sequence[LinearConstraint]) -> dict[str, tuple[str, ...]]:
    """Links whose joints a joint or a drive moves, by its name in labels."""
    link = {joint.name: body.name for joint, body in zip(robot.joints, robot.links, strict=True)}
    owners: dict[str, tuple[str, ...]] = {f"joint {name}": (link[name],) for name in joints}
    for limit in linear:
        for label, row in zip(limit.labels, limit.matrix, strict=True):
            moved = tuple(link[name] for name, factor in zip(joints, row, strict=True) if factor != 0.0)
            owners.setdefault(label.removesuffix(f" {limit.quantity}"), moved)
    return owners


def courses_of(
    limit: LinearConstraint | NonlinearConstraint, samples: Samples, bodies: Mapping[str, tuple[str, ...]]
) -> Iterator[LimitCourse]:
    """Functions of a limit along a motion."""
    values = limit.values(samples)
    values = values if isinstance(limit, LinearConstraint) else limit.shown(values)
    of_joints = limit.quantity if isinstance(limit, LinearConstraint) else "torque"
    pairs = {pair.label: pair for pair in limit.pairs} if isinstance(limit, Clearance) else {}
    for k, label in enumerate(limit.labels):
        bounds = float(limit.lower[k]), float(limit.upper[k])
        owner, quantity, names = label, "distance" if limit.quantity == "distance" else "tool", tuple[str, ...]()
        if label in pairs:
            names, quantity = (pairs[label].link, pairs[label].other), "distance"
        elif label.endswith(f" {of_joints}"):
            owner, quantity = label.removesuffix(f" {of_joints}"), of_joints
            names = bodies.get(owner, ())
        yield LimitCourse(owner, quantity, limit.units[k], *bounds, values[:, k], names)


def player_shapes(
    robot: Robot, task: Task, shape: World | None, number: Mapping[str, int], robot_file: str | None
) -> dict[str, Any]:
    """Entries ``meshes``, ``capsules``, ``objects``, ``drawn_as`` and ``left_out`` of the player's data."""
    worlds = [each for each in (task.limits.known_world, shape) if each is not None]
    meshes, reasons = ([], ()) if robot_file is None else _meshes(robot, task, robot_file, number)
    parts = worlds[0].parts if worlds and not meshes else ()
    drawn = "meshes of its URDF" if meshes else "capsules" if parts else "lines through the frames of its joints"
    known = [(number[part.link], part.to_dict()) for part in parts if part.link in number]
    objects: list[Any] = [world.to_dict()["objects"] for world in worlds]
    return {
        "meshes": meshes,
        "capsules": [{"body": body, **{k: v for k, v in plain.items() if k != "link"}} for body, plain in known],
        "objects": [_object(name, plain) for each in objects for name, plain in each.items()],
        "drawn_as": drawn,
        "left_out": _left_out(reasons),
    }


def matches(robot: Robot, task: Task, robot_file: str) -> bool:
    """True if a URDF describes the robot of a task."""
    try:
        read = read_urdf(robot_file, base=task.base_link, tip=task.tip, snap_angles=task.snap_angles)
    except InputError:
        if Path(robot_file).is_file():
            return False  # a URDF without these links
        raise
    places = [[(joint.name, joint.kind) for joint in each.joints] for each in (read, robot)]
    return places[0] == places[1] and all(
        np.allclose(a.rotation, b.rotation) and np.allclose(a.translation, b.translation)
        for a, b in zip(read.joints, robot.joints, strict=True)
    )


def _meshes(
    robot: Robot, task: Task, robot_file: str, number: Mapping[str, int]
) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Meshes of few triangles, and what is said of files that are left out."""
    meshes, left_out = urdf_meshes(Path(robot_file), robot, task.base_link, snap_angles=task.snap_angles)
    together = {k: [triangles for link, triangles in meshes if link == name] for name, k in number.items()}
    return [{"body": k, **mesh_data(*decimated(np.concatenate(x)))} for k, x in together.items() if x], left_out


def _left_out(reasons: Sequence[str]) -> str:
    """A sentence on files that are not shown."""
    if not reasons:
        return ""
    more = f"; and {len(reasons) - 1} more" if len(reasons) > 1 else ""
    return f"Some meshes of its URDF are not shown: {reasons[0]}{more}."


def _object(name: str, plain: Mapping[str, Any]) -> dict[str, Any]:
    kind = next(kind for kind in ("box", "plane", "capsule") if kind in plain)
    return {"name": name, "kind": kind, **plain[kind]}


_CELLS = (192, 128, 96, 64, 48, 32, 24, 16, 12, 8, 4, 2)  # along the longest side
_STEPS = 65535  # of a stored coordinate, over the longest side
MOST = 2500  # triangles


def mesh_data(corners: Array, faces: Array) -> dict[str, object]:
    """Corners as 16-bit steps from a point and faces as 16-bit indices, both in base64."""  # (N, 3), (M, 3)
    origin = corners.min(axis=0)
    scale = max(float(np.ptp(corners, axis=0).max()), 1e-9) / _STEPS
    steps = np.rint((corners - origin) / scale).astype("<u2")
    return {
        "origin": [float(f"{x:.7g}") for x in origin],
        "scale": float(f"{scale:.7g}"),
        "corners": base64.b64encode(steps.tobytes()).decode("ascii"),
        "faces": base64.b64encode(faces.astype("<u2").tobytes()).decode("ascii"),
    }


def decimated(triangles: Array, most: int = MOST) -> tuple[Array, Array]:
    """Corners and faces of at most so many triangles, on the finest of several grids that leaves no more."""
    # triangles (N, 3, 3)
    points = triangles.reshape(-1, 3)
    low, side = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-9)
    for cells in _CELLS:
        corners, faces = _clustered(points, np.floor((points - low) * (cells / side)).astype(np.int64))
        if len(faces) <= most:
            break
    return corners, faces


def _clustered(points: Array, cells: Array) -> tuple[Array, Array]:
    """The mesh whose corners are the means of those in each cell, without triangles that became lines."""
    _, place, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    place = place.reshape(-1)
    means = np.column_stack([np.bincount(place, points[:, k]) for k in range(3)]) / count[:, None]
    faces = place.reshape(-1, 3)
    real = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    _, first = np.unique(np.sort(faces[real], axis=1), axis=0, return_index=True)
    return means, faces[real][np.sort(first)]
