"""``fit.json``: data and quality of a fit of friction curves, schema ``excite.friction-fit/1``."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from excite.files.figure_names import figure_names
from excite.files.friction_file import write_friction
from excite.friction.fit.stiction_points import mean_break_aways
from excite.storage.atomic import write_json
from excite.storage.result_folder import check_not_taken, replace_result, result_folder

if TYPE_CHECKING:
    from excite.friction.fit.characteristic import Characteristic
    from excite.friction.fit.curve_fit import CurveFit
    from excite.friction.fit.friction_fit import FrictionFit

SCHEMA = "excite.friction-fit/1"
FIT, FRICTION, FIGURE, KIND = "fit.json", "friction.yaml", "friction", "friction-fit"


def save_fit(fit: FrictionFit, folder: str | Path, *, replace: bool = False) -> list[Path]:
    """Write the curves and the data of their fit into a folder, which is created if it does not exist.

    Parameters
    ----------
    fit : FrictionFit
    folder : path
    replace : bool
        Replace an existing fit, when the new one is complete.

    Returns
    -------
    list of Path
        Files that were written.

    Raises
    ------
    InputError
        The folder holds a fit, is being written by another process, or cannot be written to.
    """
    folder = Path(folder)
    with result_folder(folder) as run:
        check_no_fit(folder, replace=replace)
        older = figure_names([FIGURE]) if (folder / FIT).exists() else []
        with replace_result(folder, KIND, run=run, older=older) as staged:
            write_friction(fit.curves, staged / FRICTION)
            write_json(staged / FIT, fit_content(fit))
    return [folder / FRICTION, folder / FIT]


def check_no_fit(folder: Path, names: Collection[str] = (FRICTION,), *, replace: bool = False) -> None:
    """Raise `TakenError` where a folder holds a fit, or other files of the names, that may not be replaced."""
    check_not_taken(folder, FIT, "a fit", names, replace=replace)


def fit_content(fit: FrictionFit) -> dict[str, Any]:
    """Content of ``fit.json``.

    Parameters
    ----------
    fit : FrictionFit
    """
    return {
        "schema": SCHEMA,
        "robot": {"name": fit.robot.name, "sha256": fit.robot.sha256()},
        "logs": [{"file": log.source, "sha256": log.sha256, "left_out": list(log.left_out)} for log in fit.logs],
        "settings": asdict(fit.settings),
        "subtracted": fit.gravity_source,
        "drives": [_drive(characteristic) for characteristic in fit.characteristics],
        "provenance": dict(fit.provenance),
    }


def _drive(characteristic: Characteristic) -> dict[str, Any]:
    return {
        "name": characteristic.drive,
        "unit": characteristic.unit,
        "gravity": characteristic.gravity,
        "fit": None
        if characteristic.fit is None
        else {**_fit(characteristic.fit), "covariance": characteristic.fit.covariance.tolist()},
        "compared": [_fit(other) for other in characteristic.others],
        "not_fitted": characteristic.failed,
        "break_away": [asdict(mean) for mean in mean_break_aways(characteristic.break_aways)],
        "stiction": [asdict(rest) for rest in characteristic.stiction],
        "points": [asdict(point) for point in characteristic.points],
        "points_at_rest": [asdict(point) for point in characteristic.rests],
        "notes": list(characteristic.notes),
    }


def _fit(curve_fit: CurveFit) -> dict[str, Any]:
    rows = zip(curve_fit.form.parameters, curve_fit.values.tolist(), curve_fit.halfwidth.tolist(), strict=True)
    return {
        "model": curve_fit.form.name,
        "reference_temperature": curve_fit.form.temperature,
        "parameters": {
            name: {"value": value, "interval99": None if name in curve_fit.held else half} for name, value, half in rows
        },
        "scatter": curve_fit.scatter,
        "bic": curve_fit.bic,
        "aicc": curve_fit.aicc if np.isfinite(curve_fit.aicc) else None,
    }
