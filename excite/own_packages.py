"""Whether Python finds our `regressors` and `constraints`: other distributions and files have these names too."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec

DISTRIBUTION = "excite-trajectories"
_HERE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_AGAIN = (
    f"`python -m pip install --force-reinstall --no-deps {DISTRIBUTION}` (if you installed a file or folder, name that)"
)


def _place(package: str) -> str | None:
    """File or folder that Python imports a package from, or none if there is no such package."""
    spec = find_spec(package)
    if spec is None:
        return None
    return spec.origin or next(iter(spec.submodule_search_locations or ()), None)


def _owners(package: str, folder: str) -> Iterator[str]:
    """Names of other distributions in a folder that have a package of this name."""
    from importlib.metadata import distributions

    for each in distributions(path=[folder]):
        name = each.metadata["Name"] or ""
        ours = name.lower().replace("_", "-") == DISTRIBUTION
        if not ours and any(file.parts[0] in (package, f"{package}.py") for file in each.files or ()):
            yield name


def _explanation(package: str) -> str:
    """What is in the place of a package, and how to remove it."""
    place = _place(package)
    if place is None:
        return f"The package `{package}` of `{DISTRIBUTION}` is not in {_HERE} any more. Run {_AGAIN}."
    top = place if os.path.isdir(place) else os.path.dirname(place)
    folder = os.path.dirname(top) if os.path.basename(top) == package else top
    among_ours = folder == _HERE
    for name in _owners(package, folder):
        mended = f" and then {_AGAIN}" if among_ours else ""
        return (
            f"The distribution `{name}` has a package `{package}` too, in {folder}, and Python finds that one in place "
            f"of the package of `{DISTRIBUTION}`. Install `{DISTRIBUTION}` into a virtual environment of its own, or "
            f"run `python -m pip uninstall {name}`{mended}."
        )
    if among_ours:
        return (
            f"The package `{package}` of `{DISTRIBUTION}` in {folder} has lost files, or they are those of another "
            f"distribution: another one of that name was installed or uninstalled. Run {_AGAIN}."
        )
    return (
        f"Python finds {place} in place of the package `{package}` of `{DISTRIBUTION}` in {_HERE}. Rename it, or start "
        "Python in another folder."
    )


def check_packages() -> None:
    """Refuse to run with packages of others in place of ours."""
    for package in ("regressors", "constraints"):
        try:
            of = getattr(import_module(package), "DISTRIBUTION", None)
        except Exception as error:  # whatever another package of that name raises
            if getattr(error, "name", None) == DISTRIBUTION:
                raise
            raise ImportError(_explanation(package), name=DISTRIBUTION, path=_HERE) from error
        if of != DISTRIBUTION:
            raise ImportError(_explanation(package), name=DISTRIBUTION, path=_HERE)
