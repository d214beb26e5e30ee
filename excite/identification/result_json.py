"""``result.json``: an identification with its settings, written and read; information of earlier experiments."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from excite.design.design import Design
from excite.design.design_folder import DESIGN
from excite.design.design_json import load_design, stored_robot, stored_task
from excite.design.task_file import stored_part, task_content
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.information.earlier_precision import geometry, payload_text
from excite.information.half_widths import residual_degrees_of_freedom
from excite.information.matrix import noise_per_row
from excite.information.target import IdentificationTarget, target_of
from excite.storage.atomic import Destination, write_json
from excite.storage.codec import content_of
from excite.storage.commit import read_settled
from excite.storage.manifest import sha256_of
from excite.storage.migrations import schema_of
from excite.storage.records import complete, curves_file, read_record, write_record
from excite.storage.result_folder import amend_result, check_not_taken, result_folder
from excite.tasks.friction_file import friction_of, friction_text, read_friction
from excite.tasks.stored_files import EarlierInformation, UnopenedFile
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.samples import Array

RESULT, KIND = "result.json", "result"
CURVES = curves_file(KIND)
REPETITIONS = "repetitions"
SO_FAR = "repetitions-so-far.npz"  # until all are computed
_PULLED = "identified with a pull of {:g} towards the described bodies, a setting that is gone (see described_within)"
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
    return {"task": task_content(result.task), "recipe": result.recipe.to_dict(), "friction": _friction(result)}


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
            "notes": [*content["notes"], *([_PULLED.format(pull)] if (pull := content["recipe"].get("pull")) else [])],
            "friction": task.known_friction if friction is None else friction_of(friction["text"], friction["file"]),
            "friction_entry": friction,
        }

    result = read_record(path, Identification, KIND, objects)
    with complete(path, KIND):
        count = len(result.names)
        estimate = result.estimate
        shapes = (estimate.values.shape, estimate.coefficients.shape, estimate.covariance.shape)
        if not all(result.names) or len(result.units) != count or shapes != ((count,), (count,), (count, count)):
            raise ValueError("parameters without a name")
        if not np.isfinite(result.coefficients).all() or not math.isfinite(result.training_error or 0.0):
            raise ValueError("expected finite numbers to predict with, and a finite error")
    return result


_FORMER = ("ridge", "total")  # estimators of older versions


def _recipe(content: dict[str, Any], estimator: Any, allowed: Collection[str]) -> Recipe:
    """Settings of a result, less those that only older versions had: its estimate is stored with it."""
    kept = {name: value for name, value in content.items() if name != "pull"}
    if estimator is None and "estimator" in kept:
        name = str(kept["estimator"])
        estimator = stored_part("estimator", "weighted" if name in _FORMER else name, allowed)
    return Recipe(**kept if estimator is None else {**kept, "estimator": estimator})


_EXPECTED = "expected a result or a design, or the folder of one"


def earlier_information(given: Any) -> EarlierInformation:
    """Information of an earlier experiment."""
    if isinstance(given, EarlierInformation):
        return given
    if isinstance(given, UnopenedFile):
        raise given.missing()
    if isinstance(given, str | Path):
        given = _loaded(Path(given))
    if isinstance(given, Identification):
        return _of_result(given)
    if isinstance(given, Design):
        return _of_design(given)
    raise InputError(f"`after`: {_EXPECTED}; given {type(given).__name__}")


def _loaded(path: Path) -> Identification | Design:
    if path.suffix == ".json":
        return load_design(path) if path.name == DESIGN else load_result(path)
    holds = [name for name in (RESULT, DESIGN) if (path / name).exists()]
    if len(holds) == 2:
        raise InputError(f"`after`: {path} holds a result and a design; name the file, such as {path / RESULT}")
    if not holds:
        raise InputError(f"`after`: {path} holds neither {RESULT} nor {DESIGN}; {_EXPECTED}")
    return load_result(path) if holds[0] == RESULT else load_design(path)


def _of_result(result: Identification) -> EarlierInformation:
    target = target_of(result.robot, result.task)
    if target.base.names != result.names:
        raise InputError(
            f"`after`: {result.name} has the parameters {', '.join(result.names)}, but its model has "
            f"{', '.join(target.base.names)} here; identify again from its logs"
        )
    R = _root(result)
    facts = result.facts
    density = facts.noise_density or _residual_density(result)
    return _earlier(
        result,
        target,
        kind=KIND,
        sha256=_hash(None if result.folder is None else result.folder / RESULT, (R,)),
        logs=tuple(sorted(result.training)),
        factors=(R,),
        equations=facts.equations,
        density=tuple(float(density[name]) for name, _ in facts.equations) if density else None,
        seconds=float(sum(log.end - log.start for log in facts.logs)),
        degrees_of_freedom=result.estimate.degrees_of_freedom,
        values=result.estimate.values,
    )


def _root(result: Identification) -> Array:
    """Rows R with ``R'R`` the inverse of the covariance of the parameters that are identified, others unknown."""
    C = result.estimate.covariance
    seen = np.flatnonzero(np.isfinite(np.diag(C)))
    R = np.zeros((seen.size, len(C)))
    try:
        L = np.linalg.cholesky(C[np.ix_(seen, seen)])
    except np.linalg.LinAlgError as error:
        raise InputError(
            f"`after`: the covariance of {result.name} is not positive definite, so that it states no information; "
            "identify with another estimator"
        ) from error
    R[:, seen] = scipy.linalg.solve_triangular(L, np.eye(seen.size), lower=True)
    return R


