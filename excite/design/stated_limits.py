"""Limits that hold by default, and those that cannot be checked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from constraints.clearance import assumed_radius, mounting_surface, moving_heights, skeleton, upwards, why_not_mounted
from constraints.closed_loops import loop_limits
from constraints.collision_limits import SelfCollisions
from constraints.geometry import HalfSpace, Obstacle, World
from constraints.linear import QUANTITIES, LinearConstraint, spanned
from constraints.nonlinear import NonlinearConstraint
from constraints.torque import why_no_torques
from constraints.world_file import UrdfShapes
from excite.tasks.limit_choice import TORQUE_MARGIN
from excite.tasks.option import MOUNTS, NONE
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from regressors.errors import InputError, listed_names
from regressors.models.partial import PartialMotion, of_joints
from regressors.readers.library import load_robot
from regressors.robot.inertia import rotation_from_rpy
from regressors.robot.robot import Robot
from regressors.robot.shapes import Capsule, Part
from regressors.samples import Array

_NAMED = 3
_CONTACT = 0.001  # m: less is contact
_TOOL = 0.001  # m: radius of the tool's point
_MOVABLE = 0.05  # m: a base that is so high has wheels, legs or a torso below it
_ROUNDING = 1e-6  # m: of the lowest point of a mesh
_ALIKE = 0.9  # cosine between normals of planes of which one stands for the other


@dataclass(frozen=True, eq=False)
class StatedLimits:
    """Limits that hold by default."""

    # empty where they are not checked, or where the task asks for them itself
    constraints: tuple[NonlinearConstraint, ...] = ()
    unchecked: tuple[Unchecked, ...] = ()  # those that are not checked, and why
    notes: tuple[str, ...] = ()  # what is assumed


@dataclass(frozen=True)
class StatedWorld:
    """Bodies that stay apart by default: those of the robot, and the surface that it is mounted on."""

    world: World | None = None  # None where nothing is checked
    unchecked: tuple[Unchecked, ...] = ()  # what is not checked, and why
    notes: tuple[str, ...] = ()  # what is assumed

    def without_self_collision(self, reason: str) -> StatedWorld:
        """The same without the check of self-collision."""
        world = self.world
        kept = None if world is None or not world.obstacles else replace(world, self_collision=False)
        return replace(self, world=kept, unchecked=(Unchecked("self-collision", reason), *self.unchecked))


def stated_limits(robot: Robot, joints: tuple[str, ...], task: Task, world: StatedWorld) -> StatedLimits:
    """Limits of torques and of distances, where the task leaves them to the description."""
    torques = _torques(robot, joints, task)
    distances = _distances(robot, joints, task, world)
    unchecked = (*torques.unchecked, *distances.unchecked)
    if not robot.is_chain and task.limits.support is None:  # robots of several limbs may stand free
        unchecked = (*unchecked, Unchecked("balance", "no support polygon is given"))
    return StatedLimits((*torques.constraints, *distances.constraints), unchecked, (*torques.notes, *distances.notes))


def _torques(robot: Robot, joints: tuple[str, ...], task: Task) -> StatedLimits:
    if task.limits.torque_margin is None:
        return StatedLimits(unchecked=(Unchecked("torque", "left out on request"),))
    limit = task.limits.stated_torque(task.known_friction)
    if limit is None:
        return StatedLimits()
    try:
        if reason := why_no_torques(robot):
            raise InputError(reason)
        constraints = limit.imposed(task.limits.applied(robot), _motion(robot, joints))
    except InputError as error:
        return StatedLimits(unchecked=(Unchecked("torque", str(error)),))
    note = (
        f"torques, computed from the known masses and friction, stay {100 * TORQUE_MARGIN:g} % below their limits; "
        "`torque_margin` changes that"
    )
    return StatedLimits(tuple(constraints), (), (note,))


def _motion(robot: Robot, joints: tuple[str, ...]) -> PartialMotion:
    return of_joints(robot, [robot.joint_names.index(name) for name in joints])


def _parts(robot: Robot, task: Task) -> tuple[tuple[Part, ...] | Unchecked, tuple[str, ...]]:
    """Capsules of the robot of a task, and what is assumed of links whose meshes cannot be read."""
    if robot.shapes:
        return robot.shapes, ()
    if not _has_urdf(task) or not isinstance(task.robot, str):
        return Unchecked("self-collision", f"the description has no shapes, and {_given(task.robot)}"), ()
    try:
        parts, left_out = _shapes(task, task.robot).capsules()
    except InputError as error:
        return Unchecked("self-collision", str(error)), ()
    if not left_out:
        return tuple(parts), ()
    links, radius = tuple(dict.fromkeys(link for link, _ in left_out)), assumed_radius(robot)
    shown = listed_names(links, _NAMED)
    note = f"shape of {shown} assumed: a capsule of radius {radius:.2g} m along each link, because {left_out[0][1]}"
    return (*parts, *skeleton(robot, radius, links)), (note,)


def _shapes(task: Task, file: str) -> UrdfShapes:
    """The shapes of a task's robot that is named by the file of a URDF."""
    return UrdfShapes(file, task.base_link, task.tip, task.snap_angles)


