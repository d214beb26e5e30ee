"""Other distributions with packages named `regressors` or `constraints`: a sentence at import, in whatever order."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from commands import ENVIRONMENT, run_process

ROOT = Path(__file__).resolve().parents[1]
NEEDED = {  # by `import excite`
    name: (ROOT / name).read_text(encoding="utf-8")
    for name in (
        "excite/__init__.py",
        "excite/own_packages.py",
        "constraints/__init__.py",
        "regressors/__init__.py",
        "regressors/errors.py",
    )
}
NOT_HERE = {key: value for key, value in ENVIRONMENT.items() if key not in ("PYTHONPATH", "PYTHONHOME")}


def written(folder: Path, files: Mapping[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def error_of(python: str, package: str, *paths: Path, cwd: Path) -> str:
    """Last line that importing a package printed on stderr, empty if it was imported."""
    code = f"import sys; sys.path[:0] = {[str(path) for path in paths]!r}; import {package}"
    ended = run_process([python, "-S", "-c", code] if paths else [python, "-c", code], cwd, NOT_HERE)
    return ended.stderr.strip().splitlines()[-1] if ended.returncode else ""


@pytest.mark.parametrize("package", ["excite", "constraints", "regressors"])
def test_packages_are_imported_where_nothing_is_in_the_way(package: str, tmp_path: Path) -> None:
    folder = written(tmp_path / "site", NEEDED | {"other/__init__.py": "", "numpy/__init__.py": ""})
    assert error_of(sys.executable, package, folder, cwd=tmp_path) == ""


OTHER = "import statsmodels\n"  # which is not there
CASES: dict[str, dict[str, str | None]] = {
    "fails itself": {"regressors/__init__.py": OTHER},
    "for another Python": {"regressors/__init__.py": "print 'two'\n"},
    "overwritten": {"regressors/__init__.py": ""},
    "constraints": {"constraints/__init__.py": ""},
    "gone": {"constraints/__init__.py": None, "constraints/a.py": ""},
    "removed below": {"regressors/__init__.py": None},
    "nothing is left": {name: None for name in NEEDED if "constraints" in name},
}


@pytest.mark.parametrize("case", CASES)
def test_excite_says_what_is_in_place_of_its_packages(case: str, tmp_path: Path) -> None:
    files = {name: text for name, text in (NEEDED | CASES[case]).items() if text is not None}
    folder, package = written(tmp_path / "site", files), next(iter(CASES[case])).partition("/")[0]
    error = error_of(sys.executable, "excite", folder, cwd=tmp_path)
    place = {"nothing is left": "nothing", "gone": folder / package, "removed below": folder / package}
    found = place.get(case, folder / package / "__init__.py")
    assert error.startswith(f"ImportError: Python finds {found} in place of the package `{package}` of `excite-traj")
    assert "`python -m pip install --force-reinstall --no-deps excite-trajectories`" in error


def test_a_file_of_the_users_in_the_way_is_named(tmp_path: Path) -> None:
    mine = written(tmp_path / "mine", {"constraints.py": "LIMIT = 3\n"})
    error = error_of(sys.executable, "excite", mine, written(tmp_path / "site", NEEDED), cwd=tmp_path)
    assert f"Python finds {mine / 'constraints.py'} in place of the package `constraints`" in error


def test_constraints_alone_names_the_package_that_it_misses(tmp_path: Path) -> None:
    folder = written(tmp_path / "site", NEEDED | {"regressors/__init__.py": OTHER})
    error = error_of(sys.executable, "constraints", folder, cwd=tmp_path)
    assert error.startswith("ImportError: The package `regressors` that Python finds is not that of `excite-traj")
