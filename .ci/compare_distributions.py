"""Files of the distributions: ``compare_distributions.py CHECKOUT WHEEL WHEEL_OF_CHECKOUT SDIST``.

The wheel that is built from the sdist must be the one that is built from the checkout, hold every file of the three
packages that git knows, and nothing else; the sdist must hold what tests and documents need.
"""

from __future__ import annotations

import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterable
from pathlib import Path

PACKAGES = ("excite", "regressors", "constraints")
LICENCES = ("LICENSE", "excite/views/page/three.LICENSE")
ALSO_IN_SDIST = (
    "tests",
    "docs",
    "benchmarks",
    "LICENSE",
    "README.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "pyproject.toml",
)


def contents(wheel: str) -> dict[str, bytes]:
    """Names and contents of the files of a wheel."""
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def differences(expected: Iterable[str], actual: Iterable[str], of: str) -> list[str]:
    """What is missing, and what is too much."""
    missing, further = sorted({*expected} - {*actual}), sorted({*actual} - {*expected})
    return [f"{of}: {name} is missing" for name in missing] + [f"{of}: {name} is too much" for name in further]


def problems(checkout: Path, wheel: str, of_checkout: str, sdist: str) -> list[str]:
    """Sentences on what is not as it should be."""
    files, again = contents(wheel), contents(of_checkout)
    found = differences(again, files, "wheel of the sdist")
    found += [f"{name} differs between the two wheels" for name in files if files[name] != again.get(name)]
    listed = subprocess.run(["git", "ls-files", *PACKAGES], cwd=checkout, check=True, capture_output=True, text=True)
    known = {name for name in listed.stdout.splitlines() if (checkout / name).exists()}
    found += differences(known, (name for name in files if ".dist-info/" not in name), "wheel")
    licences = {name.partition(".dist-info/licenses/")[2] for name in files} - {""}
    found += differences(LICENCES, licences, "licences of the wheel")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    for name in (*ALSO_IN_SDIST, *known):
        if not any(each == name or each.startswith(f"{name}/") for each in names):
            found.append(f"sdist: {name} is missing")
    return found


if __name__ == "__main__":
    root, *archives = sys.argv[1:]
    wrong = problems(Path(root), *archives)
    print("\n".join(wrong) or "the wheels are equal, and hold what the checkout has")
    sys.exit(bool(wrong))
