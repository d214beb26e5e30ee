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


def metadata(name: str, files: Mapping[str, str]) -> dict[str, str]:
    """Metadata of an installed distribution with these files, by their names."""
    info = f"{name}-1.2.dist-info"
    record = "".join(f"{file},,\n" for file in (*files, f"{info}/METADATA", f"{info}/RECORD"))
    return {
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: tests\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/RECORD": record,
    }


def error_of(python: str, package: str, *paths: Path, cwd: Path) -> str:
    """Last line that importing a package printed on stderr, empty if it was imported."""
    code = f"import sys; sys.path[:0] = {[str(path) for path in paths]!r}; import {package}"
    ended = run_process([python, "-S", "-c", code] if paths else [python, "-c", code], cwd, NOT_HERE)
    return ended.stderr.strip().splitlines()[-1] if ended.returncode else ""


@pytest.mark.parametrize("package", ["excite", "constraints", "regressors"])
def test_packages_are_imported_where_nothing_is_in_the_way(package: str, tmp_path: Path) -> None:
    others = metadata("constraints-of-others", {"other/__init__.py": ""}) | metadata("numpy", {"numpy/__init__.py": ""})
    folder = written(tmp_path / "site", NEEDED | metadata("excite-trajectories", NEEDED) | others)
    assert error_of(sys.executable, package, folder, cwd=tmp_path) == ""


OVERWRITTEN = "ImportError: The distribution `{0}` has a package `{0}` too, in SITE, and Python finds"
LOST = "ImportError: The package `{0}` of `excite-trajectories` in SITE has lost files"
OTHER = "import statsmodels\n"  # which is not there
CASES = [
    pytest.param({"regressors/__init__.py": OTHER}, "regressors", OVERWRITTEN, id="fails itself"),
    pytest.param({"regressors/__init__.py": "print 'two'\n"}, "regressors", OVERWRITTEN, id="for another Python"),
    pytest.param({"regressors/__init__.py": ""}, "regressors", OVERWRITTEN, id="overwritten"),
    pytest.param({"constraints/__init__.py": ""}, "constraints", OVERWRITTEN, id="constraints"),
    pytest.param({"regressors/__init__.py": ""}, None, LOST.format("regressors"), id="no metadata"),
    pytest.param(
        {"constraints/__init__.py": None, "constraints/a.py": ""}, None, LOST.format("constraints"), id="gone"
    ),
    pytest.param({"regressors/__init__.py": None}, None, LOST.format("regressors"), id="removed below"),
]


@pytest.mark.parametrize(("changes", "distribution", "expected"), CASES)
def test_excite_says_what_is_in_its_place(
    changes: dict[str, str | None], distribution: str | None, expected: str, tmp_path: Path
) -> None:
    files = {name: text for name, text in (NEEDED | changes).items() if text is not None}
    others = metadata(distribution, dict.fromkeys(changes, "")) if distribution else {}
    folder = written(tmp_path / "site", files | metadata("excite-trajectories", NEEDED) | others)
    error = error_of(sys.executable, "excite", folder, cwd=tmp_path)
    assert error.startswith(expected.format(distribution).replace("SITE", str(folder)))
    assert "`python -m pip install --force-reinstall --no-deps excite-trajectories`" in error
    assert distribution is None or f"`python -m pip uninstall {distribution}` and then" in error


def test_nothing_is_left_of_a_package(tmp_path: Path) -> None:
    folder = written(tmp_path / "site", {name: text for name, text in NEEDED.items() if "constraints" not in name})
    error = error_of(sys.executable, "excite", folder, cwd=tmp_path)
    assert error.startswith(f"ImportError: The package `constraints` of `excite-trajectories` is not in {folder} any")


def test_a_file_of_the_users_in_the_way_is_named(tmp_path: Path) -> None:
    mine = written(tmp_path / "mine", {"constraints.py": "LIMIT = 3\n"})
    folder = written(tmp_path / "site", NEEDED)
    error = error_of(sys.executable, "excite", mine, folder, cwd=tmp_path)
    finds = f"Python finds {mine / 'constraints.py'} in place of the package `constraints` of `excite-trajectories`"
    assert error == f"ImportError: {finds} in {folder}. Rename it, or start Python in another folder."


def test_another_distribution_elsewhere_needs_no_second_installation(tmp_path: Path) -> None:
    theirs = {"regressors/__init__.py": ""}
    first = written(tmp_path / "first", theirs | metadata("regressors", theirs))
    folder = written(tmp_path / "site", NEEDED)
    error = error_of(sys.executable, "excite", first, folder, cwd=tmp_path)
    assert f"in {first}, and Python finds that one" in error
    assert error.endswith("or run `python -m pip uninstall regressors`.")


def test_constraints_alone_names_the_package_that_it_misses(tmp_path: Path) -> None:
    folder = written(tmp_path / "site", NEEDED | {"regressors/__init__.py": OTHER})
    error = error_of(sys.executable, "constraints", folder, cwd=tmp_path)
    assert error.startswith("ImportError: The package `regressors` that Python finds is not that of `excite-traj")
