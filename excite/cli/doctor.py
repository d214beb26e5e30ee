"""``excite doctor``: whether this environment can do the work, and the remedy where it cannot.

Nothing that may be missing is imported above, click aside: packages are imported by their names and reported.
"""

from __future__ import annotations

import json
import operator
import os
import platform
import re
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module, metadata
from textwrap import fill
from typing import Any

import click

import excite
from excite.cli.command import command
from excite.cli.streams import something_is_shown, tell, verbosity
from excite.own_packages import DISTRIBUTION
from regressors.errors import one_line
from regressors.work_prediction import memory_cap

Finding = dict[str, Any]  # kind, part and found are texts; holds is None for what may be missing; remedy
_ENABLES = {
    "dask": "starts and sweeps on other machines",
    "hdf5": "logs in HDF5",
    "matlab": "logs of MATLAB v7.3",
    "meshes": "meshes in COLLADA, in reports and for collisions",
    "mujoco": "robots in MJCF",
    "parquet": "logs in Parquet",
    "ros": "bags and MCAP, read and written",
    "xacro": "robots in xacro",
}
_MODULES = {"pycollada": "collada", "ruamel-yaml": "ruamel.yaml"}
_REQUIREMENT = re.compile(r"([\w.-]+)(?:\[[\w,-]+\])?([^;]*)(?:;.*extra == ['\"](\w+)['\"])?")
_SIGNS = {">=": operator.ge, "~=": operator.ge, "<=": operator.le, "==": operator.eq, "<": operator.lt}
_FRESH = (
    "install the versions of `requirements.lock` into a new environment (docs/set-up.md); where this fails there too, "
    "report what 'excite doctor --json' prints"
)
# of the built-in `irp6`: base parameters, their largest singular value at seeded states; what one start's motion of a
# few harmonics may have at most, over all versions that were tried; standard deviations that no estimate is off by
_RANK, _LARGEST, _CONDITION, _DEVIATIONS = 23, 2.6854766, 65.0, 5.0


@command(
    epilog="""\b
Examples:
  excite doctor
  excite doctor --verbose      every package on a line of its own
  excite doctor --json         for a report of an error

Exit status 0: everything that is needed is here, and the self-test holds; 1: something is not, with the remedy.""",
)
def doctor() -> int:
    """Check this installation: versions, optional packages, cores, and in seconds the main job on a small robot.

    The self-test designs a short motion for the IRp-6, proves its limits, simulates its log, identifies and verifies;
    what comes out is compared with what is known.
    """
    tell("looking for packages")
    findings = [*_environment(), *_packages()]
    if all(each["holds"] is not False for each in findings):
        tell("testing the main job")
        findings += _self_test()
    wrong = sum(each["holds"] is False for each in findings)
    verdict = f"This installation is healthy: the self-test holds ({time.process_time():.0f} CPU s)."
    if wrong:
        verdict = f"This installation is not healthy: {wrong} of {len(findings)} checks failed; each has its remedy."
    something_is_shown()
    if verbosity().as_json:
        click.echo(json.dumps({"verdict": verdict, "healthy": not wrong, "findings": findings}, indent=1))
    else:
        lines = [] if verbosity().quiet else _lines(findings)
        click.echo("\n".join([verdict, *lines]))
    return int(wrong > 0)


def _finding(kind: str, part: str, found: str, holds: bool | None = True, remedy: str = "") -> Finding:
    return {"kind": kind, "part": part, "found": one_line(found), "holds": holds, "remedy": "" if holds else remedy}


def _lines(findings: list[Finding]) -> Iterator[str]:
    """What failed first, then one finding a line; needed packages that are here on one, unless all is asked for."""
    joined = {each["part"]: each["found"] for each in findings if each["kind"] == "needed" and each["holds"]}
    for each in sorted(findings, key=lambda each: each["holds"] is not False):
        if verbosity().verbose or not (each["kind"] == "needed" and each["holds"]):
            remedy = f"; {each['remedy']}" if each["remedy"] else ""
            mark = {True: "ok", False: "NO", None: "--"}[each["holds"]]
            yield _line(mark, each["kind"], f"{each['part']}: {each['found']}{remedy}")
    if joined and not verbosity().verbose:
        yield _line("ok", "needed", ", ".join(f"{name} {version}" for name, version in joined.items()))


def _line(mark: str, kind: str, text: str) -> str:
    begun = f"  {mark}  {kind:<11}  "
    return fill(text, 100, initial_indent=begun, subsequent_indent=" " * len(begun), break_on_hyphens=False)


