"""``excite study``: how soon motions determine the parameters, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Folder, RobotName
from excite.cli.options import executor_options, figure_options, mapping_option, own_parts
from excite.cli.task_options import check_not_typed, settings_options
from excite.identification.recipe import Recipe
from excite.simulation.settings import SimulationSettings
from excite.tasks.further_settings import StudySettings

_GROUPS = {
    "Motions": ("designs", "trajectories", "mapping"),
    "Estimates": ("below", "points", "estimator", "cutoff"),
    "Simulation": ("repeats", "executor", "workers", "rate", "torque_noise", "encoder", "seed"),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="study",
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
@click.argument("logs", nargs=-1, type=click.Path(path_type=Path), metavar="[LOG...]")
@click.option(
    "--design", "designs", multiple=True, type=Folder(), metavar="DIR", help="Design to simulate; repeatable."
)
@click.option(
    "--trajectory",
    "trajectories",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Another motion to simulate, laid out as trajectory.csv, for the parameters of the first design; repeatable.",
)
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
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
@click.pass_context
def command(ctx: click.Context, /, robot: str, logs: tuple[Path, ...], out: Path, **given: Any) -> None:
    """Follow the estimates of ROBOT's parameters over the growing time of every LOG, and of motions that it simulates.

    Each log is a motion of its own; logs that belong together are identified together by 'excite identify'.
    """
    from excite.cli.study_run import study_and_write

    if not given["repeats"]:
        check_not_typed(ctx, ("executor", "workers"), "is for repetitions: give their number, --repeats N")
    study_and_write(robot, logs, out, **given)
