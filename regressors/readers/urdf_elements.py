"""Documents in XML that describe robots: their kind, their elements with their place in the file, and known words.

Read with the standard library's expat. A document type declaration is refused at its first byte, so no entity is ever
expanded. Of a URDF, what is not known is not read, so a misspelling of what matters is an error: ``<limits>`` would
make a joint unlimited.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

import numpy as np

from regressors.errors import Finding, InputError, TooLargeError, long_name, reading, shortened
from regressors.input_files import read_bytes
from regressors.robot.inertia import Array

_ELEMENTS = 100_000  # of a document
_NAMES = ("name", "joint", "link", "type")


@dataclass(eq=False)
class XmlElement:
    """An element with what it holds, and in whose name it complains: that of the link or joint that it is a part of."""

    source: str  # name of the file
    line: int
    label: str  # such as ``joint 'elbow'``
    tag: str  # with its prefix
    attributes: Mapping[str, str]
    children: list[XmlElement] = field(default_factory=list)

    def fail(self, message: str) -> NoReturn:
        """Raise `InputError` with the place in the file."""
        raise InputError(f"{self.source}, line {self.line}: {self.label}: {message}")

    def child(self, tag: str) -> XmlElement | None:
        """The one child of that tag, None where there is none."""
        children = [child for child in self.children if child.tag == tag]
        if len(children) > 1:
            children[1].fail(f"expected one <{tag}>, given {len(children)}")
        return children[0] if children else None

    def needed(self, tag: str) -> XmlElement:
        """The one child of that tag, which must be there."""
        child = self.child(tag)
        return child if child is not None else self.fail(f"<{tag}> is missing")

    def below(self, tag: str) -> Iterator[XmlElement]:
        """All children of that tag."""
        return (child for child in self.children if child.tag == tag)

    def all(self) -> Iterator[XmlElement]:
        """The element, and all that it holds, in the order of the document."""
        todo = [self]
        while todo:
            element = todo.pop()
            yield element
            todo.extend(reversed(element.children))

    def text(self, attribute: str) -> str:
        """An attribute that must be there, and be more than nothing."""
        value = self.attributes.get(attribute)
        if not value:
            self.fail(f"<{self.tag}> needs the attribute {attribute!r}")
        if not value.isprintable():  # a line break in a name would break messages and file headers
            self.fail(f"<{self.tag}> {attribute}: expected printable characters, given {shortened(value)}")
        if attribute in _NAMES and (wrong := long_name(value)) is not None:
            self.fail(f"<{self.tag}> {attribute}: {wrong}")
        return value

    def numbers(self, attribute: str, default: tuple[float, ...], *, infinite: bool = False) -> Array:
        """As many numbers as the default has; infinite ones only where they mean "no limit"."""
        text = self.attributes.get(attribute)
        if text is None:
            return np.array(default)
        words = text.split()
        values = [number_of(word) for word in words]
        usable = np.isfinite(values) | (infinite & ~np.isnan(values))
        if len(words) != len(default) or not np.all(usable):
            count = "a finite number" if len(default) == 1 else f"{len(default)} finite numbers"
            self.fail(f"<{self.tag}> {attribute}: expected {count}, given {text!r}; put in the robot's own values")
        return np.array(values)

    def number(self, attribute: str, default: float | None = None, *, infinite: bool = False) -> float:
        """One number; without a default the attribute must be there."""
        if default is None:
            self.text(attribute)
        return float(self.numbers(attribute, (default or 0.0,), infinite=infinite)[0])


def number_of(word: str) -> float:
    """Number that a word is, NaN where it is none."""
    try:
        return float("nan" if "_" in word else word)  # float() takes 1_0 for ten
    except ValueError:
        return float("nan")


def read_document(text: str | bytes, source: str) -> XmlElement:
    """Outermost element of an XML document."""
    count = text.count("<") if isinstance(text, str) else text.count(b"<")
    if count > 2 * _ELEMENTS:
        raise TooLargeError(
            f"{source}: it has about {count // 2} elements, more than the {_ELEMENTS} that a robot may have; remove "
            "those that are no part of it"
        )
    parser = expat.ParserCreate()
    top = XmlElement(source, 1, "<document>", "", {})
    open_elements = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        parent = open_elements[-1]
        label = parent.label if len(open_elements) > 2 else f"<{tag}>"
        if len(open_elements) == 2 and "name" in attributes:
            label = f"{tag} {shortened(attributes['name'])}"
        element = XmlElement(source, parser.CurrentLineNumber, label, tag, attributes)
        parent.children.append(element)
        open_elements.append(element)

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_elements.pop()
    parse_safely(parser, text, source)
    return top.children[0]


def parse_safely(parser: expat.XMLParserType, text: str | bytes, source: str) -> None:
    """Let a parser read a document, in which nothing may be declared."""

    def refuse(*_: object) -> None:
        raise InputError(
            f"{source}, line {parser.CurrentLineNumber}: a DOCTYPE or ENTITY declaration is refused; "
            "remove the declaration"
        )

    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise InputError(f"{source}, line {error.lineno}: not well-formed XML: {reason}") from error
    except InputError:
        raise
    except (LookupError, ValueError) as error:  # an encoding that Python or expat does not know
        raise InputError(f"{source}: cannot decode the text: {error}") from error


URDF, XACRO, MJCF = "URDF", "xacro", "MJCF"
_KINDS = {"robot": URDF, "mujoco": MJCF}


def xml_kind(path: str | Path) -> str:
    """Kind of description in an XML file.

    A name that ends in ``.xacro`` decides, then the outermost element. A text that breaks off, or whose outermost
    element is of no kind of robot, counts as URDF: the reader of URDF says what is wrong with it. So does one that
    holds xacro under another name: it is expanded only where its name, or the user, says so.
    """
    if Path(path).suffix.lower() == ".xacro":
        return XACRO
    with reading(repr(str(path))):
        content = read_bytes(path)
    tag, name = _outermost(content), Path(path).name
    if tag == "sdf":
        raise InputError(f"{name}: SDF is not read, expected URDF, xacro or MJCF; give the URDF that it was made from")
    if tag == "mujocoinclude":
        raise InputError(f"{name}: a part of an MJCF, expected a whole one; give the file that includes it")
    return _KINDS.get(tag, URDF)


def _outermost(content: bytes) -> str:
    """Outermost element; nothing where there is none."""
    tags: list[str] = []

    def decide(*given: object) -> None:  # nothing further down changes the answer, and no declaration is expanded
        tags.append(str(given[0]))
        raise StopIteration

    parser = expat.ParserCreate()
    parser.StartElementHandler = decide
    parser.StartDoctypeDeclHandler = lambda *_: decide("")
    with suppress(StopIteration, expat.ExpatError, LookupError, ValueError):
        parser.Parse(content, True)
    return tags[0] if tags else ""


_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
READ: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {  # by tag: children and attributes
    "robot": (("link", "joint"), ("name",)),
    "link": (("inertial",), ("name",)),
    "joint": (("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"), ("name", "type")),
    "inertial": (("origin", "mass", "inertia"), ()),
    "origin": ((), ("xyz", "rpy")),
    "mass": ((), ("value",)),
    "inertia": ((), _INERTIA),
    "parent": ((), ("link",)),
    "child": ((), ("link",)),
    "axis": ((), ("xyz",)),
    "limit": ((), ("lower", "upper", "velocity", "effort")),
    "dynamics": ((), ("damping", "friction")),
    "mimic": ((), ("joint", "multiplier", "offset")),
}
_KNOWN: Mapping[str, tuple[str, ...]] = {  # not needed here, though others are
    "robot": ("material", "gazebo", "transmission", "sensor", "ros2_control", "version"),
    "link": ("visual", "collision", "contact", "self_collision_checking", "type"),
    "joint": ("calibration", "safety_controller"),
}
_MANY = ("link", "joint")  # that may stand in a document more than once


def check_words(robot: XmlElement) -> tuple[Finding, ...]:
    """Findings on what is not known, once nothing that matters is misspelt."""
    unknown: dict[tuple[str, str], list[str]] = defaultdict(list)
    todo = [robot]
    for element in todo:
        todo.extend(child for child in element.children if child.tag in READ[element.tag][0])
        present = {child.tag for child in element.children} - set(_MANY)
        children = ((child, f"<{child.tag}>", child.tag, 0, present) for child in element.children)
        names = ((element, repr(name), name, 1, set(element.attributes)) for name in element.attributes)
        for where, shown, name, which, given in (*children, *names):
            known = READ[element.tag][which]
            if name not in known and (word := _unknown(where, shown, name, element.tag, which, given)):
                unknown[element.tag, word].append(element.label)
    places: dict[tuple[str, tuple[str, ...]], list[str]] = defaultdict(list)
    for (tag, word), labels in unknown.items():
        places[tag, tuple(dict.fromkeys(labels))].append(word)
    return tuple(_finding(tag, labels, words) for (tag, labels), words in places.items())


def _unknown(element: XmlElement, shown: str, word: str, parent: str, which: int, present: set[str]) -> str | None:
    """An unknown tag or attribute in words, None for one that is known; a misspelling is refused."""
    known = _KNOWN.get(parent, ())
    if word in known or word.startswith("xmlns"):
        return None
    if ":" in word:
        local = word.rpartition(":")[2] in READ[parent][which]
        return f"{shown} (it would be read without its prefix)" if local else shown
    meant = nearest(word, READ[parent][which])
    if meant is not None and meant not in present:
        asked = f"<{meant}>" if which == 0 else repr(meant)
        element.fail(f"<{parent}> has no {shown}; did you mean {asked}? Correct it, or remove it")
    near = nearest(word, known)
    return shown if near is None else f"{shown} (did you mean {near!r}?)"


def _finding(tag: str, labels: tuple[str, ...], words: list[str]) -> Finding:
    others = f" and {len(labels) - 1} more" if len(labels) > 1 else ""
    return Finding("found", f"{labels[0]}{others}", f"not known in <{tag}>, and not read: {', '.join(words)}")


def nearest(word: str, candidates: Iterable[str]) -> str | None:
    """Candidate that a word is a misspelling of: one edit away, or two from candidates of five letters or more."""
    distances = {candidate: edits(word.lower(), candidate.lower()) for candidate in candidates}
    close = {candidate: d for candidate, d in distances.items() if d <= (1 if len(candidate) < 5 else 2)}
    return min(close, key=lambda candidate: close[candidate]) if close else None


def edits(a: str, b: str) -> int:
    """Insertions, deletions, substitutions and swaps that lead from one word to another [Damerau 1964]."""
    before: list[int] = []
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        following = [i]
        for j, y in enumerate(b, 1):
            cost = min(row[j] + 1, following[-1] + 1, row[j - 1] + (x != y))
            if i > 1 and j > 1 and x == b[j - 2] and a[i - 2] == y:
                cost = min(cost, before[j - 2] + 1)
            following.append(cost)
        before, row = row, following
    return row[-1]


_FORMATS: Mapping[str, str] = {
    "mujoco": "a MuJoCo model (MJCF), not a URDF; `load_robot` reads its file",
    "sdf": "an SDF model, which is not read here; give the URDF of the same robot, from which most SDF files are made",
    "world": "an SDF world, which is not read here; give the URDF of the robot",
    "COLLADA": "a COLLADA mesh, not a robot; give the URDF that names it",
}


def robot_element(text: str | bytes, source: str) -> XmlElement:
    """Outermost element of a URDF document; any other document is refused, saying what it is and what to do."""
    outermost = read_document(text, source)
    if outermost.tag in _FORMATS:
        outermost.fail(_FORMATS[outermost.tag])
    macro = next((element for element in outermost.all() if _is_macro(element)), None)
    if macro is not None:
        where = "a xacro macro" if macro.tag.startswith("xacro:") else "an expression of xacro"
        macro.fail(
            f"{where}: the text is a template, which is not expanded by its content alone; rename the file to "
            f"{macro.source.removesuffix('.urdf').removesuffix('.xml')}.urdf.xacro, or give `xacro=True`, if you trust "
            "whom it is from"
        )
    if outermost.tag != "robot":
        outermost.fail("expected <robot> as the outermost element, as of a URDF")
    return outermost


def _is_macro(element: XmlElement) -> bool:
    expression = any("${" in value or "$(" in value for value in element.attributes.values())
    return element.tag.startswith("xacro:") or (element.tag in READ and expression)  # files of meshes may have both
