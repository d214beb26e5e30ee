"""Measure how large the house is: ``python docs/measure_house.py`` writes the table into docs/architecture.md.

Code is what is neither blank, a comment, a docstring nor an import. Bounds only fall: what is added replaces something.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
PRODUCT = ("excite", "regressors", "constraints")
BOUNDS = {
    "lines": 85_259,
    "lines of code": 51_848,
    "files": 483,
    "classes": 764,
    "public names": 95,
    "blocks of `TYPE_CHECKING`": 27,
    "imports inside functions": 141,
    "look-ups of built-in parts by name": 17,
    "lines of code of tests": 42_456,
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


def _public_names() -> int:
    tree = ast.parse((ROOT / "excite" / "__init__.py").read_text(encoding="utf-8"))
    listed = next(
        node.value for node in tree.body if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
    )
    return len(ast.literal_eval(listed))


def main() -> None:
    """Write the table."""
    rows = [f"| {name} | {count:,} | {BOUNDS[name]:,} |" for name, count in measured().items()]
    table = "\n".join(("| | is | at most |", "|---|---|---|", *rows)) + "\n"
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(_TABLE.sub(lambda match: match[1] + table + match[2], text), encoding="utf-8")


if __name__ == "__main__":
    main()
