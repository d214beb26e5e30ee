"""``excite simulate``: what the robot would measure while it plays a design, as logs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command, FurtherOption
from excite.cli.option_types import Folder
from excite.cli.options import own_parts
from excite.cli.streams import remark, say
from excite.cli.task_options import chosen_of, settings_options
from excite.simulation.settings import SimulationSettings
from regressors.quantities import number_of

if TYPE_CHECKING:
    from excite.simulation.simulation import Simulation

_GROUPS = {
    "Motion": ("trajectory", "approach_and_return", "beyond_limits", "periods"),
    "Controller": ("controller", "bandwidth", "model_error", "torque_limits"),
    "Friction and load": ("friction", "temperature", "sign_width", "breakaway", "catch", "load"),
    "Measurement": (
        "rate", "wrench_rate", "encoder", "position_noise", "velocity_noise", "torque_noise", "wrench_noise", "seed",
    ),
    "What spoils a log": (
        "impact", "friction_drift", "torque_gain", "coloured_noise", "noise_corner", "position_step",
    ),
}  # fmt: skip


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="simulate",
    epilog="""\b
Examples:
  excite simulate designs/irp6 --out logs/clean.csv
  excite simulate designs/irp6 --out logs/run1.csv --encoder 4000 --torque-noise 0.5 --model-error 0.1 --seed 1
  excite simulate designs/irp6 --out logs/curves.csv --friction friction.yaml
  excite simulate designs/irp6 --out logs/hit.csv --impact q2:3.5:200 --position-step 1e-4 --torque-gain 1.1,0.9,1
  excite simulate designs/irp6-load --out logs/load.csv --load 1.76,0,0,0.16,0.02,0,0,0.02,0,0.001
  excite simulate friction/irp6/z1.csv --out logs/z1.csv --controller pd --bandwidth 10 --friction friction.yaml
  excite simulate friction/irp6/z1.csv --out logs/z1-20.csv --controller pd --friction oil.yaml --temperature 20
  excite simulate friction/irp6/z1.stiction.csv --out logs/z1.stiction.csv --friction friction.yaml

\b
What is written:
  LOG.csv          time [s], then NAME.position, NAME.velocity, NAME.effort of every moving joint [SI]
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
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="LOG.csv", help="Log to write.")
@click.option(
    "--trajectory",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Play this file, laid out as trajectory.csv, instead of the design's motion.",
)
@click.option(
    "--approach-and-return/--no-approach-and-return",
    cls=FurtherOption,
    default=True,
    help="Also play the approach from home and the return, if the design has them.",
)
@click.option(
    "--beyond-limits",
    cls=FurtherOption,
    is_flag=True,
    help="Play a motion that breaks a limit, which is refused otherwise.",
)
@click.option("--ways/--no-ways", default=None, hidden=True, help="Former name of --approach-and-return.")
@click.option(
    "--friction", type=click.Path(path_type=Path), metavar="FILE", help="Friction curves.  [default: the robot's file]"
)
@click.option(
    "--load",
    metavar="M,MCX,...|FILE",
    help="Load at the sensor, in its frame: m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz; or a YAML file of them.",
)
@settings_options(SimulationSettings)
@own_parts
@click.option("--force", is_flag=True, help="Replace logs that are already there.")
def command(
    source: Path,
    out: Path,
    trajectory: Path | None,
    approach_and_return: bool,
    beyond_limits: bool,
    ways: bool | None,
    friction: Path | None,
    load: str | None,
    parts: tuple[str, ...],
    force: bool,
    **options: Any,
) -> None:
    """Simulate the robot of the design in DIR while it plays the motion, and write its measurements to LOG.csv.

    The robot's own inertial parameters move it (they must be in its file); its joints follow the motion under a
    controller, with friction, torque limits, and whatever noise is asked for. Joints that the design holds are rigid.
    FILE is one of a friction plan, such as friction/irp6/z1.csv; all joints of its robot can move.
    """
    import excite
    from excite.cli.main import NOT_HELD
    from excite.cli.messages import in_options
    from excite.cli.progress import progress_of_samples
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.cli.view_text import print_view, view_summary
    from excite.errors import LostMotionError
    from excite.simulation.simulate import motion_source
    from excite.simulation.simulation_files import paths_of
    from excite.storage.result_folder import result_file
    from excite.views.simulation_view import simulation_view

    if ways is not None:
        remark("excite: note: --ways and --no-ways are now --approach-and-return and its --no- form")
        approach_and_return = ways
    settings = SimulationSettings(
        **chosen_of(SimulationSettings, options)
    )  # invalid settings are reported before files are read
    design = excite.load_design(source, parts) if parts else source
    resolved = motion_source(design, trajectory, approach_and_return=approach_and_return)
    payload = None if load is None else _payload(load)
    if payload is None and resolved.task.model.channel == "wrench":
        remark("excite: note: the design is for a load, but none is simulated; give one with --load")
    try:
        with result_file(out):
            paths_of(out, wrench=payload is not None, replace=force)
            tell("simulating the motion")
            with progress_of_samples() as progress:
                simulation = excite.simulate(
                    resolved, settings, friction=friction, load=payload, beyond_limits=beyond_limits, progress=progress
                )
            tell("writing")
            files = simulation.save(out, replace=force)
    except LostMotionError as error:
        say(f"excite: {in_options(str(error))}")
        sys.exit(NOT_HELD)
    view = simulation_view(simulation)
    steps = [f"excite identify ROBOT {files[0]} --out DIR"] if simulation.outcome.holds else []
    all_in = next((file.name for file in files if file.suffix == ".json"), None)
    show(
        view_summary(view, files, steps, all_in),
        lambda: {"out": str(out), **_content(simulation, files)},
        lambda: print_view(view, files),
    )
    sys.exit(0 if simulation.outcome.holds else NOT_HELD)


def _payload(text: str) -> Any:
    """Load from ten numbers, or the name of a file."""
    from excite.tasks.payload import Payload

    try:
        numbers = [number_of(part) for part in text.split(",")]
    except ValueError:
        return Path(text)
    return Payload(numbers)


def _content(simulation: Simulation, files: list[Path]) -> dict[str, Any]:
    """What is not in the log: how well the motion was followed, and the torques that it took."""
    from dataclasses import asdict

    samples = simulation.run.samples
    return {
        "files": [str(file) for file in files],
        "robot": simulation.robot.name,
        "duration": float(samples.time[-1]),
        "samples": int(samples.time.size),
        "rate": simulation.settings.rate,
        "seed": simulation.settings.seed,
        "holds": simulation.outcome.holds,
        "failures": list(simulation.outcome.failures),
        "tracking": [asdict(tracking) for tracking in simulation.outcome.tracking],
        "torques": [asdict(use) for use in simulation.torques],
        "energy_residual": float(simulation.energy_residual),
        "notes": [*simulation.outcome.notes, *simulation.notes],
    }
