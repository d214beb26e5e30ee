"""``excite study``: how soon motions determine the parameters, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Folder, Number, RobotName
from excite.cli.options import FigureChoice, executor_options, figure_options, mapping_option, own_parts
from excite.cli.task_options import settings_options
from excite.identification.recipe import Recipe
from excite.simulation.settings import SimulationSettings

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.study.time_study import TimeStudy

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
@click.option("--repeats", type=Number(), default=0, metavar="N", help="Measure each run N times, such as 30.")
@executor_options(
    "Where repetitions run, with the same numbers; those of a study of less than 10 s stay in this process.",
    "Processes for the repetitions.  [default: one per core]",
)
@click.option("--below", type=Number(), default=5.0, metavar="%", help="Deviation that parameters are to fall below.")
@click.option("--points", type=Number(), default=100, metavar="K", help="Number of instants.")
@mapping_option
@click.option(
    "--estimator", type=click.Choice(["weighted", "least-squares"]), default="weighted", help="How to estimate."
)
@settings_options(Recipe, only=("cutoff",))
@settings_options(
    SimulationSettings,
    only=("rate", "torque_noise", "encoder", "seed"),
    unset={"torque_noise": "1 % of each joint's torque"},
)
@own_parts
@figure_options()
@click.option("--force", is_flag=True, help="Replace a study that is already there.")
def command(
    robot: str,
    logs: tuple[Path, ...],
    designs: tuple[Path, ...],
    trajectories: tuple[Path, ...],
    out: Path,
    repeats: int,
    executor: str,
    workers: int | None,
    below: float,
    points: int,
    rate: float,
    torque_noise: tuple[float, ...] | None,
    encoder: tuple[float, ...] | None,
    seed: int,
    parts: tuple[str, ...],
    figures: FigureChoice,
    force: bool,
    **options: Any,
) -> None:
    """Follow the estimates of ROBOT's parameters over the growing time of every LOG, and of motions that it simulates.

    Each log is a motion of its own; logs that belong together are identified together by 'excite identify'.
    """
    import excite
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.storage.figure_names import figure_names
    from excite.storage.records import json_of
    from excite.storage.result_folder import result_folder
    from excite.study.study_over_time import study_over_time
    from excite.study.time_study import FIGURE, check_free

    if not repeats and (executor != "process" or workers is not None):
        raise click.UsageError("--executor and --workers are for repetitions: give their number, --repeats N")
    settings: dict[str, Any] = {"rate": rate, "encoder": encoder, "torque_noise": torque_noise, "seed": seed}
    given = {name: value for name, value in options.items() if value is not None}
    with result_folder(out):
        check_free(out, figure_names([FIGURE], figures.formats), replace=force)
        study = study_over_time(
            robot,
            logs,
            designs=[excite.load_design(folder, parts) for folder in designs],
            trajectories=trajectories,
            simulation=settings,
            repeats=repeats,
            below=below / 100,
            points=points,
            executor=executor,
            workers=workers,
            progress=tell,
            **given,
        )
        files = study.save(out, replace=force)
        if figures:
            from excite.plots.time_course_plot import write_time_study_figure

            tell("drawing")
            files = [*files, *write_time_study_figure(study, out, **figures.how)]
    show(_summary(study, files), lambda: json_of(study), lambda: _print(study, files))


def _summary(study: TimeStudy, files: list[Path]) -> Summary:
    from excite.cli.summary import Summary
    from excite.cli.view_text import brief_table
    from excite.views.study_view import study_view

    view = study_view(study)
    return Summary(
        verdict=view.verdict,
        holds=view.holds,
        facts=brief_table(view.tables[0]),
        notes=view.remarks,
        files=files,
        all_in="study.json",
    )


def _print(study: TimeStudy, files: list[Path]) -> None:
    from excite.cli.literal_console import console
    from excite.cli.view_text import print_view
    from excite.views.study_view import study_view

    print_view(study_view(study))
    console().print(f"written: {', '.join(map(str, files))}", soft_wrap=True)
