"""Elements of a URDF document with their place in the file.

Reads with the standard library's expat. A document type declaration is refused at its first byte, so no entity is
ever expanded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NoReturn
from xml.parsers import expat

import numpy as np

from regressors.errors import InputError, TooLargeError
from regressors.quoting import long_name, shortened
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
        values = [_number(word) for word in words]
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


def _number(word: str) -> float:
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
