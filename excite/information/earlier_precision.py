"""Information in hand of a model's base parameters, from earlier results and designs.

An earlier experiment tells of its base parameters ``b = A_e u`` of standard parameters u, as rows R with the
information ``R'R``. With the base ``beta = A u`` of the model that is designed for, ``A_e = L A + E`` splits into what
beta determines and what it does not; the latter, g, is a nuisance that all earlier experiments share. The information
of beta alone is the Schur complement ``P = X'X - X'Y (Y'Y)^-1 Y'X`` of all rows ``X beta + Y g`` [Pukelsheim 2006,
section 3.11]. It adds to the information of the measurements, as prior knowledge does.

[Pukelsheim 2006] F. Pukelsheim, "Optimal Design of Experiments", SIAM.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from excite.information.matrix import noise_per_row
from excite.information.target import IdentificationTarget
from excite.registry import name_of
from excite.tasks.stored_files import DESIGN, RESULT, EarlierInformation
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.numerical import column_lengths
from regressors.robot.robot import Robot
from regressors.samples import Array

_ROUNDING = 1e-9  # of the entries of A: smaller ones are zero
_HIDDEN = 1e-6  # component of a direction that is not determined, in columns of length one


def geometry(robot: Robot) -> str:
    """Hash of what a robot's parameters mean: joints, bodies and drives, neither limits nor values."""
    described: Any = robot.description()
    drives = (described["transmission"] or {}).get("drives", ())
    content = {
        "joints": described["joints"],
        "bodies": list(robot.body_numbers),
        "branches": [{**branch, "link": branch["link"]["name"]} for branch in described.get("branches", ())],
        "coupling": (described["transmission"] or {}).get("coupling"),
        "drives": [[drive["name"], drive["ratio"], drive["rests"]] for drive in drives],
        "structure": described["structure"],
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def check_earlier(earlier: Sequence[EarlierInformation], robot: Robot, moving: Robot, task: Task) -> None:
    """Raise `InputError` where earlier information is about other parameters, or counts the same data twice."""
    payload = payload_text(task)
    for one in earlier:
        if one.robot_sha256 != robot.sha256() and one.robot != robot.name:
            raise InputError(f"`after`: {one.name} is of the robot {one.robot}, this task is for {robot.name}")
        if one.geometry != geometry(moving):
            raise InputError(
                f"`after`: the parameters of {one.name} are those of other bodies: its geometry or its locked joints "
                f"differ; expected {robot.name} as described here, with {', '.join(moving.joint_names)} moving"
            )
        if one.payload != payload:
            raise InputError(
                f"`after`: in {one.name} the robot carries {one.payload or 'nothing'}, in this task "
                f"{payload or 'nothing'}; give the same `payload`"
            )
    results = [one for one in earlier if one.kind == RESULT]
    logs = Counter(log for one in results for log in set(one.logs))
    for one in results:
        if any(logs[log] > 1 for log in one.logs):
            others = ", ".join(x.name for x in results if set(x.logs) & set(one.logs))
            raise InputError(f"`after`: results of the same log count it twice: {others}; give each log's result once")


def payload_text(task: Task) -> str | None:
    """What a task's robot carries, as text."""
    payload = task.installation.payload
    if payload is None or isinstance(payload, str):
        return payload
    return ",".join(f"{x:g}" for x in payload) if isinstance(payload, tuple) else str(payload)


def noise_in_hand(earlier: Sequence[EarlierInformation], model: RegressorModel, task: Task) -> tuple[float, ...] | None:
    """Noise of the rows of a task: as stated, else as results have measured it, else as designs state it.

    The density of the noise is kept, so that rows of another rate have another standard deviation.
    """
    if task.objective.noise is not None:
        return task.objective.noise
    measured = [one for one in earlier if one.kind == RESULT and one.density is not None]
    stated = [one for one in earlier if one.kind == DESIGN and one.density is not None]
    fitting = [one for one in measured or stated if one.equations == model.row_labels]
    if measured and not fitting:
        theirs = ", ".join(f"{name} [{unit}]" for name, unit in measured[0].equations)
        raise InputError(
            f"`after`: {measured[0].name} has measured the noise of the equations {theirs}, not that of the "
            f"{name_of(task.model.model)} model's equations here; give `noise`"
        )
    if not fitting:
        return None
    weights = np.array([float(max(one.degrees_of_freedom, 1)) for one in fitting])  # as variances are pooled
    squares = np.array([one.density for one in fitting]) ** 2
    density = np.sqrt(weights @ squares / weights.sum())
    return tuple(float(x) for x in density / np.sqrt(_interval(model, task)))


def densities(model: RegressorModel, task: Task) -> dict[str, float]:
    """Density of the noise of each equation of a task by name: of a row, times the root of the time between rows."""
    noise = noise_per_row(task.objective.noise, model) * np.sqrt(_interval(model, task))
    return {name: float(x) for (name, _), x in zip(model.row_labels, noise, strict=True)}


def _interval(model: RegressorModel, task: Task) -> float:
    """Time between rows [s]."""
    period = task.trajectory.period
    return float(period / model.row_times(model.times(period, task.output.rate)).size)


@dataclass(frozen=True, eq=False)
class InformationInHand:
    """What earlier experiments together tell of the base parameters of a task."""

    R: Array  # (k, b) rows with the information ``R'R``
    degrees_of_freedom: int  # of the noise that they have estimated, or will
    values: Array  # (b,) estimate by the results among them; NaN where there is none


def information_in_hand(target: IdentificationTarget, task: Task) -> InformationInHand | None:
    """What is in hand; None where a task names no earlier experiment."""
    earlier = task.objective.after
    if not earlier:
        return None
    freedom = sum(one.degrees_of_freedom for one in earlier)
    return InformationInHand(earlier_root(target, task), freedom, earlier_estimate(target, task))


def earlier_root(target: IdentificationTarget, task: Task) -> Array:
    """Rows R with the information in hand ``P = R'R`` of the base parameters of a task, shape (k, b)."""
    return _rows_of_base(target, task, task.objective.after)[0]


def earlier_estimate(target: IdentificationTarget, task: Task) -> Array:
    """Base parameters by all earlier results of a task together; NaN where there is none, shape (b,)."""
    R, y = _rows_of_base(target, task, [one for one in task.objective.after if one.kind == RESULT])
    known = np.isfinite(deviations_of(R))
    values = np.full(target.base.rank, np.nan)
    if known.any():
        size = column_lengths(R)
        values[known] = (np.linalg.lstsq(R / size, y, rcond=_ROUNDING)[0] / size)[known]
    return values


def _rows_of_base(target: IdentificationTarget, task: Task, given: Sequence[EarlierInformation]) -> tuple[Array, Array]:
    """Rows R and right-hand side y with ``R beta = y`` of noise 1, nuisance left out; y counts for results only."""
    b = target.base.rank
    earlier = sorted(given, key=lambda one: b"".join(F.tobytes() for F in one.factors))  # so that sums round alike
    if not earlier:
        return np.zeros((0, b)), np.zeros(0)
    definition, names = target.model.definition()
    union = {name: k for k, name in enumerate(dict.fromkeys((*names, *(n for one in earlier for n in one.parameters))))}
    A = _in_union(target.base.D @ definition, names, union)
    inverse, known = np.linalg.pinv(A), densities(target.model, task)
    own, beyond, rows, right = [], [], [], []
    for one in earlier:
        theirs = _in_union(one.A, one.parameters, union)
        own.append(_without_rounding(theirs @ inverse))
        beyond.append(_without_rounding(theirs - own[-1] @ A))
        rows.append(np.vstack(one.rows(known)))
        right.append(rows[-1] @ np.nan_to_num(np.zeros(len(one.A)) if one.values is None else one.values))
    G = scipy.linalg.orth(np.vstack(beyond).T, rcond=_ROUNDING)  # directions of u beyond beta
    X = np.vstack([R @ L for R, L in zip(rows, own, strict=True)])
    Y = np.vstack([R @ E @ G for R, E in zip(rows, beyond, strict=True)])
    y = np.concatenate(right)
    if Y.shape[1]:
        Q = scipy.linalg.orth(Y)
        X, y = X - Q @ (Q.T @ X), y - Q @ (Q.T @ y)
    R = np.asarray(np.linalg.qr(np.column_stack([X, y]), mode="r"))
    return np.ascontiguousarray(R[:b, :b]), np.ascontiguousarray(R[:b, b])


def _in_union(A: Array, names: Sequence[str], union: Mapping[str, int]) -> Array:
    wide = np.zeros((len(A), len(union)))
    wide[:, [union[name] for name in names]] = A
    return wide


def _without_rounding(A: Array) -> Array:
    return np.where(np.abs(A) > _ROUNDING * np.abs(A).max(initial=1.0), A, 0.0)


def deviations_of(R: Array) -> Array:
    """Standard deviations ``sqrt(diag((R'R)^-1))``; infinite where R does not determine one, shape (b,)."""  # R (k, b)
    size = column_lengths(R)
    _, s, Vt = np.linalg.svd(np.linalg.qr(R / size, mode="r"))
    seen = np.count_nonzero(s > _ROUNDING * s.max(initial=0.0))
    half = Vt[:seen].T / s[:seen]
    deviation = np.linalg.norm(half, axis=1) / size
    return np.where(np.any(np.abs(Vt[seen:]) > _HIDDEN, axis=0), np.inf, deviation)
