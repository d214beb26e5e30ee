"""``excite robots``: list the built-in robots, or describe one robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from excite.cli.command import Command
from excite.cli.option_types import RobotName
from excite.cli.options import robot_file_options
from excite.cli.streams import verbosity
from excite.cli.task_options import task_options

_OF_MODEL = ("joints", "friction", "rotor")


@click.command(
    cls=Command,
    groups={"Output": ("capsules",)},
    name="robots",
    epilog="""\b
Examples:
  excite robots
  excite robots irp6
  excite robots panda --no-friction
  excite robots arm.urdf --base-link base_link --tip tool0
  excite robots arm.urdf --capsules > world.yaml
  excite robots arm.xml --tip hand --out arm.yaml""",
)
@click.argument("robot", type=RobotName(), required=False)
@robot_file_options("--base")
@task_options(("installation",))
@task_options(("model",), only=_OF_MODEL, essential=_OF_MODEL)
@click.option("--capsules", is_flag=True, help="Print a URDF's shape as capsules, to begin a world file with.")
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Write the robot as robot YAML.")
@click.option("--force", is_flag=True, help="Replace a FILE that is already there.")
def command(robot: str | None, out: Path | None, capsules: bool, **given: Any) -> None:
    """List the built-in robots; with ROBOT (a built-in name, a robot YAML, a URDF or an MJCF) show one.

    Shown are the joints with their limits, the limits on drive coordinates, and the base parameters: the combinations
    of inertial parameters that are identifiable from motion; of a URDF also what was assumed, what is missing and what
    is implausible. With --out the robot is written as robot YAML instead.
    """
    if robot is None:
        if out is not None:
            raise click.UsageError("--out writes one robot; name it: excite robots ROBOT --out FILE")
        _list()
        return
    from excite.cli.robots_run import print_capsules, show_robot

    if capsules:
        print_capsules(robot, given)
    else:
        show_robot(robot, out, given)


def _list() -> None:
    """Print the built-in robots."""
    from excite.cli.summary import print_table
    from regressors.readers.library import built_in, built_in_names

    robots = {name: built_in(name) for name in built_in_names()}
    if verbosity().quiet:
        click.echo("\n".join(robots))
    elif verbosity().as_json:
        listed = [{"name": name, "joints": list(r.joint_names), "source": r.source} for name, r in robots.items()]
        click.echo(json.dumps(listed, indent=1))
    else:
        rows = [(name, str(described.n), described.source) for name, described in robots.items()]
        print_table("built-in robots", ("name", "joints", "source"), rows)
        click.echo("'excite robots NAME' shows one; every command also takes a robot YAML, a URDF, a xacro or an MJCF")
