"""``excite design``: the motion for a robot, as files."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from excite.cli.command import Command, FurtherOption
from excite.cli.option_types import Folder, RobotName
from excite.cli.options import (
    FigureChoice,
    figure_options,
    own_parts,
    robot_file_options,
    robot_file_typed,
    split_base,
    task_file_option,
)
from excite.cli.streams import say
from excite.cli.task_options import task_options, typed_options
from excite.registry import CONVENTIONS
from excite.tasks.limit_choice import OF_JOINTS
from excite.tasks.task import PARTS

if TYPE_CHECKING:
    from excite.design.design import Design
    from excite.tasks.task import Task

_BASE_TOO = "--base-link names the first link of a chain; --base still takes it too"

_GROUPS = {
    "Robot": ("base_link", "tip"),
    "Other": ("task_file",),
}

_NEXT = (
    "play trajectory.csv several times at full speed (rehearse it slowly first), record joint positions and torques; "
    "compare candidates with excite compare DIR..."
)
_NEXT_RUNS = "play trajectory.csv {} (rehearse it slowly first), and identify from that log"


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="design",
    epilog="""\b
Examples:
  excite design irp6 --out designs/irp6
  excite design panda --no-friction --base orthonormal --out designs/panda
  excite design arm.urdf --tip tool0 --acceleration-limit 2.5,2,2,2.5,2,2.5 --period 20 --harmonics 10 --out d
  excite design irp6 --model energy --drives 1,2 --out designs/irp6-12
  excite design irp6 --model load --period 6.4 --out designs/irp6-load
  excite design irp6 --friction-curves friction.yaml --torque-margin 0.2 --out designs/irp6-masses
  excite design panda --torque-margin 0.2 --tool-box=-0.6:0.6,-0.6:0.6,0.1: --tool-speed 1.5 --out designs/panda
  excite design arm.urdf --acceleration-limit 10 --world world.yaml --out designs/arm
  excite design irp6 --home 0,0.2,-0.2,0,0 --speed 0.1,0.5 --out designs/irp6-home
  excite design irp6 --precision 5% --noise 2 --out designs/irp6-5-percent
  excite design irp6 --task task.yaml --out designs/irp6     (options given here win over the file's)

Limits hold at all times, not only at samples: those of joints and torques, and distances of the links from each other
and from what the robot is mounted on, where the description has them; those of the tool and from obstacles, if asked
for.

\b
Families of motions (--trajectory):
  fourier          Fourier series; two of its coefficients keep it at rest at both ends
  fourier-quintic  Fourier series and a polynomial of fifth order that keeps it at rest at both ends
  cosine           sum of cosines; returns along the same path
  bspline          B-splines on equal intervals
  waypoints        quintic splines through free waypoints at free times (6 intervals are enough)
  sines            sums of sines of free frequencies and phases, and a polynomial that keeps it at rest at both ends
  polynomial       one polynomial of high degree, 4 --harmonics + 5

\b
What the criterion takes into account:
  --noise 0.1,0.2,0.1 --weighted   rows of W are divided by the noise of their equations
  --prior 0.2                      the values of the robot's description are known to 20 %
  --prior known.yaml               value and deviation of each known parameter: X7: {value: 8.1, deviation: 0.5}
  --scale prior, --scale value     each parameter is scaled by its prior deviation, or by its value
  --interest X5,F3c                the criterion is for these base parameters; the others are estimated too, but count
                                   as nuisance. Groups: gravity (what acts at rest), inertia (what acts in motion only),
                                   inertial, rotor, friction, and kinds such as coulomb, viscous, mass, first-moment
  --prior 0.2 --scale value --plausible-robots 20
                                   relative precision for the worst of 20 robots drawn from the prior (seed 0)

\b
Criteria of predicted torques (--criterion torque-deviation: mean variance; max-torque-deviation: largest variance):
  --task-motion designs/work       for the motion of this design
  --task-motion work.csv           for the motion in this file, with the columns of trajectory.csv
  neither                          for 500 states, uniform within the limits (seed 0)

\b
How precise the result is to be (--precision 5%, or a YAML file): the shortest period and number of runs after which,
with probability 95 %, the half-width of every 99 % interval is at most that share of the described value
  share: 0.05                   of all parameters; left out, nothing is asked of those that are not named
  parameters: {X5: 0.1}         of some, by name
  groups: {friction: 0.1}       of gravity, inertia, friction, or a kind such as coulomb
  torques: {motion: task.csv, share: 0.05}   error of predicted torques along a motion, of its RMS torque per joint
  scales: {X2: 0.5}             value that stands for the described one; one about zero counts with its size
  --period and --harmonics state the highest frequency, which stays; --max-time is the most robot time [s]

\b
Contents of --world FILE (YAML; lengths in m, frames of the links and of the base):
  clearance: 0.01
  robot: [{link: link_3, from: [0, 0, -0.2], to: [0, 0, 0], radius: 0.08}]    or urdf: its <collision> elements
  objects: {table: {plane: {normal: [0, 0, 1]}}, post: {capsule: {from: [0.5, 0, 0], to: [0.5, 0, 1], radius: 0.05}},
            crate: {box: {centre: [0.4, 0.4, 0.1], size: [0.2, 0.2, 0.2]}}, ball: {sphere: {centre: ..., radius: ...}}}
  ignore: [[link_5, link_7]]      pairs that are not checked; self_collision: false checks the objects only

\b
What is written to DIR:
  trajectory.csv   time [s], then position, velocity, acceleration of every joint [rad, rad/s, rad/s^2];
                   with --home also approach and return, and a column segment: approach, excite, return
  trajectory-V.csv the same motion at part V of its speed (--speed), for rehearsals
  precision.json   with --precision: half-widths, periods tried, robot time against precision (precision.csv, a figure)
  design.json      criteria, limits over continuous time, predicted accuracy, everything to run it again
  *.png, or --figures  the motion within its limits, the singular spectrum, the progress of the search
  periods/         with --precision: the starts of every search, so that the same command after a kill goes on
  starts/          every start, written as soon as it ends; the same command after a kill goes on from them""",
)
@click.argument("robot", type=RobotName())
@click.option("--out", "out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@task_file_option("YAML file with these options as keys.")
@click.option(
    "--base",
    multiple=True,
    default=("gautier",),
    metavar="NAME",
    help="Base columns of the criterion; gautier, pivoted or orthonormal.",
)
@robot_file_options()
@task_options(PARTS, without=("base",))
@own_parts
@figure_options()
@click.option("--force", is_flag=True, help="Replace a design that is already in DIR.")
@click.option("--fresh", cls=FurtherOption, is_flag=True, help="Remove the starts that an earlier run has left in DIR.")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    robot: str,
    out: Path,
    task_file: Path | None,
    parts: tuple[str, ...],
    force: bool,
    fresh: bool,
    figures: FigureChoice,
    **_: Any,
) -> None:
    """Find the motion that identifies ROBOT's dynamic parameters best, within all its limits, and write it to DIR.

    ROBOT is a built-in name (see 'excite robots'), a robot YAML, a URDF or an MJCF. The motion is at rest at both
    ends; it minimises the condition number of the regressor, or another --criterion, within limits at all times.
    """
    from excite.cli.design_run import design_and_write

    task = _task(ctx, robot, task_file, parts)
    both = split_base(ctx.params["base"])[1] is not None
    notes = (_BASE_TOO,) if both else ()
    design, files = design_and_write(task, out, notes, figures=figures, force=force, fresh=fresh)
    _show(design, files, out)
    sys.exit(_status(design))


def _task(ctx: click.Context, robot: str, task_file: Path | None, parts: tuple[str, ...]) -> Task:
    """The task of a file and of options, which win over it."""
    from excite.design.task_file import read_task_file, task_from_options

    filed = read_task_file(task_file) if task_file else {}
    typed = _typed(ctx)
    limits = {name: typed.pop(name) for name in OF_JOINTS if name in typed}
    options = {**filed, **typed, "limits": {**filed.get("limits", {}), **limits}, "robot": robot}
    task = task_from_options(options, begin=_begin(options.get("begin"), parts))
    _check_base_link(robot, task.base_link)
    return task


def _show(design: Design, files: list[Path], out: Path) -> None:
    """Print the summary."""
    from excite.cli.summary import show
    from excite.cli.view_text import print_view, view_summary
    from excite.design.design_folder import design_content
    from excite.views.design_view import design_view

    def content() -> dict[str, Any]:
        left_out = ("schema", "robot", "solver", "conventions")
        return {"out": str(out), **{k: v for k, v in design_content(design).items() if k not in left_out}}

    view, runs = design_view(design), None if design.precision is None else design.precision.runs
    steps = [_NEXT if runs is None else _NEXT_RUNS.format("once" if runs == 1 else f"{runs} times in one recording")]
    show(view_summary(view, files, steps, "design.json"), content, lambda: print_view(view, files, steps))


def _begin(folder: str | None, parts: tuple[str, ...]) -> Design | None:
    """The design that the search begins with, where parts of its own may be imported; else its folder will do."""
    from excite.design.design_json import load_design

    return load_design(folder, parts) if folder is not None and parts else None


def _check_base_link(robot: str, link: str | None) -> None:
    """Refuse a --base that is neither a convention nor the base link of a file with a tree of links."""
    from regressors.readers.library import has_tree

    if link is not None and not has_tree(robot):
        conventions = ", ".join(CONVENTIONS)
        raise click.UsageError(
            f"--base {link!r}: expected one of {conventions}, or the base link of a URDF, a xacro or an MJCF"
        )


def _status(design: Design) -> int:
    from excite.cli.interrupts import interrupted_status
    from excite.cli.main import NOT_HELD

    if design.interrupted:
        say("excite: interrupted; the best feasible motion so far is saved")
        return interrupted_status()
    met = design.precision is None or design.precision.met
    return 0 if design.feasible and met else NOT_HELD


def _typed(ctx: click.Context) -> dict[str, Any]:
    """Options given on the command line, as keys of a task."""
    typed = {name: value for name, value in typed_options(ctx).items() if name != "base"}
    typed |= robot_file_typed(ctx.params)
    if ctx.get_parameter_source("base") is not ParameterSource.DEFAULT:
        convention, link = split_base(ctx.params["base"])
        typed |= {"base": convention} if convention else {}
        typed |= {"base_link": link} if link else {}
    return typed