def _environment() -> Iterator[Finding]:
    """Python, the machine, and what this process may use of it."""
    try:
        known = metadata.metadata(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        yield _finding("environment", "excite", "not installed", False, "run 'sh docs/set-up.sh' in its folder")
        return
    version, allowed = platform.python_version(), known["Requires-Python"]
    found = f"{version} on {platform.platform()}, for excite {known['Version']}, which needs Python {allowed}"
    yield _finding("environment", "Python", found, _fits(version, allowed), f"install Python {allowed}")
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    cap = f"{memory_cap() / 1e9:g} GB of memory for one piece of work"
    yield _finding("environment", "cores", f"{usable} of {os.cpu_count()} may be used; {cap}")


def _fits(version: str, allowed: str) -> bool:
    """Whether a version is within bounds such as ``>=2.1,<3``."""
    bounds = re.findall(r"([<>=~]=?)\s*([\d.]+)", allowed)
    return all(_SIGNS[sign](_release(version), _release(bound)) for sign, bound in bounds)


def _release(version: str) -> tuple[int, ...]:
    numbers = [int(part) for part in re.findall(r"\d+", version.partition("+")[0])[:3]]
    return (*numbers, *(0,) * (3 - len(numbers)))


def _packages() -> Iterator[Finding]:
    """Every package that the distribution names, and the threads of those that compute."""
    try:
        stated = [re.match(_REQUIREMENT, each) for each in metadata.requires(DISTRIBUTION) or ()]
    except metadata.PackageNotFoundError:
        return
    for name, allowed, extra in (each.groups() for each in stated if each):
        if extra is None or extra in _ENABLES:
            yield _package(name, allowed.strip(), extra)
    pools = sys.modules.get("threadpoolctl")
    threads = [f"{each['internal_api']} {each['num_threads']}" for each in pools.threadpool_info()] if pools else []
    yield _finding("environment", "threads", ", ".join(dict.fromkeys(threads)) or "none of linear algebra is known")


def _package(name: str, allowed: str, extra: str | None) -> Finding:
    """One package: whether it can be imported, and has a version that is allowed."""
    kind, part = ("optional", f"{name}, for {_ENABLES[extra]}") if extra else ("needed", name)
    remedy = f"pip install '{DISTRIBUTION}[{extra}]'" if extra else f"pip install '{name}{allowed}'"
    try:
        import_module(_MODULES.get(name, name))
    except ModuleNotFoundError:
        return _finding(kind, part, "missing", None if extra else False, remedy)
    except Exception as error:  # of a damaged installation, or of a library of the system that it lacks
        return _finding(kind, part, f"cannot be imported ({error})", False, f"{remedy} --force-reinstall")
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return _finding(kind, part, "here, from a distribution of another name")
    if _fits(version, allowed):
        return _finding(kind, part, version)
    return _finding(kind, part, f"{version}, where {allowed} is needed", False, remedy)


def _self_test() -> Iterator[Finding]:
    """The main job on a small robot, step by step; what fails ends it."""
    steps: tuple[Callable[[dict[str, Any]], tuple[str, bool]], ...] = (_model, _design, _identification, _verification)
    made: dict[str, Any] = {}
    for step in steps:
        try:
            found, holds = step(made)
        except Exception as error:  # whatever is wrong here is the finding
            found, holds = f"{type(error).__name__}: {error}", False
        yield _finding("self-test", step.__name__.strip("_"), found, holds, _FRESH)
        if not holds:
            return


def _model(made: dict[str, Any]) -> tuple[str, bool]:
    made["model"] = excite.DifferentialModel(excite.load_robot("irp6"))
    base = excite.base_parameters(made["model"])
    largest = float(base.singular_values[0])
    found = f"{base.rank} base parameters, singular value {largest:.7f} (known: {_RANK}, {_LARGEST:.7f})"
    return found, base.rank == _RANK and abs(largest - _LARGEST) < 1e-6


def _design(made: dict[str, Any]) -> tuple[str, bool]:
    family, search = excite.Fourier(period=10, harmonics=3), excite.Search(starts=1, seed=0, executor="serial")
    design = made["design"] = excite.design_trajectory(made["model"], family, search=search)
    proven = "proven" if design.feasible else "NOT kept"
    found = f"cond(W) {design.condition_number:.4g} (known: below {_CONDITION:g}), limits {proven}"
    return found, design.feasible and design.condition_number < _CONDITION


def _identification(made: dict[str, Any]) -> tuple[str, bool]:
    log, made["other"] = (excite.simulate(made["design"], noise=1.0, seed=seed) for seed in (1, 2))
    result = made["result"] = excite.identify(made["model"], log, design=made["design"], choose=False)
    table = result.table("parameters")
    known = zip(table["value"], table["truth"], table["std. dev."], strict=True)
    worst = max(abs(value - truth) / deviation for value, truth, deviation in known)
    found = f"{len(result.names)} parameters, at most {worst:.2g} standard deviations off the truth (allowed: "
    return f"{found}{_DEVIATIONS:g})", worst < _DEVIATIONS


def _verification(made: dict[str, Any]) -> tuple[str, bool]:
    verified = excite.verify(made["result"], made["other"])
    error = f"torques of another log predicted within {verified.relative_error:.2%}"
    return f"{error}, {'confirmed' if verified.holds else 'NOT confirmed'}", verified.holds
