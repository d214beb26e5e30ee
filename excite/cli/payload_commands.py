"""``excite payload``: what a robot holds: a motion that shows it, the gains of the drives, mass, centre and inertia."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from excite.cli.command import command
from excite.cli.lazy import runs
from excite.cli.option_types import RobotName
from excite.cli.options import (
    drop_option,
    figure_options,
    file_option,
    folder_option,
    mapping_option,
    robot_file_options,
    settings_options,
)
from excite.identification.recipe import Recipe
from excite.tasks.further_settings import (
    CalibrationSettings,
    LoadFrame,
    PayloadMotionSettings,
    PayloadSettings,
    UnloadedRows,
)
from excite.tasks.installation import Installation
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.search import Output, Search

_LIMITED = ("velocity", "acceleration", "jerk", "torque_margin", "tool_point", "tool_speed", "floor", "self_collision")
_LOGS = ("without", "loaded", "mapping", "drop", "rows", "without_rows")
_SIGNALS = ("cutoff", "low_pass")


def _robot_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """How ROBOT is read and installed."""
    return robot_file_options("--base")(settings_options(Installation, without=("payload",))(command))


def _log_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """How logs are read."""
    recipe = settings_options(
        Recipe,
        only=("rows", "cutoff", "low_pass"),
        unset={"cutoff": "as --low-pass, or chosen", "low_pass": "15 where logs are fast"},
    )
    return mapping_option(drop_option(settings_options(UnloadedRows)(recipe(command))))


def _log_option(name: str, text: str, *, required: bool = False) -> Callable[[Any], Any]:
    names = ("--with", "loaded") if name == "loaded" else (f"--{name}",)
    return file_option(*names, required=required, multiple=True, metavar="LOG", help=f"{text}; repeatable.")


@command(
    groups={
        "Motion": ("box", "centre", "pose", "swing", "period", "harmonics"),
        "Sensor": ("sensor", "frame"),
        "Search": ("starts", "seed"),
    },
    epilog="""\b
Examples:
  excite payload design ur10e --box 0.2 --pose 0,-1.2,1.6,-1.2,-1.57,0 --period 5 --out motion
  excite payload design panda --box 0.2,0.2,0.1 --out motion
  excite payload design panda --box=0.3:0.6,-0.2:0.2,0.3:0.7 --pose 0,-0.4,0,-2,0,1.8,0.785 --out motion
  excite payload design arm.urdf --tip tool0 --acceleration-limit 2 --sensor wrench --out motion

\b
The motion turns the wrist, which shows mass and centre against gravity and the inertia by its acceleration, while the
arm moves little and the tool point stays in the box. It starts and ends at rest, and its limits hold at all times, not
only at samples. Drive the robot to its first pose, play it once without the load and once with it, slowly first, and
record positions and torques (or the wrench) with 'excite payload identify' in mind.

\b
What is written to DIR: design.json and trajectory.csv, as by 'excite design'.
Exit code: 0 the motion keeps all limits; 1 it does not, but is written.""",
)
@click.argument("robot", type=RobotName())
@folder_option("--out", required=True, help="Folder to write.")
@_robot_options
@settings_options(PayloadMotionSettings, LoadFrame)
@settings_options(Search, Output, only=("seed", "rate"))
@settings_options(LimitChoice, only=(*_LIMITED, "world"))
@figure_options("none")
@click.option("--force", is_flag=True, help="Replace a design that is already in DIR.")
@runs("friction_payload_run:design_and_write")
def design() -> None:
    """Find a short motion of ROBOT in a small box that shows mass, centre and inertia of what it holds.

    ROBOT is a built-in name, a robot YAML, a URDF or an MJCF.
    """


@command(
    groups={"Logs": (*_LOGS, "mass"), "Signals": _SIGNALS, "Gains": ("common",)},
    epilog="""\b
Examples:
  excite payload gains ur10e --without bare.csv --with weight.csv --mass 2.805 --out gains.yaml
  excite payload gains ur10e --without bare.csv --with weight.csv --mass 2.805 --mapping ur10e.yaml --out gains.yaml

\b
Torques from motor currents are as good as the gains (torque per current) that they are multiplied by. A load that was
weighed shows by which factor the stated gains are off: of all drives together (--common), or of each (--each), which
stays within some 10 % of the common one where the load hardly acts on the drive. The file has each factor, its standard
deviation and correlations; 'excite payload identify --gains' counts them in its intervals.""",
)
@click.argument("robot", type=RobotName())
@_log_option("without", "Log without the load", required=True)
@_log_option("loaded", "Log with the load, fixed to the last link", required=True)
@click.option(
    "--out", required=True, type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="YAML file to write."
)
@settings_options(CalibrationSettings)
@_robot_options
@_log_options
@click.option("--force", is_flag=True, help="Replace FILE.")
@runs("friction_payload_run:calibrate_and_write")
def gains() -> None:
    """Calibrate the gains of ROBOT's drives with a load of known mass, and write their factors to FILE."""


@command(
    groups={
        "Logs": (*_LOGS, "wrench"),
        "Signals": _SIGNALS,
        "Gains": ("gains", "gain_deviation"),
        "Payload": ("result", "frame", "frame_name", "controller", "rated"),
    },
    epilog="""\b
Examples:
  excite payload identify ur10e --without bare.csv --with load.csv --gains gains.yaml --out payload
  excite payload identify panda --without bare.csv --with load.csv --frame 0,0,0.107 --controller franka --out payload
  excite payload identify ur10e --result results/ur10e --with load.csv --out payload
  excite payload identify ur10e --wrench load.wrench.csv --frame 0,0,0.05 --out payload

\b
The robot without the load is known from a log of a like motion (--without), or from a result of 'excite identify'
(--result). A force/torque sensor that carries the load (--wrench) needs neither; with --without, a wrench log too, what
it carries otherwise, such as the gripper, is subtracted. Logs are as for 'excite identify'.

\b
Intervals of 99 % count noise that is correlated in time, friction that changes from log to log, the covariance of the
robot's parameters, and the gains of the drives: as calibrated in --gains, or else as stated, which are then taken to be
off by 11 % (standard deviation; those published for one arm were off by 9 %), unless --gain-deviation says better.

\b
Centre and inertia are stated in the frame of the last link of ROBOT's description, or in --frame, such as the flange,
given in it. Controllers expect the flange: give --frame where the last link's frame is not the flange.

\b
What is written to DIR:
  payload.json  mass, centre, inertia about the centre, each with value and interval; frame, gains, logs, notes
  payload.script (UR), payload.franka.cpp, payload.dat (KUKA), payload.mod (ABB), payload.urdf
Exit code: 0 done; 1 written, but a doubt remains, such as a mass that is hardly shown.""",
)
@click.argument("robot", type=RobotName())
@_log_option("without", "Log without the load")
@_log_option("loaded", "Log with the load, fixed to the last link")
@_log_option("wrench", "Instead of --with: log of the wrench of a sensor that carries the load")
@folder_option("--result", help="Instead of --without: the robot's identified model.")
@folder_option("--out", required=True, help="Folder to write.")
@file_option("--gains", help="Gains from 'excite payload gains'.")
@settings_options(PayloadSettings, LoadFrame)
@_robot_options
@_log_options
@click.option("--force", is_flag=True, help="Replace a payload that is already in DIR.")
@runs("friction_payload_run:identify_and_write")
def identify() -> None:
    """Estimate mass, centre and inertia of what ROBOT holds, and write them to DIR with 99 % intervals.

    ROBOT is a built-in name, a robot YAML, a URDF or an MJCF.
    """
