"""``excite payload identify``: what a robot holds, from its logs."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Folder, Number, RobotName, Share
from excite.cli.payload_options import frame_option, log_options, logs_of, robot_of, robot_options

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.views.view import View

_CONTROLLERS = ("all", "none", "ur", "franka", "kuka", "abb", "urdf")

_GROUPS = {
    "Logs": ("without", "loaded", "wrench", "mapping", "drop", "rows", "without_rows"),
    "Signals": ("cutoff", "low_pass"),
    "Gains": ("gains", "gain_deviation"),
    "Payload": ("result", "frame", "frame_name", "controller", "rated"),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="identify",
    epilog="""\b
Examples:
  excite payload identify ur10e --without bare.csv --with load.csv --gains gains.yaml --out payload
  excite payload identify panda --without bare.csv --with load.csv --frame 0,0,0.107 --controller franka --out payload
  excite payload identify ur10e --result results/ur10e --with load.csv --out payload
  excite payload identify ur10e --wrench load.wrench.csv --frame 0,0,0.05 --out payload

\b
The robot without the load is known from a log of a like motion (--without), or from a result of 'excite identify'
(--result). A force/torque sensor that carries the load (--wrench) needs neither; with --without, a wrench log too, what
it carries otherwise, such as the gripper, is subtracted. Logs are as for 'excite identify'.

\b
Intervals of 99 % count noise that is correlated in time, friction that changes from log to log, the covariance of the
robot's parameters, and the gains of the drives: as calibrated in --gains, or else as stated, which are then taken to be
off by 11 % (standard deviation; those published for one arm were off by 9 %), unless --gain-deviation says better.

\b
Centre and inertia are stated in the frame of the last link of ROBOT's description, or in --frame, such as the flange,
given in it. Controllers expect the flange: give --frame where the last link's frame is not the flange.

\b
What is written to DIR:
  payload.json  mass, centre, inertia about the centre, each with value and interval; frame, gains, logs, notes
  payload.script (UR), payload.franka.cpp, payload.dat (KUKA), payload.mod (ABB), payload.urdf
Exit code: 0 done; 1 written, but a doubt remains, such as a mass that is hardly shown.""",
)
@click.argument("robot", type=RobotName())
@click.option(
    "--without", multiple=True, type=click.Path(path_type=Path), metavar="LOG", help="Log without the load; repeatable."
)
@click.option(
    "--with", "loaded", multiple=True, type=click.Path(path_type=Path), metavar="LOG",
    help="Log with the load, fixed to the last link; repeatable.",
)  # fmt: skip
@click.option(
    "--wrench", multiple=True, type=click.Path(path_type=Path), metavar="LOG",
    help="Instead of --with: log of the wrench of a sensor that carries the load; repeatable.",
)  # fmt: skip
@click.option("--result", type=Folder(), metavar="DIR", help="Instead of --without: the robot's identified model.")
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@click.option("--gains", type=click.Path(path_type=Path), metavar="FILE", help="Gains from 'excite payload gains'.")
@click.option(
    "--gain-deviation", type=Share(), metavar="X",
    help="Relative standard deviation of the stated gains, the same in all drives.  [default: 0.1, and 0.05 of each]",
    show_default=False,
)  # fmt: skip
@frame_option
@click.option("--frame-name", metavar="NAME", help="What --frame is, for the files, such as flange.")
@click.option(
    "--controller", type=click.Choice(_CONTROLLERS), default="all", help="Whose form of the payload is printed."
)
@click.option("--rated", type=Number("known_mass"), metavar="KG", help="Largest load of the robot [kg].")
@robot_options
@log_options
@click.option("--force", is_flag=True, help="Replace a payload that is already in DIR.")
def command(
    robot: str,
    without: tuple[Path, ...],
    loaded: tuple[Path, ...],
    wrench: tuple[Path, ...],
    out: Path,
    **given: Any,
) -> None:
    """Estimate mass, centre and inertia of what ROBOT holds, and write them to DIR with 99 % intervals.

    ROBOT is a built-in name, a robot YAML, a URDF or an MJCF.
    """
    import excite
    from excite.cli.main import NOT_HELD
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.payload.payload_result import check_no_payload
    from excite.storage.records import json_of
    from excite.storage.result_folder import result_folder
    from excite.views.payload_view import payload_view

    if bool(loaded) == bool(wrench):
        raise click.UsageError("give the logs of the motion with the load, as --with or as --wrench")
    chosen = {"all": _CONTROLLERS[2:], "none": ()}.get(given["controller"], (given["controller"],))
    tell("reading the logs and identifying")
    with result_folder(out):
        check_no_payload(out, chosen, replace=given["force"])
        payload = excite.identify_payload(
            robot,
            list(loaded or wrench),
            without=list(without),
            wrench=bool(wrench),
            logs=logs_of(given),
            **{name: given[name] for name in ("result", "gains", "gain_deviation", "frame", "frame_name", "rated")},
            **robot_of(given),
        )
        files = payload.save(out, controllers=chosen, replace=given["force"])
    view = payload_view(payload)
    show(
        _summary(view, files),
        lambda: {"out": str(out), **json_of(payload), "controllers": payload.texts(chosen)},
        lambda: _print(view, payload.texts(chosen), files),
    )
    sys.exit(NOT_HELD if payload.doubts else 0)


def _summary(view: View, files: Sequence[Path]) -> Summary:
    from excite.cli.summary import Summary
    from excite.cli.view_text import brief_table

    return Summary(
        verdict=view.verdict,
        holds=view.holds,
        facts=[*view.summary, *brief_table(view.tables[0], most=len(view.tables[0].rows))],
        notes=view.remarks,
        files=files,
        next_steps=["give mass and centre to the controller; the files hold them in its form"],
        all_in="payload.json",
    )


def _print(view: View, texts: Mapping[str, Mapping[str, str]], files: Sequence[Path]) -> None:
    """Print the numbers with their intervals, and the controllers' forms of them."""
    from excite.cli.literal_console import console
    from excite.cli.view_text import print_view

    print_view(view)
    out = console()
    for name, each in texts.items():
        out.print(f"\n{name}:", style="bold")
        out.print(each["text"].rstrip(), soft_wrap=True)
    out.print("written: " + ", ".join(map(str, files)), soft_wrap=True)
