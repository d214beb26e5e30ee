"""``excite simulate``, ``predict`` and ``study``: what an experiment would measure, and how well it identifies."""

from __future__ import annotations

import click

from excite.cli.command import command
from excite.cli.lazy import runs
from excite.cli.option_types import FILE, Folder, RobotName
from excite.cli.options import (
    executor_options,
    figure_options,
    file_option,
    folder_option,
    mapping_option,
    own_parts,
    settings_options,
)
from excite.identification.recipe import Recipe
from excite.simulation.settings import SimulationSettings
from excite.tasks.further_settings import Extents, MotionSettings, StudySettings

_OF_SIMULATE = {
    "Motion": ("trajectory", "approach_and_return", "beyond_limits", "periods"),
    "Controller": ("controller", "bandwidth", "model_error", "torque_limits", "servos"),
    "Friction and load": ("friction", "temperature", "sign_width", "breakaway", "catch", "load"),
    "Measurement": (
        "rate", "wrench_rate", "encoder", "position_noise", "velocity_noise", "torque_noise", "wrench_noise", "seed",
    ),
    "What spoils a log": (
        "impact", "friction_drift", "torque_gain", "coloured_noise", "noise_corner", "position_step",
    ),
}  # fmt: skip


@command(
    groups=_OF_SIMULATE,
    epilog="""\b
Examples:
  excite simulate designs/irp6 --out logs/clean.csv
  excite simulate designs/irp6 --out logs/run1.csv --encoder 4000 --torque-noise 0.5 --model-error 0.1 --seed 1
  excite simulate designs/irp6 --out logs/curves.csv --friction friction.yaml
  excite simulate designs/ur10e --out logs/ur10e.csv --servos results/servos --rate 500    as its own drives follow it
  excite simulate designs/irp6 --out logs/hit.csv --impact q2:3.5:200 --position-step 1e-4 --torque-gain 1.1,0.9,1
  excite simulate designs/irp6-load --out logs/load.csv --load 1.76,0,0,0.16,0.02,0,0,0.02,0,0.001
  excite simulate friction/irp6/z1.csv --out logs/z1.csv --controller pd --bandwidth 10 --friction friction.yaml
  excite simulate friction/irp6/z1.csv --out logs/z1-20.csv --controller pd --friction oil.yaml --temperature 20
  excite simulate friction/irp6/z1.stiction.csv --out logs/z1.stiction.csv --friction friction.yaml

\b
What is written:
  LOG.csv          time [s], then NAME.position, NAME.velocity, NAME.effort of every moving joint [SI]; with --servos
                   NAME.command too
  LOG.wrench.csv   with --load: time, positions of all joints, wrench.force.x ... wrench.torque.z [N, Nm]
  LOG.json         robot, design, settings, seed, and the true standard parameters: what an identification should find;
                   'excite identify' ignores it, with a note, once LOG.csv has been changed

\b
Friction changes sign smoothly with the velocity unless --breakaway is given, so that a joint at rest creeps under any
torque. With --breakaway friction is presliding: at rest it holds any torque up to the break-away torque, with a
stiffness of that over D. Files of a friction plan are played with --breakaway auto, for their break-away tests. Give
--controller pd with them, and a --bandwidth at which the torque reaches break-away; computed-torque adds its
compensation of friction at once, so that the torque does not rise slowly. In the segments of NAME.stiction.csv whose
names contain 'stiction' the drive of the column DRIVE.effort is not held in position: it gets that torque and the
controller's model of gravity, until it moves by --catch.

\b
With --servos, what 'excite identify --model servo' identified follows the motion as the robot's drives do: late,
deflected by gravity, and as far as friction lets it; --rate is that of the commands, the masses are those of the
servos. The tracked motion, which is what counts for an identification, is compared with the commands: largest deviation
of each joint, limits, condition number and other criteria.

\b
Friction files (schema excite.friction/1) have a curve per drive: 'model: coulomb-viscous' (coulomb, viscous, offset),
'stribeck' (forward and backward: coulomb, viscous, stiction, stribeck, exponent), or 'table' (speed, torque), and
may have a 'temperature': the reference [deg C] and by how much coulomb and viscous rise per K above it.
The log can be spoilt as real ones are; what was done stands in the notes of LOG.json, and LOG.wrench.csv stays as it
is. An impact moves the robot, and the torques of the drives do not show it, only how the controller answers: it is half
a sine, whose impulse 2 TAU D / pi over the inertia of the joint is the jump of its velocity. The other options change
the log alone, in this order: friction that drifts (the drives make up for it), the gain of the torque sensors, noise;
then positions in steps.

\b
The same seed gives the same log. Zero noise, no encoder and zero model error are the defaults.

\b
Exit status 1, and no log, where the motion breaks a limit of positions, velocities, accelerations, jerks or torques:
that is computed before it is played, over continuous time where the motion has coefficients. Exit status 1, after the
log is written, where the motion does not hold: a torque is at its limit in more than 0.1 % of the samples, a joint
deviates from the reference by more than 5 % of its range of motion, or the motion passes a limit of positions by more
than 1 % of their range, of velocities by more than 5 %. LOG.json says when torques were at their
limits.""",
)
@click.argument("source", type=Folder(), metavar="DIR|FILE")
@file_option("--out", required=True, metavar="LOG.csv", help="Log to write.")
@settings_options(MotionSettings, SimulationSettings)
@own_parts
@click.option("--force", is_flag=True, help="Replace logs that are already there.")
@runs("simulate_run:simulate_and_write")
def simulate() -> None:
    """Simulate the robot of the design in DIR while it plays the motion, and write its measurements to LOG.csv.

    The robot's own inertial parameters move it (they must be in its file); its joints follow the motion under a
    controller, with friction, torque limits, and whatever noise is asked for. Joints that the design holds are rigid.
    FILE is one of a friction plan, such as friction/irp6/z1.csv; all joints of its robot can move.
    """


