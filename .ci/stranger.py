"""A stranger's script, run with the installed distribution and checked by mypy: ``stranger.py REPORT.html``."""

from __future__ import annotations

import importlib
import pkgutil
import sys
from importlib.metadata import metadata, version
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

import constraints
import excite
import regressors

PACKAGES = (excite, constraints, regressors)


def check_files(report: Path) -> None:
    """Data files are there, the licence of what is in a report too, and the packages are those installed."""
    for package in PACKAGES:
        place = Path(str(package.__file__))
        assert place.is_relative_to(sys.prefix), f"{place} is not the one installed"
        assert files(package).joinpath("py.typed").is_file()
    page = files("excite.views").joinpath("page")
    player, licence = (page.joinpath(name).read_text("utf-8") for name in ("player.min.js", "three.LICENSE"))
    text = report.read_text("utf-8")
    assert player.strip()[-200:] in text
    assert licence.strip().splitlines()[-1] in text
    assert metadata("excite-trajectories")["License-Expression"] == "Apache-2.0 AND MIT"


def check_modules() -> int:
    """Every module can be imported without the optional dependencies, but for the program that expands xacro files."""
    names = [
        each.name
        for package in PACKAGES
        for each in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        if not each.name.endswith("__main__") and not each.name.startswith("regressors.readers.xacro_")
    ]
    for name in names:
        importlib.import_module(name)
    return len(names)


def check_api(folder: Path) -> excite.Verification:
    """From a built-in robot to a verdict, as in the README."""
    for name in excite.built_in_names():
        excite.load_robot(name)
    for name in dir(excite):
        getattr(excite, name)
    model = excite.DifferentialModel(excite.load_robot("irp6"))
    search = excite.Search(starts=1, seed=0, executor="serial")
    design: excite.Design = excite.design_trajectory(model, excite.Fourier(period=10, harmonics=3), search=search)
    condition: float = design.condition_number
    assert design.feasible
    assert condition < 100
    log, other = (excite.simulate(design, noise=1.0, seed=seed) for seed in (1, 2))
    design.save(folder / "design")
    assert excite.load_design(folder / "design").condition_number == condition
    result: excite.Identification = excite.identify(model, log, design=design)
    return excite.verify(result, other)


def a_mistake() -> None:
    """Is never called: mypy reports that the comment is not needed where it does not see our types."""
    excite.load_robot(7)  # type: ignore[arg-type]


if __name__ == "__main__":
    check_files(Path(sys.argv[1]))
    modules = check_modules()
    with TemporaryDirectory() as temporary:
        verdict = check_api(Path(temporary))
    print(f"excite {version('excite-trajectories')}: {modules} modules, verdict on simulated logs: {verdict.holds}")
