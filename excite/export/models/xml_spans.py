"""Edits of an XML document in place: every byte outside of what is changed stays as it is.

The standard library's expat gives the offset of every tag; attributes are found in the bytes of the tag.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat
from xml.sax.saxutils import escape

from regressors.errors import InputError

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
    parent: XmlSpan | None = None
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
            parent = opened[-1] if opened else None
            element = XmlSpan(tag, attributes, at, self._after_tag(at, tag), parent=parent)
            (parent.children if parent else roots).append(element)
            opened.append(element)

        def end(_: str) -> None:
            element, at = opened.pop(), parser.CurrentByteIndex
            if self.content[element.inner - 2 : element.inner] == b"/>":
                element.close = element.end = element.inner
            else:
                element.close, element.end = at, self.content.index(b">", at) + 1

        def refuse(*_: object) -> None:
            raise InputError(f"{self.source}: a DOCTYPE declaration is refused; remove it")

        parser.StartDoctypeDeclHandler = refuse
        parser.XmlDeclHandler = declared
        parser.StartElementHandler, parser.EndElementHandler = begin, end
        try:
            parser.Parse(self.content, True)
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            raise InputError(f"{self.source}, line {error.lineno}: not well-formed XML: {reason}") from error
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

    def insert_in(self, element: XmlSpan, text: str, *, first: bool = False) -> None:
        """Insert lines into an element, indented as its children are, before its end or behind its start tag."""
        indent = self.indent_of(element.children[0]) if element.children else self.indent_of(element) + "  "
        lines = "".join(f"\n{indent}{line}" for line in text.split("\n"))
        if element.empty:
            slash = self.content.rindex(b"/", element.begin, element.inner)
            closed = self.bytes_of(f">{lines}\n{self.indent_of(element)}</{element.tag}>")
            self._edits.append((slash, element.inner, closed))
            return
        at = element.inner
        if not first:
            at = max((child.end for child in element.children), default=element.inner)
        after = "" if element.children else f"\n{self.indent_of(element)}"
        stay = self.content[at : element.close].strip() or b"\n" in self.content[at : element.close]
        self._edits.append((at, at, self.bytes_of(lines + ("" if stay else after))))

    def replace_tag(self, element: XmlSpan, text: str) -> None:
        """Replace the start tag of an element, or the whole of one without content."""
        self._edits.append((element.begin, element.inner, self.bytes_of(text)))

    def insert_before(self, element: XmlSpan, text: str) -> None:
        """Insert lines in front of an element."""
        self._edits.append((element.begin, element.begin, self.bytes_of(f"{text}\n{self.indent_of(element)}")))

    def indent_of(self, element: XmlSpan) -> str:
        """White space before an element in its line; empty where something else is there."""
        start = self.content.rfind(b"\n", 0, element.begin) + 1
        before = self.content[start : element.begin]
        return before.decode("ascii") if not before.strip(b" \t") else ""

    def edited(self) -> bytes:
        """The document with all edits."""
        parts, place = [], 0
        for begin, stop, new in sorted(self._edits, key=lambda edit: edit[:2]):
            parts += [self.content[place:begin], new]
            place = stop
        return b"".join([*parts, self.content[place:]])
