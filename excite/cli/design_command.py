"""``excite design``: the motion for a robot, as files."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from excite.cli.options import Box, Folder, Known, Names, Numbers, Pose, Ranges, Triple, split_base, tell_left_out
from excite.registry import CONVENTIONS, CRITERIA, EXECUTORS, MODELS, SCALES, SOLVERS, STARTS, TRAJECTORIES, WINDOWS

if TYPE_CHECKING:
    from excite.design.design import Design


@click.command(
    name="design",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True},
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
  excite design irp6 --task task.yaml --out designs/irp6     (options given here win over the file's)

\b
Families of motions (--trajectory):
  fourier          Fourier series; rest at both ends costs two of its terms
  fourier-quintic  Fourier series and a polynomial of fifth order that takes the conditions at the ends
  cosine           to and fro along the same path
  bspline          B-splines on equal intervals
  waypoints        quintic splines through free waypoints at free times (6 intervals are plenty)
  sines            sums of sines of free frequencies and phases, and a polynomial for the ends

\b
What the criterion takes into account:
  --noise 0.1,0.2,0.1 --weighted   rows of W are divided by the noise of their equations
  --prior 0.2                      and what the robot's description states is known to 20 %
  --prior known.yaml               and of some parameters value and deviation: X7: {value: 8.1, deviation: 0.5}
  --scale prior, --scale value     a deviation counts as a part of that known beforehand, or of the value

\b
What --world FILE says (YAML; lengths in m, frames of the links and of the base):
  clearance: 0.01
  robot: [{link: link_3, from: [0, 0, -0.2], to: [0, 0, 0], radius: 0.08}]    or urdf: its <collision> elements
  objects: {table: {plane: {normal: [0, 0, 1]}}, post: {capsule: {from: [0.5, 0, 0], to: [0.5, 0, 1], radius: 0.05}},
            crate: {box: {centre: [0.4, 0.4, 0.1], size: [0.2, 0.2, 0.2]}}, ball: {sphere: {centre: ..., radius: ...}}}
  ignore: [[link_5, link_7]]      pairs that need not stay apart; self_collision: false checks the objects only

\b
What is written to DIR:
  trajectory.csv   time [s], then position, velocity, acceleration of every joint [rad, rad/s, rad/s^2];
                   with --home also the way in and out, and a column segment: approach, excite, return
  trajectory-V.csv the same motion at part V of its speed (--speed), for rehearsals
  design.json      criteria, limits over continuous time, predicted accuracy, everything to run it again
  *.png            the motion within its limits, the singular spectrum, the course of the search
  starts/          every start, written as soon as it ends""",
)
@click.argument("robot")
@click.option("--out", "out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@click.option(
    "--task", "task_file", type=click.Path(path_type=Path), metavar="FILE", help="YAML file with these options as keys."
)
@click.option(
    "--base",
    multiple=True,
    default=("gautier",),
    metavar="NAME",
    help="Base columns of the criterion: gautier, pivoted or orthonormal. Any other name is the URDF's base link.",
)
@click.option("--tip", metavar="LINK", help="Last link of the chain, for a URDF.")
@click.option("--joints", type=Names(), metavar="1,3", help="Joints that move, by name or number; the others rest.")
@click.option("--drives", type=Names(), metavar="2", help="Instead of joints: drives that move; the others hold z.")
@click.option(
    "--model", type=click.Choice(MODELS), default="differential", help="Which equations are used to identify."
)
@click.option("--window", type=click.Choice(WINDOWS), default="short", help="Time windows of energy and load-integral.")
@click.option("--window-length", type=float, default=0.005, metavar="S", help="Length of the short windows [s].")
@click.option("--sensor", metavar="LINK", help="Link with the force/torque sensor (load models).  [default: the last]")
@click.option("--sensor-xyz", type=Triple(), metavar="X,Y,Z", help="Sensor's origin in that link's frame [m].")
@click.option("--sensor-rpy", type=Triple(), metavar="R,P,Y", help="Sensor's axes: roll, pitch, yaw [rad].")
@click.option(
    "--equations",
    type=Names(),
    metavar="fx,nz",
    help="Rows to use: of the wrench, or torques by joint.  [default: all]",
)
@click.option("--friction/--no-friction", default=True, help="Coulomb and viscous friction as parameters.")
@click.option("--rotor/--no-rotor", default=True, help="Rotor inertias as parameters, where the robot's file has them.")
@click.option("--joint-rotors", is_flag=True, help="A rotor inertia per joint, also where the robot's file has none.")
@click.option("--offset/--no-offset", default=False, help="A constant friction offset per drive as a parameter.")
@click.option("--friction-curves", metavar="FILE", help="Friction known beforehand, not identified.")
@click.option("--trajectory", type=click.Choice(TRAJECTORIES), default="fourier", help="Family of motions; see below.")
@click.option("--period", type=float, default=10.0, metavar="S", help="Duration of the motion [s].")
@click.option("--harmonics", type=int, default=5, metavar="N", help="Harmonics of the series; number of sines.")
@click.option("--intervals", type=int, default=15, metavar="N", help="Intervals of B-splines or between waypoints.")
@click.option("--order", type=int, default=6, metavar="N", help="Order of the B-splines: 4 (cubic), 5 or 6 (quintic).")
@click.option("--criterion", type=click.Choice(CRITERIA), default="condition", help="What is minimised.")
@click.option("--position-limit", type=Ranges(), metavar="L:U,...", help="Position limits per joint [rad or m].")
@click.option("--velocity-limit", type=Numbers(), metavar="V,...", help="Velocity limits [rad/s], one or one each.")
@click.option("--acceleration-limit", type=Numbers(), metavar="A,...", help="Acceleration limits [rad/s^2].")
@click.option("--jerk-limit", type=Numbers(), metavar="J,...", help="Jerk limits [rad/s^3].")
@click.option("--torque-margin", type=float, metavar="X", help="Impose torque limits; 0.2 keeps 20 % in reserve.")
@click.option(
    "--tool-box", type=Box(), metavar="L:U,L:U,L:U", help="Where the tool may be, x,y,z [m], such as -1:1,:,0:."
)
@click.option("--tool-speed", type=float, metavar="V", help="Largest speed of the tool [m/s].")
@click.option("--tool-point", type=Triple(), metavar="X,Y,Z", help="The tool in the last link's frame [m].")
@click.option("--world", metavar="FILE", help="Shape of the robot and obstacles, to stay apart; see below.")
@click.option("--noise", type=Numbers(), metavar="S,...", help="Noise of each equation, in its unit.  [default: 1]")
@click.option("--weighted/--no-weighted", default=False, help="Criterion of rows divided by their noise.")
@click.option("--prior", type=Known(), metavar="R|FILE", help="Criterion with what is known beforehand; see below.")
@click.option("--scale", type=click.Choice(SCALES), default="unit", help="What parameters are measured in; see below.")
@click.option("--starts", type=int, default=12, metavar="N", help="Random starts; the best one is taken.")
@click.option("--seed", type=int, default=0, metavar="N", help="Same seed, same machine: same motion.")
@click.option(
    "--start", type=Names(), default="random", metavar="KIND,...", help=f"Start: {', '.join(STARTS)}; one or one each."
)
@click.option("--begin", metavar="DIR", help="Begin with the motion of this design, of whatever family.")
@click.option("--require", type=Names(), metavar="X5,F3c", help="Parameters that the motion must show on their own.")
@click.option("--solver", type=click.Choice(SOLVERS), default="sqp", help="sqp is fast; ipopt is a cross-check.")
@click.option("--executor", type=click.Choice(EXECUTORS), default="process", help="Where the starts run.")
@click.option("--workers", type=int, metavar="N", help="Processes.  [default: one per core]")
@click.option("--rate", type=float, default=100.0, metavar="HZ", help="Samples per second of trajectory.csv.")
@click.option("--home", type=Pose(), metavar="Q,...", help="Pose to come from and return to [rad]; robot: its file's.")
@click.option("--via", type=Numbers(), multiple=True, metavar="Q,...", help="Pose on the way from home; repeatable.")
@click.option("--settle", type=float, default=1.0, metavar="S", help="Rest before and after the exciting motion [s].")
@click.option("--speed", type=Numbers(), metavar="V,...", help="Write slower rehearsals too: 0.1 for a tenth of speed.")
@click.option("--force", is_flag=True, help="Replace a design that is already in DIR.")
@click.option("--format", "form", type=click.Choice(["text", "json"]), default="text", help="Form of the summary.")
@click.pass_context
def command(
    ctx: click.Context, /, robot: str, out: Path, task_file: Path | None, force: bool, form: str, **_: Any
) -> None:
    """Find the motion that shows ROBOT's dynamic parameters best, within all its limits, and write it to DIR.

    ROBOT is a built-in name (see 'excite robots'), a robot YAML, or a URDF. The motion is at rest at both
    ends; it minimises the condition number of the regressor, or another --criterion. Limits hold at all times, not
    only at samples; those of torques, of the tool and of collisions too, if asked for.
    """
    from excite.cli.design_text import print_design
    from excite.cli.interrupts import one_interrupt
    from excite.cli.progress import progress_of_starts
    from excite.design.formulation import formulate
    from excite.design.optimisation import solve
    from excite.files.design_folder import design_content, prepare_folder, write_design
    from excite.files.task_file import read_task_file, task_from_options
    from excite.information.metrics import noise_per_row
    from excite.plots import write_figures
    from regressors.readers.library import load_robot

    typed, filed = _given(ctx, task_file is not None), read_task_file(task_file) if task_file else {}
    limits = {**filed.get("limits", {}), **typed.get("limits", {})}
    task = task_from_options({**filed, **typed, "limits": limits, "robot": robot})
    _check_base_link(robot, task.base_link)
    if task.known_friction is not None:
        tell_left_out({**filed, **_given(ctx, only_explicit=True)})
    described = load_robot(robot, base=task.base_link, tip=task.tip)
    formulation = formulate(described, task)
    noise_per_row(task.objective.noise, formulation.subject.model)
    starts = prepare_folder(out, force=force)
    for note in formulation.notes:
        click.echo(f"excite: note: {note}", err=True)
    with one_interrupt() as ignore_interrupts:
        with progress_of_starts(task.search.starts, at_end=ignore_interrupts) as progress:
            design = solve(described, formulation, starts, progress)
        files = [*write_figures(design, out), *write_design(design, out)]
    if form == "json":
        content = design_content(design)
        left_out = ("schema", "robot", "solver", "conventions")
        click.echo(json.dumps({"out": str(out), **{k: v for k, v in content.items() if k not in left_out}}, indent=1))
    else:
        print_design(design, files)
    sys.exit(_status(design))


