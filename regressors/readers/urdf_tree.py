"""The tree of links and joints that a URDF document describes, checked, with the place of every mistake in the file."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from regressors.errors import Finding, InputError, listed_names
from regressors.readers.angles import AngleReader
from regressors.readers.urdf_elements import XmlElement, check_words, robot_element
from regressors.robot.inertia import Array, from_centre_of_mass, pose_of

MOVING = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*MOVING, "fixed", "floating", "planar")


@dataclass(frozen=True, eq=False)
class Mimic:
    """``q = multiplier * q(joint) + offset`` [rad or m]."""

    joint: str
    multiplier: float
    offset: float
    curved: bool = False  # the tangent at the leader's zero of what is no line


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint as the document states it."""

    name: str  # its own name and those of the two links
    parent: str
    child: str
    kind: str  # one of `JOINT_TYPES`
    pose: Array  # (4, 4) pose of the child's frame in the parent's at position zero
    axis: Array  # (3,) unit vector in the child's frame
    bounds: Mapping[str, float]  # the attributes of ``<limit>`` that are stated [rad or m, rad/s or m/s, Nm or N]
    damping: float | None  # viscous and Coulomb friction [Nm s/rad or N s/m, Nm or N]; None without ``<dynamics>``
    friction: float | None
    mimic: Mimic | None


@dataclass(frozen=True, eq=False)
class UrdfTree:
    """Links and joints of one document; every link hangs below the root."""

    name: str  # name of the robot, name of the file for messages
    source: str
    root: str
    # (10,) inertial parameters about the link frame's origin, shape (10,); None without ``<inertial>``
    links: Mapping[str, Array | None]
    above: Mapping[str, TreeJoint]  # the joint that carries a link, by the link's name
    below: Mapping[str, list[TreeJoint]]  # the joints that a link carries, in the order of the document
    notes: tuple[Finding, ...] = ()  # on tags and attributes
    angles: AngleReader = field(default_factory=lambda: AngleReader(snap=False))  # with what it noticed
    # joints that the document says to have a transmission; empty where it does not speak of them
    actuated: frozenset[str] = frozenset()

    def path(self, first: str, last: str) -> list[TreeJoint] | None:
        """Joints from one link down to another, None where the second does not hang below the first."""
        joints: list[TreeJoint] = []
        while last != first:
            if last not in self.above:
                return None
            joints.append(self.above[last])
            last = joints[-1].parent
        return joints[::-1]

    def carrier(self, link: str, links: Collection[str]) -> str:
        """The first of some links that is met from a link upwards, itself included; the root where none is."""
        while link not in links and link in self.above:
            link = self.above[link].parent
        return link


def _pose(element: XmlElement, angles: AngleReader) -> Array:
    """Pose stated by ``<origin>``: ``R = Rz(yaw) Ry(pitch) Rx(roll)``."""
    origin = element.child("origin")
    if origin is None:
        return np.eye(4)
    if "rpy" not in origin.attributes and "quat_xyzw" in origin.attributes:
        origin.fail("<origin> quat_xyzw: rotations are read from 'rpy' only; write roll, pitch and yaw there")
    return pose_of(angles.rotation(origin), origin.numbers("xyz", (0.0, 0.0, 0.0)))


