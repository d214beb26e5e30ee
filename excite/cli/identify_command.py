"""``excite identify``: the parameters of a robot from its logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from excite.cli.options import Folder, Names, Numbers, Triple, tell_left_out
from excite.registry import COVARIANCES, DROPPABLE, ESTIMATORS, MODELS, SIGNALS, WINDOWS

if TYPE_CHECKING:
    from excite.design.stored_design import StoredDesign
    from excite.identification.recipe import Recipe
    from excite.tasks.task import Task

_MODEL = (
    "tip", "joints", "drives", "model", "window", "window_length", "sensor", "sensor_xyz", "sensor_rpy", "equations",
    "friction", "rotor", "joint_rotors", "offset",
)  # fmt: skip
_RECIPE = (
    "rows", "signals", "cutoff", "period", "harmonics", "average", "measured_velocity", "low_pass", "every",
    "estimator", "covariance", "temperature",
)  # fmt: skip


class Width(click.ParamType[float | None]):
    """A velocity or a distance, or ``auto``."""

    name = "width"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | None:
        """Value of the text that was typed."""
        if value is None or value == "auto":
            return None
        try:
            return float(value)
        except ValueError:
            self.fail(f"expected auto or a number, given {value!r}", param, ctx)


@click.command(
    name="identify",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True},
    epilog="""\b
Examples:
  excite identify irp6 run1.csv run2.csv --design designs/irp6 --out results/irp6
  excite identify ur10e log.csv --mapping ur10e.yaml --joint-rotors --offset --out results/ur10e
  excite identify irp6 run.csv --model energy --out results/energy
  excite identify irp6 run.csv --estimator physical --out results/possible
  excite identify irp6 run.csv --friction-curves friction.yaml --out results/masses

\b
A log is a CSV file with a header: time [s], then NAME.position, NAME.effort [rad, Nm] and, where measured,
NAME.velocity and NAME.temperature [deg C] of each joint (or one temperature for all); wrench.force.x ...
wrench.torque.z [N, Nm] for the load models. Other files need a --mapping: a YAML file that says which columns hold
what, in which units.

\b
Estimators:
  weighted       least squares, each joint weighted by its residual
  least-squares  the same without weights            huber          outliers count less
  recursive      sample by sample, with its history  total          errors in the motion too
  instrumental   unbiased if the motion is noisy; needs --design
  physical       only parameters that a real robot can have

