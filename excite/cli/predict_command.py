"""``excite predict``: the deviations that repeats of an experiment will show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Number
from excite.cli.options import own_parts
from excite.cli.task_options import settings_options
from excite.identification.recipe import Recipe
from excite.simulation.settings import SimulationSettings

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.views.view import View

_MOST = 12  # parameters in the summary
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
@click.option("--count", type=Number(), default=400, metavar="K", help="Samples of the noise.")
@own_parts
def command(folder: Path, count: float, parts: tuple[str, ...], choose: bool, **options: Any) -> None:
    """Predict how much the parameters of the design in DIR will scatter from repeat to repeat, and their bias.

    Give the noise of your robot's sensors; without any there is nothing to predict.
    """
    import excite
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.storage.records import json_of
    from excite.views.prediction_view import accuracy_view

    given = {name: value for name, value in options.items() if value is not None}
    design = excite.load_design(folder, parts)
    prediction = excite.predict_accuracy(design, choose=choose, count=int(count), progress=tell, **given)
    files = prediction.save(folder if folder.suffix != ".json" else folder.parent)
    view = accuracy_view(prediction)
    show(_summary(view, files), lambda: json_of(prediction), lambda: _print(view, files))


def _summary(view: View, files: list[Path]) -> Summary:
    from excite.cli.summary import Summary
    from excite.cli.view_text import brief_table

    return Summary(
        verdict=view.verdict,
        facts=[*view.summary, *brief_table(view.tables[0], most=_MOST)],
        notes=view.remarks,
        files=files,
        all_in=files[0].name,
    )


def _print(view: View, files: list[Path]) -> None:
    from excite.cli.literal_console import console
    from excite.cli.view_text import print_view

    print_view(view)
    console().print(f"written: {', '.join(map(str, files))}", soft_wrap=True)
