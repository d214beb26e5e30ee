"""``excite identify`` and ``verify``: the parameters of a robot from its logs, and a verdict on them."""

from __future__ import annotations

import click

from excite.cli.command import command, further_option
from excite.cli.lazy import runs
from excite.cli.option_types import ALL_OR_NONE, FILE, Folder, Names, RobotName
from excite.cli.options import (
    drop_option,
    executor_options,
    figure_options,
    file_option,
    folder_option,
    mapping_option,
    own_parts,
    robot_file_options,
    settings_options,
)
from excite.identification.recipe import Recipe
from excite.registry import CHOSEN
from excite.tasks.further_settings import Extents, GainSettings, RepeatSettings, Tolerances
from excite.tasks.installation import Installation
from excite.tasks.model_choice import ModelChoice


@command(
    groups={
        "Motion": ("design_folder", "designs", "period", "harmonics"),
        "Model": ("friction_curves", "result"),
        "Logs": ("mapping", "drop", "rows", "temperature"),
        "Signals": ("signals", "cutoff", "delay", "bias", "average", "measured_velocity", "low_pass", "every"),
        "Friction in the equations": ("sign_width", "breakaway", "standstill", "friction_scale"),
        "Estimator": ("estimator", "covariance", "described_within", "choose"),
        "Drive gains": ("loaded", "known_mass", "gains"),
        "Repetitions": ("each", "repeat", "seed", "executor", "workers"),
    },
    epilog="""\b
Examples:
  excite identify irp6 run1.csv run2.csv --design designs/irp6 --out results/irp6
  excite identify ur10e log.csv --mapping ur10e.yaml --joint-rotors --offset --out results/ur10e
  excite identify irp6 run.csv --model energy --out results/energy
  excite identify so101 run1 run2 --model servo --out results/servos        from commands, without torques
  excite identify ur10e log.csv --model servo --result results/ur10e --out results/drives
  excite identify irp6 run.csv --friction-curves friction.yaml --out results/masses

\b
A log is a CSV file with a header: time [s], then NAME.position, NAME.effort [rad, Nm] and, where measured,
NAME.velocity, NAME.command (commanded position) and NAME.temperature [deg C] of each joint (or one temperature for
all); wrench.force.x ... wrench.torque.z [N, Nm] for the load models. Recordings in MCAP, rosbag2, Parquet, NPZ, HDF5,
MATLAB, JSON, folders of signals and text of PlotJuggler, RTDE, libfranka or ROS are recognised by their content;
'excite logs LOG' shows what they hold. What does not say all needs a --mapping: a YAML file that says which columns
hold what, in which units, at the joints or at the motors, in one file or several; 'excite logs LOG --write-mapping
FILE' proposes one.

\b
Held, missing and unreadable rows, gaps of up to a second, wrong readings, impacts and torques at their limits are
found, reported with their rows, and make no equations; --rows all uses impacts and torques at limits. Time stamps that
jitter over evenly sampled rows are put right.

\b
Estimators:
  weighted       least squares, each joint weighted by its residual
  least-squares  the same without weights            huber          outliers count less
  recursive      sample by sample, with its history  instrumental   unbiased if the motion is noisy; needs --design
  physical       only parameters that are physically possible

\b
Settings that are not given are chosen (--choose): blocks of time are left out one after the other and predicted from
the others; what predicts their measured torques best, and clearly better than something simpler, is taken.
  cutoff, signals (savitzky-golay, spline or fourier instead of butterworth, or measured velocities), delay, bias (of a
  force/torque sensor), friction_scale (of --friction-curves), standstill, estimator (with how near bodies are held to
  their description), joint_rotors, and of each drive offset, load_share, root_friction, asymmetric_friction, stribeck

\b
What is written to DIR:
  result.json   parameters with 99 % intervals, their logs and settings, everything to verify them
  *.png         torques, residuals, parameters, estimates over time""",
)
@click.argument("robot", type=RobotName())
@click.argument("logs", nargs=-1, required=True, type=FILE, metavar="LOG...")
@folder_option("--out", required=True, help="Folder to write.")
@folder_option("--design", "design_folder", help="Design that was played; also gives the model.")
@further_option(
    "--designs",
    type=Folder(),
    multiple=True,
    metavar="DIR",
    help="Instead: folder of designs to look in for the one that the mapping names; repeatable.  [default: the "
    "mapping's folder and 'designs']",
)
@robot_file_options("--base")
@settings_options(
    Installation,
    ModelChoice,
    without=("friction_curves",),
    essential=("joints", "model", "friction", "joint_rotors", "offset"),
    help={
        "model": "Equations to identify from.",
        "joints": "Joints that moved, by name or number; the others stood still.",
        "drives": "Instead of joints: drives that moved.",
        "equations": "Rows to use.  [default: all]",
    },
)
@file_option(
    "--friction-curves",
    help="Known friction curves, which are subtracted; drives without one keep their friction parameters.",
)
@folder_option("--result", help="With --model servo: identified model whose masses set the scale of the servos.")
@further_option(
    "--loaded",
    multiple=True,
    type=FILE,
    metavar="LOG",
    help="Log with a load of known mass at the last link, which calibrates the drive gains; repeatable.",
)
@settings_options(GainSettings)
@mapping_option
@drop_option
@settings_options(Recipe)
@click.option(
    "--choose",
    type=Names(ALL_OR_NONE, CHOSEN),
    default="all",
    metavar="all|none|NAME,...",
    help="Settings to choose by predicting torques that were left out, where they are not given; see below.",
)
@own_parts
@settings_options(RepeatSettings)
@executor_options(
    "Where repetitions run, with the same numbers; those of less than 10 s and those on a GPU stay in this process.",
    "Processes for the repetitions.  [default: one per core, as memory allows]",
)
@figure_options()
@click.option("--force", is_flag=True, help="Replace a result that is already in DIR.")
@runs("identify_run:identify_and_write")
def identify() -> None:
    """Identify ROBOT's dynamic parameters from one LOG or several, and write them to DIR with their uncertainty.

    ROBOT is a built-in name, a robot YAML, a URDF or an MJCF. The exciting stretch of each log is found, velocities and
    accelerations are made from the positions, and the base parameters are estimated from all logs together.
    """


