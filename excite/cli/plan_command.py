"""``excite plan``: the shortest campaign of partial motions that identifies every parameter."""

from __future__ import annotations

import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command
from excite.cli.options import Names, Number, RobotName, snap_option
from excite.cli.task_options import task_options
from excite.registry import MODELS
from excite.tasks.model_choice import FURTHER_FRICTION

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.design.campaign import Campaign
    from excite.tasks.task import Task


@click.command(
    cls=Command,
    name="plan",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True},
    epilog="""\b
Examples:
  excite plan irp6
  excite plan irp6 --model energy --at-once 1
  excite plan panda --no-friction --at-once 3
  excite plan irp6 --friction-curves friction.yaml

\b
Each motion is then designed on its own:
  excite design irp6 --drives 1,3 --out designs/irp6-13""",
)
@click.argument("robot", type=RobotName())
@click.option("--base-link", metavar="LINK", help="First link of the chain, for a URDF or MJCF.")
@click.option("--tip", metavar="LINK", help="Last link of the chain, for a URDF or MJCF.")
@task_options(("installation",))
@snap_option
@click.option("--joints", type=Names(), metavar="1,2,3", help="Joints whose parameters to identify.")
@click.option(
    "--model", type=click.Choice(MODELS), default="energy", help="Model whose equations identify the parameters."
)
@click.option(
    "--at-once",
    type=Number(),
    metavar="N",
    help="Largest number of drives that move at the same time.  [default: 2]",
)
@click.option("--friction/--no-friction", default=True, help="Friction as parameters.")
@click.option(
    "--friction-curves", metavar="FILE", help="Known friction curves; friction of the other drives is identified."
)
@click.option("--rotor/--no-rotor", default=True, help="Rotor inertias as parameters.")
@task_options(("model",), only=(*FURTHER_FRICTION, "stribeck_speed"))
def command(
    robot: str,
    base_link: str | None,
    tip: str | None,
    snap_angles: bool | None,
    joints: tuple[str, ...] | None,
    model: str,
    at_once: int | None,
    friction: bool,
    friction_curves: str | None,
    rotor: bool,
    **further: Any,
) -> None:
    """Propose the shortest campaign: few motions of few drives of ROBOT that together identify every parameter.

    Drives that do not move hold their own coordinate, as brakes and position control do.
    """
    import excite
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show

    curves = None if friction_curves is None else excite.read_friction(Path(friction_curves))
    asked: dict[str, Any] = {
        "joints": joints,
        "model": model,
        "friction": friction,
        "friction_curves": curves,
        "rotor": rotor,
    }
    described: dict[str, Any] = {"base_link": base_link, "tip": tip, "snap_angles": snap_angles is not False}
    task = excite.Task(robot, **described, **asked, **further)
    tell("finding the parameters that each selection of drives identifies")
    campaign = excite.plan_campaign(task, at_once)
    design = _design_command(task, friction_curves)
    show(_summary(campaign, design), lambda: asdict(campaign), lambda: _print(campaign, design))


def _design_command(task: Task, curves: str | None) -> str:
    """Command that designs for the same robot, chain and parameters."""
    words = ["excite", "design", task.robot_name, "--model", str(task.model.model)]
    words += ["--base", task.base_link] if task.base_link is not None else []
    words += ["--tip", task.tip] if task.tip is not None else []
    words += [] if task.snap_angles else ["--no-snap-angles"]
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
    from excite.cli.summary import Summary, compact_table, some_of

    rows = [
        (str(number), ", ".join(step.drives), str(step.rank), some_of(step.parameters, 6))
        for number, step in enumerate(campaign.steps, 1)
    ]
    most = max(len(step.drives) for step in campaign.steps)
    count = len(campaign.steps)
    return Summary(
        verdict=f"{count} motion{'s' * (count > 1)} of at most {most} drive{'s' * (most > 1)} identify all "
        f"{campaign.rank} parameters of {campaign.robot} ({campaign.model} model)",
        facts=[
            f"joints {', '.join(campaign.joints)}; {len(campaign.subsets)} selections of drives were compared",
            *compact_table(
                "motion", "drives that move", "combinations", "then identified individually", rows=rows, left=4
            ),
        ],
        next_steps=[_next_step(campaign, design)],
    )


def _next_step(campaign: Campaign, design: str) -> str:
    return f"{design} --drives {','.join(campaign.steps[0].drives)} --out designs/motion-1"


def _print(campaign: Campaign, design: str) -> None:
    from rich.table import Table
    from rich.text import Text

    from excite.cli.literal_console import console

    out = console()
    out.print(
        Text(campaign.robot, style="bold"),
        f": {len(campaign.steps)} motion(s) identify all {campaign.rank} parameters of the {campaign.model} "
        f"model of joints {', '.join(campaign.joints)}",
        sep="",
        soft_wrap=True,
    )
    table = Table(title="campaign", title_justify="left", show_lines=True)
    for heading in ("motion", "drives that move", "identifies", "newly identified individually"):
        table.add_column(heading, overflow="fold")
    for number, step in enumerate(campaign.steps, 1):
        table.add_row(str(number), ", ".join(step.drives), "\n".join(step.expressions), ", ".join(step.parameters))
    out.print(table)
    out.print("parameters that each selection of drives identifies")
    subsets = Table()
    subsets.add_column("drives")
    subsets.add_column("parameters", justify="right")
    for drives, rank in campaign.subsets:
        subsets.add_row(", ".join(drives), str(rank))
    out.print(subsets)
    out.print(f"next: {_next_step(campaign, design)}", soft_wrap=True)
