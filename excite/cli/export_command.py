"""``excite export``: a design as a motion that a controller plays, a result as a model that a simulator loads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Folder, Number, PartName
from excite.cli.options import own_parts
from excite.cli.task_options import check_not_typed, settings_options
from excite.registry import MODEL_FORMATS, MOTION_FORMATS
from excite.tasks.further_settings import EnsembleSettings

_OF_ENSEMBLES = ("seed", "level", "prior")


@click.command(
    cls=Command,
    groups={"Output": ("form", "rate"), "Ensemble": ("samples", *_OF_ENSEMBLES)},
    name="export",
    epilog="""\b
Examples:
  excite export designs/ur10e --format ros2-yaml --out play/goal.yaml
  excite export designs/ur10e --format urscript --rate 125 --out play/excite.script
  excite export designs/panda --format franka --out play/panda.csv
  excite export results/ur10e --format urdf --robot-file mine.urdf --out models/ur10e.urdf
  excite export results/ur10e --format mjcf --out models/ur10e.xml
  excite export results/ur10e --format mjcf --samples 100 --out models/ensemble

\b
Motions, of a design:
  ros2-yaml  goal of FollowJointTrajectory        mcap      trajectory_msgs/JointTrajectory in a bag
  urscript   program with servoj                  rtde      CSV of target_q for an RTDE client
  franka     1000 rows a second for libfranka     krl       KUKA spline block with its times
  rsi        CSV for KUKA RSI (6 axes), FRI (7)   rapid     ABB module of MoveAbsJ
  egm        CSV for ABB EGM                      npz, mat  arrays for NumPy and MATLAB
  mujoco     arrays with the rows of qpos and ctrl by joint

\b
Models, of a result:
  urdf   copy of --robot-file with the identified parameters, or a URDF written from the robot's description
  mjcf   the same for MuJoCo                      drake     URDF with Drake's rotor inertias and gear ratios
  isaac  actuator configuration of Isaac Lab      yaml      robot YAML, which excite reads
  npz    arrays in the conventions of Pinocchio   csv, md, tex  tables with intervals

\b
Bodies are the physically possible ones nearest the description; what a format cannot express is named.

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
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE", help="File to write.")
@click.option(
    "--rate", type=Number(), metavar="HZ", help="Samples per second of a motion.  [default: that of the format]"
)
@click.option(
    "--robot-file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Description of the robot to change a copy of, for a model.",
)
@settings_options(EnsembleSettings)
@own_parts
@click.option("--force", is_flag=True, help="Replace files that are already there.")
@click.pass_context
def command(ctx: click.Context, /, folder: Path, form: str, out: Path, **given: Any) -> None:
    """Export the design or the result in DIR as a FILE that other programs take.

    DIR is the folder of a design or of a result; where it holds both, name its design.json or its result.json.
    """
    from excite.cli.export_run import export

    if given["samples"] is None:
        check_not_typed(ctx, _OF_ENSEMBLES, "is of an ensemble: give the number of its robots, --samples N")
    export(folder, form, out, given)
