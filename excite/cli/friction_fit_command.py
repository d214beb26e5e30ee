"""``excite friction fit``: friction curves from logs of runs at constant speed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from excite.cli.command import Command
from excite.cli.figure_options import figure_options
from excite.cli.options import Folder, Names, Number, RobotName, own_parts, reading_options
from excite.cli.task_options import task_options
from excite.registry import DROPPABLE

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
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True},
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
@click.option("--base-link", "--base", "base_link", metavar="LINK", help="First link of the chain, for a URDF or MJCF.")
@click.option("--tip", metavar="LINK", help="Last link of the chain, for a URDF or MJCF.")
@task_options(("installation",), without=("gravity",))
@reading_options
@click.option(
    "--drives",
    "--joints",
    "drives",
    type=Names(),
    metavar="1,3",
    help="Drives, or joints of a robot without drives, by name or number.  [default: all]",
)
@click.option("--plan", type=Folder(), metavar="DIR", help="Plan that was played; its windows are found in the logs.")
@click.option(
    "--mapping",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="YAML file with the columns and units of a log in another format.",
)
@click.option("--drop", multiple=True, type=click.Choice(DROPPABLE), help="Faulty rows to leave out.")
@click.option(
    "--gravity",
    type=click.Choice(["auto", "model", "symmetric", "none"]),
    default="auto",
    help="How gravity is removed; see below.",
)
@click.option("--parameters", type=Folder(), metavar="RESULT", help="Result of 'excite identify' for the model.")
@own_parts
@click.option(
    "--model",
    type=click.Choice(["auto", "coulomb-viscous", "stribeck", "table"]),
    default="auto",
    help="Equation of the curve; auto: the one with the smallest criterion.",
)
@click.option(
    "--exponent",
    type=Number(),
    metavar="D",
    help="Exponent of the Stribeck term.  [default: 1 or 2, whichever fits better]",
)
@click.option(
    "--criterion",
    type=click.Choice(["bic", "aicc"]),
    default="bic",
    help="Information criterion that chooses the equation.",
)
@click.option(
    "--window",
    type=Number(),
    metavar="S",
    help="Length of a window [s].  [default: the plan's whole windows; 0.3 without]",
)
@click.option("--tolerance", type=Number(), default=0.03, metavar="X", help="Change of speed allowed over a window.")
@click.option(
    "--speed",
    type=click.Choice(["auto", "constant", "averaged"]),
    default="auto",
    help="averaged: also use windows of changing speed, with a model that subtracts the torque of acceleration; auto: "
    "only if constant speeds are too few and the drive moves alone.",
)
@click.option(
    "--temperature",
    type=click.Choice(["auto", "linear", "none"]),
    default="auto",
    help="Whether friction is linear in the log's temperature.",
)
@click.option(
    "--load",
    type=click.Choice(["auto", "linear", "none"]),
    default="auto",
    help="Whether friction grows with the torque that the drive carries.",
)
@click.option(
    "--stiction",
    type=click.Choice(["fit", "report"]),
    default="fit",
    help="fit: torques at which a drive broke away are points of its curve at speed zero.",
)
@figure_options()
@click.option("--force", is_flag=True, help="Replace a fit that is already in DIR.")
def command(robot: str, logs: tuple[Path, ...], out: Path, **options: Any) -> None:
    """Fit friction curves to LOGs of ROBOT, and write them to DIR.

    Windows of constant speed are found in each log; the mean torque of each is one point of a drive's curve. With
    --plan they are the plan's whole windows, found in logs that begin before it or after.
    """
    from excite.cli.friction_fit_run import fit_and_write

    fit_and_write(robot, logs, out, options)