\b
What is written to DIR:
  result.json   parameters with 99 % intervals, what they rest on, everything to verify them
  *.png         torques, residuals, parameters, estimates over time""",
)
@click.argument("robot")
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@click.option("--design", "played", type=Folder(), metavar="DIR", help="Design that was played; gives the model too.")
@click.option("--base", "base_link", metavar="LINK", help="First link of the chain, for a URDF.")
@click.option("--tip", metavar="LINK", help="Last link of the chain, for a URDF.")
@click.option("--model", type=click.Choice(MODELS), default="differential", help="Equations to identify from.")
@click.option("--window", type=click.Choice(WINDOWS), default="short", help="Time windows of energy and load-integral.")
@click.option("--window-length", type=float, default=0.005, metavar="S", help="Length of the short windows [s].")
@click.option("--joints", type=Names(), metavar="1,3", help="Joints that moved, by name or number; the others rested.")
@click.option("--drives", type=Names(), metavar="2", help="Instead of joints: drives that moved.")
@click.option("--sensor", metavar="LINK", help="Link with the force/torque sensor (load models).  [default: the last]")
@click.option("--sensor-xyz", type=Triple(), metavar="X,Y,Z", help="Sensor's origin in that link's frame [m].")
@click.option("--sensor-rpy", type=Triple(), metavar="R,P,Y", help="Sensor's axes: roll, pitch, yaw [rad].")
@click.option("--equations", type=Names(), metavar="fx,nz", help="Rows to use.  [default: all]")
@click.option("--friction/--no-friction", default=True, help="Coulomb and viscous friction as parameters.")
@click.option("--rotor/--no-rotor", default=True, help="Rotor inertias as parameters, where the robot's file has them.")
@click.option("--joint-rotors", is_flag=True, help="A rotor inertia per joint, also where the robot's file has none.")
@click.option("--offset/--no-offset", default=False, help="A constant friction offset per drive as a parameter.")
@click.option(
    "--friction-curves",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Friction known beforehand; subtracted. Intervals allow for the uncertainty that the file states.",
)
@click.option(
    "--temperature",
    type=Numbers(),
    metavar="T,...",
    help="Of logs without NAME.temperature, for friction curves that depend on it [deg C]: one, or one per joint.",
)
@click.option(
    "--mapping", type=click.Path(path_type=Path), metavar="FILE", help="YAML: what a foreign log's columns are."
)
@click.option(
    "--drop", multiple=True, type=click.Choice(DROPPABLE), help="Faulty rows to leave out instead of refusing the log."
)
@click.option(
    "--rows", default="auto", metavar="A:B", help="Rows to use: auto finds the motion; all; or from row A to B."
)
@click.option("--signals", type=click.Choice(SIGNALS), default="butterworth", help="From positions to accelerations.")
@click.option("--cutoff", type=float, metavar="HZ", help="Low-pass of butterworth.  [default: from the motion]")
@click.option("--period", type=float, metavar="S", help="Of a periodic motion.  [default: the design's, or found]")
@click.option("--harmonics", type=int, metavar="N", help="Of the motion, for fourier.  [default: from the motion]")
@click.option("--average", is_flag=True, help="Average each log over whole periods first.")
@click.option("--measured-velocity", is_flag=True, help="Use the log's velocities.")
@click.option("--low-pass", type=float, metavar="HZ", help="The same low-pass on both sides of the equations.")
@click.option("--every", type=int, metavar="N", help="Keep every N-th instant.  [default: all; as --low-pass allows]")
@click.option(
    "--sign-width", type=Width(), default="auto", metavar="V", help="Velocity over which friction turns; 0: sign()."
)
@click.option(
    "--breakaway",
    type=Width(),
    default="auto",
    metavar="D",
    help="Instead: distance over which it turns [rad]; 0: none.",
)
@click.option("--estimator", type=click.Choice(ESTIMATORS), default="weighted", help="See below.")
@click.option(
    "--covariance", type=click.Choice(COVARIANCES), default="auto", help="Residuals as white noise, or as they are."
)
@click.option("--pull", type=float, default=0.0, metavar="W", help="Pull of physical towards the described bodies.")
@click.option("--repeat", type=int, default=0, metavar="N", help="Repeat the experiment N times in simulation.")
@click.option("--seed", type=int, default=0, metavar="N", help="Of the repetitions.")
@click.option("--force", is_flag=True, help="Replace a result that is already in DIR.")
@click.option("--format", "form", type=click.Choice(["text", "json"]), default="text", help="Form of the summary.")
@click.pass_context
def command(ctx: click.Context, /, robot: str, logs: tuple[Path, ...], out: Path, **options: Any) -> None:
    """Identify ROBOT's dynamic parameters from one LOG or several, and write them to DIR with their uncertainty.

    ROBOT is a built-in name, a robot YAML, or a URDF. The exciting stretch of each log is found, velocities and
    accelerations are made from the positions, and the base parameters are estimated from all logs together.
    """
    from excite.cli.identify_run import identify_and_write

    task, design = _task(ctx, robot)
    if options["friction_curves"] is not None:
        tell_left_out({"friction": ctx.params["friction"] and _typed(ctx, "friction")})  # an offset: with the result
    identify_and_write(robot, logs, out, task, design, _recipe(ctx), options)


def _task(ctx: click.Context, robot: str) -> tuple[Task, StoredDesign | None]:
    """Model that is asked for: of the design, where one is named, with what was typed."""
    from excite.files.design_json import load_design
    from excite.files.task_file import task_from_options

    played = ctx.params["played"]
    design = None if played is None else load_design(played)
    given = {name: ctx.params[name] for name in (*_MODEL, "base_link") if design is None or _typed(ctx, name)}
    stored = {} if design is None else {name: getattr(design.task, name) for name in (*_MODEL, "base_link")}
    return task_from_options({**stored, **given, "robot": robot}), design


def _typed(ctx: click.Context, name: str) -> bool:
    return ctx.get_parameter_source(name) is not ParameterSource.DEFAULT


def _recipe(ctx: click.Context) -> Recipe:
    from excite.identification.recipe import Recipe

    return Recipe(
        **{name: ctx.params[name] for name in _RECIPE},
        sign_width=ctx.params["sign_width"],
        breakaway=ctx.params["breakaway"],
    )
