"""A file of the user's in XML with the parameters of a model written into it."""

from __future__ import annotations

from dataclasses import dataclass

from excite.export.models.xml_spans import XmlDocument
from excite.export.models.xml_text import comment


@dataclass(frozen=True, eq=False)
class XmlCopy:
    """A user's URDF or MJCF with the parameters of a model to be written into it."""

    document: XmlDocument
    notes: tuple[str, ...]

    def content(self, lines: tuple[str, ...]) -> bytes:
        """The edited file, with a comment in front of its outermost element."""
        self.document.insert_before(self.document.root, comment(lines))
        return self.document.edited()
