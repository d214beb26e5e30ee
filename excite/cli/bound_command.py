"""``excite bound``: how far a design is from the best possible."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from excite.cli.command import Command
from excite.cli.option_types import Number
from excite.cli.options import own_parts

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.views.view import View

_CRITERIA = ("condition", "logdet", "sigma-min")
_FEW = 5  # changes that the summary shows
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
    import excite
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.cli.view_text import print_view
    from excite.optimality.design_bound import NAME, stored_bound
    from excite.optimality.sensitivity import sensitivity
    from excite.storage.records import json_of
    from excite.views.prediction_view import bound_view

    design = excite.load_design(folder, parts)
    wanted, place = criteria or _CRITERIA[:1], folder if folder.suffix != ".json" else folder.parent
    known = None if force else stored_bound(design)
    enough = known is not None and {each.name for each in known.criteria} >= set(wanted)
    if known is not None and enough and known.sensitivity is not None:
        result, files = known, []
    elif known is not None and enough:
        result = replace(known, sensitivity=sensitivity(design, tell))
        files = result.save(place)
    else:
        result = excite.bound(design, wanted, seed=int(seed), progress=tell)
        others = () if known is None else (each for each in known.criteria if each.name not in wanted)
        result = replace(result, criteria=(*result.criteria, *others))
        files = result.save(place)
    view = bound_view(result)
    show(_summary(view, files, None if files else NAME), lambda: json_of(result), lambda: print_view(view))


def _summary(view: View, files: list[Path], read_from: str | None) -> Summary:
    from excite.cli.summary import Summary
    from excite.cli.view_text import brief_table

    criteria, *changes = view.tables
    return Summary(
        verdict=view.verdict,
        facts=[
            view.summary[0],
            *brief_table(criteria),
            *(each for table in changes for each in brief_table(table, most=_FEW)),
            *view.summary[1:],
        ],
        notes=[*([f"read from {read_from}; --force computes it again"] if read_from else []), *view.remarks],
        files=files,
    )
