"""What is shown of several results together, and of how far a design is from the best possible."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from excite.design.comparison import Judgement
from excite.design.stated_limits import kept_headline
from excite.information.matrix import CONVENTIONS
from excite.optimality.design_bound import CriterionBound, DesignBound
from excite.optimality.sensitivity import Sensitivity
from excite.views.view import Column, Format, View, ViewTable, headed

_UNLIKE = "the designs are for different robots, models or moving joints; their numbers are not comparable"
_LARGER_IS_BETTER = ("smallest_singular_value", "log_det")


def comparison_view(judgements: Sequence[Judgement], bounds: Sequence[DesignBound] = ()) -> View:
    """View of several designs; ``bound.json`` of some says how near they come to the best possible."""
    alike, first = is_alike(judgements), judgements[0]
    goals = _goals(judgements)
    ranked = sorted(range(len(judgements)), key=lambda k: goals[k] if alike else k)
    reached = dict.fromkeys(f"{b.name}, by its bound.json: {each.sentence}" for b in bounds for each in b.criteria)
    return View(
        kind="comparison",
        title=f"{len(judgements)} designs",
        verdict=verdicts(judgements)[ranked[0]] if alike else _UNLIKE,
        summary=(
            f"{first.robot}, {first.model} model, {first.parameters} base parameters; criterion of the first design: "
            f"{first.minimised}",
            *reached,
        ),
        remarks=(
            "every design is judged under the parameters (friction, rotors) and the noise of the first one, at 100 Hz",
            *_friction(judgements),
            *dict.fromkeys(
                f"{j.name}: not checked when designed: {', '.join(j.unchecked)}" for j in judgements if j.unchecked
            ),
            *dict.fromkeys(f"{j.name}: {said}" for j in judgements for said in j.believed),
        ),
        tables=(
            _ranking([(judgements[k], goals[k]) for k in ranked]),
            _facts(judgements),
            _measures(judgements, marked=alike and len(judgements) > 1),
        ),
    )


def is_alike(judgements: Sequence[Judgement]) -> bool:
    """Whether the numbers of some designs can be compared."""
    return len({(j.robot, j.model, j.moving, j.parameters) for j in judgements}) == 1


def verdicts(judgements: Sequence[Judgement]) -> list[str]:
    """One sentence on each design."""
    goals = _goals(judgements)
    sentences = []
    for judgement, goal in zip(judgements, goals, strict=True):
        held = _held(judgement, "keeps every checked limit", "exceeds a limit")
        best = "; the best of these" if is_alike(judgements) and len(goals) > 1 and goal == min(goals) else ""
        condition = judgement.criteria["condition_number"]
        sentences.append(f"{judgement.name}: {held}, condition number {condition:.4g}{best}")
    return sentences


def _goals(judgements: Sequence[Judgement]) -> list[float]:
    """The criterion of the first design, or its condition number where that does not apply to all."""
    goals = [j.goal for j in judgements if j.goal is not None]
    return goals if len(goals) == len(judgements) else [j.criteria["condition_number"] for j in judgements]


def _held(judgement: Judgement, kept: str, broken: str) -> str:
    return kept_headline(judgement.unchecked, kept) if judgement.feasible else broken


def _friction(judgements: Sequence[Judgement]) -> list[str]:
    identified = [j.friction == "identified" for j in judgements]
    if len(set(identified)) == 1 or judgements[0].channel != "effort":
        return []
    like = "the first one, with" if identified[0] else "the first one, without"
    return [f"only some of the designs identify friction; all are compared like {like} friction parameters"]


def _ranking(judged: Sequence[tuple[Judgement, float]]) -> ViewTable:
    columns = headed("*design:text, *cond(W):4, *criterion:4, *lasts [s], *tightest limit used:%, *limits:text")
    rows = []
    for j, goal in judged:
        used = None if j.tightest is None else j.tightest.use
        rows.append((j.name, j.criteria["condition_number"], goal, j.duration, used, _held(j, "hold", "BROKEN")))
    broken = {(k, 5): "bad" for k, (j, _) in enumerate(judged) if not j.feasible}
    title = "Designs by the criterion of the first one"
    return ViewTable("ranking", title, columns, tuple(rows), marked=broken, most=len(rows))


def _facts(judgements: Sequence[Judgement]) -> ViewTable:
    """What each design is for, a column each."""
    columns = tuple(Column(text, Format.TEXT) for text in ("", *(j.name for j in judgements)))
    of: dict[str, Any] = {
        "robot": lambda j: j.robot,
        "model": lambda j: j.model,
        "moving": lambda j: f"{len(j.moving)}: {', '.join(j.moving)}",
        "base parameters": lambda j: str(j.parameters),
        "friction, when designed": lambda j: j.friction,
        "designed for": lambda j: j.minimised,
        "tightest limit": lambda j: "-" if j.tightest is None else j.tightest.label,
        "limits that were checked": lambda j: "hold" if j.feasible else "BROKEN",
        "not checked when designed": lambda j: ", ".join(j.unchecked) or "-",
        "CPU of the design [s]": lambda j: f"{j.cpu_seconds:.1f}",
    }
    rows = tuple((name, *map(value, judgements)) for name, value in of.items())
    return ViewTable("designs", "What each design is for", columns, rows)


def _measures(judgements: Sequence[Judgement], *, marked: bool) -> ViewTable:
    columns = (
        *headed("measure:text"),
        *(Column(j.name) for j in judgements),
        Column("convention", Format.TEXT, wide=True),
    )
    rows, best = [], dict[tuple[int, int], str]()
    for k, (name, meaning) in enumerate(CONVENTIONS.items()):
        values = [float(j.criteria[name]) for j in judgements]
        most = max(values) if name.startswith(_LARGER_IS_BETTER) else min(values)
        best |= {(k, 1 + i): "best" for i, value in enumerate(values) if marked and value == most}
        rows.append((name.replace("_", " "), *values, meaning))
    note = "Marked: the best of each row." if marked else ""
    return ViewTable("comparison", "Measures of each design", columns, tuple(rows), note=note, marked=best)


_NO_CHANGES = "what changes of the problem would bring was left out or interrupted; `what_ifs` finds it"


def bound_view(bound: DesignBound) -> View:
    """View of the bounds on a design's criteria, and of what changes of its problem would bring."""
    changes = bound.sensitivity if bound.sensitivity is not None and bound.sensitivity.rows else None
    meaning = () if changes is None else (f"{changes.meaning}; without a change it is {changes.reference:.4g}",)
    return View(
        kind="bound",
        title=f"best possible for {bound.name}",
        verdict=verdict_of(bound.criteria[0]),
        summary=(
            f"{bound.name}: bounds over all motions of the family within the limits; smaller criteria are better",
            *meaning,
        ),
        remarks=(*(() if bound.sensitivity is not None else (_NO_CHANGES,)), *bound.assumptions),
        tables=(_criteria(bound), *(() if changes is None else (_changes(changes),))),
    )


