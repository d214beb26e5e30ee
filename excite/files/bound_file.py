"""``bound.json`` in the folder of a design: bounds on criteria over all motions of its problem."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from excite.design.designed_motion import DesignedMotion
from excite.optimality.bounded_problem import bounded_problem_sha256
from excite.optimality.design_bound import CriterionBound, DesignBound, reached_by
from excite.optimality.sensitivity import Sensitivity, SensitivityRow
from excite.registry import name_of
from excite.storage.atomic import read_json, write_json
from excite.storage.commit import read_settled
from excite.storage.destination import Destination
from excite.storage.manifest import read_manifest
from excite.storage.result_folder import replace_result, result_folder
from regressors.errors import InputError

SCHEMA = "excite.bound/1"
NAME, KIND = "bound.json", "bound"


def save_bound(bound: DesignBound, folder: str | Path) -> list[Path]:
    """Write a bound into a folder, created if it does not exist; an older one is replaced.

    Parameters
    ----------
    bound : DesignBound
    folder : path

    Raises
    ------
    InputError
        The folder is being written by another process, cannot be written to, or holds a file of the name that is not
        a bound.
    """
    folder = Path(folder)
    with result_folder(folder) as run:
        _check_replaceable(folder)
        with replace_result(folder, KIND, run=run) as staged:
            write_json(staged / NAME, bound_content(bound))
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
        raise InputError(f"{path} is already there, and is not a bound; move it, or give another folder")


def bound_content(bound: DesignBound) -> dict[str, Any]:
    """Content of ``bound.json``.

    Parameters
    ----------
    bound : DesignBound
    """
    changes = bound.sensitivity
    criteria = [{**asdict(each), "efficiency": each.efficiency, "basis": each.basis} for each in bound.criteria]
    return {
        "schema": SCHEMA,
        "problem": bound.problem,
        "coefficients": bound.coefficients,
        "criteria": criteria,
        "assumptions": list(bound.assumptions),
        "sensitivity": None if changes is None else {**asdict(changes), "meaning": changes.meaning},
    }


def stored_bound(design: DesignedMotion) -> DesignBound | None:
    """The bound in a design's folder; None where there is none, or that of another problem.

    Parameters
    ----------
    design : DesignedMotion

    Raises
    ------
    InputError
        The file is damaged.
    """
    if design.folder is None or not (design.folder / NAME).exists():
        return None
    path = design.folder / NAME
    content = read_settled(Destination(design.folder), lambda: read_json(path))
    problem = bounded_problem_sha256(design)
    if content.get("schema") != SCHEMA or problem is None or content.get("problem") != problem:
        return None
    try:
        fields = CriterionBound.__dataclass_fields__
        criteria = tuple(CriterionBound(**{name: each[name] for name in fields}) for each in content["criteria"])
        assumptions = tuple(map(str, content["assumptions"]))
        changes = _stored_sensitivity(content.get("sensitivity"))
    except (KeyError, TypeError) as error:
        raise InputError(f"{path} is damaged: {error}; remove it, and run `excite bound` again") from error
    coefficients = design.coefficients_sha256
    if content.get("coefficients") != coefficients:  # another motion of the same problem
        criteria = tuple(replace(each, reached=reached_by(design, each.name)) for each in criteria)
        changes = None
    if changes is not None and changes.criterion != str(name_of(design.task.objective.criterion)):
        changes = None
    return DesignBound(design.name, problem, criteria, assumptions, coefficients, changes)


def _stored_sensitivity(content: Any) -> Sensitivity | None:
    """What changes of the problem would bring; None where a file has nothing of it."""
    if content is None:
        return None
    rows = tuple(SensitivityRow(row["change"], row["value"], row["gain"]) for row in content["rows"])
    return Sensitivity(content["criterion"], content["reference"], rows, content["cpu_seconds"])