_OF_SIMULATION = (
    "torque_noise", "encoder", "position_noise", "velocity_noise", "rate", "periods", "model_error", "breakaway",
    "seed", "coloured_noise", "noise_corner", "torque_gain", "friction_drift",
)  # fmt: skip


@command(
    groups={
        "Noise": ("torque_noise", "coloured_noise", "noise_corner", "encoder", "position_noise", "velocity_noise"),
        "Experiment": ("rate", "periods", "model_error", "friction", "breakaway", "torque_gain", "friction_drift"),
        "Identification": ("signals", "cutoff", "low_pass", "every", "estimator", "choose"),
        "Prediction": ("count", "seed"),
    },
    epilog="""\b
Examples:
  excite predict designs/irp6 --torque-noise 0.5
  excite predict designs/irp6 --torque-noise 0.1 --coloured-noise 0.5 --noise-corner 2 --rate 500
  excite predict designs/irp6 --torque-noise 0.5 --encoder 4000 --signals fourier
  excite predict designs/irp6 --torque-noise 0.5 --friction stribeck.yaml --json

\b
The experiment is simulated once, and its log identified as 'excite identify' would. Random samples of the noise then
reach the parameters by the equations of that identification, with its filter, its derivatives and its weights. Noise of
the torques is white (--torque-noise), or of frequencies below --noise-corner (--coloured-noise). Encoder counts begin
at a random phase in each sample.

\b
  by torques   standard deviation by noise of the torques
  by motion    standard deviation by noise and counts of the measured motion
  deviation    what repeats of the experiment scatter by
  bias         what they share: friction that the model does not describe, gains, a filter that cuts the motion

\b
Repeats are taken to have the settings that are chosen for the simulated log. Written to DIR: accuracy.json.""",
)
@click.argument("folder", type=FILE, metavar="DIR")
@settings_options(SimulationSettings, only=_OF_SIMULATION, unset={"breakaway": "none"})
@settings_options(MotionSettings, only=("friction",), help={"friction": "True friction curves."})
@settings_options(Recipe, only=("signals", "cutoff", "low_pass", "every", "estimator"))
@click.option("--choose/--no-choose", default=True, help="Choose what is not given, as 'excite identify' does.")
@settings_options(Extents, only=("count",))
@own_parts
@runs("study_run:predict_and_write")
def predict() -> None:
    """Predict how much the parameters of the design in DIR will scatter from repeat to repeat, and their bias.

    Give the noise of your robot's sensors; without any there is nothing to predict.
    """


@command(
    groups={
        "Motions": ("designs", "trajectories", "mapping"),
        "Estimates": ("below", "points", "estimator", "cutoff"),
        "Simulation": ("repeats", "executor", "workers", "rate", "torque_noise", "encoder", "seed"),
    },
    epilog="""\b
Examples:
  excite study irp6 --design designs/irp6 --design designs/short --repeats 30 --out studies/irp6
  excite study irp6 --design designs/irp6 --torque-noise 1 --encoder 4000 --rate 500 --out studies/noisy
  excite study ur10e 40sec.csv 50sec.csv --mapping ur10e.yaml --out studies/ur10e
  excite study irp6 run.csv --design designs/irp6 --below 2 --out studies/both
  excite study irp6 --design designs/irp6 --trajectory by-hand.csv --repeats 30 --out studies/by-hand

\b
What it answers: how long must a motion be played; is the designed motion better than another one; would a second run
help. For every log and design it estimates the parameters from the rows up to t, for 100 instants t, as in Fig. 15 of
Kozlowski and Dutkiewicz (1996), and says from when on the standard deviation of each parameter stays below --below of
its true value, where the log knows it, else of its final value. A parameter that is nearly zero may never get there.

\b
Rows are weighted by the noise of their equation over the whole log, and the intervals are those of the whole log, as
'excite identify' states them, scaled by how much the rows up to t say. With --repeats N each simulated run is measured
N times with other noise; the scatter of these estimates is what the intervals claim to be.

\b
What is written to DIR:
  study.json                 of every motion: times, estimates, deviations, cond(W(t)), true values, scatter
  estimates_over_time.png    cond(W), the largest deviation, and every parameter over time""",
)
@click.argument("robot", type=RobotName(), metavar="ROBOT")
@click.argument("logs", nargs=-1, type=FILE, metavar="[LOG...]")
@folder_option("--design", "designs", multiple=True, help="Design to simulate; repeatable.")
@file_option(
    "--trajectory",
    "trajectories",
    multiple=True,
    help="Another motion to simulate, laid out as trajectory.csv, for the parameters of the first design; repeatable.",
)
@folder_option("--out", required=True, help="Folder to write.")
@settings_options(StudySettings)
@executor_options(
    "Where repetitions run, with the same numbers; those of a study of less than 10 s stay in this process.",
    "Processes for the repetitions.  [default: one per core]",
)
@mapping_option
@settings_options(Recipe, only=("cutoff",))
@settings_options(
    SimulationSettings,
    only=("rate", "torque_noise", "encoder", "seed"),
    unset={"torque_noise": "1 % of each joint's torque"},
)
@own_parts
@figure_options()
@click.option("--force", is_flag=True, help="Replace a study that is already there.")
@runs("study_run:study_and_write")
def study() -> None:
    """Follow the estimates of ROBOT's parameters over the growing time of every LOG, and of motions that it simulates.

    Each log is a motion of its own; logs that belong together are identified together by 'excite identify'.
    """
