"""The command that fits friction curves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

import excite
from excite.cli.command import Command
from excite.cli.literal_console import console
from excite.cli.option_types import Folder, Names, RobotName
from excite.cli.options import drop_option, figure_options, mapping_option, own_parts, robot_file_of, robot_file_options
from excite.cli.sign_of_life import tell
from excite.cli.summary import Summary, show
from excite.cli.task_options import chosen_of, settings_options, task_options
from excite.cli.view_text import brief_table, print_view
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.friction_fit import FIGURE, FRICTION, check_no_fit
from excite.storage.figure_names import figure_names
from excite.storage.records import json_of
from excite.storage.result_folder import result_folder
from excite.tasks.robot_of_task import installed_robot
from excite.views.friction_fit_view import friction_fit_view

_GROUPS = {
    "Logs": ("drives", "plan", "mapping", "drop"),
    "Windows": ("window", "tolerance", "speed"),
    "Gravity": ("gravity", "parameters"),
    "Curve": ("model", "exponent", "criterion", "temperature", "load", "stiction"),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="fit",
    epilog="""\b
Examples:
  excite friction fit irp6 joint2.csv --drives z2 --out friction/z2
  excite friction fit irp6 z1.csv z1.stiction.csv z2.csv --plan friction/plan --out friction/irp6
  excite friction fit irp6 joint1.csv --gravity none --model stribeck --exponent 1 --out friction/z1
  excite friction fit ur10e log.csv --mapping ur10e.yaml --parameters results/ur10e --out friction/ur10e

\b
Gravity:
  auto       model where masses are known or --parameters are given; else none, where the plan says that it cancels, or
             gravity does not act on the drive, as where all axes are vertical
  model      subtracted, with the robot's described parameters or those of --parameters
  symmetric  cancelled between windows of both directions over the same path; needs no model, but finds only the
             part of friction that is the same in both directions
  none       torques as they are, for drives on which gravity does not act, or over the whole windows of a plan about a
             pose in which it cancels; refused where it does not

\b
Break-away:
  The logs are searched for slow ramps of torque that start at rest and end in motion: the break-away tests in the runs
  of a plan, where the joint creeps, and those of its NAME.stiction.csv, where the torque is given; without a plan, for
  ramps while all other drives rest. The break-away torque is the one at which the speed of the drive begins to grow,
  after presliding by microns. Each is a point of the curve at speed zero, with the scatter of the repetitions as its
  uncertainty; without a plan it counts only if another one in the same direction repeats it. Torques against the
  motion that follows, or far from the friction of the slowest windows, do not count; the summary lists them.

\b
What is written to DIR:
  friction.yaml  curves for --friction-curves of 'excite design', 'excite plan' and 'excite identify', and --friction of
                 'excite simulate', with the covariance of their parameters, which the intervals of later
                 identifications allow for
  fit.json       windows, parameters with 99 % intervals, all models that were compared, break-away torques
  friction.png   windows, curves and their 99 % bands, break-away torques""",
)
@click.argument("robot", type=RobotName())
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@robot_file_options("--base")
@task_options(("installation",), without=("gravity",))
@click.option(
    "--drives",
    "--joints",
    "drives",
    type=Names(),
    metavar="1,3",
    help="Drives, or joints of a robot without drives, by name or number.  [default: all]",
)
@click.option("--plan", type=Folder(), metavar="DIR", help="Plan that was played; its windows are found in the logs.")
@mapping_option
@drop_option
@click.option("--parameters", type=Folder(), metavar="RESULT", help="Result of 'excite identify' for the model.")
@own_parts
@settings_options(FitSettings)
@figure_options()
@click.option("--force", is_flag=True, help="Replace a fit that is already in DIR.")
def command(robot: str, logs: tuple[Path, ...], out: Path, **options: Any) -> None:
    """Fit friction curves to LOGs of ROBOT, and write them to DIR.

    Windows of constant speed are found in each log; the mean torque of each is one point of a drive's curve. With
    --plan they are the plan's whole windows, found in logs that begin before it or after.
    """
    fit_and_write(robot, logs, out, options)


def fit_and_write(name: str, paths: Sequence[Path], out: Path, given: dict[str, Any]) -> None:
    """Fit curves to logs and write their folder."""
    settings = FitSettings(**chosen_of(FitSettings, given))
    tell("reading the logs")
    with result_folder(out):
        check_no_fit(out, (FRICTION, *figure_names([FIGURE], given["figures"].formats)), replace=given["force"])
        task = excite.Task(name, **robot_file_of(given), mount=given["mount"], payload=given["payload"])
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
            files = [*write_friction_figure(fit.robot, fit.characteristics, out, **figures.how), *files]
    show(
        _summary(fit, files),
        lambda: {"out": str(out), **json_of(fit)},
        lambda: _print(fit, files),
    )


def _summary(fit: excite.FrictionFit, files: Sequence[Path]) -> Summary:
    view = friction_fit_view(fit)
    return Summary(
        verdict=view.verdict,
        facts=[*brief_table(view.tables[0], left=2), *view.summary],
        notes=[*view.remarks, "friction of other drives is identified with the masses"],
        files=files,
        next_steps=[f"excite identify ROBOT LOG... --friction-curves {files[-1].parent / FRICTION} --out DIR"],
        all_in="fit.json",
    )


def _print(fit: excite.FrictionFit, files: Sequence[Path]) -> None:
    print_view(friction_fit_view(fit))
    drives = ", ".join(characteristic.drive for characteristic in fit.characteristics)
    console().print(
        f"note: {FRICTION} has curves of {drives}; friction of other drives is identified with the masses",
        soft_wrap=True,
    )
    console().print("written: " + ", ".join(map(str, files)), soft_wrap=True)
