"""``result.json``: an identification with everything that it rests on, and its way back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from excite.files.friction_file import friction_of
from excite.files.stored import complete, stored_content, stored_robot
from excite.files.task_file import task_from_options
from excite.identification.identification import Identification
from excite.identification.prediction import instant_subject, prediction, relative_error
from excite.identification.recipe import Recipe
from excite.identification.residuals import residual_diagnostics
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array

SCHEMA = "excite.result/1"
RESULT = "result.json"


@dataclass(frozen=True, eq=False)
class Reference:
    """Values that an estimate is compared with.

    Parameters
    ----------
    kind : {"truth", "description"}
        Of a simulated log, or as the robot's description states them.
    values : ndarray, shape (p,)
        NaN where unknown.
    """

    kind: str
    values: Array


@dataclass(frozen=True, eq=False)
class StoredResult:
    """A result as its file tells it.

    Parameters
    ----------
    folder : Path
    robot : Robot
        The whole robot.
    task : Task
    recipe : Recipe
    names, units : tuple of str
        Base parameters.
    coefficients : ndarray, shape (p,)
        Values that explain the logs together, for predictions.
    content : dict
        The whole file.
    friction : FrictionCurves, optional
        Known beforehand, and subtracted from the torques.
    """

    folder: Path
    robot: Robot
    task: Task
    recipe: Recipe
    names: tuple[str, ...]
    units: tuple[str, ...]
    coefficients: Array
    content: dict[str, Any]
    friction: FrictionCurves | None = None

    @property
    def training(self) -> frozenset[str]:
        """Hashes of the logs that it was identified from."""
        return frozenset(log["sha256"] for log in self.content["logs"])

    @property
    def training_error(self) -> float | None:
        """Relative error of the predictions on those logs, at every instant, unfiltered."""
        value = self.content["prediction_error"]
        return None if value is None else float(value)


def result_content(
    result: Identification,
    *,
    reference: Reference | None = None,
    design: Mapping[str, Any] | None = None,
    friction: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Content of ``result.json``.

    Parameters
    ----------
    result : Identification
    reference : Reference, optional
    design : mapping, optional
        Folder, hash and condition number of the design whose motion was played.
    friction : mapping, optional
        File, hash and text of the friction curves that were subtracted, where they are not those of the task.
    provenance : mapping, optional
        Versions and times.
    """
    estimate, observations, base = result.estimate, result.observations, result.subject.base
    return {
        "schema": SCHEMA,
        "robot": {
            "name": result.robot.name,
            "sha256": result.robot.sha256(),
            "description": result.robot.description(),
        },
        "task": result.task.to_dict(),
        "recipe": result.recipe.to_dict(),
        "design": None if design is None else dict(design),
        "friction": None if friction is None else dict(friction),
        "logs": [_log(part) for part in result.prepared],
        "estimator": estimate.method,
        "equations": [list(equation) for equation in observations.equations],
        "rows": len(observations.y),
        "degrees_of_freedom": estimate.degrees_of_freedom,
        "condition_number": {
            "measured": _finite(result.condition_number),
            "designed": None if design is None else design.get("condition_number"),
            "convention": "cond(W), columns of the left-to-right QR base (Gautier 1991), SI, unscaled",
        },
        "relative_error": _finite(_relative(result)),
        "prediction_error": _prediction_error(result, friction),
        "reference": None if reference is None else reference.kind,
        "parameters": _parameters(result, reference),
        "covariance": [[_finite(x) for x in row] for row in estimate.covariance.tolist()],
        "unseen": list(estimate.unseen),
        "standard": dict(estimate.standard),
        "noise": {
            log: dict(zip((name for name, _ in observations.equations), map(_finite, row), strict=True))
            for log, row in zip(observations.logs, estimate.noise.tolist(), strict=True)
        },
        "residuals": [
            {name: _finite(x) if isinstance(x, float) else x for name, x in vars(diagnosis).items()}
            for diagnosis in residual_diagnostics(estimate, observations)
        ],
        "base": {"rank": base.rank, "columns": list(base.names), "gap": _finite(base.gap)},
        "notes": list(estimate.notes),
        "provenance": dict(provenance or {}),
    }


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
    }


def _parameters(result: Identification, reference: Reference | None) -> list[dict[str, Any]]:
    estimate, base = result.estimate, result.subject.base
    known = np.full(len(estimate.names), np.nan) if reference is None else reference.values
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
            "reference": _finite(float(known[k])),
        }
        for k, (name, unit) in enumerate(zip(estimate.names, estimate.units, strict=True))
    ]


def _relative(result: Identification) -> float:
    return relative_error(result.observations.y, result.estimate.predicted(result.observations))


def _prediction_error(result: Identification, friction: Mapping[str, Any] | None) -> float | None:
    """Error of the predictions on the logs as recorded, as `excite.verification` judges other logs."""
    subject = instant_subject(result.robot, result.task, result.recipe)
    if subject.base.names != result.estimate.names:
        return None
    curves = result.task.known_friction if friction is None else friction_of(friction["text"], friction["file"])
    beta = result.estimate.coefficients
    found = [prediction(subject, part, result.recipe, beta, curves) for part in result.prepared]
    measured, predicted = (np.concatenate([getattr(p, what) for p in found]) for what in ("measured", "predicted"))
    return _finite(relative_error(measured, predicted))


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def read_result(folder: str | Path) -> StoredResult:
    """Result in a folder, or in a ``result.json``.

    Parameters
    ----------
    folder : path

    Raises
    ------
    InputError
        There is none, it is of another schema, or its robot is not the one that its hash says.
    """
    folder = Path(folder)
    path = folder if folder.suffix == ".json" else folder / RESULT
    if not path.exists():
        raise InputError(f"{folder} holds no result: there is no {path}; 'excite identify' makes one")
    content = stored_content(path, SCHEMA)
    with complete(path, "result"):
        parameters, friction = content["parameters"], content["friction"]
        task = task_from_options(content["task"])
        return StoredResult(
            folder=path.parent,
            robot=stored_robot(content),
            task=task,
            recipe=Recipe(**content["recipe"]),
            names=tuple(str(p["name"]) for p in parameters),
            units=tuple(str(p["unit"]) for p in parameters),
            coefficients=np.array([float(p["fit"]) for p in parameters]),
            content=_complete(content),
            friction=task.known_friction if friction is None else friction_of(friction["text"], friction["file"]),
        )


def _complete(content: dict[str, Any]) -> dict[str, Any]:
    for log in content["logs"]:
        str(log["sha256"])
    for name in ("relative_error", "estimator", "condition_number"):
        content[name]
    for value in (content["prediction_error"], *(p["fit"] for p in content["parameters"])):
        if value is not None and not math.isfinite(value):
            raise ValueError(f"{value} where a finite number should be")
    return content
