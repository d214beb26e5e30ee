"""The source: outside the models nobody asks which model one is, and nobody reads meaning into a parameter's name."""

from __future__ import annotations

import ast
import importlib
import pkgutil
from functools import cache
from pathlib import Path

import constraints
import excite
import regressors
import regressors.models
from regressors.models.model import RegressorModel

PACKAGES = [Path(package.__file__).parent for package in (regressors, constraints, excite)]
INSIDE = PACKAGES[0] / "models"
PARAMETERS = ("regressors.models", "excite.identification", "excite.study")  # where parameters have their names
PATTERNS_OF_FILES = {"excite/export/models/plain_models.py"}  # of names of files and links, not of parameters


@cache
def sources() -> dict[str, ast.Module]:
    """Every file of the packages."""
    paths = [path for package in PACKAGES for path in sorted(package.rglob("*.py"))]
    return {path.relative_to(INSIDE.parents[1]).as_posix(): ast.parse(path.read_text("utf-8")) for path in paths}


def model_classes() -> set[str]:
    for module in pkgutil.iter_modules(regressors.models.__path__):
        importlib.import_module(f"regressors.models.{module.name}")
    classes, new = set(), {RegressorModel}
    while new:
        classes |= new
        new = {sub for cls in new for sub in cls.__subclasses__() if sub.__module__.startswith("regressors.")} - classes
    return {cls.__name__ for cls in classes}


def kinds_asked_for(tree: ast.AST, classes: set[str]) -> list[int]:
    """Lines that ask whether something is of one of the classes, or compare its type or the type's name."""
    lines = []
    for node in ast.walk(tree):
        parts: list[ast.AST] = list(ast.walk(node)) if isinstance(node, ast.Compare) else []
        asked = {str(part.value) for part in parts if isinstance(part, ast.Constant)}
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("isinstance", "issubclass"):
            parts = list(ast.walk(node.args[1]))
        if (asked | {getattr(part, "id", getattr(part, "attr", "")) for part in parts}) & classes:
            lines.append(node.lineno)
    return lines


def test_the_search_sees_what_it_is_to_see() -> None:
    classes = model_classes()
    assert {"RegressorModel", "WindowModel", "PartialModel", "DifferentialModel", "LoadIntegralModel"} <= classes
    asked = ("isinstance(x, EnergyModel)", "isinstance(x, int | load.LoadModel)", "type(x).__name__ == 'EnergyModel'")
    assert [kinds_asked_for(ast.parse(line), classes) for line in asked] == [[1]] * 3
    assert kinds_asked_for(ast.parse("EnergyModel(robot).names == names and isinstance(x, int)"), {"LoadModel"}) == []


def test_outside_the_models_nobody_asks_which_model_one_is() -> None:
    classes = model_classes() - {"RegressorModel"}  # that something is a model may be asked
    outside = {name: tree for name, tree in sources().items() if not name.startswith("regressors/models/")}
    assert [f"{name}:{line}" for name, tree in outside.items() for line in kinds_asked_for(tree, classes)] == []


def test_who_knows_parameters_reads_no_patterns() -> None:
    """Files that import `re` take nothing from the rooms of models and estimates."""
    both = set()
    for name, tree in sources().items():
        imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
        taken = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        if any(alias.name == "re" for node in imports for alias in node.names):
            both |= {name for module in taken if module.startswith(PARAMETERS)}
    assert both == PATTERNS_OF_FILES
