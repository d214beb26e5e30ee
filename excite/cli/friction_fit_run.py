"""The work behind ``excite friction fit``: files in, curves, files out."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits

from excite.files.friction_file import write_friction
from excite.files.friction_fit_file import FIT, FRICTION, fit_content
from excite.files.friction_plan_folder import read_plan
from excite.files.result_json import read_result
from excite.friction.fit.characteristics import Characteristic, characteristics
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.fit_uncertainty import curve_uncertainty
from excite.friction.fit.plan_match import PlannedRuns, planned_runs
from excite.friction.fit.rigid_torques import RigidModel, described_model, identified_model
from excite.friction.fit.stiction_points import mean_break_aways
from excite.logs.gaps import segments
from excite.logs.log import Log
from excite.logs.log_checks import check_log
from excite.logs.log_reading import read_log
from excite.logs.mapping import read_mapping
from excite.storage.atomic import write_json
from excite.storage.folder import made_folder
from regressors.errors import InputError, UnknownName
from regressors.friction.curves import FrictionCurves
from regressors.readers.library import load_robot
from regressors.robot.robot import Robot

_SETTINGS = (
    "window",
    "tolerance",
    "speed",
    "gravity",
    "model",
    "exponent",
    "criterion",
    "temperature",
    "load",
    "stiction",
)


def fit_and_write(name: str, paths: Sequence[Path], out: Path, given: dict[str, Any]) -> None:
    """Fit curves to logs and write their folder.

    Parameters
    ----------
    name : str
        Robot, as typed.
    paths : sequence of Path
        Logs.
    out : Path
    given : dict
        The command's other options.
    """
    if (out / FIT).exists() and not given["force"]:
        raise InputError(f"{out} already holds a fit; --force replaces it, or choose another --out")
    settings = FitSettings(**{key: given[key] for key in _SETTINGS})
    with made_folder(out), threadpool_limits(1):
        robot = load_robot(name, base=given["base_link"], tip=given["tip"])
        model = _rigid(robot, given)
        logs = _logs(robot, paths, given)
        plan = _plan(robot, given)
        _tell("fitting curves to windows of constant speed ...")
        found = characteristics(robot, logs, settings, model, _wanted(robot, given, plan), plan)
        provenance = {
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "versions": {package: version(package) for package in ("excite-trajectories", "numpy", "scipy")},
        }
        source = model(robot).source if any(one.gravity == "model" for one in found) else None
        content = fit_content(robot, logs, settings, found, source, provenance)
        from excite.plots.friction_plot import write_friction_figure

        files = write_friction_figure(robot.name, found, out)
        uncertain = {one.drive: curve_uncertainty(one.fit) for one in found if one.fit is not None}
        write_friction(FrictionCurves({one.drive: one.curve for one in found}, uncertain), out / FRICTION)
        write_json(out / FIT, content)
    if given["form"] == "json":
        click.echo(json.dumps({"out": str(out), **content}, indent=1))
    else:
        _print(found, [*files, out / FRICTION, out / FIT])


def _tell(line: str) -> None:
    """A line of progress, where somebody looks on."""
    if sys.stderr.isatty():
        click.echo(line, err=True)


def _rigid(robot: Robot, given: dict[str, Any]) -> Callable[[Robot], RigidModel]:
    """Model without friction for the robot of a log."""
    if given["parameters"] is None:
        return described_model
    if given["gravity"] == "symmetric":
        raise InputError("--parameters is for --gravity model; symmetric windows need no model")
    stored = read_result(given["parameters"])
    model = identified_model(stored, robot)
    return lambda _: model


def _plan(robot: Robot, given: dict[str, Any]) -> dict[str, PlannedRuns] | None:
    """What the plan has each drive do."""
    if given["plan"] is None:
        return None
    planned, content = read_plan(given["plan"])
    if planned.sha256() != robot.sha256():
        raise InputError(f"{given['plan']} is a plan for {planned.name}, not for {robot.name} as given here")
    return planned_runs(content, str(given["plan"]))


def _wanted(robot: Robot, given: dict[str, Any], plan: dict[str, PlannedRuns] | None) -> tuple[str, ...] | None:
    """Drives that were asked for."""
    drives = _drives(robot, given["drives"])
    for name in drives or ():
        if plan is not None and name not in plan:
            raise UnknownName(f"drive in {given['plan']}", name, tuple(plan))
    return drives


def _drives(robot: Robot, given: tuple[str, ...] | None) -> tuple[str, ...] | None:
    """Names of the drives that were typed, by name or number."""
    if given is None:
        return None
    known = robot.joint_names if robot.transmission is None else tuple(d.name for d in robot.transmission.drives)
    numbers = {str(number): name for number, name in enumerate(known, 1)}
    return tuple(numbers.get(name, name) for name in given)


def _logs(robot: Robot, paths: Sequence[Path], given: dict[str, Any]) -> list[Log]:
    mapping = None if given["mapping"] is None else read_mapping(given["mapping"])
    logs: dict[str, Log] = {}
    for path in paths:
        _tell(f"reading {path} ...")
        log = read_log(path, None, mapping, given["drop"])
        if log.sha256 in logs:
            raise InputError(f"{log.source} has the same content as {logs[log.sha256].source}: a log counts once")
        for part in segments(log):
            check_log(part, robot, ())  # a drive that breaks away moves by microns
        logs[log.sha256] = log
    return list(logs.values())


def _print(found: Sequence[Characteristic], files: Sequence[Path]) -> None:
    console = Console(highlight=False)
    for one in found:
        name = "table" if one.fit is None else one.fit.form.name
        console.print(f"{one.drive}: {name}, {len(one.points)} points", style="bold")
        console.print(_table(one))
        for line in _said(one):
            console.print(f"  {line}", soft_wrap=True)
    console.print(f"note: what has no curve is taken to have no friction: {FRICTION} names ", end="")
    console.print(", ".join(one.drive for one in found))
    console.print("written: " + ", ".join(map(str, files)), soft_wrap=True)


def _table(one: Characteristic) -> Table:
    """Parameters, and the torques at which the drive breaks away, with their 99 % intervals."""
    table = Table()
    for heading in ("parameter", "value", "99 %", "unit"):
        table.add_column(heading, justify="right" if heading in ("value", "99 %") else "left")
    if one.fit is not None:
        units = _units(one)
        for parameter, value, half in zip(one.fit.form.parameters, one.fit.values, one.fit.halfwidth, strict=True):
            interval = "upper bound" if parameter in one.fit.held else f"+- {half:.2g}"
            table.add_row(parameter, f"{value:.5g}", interval, units[parameter.rsplit(".", 1)[-1]])
    for mean in mean_break_aways(one.break_aways):
        name = f"break-away {'+' if mean.direction > 0 else '-'}, {mean.count} ramp{'s' if mean.count > 1 else ''}"
        table.add_row(name, f"{mean.torque:.5g}", f"+- {mean.interval99:.2g}", one.unit)
    return table


def _units(one: Characteristic) -> dict[str, str]:
    speed = "rad/s" if one.unit == "Nm" else "m/s"
    viscous = "Nm s/rad" if one.unit == "Nm" else "N s/m"
    return {
        "coulomb": one.unit,
        "viscous": viscous,
        "stiction": one.unit,
        "stribeck": speed,
        "offset": one.unit,
        "coulomb_temperature": f"{one.unit}/K",
        "viscous_temperature": f"{viscous}/K",
        "load": "",
    }


def _said(one: Characteristic) -> list[str]:
    lines = list(one.notes)
    if len(one.others) > 1:
        compared = ", ".join(f"{other.form.name} {other.bic:.1f}" for other in one.others)
        lines.append(f"compared, BIC: {compared}")
    if one.fit is not None and one.fit.scatter > 1.5:
        lines.append(
            f"the points scatter {one.fit.scatter:.2g} times as much as noise within the windows explains; the "
            "intervals allow for it"
        )
    return lines
