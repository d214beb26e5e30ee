"""Every message of the packages, found in their source: errors, notes, help texts, first lines of docstrings.

``python tests/builders/messages.py`` prints them, one per line with file and line, for whoever edits the words.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("regressors", "constraints", "excite")


@dataclass(frozen=True)
class Message:
    """A text that a user may read.

    Parameters
    ----------
    place : str
        File and line.
    kind : {"error", "text", "help", "docstring"}
    text : str
        With ``{}`` for what is filled in.
    """

    place: str
    kind: str
    text: str


def messages() -> list[Message]:
    """All messages of the packages, in the order of the files."""
    files = sorted(file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    return [message for file in files for message in _messages_of(file)]


def _messages_of(file: Path) -> Iterator[Message]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    nodes = list(ast.walk(tree))
    docstrings = set(_docstrings(nodes))
    kinds = _kinds(nodes)
    place = str(file.relative_to(ROOT))
    for node in nodes:
        if id(node) in docstrings:
            yield Message(f"{place}:{node.lineno}", "docstring", str(node.value).strip().splitlines()[0])  # type: ignore[attr-defined]
        elif id(node) in kinds and (text := _text(node)) is not None:
            yield Message(f"{place}:{node.lineno}", kinds[id(node)], text)  # type: ignore[attr-defined]


def _docstrings(nodes: list[ast.AST]) -> Iterator[int]:
    """Identities of the docstrings of a module and of its public classes and functions."""
    for node in nodes:
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            continue
        hidden = not isinstance(node, ast.Module) and node.name.startswith("_")
        if not hidden and ast.get_docstring(node) is not None:
            yield id(node.body[0].value)  # type: ignore[attr-defined]


def _kinds(nodes: list[ast.AST]) -> dict[int, str]:
    """Kinds of the texts in a tree, by identity; a text inside another one is part of that."""
    kinds: dict[int, str] = {}
    inside: set[int] = set()
    skipped = {id(node.body[0].value) for node in nodes if _documented(node)}  # type: ignore[attr-defined]

    def mark(node: ast.AST, kind: str) -> None:
        for part in ast.walk(node):
            if isinstance(part, ast.Constant | ast.JoinedStr) and id(part) not in inside:
                kinds.setdefault(id(part), kind)
                if isinstance(part, ast.JoinedStr):
                    inside.update(id(piece) for value in part.values for piece in _pieces(value))

    for node in nodes:
        if isinstance(node, ast.Raise) and node.exc is not None:
            mark(node.exc, "error")
        elif isinstance(node, ast.keyword) and node.arg in ("help", "epilog"):
            mark(node.value, "help")
    for node in nodes:
        if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and _sentence(node.value)):
            mark(node, "text")
    return {key: kind for key, kind in kinds.items() if key not in inside and key not in skipped}


def _documented(node: ast.AST) -> bool:
    places = ast.Module | ast.ClassDef | ast.FunctionDef
    return isinstance(node, places) and ast.get_docstring(node) is not None


def _pieces(value: ast.AST) -> Iterator[ast.AST]:
    """Constants of a formatted string itself; texts inside its braces are texts of their own."""
    if isinstance(value, ast.Constant):
        yield value
    elif isinstance(value, ast.FormattedValue) and value.format_spec is not None:
        yield from ast.walk(value.format_spec)


def _sentence(value: object) -> bool:
    return isinstance(value, str) and value.count(" ") >= 2


def _text(node: ast.AST) -> str | None:
    if isinstance(node, ast.JoinedStr):
        text = "".join(str(v.value) if isinstance(v, ast.Constant) else "{}" for v in node.values)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        text = node.value
    else:
        return None
    return text if any(letter.isalpha() for letter in text.replace("{}", "")) else None


if __name__ == "__main__":
    for message in messages():
        print(f"{message.place}: {message.kind}: {message.text!r}")
