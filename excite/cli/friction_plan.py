"""``excite friction plan``: runs at constant speed from which friction characteristics are found."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.options import Folder, Names, Numbers, Ranges

if TYPE_CHECKING:
    from excite.friction.plan import CoordinatePlan, FrictionPlan

_NOT_HELD = 1
_GRAVITY = {
    "none": "none",
    "cancels": "cancels",
    "subtracted": "the model's has to be subtracted",
    "stated": "said to cancel (--balanced)",
}


class PoseOrFound(click.ParamType[tuple[float, ...] | None]):
    """A number for every joint, separated by commas, or ``found``."""

    name = "pose"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...] | None:
        """Value of the text that was typed."""
        return None if value == "found" else Numbers().convert(value, param, ctx)


@click.command(
    name="plan",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True},
    epilog="""\b
Examples:
  excite friction plan irp6 --out friction/irp6
  excite friction plan irp6 --drives 1,2,3 --speeds 5,20,50,100 --shortest 0.25 --out friction/irp6
  excite friction plan ur10e --acceleration-limit 2 --jerk-limit 20 --out friction/ur10e
  excite friction plan arm.urdf --tip tool0 --pose 0,0,0,0,0,0 --out friction/arm

\b
What is written to DIR:
  NAME.csv    one motion per joint or drive: time [s], then NAME.position, NAME.velocity, NAME.acceleration of
              every joint [SI], and segment: 'warm-up', 'transfer', 'rest', 'z1 +30 %', 'z1 stiction -' ...
  plan.json   poses, windows of constant speed, order, limits over continuous time
  runs.png    positions and velocities over time, the windows in them

\b
The middle of every run is a pose in which gravity does not act on the joint, or acts alike to both sides, so that it
cancels over a window; where there is none the model's gravity has to be subtracted, and the summary says so. Obstacles
and the robot's own links are not looked at: watch the poses before anything is played.""",
)
@click.argument("robot")
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@click.option("--base", "base_link", metavar="LINK", help="First link of the chain, for a URDF.")
@click.option("--tip", metavar="LINK", help="Last link of the chain, for a URDF.")
@click.option("--drives", type=Names(), metavar="1,3", help="Drives to measure, by name or number.  [default: all]")
@click.option("--joints", type=Names(), metavar="1,3", help="Instead: joints to measure, each moved on its own.")
@click.option(
    "--speeds", "percent", type=Numbers(), default="5,10,20,30,40,50,60,70,80,90,100", metavar="P,...",
    help="In percent of the largest speed.",
)  # fmt: skip
@click.option("--pose", type=PoseOrFound(), default="found", metavar="Q,...", help="Middle of every run [rad or m].")
@click.option("--balanced", is_flag=True, help="Gravity cancels about --pose, though inertias are not known.")
@click.option("--shortest", type=float, default=0.3, metavar="S", help="Least window of constant speed [s].")
@click.option(
    "--longest",
    type=float,
    default=2.0,
    metavar="S",
    help="Largest window of constant speed [s]; inf: as the range allows.",
)
@click.option(
    "--stroke", type=float, default=float("inf"), metavar="R",
    help="Largest way to both sides of the pose [rad or m].  [default: the range]", show_default=False,
)  # fmt: skip
@click.option("--warm-up", type=float, default=30.0, metavar="S", help="Warm-up of each joint [s]; 0 for none.")
@click.option("--repeats", type=int, default=1, metavar="N", help="How often every speed is played.")
@click.option("--breakaways", type=int, default=3, metavar="N", help="Very slow starts from rest per direction.")
@click.option("--creep", type=float, default=0.1, metavar="P", help="Their speed, in percent of the largest one.")
@click.option("--creeping", type=float, default=5.0, metavar="S", help="Length of each of them [s].")
@click.option("--pause", type=float, default=0.5, metavar="S", help="Rest between runs [s].")
@click.option("--rate", type=float, default=500.0, metavar="HZ", help="Samples per second of the files.")
@click.option("--position-limit", type=Ranges(), metavar="L:U,...", help="Position limits per joint [rad or m].")
@click.option("--velocity-limit", type=Numbers(), metavar="V,...", help="Velocity limits [rad/s], one or one each.")
@click.option("--acceleration-limit", type=Numbers(), metavar="A,...", help="Acceleration limits [rad/s^2].")
@click.option("--jerk-limit", type=Numbers(), metavar="J,...", help="Jerk limits [rad/s^3].")
@click.option("--seed", type=int, default=0, metavar="N", help="Of the poses that are tried.")
@click.option("--force", is_flag=True, help="Replace a plan that is already in DIR.")
@click.pass_context
def command(
    ctx: click.Context, /, robot: str, out: Path, base_link: str | None, tip: str | None, **options: Any
) -> None:
    """Plan the runs that show the friction of ROBOT's joints or drives, and write them to DIR.

    Each goes there and back at constant speeds, with ramps within all limits, after a warm-up and very slow starts
    from rest. ROBOT is a built-in name, a robot YAML, or a URDF.
    """
    import numpy as np

    from excite.files.friction_runs import check_free, write_plan
    from excite.files.made_folder import made_folder
    from excite.friction.plan import friction_plan
    from excite.friction.schedule import Schedule
    from excite.plots.friction_plan import friction_plan_figure
    from excite.plots.writing import written
    from excite.task import LimitOverrides
    from regressors.library import load_robot

    check_free(out, force=options["force"])
    limits = LimitOverrides(*(options[f"{what}_limit"] for what in ("position", "velocity", "acceleration", "jerk")))
    described = limits.applied(load_robot(robot, base=base_link, tip=tip))
    if sys.stderr.isatty():
        click.echo("looking for poses and bounding torques ...", err=True)
    names = (
        "percent",
        "rate",
        "shortest",
        "longest",
        "stroke",
        "warm_up",
        "repeats",
        "creep",
        "creeping",
        "breakaways",
        "pause",
    )
    schedule = Schedule(**{name: options[name] for name in names})
    pose = None if options["pose"] is None else np.array(options["pose"])
    chosen = {name: options[name] for name in ("joints", "drives", "balanced", "seed")}
    with made_folder(out):
        plan = friction_plan(described, schedule, pose=pose, **chosen)
        files = [*write_plan(plan, out), *written({"runs": friction_plan_figure(plan)}, out)]
    _show(plan, files, found=pose is None)
    if any(c.broken for c in plan.coordinates):
        ctx.exit(_NOT_HELD)


