"""``excite payload gains``: gains of the drives from a load of known mass."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Number, RobotName
from excite.cli.payload_options import log_options, logs_of, robot_of, robot_options

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.payload.calibrate_gains import CalibratedGains

_GROUPS = {
    "Logs": ("without", "loaded", "mass", "mapping", "drop", "rows", "without_rows"),
    "Signals": ("cutoff", "low_pass"),
    "Gains": ("common",),
}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="gains",
    epilog="""\b
Examples:
  excite payload gains ur10e --without bare.csv --with weight.csv --mass 2.805 --out gains.yaml
  excite payload gains ur10e --without bare.csv --with weight.csv --mass 2.805 --mapping ur10e.yaml --out gains.yaml

\b
Torques from motor currents are as good as the gains (torque per current) that they are multiplied by. A load that was
weighed shows by which factor the stated gains are off: of all drives together (--common), or of each (--each), which
stays within some 10 % of the common one where the load hardly acts on the drive. The file has each factor, its standard
deviation and correlations; 'excite payload identify --gains' counts them in its intervals.""",
)
@click.argument("robot", type=RobotName())
@click.option(
    "--without", required=True, multiple=True, type=click.Path(path_type=Path), metavar="LOG",
    help="Log without the load; repeatable.",
)  # fmt: skip
@click.option(
    "--with", "loaded", required=True, multiple=True, type=click.Path(path_type=Path), metavar="LOG",
    help="Log with the load, fixed to the last link; repeatable.",
)  # fmt: skip
@click.option("--mass", required=True, type=Number("known_mass"), metavar="KG", help="Mass of that load [kg].")
@click.option(
    "--out", required=True, type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="YAML file to write."
)
@click.option("--common/--each", default=False, help="One factor for all drives, or one for each.")
@robot_options
@log_options
@click.option("--force", is_flag=True, help="Replace FILE.")
def command(
    robot: str, without: tuple[Path, ...], loaded: tuple[Path, ...], mass: float, out: Path, **given: Any
) -> None:
    """Calibrate the gains of ROBOT's drives with a load of known mass, and write their factors to FILE."""
    import excite
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.payload.known_gains import save_gains

    tell("reading the logs and calibrating")
    with save_gains(out, replace=given["force"]) as write:
        calibrated = excite.calibrate_gains(
            robot,
            list(loaded),
            list(without),
            mass,
            kind="common" if given["common"] else "each",
            logs=logs_of(given),
            **robot_of(given),
        )
        write(calibrated.gains, robot=calibrated.robot, mass=mass)
    show(_summary(calibrated, out), lambda: {"out": str(out), **calibrated.content()}, lambda: _print(calibrated, out))


def _rows(calibrated: CalibratedGains) -> list[tuple[str, ...]]:
    gains = calibrated.gains
    return [
        (name, f"{factor:.4f}", f"+- {calibrated.quantile * deviation:.2g}")
        for name, factor, deviation in zip(gains.drives, gains.factor, gains.deviation, strict=True)
    ]


def _summary(calibrated: CalibratedGains, out: Path) -> Summary:
    from excite.cli.summary import Summary, compact_table

    factors = calibrated.gains.factor
    return Summary(
        verdict=f"Gains of {calibrated.robot} are {factors.min():.3f} to {factors.max():.3f} times those stated",
        facts=[
            f"with stated gains, the load of {calibrated.known_mass:g} kg appears as {calibrated.stated_mass:.4g} kg",
            *compact_table("drive", "factor", "99 %", rows=_rows(calibrated)),
        ],
        notes=calibrated.notes,
        files=[out],
        next_steps=[f"excite payload identify ROBOT --with LOG --without LOG --gains {out} --out DIR"],
    )


def _print(calibrated: CalibratedGains, out: Path) -> None:
    from rich.table import Table

    from excite.cli.literal_console import console
    from excite.cli.messages import in_options

    shown, table = console(), Table()
    for heading in ("drive", "factor", "99 %"):
        table.add_column(heading, justify="left" if heading == "drive" else "right")
    for row in _rows(calibrated):
        table.add_row(*row)
    shown.print(table)
    for note in calibrated.notes:
        shown.print(f"note: {in_options(note)}", soft_wrap=True)
    shown.print(f"written: {out}", soft_wrap=True)