def _check_base_link(robot: str, link: str | None) -> None:
    """A --base that is no convention must be a link, which only a URDF has."""
    if link is not None and not robot.lower().endswith((".urdf", ".xml")):
        conventions = ", ".join(CONVENTIONS)
        raise click.UsageError(f"--base {link!r}: expected one of {conventions}, or the base link of a URDF")


def _status(design: Design) -> int:
    from excite.cli.main import INTERRUPTED, NOT_HELD

    if design.interrupted:
        click.echo("excite: interrupted; the best feasible motion so far is saved", err=True)
        return INTERRUPTED
    return 0 if design.feasible else NOT_HELD


def _given(ctx: click.Context, only_explicit: bool) -> dict[str, Any]:
    """Options of the command line as keys of a task; with a task file only those that were typed."""
    values = {
        name: value
        for name, value in ctx.params.items()
        if name not in ("robot", "out", "task_file", "force", "form")
        and (not only_explicit or ctx.get_parameter_source(name) is not ParameterSource.DEFAULT)
    }
    limits = {
        what: values.pop(f"{what}_limit")
        for what in ("position", "velocity", "acceleration", "jerk")
        if values.get(f"{what}_limit") is not None
    }
    values = {name: value for name, value in values.items() if value is not None and not name.endswith("_limit")}
    if "base" in values:
        convention, link = split_base(values.pop("base"))
        values |= {"base": convention} if convention else {}
        values |= {"base_link": link} if link else {}
    return {**values, "limits": limits} if limits else values
