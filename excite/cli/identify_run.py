"""The work behind ``excite identify``: files in, estimate, files out."""

from __future__ import annotations

import json
import platform
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import click
from threadpoolctl import threadpool_limits

from excite.cli.estimate_text import print_estimate
from excite.cli.interrupts import one_interrupt
from excite.cli.repetition_text import print_repetitions, repeat_and_write
from excite.design.stored_design import StoredDesign
from excite.files.design_folder import DESIGN
from excite.files.friction_file import friction_text, read_friction
from excite.files.result_json import RESULT, result_content
from excite.identification.choice import chosen_estimator
from excite.identification.identification import Identification, identified
from excite.identification.recipe import Recipe, not_repeated
from excite.identification.reference_values import reference_of
from excite.information.target import friction_of_moving, moving_robot
from excite.logs.log import Log
from excite.logs.log_reading import read_log
from excite.logs.mapping import read_mapping
from excite.plots import write_identification_figures
from excite.storage.atomic import write_json
from excite.storage.folder import made_folder
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves
from regressors.models.nominal import standard_values
from regressors.readers.library import load_robot
from regressors.robot.robot import Robot

_PACKAGES = ("excite-trajectories", "casadi", "clarabel", "numpy", "scipy")
_SILENT = 2.0  # seconds before progress is told


def identify_and_write(
    name: str, paths: Sequence[Path], out: Path, task: Task, design: StoredDesign | None, recipe: Recipe, given: Any
) -> None:
    """Identify from logs and write a result's folder.

    Parameters
    ----------
    name : str
        Robot, as typed.
    paths : sequence of Path
        Logs.
    out : Path
    task : Task
    design : StoredDesign, optional
        That was played.
    recipe : Recipe
    given : mapping
        The command's other options.
    """
    if given["repeat"]:
        recipe.check_repeatable(given["repeat"])
    if (out / RESULT).exists() and not given["force"]:
        raise InputError(f"{out} already holds a result; --force replaces it, or choose another --out")
    # on matrices of this size more threads only wait for each other
    with made_folder(out), one_interrupt() as ignore_interrupts, threadpool_limits(1):
        result, content, files = _written(name, paths, out, task, design, recipe, given, ignore_interrupts)
    status = 0
    if given["repeat"]:
        content, status = repeat_and_write(result, out, content, given["repeat"], given["seed"])
    if given["form"] == "json":
        left_out = ("schema", "robot", "covariance", "task")
        click.echo(json.dumps({"out": str(out), **{k: v for k, v in content.items() if k not in left_out}}, indent=1))
    else:
        print_estimate(content, files)
        if "repetitions" in content:
            print_repetitions(content["repetitions"])
    sys.exit(status)


def _written(
    name: str,
    paths: Sequence[Path],
    out: Path,
    task: Task,
    design: StoredDesign | None,
    recipe: Recipe,
    given: Any,
    at_end: Callable[[], None],
) -> tuple[Identification, dict[str, Any], list[Path]]:
    """Identify and write; `at_end` is called when nothing is left but to write."""
    began, cpu = time.monotonic(), time.process_time()
    robot = load_robot(name, base=task.base_link, tip=task.tip)
    _check_design(robot, design)
    if design is not None and recipe.period is None:
        recipe = replace(recipe, period=_period(design, recipe))
    told = _progress(began)
    curves, source = _known_friction(given["friction_curves"], design, task, robot)
    if given["repeat"] and curves is not None:
        raise not_repeated()
    estimator = chosen_estimator(
        recipe.estimator,
        trajectory=None if design is None else design.trajectory,
        known=standard_values(robot),
        pull=given["pull"],
    )
    logs = _logs(paths, given, told)
    result = identified(robot, task, logs, recipe, estimator, friction=curves, progress=told)
    reference = reference_of(result, paths)
    content = result_content(
        result,
        reference=reference,
        design=_played(design),
        friction=source,
        provenance=_provenance(time.monotonic() - began, time.process_time() - cpu, given),
    )
    told("drawing")
    at_end()
    files = write_identification_figures(result, out, reference)
    write_json(out / RESULT, content)
    return result, content, [*files, out / RESULT]


def _logs(paths: Sequence[Path], given: Any, told: Callable[[str], None]) -> list[Log]:
    """Logs as read, each of its own content."""
    mapping = None if given["mapping"] is None else read_mapping(given["mapping"])
    logs: dict[str, Log] = {}
    for path in paths:
        told(f"reading {path}")
        log = read_log(path, None, mapping, given["drop"])
        if log.sha256 in logs:
            raise InputError(f"{log.source} has the same content as {logs[log.sha256].source}: a log counts once")
        logs[log.sha256] = log
    return list(logs.values())


def _period(design: StoredDesign, recipe: Recipe) -> float | None:
    """Period of the design's motion, where the recipe can use it."""
    periodic = design.trajectory.family.name == "fourier"
    return design.trajectory.duration if recipe.average or (periodic and recipe.signals == "fourier") else None


def _known_friction(
    path: Path | None, design: StoredDesign | None, task: Task, robot: Robot
) -> tuple[FrictionCurves | None, dict[str, Any] | None]:
    """Friction curves that were named, or else those that the design was made with, and where they are from."""
    moving = moving_robot(robot, task)
    if path is not None:
        named = _curves(path, robot)
        known = friction_of_moving(named, robot, moving)
        alike = len(known.curves) == len(named.curves)
        return known, _file(path, text=True) if alike else {**_file(path), "text": friction_text(known)}
    made_for = None if design is None else design.task.known_friction
    if design is None or made_for is None or task.model.friction or task.model.startswith("load"):
        return None, None
    click.echo(
        "excite: note: the design is for known friction: its curves are subtracted; --friction identifies friction, "
        "--friction-curves names other curves",
        err=True,
    )
    known = friction_of_moving(made_for, robot, moving)
    return known, {**_file(design.folder / DESIGN), "text": friction_text(known)}


def _curves(path: Path, robot: Robot) -> FrictionCurves:
    curves = read_friction(path)
    try:
        curves.check(robot)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return curves


def _check_design(robot: Robot, design: StoredDesign | None) -> None:
    if design is not None and design.robot.sha256() != robot.sha256():
        raise InputError(
            f"{design.folder} is a design for {design.robot.name} (description {design.robot.sha256()[:12]}), "
            f"not for {robot.name} ({robot.sha256()[:12]})"
        )


def _played(design: StoredDesign | None) -> dict[str, Any] | None:
    if design is None:
        return None
    return {
        **_file(design.folder / DESIGN),
        "folder": str(design.folder),
        "condition_number": design.content["criteria"]["condition_number"],
    }


def _file(path: Path, *, text: bool = False) -> dict[str, Any]:
    content = path.read_bytes()
    known = {"file": str(path), "sha256": sha256(content).hexdigest()}
    return {**known, "text": content.decode("utf-8")} if text else known


def _provenance(wall: float, cpu: float, given: Any) -> dict[str, Any]:
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": given["seed"],
        "mapping": None if given["mapping"] is None else _file(given["mapping"]),
        "drop": list(given["drop"]),
        "wall_seconds": wall,
        "cpu_seconds": cpu,
        "python": platform.python_version(),
        "versions": {package: version(package) for package in _PACKAGES},
    }


def _progress(began: float) -> Any:
    """What is being done, on stderr, once it takes long enough to wonder."""

    def told(what: str) -> None:
        if time.monotonic() - began > _SILENT:
            click.echo(f"excite: {what}", err=True)

    return told
