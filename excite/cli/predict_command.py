"""``excite predict``: the deviations that repeats of an experiment will show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from excite.cli.command import Command
from excite.cli.options import own_parts
from excite.cli.task_options import settings_options
from excite.identification.recipe import Recipe
from excite.simulation.settings import SimulationSettings
from excite.tasks.further_settings import Extents

_OF_SIMULATION = (
    "torque_noise", "encoder", "position_noise", "velocity_noise", "rate", "periods", "model_error", "breakaway",
    "seed", "coloured_noise", "noise_corner", "torque_gain", "friction_drift",
)  # fmt: skip
_GROUPS = {
    "Noise": ("torque_noise", "coloured_noise", "noise_corner", "encoder", "position_noise", "velocity_noise"),
    "Experiment": ("rate", "periods", "model_error", "friction", "breakaway", "torque_gain", "friction_drift"),
    "Identification": ("signals", "cutoff", "low_pass", "every", "estimator", "choose"),
    "Prediction": ("count", "seed"),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="predict",
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
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@settings_options(SimulationSettings, only=_OF_SIMULATION, unset={"breakaway": "none"})
@click.option("--friction", type=click.Path(path_type=Path), metavar="FILE", help="True friction curves.")
@settings_options(Recipe, only=("signals", "cutoff", "low_pass", "every", "estimator"))
@click.option("--choose/--no-choose", default=True, help="Choose what is not given, as 'excite identify' does.")
@settings_options(Extents, only=("count",))
@own_parts
def command(folder: Path, parts: tuple[str, ...], **options: Any) -> None:
    """Predict how much the parameters of the design in DIR will scatter from repeat to repeat, and their bias.

    Give the noise of your robot's sensors; without any there is nothing to predict.
    """
    from excite.cli.study_run import predict_and_write

    predict_and_write(folder, parts, {name: value for name, value in options.items() if value is not None})
