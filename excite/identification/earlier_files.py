"""Information in hand from earlier results and designs: read from their folders, or from the objects themselves."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg

from excite.design.design import Design
from excite.design.design_folder import DESIGN as DESIGN_FILE
from excite.design.design_json import load_design
from excite.identification.identification import Identification
from excite.identification.result_json import RESULT as RESULT_FILE
from excite.identification.result_json import load_result
from excite.information.earlier_precision import geometry, payload_text
from excite.information.half_widths import residual_degrees_of_freedom
from excite.information.matrix import noise_per_row
from excite.information.target import IdentificationTarget, target_of
from excite.storage.manifest import sha256_of
from excite.tasks.stored_files import DESIGN, RESULT, EarlierInformation, UnopenedFile
from regressors.errors import InputError
from regressors.samples import Array

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
        return load_design(path) if path.name == DESIGN_FILE else load_result(path)
    holds = [name for name in (RESULT_FILE, DESIGN_FILE) if (path / name).exists()]
    if len(holds) == 2:
        raise InputError(f"`after`: {path} holds a result and a design; name the file, such as {path / RESULT_FILE}")
    if not holds:
        raise InputError(f"`after`: {path} holds neither {RESULT_FILE} nor {DESIGN_FILE}; {_EXPECTED}")
    return load_result(path) if holds[0] == RESULT_FILE else load_design(path)


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
        kind=RESULT,
        sha256=_hash(None if result.folder is None else result.folder / RESULT_FILE, (R,)),
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
        kind=DESIGN,
        sha256=_hash(None if design.folder is None else design.folder / DESIGN_FILE, factors),
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
