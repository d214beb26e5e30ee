"""``excite robots``, ``logs``, ``export`` and ``report``: what is read from others, and written for them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from excite.cli.command import command
from excite.cli.lazy import runs
from excite.cli.option_types import FILE, Folder, Number, PartName, RobotName
from excite.cli.options import file_option, own_parts, robot_file_options, settings_options
from excite.cli.streams import verbosity
from excite.registry import MODEL_FORMATS, MOTION_FORMATS
from excite.tasks.further_settings import EnsembleSettings
from excite.tasks.installation import Installation
from excite.tasks.model_choice import ModelChoice

_SHOWN_OF_MODEL = ("joints", "friction", "rotor")


@command(
    epilog="""\b
Examples:
  excite robots
  excite robots irp6
  excite robots panda --no-friction
  excite robots arm.urdf --base-link base_link --tip tool0
  excite robots arm.urdf --capsules > world.yaml
  excite robots arm.xml --tip hand --out arm.yaml""",
)
@click.argument("robot", type=RobotName(), required=False)
@robot_file_options("--base")
@settings_options(Installation)
@settings_options(ModelChoice, only=_SHOWN_OF_MODEL, essential=_SHOWN_OF_MODEL)
@click.option("--capsules", is_flag=True, help="Print a URDF's shape as capsules, to begin a world file with.")
@file_option("--out", help="Write the robot as robot YAML.")
@click.option("--force", is_flag=True, help="Replace a FILE that is already there.")
def robots(robot: str | None, out: Path | None, capsules: bool, **given: Any) -> None:
    """List the built-in robots; with ROBOT (a built-in name, a robot YAML, a URDF or an MJCF) show one.

    Shown are the joints with their limits, the limits on drive coordinates, and the base parameters: the combinations
    of inertial parameters that are identifiable from motion; of a URDF also what was assumed, what is missing and what
    is implausible. With --out the robot is written as robot YAML instead.
    """
    if robot is None:
        if out is not None:
            raise click.UsageError("--out writes one robot; name it: excite robots ROBOT --out FILE")
        _list()
        return
    from excite.cli.robots_run import print_capsules, show_robot

    if capsules:
        print_capsules(robot, given)
    else:
        show_robot(robot, out, given)


def _list() -> None:
    """Print the built-in robots."""
    from excite.cli.summary import print_table
    from regressors.readers.library import built_in, built_in_names

    robots = {name: built_in(name) for name in built_in_names()}
    if verbosity().quiet:
        click.echo("\n".join(robots))
    elif verbosity().as_json:
        listed = [{"name": name, "joints": list(r.joint_names), "source": r.source} for name, r in robots.items()]
        click.echo(json.dumps(listed, indent=1))
    else:
        rows = [(name, str(described.n), described.source) for name, described in robots.items()]
        print_table("built-in robots", ("name", "joints", "source"), rows)
        click.echo("'excite robots NAME' shows one; every command also takes a robot YAML, a URDF, a xacro or an MJCF")


@command(
    groups={"Robot": ("robot",)},
    epilog="""\b
Examples:
  excite logs run.mcap
  excite logs recording.csv --robot ur10e --write-mapping ur10e.yaml
  excite identify ur10e recording.csv --mapping ur10e.yaml --out results/ur10e

\b
Formats are recognised by their content: MCAP and rosbag2, Parquet (LeRobot), NPZ, HDF5, MATLAB, JSON, folders with one
file per signal or of sage (commands and states of servos), and tables in text, among them those of PlotJuggler, RTDE
clients of Universal Robots, libfranka, rostopic and ros2 topic echo.

\b
Units that the recording does not state follow from the ratio of the velocities to the rate of change of the positions,
and from ranges. Each is stated, certain, or likely; what is not certain is asked. The mapping holds the likeliest
answers, with the questions as comments: correct it before you use it.""",
)
@click.argument("file", type=FILE, metavar="FILE")
@click.option(
    "--robot", type=RobotName(), metavar="ROBOT", help="Robot that moved, for the names and the ranges of its joints."
)
@robot_file_options("--base")
@file_option("--write-mapping", metavar="MAP.yaml", help="Mapping to write, for --mapping.")
@click.option("--force", is_flag=True, help="Replace a mapping that is already there.")
@runs("logs_run:show_recording")
def logs() -> None:
    """Show what FILE holds, what was recognised, and what it does not say; write the mapping that reads it.

    FILE is a recording of any known format, or a folder of one.
    """


@command(
    groups={"Ensemble": ("samples", "seed", "level", "prior")},
    epilog="""\b
Examples:
  excite export designs/ur10e --format ros2-yaml --out play/goal.yaml
  excite export designs/ur10e --format urscript --rate 125 --out play/excite.script
  excite export designs/so101 --format lerobot --out play/so101
  excite export results/ur10e --format urdf --robot-file mine.urdf --out models/ur10e.urdf
  excite export servos --format mjcf --out a.xml  (urdf, isaac, yaml, bam)
  excite export results/ur10e --format mjcf --samples 100 --out models/ensemble