def _show(plan: FrictionPlan, files: Sequence[Path], *, found: bool) -> None:
    from rich.table import Table
    from rich.text import Text

    from excite.cli.summary import console

    out = console()
    total = sum(c.runs.duration for c in plan.coordinates)
    out.print(
        Text(plan.robot.name, style="bold"), f": {len(plan.coordinates)} friction measurement(s), {total / 60:.1f} min",
        sep="", soft_wrap=True,
    )  # fmt: skip
    table = Table()
    for heading in ("moves", "pose of the joints", "gravity", "speeds", "to each side", "windows", "lasts", "limits"):
        table.add_column(heading, overflow="fold")
    for c in plan.coordinates:
        lengths = [window.end - window.start for window in c.windows]
        pose = " ".join(f"{value:.4g}" for value in c.place.pose + 0.0)
        speeds = f"{len(set(c.order))} to {max(c.order) / 100 * c.pace.velocity:.3g} {c.unit}/s"
        window = f"{min(lengths):.3g} to {max(lengths):.3g} s"
        table.add_row(
            c.label, pose, _gravity(c), speeds, f"{c.stroke:.3g} {c.unit}", window,
            f"{c.runs.duration:.0f} s", "broken" if c.broken else "hold",
        )  # fmt: skip
    out.print(table)
    for c in plan.coordinates:
        for percent, reason in c.left_out.items():
            out.print(f"{c.label}: {percent:g} % is left out: {reason}; --shortest allows less", soft_wrap=True)
        if c.place.gravity == "subtracted":
            nowhere = (
                "it cancels about no pose with room for the runs" if found else "it does not cancel about the pose"
            )
            out.print(f"{c.label}: gravity: {nowhere}; 'excite friction fit' subtracts the model's", soft_wrap=True)
        for use in c.broken:
            told = f"{use.extreme:.4g} {use.unit} beyond {use.bound:.4g} at {use.time:.2f} s"
            out.print(f"{c.label}: {use.label} does not hold: {told}; lower --acceleration-limit", soft_wrap=True)
        if c.torques_unchecked:
            out.print(f"{c.label}: torque limits are not checked: {c.torques_unchecked}", soft_wrap=True)
        if len(c.turns) > 1:
            out.print(
                f"{c.label} turns {', '.join(c.turns)}: what is measured is their friction together", soft_wrap=True
            )
        if c.pace.assumed:
            known = " and ".join(f"{what} {getattr(c.pace, what):.3g}" for what in c.pace.assumed)
            out.print(f"{c.label}: no limit is known; assumed: {known} (SI)", soft_wrap=True)
    order = ", ".join(f"{percent:g}" for percent in plan.coordinates[0].order)
    out.print(
        f"order, to keep the temperature steady: warm-up, stiction, then {order} % there and back", soft_wrap=True
    )
    out.print("obstacles and the robot's own links were not looked at", soft_wrap=True)
    out.print(f"written: {', '.join(map(str, files))}", soft_wrap=True)


def _gravity(plan: CoordinatePlan) -> str:
    told = _GRAVITY[plan.place.gravity]
    size, torque = plan.largest_gravity, {"rad": "Nm", "m": "N"}[plan.unit]
    return told if plan.place.gravity == "none" or size != size else f"{told}; up to {size:.3g} {torque}"
