"""``result.json``: an identification with its inputs and settings, written and read; beside it what figures draw."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from excite.files.between_logs_json import between_logs_content
from excite.files.friction_file import friction_of, friction_text, read_friction
from excite.files.result_curves import CURVES, result_curves
from excite.files.stored import stored_content, stored_robot
from excite.files.stored_task import stored_task
from excite.files.task_file import stored_part, task_content
from excite.identification.estimate import Estimate
from excite.identification.identification import Identification
from excite.identification.noise_density import noise_density
from excite.identification.prediction import relative_error
from excite.identification.recipe import Recipe
from excite.identification.reference_values import ReferenceValues
from excite.identification.residuals import residual_diagnostics
from excite.identification.result import StoredResult
from excite.logs.event import Event
from excite.storage.atomic import write_json
from excite.storage.commit import read_settled
from excite.storage.curves_file import write_curves
from excite.storage.destination import Destination
from excite.storage.figure_names import figure_names
from excite.storage.manifest import check_files
from excite.storage.records import complete
from excite.storage.result_folder import amend_result, check_not_taken, replace_result, result_folder
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.motor_side import MotorSide, motor_sides

SCHEMA = "excite.result/1"
RESULT, KIND = "result.json", "result"
REPETITIONS = "repetitions"
SO_FAR = "repetitions-so-far.npz"  # until all are computed
FIGURES = ("torques", "residuals", "parameters", "estimates", REPETITIONS)


def save_result(result: Identification, folder: str | Path, *, replace: bool = False) -> list[Path]:
    """Write ``result.json``, and what its figures draw, into a folder, which is created if it does not exist."""
    folder = Path(folder)
    with result_folder(folder) as run:
        check_free(folder, (CURVES,), replace=replace)
        older = figure_names(FIGURES) if (folder / RESULT).exists() else ()
        with replace_result(folder, KIND, run=run, older=older) as staged:
            write_curves(staged / CURVES, result_curves(result))
            write_json(staged / RESULT, result_content(result))
    return [folder / RESULT, folder / CURVES]


def amend_content(folder: Path, content: dict[str, Any]) -> None:
    """Replace the content of a folder's ``result.json`` by one with more in it, of the same run."""
    with result_folder(folder), amend_result(folder, KIND) as staged:
        write_json(staged / RESULT, content)


def check_free(folder: str | Path, names: Collection[str] = (), *, replace: bool) -> None:
    """Raise `TakenError` where a folder holds a result, or other files of the names, that may not be replaced."""
    check_not_taken(Path(folder), RESULT, "a result", names, replace=replace)


def result_content(result: Identification) -> dict[str, Any]:
    """Content of ``result.json``."""
    estimate, observations, base = result.estimate, result.observations, result.target.base
    design, reference = result.design_summary, result.reference
    return {
        "schema": SCHEMA,
        "robot": {
            "name": result.robot.name,
            "sha256": result.robot.sha256(),
            "description": result.robot.description(),
        },
        "task": task_content(result.task),
        "recipe": result.recipe.to_dict(),
        "design": None if design is None else {name: _finite_or(value) for name, value in design.items()},
        "friction": _friction(result),
        "choices": [choice.to_dict() for choice in result.choices],
        "friction_scale": None if result.friction_scale is None else result.friction_scale.content(),
        "drive_gains": None if result.calibration is None else result.calibration.content(),
        "logs": [_log(part) for part in result.prepared],
        "estimator": estimate.method,
        "equations": [list(equation) for equation in observations.equations],
        "rows": len(observations.y),
        "degrees_of_freedom": estimate.degrees_of_freedom,
        "condition_number": {
            "measured": _finite(result.condition_number),
            "designed": None if design is None else _finite(design["condition_number"]),
            "convention": "cond(W), columns of the left-to-right QR base (Gautier 1991), SI, unscaled",
        },
        "relative_error": _finite(_relative(result)),
        "prediction_error": result.training_error,
        "reference": None if reference is None else reference.kind,
        "parameters": _parameters(result, reference),
        "covariance": [[_finite(x) for x in row] for row in estimate.covariance.tolist()],
        "friction_mismatch": None if estimate.mismatch is None else estimate.mismatch.tolist(),
        "unseen": list(estimate.unseen),
        "standard": dict(estimate.standard),
        "noise": {
            log: dict(zip((name for name, _ in observations.equations), map(_finite, row), strict=True))
            for log, row in zip(observations.logs, estimate.noise.tolist(), strict=True)
        },
        "noise_density": _noise_density(result),
        "residuals": [
            {name: _finite(x) if isinstance(x, float) else x for name, x in vars(diagnosis).items()}
            for diagnosis in residual_diagnostics(estimate, observations)
        ],
        "base": {"rank": base.rank, "columns": list(base.names), "gap": _finite(base.gap)},
        "notes": list(estimate.notes),
        "doubts": [asdict(doubt) for doubt in result.doubts],
        "warnings": [asdict(warning) for warning in result.warnings],
        **between_logs_content(result),
        "provenance": dict(result.provenance),
    }


def _noise_density(result: Identification) -> dict[str, float] | None:
    """Density of the noise of each equation; None where that of one is not known."""
    density = noise_density(result.estimate, result.observations)
    if not np.all(np.isfinite(density)):
        return None
    return {name: float(x) for (name, _), x in zip(result.observations.equations, density, strict=True)}


