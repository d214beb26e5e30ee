"""``excite compare``: candidate designs under the same metrics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from excite.cli.command import Command
from excite.cli.options import own_parts
from excite.registry import MODELS, WINDOWS

if TYPE_CHECKING:
    from excite.cli.summary import Summary
    from excite.design.comparison import Judgement
    from excite.optimality.design_bound import DesignBound

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
_UNLIKE = "the designs are for different robots, models or moving joints; their numbers are not comparable"
_LARGER_IS_BETTER = (
    "smallest_singular_value",
    "log_det",
    "smallest_singular_value_noise_weighted",
    "log_det_noise_weighted",
)

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
    from excite.optimality.design_bound import stored_bound

    read = []
    for folder in designs:
        tell(f"reading {folder}")
        read.append(excite.load_design(folder, parts))
    tell("comparing the designs")
    judgements = excite.compare(read, model, window)
    verdicts = _verdicts(judgements)
    show(
        _summary(judgements, verdicts, [text for each in read for text in _bounds(stored_bound(each))]),
        lambda: [{"verdict": text, **_plain(j)} for text, j in zip(verdicts, judgements, strict=True)],
        lambda: _print(judgements),
    )


def _plain(judgement: Judgement) -> dict[str, object]:
    criteria = {name: value if math.isfinite(value) else None for name, value in judgement.criteria.items()}
    goal = judgement.goal if judgement.goal is not None and math.isfinite(judgement.goal) else None
    return {**asdict(judgement), "goal": goal, "criteria": criteria}


def _is_alike(judgements: Sequence[Judgement]) -> bool:
    return len({(j.robot, j.model, j.moving, j.parameters) for j in judgements}) == 1


def _goals(judgements: Sequence[Judgement]) -> list[float]:
    """The criterion of the first design, or its condition number where that does not apply to all."""
    if any(j.goal is None for j in judgements):
        return [j.criteria["condition_number"] for j in judgements]
    return [math.inf if j.goal is None else j.goal for j in judgements]


def _verdicts(judgements: Sequence[Judgement]) -> list[str]:
    """One sentence on each design."""
    goals = _goals(judgements)
    sentences = []
    for judgement, goal in zip(judgements, goals, strict=True):
        held = _held(judgement, "keeps every checked limit", "exceeds a limit")
        best = "; the best of these" if _is_alike(judgements) and len(goals) > 1 and goal == min(goals) else ""
        condition = judgement.criteria["condition_number"]
        sentences.append(f"{judgement.name}: {held}, condition number {condition:.4g}{best}")
    return sentences


def _held(judgement: Judgement, kept: str, broken: str) -> str:
    from excite.design.stated_limits import kept_headline

    return kept_headline(judgement.unchecked, kept) if judgement.feasible else broken


def _bounds(bound: DesignBound | None) -> list[str]:
    """How near a design comes to the best possible, where that was bounded."""
    return [] if bound is None else [f"{bound.name}, by its bound.json: {each.sentence}" for each in bound.criteria]


def _summary(judgements: Sequence[Judgement], verdicts: Sequence[str], bounds: Sequence[str]) -> Summary:
    from excite.cli.summary import Summary, compact_table

    goals = _goals(judgements)
    ranked = sorted(range(len(judgements)), key=lambda k: goals[k]) if _is_alike(judgements) else range(len(judgements))
    rows = [_row(judgements[k], goals[k]) for k in ranked]
    first = judgements[0]
    return Summary(
        verdict=verdicts[ranked[0]] if _is_alike(judgements) else _UNLIKE,
        facts=[
            f"{first.robot}, {first.model} model, {first.parameters} base parameters; criterion of the first design: "
            f"{first.minimised}",
            *compact_table("design", "cond(W)", "criterion", "lasts", "tightest limit used", "limits", rows=rows),
            *bounds,
        ],
        notes=[*(note for note in _notes(judgements) if note != _UNLIKE), *_unchecked(judgements)],
        next_steps=["--verbose shows every convention of the condition number, and every metric"],
    )


def _row(j: Judgement, goal: float) -> tuple[str, ...]:
    used = "-" if j.tightest is None else f"{100 * j.tightest.use:.1f} %"
    held = _held(j, "hold", "BROKEN")
    return (j.name, f"{j.criteria['condition_number']:.4g}", f"{goal:.4g}", f"{j.duration:g} s", used, held)


def _unchecked(judgements: Sequence[Judgement]) -> list[str]:
    notes = (f"{j.name}: not checked when designed: {', '.join(j.unchecked)}" for j in judgements if j.unchecked)
    return list(dict.fromkeys([*notes, *(f"{j.name}: {said}" for j in judgements for said in j.believed)]))


def _notes(judgements: Sequence[Judgement]) -> list[str]:
    notes = [] if _is_alike(judgements) else [_UNLIKE]
    identified = [j.friction == "identified" for j in judgements]
    if len(set(identified)) > 1 and judgements[0].channel == "effort":
        how = "with" if identified[0] else "without"
        notes.append(
            "only some of the designs identify friction; all are compared like the first one, "
            f"{how} friction parameters"
        )
    return notes


def _print(judgements: Sequence[Judgement]) -> None:
    from rich.table import Table

    from excite.cli.literal_console import console

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
    comparable = _is_alike(judgements) and len(judgements) > 1
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
    table.add_row("limits that were checked", *("hold" if j.feasible else "BROKEN" for j in judgements))
    table.add_row("not checked when designed", *(", ".join(j.unchecked) or "-" for j in judgements))
    table.add_row("CPU of the design [s]", *(f"{j.cpu_seconds:.1f}" for j in judgements))
    console().print("designs under the same metrics" + ("; the best of each row is marked *" if comparable else ""))
    console().print(table)
    for note in _notes(judgements):
        console().print(f"note: {note}", soft_wrap=True)
