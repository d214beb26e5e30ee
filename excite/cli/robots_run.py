"""Execution of ``excite robots``: the list of built-in robots, one robot, or its shape."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from rich.text import Text

from constraints.geometry import World
from constraints.linear import QUANTITIES, linear_limits
from constraints.world_file import UrdfShapes, world_text
from excite.cli.options import task_of
from excite.cli.streams import in_options, remark, verbosity
from excite.cli.summary import console, print_table, show
from excite.export.models.robot_yaml import write_robot
from excite.information.nearly_unidentifiable import left_out_by_rounding
from excite.information.target import left_to_right_base
from excite.tasks.installation import Installation
from excite.tasks.model_choice import ModelChoice
from excite.tasks.robot_of_task import installed_robot
from excite.views.view import View
from regressors.errors import InputError
from regressors.models.base import Base
from regressors.models.servo import ServoModel
from regressors.models.servo_response import scale_shown_by
from regressors.numerical import or_none
from regressors.robot.robot import BASE, Link, Robot


def print_capsules(robot: str, given: Mapping[str, Any]) -> None:
    """Print the shape of a URDF as capsules of a world file."""
    shapes = UrdfShapes(robot, given["base_link"], given["tip"], given["snap_angles"] is not False)
    parts, left_out = shapes.capsules()
    if not parts:
        more = f" ({len(left_out) - 1} more like it)" if len(left_out) > 1 else ""
        raise InputError(f"{left_out[0][1]}{more}, and no other shape is left; put the meshes there")
    for _, what in left_out:
        remark(f"excite: note: left out: {what}")
    text = world_text(shapes.ranges_apart(World(parts)))
    if verbosity().as_json:
        click.echo(json.dumps({"world": text, "left_out": [what for _, what in left_out]}, indent=1))
    else:
        click.echo(text, nl=False)


def show_robot(robot: str, out: Path | None, given: Mapping[str, Any]) -> None:
    """Print a robot, or write it."""
    task = task_of(robot, given, Installation, ModelChoice)
    whole = installed_robot(task)
    if out is not None:
        write_robot(whole, out, replace=given["force"])
        show(View(whole.name, f"written: {out}"), content=lambda: {"out": str(out)})
        return
    motion, base = left_to_right_base(whole, task)
    chosen = verbosity()
    if not (chosen.quiet or chosen.verbose or chosen.as_json):
        _print(whole, motion.labels, base)
        return
    moving = ", ".join(motion.labels)
    show(
        View(whole.name, f"{whole.name}: {whole.n} joints; motion of {moving} identifies {base.rank} base parameters"),
        content=lambda: _content(whole, motion.labels, base),
        details=lambda: _print(whole, motion.labels, base),
    )


def _content(whole: Robot, moving: tuple[str, ...], base: Base) -> dict[str, Any]:
    lists = {name: list(getattr(base, name)) for name in ("expressions", "units", "by_rounding")}
    told = _servos(whole).items()
    return {
        "name": whole.name,
        "sha256": whole.sha256(),
        "description": whole.description(),
        "health": [
            {"kind": note.kind, "where": note.where, "what": note.what, "advice": in_options(note.advice)}
            for note in whole.notes
        ],
        "moving_joints": list(moving),
        "base": {"rank": base.rank, "gap": or_none(base.gap), "columns": list(base.names), **lists},
        "servos": {name: {"gravity": load, "own_inertia": own, "told_by": text} for name, (load, own, text) in told},
    }


def _print(whole: Robot, moving: tuple[str, ...], base: Base) -> None:
    out = console()
    out.print(Text(whole.name, style="bold"), f": {whole.n} joint(s); {whole.source}", sep="", soft_wrap=True)
    out.print(f"description SHA-256 {whole.sha256()[:16]}..., gravity {whole.gravity.tolist()} m/s^2", soft_wrap=True)
    print_table("joints", ("number", "name", "kind", "link", "mass [kg]", *_on(whole, "on")), _bodies(whole))
    if whole.closures:
        closed = ", ".join(closure.label for closure in whole.closures)
        passive = f"; passive: {', '.join(whole.passive)}" if whole.passive else ""
        how = "determined by" if whole.n > len(moving) + len(whole.passive) else "moved by"
        out.print(f"not free: {closed}; {how} {', '.join(moving)}{passive}", soft_wrap=True)
    if limits := _limits(whole):
        print_table("limits", ("coordinate", *QUANTITIES), limits)
    else:
        out.print("no limits are known")
    if whole.notes:
        notes = [(note.kind, note.where, note.what, in_options(note.advice)) for note in whole.notes]
        print_table("health of the description", ("", "where", "what", "advice"), notes)
    clarity = f"singular value gap {base.gap:.1e}" if math.isfinite(base.gap) else "no column depends on others"
    title = f"base parameters of {', '.join(moving)}: {base.rank} of {len(base.columns)} columns ({clarity})"
    for line in (title, *map(in_options, left_out_by_rounding(whole, base))):
        out.print(line, soft_wrap=True)
    rows = zip(base.names, base.expressions, base.units, strict=True)
    print_table(None, ("column", "combination", "unit"), rows)
    if servos := _servos(whole):
        loads = [(name, f"{load:.2g}", f"{own:.2g}", words) for name, (load, own, words) in servos.items()]
        title = "what tells torques where none are measured (model servo)"
        print_table(title, ("joint", "gravity up to [Nm, N]", "own inertia up to [kg m^2, kg]", "told by"), loads)


def _bodies(whole: Robot) -> list[tuple[str, ...]]:
    """Joints with the links that they move, and branches, which move with them."""
    carriers = (BASE, *(link.name for link in whole.links))
    rows: list[tuple[str, ...]] = [
        (str(number), joint.name, joint.kind, link.name, _mass(link), *_on(whole, carriers[parent]))
        for number, (joint, link, parent) in enumerate(zip(whole.joints, whole.links, whole.parents, strict=True), 1)
    ]
    for branch, number in zip(whole.branches, whole.body_numbers[whole.n :], strict=True):
        terms = (f"{c:g} {name}" for c, name in zip(branch.coupling, whole.joint_names, strict=True) if c != 0.0)
        verb = "turns" if branch.joint.kind == "revolute" else "slides"
        kind = f"{verb} with {' + '.join(terms)}"
        on = _on(whole, branch.parent)
        rows.append((str(number), f"on {branch.parent}", kind, branch.link.name, _mass(branch.link), *on))
    return rows


def _on(whole: Robot, carrier: str) -> tuple[str, ...]:
    """What carries a joint, where that is not the link of the row before."""
    return () if whole.is_chain else (carrier,)


def _mass(link: Link) -> str:
    return "unknown" if link.theta is None else f"{link.theta[0]:.4g}"


def _limits(whole: Robot) -> list[tuple[str, ...]]:
    """Limits of each joint and drive that has any."""
    drives = whole.transmission.drives if whole.transmission else ()
    names = [*(f"joint {name}" for name in whole.joint_names), *(f"drive {drive.name}" for drive in drives)]
    limits: dict[str, dict[str, str]] = {name: {} for name in names}
    for limit in linear_limits(whole):
        for label, lower, upper, unit in zip(limit.labels, limit.lower, limit.upper, limit.units, strict=True):
            shown = f"[{lower:.4g}, {upper:.4g}]" if limit.derivative == 0 else f"{upper:.4g}"
            limits[label.removesuffix(f" {limit.quantity}")][limit.quantity] = f"{shown} {unit}"
    return [(name, *(row.get(quantity, "-") for quantity in QUANTITIES)) for name, row in limits.items() if row]


def _servos(whole: Robot) -> dict[str, tuple[float, float, str]]:
    """Of each joint, what tells its servo's torques; none where masses are unknown or drives coupled."""
    try:
        ServoModel(whole)
    except InputError:
        return {}
    return dict(zip(whole.joint_names, scale_shown_by(whole), strict=True))