@command(
    groups={
        "Verdict": ("torque", "motion", "horizon", "training_too"),
        "Logs": ("mapping", "drop", "rows", "signals", "temperature"),
    },
    epilog="""\b
Examples:
  excite verify results/irp6 validation.csv
  excite verify results/ur10e ptp.csv --mapping ur10e.yaml --torque-tolerance 6
  excite verify results/irp6 a.csv b.csv --horizon 1 --json

\b
Of each log the torques are predicted along the measured motion, and joint by joint they are confirmed, contradicted,
not known, where the error is within what the result's covariance allows, or not to be judged: noise of the
measurement above the frequencies of the motion does not count, nor what friction holds at standstill. The verdict is
negative if a joint is contradicted or not known, if the error over all joints exceeds its tolerance or is much larger
than on the logs of the identification, or if the identification doubts the result. It answers three questions: are
the torques predicted, are the parameters those of a possible robot, which of them are known. Servos are judged by the
motion that follows from their commands.
The motion that the model simulates from the measured torques, restarted from the measured state after each horizon, is
shown, and a remark where it deviates; where it diverges, as a light wrist's does, the horizon is halved.
Of a log longer than 60 s, the motion is simulated in 60 windows at most, spread evenly over it.
Exit status 0: the verdict is positive; 1: it is negative.

\b
What is written to DIR (or --out), per log:
  verification-LOG.json    errors of every joint and what limits them, the verdict with its reasons
  verification-LOG-*.png   measured and predicted torques, measured and simulated motion""",
)
@click.argument("folder", type=Folder(), metavar="DIR")
@click.argument("logs", nargs=-1, required=True, type=FILE, metavar="LOG...")
@folder_option("--out", help="Folder to write.  [default: that of the result]")
@mapping_option
@drop_option
@settings_options(Tolerances)
@settings_options(Extents, only=("horizon",))
@settings_options(
    Recipe, only=("rows", "signals", "temperature"), unset={"signals": "as identified", "temperature": "as identified"}
)
@own_parts
@figure_options()
@click.option("--training-too", is_flag=True, help="Accept logs that the result was identified from.")
@runs("identify_run:verify_and_write")
def verify() -> None:
    """Judge the result in DIR on each LOG: predicted torques, simulated motion, and a verdict with its reasons.

    A LOG must be of the same robot, and must not be one that the result was identified from.
    """
