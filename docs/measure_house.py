"""Measure how large the house is: ``python docs/measure_house.py`` writes the table into docs/architecture.md.

Code is what is neither blank, a comment, a docstring nor an import at the top; a room is a folder of a package. Bounds
only fall: what is added replaces something.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
PRODUCT = ("excite", "regressors", "constraints")
BOUNDS = {
    "lines": 86_070,
    "lines of code": 52_941,
    "files": 394,
    "classes": 704,
    "public names": 95,
    "blocks of `TYPE_CHECKING`": 17,
    "imports inside functions": 59,
    "look-ups of built-in parts by name": 19,
    "lines of code of tests": 37_705,
    "rooms": 22,
    "floors of rooms": 11,
    "arrows between rooms": 141,
}
_TABLE = re.compile(r"(<!-- size -->\n).*?(<!-- end of size -->)", re.DOTALL)


def measured() -> dict[str, int]:
    """What there is of each."""
    files = [path for package in PRODUCT for path in sorted((ROOT / package).rglob("*.py"))]
    texts = [path.read_text(encoding="utf-8") for path in files]
    trees = [ast.parse(text) for text in texts]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    tests = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "tests").rglob("*.py"))]
    counts = (
        sum(len(text.splitlines()) for text in texts),
        sum(map(_code, texts)),
        len(files),
        sum(isinstance(node, ast.ClassDef) for node in nodes),
        _public_names(),
        sum(isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test) for node in nodes),
        sum(map(_deferred, trees)),
        sum(isinstance(node, ast.Call) and ast.unparse(node.func) == "built_in" for node in nodes),
        sum(map(_code, tests)),
        *_rooms(files, trees),
    )
    return dict(zip(BOUNDS, counts, strict=True))


def _code(text: str) -> int:
    """Lines of a file that are code."""
    tree, lines = ast.parse(text), text.splitlines()
    others = {k for k, line in enumerate(lines, 1) if not line.strip() or line.strip().startswith("#")}
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                others |= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            others |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines) - len(others)


def _deferred(tree: ast.Module) -> int:
    """Imports inside functions."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return len({id(part) for f in functions for part in ast.walk(f) if isinstance(part, ast.Import | ast.ImportFrom)})


def _rooms(files: list[Path], trees: list[ast.Module]) -> tuple[int, int, int]:
    """Rooms, the length of the longest chain of them, and pairs of rooms of which one imports the other."""
    arrows = {room: set[str]() for file in files if (room := _room(file.relative_to(ROOT).with_suffix("").parts))}
    for file, tree in zip(files, trees, strict=True):
        room = _room(file.relative_to(ROOT).with_suffix("").parts)
        arrows.get(room, set()).update({_room(tuple(name.split("."))) for name in _imported(tree)} - {room, ""})
    floors: dict[str, int] = {}
    for room in TopologicalSorter(arrows).static_order():
        floors[room] = 1 + max((floors[below] for below in arrows[room]), default=0)
    return len(arrows), max(floors.values()), sum(map(len, arrows.values()))


def _room(parts: tuple[str, ...]) -> str:
    """Folder of a package that a module is in; a package without folders is a room, modules beside folders are none."""
    if parts[0] == "constraints":
        return parts[0]
    return ".".join(parts[:2]) if len(parts) > 1 and (ROOT / parts[0] / parts[1]).is_dir() else ""


def _imported(tree: ast.Module) -> Iterator[str]:
    """Modules that are imported anywhere in a module, also inside functions and for annotations only."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module is not None and node.module.split(".")[0] in PRODUCT:
            yield from (f"{node.module}.{part.name}" for part in node.names)


def _public_names() -> int:
    tree = ast.parse((ROOT / "excite" / "__init__.py").read_text(encoding="utf-8"))
    assigned = {ast.unparse(node.targets[0]): node.value for node in tree.body if isinstance(node, ast.Assign)}
    return sum(len(names.split()) for names in ast.literal_eval(assigned["_NAMES"]).values())


def main() -> None:
    """Write the table."""
    rows = [f"| {name} | {count:,} | {BOUNDS[name]:,} |" for name, count in measured().items()]
    table = "\n".join(("| | is | at most |", "|---|---|---|", *rows)) + "\n"
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(_TABLE.sub(lambda match: match[1] + table + match[2], text), encoding="utf-8")


if __name__ == "__main__":
    main()
