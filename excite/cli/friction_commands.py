"""``excite friction``: plan runs at constant speed, and fit friction curves to their logs."""

from __future__ import annotations

import click

from excite.cli.command import command, further_option
from excite.cli.lazy import runs
from excite.cli.option_types import FILE, Names, RobotName
from excite.cli.options import (
    drop_option,
    figure_options,
    folder_option,
    mapping_option,
    own_parts,
    robot_file_options,
    settings_options,
)
from excite.design.friction_runs.schedule import Schedule
from excite.friction.constant_speed_windows import FitSettings
from excite.tasks.further_settings import FrictionPoses
from excite.tasks.installation import Installation
from excite.tasks.limit_choice import LimitChoice

OF_RUNS = ("position", "velocity", "acceleration", "jerk", "floor", "self_collision")


@command(
    groups={
        "Drives and poses": ("drives", "joints", "pose", "balanced", "seed"),
        "Runs": ("percent", "shortest", "longest", "stroke", "warm_up", "repeats", "pause"),
        "Break-away tests": ("breakaways", "creep", "creeping", "torque_ramp", "ramping"),
    },
    epilog="""\b
Examples:
  excite friction plan irp6 --out friction/irp6
  excite friction plan irp6 --drives 1,2,3 --speeds 5,20,50,100 --shortest 0.25 --out friction/irp6
  excite friction plan ur10e --acceleration-limit 2 --jerk-limit 20 --out friction/ur10e
  excite friction plan ur10e --longest inf --torque-ramp 60,60,30,10,10,10 --out friction/ur10e
  excite friction plan arm.urdf --tip tool0 --world world.yaml --out friction/arm

\b
What is written to DIR:
  NAME.csv    one motion per joint or drive: time [s], then NAME.position, NAME.velocity, NAME.acceleration of
              every joint [SI], and segment: 'warm-up', 'transfer', 'rest', 'z1 +30 %', 'z1 stiction -' ...
  NAME.stiction.csv   for robots with a torque interface: the pose, and slow ramps of the torque of one drive in both
              directions, column DRIVE.effort, in segments 'z1 stiction +', 'z1 stiction -'. Gravity in the pose is
              not included; a position controller has to take over once the drive moves
  plan.json   poses, windows of constant speed, order, limits and distances over continuous time, ramps of torque
  runs.png    positions and velocities over time, the windows in them

\b
The middle of every run is a pose in which gravity does not act on the joint, or acts symmetrically, so that it
cancels over a window. Where there is no such pose, the model's gravity has to be subtracted, and the summary says so.

\b
Poses are chosen, and strokes bounded, so that the robot's links keep clear of each other and of the floor in every
position that a run passes, as far as their shapes are known; give obstacles with --world FILE, as for 'excite design'
(see 'excite design --help-all'). You move the robot from one pose to the next; the summary lists the straight lines in
joint space that are free.

\b
Exit code: 0 the plan keeps all limits and distances; 1 it does not, but is written.""",
)
@click.argument("robot", type=RobotName())
@folder_option("--out", required=True, help="Folder to write.")
@robot_file_options("--base")
@settings_options(Installation)
@click.option("--drives", type=Names(), metavar="1,3", help="Drives to measure, by name or number.  [default: all]")
@further_option("--joints", type=Names(), metavar="1,3", help="Instead: joints to measure, each moved on its own.")
@settings_options(FrictionPoses)
@settings_options(LimitChoice, only=(*OF_RUNS, "world"))
@settings_options(Schedule)
@figure_options()
@click.option("--force", is_flag=True, help="Replace a plan that is already in DIR.")
@runs("friction_payload_run:plan_runs_and_write")
def plan() -> None:
    """Plan runs that measure the friction of ROBOT's joints or drives, and write them to DIR.

    Each runs forth and back at constant speeds, with ramps within all limits, after a warm-up and break-away
    tests. ROBOT is a built-in name, a robot YAML, a URDF or an MJCF.
    """


@command(
    groups={
        "Logs": ("drives", "plan", "mapping", "drop"),
        "Windows": ("window", "tolerance", "speed"),
        "Gravity": ("gravity", "parameters"),
        "Curve": ("model", "exponent", "criterion", "temperature", "load", "stiction"),
    },
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
@click.argument("logs", nargs=-1, required=True, type=FILE, metavar="LOG...")
@folder_option("--out", required=True, help="Folder to write.")
@robot_file_options("--base")
@settings_options(Installation, without=("gravity",))
@click.option(
    "--drives",
    "--joints",
    "drives",
    type=Names(),
    metavar="1,3",
    help="Drives, or joints of a robot without drives, by name or number.  [default: all]",
)
@folder_option("--plan", help="Plan that was played; its windows are found in the logs.")
@mapping_option
@drop_option
@folder_option("--parameters", metavar="RESULT", help="Result of 'excite identify' for the model.")
@own_parts
@settings_options(FitSettings)
@figure_options()
@click.option("--force", is_flag=True, help="Replace a fit that is already in DIR.")
@runs("friction_payload_run:fit_and_write")
def fit() -> None:
    """Fit friction curves to LOGs of ROBOT, and write them to DIR.

    Windows of constant speed are found in each log; the mean torque of each is one point of a drive's curve. With
    --plan they are the plan's whole windows, found in logs that begin before it or after.
    """
