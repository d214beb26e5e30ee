"""``excite bound``: how far a design is from the best possible."""

from __future__ import annotations

from pathlib import Path

import click

from excite.cli.command import Command
from excite.cli.option_types import Number
from excite.cli.options import own_parts

_CRITERIA = ("condition", "logdet", "sigma-min")
_GROUPS = {"Bound": ("criteria", "seed", "force")}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="bound",
    epilog="""\b
Example:
  excite bound designs/irp6
  excite bound designs/irp6 --criterion condition --json""",
)
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@click.option(
    "--criterion",
    "criteria",
    multiple=True,
    type=click.Choice(_CRITERIA),
    help="Criterion to bound; repeatable.  [default: condition]",
)
@click.option("--seed", type=Number(), default=0, metavar="N", help="Seed of the search for states.")
@click.option("--force", is_flag=True, help="Compute the bound again, although DIR has one of the same problem.")
@own_parts
def command(folder: Path, criteria: tuple[str, ...], seed: float, force: bool, parts: tuple[str, ...]) -> None:
    """Bound what any motion within the limits of the design in DIR could reach, and write DIR/bound.json.

    A bound from below on the condition number, or on the criteria of D- and E-optimality (logdet, sigma-min), over all
    motions of the family within the limits of the design's problem. 'excite compare' shows it from then on.

    With it, what twice the harmonics, 1.5 times the period, or each limit of joints and drives that is used, looser by
    20 %, would bring: the gains found by improving this motion after one change at a time.
    """
    from excite.cli.study_run import bound_and_write

    bound_and_write(folder, criteria or _CRITERIA[:1], int(seed), parts, force=force)
