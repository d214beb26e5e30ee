"""What is shown of predictions for a design: how far it is from the best possible, and what its repeats will show."""

from __future__ import annotations

from excite.optimality.design_bound import CriterionBound, DesignBound
from excite.optimality.sensitivity import Sensitivity
from excite.study.accuracy_prediction import AccuracyPrediction, ParameterAccuracy
from excite.views.view import Column, Format, View, ViewTable


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
        Column("criterion", Format.TEXT, brief=True),
        Column("bound", brief=True, digits=4),
        Column("design", brief=True, digits=4),
        Column("efficiency", Format.PERCENT, brief=True),
        Column("bound is", Format.TEXT, brief=True),
        Column("estimate"),
        Column("CPU [s]"),
    )
    rows = tuple(
        (c.described, c.value, c.reached, c.efficiency, _basis(c), c.estimate, c.cpu_seconds) for c in bound.criteria
    )
    return ViewTable("bounds", "Bounds on the criteria", columns, rows)


def _basis(bound: CriterionBound) -> str:
    return f"proven (estimated: {bound.estimate:.4g})" if bound.proven else bound.basis


def _changes(changes: Sensitivity) -> ViewTable:
    columns = (
        Column("change of the problem", Format.TEXT, brief=True),
        Column(changes.criterion, brief=True, digits=4),
        Column("gain", Format.PERCENT, brief=True),
    )
    rows = tuple((row.change, row.value, row.gain) for row in changes.rows)
    title = f"What changes of the problem would bring, found in {changes.cpu_seconds:.1f} s CPU"
    return ViewTable("changes", title, columns, rows)


def accuracy_view(prediction: AccuracyPrediction) -> View:
    """View of what repeats of an experiment are predicted to show."""
    worst = max(prediction.parameters, key=_relative)
    return View(
        title=f"predicted accuracy of repeats of {prediction.name}",
        verdict=f"Repeats scatter most, in relation to its value, in {worst.name}: {worst.deviation:.2g} {worst.unit} "
        f"of {worst.value:.4g}",
        summary=(
            f"{len(prediction.parameters)} parameters of {prediction.robot}, {prediction.model} model; deviations to "
            f"{100 * prediction.precision:.2g} % ({prediction.count} samples)",
        ),
        remarks=prediction.notes,
        tables=(_parameters(prediction),),
    )


def _relative(parameter: ParameterAccuracy) -> float:
    return float(parameter.deviation / abs(parameter.value)) if parameter.value else 0.0


def _parameters(prediction: AccuracyPrediction) -> ViewTable:
    columns = (
        Column("parameter", Format.TEXT, brief=True),
        Column("expected", brief=True, digits=4),
        Column("unit", Format.UNIT, brief=True),
        *(Column(name, brief=True, digits=2) for name in ("by torques", "by motion", "deviation", "bias")),
    )
    rows = tuple(
        (p.name, p.value, p.unit, p.by_torques, p.by_motion, p.deviation, p.bias) for p in prediction.parameters
    )
    return ViewTable("accuracy", "Predicted accuracy of repeats", columns, rows)
