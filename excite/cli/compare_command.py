"""``excite compare``: candidate designs under the same metrics."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from excite.cli.command import Command
from excite.cli.options import own_parts
from excite.registry import MODELS, WINDOWS

if TYPE_CHECKING:
    from excite.design.comparison import Judgement

_GROUPS = {"Model": ("model", "window")}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="compare",
    epilog="""\b
Example:
  excite compare designs/irp6 designs/irp6-long --json
  excite compare designs/mine designs/irp6 --part mine:Mine""",
)
@click.argument("designs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="DIR...")
@click.option("--model", type=click.Choice(MODELS), help="Compare under this model.  [default: that of each design]")
@click.option("--window", type=click.Choice(WINDOWS), help="Time windows of energy and load-integral.")
@own_parts
def command(designs: tuple[Path, ...], model: str | None, window: str | None, parts: tuple[str, ...]) -> None:
    """Compare designs by the same metrics: every condition number, smallest singular value, log det, margins.

    Every design is judged under the parameters (friction, rotors) and the noise of the first one, sampled at 100 Hz,
    and by the criterion that the first one minimised.
    """
    import excite
    from excite.cli.sign_of_life import tell
    from excite.cli.summary import show
    from excite.cli.view_text import print_view, view_summary
    from excite.optimality.design_bound import stored_bound
    from excite.views.comparison_view import comparison_view, verdicts

    read = []
    for folder in designs:
        tell(f"reading {folder}")
        read.append(excite.load_design(folder, parts))
    tell("comparing the designs")
    judgements = excite.compare(read, model, window)
    known = [bound for each in read if (bound := stored_bound(each)) is not None]
    view = comparison_view(judgements, known)
    show(
        view_summary(view, next_steps=["--verbose shows every convention of the condition number, and every metric"]),
        lambda: [{"verdict": text, **_plain(j)} for text, j in zip(verdicts(judgements), judgements, strict=True)],
        lambda: print_view(view),
    )


def _plain(judgement: Judgement) -> dict[str, object]:
    criteria = {name: value if math.isfinite(value) else None for name, value in judgement.criteria.items()}
    goal = judgement.goal if judgement.goal is not None and math.isfinite(judgement.goal) else None
    return {**asdict(judgement), "goal": goal, "criteria": criteria}
