"""``excite compare``: candidate designs under the same metrics."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from excite.cli.options import own_parts
from excite.registry import MODELS, WINDOWS

if TYPE_CHECKING:
    from excite.design.comparison import Judgement

_ROWS = {
    "condition_number": "cond, left-to-right base",
    "condition_number_pivoted": "cond, pivoted base",
    "condition_number_orthonormal": "cond, orthonormal base",
    "condition_number_column_normalised": "cond, columns normalised",
    "condition_number_length_scaled": "cond, lengths in 0.1 m",
    "condition_number_noise_weighted": "cond, noise-weighted",
    "condition_number_frobenius": "cond, Frobenius norm",
    "smallest_singular_value": "smallest singular value",
    "log_det": "log det W'W",
    "trace_inverse": "trace (W'W)^-1",
    "smallest_singular_value_noise_weighted": "smallest singular value, noise-weighted",
    "log_det_noise_weighted": "log det, noise-weighted",
    "trace_inverse_noise_weighted": "trace, noise-weighted",
}
_LARGER_IS_BETTER = (
    "smallest_singular_value",
    "log_det",
    "smallest_singular_value_noise_weighted",
    "log_det_noise_weighted",
)


@click.command(
    name="compare",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True},
    epilog="""\b
Example:
  excite compare designs/irp6 designs/irp6-long --json
  excite compare designs/mine designs/irp6 --part mine:Mine""",
)
@click.argument("designs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="DIR...")
@click.option("--model", type=click.Choice(MODELS), help="Compare under this model.  [default: that of each design]")
@click.option("--window", type=click.Choice(WINDOWS), help="Time windows of energy and load-integral.")
@own_parts
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    designs: tuple[Path, ...], model: str | None, window: str | None, parts: tuple[str, ...], as_json: bool
) -> None:
    """Compare designs by the same metrics: every condition number, smallest singular value, log det, margins.

    Every design is judged under the parameters (friction, rotors) and the noise of the first one, sampled at 100 Hz,
    and by the criterion that the first one minimised.
    """
    import excite
    from excite.cli.sign_of_life import tell

    read = []
    for folder in designs:
        tell(f"reading {folder}")
        read.append(excite.load_design(folder, parts))
    tell("comparing the designs")
    judgements = excite.compare(read, model, window)
    if as_json:
        click.echo(json.dumps([_plain(judgement) for judgement in judgements], indent=1))
    else:
        _show(judgements)


def _plain(judgement: Judgement) -> dict[str, object]:
    import math

    criteria = {name: value if math.isfinite(value) else None for name, value in judgement.criteria.items()}
    goal = judgement.goal if judgement.goal is not None and math.isfinite(judgement.goal) else None
    return {**asdict(judgement), "goal": goal, "criteria": criteria}


def _show(judgements: list[Judgement]) -> None:
    from rich.table import Table

    from excite.cli.design_text import console

    table = Table()
    table.add_column("")
    for judgement in judgements:
        table.add_column(judgement.name, justify="right", overflow="fold")
    table.add_row("robot", *(j.robot for j in judgements))
    table.add_row("model", *(j.model for j in judgements))
    table.add_row("moving", *(f"{len(j.moving)}: {', '.join(j.moving)}" for j in judgements))
    table.add_row("duration [s]", *(f"{j.duration:g}" for j in judgements))
    table.add_row("base parameters", *(str(j.parameters) for j in judgements))
    table.add_row("friction, when designed", *(j.friction for j in judgements))
    alike = len({(j.robot, j.model, j.moving, j.parameters) for j in judgements}) == 1
    comparable = alike and len(judgements) > 1
    for name, label in _ROWS.items():
        values = [j.criteria[name] for j in judgements]
        best = max(values) if name in _LARGER_IS_BETTER else min(values)
        table.add_row(label, *(f"{v:.4g}{' *' if comparable and v == best else ''}" for v in values))
    table.add_row("designed for", *(j.minimised for j in judgements))
    goals = [float("nan") if j.goal is None else j.goal for j in judgements]
    table.add_row(
        "criterion of the first design",
        *(
            "-" if j.goal is None else f"{j.goal:.4g}{' *' if comparable and j.goal == min(goals) else ''}"
            for j in judgements
        ),
    )
    table.add_row("tightest limit", *("-" if j.tightest is None else f"{j.tightest.label}" for j in judgements))
    table.add_row(
        "use of that limit", *("-" if j.tightest is None else f"{100 * j.tightest.use:.2f} %" for j in judgements)
    )
    table.add_row("limits of joints and drives", *("hold" if j.feasible else "BROKEN" for j in judgements))
    table.add_row("not checked when designed", *(", ".join(j.unchecked) or "-" for j in judgements))
    table.add_row("CPU of the design [s]", *(f"{j.cpu_seconds:.1f}" for j in judgements))
    console().print("designs under the same metrics" + ("; the best of each row is marked *" if comparable else ""))
    console().print(table)
    if not alike:
        click.echo(
            "note: the designs are for different robots, models or moving joints; their numbers are not comparable"
        )
    asked = [judgement.friction == "identified" for judgement in judgements]
    if len(set(asked)) > 1 and judgements[0].channel == "effort":
        how = "with" if asked[0] else "without"
        click.echo(
            "note: only some of the designs identify friction; all are compared like the first one, "
            f"{how} friction parameters"
        )
