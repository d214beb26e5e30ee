"""XML that is written: elements with their attributes, escaped, and comments."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.sax.saxutils import quoteattr


def start(tag: str, attributes: Mapping[str, str], *, empty: bool = False) -> str:
    """Start tag, or a whole element without content."""
    shown = "".join(f" {name}={quoteattr(value)}" for name, value in attributes.items())
    return f"<{tag}{shown}{'/' if empty else ''}>"


def comment(lines: Iterable[str]) -> str:
    """Comment of several lines; two hyphens, which no comment may hold, are set apart."""
    body = "\n".join(f"  {line}".replace("--", "- -").replace("--", "- -") for line in lines)
    return f"<!--\n{body}\n-->"