def _has_urdf(task: Task) -> bool:
    """Whether the robot is named by a file whose name tells a URDF, or a xacro that expands to one."""
    suffix = Path(task.robot).suffix.lower() if isinstance(task.robot, str) else ""
    return suffix == ".xacro" or (suffix in (".urdf", ".xml") and not task.xacro)


def _given(robot: Robot | StoredRobot | str) -> str:
    """How a robot is given that is not the file of a URDF."""
    if isinstance(robot, StoredRobot):
        return "the robot is that of a stored design, which holds none"
    if not isinstance(robot, str):
        return "the robot is given as an object; give its URDF in its place, or give it `shapes`"
    return f"{robot} is no URDF, nor a xacro by its name"


def stated_world(robot: Robot, task: Task) -> StatedWorld:
    """Bodies that stay apart by default.

    Everything that a joint moves stays on the robot's side of the surface behind its base, by 2 cm: the floor where the
    robot stands, the wall or the ceiling where it is mounted there. Its normal is against gravity as the robot's
    description has it; the option `floor` is its height along the normal, and `"auto"` the lowest point of the base's
    shape in a URDF, or the base's origin. Where a description does not stand on such a plane, there is none, and it is
    said why, see `constraints.clearance.why_not_mounted`.
    """
    if isinstance(task.robot, StoredRobot) and task.robot.shape is not None:
        return StatedWorld(replace(task.robot.shape, ignored=()))  # older files leave out what their limits allowed
    given = task.limits.known_world
    known, notes = _parts(robot, task) if given is None else (given.parts, ())
    parts = skeleton(robot, assumed_radius(robot)) if isinstance(known, Unchecked) else known
    point = task.limits.tool_point
    tool = (Part(robot.links[robot.last_link("a tool")].name, Capsule(point, point, _TOOL)),) if any(point) else ()
    surface = _surface(robot, task, parts, tool)
    objects = (surface,) if isinstance(surface, Obstacle) else ()
    unchecked = (surface,) if isinstance(surface, Unchecked) else ()
    reason = Unchecked("self-collision", "left out on request") if not task.limits.self_collision else known
    if given is None:
        unchecked = (*unchecked, Unchecked("obstacles", "no world file is given"))
        unchecked = (reason, *unchecked) if isinstance(reason, Unchecked) else unchecked
    apart = given is None and not isinstance(reason, Unchecked)
    if not objects and not apart:
        return StatedWorld(None, unchecked)
    world = World((*parts, *tool), objects, _CONTACT, self_collision=apart)
    try:
        world.check(robot)
        if apart and not robot.shapes and isinstance(task.robot, str):
            world = _shapes(task, task.robot).ranges_apart(world, task.limits.applied(robot), tool)
    except InputError as error:
        return StatedWorld(None, (Unchecked("self-collision", str(error)), *unchecked))
    assumed = isinstance(known, Unchecked)
    return StatedWorld(world, unchecked, (*notes, *(_surface_note(each, robot, assumed=assumed) for each in objects)))


