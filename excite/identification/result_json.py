"""``result.json``: an identification with its inputs and settings, written and read; beside it what figures draw."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from excite.design.design_json import stored_robot, stored_task
from excite.design.task_file import stored_part, task_content
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.storage.atomic import Destination, write_json
from excite.storage.codec import content_of
from excite.storage.commit import read_settled
from excite.storage.migrations import schema_of
from excite.storage.records import complete, curves_file, read_record, write_record
from excite.storage.result_folder import amend_result, check_not_taken, result_folder
from excite.tasks.friction_file import friction_of, friction_text, read_friction
from regressors.arguments import checked
from regressors.errors import InputError

RESULT, KIND = "result.json", "result"
CURVES = curves_file(KIND)
REPETITIONS = "repetitions"
SO_FAR = "repetitions-so-far.npz"  # until all are computed
FIGURES = ("torques", "residuals", "parameters", "estimates", REPETITIONS)


def save_result(result: Identification, folder: str | Path, *, replace: bool = False) -> list[Path]:
    """Write ``result.json``, and what its figures draw, into a folder, which is created if it does not exist."""
    folder = Path(folder)
    with result_folder(folder):
        check_free(folder, (CURVES,), replace=replace)
        return write_record(result, KIND, folder, KIND, FIGURES, objects=_objects(result))


def amend_result_file(folder: Path, result: Identification) -> None:
    """Replace a folder's ``result.json`` by one with more in it, of the same run; the curves stay."""
    with result_folder(folder), amend_result(folder, KIND) as staged:
        write_json(staged / RESULT, result_content(result))


def check_free(folder: str | Path, names: Collection[str] = (), *, replace: bool) -> None:
    """Raise `TakenError` where a folder holds a result, or other files of the names, that may not be replaced."""
    check_not_taken(Path(folder), RESULT, "a result", names, replace=replace)


def result_content(result: Identification) -> dict[str, Any]:
    """Content of ``result.json``; its arrays are in the file of curves."""
    return {"schema": schema_of(KIND), **content_of(result)[0], **_objects(result)}


def _objects(result: Identification) -> dict[str, Any]:
    """Entries of the parts that may be objects of the user's."""
    return {
        "task": task_content(result.task),
        "recipe": result.recipe.to_dict(),
        "friction": _friction(result),
    }


def _friction(result: Identification) -> dict[str, Any] | None:
    """File, hash and text of the friction curves that were subtracted, where they are not those of the task."""
    if result.friction is None or result.task.known_friction is not None:
        return None
    if result.friction_entry is not None:
        return dict(result.friction_entry)
    file = result.friction_file
    if file is None:
        return {"file": "friction curves", "sha256": None, "text": friction_text(result.friction)}
    content = file.read_bytes()
    known = {"file": str(file), "sha256": sha256(content).hexdigest()}
    as_filed = result.friction_scale is None and file.suffix != ".json"
    whole = as_filed and len(read_friction(file).curves) == len(result.friction.curves)
    return {**known, "text": content.decode("utf-8") if whole else friction_text(result.friction)}


@checked
def load_result(folder: str | Path, part: str | Collection[str] = (), **own: Any) -> Identification:
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


def _result(folder: Path, path: Path, allowed: Collection[str], own: dict[str, Any]) -> Identification:
    if not path.exists():
        raise InputError(f"{folder} holds no result: there is no {path}; write one with `identify`")

    def objects(content: Mapping[str, Any]) -> dict[str, Any]:
        friction, robot = content["friction"], stored_robot(content)
        given = {name: value for name, value in own.items() if name != "estimator"}
        task = stored_task(content, robot, allowed, given)
        return {
            "folder": path.parent,
            "task": task,
            "recipe": _recipe(content["recipe"], own.get("estimator"), allowed),
            "friction": task.known_friction if friction is None else friction_of(friction["text"], friction["file"]),
            "friction_entry": friction,
        }

    result = read_record(path, Identification, KIND, objects)
    with complete(path, KIND):
        _check_whole(result)
    return result


def _recipe(content: dict[str, Any], estimator: Any, allowed: Collection[str]) -> Recipe:
    if estimator is None and "estimator" in content:
        estimator = stored_part("estimator", str(content["estimator"]), allowed)
    return Recipe(**content if estimator is None else {**content, "estimator": estimator})


def _check_whole(result: Identification) -> None:
    count = len(result.names)
    estimate = result.estimate
    shapes = (estimate.values.shape, estimate.coefficients.shape, estimate.covariance.shape)
    if not all(result.names) or len(result.units) != count or shapes != ((count,), (count,), (count, count)):
        raise ValueError("parameters without a name")
    if not np.isfinite(result.coefficients).all() or not math.isfinite(result.training_error or 0.0):
        raise ValueError("expected finite numbers to predict with, and a finite error")
