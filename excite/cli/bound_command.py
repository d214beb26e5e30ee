"""``excite bound``: how far a design is from the best possible."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from excite.cli.command import Command
from excite.cli.options import Number, own_parts

if TYPE_CHECKING:
    from rich.table import Table

    from excite.cli.summary import Summary
    from excite.optimality.design_bound import CriterionBound, DesignBound
    from excite.optimality.sensitivity import Sensitivity

_CRITERIA = ("condition", "logdet", "sigma-min")
_FEW = 5  # changes that the summary shows
_GROUPS = {"Bound": ("criteria", "seed", "force")}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="bound",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True},
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
    from excite.optimality.design_bound import NAME, stored_bound
    from excite.optimality.sensitivity import sensitivity
    from excite.storage.records import json_of

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
    summary = _summary(result, files, None if files else NAME)
    show(summary, lambda: json_of(result), lambda: _print(result))


def _summary(result: DesignBound, files: list[Path], read_from: str | None) -> Summary:
    from excite.cli.summary import Summary, compact_table

    rows = [
        (each.described, f"{each.value:.4g}", f"{each.reached:.4g}", f"{each.efficiency:.0%}", _basis(each))
        for each in result.criteria
    ]
    return Summary(
        verdict=verdict_of(result.criteria[0]),
        facts=[
            f"{result.name}: bounds over all motions of the family within the limits; smaller criteria are better",
            *compact_table("criterion", "bound", "design", "efficiency", "bound is", rows=rows),
            *_changes(result.sensitivity),
        ],
        notes=[*([f"read from {read_from}; --force computes it again"] if read_from else []), *result.assumptions],
        files=files,
    )


def _changes(result: Sensitivity | None) -> list[str | Table]:
    """The changes that would bring most, and what their gains are."""
    from excite.cli.summary import compact_table

    if result is None or not result.rows:
        return []
    table = compact_table("change of the problem", result.criterion, "gain", rows=_rows(result), most=_FEW)
    return [*table, f"{result.meaning}; without a change it is {result.reference:.4g}"]


def _rows(result: Sensitivity) -> list[tuple[str, str, str]]:
    return [(row.change, f"{row.value:.4g}", f"{row.gain:.1%}") for row in result.rows]


def _basis(bound: CriterionBound) -> str:
    return f"proven (estimated: {bound.estimate:.4g})" if bound.proven else bound.basis


def verdict_of(bound: CriterionBound) -> str:
    """One sentence on how far a design is from the best possible."""
    times = bound.reached / bound.value
    how = "is proven" if bound.proven else f"is {bound.basis}"
    return (
        f"The design's {bound.described}, {bound.reached:.4g}, is at most {times:.3g} times the best possible: "
        f"no motion within the limits has less than {bound.value:.4g}, which {how}."
    )


def _print(result: DesignBound) -> None:
    from rich.table import Table

    from excite.cli.literal_console import console

    table = Table()
    for heading in ("criterion", "bound", "design", "efficiency", "basis", "estimate", "CPU [s]"):
        table.add_column(heading, justify="left" if heading in ("criterion", "basis") else "right", overflow="fold")
    for each in result.criteria:
        row = (each.described, f"{each.value:.4g}", f"{each.reached:.4g}", f"{each.efficiency:.1%}", each.basis)
        table.add_row(*row, f"{each.estimate:.4g}", f"{each.cpu_seconds:.1f}")
    console().print(table)
    if result.sensitivity is not None:
        _print_changes(result.sensitivity)
    for note in result.assumptions:
        console().print(f"note: {note}", soft_wrap=True)


def _print_changes(result: Sensitivity) -> None:
    from rich.table import Table

    from excite.cli.literal_console import console

    table = Table()
    for number, heading in enumerate(("change of the problem", result.criterion, "gain")):
        table.add_column(heading, justify="right" if number else "left", overflow="fold")
    table.add_row("none", f"{result.reference:.4g}", "")
    for row in _rows(result):
        table.add_row(*row)
    console().print(table)
    console().print(f"note: {result.meaning} ({result.cpu_seconds:.1f} s CPU)", soft_wrap=True)
