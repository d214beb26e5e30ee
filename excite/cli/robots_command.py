"""``excite robots``: list the built-in robots, or describe one robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command
from excite.cli.messages import in_options
from excite.cli.option_types import RobotName
from excite.cli.options import robot_file_of, robot_file_options
from excite.cli.streams import remark, verbosity
from excite.cli.task_options import chosen_of, task_options
from excite.tasks.task import PARTS
from regressors.errors import InputError

if TYPE_CHECKING:
    from rich.table import Table

    from regressors.models.base import Base
    from regressors.robot.finding import Finding
    from regressors.robot.robot import Robot

_GROUPS = {
    "Output": ("capsules",),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
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
@task_options(("model",), only=("joints", "friction", "rotor"), essential=("joints", "friction", "rotor"))
@click.option("--capsules", is_flag=True, help="Print a URDF's shape as capsules, to begin a world file with.")
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Write the robot as robot YAML.")
@click.option("--force", is_flag=True, help="Replace a FILE that is already there.")
def command(
    robot: str | None,
    joints: tuple[str, ...] | None,
    friction: bool,
    rotor: bool,
    capsules: bool,
    out: Path | None,
    force: bool,
    **given: Any,
) -> None:
    """List the built-in robots; with ROBOT (a built-in name, a robot YAML, a URDF or an MJCF) show one.

    Shown are the joints with their limits, the limits on drive coordinates, and the base parameters: the combinations
    of inertial parameters that are identifiable from motion; of a URDF also what was assumed, what is missing and what
    is implausible. With --out the robot is written as robot YAML instead.
    """
    from excite.cli.summary import Summary, show
    from excite.information.target import left_to_right_base
    from excite.tasks.robot_of_task import installed_robot
    from excite.tasks.task import Task

    if robot is None:
        if out is not None:
            raise click.UsageError("--out writes one robot; name it: excite robots ROBOT --out FILE")
        _list()
        return
    read = robot_file_of(given)
    if capsules:
        from excite.files.world_file import capsules_text, urdf_capsules

        parts, left_out = urdf_capsules(robot, read["base_link"], read["tip"], snap_angles=read["snap_angles"])
        if not parts:
            more = f" ({len(left_out) - 1} more like it)" if len(left_out) > 1 else ""
            raise InputError(f"{left_out[0][1]}{more}, and no other shape is left; put the meshes there")
        for _, what in left_out:
            remark(f"excite: note: left out: {what}")
        if verbosity().as_json:
            click.echo(
                json.dumps({"world": capsules_text(parts), "left_out": [what for _, what in left_out]}, indent=1)
            )
        else:
            click.echo(capsules_text(parts), nl=False)
        return
    installation = chosen_of(PARTS["installation"], given)
    task = Task(robot, joints=joints, friction=friction, rotor=rotor, **read, **installation)
    whole = installed_robot(task)
    if out is not None:
        from excite.files.robot_yaml import write_robot

        write_robot(whole, out, replace=force)
        show(Summary(f"written: {out}"), lambda: {"out": str(out)}, lambda: None)
        return
    motion, parameters = left_to_right_base(whole, task)
    moving = motion.labels
    if verbosity().plain:
        _show(whole, moving, parameters)
        return
    show(
        Summary(_verdict(whole, moving, parameters)),
        lambda: _content(whole, moving, parameters),
        lambda: _show(whole, moving, parameters),
    )


def _verdict(whole: Robot, moving: tuple[str, ...], base: Base) -> str:
    return f"{whole.name}: {whole.n} joints; motion of {', '.join(moving)} identifies {base.rank} base parameters"


def _list() -> None:
    from excite.cli.literal_console import console
    from regressors.readers.library import built_in, built_in_names

    robots = {name: built_in(name) for name in built_in_names()}
    if verbosity().quiet:
        click.echo("\n".join(robots))
        return
    if verbosity().as_json:
        listed = [{"name": name, "joints": list(r.joint_names), "source": r.source} for name, r in robots.items()]
        click.echo(json.dumps(listed, indent=1))
        return
    table = _table("built-in robots", "name", "joints", "source")
    for name, described in robots.items():
        table.add_row(name, str(described.n), described.source)
    console().print(table)
    click.echo("'excite robots NAME' shows one; every command also takes a robot YAML, a URDF, a xacro or an MJCF")


def _table(title: str | None, *headings: str) -> Table:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for heading in headings:
        table.add_column(heading, overflow="fold")
    return table


def _content(whole: Robot, moving: tuple[str, ...], base: Base) -> dict[str, Any]:
    return {
        "name": whole.name,
        "sha256": whole.sha256(),
        "description": whole.description(),
        "health": [_finding(note) for note in whole.notes],
        "moving_joints": list(moving),
        "base": {
            "rank": base.rank,
            "gap": base.gap if base.gap != float("inf") else None,
            "columns": list(base.names),
            "expressions": list(base.expressions),
            "units": list(base.units),
            "by_rounding": list(base.by_rounding),
        },
    }


def _finding(note: Finding) -> dict[str, str]:
    return {"kind": note.kind, "where": note.where, "what": note.what, "advice": in_options(note.advice)}


def _show(whole: Robot, moving: tuple[str, ...], base: Base) -> None:
    from rich.text import Text

    from constraints.linear import QUANTITIES, linear_limits
    from excite.cli.literal_console import console
    from excite.information.nearly_unidentifiable import left_out_by_rounding

    out = console()
    out.print(Text(whole.name, style="bold"), f": {whole.n} joint(s); {whole.source}", sep="", soft_wrap=True)
    out.print(f"description SHA-256 {whole.sha256()[:16]}..., gravity {whole.gravity.tolist()} m/s^2", soft_wrap=True)
    joints = _table("joints", "number", "name", "kind", "link", "mass [kg]")
    for number, (joint, link) in enumerate(zip(whole.joints, whole.links, strict=True), 1):
        mass = "unknown" if link.theta is None else f"{link.theta[0]:.4g}"
        joints.add_row(str(number), joint.name, joint.kind, link.name, mass)
    for branch, number in zip(whole.branches, whole.body_numbers[whole.n :], strict=True):
        terms = (f"{c:g} {name}" for c, name in zip(branch.coupling, whole.joint_names, strict=True) if c != 0.0)
        mass = "unknown" if branch.link.theta is None else f"{branch.link.theta[0]:.4g}"
        kind = (
            f"turns with {' + '.join(terms)}" if branch.joint.kind == "revolute" else f"slides with {' + '.join(terms)}"
        )
        joints.add_row(str(number), f"on {branch.parent}", kind, branch.link.name, mass)
    out.print(joints)
    names = [f"joint {name}" for name in whole.joint_names]
    names += [f"drive {drive.name}" for drive in whole.transmission.drives] if whole.transmission else []
    limits: dict[str, dict[str, str]] = {name: {} for name in names}
    for limit in linear_limits(whole):
        for label, lower, upper, unit in zip(limit.labels, limit.lower, limit.upper, limit.units, strict=True):
            coordinate = label.removesuffix(f" {limit.quantity}")
            shown = f"[{lower:.4g}, {upper:.4g}]" if limit.derivative == 0 else f"{upper:.4g}"
            limits[coordinate][limit.quantity] = f"{shown} {unit}"
    table = _table("limits", "coordinate", *QUANTITIES)
    for coordinate, row in ((name, row) for name, row in limits.items() if row):
        table.add_row(coordinate, *(row.get(quantity, "-") for quantity in QUANTITIES))
    out.print(table if table.row_count else "no limits are known")
    _show_health(whole.notes)
    clarity = "no column depends on others" if base.gap == float("inf") else f"singular value gap {base.gap:.1e}"
    title = f"base parameters of {', '.join(moving)}: {base.rank} of {len(base.columns)} columns ({clarity})"
    out.print(title, soft_wrap=True)
    for note in left_out_by_rounding(whole, base):
        out.print(in_options(note), soft_wrap=True)
    parameters = _table(None, "column", "combination", "unit")
    for name, expression, unit in zip(base.names, base.expressions, base.units, strict=True):
        parameters.add_row(name, expression, unit)
    out.print(parameters)


def _show_health(notes: tuple[Finding, ...]) -> None:
    """What the reader noticed in the file."""
    from excite.cli.literal_console import console

    if not notes:
        return
    table = _table("health of the description", "", "where", "what", "advice")
    for note in notes:
        table.add_row(note.kind, note.where, note.what, in_options(note.advice))
    console().print(table)
