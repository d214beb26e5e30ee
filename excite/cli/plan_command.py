"""``excite plan``: the shortest campaign of partial motions; or, for a precision, the next motion after others."""

from __future__ import annotations

import sys
from typing import Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Folder, RobotName
from excite.cli.options import robot_file_options, robot_file_typed, task_file_option
from excite.cli.task_options import check_not_typed, settings_options, task_options, typed_options
from excite.tasks.further_settings import CampaignSettings
from excite.tasks.model_choice import FURTHER_FRICTION

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
@settings_options(CampaignSettings)
@task_options(("objective",), only=("precision", "after", "noise"))
@task_options(("search",), only=("starts",))
@task_options(
    ("trajectory",),
    only=("period",),
    help={"period": "Period of the next motion."},
    unset={"period": "that of the shortest experiment"},
)
@task_file_option("Task file of the next motion.")
@click.option("--out", type=Folder(), metavar="DIR", help="Folder for the next motion.")
@click.option("--force", is_flag=True, help="Replace a design that is already in DIR.")
@click.pass_context
def command(ctx: click.Context, /, robot: str, **given: Any) -> None:
    """Propose the shortest campaign: few motions of few drives of ROBOT that together identify every parameter.

    Drives that do not move hold their own coordinate, as brakes and position control do. With --precision, propose the
    next motion after the results and designs in --after, or say that they are enough.
    """
    from excite.cli.plan_run import next_motion_task, plan_campaign, plan_next_motion

    if given["precision"] is None:
        check_not_typed(ctx, _OF_NEXT_MOTION, "is for the next motion towards a precision; give --precision too")
        plan_campaign(robot, given)
    else:
        typed = typed_options(ctx) | robot_file_typed(given)
        task = next_motion_task(robot, typed, given["task_file"])
        sys.exit(plan_next_motion(task, given["of"], given["out"], force=given["force"]))
