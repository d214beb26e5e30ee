"""Other distributions whose files are in the folders of our packages: PyPI has some of the same names.

pip overwrites files of one distribution by those of another without a word, in either order, and removes files that
another one needs as well. This module is complete by itself, so that it costs nothing.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

DISTRIBUTION = "excite-trajectories"
_PACKAGES = ("constraints", "regressors")
_METADATA = (".dist-info", ".egg-info")


def _names_beside(folder: str) -> bool:
    """Whether the folder has the metadata of a distribution that is called like one of our packages."""
    try:
        entries = os.listdir(folder)
    except OSError:  # packages in an archive, or frozen into a program
        return False
    names = (entry.lower() for entry in entries if entry.lower().endswith(_METADATA))
    return any(name.startswith(_PACKAGES) for name in names)


def _owners(folder: str) -> Iterator[tuple[str, str, str]]:
    """Name, version and package of other distributions that put files into our packages in this folder."""
    from importlib.metadata import distributions

    for each in distributions(path=[folder]):
        name = each.metadata["Name"] or ""
        if not name.lower().startswith(_PACKAGES):
            continue
        tops = {file.parts[0] for file in each.files or ()}
        for package in _PACKAGES:
            if package in tops:
                yield name, each.version, package


def check_neighbours() -> None:
    """Refuse to run where another distribution's files are among ours."""
    folder = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    if not _names_beside(folder):
        return
    for name, version, package in _owners(folder):
        raise ImportError(
            f"The distribution `{name}` {version} and `{DISTRIBUTION}` both have the package `{package}`, and have "
            f"overwritten each other's files in {os.path.join(folder, package)}. Install `{DISTRIBUTION}` into a "
            f"virtual environment of its own, or run `python -m pip uninstall {name}` and then `python -m pip install "
            f"--force-reinstall --no-deps {DISTRIBUTION}` (if you installed a file or folder, name that).",
            name=DISTRIBUTION,
            path=folder,
        )