def _surface(robot: Robot, task: Task, *bodies: tuple[Part, ...]) -> Obstacle | Unchecked | None:
    """The surface that the robot is mounted on, or why it is not checked; None where a plane of the world is it."""
    mount, floor, world = task.installation.mount, task.limits.floor, task.limits.known_world
    name = mount if isinstance(mount, str) else "floor"
    if floor == NONE:
        return Unchecked(name, "left out on request")
    normal = _normal(robot, task)
    shapes = [each.shape for each in (() if world is None else world.obstacles)]
    if any(isinstance(shape, HalfSpace) and np.dot(shape.normal, normal) > _ALIKE for shape in shapes):
        return None
    surface = mounting_surface(name, normal, floor if isinstance(floor, float) else _lowest(task, normal))
    heights = next(filter(None, (moving_heights(robot, parts, surface) for parts in bodies)), None)
    if heights is None:
        return Unchecked(
            name, "no joint raises or lowers a known shape; shapes of links, or `tool_point`, tell of others"
        )
    highest = max(heights, key=lambda link: float(heights[link].max()))
    if isinstance(floor, float) and (reached := float(heights[highest].max())) < 0.0:
        raise InputError(f"`floor`: no pose is above it, {highest} stays {-reached:.3g} m below; state another height")
    if isinstance(floor, float) or (reason := why_not_mounted(heights)) is None:
        return surface
    return Unchecked(name, f"{reason}; `floor` states its height above the base's origin")


def _normal(robot: Robot, task: Task) -> Array:
    """Upwards in the axes of the base as described: the mount turns the surface with the robot."""
    installation = task.installation
    if installation.gravity is not None and isinstance(task.robot, str):
        robot = load_robot(task.robot, task.base_link, task.tip, snap_angles=task.snap_angles, xacro=task.xacro)
    if installation.mount is None:
        return upwards(robot)
    angles = MOUNTS[installation.mount] if isinstance(installation.mount, str) else installation.mount
    return rotation_from_rpy(angles) @ upwards(robot)


def _lowest(task: Task, normal: Array) -> float:
    """Height of the lowest point of the base, at most that of its origin; of which nothing is known, its origin's."""
    if not isinstance(task.robot, str) or not _has_urdf(task):
        return 0.0
    known = _shapes(task, task.robot).lowest(normal)
    return 0.0 if known is None else min(known, 0.0)


def _surface_note(surface: Obstacle, robot: Robot, *, assumed: bool) -> str:
    assert isinstance(surface.shape, HalfSpace)
    shape = f", as capsules of radius {assumed_radius(robot):.2g} m along the links," if assumed else ""
    offset = surface.shape.offset
    height = "through" if abs(offset) < _ROUNDING else f"{abs(offset):.3g} m {'above' if offset > 0 else 'below'}"
    still = "; the base is assumed to stand still" if abs(offset) > _MOVABLE else ""
    return (
        f"what moves{shape} stays {surface.clearance:g} m from the {surface.name}, a plane {height} the origin of the "
        f"base{still}; `floor` moves it"
    )


def _distances(robot: Robot, joints: tuple[str, ...], task: Task, stated: StatedWorld) -> StatedLimits:
    if stated.world is None:
        return StatedLimits((), stated.unchecked, stated.notes)
    try:
        constraints = SelfCollisions(stated.world).imposed(task.limits.applied(robot), _motion(robot, joints))
    except InputError as error:
        return StatedLimits(unchecked=(Unchecked("self-collision", str(error)), *stated.unchecked))
    return StatedLimits(tuple(constraints), stated.unchecked, stated.notes)


