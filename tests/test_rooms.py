"""The rooms of the source: tests mirror them, and a module's name says which module it is."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("regressors", "constraints", "excite")


def folders(top: Path) -> set[str]:
    """Paths below a folder of the folders that hold Python files, or folders with such files."""
    return {
        str(folder.relative_to(top))
        for file in top.rglob("*.py")
        for folder in file.parents
        if folder.is_relative_to(top) and folder != top
    }


@pytest.mark.parametrize("package", PACKAGES)
def test_folders_of_tests_are_rooms_of_the_source(package: str) -> None:
    assert sorted(folders(ROOT / "tests" / package) - folders(ROOT / package)) == []


@pytest.mark.parametrize("package", PACKAGES)
def test_module_names_stand_for_one_module(package: str) -> None:
    paths = defaultdict(list)
    for path in sorted((ROOT / package).rglob("*.py")):
        paths[path.stem].append(str(path.relative_to(ROOT)))
    del paths["__init__"]
    assert [same_name for same_name in paths.values() if len(same_name) > 1] == []
