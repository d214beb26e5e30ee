"""``excite identify``: the parameters of a robot from its logs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from excite.cli.command import Command
from excite.cli.figure_options import figure_options
from excite.cli.options import (
    Folder,
    Number,
    NumberOr,
    Numbers,
    PartName,
    RobotName,
    SettingNames,
    own_parts,
    reading_options,
)
from excite.cli.task_options import task_options, typed_options
from excite.registry import CHOSEN, COVARIANCES, DROPPABLE, ESTIMATORS, EXECUTORS, SIGNALS
from excite.tasks.task import PLACE

_RECIPE = (
    "rows", "signals", "cutoff", "period", "harmonics", "average", "measured_velocity", "low_pass", "every",
    "estimator", "covariance", "temperature", "sign_width", "breakaway", "pull", "described_within", "delay",
    "standstill", "friction_scale",
)  # fmt: skip


class Width(click.ParamType[float | tuple[float, ...] | None]):
    """A velocity or a distance, one of each drive, or ``auto``."""

    name = "width"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | tuple[float, ...] | None:
        """Convert the text of the option."""
        if value is None or value == "auto":
            return None
        try:
            numbers = Numbers().convert(value, param, ctx)
        except click.BadParameter as error:
            self.fail(f"expected auto or a number; {error.message}", param, ctx)
        return numbers if len(numbers) > 1 else numbers[0]


class Delay(NumberOr):
    """A time, or ``auto``, which is None."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert the text of the option."""
        number = super().convert(value, param, ctx)
        return None if number == self.word else number


