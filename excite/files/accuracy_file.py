"""``accuracy.json`` in the folder of a design: deviations that repeats are predicted to show."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from excite.accuracy.accuracy_prediction import AccuracyPrediction
from excite.storage.atomic import read_json, write_json
from excite.storage.manifest import read_manifest
from excite.storage.result_folder import replace_result, result_folder
from regressors.errors import InputError

SCHEMA = "excite.accuracy/1"
NAME, KIND = "accuracy.json", "accuracy"


def save_accuracy(prediction: AccuracyPrediction, folder: str | Path) -> list[Path]:
    """Write a prediction into a folder, created if it does not exist; an older one is replaced.

    Parameters
    ----------
    prediction : AccuracyPrediction
    folder : path

    Raises
    ------
    InputError
        The folder is being written by another process, cannot be written to, or holds a file of the name that is no
        such prediction.
    """
    folder = Path(folder)
    with result_folder(folder) as run:
        _check_replaceable(folder)
        with replace_result(folder, KIND, run=run) as staged:
            write_json(staged / NAME, accuracy_content(prediction))
    return [folder / NAME]


def _check_replaceable(folder: Path) -> None:
    path = folder / NAME
    if not path.exists() or KIND in read_manifest(folder):
        return
    try:
        own = read_json(path).get("schema") != SCHEMA
    except InputError:
        own = True
    if own:
        raise InputError(f"{path} is already there, and is not a predicted accuracy; move it, or give another folder")


def accuracy_content(prediction: AccuracyPrediction) -> dict[str, Any]:
    """Content of ``accuracy.json``.

    Parameters
    ----------
    prediction : AccuracyPrediction
    """
    return {
        "schema": SCHEMA,
        "design": prediction.name,
        "design_sha256": prediction.design_sha256,
        "robot": prediction.robot,
        "model": prediction.model,
        "samples": prediction.count,
        "precision": prediction.precision,
        "seed": prediction.seed,
        "conditions": dict(prediction.conditions),
        "identification": dict(prediction.identification),
        "parameters": [{**asdict(each), "error": each.error} for each in prediction.parameters],
        "notes": list(prediction.notes),
    }
