"""Names of classes: a public one stands for one thing in the whole of its package."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize("package", ["regressors", "constraints", "excite"])
def test_public_class_names_stand_for_one_class(package: str) -> None:
    paths = defaultdict(list)
    for path in sorted((ROOT / package).rglob("*.py")):
        for statement in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(statement, ast.ClassDef) and not statement.name.startswith("_"):
                paths[statement.name].append(str(path.relative_to(ROOT)))
    assert {name: places for name, places in paths.items() if len(places) > 1} == {}