def verdict_of(bound: CriterionBound) -> str:
    """One sentence on how far a design is from the best possible."""
    times = bound.reached / bound.value
    how = "is proven" if bound.proven else f"is {bound.basis}"
    return (
        f"The design's {bound.described}, {bound.reached:.4g}, is at most {times:.3g} times the best possible: "
        f"no motion within the limits has less than {bound.value:.4g}, which {how}."
    )


def _criteria(bound: DesignBound) -> ViewTable:
    columns = headed("*criterion:text, *bound:4, *design:4, *efficiency:%, *bound is:text, estimate, CPU [s]")
    rows = tuple(
        (c.described, c.value, c.reached, c.efficiency, _basis(c), c.estimate, c.cpu_seconds) for c in bound.criteria
    )
    return ViewTable("bounds", "Bounds on the criteria", columns, rows)


def _basis(bound: CriterionBound) -> str:
    return f"proven (estimated: {bound.estimate:.4g})" if bound.proven else bound.basis


def _changes(changes: Sensitivity) -> ViewTable:
    criterion = Column(changes.criterion, brief=True, digits=4)
    columns = (*headed("*change of the problem:text"), criterion, *headed("*gain:%"))
    rows = tuple((row.change, row.value, row.gain) for row in changes.rows)
    title = f"What changes of the problem would bring, found in {changes.cpu_seconds:.1f} s CPU"
    return ViewTable("changes", title, columns, rows, most=5)