_GROUPS = {
    "Motion": ("design_folder", "designs", "period", "harmonics"),
    "Model": ("friction_curves",),
    "Logs": ("mapping", "drop", "rows", "temperature"),
    "Signals": ("signals", "cutoff", "delay", "average", "measured_velocity", "low_pass", "every"),
    "Friction in the equations": ("sign_width", "breakaway", "standstill", "friction_scale"),
    "Estimator": ("estimator", "covariance", "pull", "described_within", "choose"),
    "Drive gains": ("loaded", "known_mass", "gains"),
    "Repetitions": ("each", "repeat", "seed", "executor", "workers"),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
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
wrench.torque.z [N, Nm] for the load models. Recordings in MCAP, rosbag2, Parquet, NPZ, HDF5, MATLAB, folders of
signals and text of PlotJuggler, RTDE or libfranka are recognised by their content; 'excite logs LOG' shows what they
hold. What does not say all needs a --mapping: a YAML file that says which columns hold what, in which units, at the
joints or at the motors, in one file or several; 'excite logs LOG --write-mapping FILE' proposes one.

\b
Held, missing and unreadable rows, gaps of up to a second, wrong readings, impacts and torques at their limits are
found, reported with their rows, and make no equations; --rows all uses impacts and torques at limits. Time stamps that
jitter over evenly sampled rows are put right.

\b
Estimators:
  weighted       least squares, each joint weighted by its residual
  least-squares  the same without weights            huber          outliers count less
  recursive      sample by sample, with its history  total          errors in the motion too
  instrumental   unbiased if the motion is noisy; needs --design
  physical       only parameters that are physically possible
  ridge          shrinks towards the described values; cross-validation chooses the weight

\b
Settings that are not given are chosen (--choose): blocks of time are left out one after the other and predicted from
the others; what predicts their measured torques best, and clearly better than something simpler, is taken.
  cutoff, signals (savitzky-golay, spline or fourier instead of butterworth, or measured velocities), delay,
  friction_scale (of --friction-curves), standstill, estimator (with how near bodies are held to their description),
  joint_rotors, and of each drive offset, load_share, root_friction, asymmetric_friction, stribeck

\b
What is written to DIR:
  result.json   parameters with 99 % intervals, their logs and settings, everything to verify them
  *.png         torques, residuals, parameters, estimates over time""",
)
@click.argument("robot", type=RobotName())
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@click.option(
    "--design", "design_folder", type=Folder(), metavar="DIR", help="Design that was played; also gives the model."
)
@click.option(
    "--designs",
    type=Folder(),
    multiple=True,
    metavar="DIR",
    help="Instead: folder of designs to look in for the one that the mapping names; repeatable.  [default: the "
    "mapping's folder and 'designs']",
)
@click.option("--base-link", "--base", "base_link", metavar="LINK", help="First link of the chain, for a URDF or MJCF.")
@click.option("--tip", metavar="LINK", help="Last link of the chain, for a URDF or MJCF.")
@reading_options
@task_options(
    ("installation", "model"),
    without=("friction_curves",),
    help={
        "model": "Equations to identify from.",
        "joints": "Joints that moved, by name or number; the others stood still.",
        "drives": "Instead of joints: drives that moved.",
        "equations": "Rows to use.  [default: all]",
    },
)
@click.option(
    "--friction-curves",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Known friction curves, which are subtracted; drives without one keep their friction parameters.",
)
@click.option(
    "--loaded",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="LOG",
    help="Log with a load of known mass at the last link, which calibrates the drive gains; repeatable.",
)
@click.option("--known-mass", type=Number(), metavar="M", help="Mass of that load [kg].")
@click.option(
    "--gains", type=click.Choice(["each", "common"]), default="each", help="One gain for each drive, or one for all."
)
@click.option(
    "--temperature",
    type=Numbers(),
    metavar="T,...",
    help="Temperature of logs without NAME.temperature, for friction curves that depend "
    "on it [deg C]: one, or one per joint.",
)
@click.option(
    "--mapping",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="YAML file with the columns and units of a log in another format.",
)
@click.option(
    "--drop", multiple=True, type=click.Choice(DROPPABLE), help="Faulty rows to leave out instead of refusing the log."
)
@click.option(
    "--rows",
    default="auto",
    metavar="A:B",
    help="Rows to use: auto finds the motion; all; or from row A to B, and nothing else is checked.",
)
@click.option(
    "--signals",
    type=click.Choice(SIGNALS),
    help="Method that differentiates the positions.  [default: butterworth, or chosen]",
)
@click.option(
    "--cutoff",
    type=Number(),
    metavar="HZ",
    help="Cutoff frequency of butterworth, and bandwidth of savitzky-golay and spline.  [default: chosen]",
)
@click.option(
    "--delay",
    type=Delay("auto"),
    default="auto",
    metavar="S",
    help="Delay of the recorded torques after the positions [s]; 0: none.",
)
@click.option("--period", type=Number(), metavar="S", help="Period of the motion.  [default: the design's, or found]")
@click.option(
    "--harmonics",
    type=Number(),
    metavar="N",
    help="Harmonics of the motion, for fourier.  [default: from the motion]",
)
@click.option("--average", is_flag=True, help="Average each log over whole periods first.")
@click.option("--measured-velocity", is_flag=True, help="Use the log's velocities.")
@click.option("--low-pass", type=Number(), metavar="HZ", help="The same low-pass on both sides of the equations.")
@click.option(
    "--every",
    type=Number(),
    metavar="N",
    help="Keep every N-th instant.  [default: all, or as the cutoff of --low-pass allows]",
)
@click.option(
    "--sign-width",
    type=Width(),
    default="auto",
    metavar="V",
    help="Velocity over which Coulomb friction changes sign, or one of each drive; 0: sign().",
)
@click.option(
    "--breakaway",
    type=Width(),
    default="auto",
    metavar="D",
    help="Instead: presliding distance over which it changes sign [rad]; 0: none.",
)
@click.option(
    "--standstill",
    type=Width(),
    default="auto",
    metavar="V",
    help="Leave out rows while a drive is slower, where friction may hold it [rad/s]; 0: none.",
)
@click.option(
    "--scale-friction/--no-scale-friction",
    "friction_scale",
    default=None,
    help="Scale each known friction curve by one fitted factor, or subtract it as given.  [default: chosen]",
)
@click.option(
    "--estimator",
    type=PartName("estimator", ESTIMATORS),
    help="Estimator; see below.  [default: weighted or physical, chosen]",
)
@click.option(
    "--covariance",
    type=click.Choice(COVARIANCES),
    default="auto",
    help="Residuals assumed white, or with their autocorrelation.",
)
@click.option(
    "--pull",
    type=Number(),
    default=0.0,
    metavar="W",
    help="Weight of the described bodies in the estimator physical.",
)
@click.option(
    "--described-within",
    type=Number(),
    metavar="X",
    help="Instead: hold bodies within about X times their size of the description (estimator physical).",
)
@click.option(
    "--choose",
    type=SettingNames(CHOSEN),
    default="all",
    metavar="all|none|NAME,...",
    help="Settings to choose by predicting torques that were left out, where they are not given; see below.",
)
@own_parts
@click.option("--each", is_flag=True, help="Of several logs: the estimate of each alone too, beside their scatter.")
@click.option("--repeat", type=Number(), default=0, metavar="N", help="Repeat the experiment N times in simulation.")
@click.option("--seed", type=Number(), default=0, metavar="N", help="Seed of the repetitions.")
@click.option(
    "--executor",
    type=PartName("executor", EXECUTORS, own=False),
    default="process",
    help="Where repetitions run, with the same numbers; those of less than 10 s and those on a GPU stay in this "
    "process.",
)
@click.option(
    "--workers",
    type=Number(),
    metavar="N",
    help="Processes for the repetitions.  [default: one per core, as memory allows]",
)
@figure_options()
@click.option("--force", is_flag=True, help="Replace a result that is already in DIR.")
@click.pass_context
def command(ctx: click.Context, /, robot: str, logs: tuple[Path, ...], out: Path, **options: Any) -> None:
    """Identify ROBOT's dynamic parameters from one LOG or several, and write them to DIR with their uncertainty.

    ROBOT is a built-in name, a robot YAML, a URDF or an MJCF. The exciting stretch of each log is found, velocities and
    accelerations are made from the positions, and the base parameters are estimated from all logs together.
    """
    from excite.cli.identify_run import identify_and_write
    from excite.identification.recipe import Recipe

    typed = {name: value for name, value in typed_options(ctx).items() if PLACE[name] in ("installation", "model")}
    typed.pop("friction_curves", None)
    for name in ("executor", "workers"):
        if _is_typed(ctx, name) and not options["repeat"]:
            raise click.UsageError(f"--{name} is for repetitions: give their number, --repeat N")
    of_recipe = {name: options[name] for name in _RECIPE if _is_typed(ctx, name) and options[name] is not None}
    Recipe(**of_recipe)
    identify_and_write(robot, logs, out, typed, of_recipe, options)


def _is_typed(ctx: click.Context, name: str) -> bool:
    return ctx.get_parameter_source(name) is not ParameterSource.DEFAULT