_SURFACES = ("floor", "wall", "ceiling")
_COLLISIONS = (*_SURFACES, "self-collision")  # obstacles are the user's to state
_ORDER = (*QUANTITIES, "torque", "power", "tool", "balance", "distance")


@dataclass(frozen=True)
class Unchecked:
    """A kind of limit that is not checked."""

    # ``position``, ``velocity``, ``acceleration``, ``jerk``, ``torque``, ``self-collision``, ``floor`` (or ``wall``,
    # ``ceiling``) or ``obstacles``
    limit: str
    reason: str  # why, with the joints where it is not all of them

    def __str__(self) -> str:
        return f"{self.limit} ({self.reason})"


def unchecked_limits(motion: PartialMotion, limits: Sequence[LinearConstraint]) -> tuple[Unchecked, ...]:
    """Limits of joints and drives that neither the robot's description nor the task states, but for torques."""
    unchecked = []
    for derivative, quantity in enumerate(QUANTITIES):
        if free := unbounded(motion, limits, derivative):
            of = "" if len(free) == len(motion.labels) else f" for {', '.join(free)}"
            unchecked.append(Unchecked(quantity, f"no limit is stated{of}"))
    return tuple(unchecked)


def unbounded(motion: PartialMotion, limits: Sequence[LinearConstraint], *derivatives: int) -> list[str]:
    """Coordinates that no limit of these derivatives bounds."""
    bounded = spanned(limits, len(motion.labels), derivatives)
    return [name for name, known in zip(motion.labels, bounded, strict=True) if not known]


def checked_text(quantities: Iterable[str]) -> str:
    """Kinds of limits that were checked, each with the number of limits, such as ``position (7), distance (54)``."""
    counts = Counter(quantities)
    order = [*(kind for kind in _ORDER if kind in counts), *sorted(set(counts) - set(_ORDER))]
    return ", ".join(f"{kind} ({counts[kind]})" for kind in order)


def collisions_unchecked(limits: Iterable[str]) -> tuple[str, ...]:
    """Those kinds of limits among them whose breach may break the robot: of the robot with itself and its mounting."""
    return tuple(limit for limit in limits if limit in _COLLISIONS)


def gravest_first(unchecked: Iterable[Unchecked]) -> tuple[Unchecked, ...]:
    """What the robot is mounted on first, then the robot itself, then the others in their order."""
    return tuple(sorted(unchecked, key=lambda each: (each.limit not in _SURFACES, each.limit not in _COLLISIONS)))


def kept_headline(limits: Iterable[str], plain: str) -> str:
    """First words on a motion that exceeds no limit that was checked."""
    missing = collisions_unchecked(limits)
    return f"limits kept; collisions NOT checked ({', '.join(missing)})" if missing else plain


def kept_text(unchecked: Sequence[Unchecked], quantities: Iterable[str] = ()) -> str:
    """Verdict on a motion that exceeds no limit, with what was not checked and what was."""
    checked = f"; checked: {text}" if (text := checked_text(quantities)) else ""
    if not unchecked:
        return f"every limit is kept{checked}"
    kept = kept_headline((each.limit for each in unchecked), "every limit that was checked is kept")
    return f"{kept}; not checked: {', '.join(map(str, unchecked))}{checked}"


def nonlinear_limits(robot: Robot, joints: tuple[str, ...], task: Task) -> tuple[NonlinearConstraint, ...]:
    """Torque limits, the tool's box and its speed, and distances from obstacles, where a task asks for them.

    Before them what closed loops limit.
    """
    robot = task.limits.applied(robot)
    limits, motion = task.limits.imposed(task.known_friction), _motion(robot, joints)
    asked = (constraint for limit in limits for constraint in limit.imposed(robot, motion))
    return (*loop_limits(robot), *asked)
