"""Summary of a finished design on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from excite.cli.literal_console import console
from excite.cli.messages import in_options
from excite.cli.precision_text import half_width_table, precision_lines
from excite.cli.summary import Summary, compact_table, some_of
from excite.design.between_samples import between_samples_text
from excite.design.stated_limits import collisions_unchecked, kept_headline, kept_text
from excite.information.metrics import noise_text
from excite.information.weighting import minimised_text
from excite.registry import name_of

if TYPE_CHECKING:
    from excite.design.design import Design
    from excite.information.metrics import PredictedAccuracy

_CONDITIONS = {
    "condition_number": "left-to-right base (Gautier), unscaled",
    "condition_number_pivoted": "pivoted base, unscaled",
    "condition_number_orthonormal": "orthonormal base",
    "condition_number_column_normalised": "columns normalised",
    "condition_number_length_scaled": "lengths in 0.1 m",
    "condition_number_noise_weighted": "rows weighted by noise",
    "condition_number_frobenius": "Frobenius norm instead of 2-norm",
}
_CONDITION = "condition, base gautier"
_NEXT = (
    "play trajectory.csv several times at full speed (rehearse it slowly first), record joint positions and torques; "
    "compare candidates with excite compare DIR..."
)
_NEXT_RUNS = "play trajectory.csv {runs} (rehearse it slowly first), and identify from that log"
_MOST_STARTS = 30
_NEAR = 0.5  # limits used beyond this fraction are listed; design.json has all of them


def design_summary(design: Design, files: Sequence[Path]) -> Summary:
    """Summary of a design: whether its limits hold, its criterion, the limits that are used most."""
    return Summary(
        verdict=_verdict(design),
        holds=design.feasible and (design.precision is None or design.precision.met),
        caution=bool(collisions_unchecked(each.limit for each in design.unchecked)),
        facts=[
            *precision_lines(design),
            _asked(design),
            *_unchecked(design),
            *_nearest_limits(design),
            *_transfer_lines(design),
            *_between_samples(design),
        ],
        notes=design.notes,
        files=files,
        next_steps=[_next(design)],
        all_in="design.json",
    )


def _verdict(design: Design) -> str:
    """Whether the limits hold, and the condition number beside those that the search began with."""
    uses = [use for some in (design.limits, *design.transfer_limits.values()) for use in some]
    if design.broken:
        held = f"Design exceeds {len(design.broken)} of {len(uses)} checked limits: {some_of(design.broken)}"
    else:
        plain = f"Design within all {len(uses)} checked limits" if uses else "Design for which no limit was checked"
        held = kept_headline((each.limit for each in design.unchecked), plain)
        held = held[:1].upper() + held[1:]
    return f"{held}; condition number {design.condition_number:.4g}{_guesses(design)}"


def _guesses(design: Design) -> str:
    """Condition numbers of the initial guesses, where it is the condition number that was minimised."""
    values = [start.history[0] for start in design.starts if start.history]
    if not values or minimised_text(design.task) != _CONDITION:
        return ""
    return f" (initial guesses: {min(values):.4g}" + (f" to {max(values):.4g})" if len(values) > 1 else ")")


def _asked(design: Design) -> str:
    task = design.task
    moving = ", ".join(design.target.motion.labels)
    return (
        f"{design.robot.name}: {name_of(task.model.model)} model, {moving} move, {design.base.rank} base parameters; "
        f"{task.trajectory.period:g} s, {design.trajectory.family.described}; minimised: {_minimised(design)}; "
        f"{design.number_of_starts} start{'s' * (design.number_of_starts > 1)}, "
        f"{design.provenance['cpu_seconds']:.1f} s CPU{_worth(design)}"
    )


def _minimised(design: Design) -> str:
    """What was minimised, with its value where that is not the condition number of the verdict."""
    text = minimised_text(design.task)
    return text if text == _CONDITION else f"{text} ({design.minimised_value:.4g})"


def _worth(design: Design) -> str:
    """What more rounds of the search would bring."""
    if design.search is None or design.search.left is None:
        return ""
    more = design.number_of_starts // design.search.populations
    return f"; another {more} would bring about {100 * design.search.left:.1f} %"


def _unchecked(design: Design) -> list[str]:
    return [f"not checked: {', '.join(map(str, design.unchecked))}"] if design.unchecked else []


def _nearest_limits(design: Design) -> list[str | Table]:
    """The limits that are used most, those that do not hold first."""
    uses = sorted(design.limits, key=lambda use: (use.holds, -use.use))
    rows = [
        (use.label, f"{use.extreme:.4g}", f"{use.bound:.4g}", use.unit, f"{100 * use.use:.1f} %") for use in uses[:4]
    ]
    return compact_table("limits used most", "extreme", "bound", "unit", "used", rows=rows)


def print_design(design: Design, files: Sequence[Path]) -> None:
    """Print all of a design: criteria, use of the limits, predicted accuracy, starts, next step."""
    out = console()
    task = design.task
    best = next(start for start in design.starts if start.index == design.best_start)
    out.print(
        Text("\n").append(design.robot.name, style="bold"),
        f": {name_of(task.model.model)} model; {', '.join(design.target.motion.labels)} move; "
        f"{design.base.rank} base parameters; {task.trajectory.period:g} s, {design.trajectory.family.described}, "
        "at rest at both ends",
        sep="",
        soft_wrap=True,
    )
    first = len(design.nearly_unidentifiable) > 0  # says what the condition number is made of
    for note in design.notes[:first]:
        out.print(f"note: {in_options(note)}", soft_wrap=True)
    out.print(
        Text(f"condition number {design.condition_number:.4g}", style="bold"),
        f" of W, {design.rows} rows; minimised: {_minimised(design)}; "
        f"best of {design.number_of_starts} starts (start-{best.index:04d}), "
        f"{design.provenance['cpu_seconds']:.1f} s CPU, {design.provenance['evaluation']}",
        sep="",
        soft_wrap=True,
    )
    out.print(_conditions(design))
    out.print(_limits(design))
    for line in (*_transfer_lines(design), *map(in_options, _between_samples(design))):
        out.print(line, soft_wrap=True)
    for fact in precision_lines(design):
        out.print(fact, soft_wrap=isinstance(fact, str))
    out.print(_predictions(design))
    if design.precision is not None:
        out.print(half_width_table(design.precision))
    for note in design.notes[first:]:
        out.print(f"note: {in_options(note)}", soft_wrap=True)
    out.print(Text(_kept(design), style="" if design.feasible else "bold red"), soft_wrap=True)
    out.print(_starts(design))
    if design.harmonics_trials:
        out.print(_rungs(design))
    out.print(f"written to {files[-1].parent}: {', '.join(path.name for path in files)}", soft_wrap=True)
    out.print(f"next: {_next(design)}", soft_wrap=True)


def _next(design: Design) -> str:
    if design.precision is None:
        return _NEXT
    runs = design.precision.runs
    return _NEXT_RUNS.format(runs="once" if runs == 1 else f"{runs} times in one recording")


def _starts(design: Design) -> Table:
    """How each start ended, the best first."""
    table = Table(title="starts", title_justify="left")
    for heading in ("start", "began at", "ended at", "iterates", "CPU [s]", "how it ended"):
        table.add_column(heading, justify="left" if heading == "how it ended" else "right", overflow="fold")
    for start in sorted(design.starts, key=lambda start: start.value)[:_MOST_STARTS]:
        began = f"{start.history[0]:.4g}" if start.history else "-"
        row = (str(start.index), began, f"{start.value:.4g}", str(len(start.history)), f"{start.cpu:.1f}")
        table.add_row(*row, start.status)
    return table


def _rungs(design: Design) -> Table:
    """What each number of harmonics brought, where the search chose it."""
    table = Table(title="harmonics", title_justify="left")
    for heading in ("harmonics", "criterion", "CPU s"):
        table.add_column(heading, justify="right")
    for trial in design.harmonics_trials:
        table.add_row(str(trial.harmonics), f"{trial.value:.5g}", f"{trial.cpu_seconds:.1f}")
    return table


def _conditions(design: Design) -> Table:
    table = Table(title="condition number by convention", title_justify="left")
    table.add_column("convention")
    table.add_column("value", justify="right")
    for name, meaning in _CONDITIONS.items():
        table.add_row(meaning, f"{design.criteria[name]:.4g}")
    table.add_row("smallest singular value of W", f"{design.criteria['smallest_singular_value']:.4g}")
    table.add_row("log det W'W", f"{design.criteria['log_det']:.5g}")
    return table


def _limits(design: Design) -> Table:
    near = [use for use in design.limits if use.use > _NEAR or not use.holds] or list(design.limits)
    table = Table(title="limits over continuous time", title_justify="left", caption_justify="left")
    if len(near) < len(design.limits):
        table.caption = f"{len(design.limits) - len(near)} more limits are used to less than {100 * _NEAR:g} %"
    for heading, justify in (("limit", "left"), ("extreme", "right"), ("bound", "right"), ("margin", "right")):
        table.add_column(heading, justify="right" if justify == "right" else "left")
    table.add_column("unit")
    table.add_column("used", justify="right")
    table.add_column("holds")
    for use in near:
        table.add_row(
            use.label,
            f"{use.extreme:.4f}",
            f"{use.bound:.4f}",
            f"{use.margin:.4f}",
            use.unit,
            f"{100 * use.use:.1f} %",
            "yes" if use.holds else Text("NO", style="bold red"),
        )
    return table


def _kept(design: Design) -> str:
    """Whether the limits are kept, and what is not known of them."""
    broken = [use.label for part in (design.limits, *design.transfer_limits.values()) for use in part if not use.holds]
    if broken:
        return f"the motion exceeds {len(broken)} limit{'s' * (len(broken) > 1)}: {', '.join(broken)}"
    return kept_text(design.unchecked, (use.quantity for use in design.limits))


def _transfer_lines(design: Design) -> list[str]:
    """Lines of text on approach and return."""
    if design.approach_and_return is None:
        return []
    names = {"approach": "approach from home", "return": "return to home"}
    lines = []
    for segment, transfer in design.approach_and_return.transfers.items():
        uses = design.approach_and_return.limits[segment]
        broken = [use.label for use in uses if not use.holds]
        nearest = max(uses, key=lambda use: use.use)
        verdict = (
            f"BREAKS {', '.join(broken)}"
            if broken
            else f"no limit is exceeded, {nearest.label} used to {100 * nearest.use:.1f} %"
        )
        lines.append(
            f"{names[segment]}: {transfer.duration:g} s ({transfer.shortest:.4g} s at the quickest), {verdict}"
        )
    return [*lines, f"trajectory.csv lasts {design.sequence.duration:g} s"]


def _between_samples(design: Design) -> list[str]:
    """What becomes of the limits between the samples of the file; nothing where no limit is known."""
    certified = design.between_samples
    return [between_samples_text(design, certified)] if any(each.uses for each in certified) else []


def _predictions(design: Design) -> Table:
    title = f"accuracy of one run for {noise_text(design.task.objective.noise, design.target.model)}"
    table = Table(title=title, title_justify="left")
    table.add_column("parameter")
    table.add_column("combination", overflow="fold", max_width=70)
    table.add_column("standard deviation", justify="right")
    for heading in ("known beforehand", "both") if design.prior else ():
        table.add_column(heading, justify="right")
    table.add_column("unit")
    behind = any(p.motor_side for p in design.predicted)
    if behind:
        table.add_column("at the motor", justify="right")
    known = {k.name: ("-" if k.deviation is None else f"{k.deviation:.3g}", f"{k.after:.3g}") for k in design.prior}
    for p in design.predicted:
        row = (p.name, p.expression, f"{p.standard_deviation:.3g}", *known.get(p.name, ()), p.unit)
        table.add_row(*row, *((_at_the_motor(p),) if behind else ()))
    return table


def _at_the_motor(prediction: PredictedAccuracy) -> str:
    """Deviation of the rotor inertia itself, where the parameter is one at the drive coordinate."""
    side = prediction.motor_side
    return "" if side is None else f"{side.name}: {prediction.standard_deviation / side.factor:.3g} {side.unit}"
