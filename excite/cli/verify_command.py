"""``excite verify``: verification of a result on other logs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Folder
from excite.cli.options import drop_option, figure_options, mapping_option, own_parts
from excite.cli.task_options import settings_options
from excite.identification.recipe import Recipe
from excite.tasks.further_settings import Extents
from excite.verification.tolerances import Tolerances


@click.command(
    cls=Command,
    groups={
        "Verdict": ("torque", "motion", "horizon", "training_too"),
        "Logs": ("mapping", "drop", "rows", "signals", "temperature"),
    },
    name="verify",
    epilog="""\b
Examples:
  excite verify results/irp6 validation.csv
  excite verify results/ur10e ptp.csv --mapping ur10e.yaml --torque-tolerance 6
  excite verify results/irp6 a.csv b.csv --horizon 1 --json

\b
Two tests per log: the torques that the result predicts along the measured motion, and the motion that the identified
model simulates from the measured torques, restarted from the measured state after each horizon. The verdict is
negative if an error exceeds its tolerance, if a joint is predicted no better than by zero, or if the error is much
larger than on the logs of the identification. The errors that it judges are those of the model: the noise of the
measurement, estimated from what the log has above the frequencies of the motion, does not count. Where an error of the
torques that is allowed would move a joint too far, as a light wrist, the motion restarts earlier.
Of a log longer than 60 s, the motion is simulated in 60 windows at most, spread evenly over the log; torques are
predicted in all of its rows.
Exit status 0: the verdict is positive; 1: it is negative.

\b
What is written to DIR (or --out), per log:
  verification-LOG.json    errors of every joint and what limits them, the verdict with its reasons
  verification-LOG-*.png   measured and predicted torques, measured and simulated motion""",
)
@click.argument("folder", type=Folder(), metavar="DIR")
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")
@click.option("--out", type=Folder(), metavar="DIR", help="Folder to write.  [default: that of the result]")
@mapping_option
@drop_option
@settings_options(Tolerances)
@settings_options(Extents, only=("horizon",))
@settings_options(
    Recipe,
    only=("rows", "signals", "temperature"),
    unset={"signals": "as identified", "temperature": "as identified"},
)
@own_parts
@figure_options()
@click.option("--training-too", is_flag=True, help="Accept logs that the result was identified from.")
def command(folder: Path, logs: tuple[Path, ...], out: Path | None, **given: Any) -> None:
    """Judge the result in DIR on each LOG: predicted torques, simulated motion, and a verdict with its reasons.

    A LOG must be of the same robot, and must not be one that the result was identified from.
    """
    from excite.cli.verify_run import verify_and_write

    tolerances = Tolerances(given.pop("torque"), given.pop("motion"))
    verify_and_write(folder, logs, out, tolerances=tolerances, **given)
