"""What is shown of a predicted accuracy."""

from __future__ import annotations

from excite.study.predict_accuracy import AccuracyPrediction, ParameterAccuracy
from excite.views.view import BRIEF_UNIT, Column, View, ViewTable, numbers, texts


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
        *texts("parameter", brief=True),
        *numbers("expected", brief=True, digits=4),
        BRIEF_UNIT,
        *(Column(name, brief=True, digits=2) for name in ("by torques", "by motion", "deviation", "bias")),
    )
    rows = tuple(
        (p.name, p.value, p.unit, p.by_torques, p.by_motion, p.deviation, p.bias) for p in prediction.parameters
    )
    return ViewTable("accuracy", "Predicted accuracy of repeats", columns, rows)
