"""The source: outside the models nobody asks which model one is, and nobody reads meaning into a parameter's name."""

from __future__ import annotations

import ast
import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import constraints
import excite
import regressors
import regressors.models
from regressors.models.model import RegressorModel

PACKAGES = [Path(package.__file__).parent for package in (regressors, constraints, excite)]
INSIDE = PACKAGES[0] / "models"
# patterns of files' names, of numbers and of text; none of them is given the name of a parameter
READ_BY_PATTERNS = {
    "regressors/numerical.py",
    "regressors/quantities.py",
    "regressors/readers/chain_ends.py",
    "regressors/readers/description_schema.py",
    "regressors/readers/dh_table.py",
    "regressors/readers/documents.py",
    "regressors/readers/xacro_expansion.py",
    "regressors/readers/xacro_expressions.py",
    "excite/cli/command.py",
    "excite/cli/messages.py",
    "excite/design/design_folder.py",
    "excite/design/executors/dask_cluster.py",
    "excite/design/start_results.py",
    "excite/export/models/plain_models.py",
    "excite/export/models/xml_copy.py",
    "excite/export/motions/motion_format.py",
    "excite/friction/plan/schedule.py",
    "excite/logs/guess/channels.py",
    "excite/logs/recordings/array_streams.py",
    "excite/logs/recordings/column_name.py",
    "excite/logs/recordings/text_table.py",
    "excite/storage/atomic.py",
    "excite/storage/migrations.py",
    "excite/tasks/friction_file.py",
    "excite/tasks/option.py",
    "excite/views/bars.py",
    "excite/views/drawings.py",
    "excite/views/figure_files.py",
    "excite/views/page_text.py",
    "excite/views/style.py",
}


def sources() -> Iterator[tuple[str, Path]]:
    for package in PACKAGES:
        for path in sorted(package.rglob("*.py")):
            yield path.relative_to(package.parent).as_posix(), path


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
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("isinstance", "issubclass"):
            asked = {getattr(part, "id", getattr(part, "attr", "")) for part in ast.walk(node.args[1])}
        elif isinstance(node, ast.Compare):
            asked = {getattr(part, "id", getattr(part, "attr", "")) for part in ast.walk(node)}
            asked |= {str(part.value) for part in ast.walk(node) if isinstance(part, ast.Constant)}
        else:
            continue
        if asked & classes:
            lines.append(node.lineno)
    return lines


def test_the_search_sees_what_it_is_to_see() -> None:
    classes = model_classes()
    assert {"RegressorModel", "WindowModel", "PartialModel", "DifferentialModel", "LoadIntegralModel"} <= classes
    for line in (
        "isinstance(x, EnergyModel)",
        "isinstance(x, int | load.LoadModel)",
        "type(x) is EnergyModel",
        "type(x).__name__ == 'EnergyModel'",
    ):
        assert kinds_asked_for(ast.parse(line), classes) == [1]
    assert kinds_asked_for(ast.parse("EnergyModel(robot).names == names and isinstance(x, int)"), {"LoadModel"}) == []


def test_outside_the_models_nobody_asks_which_model_one_is() -> None:
    classes = model_classes() - {"RegressorModel"}  # that something is a model may be asked
    found = {
        f"{name}:{line}"
        for name, path in sources()
        if INSIDE not in path.parents
        for line in kinds_asked_for(ast.parse(path.read_text(encoding="utf-8")), classes)
    }
    assert found == set()


def test_patterns_are_for_text_and_files_only() -> None:
    using = {
        name
        for name, path in sources()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Import) and any(alias.name == "re" for alias in node.names)
    }
    assert using == READ_BY_PATTERNS