def _residual_density(result: Identification) -> dict[str, float] | None:
    """Density of the residuals as if they were white, of results that do not state that of their noise."""
    rates = np.array([log.rate for log in result.facts.logs])
    squares = result.estimate.noise**2 / rates[:, None]
    if not np.isfinite(squares).any(axis=0).all():
        return None
    names = (name for name, _ in result.equations)
    return dict(zip(names, np.sqrt(np.nanmean(squares, axis=0)).tolist(), strict=True))


def _of_design(design: Design) -> EarlierInformation:
    target, task = target_of(design.robot, design.task), design.task
    T = design.trajectory.duration
    samples = design.trajectory.samples(target.model.times(T, task.output.rate))
    labels = tuple(target.model.row_labels)
    W = target.model.assemble(samples)[:, target.base.index].reshape(-1, len(labels), target.base.rank)
    spacing = np.sqrt(T / len(W))
    factors = tuple(spacing * _full_rank_rows(W[:, j]) for j in range(len(labels)))
    noise = None if task.objective.noise is None else noise_per_row(task.objective.noise, target.model) * spacing
    return _earlier(
        design,
        target,
        kind="design",
        sha256=_hash(None if design.folder is None else design.folder / DESIGN, factors),
        logs=(),
        factors=factors,
        equations=labels,
        density=None if noise is None else tuple(float(x) for x in noise),
        seconds=float(T),
        degrees_of_freedom=residual_degrees_of_freedom(len(W) * len(labels), 0, len(labels)),
    )


def _full_rank_rows(W: Array) -> Array:
    """Triangular factor of rows, without rows of zeros."""
    R = np.asarray(np.linalg.qr(W, mode="r"))
    return np.ascontiguousarray(R[np.any(R != 0.0, axis=1)])


def _earlier(subject: Any, target: IdentificationTarget, **parts: Any) -> EarlierInformation:
    definition, names = target.model.definition()
    return EarlierInformation(
        name=subject.name,
        robot=subject.robot.name,
        robot_sha256=subject.robot.sha256(),
        geometry=geometry(target.robot),
        payload=payload_text(subject.task),
        parameters=names,
        A=np.ascontiguousarray(target.base.D @ definition),  # sums round alike when it is read back
        **parts,
    )


def _hash(file: Path | None, factors: tuple[Array, ...]) -> str:
    """Hash of a file, or of the information of what was not read from one."""
    if file is not None and file.exists():
        return str(sha256_of(file))
    return hashlib.sha256(b"".join(np.ascontiguousarray(F).tobytes() for F in factors)).hexdigest()
