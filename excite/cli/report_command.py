"""``excite report``: one HTML page on designs, campaigns, identifications, verifications, friction and studies."""

from __future__ import annotations

from pathlib import Path

import click

import excite
from excite.cli.command import Command
from excite.cli.option_types import Folder
from excite.cli.options import own_parts
from excite.cli.sign_of_life import tell
from excite.cli.summary import Summary, show

_GROUPS = {"Robot": ("robot_file",)}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="report",
    epilog="""\b
Examples:
  excite report designs/irp6 --out irp6.html
  excite report designs/arm --robot-file arm.urdf --out arm.html             with the meshes of its links
  excite report designs/short designs/long --out which.html                  compared by the same metrics
  excite report designs/irp6 results/irp6 --out experiment.html              with the verifications in results/irp6
  excite plan irp6 --json > plan.json; excite report plan.json --out plan.html
  excite report plans/friction friction/irp6 --out friction.html             runs to measure friction, fitted curves

\b
The page has, for each result: the verdict in words; what was asked; what was assumed and not checked; parameters with
their intervals, conditions under each convention and margins of the limits, in tables that sort when a heading is
pressed; figures; provenance, and the commands that repeat it. Planned and measured motions play in 3D: space plays and
pauses, comma and full stop step, arrow keys turn the view, plus and minus zoom. The robot is drawn by the meshes of
--robot-file, else by the capsules of its world file or URDF, else by lines through the frames of its joints.
Several designs, or several identifications, are compared.

\b
The page is one file that needs no network: mail it, or open it from a disk in any browser of today.
Exit status 0: written; 2: bad input, and an older page stays.""",
)
@click.argument("paths", nargs=-1, required=True, type=Folder(), metavar="DIR...")
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE.html", help="Page to write.")
@click.option(
    "--robot-file",
    type=click.Path(path_type=Path),
    metavar="FILE.urdf",
    help="URDF of the robot, whose meshes (STL, OBJ, DAE) the player shows.",
)
@own_parts
@click.option("--force", is_flag=True, help="Replace a page that is already there.")
def command(
    paths: tuple[Path, ...],
    out: Path,
    robot_file: Path | None,
    parts: tuple[str, ...],
    force: bool,
) -> None:
    """Write one HTML page on what is in each DIR: designs, results, friction, studies; or in JSON files."""
    tell("writing the page")
    page = excite.write_report(paths, out, replace=force, robot_file=robot_file, part=parts)
    size = page.stat().st_size
    summary = Summary(f"Page written: {page} ({size / 1e6:.2f} MB); open it in a browser")
    show(summary, lambda: {"out": str(page), "bytes": size}, lambda: None)
