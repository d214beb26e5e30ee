"""``excite friction plan``: runs at constant speed, from which friction curves are identified."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command, FurtherOption
from excite.cli.option_types import Folder, Names, Number, Numbers, PoseOrFound, RobotName
from excite.cli.options import figure_options, robot_file_of, robot_file_options
from excite.cli.task_options import chosen_of, settings_options, task_options
from excite.friction.plan.schedule import Schedule
from excite.tasks.task import PARTS

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.views.view import View

_NOT_HELD = 1


_LIMITED = ("position", "velocity", "acceleration", "jerk")

_GROUPS = {
    "Drives and poses": ("drives", "joints", "pose", "balanced", "seed"),
    "Runs": ("percent", "shortest", "longest", "stroke", "warm_up", "repeats", "pause"),
    "Break-away tests": ("breakaways", "creep", "creeping", "torque_ramp", "ramping"),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="plan",
    epilog="""\b
Examples:
  excite friction plan irp6 --out friction/irp6
  excite friction plan irp6 --drives 1,2,3 --speeds 5,20,50,100 --shortest 0.25 --out friction/irp6
  excite friction plan ur10e --acceleration-limit 2 --jerk-limit 20 --out friction/ur10e
  excite friction plan ur10e --longest inf --torque-ramp 60,60,30,10,10,10 --out friction/ur10e
  excite friction plan arm.urdf --tip tool0 --world world.yaml --out friction/arm

\b
What is written to DIR:
  NAME.csv    one motion per joint or drive: time [s], then NAME.position, NAME.velocity, NAME.acceleration of
              every joint [SI], and segment: 'warm-up', 'transfer', 'rest', 'z1 +30 %', 'z1 stiction -' ...
  NAME.stiction.csv   for robots with a torque interface: the pose, and slow ramps of the torque of one drive in both
              directions, column DRIVE.effort, in segments 'z1 stiction +', 'z1 stiction -'. Gravity in the pose is
              not included; a position controller has to take over once the drive moves
  plan.json   poses, windows of constant speed, order, limits and distances over continuous time, ramps of torque
  runs.png    positions and velocities over time, the windows in them

\b
The middle of every run is a pose in which gravity does not act on the joint, or acts symmetrically, so that it
cancels over a window. Where there is no such pose, the model's gravity has to be subtracted, and the summary says so.

\b
Give obstacles with --world FILE, as for 'excite design' (see 'excite design --help-all'): then poses are chosen, and
strokes bounded, so that the robot's links keep their distance from each other and from obstacles in every position
that a run passes. Without --world no collisions are checked: check the poses before you play anything. You move the
robot from one pose to the next; with --world the summary lists the straight lines in joint space that are free.

\b
Exit code: 0 the plan keeps all limits and distances; 1 it does not, but is written.""",
)
@click.argument("robot", type=RobotName())
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@robot_file_options("--base")
@task_options(("installation",))
@click.option("--drives", type=Names(), metavar="1,3", help="Drives to measure, by name or number.  [default: all]")
@click.option(
    "--joints",
    cls=FurtherOption,
    type=Names(),
    metavar="1,3",
    help="Instead: joints to measure, each moved on its own.",
)
@click.option("--pose", type=PoseOrFound(), default="found", metavar="Q,...", help="Middle of every run [rad or m].")
@click.option(
    "--balanced",
    cls=FurtherOption,
    is_flag=True,
    help="State that gravity cancels about --pose, for robots without known inertias.",
)
@task_options(("limits",), only=(*_LIMITED, "world"))
@settings_options(Schedule)
@click.option(
    "--torque-ramp", cls=FurtherOption, type=Numbers(), metavar="T,...",
    help="Largest torque of the ramps in NAME.stiction.csv, one for all, or one each; 0 for none [Nm or N].  "
    "[default: 1.5 times the friction in the robot's file, at most half of the torque limit]",
)  # fmt: skip
@click.option(
    "--seed", cls=FurtherOption, type=Number(), default=0, metavar="N", help="Seed of the random poses that are tried."
)
@figure_options()
@click.option("--force", is_flag=True, help="Replace a plan that is already in DIR.")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    robot: str,
    out: Path,
    **options: Any,
) -> None:
    """Plan runs that measure the friction of ROBOT's joints or drives, and write them to DIR.

    Each runs forth and back at constant speeds, with ramps within all limits, after a warm-up and break-away
    tests. ROBOT is a built-in name, a robot YAML, a URDF or an MJCF.
    """
    import excite
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.friction.plan.friction_plan import FIGURE, KIND, check_no_plan
    from excite.storage.figure_names import figure_names
    from excite.storage.records import json_of
    from excite.storage.result_folder import result_folder
    from excite.tasks.robot_of_task import installed_robot
    from excite.views.friction_plan_view import friction_plan_view

    read = robot_file_of(options)
    task = excite.Task(robot, **read, **chosen_of(PARTS["installation"], options))
    described = installed_robot(task)
    file = options["world"]
    world = (
        None
        if file is None
        else excite.read_world(Path(file), robot, read["base_link"], read["tip"], snap_angles=read["snap_angles"])
    )
    limits = excite.LimitChoice(**{what: options[what] for what in _LIMITED})
    schedule = Schedule(**chosen_of(Schedule, options))
    chosen = {name: options[name] for name in ("joints", "drives", "pose", "balanced", "torque_ramp", "seed")}
    tell("looking for poses and bounding torques")
    with result_folder(out):
        check_no_plan(out, figure_names([FIGURE], options["figures"].formats), replace=options["force"])
        plan = excite.plan_friction(described, schedule, limits=limits, world=world, **chosen)
        files = plan.save(out, replace=options["force"])
        if figures := options["figures"]:
            from excite.plots.figure_files import write_figure_files
            from excite.plots.friction_plan_plot import friction_plan_figure

            tell("drawing")
            drawn = write_figure_files(lambda: {FIGURE: friction_plan_figure(plan)}, out, KIND, **figures.how)
            files = [*files, *drawn]
    view = friction_plan_view(plan)
    show(
        _summary(view, files),
        lambda: {"out": str(out), **{name: each for name, each in json_of(plan).items() if name != "robot"}},
        lambda: _print(view, files),
    )
    if not plan.holds:
        ctx.exit(_NOT_HELD)


def _summary(view: View, files: Sequence[Path]) -> Summary:
    from excite.cli.summary import Summary
    from excite.cli.view_text import brief_table

    return Summary(
        verdict=view.verdict,
        holds=view.holds,
        facts=[*view.summary, *brief_table(view.tables[0], left=2)],
        notes=view.remarks,
        files=files,
        next_steps=[
            "play each file and record positions and torques, then excite friction fit ROBOT LOG... --plan "
            f"{files[0].parent} --out DIR"
        ],
        all_in="plan.json",
    )


def _print(view: View, files: Sequence[Path]) -> None:
    from excite.cli.literal_console import console
    from excite.cli.view_text import print_view

    print_view(view)
    console().print(f"written: {', '.join(map(str, files))}", soft_wrap=True)
