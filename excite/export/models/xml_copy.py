"""Copies of a user's own XML, in which only what is identified changes; XML that is written.

The standard library's expat gives the offset of every tag; attributes are found in the bytes of the tag.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from excite.export.models.identified_model import DrivenRobot
from excite.export.models.nearest_bodies import held_note, own_part
from regressors.errors import InputError, shortened
from regressors.readers.moving_part import carried, kind_of
from regressors.readers.urdf_elements import parse_safely
from regressors.readers.urdf_tree import TreeJoint, UrdfTree
from regressors.robot.robot import Joint, Robot
from regressors.samples import Array

_ATTRIBUTE = re.compile(rb"""\s+([^\s=<>/"']+)\s*=\s*("[^"]*"|'[^']*')""")
_END = re.compile(rb"\s*(/?)>")


@dataclass(eq=False)
class XmlSpan:
    """An element and where it is in the document."""

    tag: str
    attributes: Mapping[str, str]
    # offsets of its start tag, of what follows that tag, of its end tag, and of what follows the element; for an
    # empty element the last three are alike
    begin: int
    inner: int
    close: int = -1
    end: int = -1
    children: list[XmlSpan] = field(default_factory=list)

    @property
    def empty(self) -> bool:
        """True for a tag that ends itself."""
        return self.inner == self.end

    def below(self, tag: str) -> Iterator[XmlSpan]:
        """Children of that tag."""
        return (child for child in self.children if child.tag == tag)

    def child(self, tag: str) -> XmlSpan | None:
        """First child of that tag."""
        return next(self.below(tag), None)

    def all(self) -> Iterator[XmlSpan]:
        """The element and all that it holds, in the order of the document."""
        yield self
        for child in self.children:
            yield from child.all()


class XmlDocument:
    """A document with edits to come."""

    def __init__(self, content: bytes, source: str) -> None:
        self.content, self.source = content, source
        self._edits: list[tuple[int, int, bytes]] = []
        self.line = b"\r\n" if b"\r\n" in content else b"\n"
        self.encoding = "utf-8"
        if b"\0" in content[:4]:
            raise InputError(f"{source}: it is in UTF-16 or UTF-32; save it as UTF-8")
        self.root = self._read()

    def _read(self) -> XmlSpan:
        parser = expat.ParserCreate()
        roots: list[XmlSpan] = []
        opened: list[XmlSpan] = []

        def declared(_: str, encoding: str | None, __: int) -> None:
            self.encoding = encoding or "utf-8"

        def begin(tag: str, attributes: dict[str, str]) -> None:
            at = parser.CurrentByteIndex
            element = XmlSpan(tag, attributes, at, self._after_tag(at, tag))
            (opened[-1].children if opened else roots).append(element)
            opened.append(element)

        def end(_: str) -> None:
            element, at = opened.pop(), parser.CurrentByteIndex
            if self.content[element.inner - 2 : element.inner] == b"/>":
                element.close = element.end = element.inner
            else:
                element.close, element.end = at, self.content.index(b">", at) + 1

        parser.XmlDeclHandler = declared
        parser.StartElementHandler, parser.EndElementHandler = begin, end
        parse_safely(parser, self.content, self.source)
        return roots[0]

    def _after_tag(self, at: int, tag: str) -> int:
        place = at + 1 + len(tag.encode(self.encoding))
        while match := _ATTRIBUTE.match(self.content, place):
            place = match.end()
        finish = _END.match(self.content, place)
        assert finish is not None
        return finish.end()

    def bytes_of(self, text: str) -> bytes:
        """Text as the document writes it: its encoding and its line ends."""
        return text.encode(self.encoding, "xmlcharrefreplace").replace(b"\n", self.line)

    def set(self, element: XmlSpan, values: Mapping[str, str]) -> None:
        """Set attributes of an element; those that have the value already stay as they are written."""
        at = element.begin + 1 + len(element.tag.encode(self.encoding))
        missing = dict(values)
        while match := _ATTRIBUTE.match(self.content, at):
            name, at = match.group(1).decode(self.encoding), match.end()
            value = missing.pop(name, None)
            if value is not None and value != element.attributes[name]:
                begin, stop = match.span(2)
                self._edits.append((begin + 1, stop - 1, self.bytes_of(escape(value, {'"': "&quot;", "'": "&apos;"}))))
        added = "".join(f' {name}="{escape(value, {chr(34): "&quot;"})}"' for name, value in missing.items())
        if added:
            self._edits.append((at, at, self.bytes_of(added)))

    def set_child(self, element: XmlSpan, tag: str, values: Mapping[str, str], *, first: bool = False) -> None:
        """Set attributes of the first child of a tag; one that is not there is inserted."""
        if (child := element.child(tag)) is not None:
            self.set(child, values)
        else:
            self.insert_in(element, start(tag, values, empty=True), first=first)

    def insert_in(self, element: XmlSpan, text: str, *, first: bool = False) -> None:
        """Insert lines into an element, indented as its children are, before its end or behind its start tag."""
        indent = self.indent_of(element.children[0]) if element.children else self.indent_of(element) + "  "
        lines = "".join(f"\n{indent}{line}" for line in text.split("\n"))
        if element.empty:
            slash = self.content.rindex(b"/", element.begin, element.inner)
            closed = self.bytes_of(f">{lines}\n{self.indent_of(element)}</{element.tag}>")
            self._edits.append((slash, element.inner, closed))
            return
        at = max((child.end for child in element.children if not first), default=element.inner)
        after = "" if element.children else f"\n{self.indent_of(element)}"
        stay = self.content[at : element.close].strip() or b"\n" in self.content[at : element.close]
        self._edits.append((at, at, self.bytes_of(lines + ("" if stay else after))))

    def replace_tag(self, element: XmlSpan, text: str) -> None:
        """Replace the start tag of an element, or the whole of one without content."""
        self._edits.append((element.begin, element.inner, self.bytes_of(text)))

    def replace(self, element: XmlSpan, text: str) -> None:
        """Replace an element and all that it holds."""
        self._edits.append((element.begin, element.end, self.bytes_of(text)))

    def insert_before(self, element: XmlSpan, text: str) -> None:
        """Insert lines in front of an element."""
        self._edits.append((element.begin, element.begin, self.bytes_of(f"{text}\n{self.indent_of(element)}")))

    def indent_of(self, element: XmlSpan) -> str:
        """White space before an element in its line; empty where something else is there."""
        start = self.content.rfind(b"\n", 0, element.begin) + 1
        before = self.content[start : element.begin]
        return before.decode("ascii") if not before.strip(b" \t") else ""

    def edited(self, lines: tuple[str, ...] = ()) -> bytes:
        """The document with all edits, and with a comment in front of its outermost element."""
        if lines:
            self.insert_before(self.root, comment(lines))
        parts, place = [], 0
        for begin, stop, new in sorted(self._edits, key=lambda edit: edit[:2]):
            parts += [self.content[place:begin], new]
            place = stop
        return b"".join([*parts, self.content[place:]])


def start(tag: str, attributes: Mapping[str, str], *, empty: bool = False) -> str:
    """Start tag, or a whole element without content."""
    shown = "".join(f" {name}={quoteattr(value)}" for name, value in attributes.items())
    return f"<{tag}{shown}{'/' if empty else ''}>"


def comment(lines: Iterable[str]) -> str:
    """Comment of several lines; two hyphens, which no comment may hold, are set apart."""
    body = "\n".join(f"  {line}".replace("--", "- -").replace("--", "- -") for line in lines)
    return f"<!--\n{body}\n-->"


_ROUNDED = 1e-3  # of a pose whose angles were snapped


def joints_in(tree: UrdfTree, robot: Robot, file: Path) -> list[TreeJoint]:
    """The joints of a robot in a file, in their order."""
    by_name = {joint.name: joint for joint in tree.above.values()}
    if missing := [name for name in robot.joint_names if name not in by_name]:
        raise InputError(
            f"{str(file)!r} is not the file of robot {robot.name!r}: it has no joint {', '.join(missing)}; its joints "
            f"are {shortened(', '.join(sorted(by_name)))}"
        )
    return [by_name[name] for name in robot.joint_names]


def pose_error(trees: tuple[UrdfTree, ...], robot: Robot, file: Path) -> float:
    """Largest difference of the poses and axes of joints in the first tree from those of the robot."""
    theirs = joints_in(trees[0], robot, file)
    distances = [_distances(tree, robot, file) for tree in trees]
    for k, joint in enumerate(robot.joints):
        if kind_of(theirs[k]) != joint.kind or min(d[k] for d in distances) > _ROUNDED:
            raise InputError(
                f"{str(file)!r} is not the file of robot {robot.name!r}: joint {joint.name!r} sits elsewhere in it, or "
                "moves otherwise; give the file that the robot was read from, or leave `robot_file` out"
            )
    return max(distances[0])


def _distances(tree: UrdfTree, robot: Robot, file: Path) -> list[float]:
    """Largest difference of each joint's pose and axis from the robot's; infinite where no chain leads to it."""
    distances, theirs = [], joints_in(tree, robot, file)
    for joint, mine, parent in zip(robot.joints, theirs, robot.parents, strict=True):
        path = tree.path(theirs[parent - 1].child, mine.child) if parent else [mine]
        paths = _paths(tree, path, open_above=parent == 0)
        distances.append(min((_distance(path, joint) for path in paths), default=np.inf))
    return distances


def _paths(tree: UrdfTree, path: list[TreeJoint] | None, *, open_above: bool) -> list[list[TreeJoint]]:
    """The path; where the robot's base is not known, with more and more of the joints above it too."""
    paths = [] if path is None else [path]
    while open_above and paths and paths[-1][0].parent in tree.above:
        paths.append([tree.above[paths[-1][0].parent], *paths[-1]])
    return paths


def _distance(path: list[TreeJoint], joint: Joint) -> float:
    T = np.eye(4)
    for step in path:
        T = T @ step.pose
    differences = (T[:3, 3] - joint.translation, T[:3, :3] - joint.rotation, path[-1].axis - joint.axis)
    return float(max(np.abs(difference).max() for difference in differences))


def share_inertia(
    tree: UrdfTree, joints: list[TreeJoint], model: DrivenRobot, write: Callable[[str, Array, float], None]
) -> list[str]:
    """Write the inertia of every link whose group moved; the others of a group keep theirs, or a factor of theirs."""
    names, notes = {joint.name for joint in joints}, []
    for own, name in enumerate(link.name for link in model.described.links):
        if name not in model.composites:
            continue
        others = []
        for k, (carrier, pose) in enumerate(model.carriers[: len(joints)]):
            for link, T in carried(tree, joints[k].child, names) if carrier == own else ():
                theta = tree.links[link]
                if link != joints[own].child and theta is not None and np.any(theta):
                    others.append((link, theta, pose @ T))  # (10,); (4, 4)
        mine, factor = own_part(model.composites[name], [(theta, T) for _, theta, T in others])
        write(joints[own].child, mine, 1.0)
        for other, theta, _ in others if factor != 1.0 else ():
            write(other, factor * theta, factor)
        if others:
            notes.append(held_note(joints[own].child, [other for other, _, _ in others], factor))
    return notes
