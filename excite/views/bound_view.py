"""What is shown of a bound: how far a design is from the best possible, and what changes would bring."""

from __future__ import annotations

from excite.optimality.design_bound import CriterionBound, DesignBound
from excite.optimality.sensitivity import Sensitivity
from excite.views.view import View, ViewTable, numbers, percents, texts


def bound_view(bound: DesignBound) -> View:
    """View of the bounds on a design's criteria, and of what changes of its problem would bring."""
    changes = bound.sensitivity if bound.sensitivity is not None and bound.sensitivity.rows else None
    meaning = () if changes is None else (f"{changes.meaning}; without a change it is {changes.reference:.4g}",)
    return View(
        title=f"best possible for {bound.name}",
        verdict=verdict_of(bound.criteria[0]),
        summary=(
            f"{bound.name}: bounds over all motions of the family within the limits; smaller criteria are better",
            *meaning,
        ),
        remarks=bound.assumptions,
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
    columns = (
        *texts("criterion", brief=True),
        *numbers("bound", "design", brief=True, digits=4),
        *percents("efficiency", brief=True),
        *texts("bound is", brief=True),
        *numbers("estimate", "CPU [s]"),
    )
    rows = tuple(
        (c.described, c.value, c.reached, c.efficiency, _basis(c), c.estimate, c.cpu_seconds) for c in bound.criteria
    )
    return ViewTable("bounds", "Bounds on the criteria", columns, rows)


def _basis(bound: CriterionBound) -> str:
    return f"proven (estimated: {bound.estimate:.4g})" if bound.proven else bound.basis


def _changes(changes: Sensitivity) -> ViewTable:
    columns = (
        *texts("change of the problem", brief=True),
        *numbers(changes.criterion, brief=True, digits=4),
        *percents("gain", brief=True),
    )
    rows = tuple((row.change, row.value, row.gain) for row in changes.rows)
    title = f"What changes of the problem would bring, found in {changes.cpu_seconds:.1f} s CPU"
    return ViewTable("changes", title, columns, rows)
