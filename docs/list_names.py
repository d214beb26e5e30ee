"""Write what each public name is into docs/reference/names.md, by its docstring: ``python docs/list_names.py``.

Names and examples are typed there; a test runs the examples, and compares names and sentences.
"""

from __future__ import annotations

import re
from pathlib import Path

import excite

PAGE = Path(__file__).resolve().parent / "reference" / "names.md"
ROW = re.compile(r"^\| `(?P<name>\w+)` \| (?P<sentence>.*?) \| (?P<example>.*) \|$", re.MULTILINE)


def sentence(name: str) -> str:
    """First sentence of the docstring of a public name, for a cell of a table."""
    paragraph = " ".join((getattr(excite, name).__doc__ or "").strip().split("\n\n")[0].split())
    return re.split(r"(?<=\.) (?=[A-Z])", paragraph)[0].replace("|", r"\|").replace("``", "`")


def filled(text: str) -> str:
    """Text of the page with all sentences as they are now."""
    return ROW.sub(lambda row: f"| `{row['name']}` | {sentence(row['name'])} | {row['example']} |", text)


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