\b
Motions, of a design:
  ros2-yaml  goal of FollowJointTrajectory        mcap      trajectory_msgs/JointTrajectory in a bag
  urscript   program with servoj                  rtde      CSV of target_q for an RTDE client
  franka     1000 rows a second for libfranka     krl       KUKA spline block with its times
  rsi        CSV for KUKA RSI (6 axes), FRI (7)   rapid     ABB module of MoveAbsJ
  egm        CSV for ABB EGM                      npz, mat  arrays for NumPy and MATLAB
  mujoco     arrays with the rows of qpos and ctrl by joint
  lerobot    folder that lerobot-replay takes     sage      control.csv of positions for servos

\b
Models, of a result:
  urdf   copy of --robot-file with the identified parameters, or a URDF written from the robot's description
  mjcf   the same for MuJoCo                      drake     URDF with Drake's rotor inertias and gear ratios
  isaac  actuator configuration of Isaac Lab      yaml      robot YAML, which excite reads
  npz    arrays in the conventions of Pinocchio   csv, md, tex  tables with intervals

\b
Servos, of 'excite identify --model servo':
  mjcf   copy of --robot-file, or a new MJCF, with the servos as actuators
  urdf   friction, damping, limits of joints      drake     the same with the inertia of the servos
  isaac  actuator configuration of Isaac Lab      bam       parameters of Better Actuator Models
  yaml   every quantity with its unit and interval

\b
Bodies of a result are the physically possible ones nearest the description; what a format cannot express is named.

\b
With --samples, FILE is a folder of robots that the data allow, each of them possible: what the data determine
is spread as the result states, the rest by --prior about the description. Beside the robots are ranges.yaml
(low, high, mean and deviation of every parameter), samples.npz and, when all is written, ensemble.json.
After Ctrl-C the robots that are written stay, with an ensemble.json that lists them.

\b
Every sample of a motion is the design's own formula, with approach and return where it has them, at exact
rest at both ends. Limits are checked again for what the controller makes of the samples; a motion that breaks
one is not written.

\b
What is written:
  FILE               the motion or the model, with the hash of the design or the result
  FILE.record.*      what to record, for the recorder that belongs to the controller, if it takes a file
  FILE.mapping.yaml  how 'excite identify --mapping' reads that recording, and by which hash it finds the design

Exit status 1, and no file, where the motion breaks a limit; exit status 1 too where the controller does not
document what it makes of the samples (rtde, krl, rapid), and a curve through them would pass one.""",
)
@click.argument("folder", type=Folder(), metavar="DIR")
@click.option(
    "--format",
    "form",
    required=True,
    type=PartName("export format", tuple(dict.fromkeys((*MOTION_FORMATS, *MODEL_FORMATS)))),
    help="Format; see below.",
)
@file_option("--out", required=True, help="File to write; a folder for lerobot.")
@click.option(
    "--rate", type=Number(), metavar="HZ", help="Samples per second of a motion.  [default: that of the format]"
)
@file_option("--robot-file", help="Description of the robot to change a copy of, for a model.")
@settings_options(EnsembleSettings)
@own_parts
@click.option("--force", is_flag=True, help="Replace files that are already there.")
@runs("exchange_run:export_and_show")
def export() -> None:
    """Export the design, result or servos in DIR as a FILE for other programs.

    DIR is the folder of a design, of a result or of servos; where it holds several, name the JSON file of one.
    """


@command(
    groups={"Robot": ("robot_file",)},
    epilog="""\b
Examples:
  excite report designs/irp6 --out irp6.html
  excite report designs/arm --robot-file arm.urdf --out arm.html             with the meshes of its links
  excite report designs/short designs/long --out which.html                  compared by the same metrics
  excite report designs/irp6 results/irp6 --out experiment.html              with the verifications in results/irp6
  excite plan irp6 --json > plan.json; excite report plan.json --out plan.html
  excite report plans/friction friction/irp6 --out friction.html             runs to measure friction, fitted curves

\b
The page has, for each result: the verdict in words; what was asked; what was assumed and not checked; parameters with
their intervals, conditions under each convention and margins of the limits, in tables that sort when a heading is
pressed; figures; provenance, and the commands that repeat it. Planned and measured motions play in 3D: space plays and
pauses, comma and full stop step, arrow keys turn the view, plus and minus zoom. The robot is drawn by the meshes of
--robot-file, else by the capsules of its world file or URDF, else by lines through the frames of its joints.
Several designs, or several identifications, are compared.

\b
The page is one file that needs no network: mail it, or open it from a disk in any browser of today.
Exit status 0: written; 2: bad input, and an older page stays.""",
)
@click.argument("paths", nargs=-1, required=True, type=Folder(), metavar="DIR...")
@file_option("--out", required=True, metavar="FILE.html", help="Page to write.")
@file_option(
    "--robot-file", metavar="FILE.urdf", help="URDF of the robot, whose meshes (STL, OBJ, DAE) the player shows."
)
@own_parts
@click.option("--force", is_flag=True, help="Replace a page that is already there.")
@runs("exchange_run:write_page")
def report() -> None:
    """Write one HTML page on what is in each DIR: designs, results, friction, studies; or in JSON files."""
