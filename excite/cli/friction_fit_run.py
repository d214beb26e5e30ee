"""Execution of ``excite friction fit``, and the summary of the curves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

import excite
from excite.cli.literal_console import console
from excite.cli.messages import in_options
from excite.cli.sign_of_life import tell
from excite.cli.summary import Summary, compact_table, show
from excite.files.figure_names import figure_names
from excite.files.friction_fit_file import FIGURE, FRICTION, check_no_fit, fit_content
from excite.friction.fit.characteristic import Characteristic
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.stiction_points import mean_break_aways
from excite.storage.result_folder import result_folder
from excite.tasks.robot_of_task import installed_robot

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
        Robot, as given on the command line.
    paths : sequence of Path
        Logs.
    out : Path
    given : dict
        The command's other options.
    """
    settings = FitSettings(**{key: given[key] for key in _SETTINGS})
    tell("reading the logs")
    with result_folder(out):
        check_no_fit(out, (FRICTION, *figure_names([FIGURE], given["figures"].formats)), replace=given["force"])
        task = excite.Task(
            name,
            base_link=given["base_link"],
            tip=given["tip"],
            snap_angles=given["snap_angles"] is not False,
            mount=given["mount"],
            payload=given["payload"],
        )
        robot = installed_robot(task)
        asked = {key: given[key] for key in ("plan", "drives", "mapping", "drop")}
        if given["parameters"] is not None:
            own = given["parts"]
            asked["parameters"] = excite.load_result(given["parameters"], own) if own else given["parameters"]
        fit = excite.fit_friction(robot, list(paths), settings, progress=tell, **asked)
        files = fit.save(out, replace=given["force"])
        if figures := given["figures"]:
            from excite.plots.friction_plot import write_friction_figure

            tell("drawing")
            files = [*write_friction_figure(robot.name, fit.characteristics, out, **figures.how), *files]
    show(
        _summary(fit.characteristics, files),
        lambda: {"out": str(out), **fit_content(fit)},
        lambda: _print(fit.characteristics, files),
    )


def _summary(characteristics: Sequence[Characteristic], files: Sequence[Path]) -> Summary:
    count, points = len(characteristics), sum(len(each.points) for each in characteristics)
    rows = [_row(each) for each in characteristics]
    return Summary(
        verdict=f"Friction curves of {count} drive{'s' * (count > 1)} from {points} windows of constant speed",
        facts=[
            *compact_table("drive", "equation", "points", "Coulomb", "viscous", "scatter", rows=rows, left=2),
            "coulomb and viscous friction with 99 % intervals; scatter: of the points, over what noise explains",
        ],
        notes=[f"{each.drive}: {line}" for each in characteristics for line in each.notes]
        + ["friction of other drives is identified with the masses"],
        files=files,
        next_steps=[f"excite identify ROBOT LOG... --friction-curves {files[-1].parent / FRICTION} --out DIR"],
        all_in="fit.json",
    )


def _row(characteristic: Characteristic) -> tuple[str, ...]:
    """Coulomb and viscous friction of a drive, in one direction where the two differ."""
    fit, points = characteristic.fit, str(len(characteristic.points))
    if fit is None:
        return (characteristic.drive, "table", points, "-", "-", "-")
    units = _units(characteristic)
    found = {
        name.rsplit(".", 1)[-1]: f"{value:.4g} +- {half:.1g} {units[name.rsplit('.', 1)[-1]]}"
        for name, value, half in zip(fit.form.parameters, fit.values, fit.halfwidth, strict=True)
    }
    friction = (found.get("coulomb", "-"), found.get("viscous", "-"))
    return (characteristic.drive, fit.form.name, points, *friction, f"{fit.scatter:.2g}")


def _print(characteristics: Sequence[Characteristic], files: Sequence[Path]) -> None:
    out = console()
    for characteristic in characteristics:
        name = "table" if characteristic.fit is None else characteristic.fit.form.name
        out.print(f"{characteristic.drive}: {name}, {len(characteristic.points)} points", style="bold")
        out.print(_table(characteristic))
        for line in _summary_lines(characteristic):
            out.print(f"  {in_options(line)}", soft_wrap=True)
    drives = ", ".join(characteristic.drive for characteristic in characteristics)
    out.print(
        f"note: {FRICTION} has curves of {drives}; friction of other drives is identified with the masses",
        soft_wrap=True,
    )
    out.print("written: " + ", ".join(map(str, files)), soft_wrap=True)


def _table(characteristic: Characteristic) -> Table:
    """Table of parameters and break-away torques with their 99 % intervals."""
    table = Table()
    for heading in ("parameter", "value", "99 %", "unit"):
        table.add_column(heading, justify="right" if heading in ("value", "99 %") else "left")
    if characteristic.fit is not None:
        units = _units(characteristic)
        for parameter, value, half in zip(
            characteristic.fit.form.parameters, characteristic.fit.values, characteristic.fit.halfwidth, strict=True
        ):
            interval = "upper bound" if parameter in characteristic.fit.held else f"+- {half:.2g}"
            table.add_row(parameter, f"{value:.5g}", interval, units[parameter.rsplit(".", 1)[-1]])
    for mean in mean_break_aways(characteristic.break_aways):
        name = f"break-away {'+' if mean.direction > 0 else '-'}, {mean.count} ramp{'s' if mean.count > 1 else ''}"
        table.add_row(name, f"{mean.torque:.5g}", f"+- {mean.interval99:.2g}", characteristic.unit)
    return table


def _units(characteristic: Characteristic) -> dict[str, str]:
    speed = "rad/s" if characteristic.unit == "Nm" else "m/s"
    viscous = "Nm s/rad" if characteristic.unit == "Nm" else "N s/m"
    return {
        "coulomb": characteristic.unit,
        "viscous": viscous,
        "stiction": characteristic.unit,
        "stribeck": speed,
        "offset": characteristic.unit,
        "coulomb_temperature": f"{characteristic.unit}/K",
        "viscous_temperature": f"{viscous}/K",
        "load": "",
    }


def _summary_lines(characteristic: Characteristic) -> list[str]:
    lines = list(characteristic.notes)
    if len(characteristic.others) > 1:
        compared = ", ".join(f"{other.form.name} {other.bic:.1f}" for other in characteristic.others)
        lines.append(f"compared, BIC: {compared}")
    if characteristic.fit is not None and characteristic.fit.scatter > 1.5:
        lines.append(
            f"the points scatter {characteristic.fit.scatter:.2g} times as much as noise within the windows explains; "
            "the intervals allow for it"
        )
    return lines
