"""``excite plan``: the shortest campaign of partial motions; or, for a precision, the next motion after others."""

from __future__ import annotations

import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from excite.cli.command import Command
from excite.cli.option_types import Folder, Number, RobotName
from excite.cli.options import robot_file_of, robot_file_options
from excite.cli.task_options import chosen_of, task_options, typed_options
from excite.registry import MODELS
from excite.tasks.model_choice import FURTHER_FRICTION
from excite.tasks.task import PARTS

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.design.campaign import Campaign
    from excite.tasks.task import Task


_NAMED = 6  # parameters of a motion that the summary names
_OF_MODEL = ("joints", "friction", "friction_curves", "rotor", *FURTHER_FRICTION, "stribeck_speed")
_OF_NEXT_MOTION = ("after", "noise", "of", "period", "starts", "task_file", "out", "force")


@click.command(
    cls=Command,
    groups={"Next motion": ("precision", *_OF_NEXT_MOTION[:-2])},
    name="plan",
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
@task_options(("installation",))
@task_options(("model",), only=_OF_MODEL, help={"joints": "Joints whose parameters to identify."})
@click.option(
    "--model", type=click.Choice(MODELS), default="energy", help="Model whose equations identify the parameters."
)
@click.option(
    "--at-once",
    type=Number(),
    metavar="N",
    help="Largest number of drives that move at the same time.  [default: 2]",
)
@task_options(("objective",), only=("precision", "after", "noise"))
@task_options(("search",), only=("starts",))
@click.option(
    "--of",
    type=click.Choice(("measured", "described")),
    default="measured",
    help="Values that --precision is a share of.",
)
@click.option("--period", type=Number(), metavar="S", help="Period of the next motion [s].")
@click.option(
    "--task", "task_file", type=click.Path(path_type=Path), metavar="FILE", help="Task file of the next motion."
)
@click.option("--out", type=Folder(), metavar="DIR", help="Folder for the next motion.")
@click.option("--force", is_flag=True, help="Replace a design that is already in DIR.")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    robot: str,
    model: str,
    at_once: int | None,
    friction_curves: str | None,
    precision: float | dict[str, Any] | None,
    of: str,
    task_file: Path | None,
    out: Path | None,
    force: bool,
    **given: Any,
) -> None:
    """Propose the shortest campaign: few motions of few drives of ROBOT that together identify every parameter.

    Drives that do not move hold their own coordinate, as brakes and position control do. With --precision, propose the
    next motion after the results and designs in --after, or say that they are enough.
    """
    if precision is not None:
        sys.exit(_next_motion(ctx, robot, task_file, of, out, force=force))
    _check_not_typed(ctx)
    import excite
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.storage.records import json_of

    curves = None if friction_curves is None else excite.read_friction(Path(friction_curves))
    asked = {**chosen_of(PARTS["installation"], given), **chosen_of(PARTS["model"], given)}
    task = excite.Task(robot, **robot_file_of(given), **asked, model=model, friction_curves=curves)
    tell("finding the parameters that each selection of drives identifies")
    campaign = excite.plan_campaign(task, at_once)
    design = _design_command(task, friction_curves)
    show(_summary(campaign, design), lambda: json_of(campaign), lambda: _print(campaign, design))


def _next_motion(
    ctx: click.Context, robot: str, task_file: Path | None, of: str, out: Path | None, *, force: bool
) -> int:
    """Plan the next motion of a sequence; the exit status."""
    from excite.cli.main import NOT_HELD
    from excite.cli.next_motion_run import plan_next_motion
    from excite.files.task_file import read_task_file, task_from_options

    filed = read_task_file(task_file) if task_file else {}
    named = ("base_link", "tip", "snap_angles", "xacro")
    typed = typed_options(ctx) | {name: ctx.params[name] for name in named if ctx.params[name] is not None}
    if "period" in typed:
        typed["scale"] = "precision"  # at that period, not at the shortest
    task = task_from_options({"model": "differential", **filed, **typed, "robot": robot})
    return 0 if plan_next_motion(task, of, out, force=force) else NOT_HELD


def _check_not_typed(ctx: click.Context) -> None:
    """Refuse options of the next motion without a precision."""
    for name in _OF_NEXT_MOTION:
        if ctx.get_parameter_source(name) is not ParameterSource.DEFAULT:
            flag = {"task_file": "--task"}.get(name, f"--{name}")
            raise click.UsageError(f"{flag} is for the next motion towards a precision; give --precision too")


def _design_command(task: Task, curves: str | None) -> str:
    """Command that designs for the same robot, chain and parameters."""
    words = ["excite", "design", task.robot_name, "--model", str(task.model.model)]
    words += ["--base", task.base_link] if task.base_link is not None else []
    words += ["--tip", task.tip] if task.tip is not None else []
    words += [] if task.snap_angles else ["--no-snap-angles"]
    words += ["--xacro"] if task.xacro else []
    words += [] if task.model.friction else ["--no-friction"]
    words += [] if curves is None else ["--friction-curves", curves]
    words += [word for name in FURTHER_FRICTION for word in _friction_words(name, getattr(task.model, name))]
    words += [] if task.model.rotor else ["--no-rotor"]
    words += ["--stribeck-speed", f"{task.model.stribeck_speed:g}"] if task.model.stribeck else []
    return shlex.join(words)


def _friction_words(name: str, chosen: bool | tuple[str, ...]) -> list[str]:
    """Words that ask for a further friction parameter, such as ``--load-share 1,3``."""
    if chosen is False:
        return []
    flag = f"--{name.replace('_', '-')}"
    if name == "offset":  # a plain flag, since it always was one
        return [flag]
    return [flag, "all" if chosen is True else ",".join(chosen)]


def _summary(campaign: Campaign, design: str) -> Summary:
    from excite.cli.summary import Summary, some_of
    from excite.cli.view_text import brief_table
    from excite.views.campaign_view import campaign_view

    view = campaign_view(campaign)
    rows = tuple((*row[:-1], some_of(row[-1].split(", "), _NAMED)) for row in view.tables[0].rows)
    return Summary(
        verdict=view.verdict,
        facts=[*view.summary, *brief_table(replace(view.tables[0], rows=rows), left=5)],
        next_steps=[_next_step(campaign, design)],
    )


def _next_step(campaign: Campaign, design: str) -> str:
    return f"{design} --drives {','.join(campaign.steps[0].drives)} --out designs/motion-1"


def _print(campaign: Campaign, design: str) -> None:
    from excite.cli.literal_console import console
    from excite.cli.view_text import print_view
    from excite.views.campaign_view import campaign_view

    print_view(campaign_view(campaign))
    console().print(f"next: {_next_step(campaign, design)}", soft_wrap=True)
