"""``fit.json``: what friction curves were fitted to, and how well, schema ``excite.friction-fit/1``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from excite.friction.fit.stiction_points import mean_break_aways

if TYPE_CHECKING:
    from excite.friction.fit.characteristics import Characteristic
    from excite.friction.fit.curve_fit import Fit
    from excite.friction.fit.fit_settings import FitSettings
    from excite.logs.log import Log
    from regressors.robot.robot import Robot

SCHEMA = "excite.friction-fit/1"
FIT, FRICTION = "fit.json", "friction.yaml"


def fit_content(
    robot: Robot,
    logs: Sequence[Log],
    settings: FitSettings,
    found: Sequence[Characteristic],
    model: str | None,
    provenance: Mapping[str, Any],
) -> dict[str, Any]:
    """Content of the file.

    Parameters
    ----------
    robot : Robot
    logs : sequence of Log
    settings : FitSettings
    found : sequence of Characteristic
    model : str, optional
        Where the parameters are from that gravity was subtracted with.
    provenance : mapping
    """
    return {
        "schema": SCHEMA,
        "robot": {"name": robot.name, "sha256": robot.sha256()},
        "logs": [{"file": log.source, "sha256": log.sha256, "left_out": list(log.left_out)} for log in logs],
        "settings": asdict(settings),
        "subtracted": model,
        "drives": [_drive(one) for one in found],
        "provenance": dict(provenance),
    }


def _drive(one: Characteristic) -> dict[str, Any]:
    return {
        "name": one.drive,
        "unit": one.unit,
        "gravity": one.gravity,
        "fit": None if one.fit is None else {**_fit(one.fit), "covariance": one.fit.covariance.tolist()},
        "compared": [_fit(other) for other in one.others],
        "not_fitted": one.failed,
        "break_away": [asdict(mean) for mean in mean_break_aways(one.break_aways)],
        "stiction": [asdict(rest) for rest in one.stiction],
        "points": [asdict(point) for point in one.points],
        "points_at_rest": [asdict(point) for point in one.rests],
        "notes": list(one.notes),
    }


def _fit(one: Fit) -> dict[str, Any]:
    rows = zip(one.form.parameters, one.values.tolist(), one.halfwidth.tolist(), strict=True)
    return {
        "model": one.form.name,
        "reference_temperature": one.form.temperature,
        "parameters": {
            name: {"value": value, "interval99": None if name in one.held else half} for name, value, half in rows
        },
        "scatter": one.scatter,
        "bic": one.bic,
        "aicc": one.aicc if np.isfinite(one.aicc) else None,
    }
