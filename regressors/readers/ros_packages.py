"""Folders of ROS packages, found without ROS: by the search paths of its environment, and around a file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from regressors.errors import InputError

SEARCHED = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")  # variables of the environment


def find_package(name: str, near: Path, roots: Iterable[str | Path] = ()) -> Path:
    """Folder of a package.

    Looked through are, in this order, the roots given, those of ``ROS_PACKAGE_PATH``, ``share`` of the prefixes of
    ``AMENT_PREFIX_PATH``, and the folders that a file is in, the innermost first. A root is the package itself, holds
    it, or holds the repository that holds it.
    """
    for folder in _places(name, near, roots):
        if folder.is_dir():
            return folder.resolve()
    raise InputError(
        f"{near.name}: no folder of the package {name!r}, neither around the file nor in ROS_PACKAGE_PATH; set it to "
        "the folder that holds the package: export ROS_PACKAGE_PATH=FOLDER"
    )


def _places(name: str, near: Path, roots: Iterable[str | Path]) -> Iterator[Path]:
    for root in package_roots(roots):
        if root.resolve().name == name:
            yield root
        yield root / name
        if root.is_dir():
            yield from (folder / name for folder in sorted(root.iterdir()))
    for folder in near.resolve().parents:
        if folder.name == name:
            yield folder
        yield folder / name


def package_roots(roots: Iterable[str | Path] = ()) -> list[Path]:
    """Folders to look for packages in that the user named: those given, and those of the environment of ROS."""
    shares = (prefix / "share" for prefix in _paths(SEARCHED[1]))
    return [*map(Path, roots), *_paths(SEARCHED[0]), *shares]


def _paths(variable: str) -> list[Path]:
    return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]
