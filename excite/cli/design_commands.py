"""``excite design``, ``plan``, ``sweep``, ``compare`` and ``bound``: motions, and how good they are."""

from __future__ import annotations

import click

from excite.cli.command import command, further_option
from excite.cli.lazy import runs
from excite.cli.option_types import FILE, RobotName
from excite.cli.options import (
    executor_options,
    figure_options,
    file_option,
    folder_option,
    own_parts,
    robot_file_options,
    settings_options,
)
from excite.registry import MODELS, WINDOWS
from excite.tasks.further_settings import BoundSettings, CampaignSettings
from excite.tasks.installation import Installation
from excite.tasks.model_choice import FURTHER_FRICTION, ModelChoice
from excite.tasks.objective import Objective
from excite.tasks.search import Search
from excite.tasks.task import PARTS
from excite.tasks.trajectory_choice import TrajectoryChoice


@command(
    groups={"Other": ("task_file",)},
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
  of --model servo: parameters by symbol, {K: 0.2, D: 0.2, J: 0.4, d: 0.2}; runs of the motion are rehearsed

\b
Servos that were identified (--servos DIR): the criterion is that of the motion that they make of the commands, by gain
and phase about the middle pose, without friction, gravity and torque limits; rehearsals of --precision are of them.

\b
Contents of --world FILE (YAML; lengths in m, frames of the links and of the base):
  clearance: 0.01
  robot: [{link: link_3, from: [0, 0, -0.2], to: [0, 0, 0], radius: 0.08}]    or urdf: its <collision> elements
  objects: {table: {plane: {normal: [0, 0, 1]}}, post: {capsule: {from: [0.5, 0, 0], to: [0.5, 0, 1], radius: 0.05}},
            crate: {box: {centre: [0.4, 0.4, 0.1], size: [0.2, 0.2, 0.2]}}, ball: {sphere: {centre: ..., radius: ...}}}
  ignore: [[link_5, link_7]]      pairs that are not checked; self_collision: false checks the objects only
  apart: ranges of joints that keep two links apart; excite robots FILE --capsules prints those of a URDF

\b
Contents of --support FILE (YAML; lengths in m, in the frame of the base, whose own mass is a part of the stand's):
  polygon: [[0.3, 0.3, -0.5], [-0.3, 0.3, -0.5], [-0.3, -0.3, -0.5], [0.3, -0.3, -0.5]]     where it touches the ground
  stand: {mass: 40, centre: [0, 0, -0.3]}    of all that does not move
  margin: 0.02                    of the zero-moment point to each edge; a tenth of the middle's if left out
  friction: 0.4                   coefficient to the ground; if left out, sliding is not checked

\b
What is written to DIR:
  trajectory.csv   time [s], then position, velocity, acceleration of every joint [rad, rad/s, rad/s^2];
                   with --stops the motion again, slowly and with stops;
                   with --home also approach and return, and a column segment: approach, excite, return
  trajectory-V.csv the same motion at part V of its speed (--speed), for rehearsals
  precision.json   with --precision: half-widths, periods tried, robot time against precision (precision.csv, a figure)
  design.json      criteria, limits over continuous time, predicted accuracy, everything to run it again
  *.png, or --figures  the motion within its limits, the singular spectrum, the progress of the search
  periods/         with --precision: the starts of every search, so that the same command after a kill goes on
  starts/          every start, written as soon as it ends; the same command after a kill goes on from them""",
)
@click.argument("robot", type=RobotName())
@folder_option("--out", "out", required=True, help="Folder to write.")
@file_option("--task", "task_file", help="YAML file with these options as keys.")
@click.option(
    "--base",
    multiple=True,
    default=("gautier",),
    metavar="NAME",
    help="Base columns of the criterion; gautier, pivoted or orthonormal.",
)
@robot_file_options()
@settings_options(*PARTS.values(), without=("base",))
@own_parts
@figure_options()
@click.option("--force", is_flag=True, help="Replace a design that is already in DIR.")
@further_option("--fresh", is_flag=True, help="Remove the starts that an earlier run has left in DIR.")
@runs("design_run:design_from_options")
def design() -> None:
    """Find the motion that identifies ROBOT's dynamic parameters best, within all its limits, and write it to DIR.

    ROBOT is a built-in name (see 'excite robots'), a robot YAML, a URDF or an MJCF. The motion is at rest at both
    ends; it minimises the condition number of the regressor, or another --criterion, within limits at all times.
    """


_OF_MODEL = ("joints", "friction", "friction_curves", "rotor", *FURTHER_FRICTION, "stribeck_speed")
OF_NEXT_MOTION = ("after", "noise", "of", "period", "starts", "task_file", "out", "force")


@command(
    groups={"Next motion": ("precision", *OF_NEXT_MOTION[:-2])},
    epilog="""\b
Examples:
  excite plan irp6
  excite plan irp6 --model energy --at-once 1
  excite plan panda --no-friction --at-once 3
  excite plan irp6 --friction-curves friction.yaml
  excite plan irp6 --precision 5% --after results/a --out designs/b

\b
Each motion of a campaign is then designed on its own:
  excite design irp6 --drives 1,3 --out designs/irp6-13

\b
With --precision, what results and designs in --after tell of the parameters is weighed against it: the exit status is 0
where it is enough, 1 where another motion is needed, which --out writes.
  --precision 5%, or a YAML file   as of 'excite design'
  --of measured                    of the values that the results have measured, where they have (described: of the
                                   robot's description)
  --period 10                      of the next motion; that of the shortest experiment if not given
  --task task.yaml                 limits, home, search and all other options of a design""",
)
@click.argument("robot", type=RobotName())
@robot_file_options()
@settings_options(Installation)
@settings_options(ModelChoice, only=_OF_MODEL, help={"joints": "Joints whose parameters to identify."})
@settings_options(CampaignSettings)
@settings_options(Objective, Search, only=("precision", "after", "noise", "starts"))
@settings_options(
    TrajectoryChoice,
    only=("period",),
    help={"period": "Period of the next motion."},
    unset={"period": "that of the shortest experiment"},
)
@file_option("--task", "task_file", help="Task file of the next motion.")
@folder_option("--out", help="Folder for the next motion.")
@click.option("--force", is_flag=True, help="Replace a design that is already in DIR.")
@runs("study_run:plan_from_options")
def plan() -> None:
    """Propose the shortest campaign: few motions of few drives of ROBOT that together identify every parameter.

    Drives that do not move hold their own coordinate, as brakes and position control do. With --precision, propose the
    next motion after the results and designs in --after, or say that they are enough.
    """


@command(
    groups={"Execution": ("executor", "workers")},
    epilog="""\b
Examples:
  excite sweep run sweep.yaml --out sweeps/arms
  excite sweep run sweep.yaml --out sweeps/arms --report --figures svg
  excite sweep run sweep.yaml --out sweeps/arms --executor dask://10.0.0.1:8786

\b
Contents of FILE (YAML; options are the keys of a task file, see --task of 'excite design'):
  common: {starts: 4, harmonics: 5}                  options of every cell
  grid:                                              every combination of these is a cell
    robot: [irp6, panda]
    trajectory: [fourier, cosine]
    limits: {slow: {velocity: 0.5}, fast: {velocity: 1.0}}    labels of long values
    seed: [0, 1, 2]
  exclude: [{robot: panda, limits: slow}]            combinations that are left out
  include: [{robot: ur10e, limits: {acceleration: 3}}]        further cells

\b
What is written to DIR:
  cells/NAME     of every cell, such as robot=irp6,seed=0, an ordinary folder of a design
  campaign.csv   one line per cell: options, status, every criterion, tightest limit, time; campaign.json likewise
  campaign.png   the condition numbers by each option
  campaign.html  with --report

\b
Cells run on all cores, each with its starts one after the other. The same command again continues where it stopped.
Exit status: 0 every cell has a design within its limits; 1 at least one has not, and the table says why.""",
)
@click.argument("file", type=FILE)
@folder_option("--out", required=True, help="Folder to write.")
@executor_options("Where the cells run.", "Number of processes.  [default: one per core]")
@figure_options()
@click.option("--report", is_flag=True, help="Write campaign.html too: table and figure as one page.")
@click.option("--force", is_flag=True, help="Replace cells of the same names that have other options.")
@runs("design_run:run_and_write")
def run() -> None:
    """Design every cell of the sweep FILE, or those that are left, and write all of them in one table."""


@command(
    epilog="""\b
Example:
  excite compare designs/irp6 designs/irp6-long --json
  excite compare designs/mine designs/irp6 --part mine:Mine""",
)
@click.argument("designs", nargs=-1, required=True, type=FILE, metavar="DIR...")
@click.option("--model", type=click.Choice(MODELS), help="Compare under this model.  [default: that of each design]")
@click.option("--window", type=click.Choice(WINDOWS), help="Time windows of energy and load-integral.")
@own_parts
@runs("study_run:compare_designs")
def compare() -> None:
    """Compare designs by the same metrics: every condition number, smallest singular value, log det, margins.

    Every design is judged under the parameters (friction, rotors) and the noise of the first one, sampled at 100 Hz,
    and by the criterion that the first one minimised.
    """


@command(
    groups={"Bound": ("criteria", "seed", "what_ifs", "force")},
    epilog="""\b
Example:
  excite bound designs/irp6
  excite bound designs/irp6 --criterion condition --json""",
)
@click.argument("folder", type=FILE, metavar="DIR")
@settings_options(BoundSettings)
@click.option("--force", is_flag=True, help="Compute the bound again, although DIR has one of the same problem.")
@own_parts
@runs("study_run:bound_and_write")
def bound() -> None:
    """Bound what any motion within the limits of the design in DIR could reach, and write DIR/bound.json.

    A bound from below on the condition number, or on the criteria of D- and E-optimality (logdet, sigma-min), over all
    motions of the family within the limits of the design's problem. 'excite compare' shows it from then on.

    With it, what twice the harmonics, 1.5 times the period, or each limit of joints and drives that is used, looser by
    20 %, would bring: the gains found by improving this motion after one change at a time. Ctrl-C ends the work, and
    the bound so far is kept.
    """