def _log(part: Any) -> dict[str, Any]:
    log = part.log
    return {
        "file": log.source,
        "sha256": log.sha256,
        "rows": log.count,
        "from": float(log.time[0]),
        "to": float(log.time[-1]),
        "instants": int(part.samples.time.size),
        "rate": float((part.samples.time.size - 1) / (part.samples.time[-1] - part.samples.time[0])),
        "notes": list(part.notes),
        "events": [_event(event) for event in part.events],
        "left_out_share": part.left_out_share,
    }


def _event(event: Event) -> dict[str, Any]:
    first, last = event.rows
    return {
        "kind": event.kind,
        "rows": [first, last],
        "from": event.begin,
        "to": event.end,
        "seconds": event.seconds,
        "left_out": event.left_out,
        "text": event.text,
    }


def _parameters(result: Identification, reference: ReferenceValues | None) -> list[dict[str, Any]]:
    estimate, base = result.estimate, result.target.base
    known = np.full(len(estimate.names), np.nan) if reference is None else reference.values
    sides = motor_sides(result.target.model, base)
    return [
        {
            "name": name,
            "expression": base.expressions[k],
            "unit": unit,
            "value": _finite(float(estimate.values[k])),
            "standard_deviation": _finite(float(estimate.deviation[k])),
            "interval": [_finite(float(x)) for x in estimate.interval[k]],
            "relative_deviation": _finite(float(estimate.relative_deviation[k])),
            "seen": name not in estimate.unseen,
            "fit": float(estimate.coefficients[k]),
            **({} if estimate.unconstrained is None else {"unconstrained": float(estimate.unconstrained[k])}),
            "reference": _finite(float(known[k])),
            **({"motor_side": _motor_side(estimate, k, float(known[k]), sides[name])} if name in sides else {}),
        }
        for k, (name, unit) in enumerate(zip(estimate.names, estimate.units, strict=True))
    ]


def _motor_side(estimate: Estimate, k: int, reference: float, side: MotorSide) -> dict[str, Any]:
    """The rotor inertia itself, of a parameter that is one at the drive coordinate."""
    return {
        **vars(side),
        "value": _finite(float(estimate.values[k]) / side.factor),
        "standard_deviation": _finite(float(estimate.deviation[k]) / side.factor),
        "interval": [_finite(float(x) / side.factor) for x in estimate.interval[k]],
        "reference": _finite(reference / side.factor),
    }


def _relative(result: Identification) -> float:
    return relative_error(result.observations.y, result.estimate.predicted(result.observations))


def _friction(result: Identification) -> dict[str, Any] | None:
    """File, hash and text of the friction curves that were subtracted, where they are not those of the task."""
    if result.friction is None or result.task.known_friction is not None:
        return None
    file = result.friction_file
    if file is None:
        return {"file": "friction curves", "sha256": None, "text": friction_text(result.friction)}
    content = file.read_bytes()
    known = {"file": str(file), "sha256": sha256(content).hexdigest()}
    as_filed = result.friction_scale is None and file.suffix != ".json"
    whole = as_filed and len(read_friction(file).curves) == len(result.friction.curves)
    return {**known, "text": content.decode("utf-8") if whole else friction_text(result.friction)}


def _finite_or(value: Any) -> Any:
    return _finite(value) if isinstance(value, float) else value


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


@checked
def load_result(folder: str | Path, part: str | Collection[str] = (), **own: Any) -> StoredResult:
    """Load the result in a folder, or in a ``result.json``.

    Parameters
    ----------
    folder : path
    part : str or collection of str
        User-defined parts, as ``module:Name``, that may be imported if the result names them.
    **own
        User-defined parts of the result, as objects: ``model``, ``estimator``. Files only name such parts; nothing else
        is imported for them. Other options of the task too, such as ``friction_curves`` where the file only names
        theirs: it is not opened.

    Raises
    ------
    InputError
        There is no result, it has another schema, or its robot does not match its hash; or ``result.json`` is not the
        one that was written.
    """
    folder = Path(folder)
    path = folder if folder.suffix == ".json" else folder / RESULT
    allowed = (part,) if isinstance(part, str) else part
    return read_settled(Destination(path.parent), lambda: _result(folder, path, allowed, own))


def _result(folder: Path, path: Path, allowed: Collection[str], own: dict[str, Any]) -> StoredResult:
    if not path.exists():
        raise InputError(f"{folder} holds no result: there is no {path}; write one with `identify`")
    content = stored_content(path, SCHEMA)
    with complete(path, "result"):
        friction = content["friction"]
        robot = stored_robot(content)
        given = {name: value for name, value in own.items() if name != "estimator"}
        task = stored_task(content, robot, allowed, given)
        result = StoredResult(
            folder=path.parent,
            robot=robot,
            task=task,
            recipe=_recipe(content["recipe"], own.get("estimator"), allowed),
            content=_complete(content),
            friction=task.known_friction if friction is None else friction_of(friction["text"], friction["file"]),
        )
        if not all(result.names) or len(result.units) != len(result.coefficients):
            raise ValueError("parameters without a name")
    if path.name == RESULT:
        check_files(path.parent, KIND, (RESULT,))
    return result


def _recipe(content: dict[str, Any], estimator: Any, allowed: Collection[str]) -> Recipe:
    if estimator is None and "estimator" in content:
        estimator = stored_part("estimator", str(content["estimator"]), allowed)
    return Recipe(**content if estimator is None else {**content, "estimator": estimator})


def _complete(content: dict[str, Any]) -> dict[str, Any]:
    for log in content["logs"]:
        str(log["sha256"])
    for name in ("relative_error", "estimator", "condition_number"):
        content[name]
    for value in (content["prediction_error"], *(p["fit"] for p in content["parameters"])):
        if value is not None and not math.isfinite(value):
            raise ValueError(f"expected a finite number, given {value}")
    return content