def _inertial_parameters(link: XmlElement, angles: AngleReader) -> Array | None:
    inertial = link.child("inertial")
    if inertial is None:
        return None
    T = _pose(inertial, angles)
    mass, tensor = inertial.needed("mass"), inertial.needed("inertia")
    m = mass.number("value")
    xx, xy, xz, yy, yz, zz = (tensor.number(key) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    R = T[:3, :3]
    return from_centre_of_mass(m, T[:3, 3], R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T)


def _axis(joint: XmlElement, angles: AngleReader) -> Array:
    stated = joint.child("axis")
    if stated is None:
        return np.array([1.0, 0.0, 0.0])
    axis = stated.numbers("xyz", (1.0, 0.0, 0.0))
    length = float(np.linalg.norm(axis))
    if not 0 < length < np.inf:
        stated.fail(f"<axis> xyz: expected a direction, given {stated.attributes['xyz']!r}")
    return angles.axis(axis / length, stated.label, stated.attributes.get("xyz", ""))


def _bounds(joint: XmlElement) -> dict[str, float]:
    limit = joint.child("limit")
    if limit is None:
        return {}
    stated = [key for key in ("lower", "upper", "velocity", "effort") if key in limit.attributes]
    return {key: limit.number(key, infinite=True) for key in stated}


def _friction(joint: XmlElement) -> tuple[float | None, float | None]:
    dynamics = joint.child("dynamics")
    if dynamics is None:
        return None, None
    damping, friction = dynamics.number("damping", 0.0), dynamics.number("friction", 0.0)
    if min(damping, friction) < 0:
        dynamics.fail(f"<dynamics>: expected zero or more, given damping {damping:g}, friction {friction:g}")
    return damping, friction


def _joint(element: XmlElement, angles: AngleReader) -> TreeJoint:
    kind = element.text("type")
    if kind not in JOINT_TYPES:
        element.fail(f"no joint type named {kind!r}; available: {', '.join(JOINT_TYPES)}")
    damping, friction = _friction(element)
    mimic = element.child("mimic")
    return TreeJoint(
        name=element.text("name"),
        parent=element.needed("parent").text("link"),
        child=element.needed("child").text("link"),
        kind=kind,
        pose=_pose(element, angles),
        axis=_axis(element, angles) if kind in MOVING else np.array([1.0, 0.0, 0.0]),
        bounds=_bounds(element) if kind in MOVING else {},
        damping=damping,
        friction=friction,
        mimic=None
        if mimic is None or kind not in MOVING
        else Mimic(mimic.text("joint"), mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)),
    )


def _actuated(robot: XmlElement) -> frozenset[str]:
    """Joints that a transmission or a controller of the document moves."""
    groups = [group for tag in ("transmission", "ros2_control") for group in robot.below(tag)]
    return frozenset(name for group in groups for j in group.below("joint") if (name := j.attributes.get("name")))


def _root(source: str, above: Mapping[str, TreeJoint], below: Mapping[str, list[TreeJoint]]) -> str:
    """Name of the one link that hangs on no joint, provided that all others hang below it."""
    roots = [name for name in below if name not in above]
    if len(roots) > 1:
        names = listed_names(roots)
        raise InputError(
            f"{source}: expected one root link, given {len(roots)} that are the child of no joint: {names}"
        )
    reached = list(roots)
    for link in reached:
        reached.extend(joint.child for joint in below[link])
    loop = sorted(set(below) - set(reached))
    if loop:
        raise InputError(f"{source}: expected a tree, given a loop of joints through links: {listed_names(loop)}")
    return roots[0]


def parse_tree(text: str | bytes, source: str, *, snap_angles: bool = True) -> UrdfTree:
    """Read and check the tree of a URDF document."""
    robot = robot_element(text, source)
    notes, angles = check_words(robot), AngleReader(snap_angles)
    if not any(robot.below("link")):
        robot.fail("expected at least one <link>, given none")
    links: dict[str, Array | None] = {}
    above: dict[str, TreeJoint] = {}
    names: set[str] = set()
    for element in robot.below("link"):
        if element.text("name") in links:
            element.fail("two links share this name")
        links[element.text("name")] = _inertial_parameters(element, angles)
    below: dict[str, list[TreeJoint]] = {name: [] for name in links}
    for element in robot.below("joint"):
        joint = _joint(element, angles)
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                element.fail(f"<{role}>: no link named {link!r}; available: {listed_names(links)}")
        if joint.name in names:
            element.fail("two joints share this name")
        if joint.child in above:
            other = above[joint.child].name
            element.fail(
                f"link {joint.child!r} is already the child of joint {other!r}; a closed loop is not supported"
            )
        names.add(joint.name)
        above[joint.child] = joint
        below[joint.parent].append(joint)
    root = _root(source, above, below)
    return UrdfTree(robot.text("name"), source, root, links, above, below, notes, angles, _actuated(robot))
