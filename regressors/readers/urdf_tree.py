"""The tree of links and joints that a URDF document describes, checked, with the place of every mistake in the file.

Reads with the standard library's expat. A document type declaration is refused at its first byte, so no entity is
ever expanded.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NoReturn
from xml.parsers import expat

import numpy as np

from regressors.errors import InputError
from regressors.robot.inertia import Array, from_centre_of_mass

MOVING = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*MOVING, "fixed", "floating", "planar")
_LISTED = 20


def listing(names: Iterable[str]) -> list[str]:
    """First names of a long list, then an ellipsis, for messages."""
    names = list(names)
    return names if len(names) <= _LISTED else [*names[:_LISTED], "..."]


@dataclass(frozen=True, eq=False)
class Mimic:
    """``q = multiplier * q(joint) + offset`` [rad or m]."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint as the document states it.

    Parameters
    ----------
    name, parent, child : str
        Its own name and those of the two links.
    kind : str
        One of `JOINT_TYPES`.
    pose : ndarray, shape (4, 4)
        Pose of the child's frame in the parent's at position zero.
    axis : ndarray, shape (3,)
        Unit vector in the child's frame.
    bounds : mapping of str to float
        The attributes of ``<limit>`` that are stated [rad or m, rad/s or m/s, Nm or N].
    damping, friction : float or None
        Viscous and Coulomb friction [Nm s/rad or N s/m, Nm or N]; None without ``<dynamics>``.
    mimic : Mimic or None
    """

    name: str
    parent: str
    child: str
    kind: str
    pose: Array
    axis: Array
    bounds: Mapping[str, float]
    damping: float | None
    friction: float | None
    mimic: Mimic | None


@dataclass(frozen=True, eq=False)
class UrdfTree:
    """Links and joints of one document; every link hangs below the root.

    Parameters
    ----------
    name, source : str
        Name of the robot, name of the file for messages.
    root : str
    links : mapping of str to ndarray or None
        Inertial parameters about the link frame's origin, shape (10,); None without ``<inertial>``.
    above : mapping of str to TreeJoint
        The joint that carries a link, by the link's name.
    below : mapping of str to list of TreeJoint
        The joints that a link carries, in the order of the document.
    """

    name: str
    source: str
    root: str
    links: Mapping[str, Array | None]
    above: Mapping[str, TreeJoint]
    below: Mapping[str, list[TreeJoint]]

    def path(self, first: str, last: str) -> list[TreeJoint] | None:
        """Joints from one link down to another, None where the second does not hang below the first."""
        joints: list[TreeJoint] = []
        while last != first:
            if last not in self.above:
                return None
            joints.append(self.above[last])
            last = joints[-1].parent
        return joints[::-1]


@dataclass(eq=False)
class _Element:
    source: str
    line: int
    label: str
    tag: str
    attributes: Mapping[str, str]
    children: list[_Element] = field(default_factory=list)

    def fail(self, message: str) -> NoReturn:
        raise InputError(f"{self.source}, line {self.line}: {self.label}: {message}")

    def child(self, tag: str) -> _Element | None:
        children = [child for child in self.children if child.tag == tag]
        if len(children) > 1:
            children[1].fail(f"expected one <{tag}>, given {len(children)}")
        return children[0] if children else None

    def needed(self, tag: str) -> _Element:
        child = self.child(tag)
        return child if child is not None else self.fail(f"<{tag}> is missing")

    def text(self, attribute: str) -> str:
        value = self.attributes.get(attribute)
        if not value:
            self.fail(f"<{self.tag}> needs the attribute {attribute!r}")
        if not value.isprintable():  # a line break in a name would break messages and file headers
            self.fail(f"<{self.tag}> {attribute}: expected printable characters, given {value!r}")
        return value

    def numbers(self, attribute: str, default: tuple[float, ...], *, infinite: bool = False) -> Array:
        """As many numbers as the default has; infinite ones only where they mean "no limit"."""
        text = self.attributes.get(attribute)
        if text is None:
            return np.array(default)
        words = text.split()
        values = [_number(word) for word in words]
        usable = np.isfinite(values) | (infinite & ~np.isnan(values))
        if len(words) != len(default) or not np.all(usable):
            count = "a number" if len(default) == 1 else f"{len(default)} numbers"
            self.fail(f"<{self.tag}> {attribute}: expected {count}, given {text!r}")
        return np.array(values)

    def number(self, attribute: str, default: float | None = None, *, infinite: bool = False) -> float:
        """One number; without a default the attribute must be there."""
        if default is None:
            self.text(attribute)
        return float(self.numbers(attribute, (default or 0.0,), infinite=infinite)[0])


def _number(word: str) -> float:
    try:
        return float("nan" if "_" in word else word)  # float() takes 1_0 for ten
    except ValueError:
        return float("nan")


def _document(text: str | bytes, source: str) -> _Element:
    parser = expat.ParserCreate()
    top = _Element(source, 1, "<document>", "", {})
    open_elements = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        parent = open_elements[-1]
        label = parent.label if len(open_elements) > 2 else f"<{tag}>"
        if len(open_elements) == 2 and "name" in attributes:
            label = f"{tag} {attributes['name']!r}"
        element = _Element(source, parser.CurrentLineNumber, label, tag, attributes)
        parent.children.append(element)
        open_elements.append(element)

    def refuse(*_: object) -> None:
        raise InputError(
            f"{source}, line {parser.CurrentLineNumber}: a DOCTYPE or ENTITY declaration is refused, "
            "expected plain URDF; remove the declaration"
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_elements.pop()
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise InputError(f"{source}, line {error.lineno}: not well-formed XML: {reason}") from error
    except InputError:
        raise
    except (LookupError, ValueError) as error:  # an encoding that Python or expat does not know
        raise InputError(f"{source}: cannot decode the text: {error}") from error
    return top.children[0]


def _pose(element: _Element) -> Array:
    """Pose stated by ``<origin>``: ``R = Rz(yaw) Ry(pitch) Rx(roll)``."""
    T = np.eye(4)
    origin = element.child("origin")
    if origin is None:
        return T
    T[:3, 3] = origin.numbers("xyz", (0.0, 0.0, 0.0))
    angles = origin.numbers("rpy", (0.0, 0.0, 0.0))
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    T[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return T


def _inertial_parameters(link: _Element) -> Array | None:
    inertial = link.child("inertial")
    if inertial is None:
        return None
    T = _pose(inertial)
    mass, tensor = inertial.needed("mass"), inertial.needed("inertia")
    m = mass.number("value")
    if m < 0:
        mass.fail(f"<mass> value: expected zero or more, given {m:g}")
    xx, xy, xz, yy, yz, zz = (tensor.number(key) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    R = T[:3, :3]
    return from_centre_of_mass(m, T[:3, 3], R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T)


def _axis(joint: _Element) -> Array:
    stated = joint.child("axis")
    if stated is None:
        return np.array([1.0, 0.0, 0.0])
    axis = stated.numbers("xyz", (1.0, 0.0, 0.0))
    length = float(np.linalg.norm(axis))
    if not 0 < length < np.inf:
        stated.fail(f"<axis> xyz: expected a direction, given {stated.attributes['xyz']!r}")
    return axis / length


def _bounds(joint: _Element) -> dict[str, float]:
    limit = joint.child("limit")
    if limit is None:
        return {}
    stated = [key for key in ("lower", "upper", "velocity", "effort") if key in limit.attributes]
    return {key: limit.number(key, infinite=True) for key in stated}


def _friction(joint: _Element) -> tuple[float | None, float | None]:
    dynamics = joint.child("dynamics")
    if dynamics is None:
        return None, None
    damping, friction = dynamics.number("damping", 0.0), dynamics.number("friction", 0.0)
    if min(damping, friction) < 0:
        dynamics.fail(f"<dynamics>: expected zero or more, given damping {damping:g}, friction {friction:g}")
    return damping, friction


def _joint(element: _Element) -> TreeJoint:
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
        pose=_pose(element),
        axis=_axis(element) if kind in MOVING else np.array([1.0, 0.0, 0.0]),
        bounds=_bounds(element) if kind in MOVING else {},
        damping=damping,
        friction=friction,
        mimic=None
        if mimic is None or kind not in MOVING
        else Mimic(mimic.text("joint"), mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)),
    )


def _robot_element(text: str | bytes, source: str) -> _Element:
    robot = _document(text, source)
    if robot.tag != "robot":
        robot.fail("expected <robot> as the outermost element")
    for child in robot.children:
        if child.tag.startswith("xacro:"):
            child.fail("a xacro macro, expected plain URDF; expand it first: xacro FILE.xacro > FILE.urdf")
    if not any(child.tag == "link" for child in robot.children):
        robot.fail("expected at least one <link>, given none")
    return robot


def _root(source: str, above: Mapping[str, TreeJoint], below: Mapping[str, list[TreeJoint]]) -> str:
    """Name of the one link that hangs on no joint, provided that all others hang below it."""
    roots = [name for name in below if name not in above]
    if len(roots) > 1:
        names = ", ".join(listing(roots))
        raise InputError(
            f"{source}: expected one root link, given {len(roots)} that are the child of no joint: {names}"
        )
    reached = list(roots)
    for link in reached:
        reached.extend(joint.child for joint in below[link])
    loop = sorted(set(below) - set(reached))
    if loop:
        raise InputError(f"{source}: expected a tree, given a loop of joints through links: {', '.join(listing(loop))}")
    return roots[0]


def parse_tree(text: str | bytes, source: str) -> UrdfTree:
    """Read and check the tree of a URDF document.

    Parameters
    ----------
    text : str or bytes
        The document.
    source : str
        Name of the file, for messages.

    Returns
    -------
    UrdfTree

    Raises
    ------
    InputError
        Not well-formed, a document type declaration, a missing or unusable value, or links that form no tree.
    """
    robot = _robot_element(text, source)
    links: dict[str, Array | None] = {}
    above: dict[str, TreeJoint] = {}
    names: set[str] = set()
    for element in (child for child in robot.children if child.tag == "link"):
        if element.text("name") in links:
            element.fail("two links share this name")
        links[element.text("name")] = _inertial_parameters(element)
    below: dict[str, list[TreeJoint]] = {name: [] for name in links}
    for element in (child for child in robot.children if child.tag == "joint"):
        joint = _joint(element)
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                element.fail(f"<{role}>: no link named {link!r}; available: {', '.join(listing(links))}")
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
    return UrdfTree(robot.text("name"), source, _root(source, above, below), links, above, below)
