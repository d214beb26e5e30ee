"""``excite payload design``: a short motion that shows what a robot holds."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command
from excite.cli.messages import in_options
from excite.cli.option_types import BoxOrSides, Folder, Number, Numbers, RobotName
from excite.cli.options import figure_options
from excite.cli.payload_options import frame_option, robot_of, robot_options
from excite.cli.streams import remark
from excite.cli.task_options import task_options

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.payload.payload_motion import PayloadMotion

_LIMITS = ("velocity", "acceleration", "jerk", "torque_margin", "tool_point", "tool_speed", "floor", "self_collision")

_GROUPS = {
    "Motion": ("box", "centre", "pose", "swing", "period", "harmonics"),
    "Sensor": ("sensor", "frame"),
    "Search": ("starts", "seed"),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="design",
    epilog="""\b
Examples:
  excite payload design ur10e --box 0.2 --pose 0,-1.2,1.6,-1.2,-1.57,0 --period 5 --out motion
  excite payload design panda --box 0.2,0.2,0.1 --out motion
  excite payload design panda --box=0.3:0.6,-0.2:0.2,0.3:0.7 --pose 0,-0.4,0,-2,0,1.8,0.785 --out motion
  excite payload design arm.urdf --tip tool0 --acceleration-limit 2 --sensor wrench --out motion

\b
The motion turns the wrist, which shows mass and centre against gravity and the inertia by its acceleration, while the
arm moves little and the tool point stays in the box. It starts and ends at rest, and its limits hold at all times, not
only at samples. Drive the robot to its first pose, play it once without the load and once with it, slowly first, and
record positions and torques (or the wrench) with 'excite payload identify' in mind.

\b
What is written to DIR: design.json and trajectory.csv, as by 'excite design'.
Exit code: 0 the motion keeps all limits; 1 it does not, but is written.""",
)
@click.argument("robot", type=RobotName())
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@robot_options
@click.option(
    "--box", type=BoxOrSides(), default="0.2", metavar="S|SX,SY,SZ|L:U,L:U,L:U",
    help="Box of the tool point [m]: its sides about --centre, or its bounds in the base frame.",
)  # fmt: skip
@click.option(
    "--centre", type=Numbers("tool_point"), metavar="X,Y,Z",
    help="Centre of the box in the base frame [m].  [default: the tool point in --pose]", show_default=False,
)  # fmt: skip
@click.option(
    "--pose", type=Numbers("pose"), metavar="Q,...",
    help="Present pose, which the motion is about [rad or m].  [default: the robot's home, or mid-range]",
    show_default=False,
)  # fmt: skip
@click.option(
    "--swing", type=Numbers("pose"), metavar="R,...",
    help="Largest deviation from --pose, one for all, or one each [rad or m].  [default: wrist 1.5, others 0.35]",
    show_default=False,
)  # fmt: skip
@click.option(
    "--sensor", type=click.Choice(["torque", "wrench"]), default="torque",
    help="What measures: the joints' torques, or a force/torque sensor that carries the load.",
)  # fmt: skip
@frame_option
@click.option("--period", type=Number(), default=5.0, metavar="S", help="Duration of the motion [s].")
@click.option("--harmonics", type=Number(), default=3, metavar="N", help="Harmonics of its Fourier series.")
@click.option("--starts", type=Number(), default=1, metavar="N", help="Random starts; the best one is taken.")
@task_options(("search",), only=("seed",))
@task_options(("output",), only=("rate",))
@task_options(("limits",), only=(*_LIMITS, "world"))
@figure_options("none")
@click.option("--force", is_flag=True, help="Replace a design that is already in DIR.")
def command(robot: str, out: Path, **given: Any) -> None:
    """Find a short motion of ROBOT in a small box that shows mass, centre and inertia of what it holds.

    ROBOT is a built-in name, a robot YAML, a URDF or an MJCF.
    """
    import excite
    from excite.cli.design_text import print_design
    from excite.cli.interrupts import one_interrupt
    from excite.cli.main import NOT_HELD
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.files.design_folder import check_no_design
    from excite.storage.result_folder import result_folder

    limits = {name: given[name] for name in _LIMITS if given[name] is not None}
    if given["world"] is not None:
        own = {name: given[name] for name in ("base_link", "tip")}
        limits["world"] = excite.read_world(
            Path(given["world"]), robot, own["base_link"], own["tip"], snap_angles=given["snap_angles"] is not False
        )
    asked = ("sensor", "pose", "centre", "swing", "period", "harmonics", "starts", "seed", "rate", "frame")
    with result_folder(out):
        check_no_design(out, ("trajectory.csv",), replace=given["force"])
        tell("looking for the best motion")
        with one_interrupt() as interruption:
            motion = excite.design_payload_motion(
                robot,
                given["box"],
                limits=excite.LimitChoice(**limits),
                **robot_of(given),
                **{name: given[name] for name in asked},
            )
            interruption.ignore()
            files = motion.design.save(out, replace=given["force"])
            if figures := given["figures"]:
                tell("drawing")
                from excite.plots import write_figures

                files = [*write_figures(motion.design, out, **figures.how), *files]
    for note in motion.notes:
        remark(f"excite: note: {in_options(note)}")
    show(_summary(motion, files), lambda: _content(motion, out), lambda: print_design(motion.design, files))
    sys.exit(0 if motion.design.feasible else NOT_HELD)


def _content(motion: PayloadMotion, out: Path) -> dict[str, Any]:
    from excite.files.design_folder import design_content

    left_out = ("schema", "robot", "solver", "conventions")
    shown = {k: v for k, v in design_content(motion.design).items() if k not in left_out}
    own = {"pose": motion.pose.tolist(), "box": motion.box, "payload_notes": list(motion.notes)}
    return {"out": str(out), **shown, **own}


def _rounded(box: Sequence[tuple[float | None, float | None]]) -> list[tuple[str, str]]:
    return [("-inf" if low is None else f"{low:.3g}", "inf" if high is None else f"{high:.3g}") for low, high in box]


def _summary(motion: PayloadMotion, files: list[Path]) -> Summary:
    """That of the design, with the box that the tool point stays in, and what to do next."""
    from excite.cli.design_text import design_summary

    stays = ""
    if motion.box is not None:
        sides = ", ".join(
            f"{axis} {low} to {high}" for axis, (low, high) in zip("xyz", _rounded(motion.box), strict=True)
        )
        stays = f"the tool point stays in {sides} m; "
    return replace(
        design_summary(motion.design, files),
        notes=(*motion.notes, *motion.design.notes),
        next_steps=[
            f"{stays}drive to the first pose, play trajectory.csv slowly, then without and "
            "with the load, and record both for 'excite payload identify'"
        ],
    )
