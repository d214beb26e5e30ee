"""A result on a log that was not used to identify: predicted torques, simulated motion, and a verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from excite.files.result_json import StoredResult
from excite.identify.preparation import Prepared, measured_channel, prepared
from excite.identify.regressor import measured_regressor
from excite.logs.log import Log
from excite.simulate.replay import Replay, windowed_motion
from excite.subject import Subject, subject_of
from excite.task import Task
from excite.verify.motion import MotionError, failure, motion_errors
from excite.verify.torques import TorqueError, overall, torque_errors
from excite.verify.verdict import Tolerances, Verdict, verdict
from regressors.differential import DifferentialModel
from regressors.errors import InputError
from regressors.friction import FrictionCurves
from regressors.partial import PartialModel
from regressors.samples import Array

HORIZON = 0.5
_POINTWISE = {"energy": "differential", "load-integral": "load"}


@dataclass(frozen=True, eq=False)
class Verification:
    """What a result makes of one log.

    Parameters
    ----------
    prepared : Prepared
    equations : tuple of (str, str)
    time : ndarray, shape (N,)
        Instants at which the log has measurements [s].
    measured, predicted : ndarray, shape (N, r)
        At those instants; measured ones as recorded, not filtered [units of the equations].
    torques : tuple of TorqueError
    relative_error : float
        Over all equations.
    training_error : float or None
        The same on the logs that the result was identified from.
    replay : Replay or None
        The simulated motion; None where the model has none.
    motions : tuple of MotionError, or None
        None where there is no motion, or where it failed.
    verdict : Verdict
    """

    prepared: Prepared
    equations: tuple[tuple[str, str], ...]
    time: Array
    measured: Array
    predicted: Array
    torques: tuple[TorqueError, ...]
    relative_error: float
    training_error: float | None
    replay: Replay | None
    motions: tuple[MotionError, ...] | None
    verdict: Verdict


def verified(
    result: StoredResult,
    log: Log,
    *,
    rows: str | None = None,
    tolerances: Tolerances | None = None,
    horizon: float = HORIZON,
    friction: FrictionCurves | None = None,
    training_too: bool = False,
) -> Verification:
    """Judge a result on a log.

    Parameters
    ----------
    result : StoredResult
    log : Log
        As read.
    rows : str, optional
        Which rows, see `Recipe`; found if not given.
    tolerances : Tolerances, optional
    horizon : float
        After so long the simulated motion starts anew from the measured state [s].
    friction : FrictionCurves, optional
        Those that were subtracted when the result was identified.
    training_too : bool
        Accept a log that the result was identified from.

    Raises
    ------
    InputError
        A log that the result was identified from, or that does not fit its robot.
    """
    if log.sha256 in result.training and not training_too:
        raise InputError(
            f"{log.source} is a log that the result was identified from: it cannot show whether the result holds "
            f"elsewhere; take another one, or allow it with --training-too"
        )
    recipe = replace(result.recipe, rows=rows or "auto", average=False, low_pass=None, every=None)
    subject = judging_subject(result)
    part = prepared(log, result.robot, subject, recipe)
    model, samples = subject.model, part.samples
    r = len(model.row_labels)
    W = measured_regressor(subject, samples, recipe.breakaway or 0.0)
    predicted = (W @ result.coefficients).reshape(-1, r)
    if friction is not None:
        known = friction.joint_torque(subject.robot, samples.q, samples.dq)
        predicted = predicted + model.right_side(samples, known).reshape(-1, r)
    time, measured = _recorded(subject, part)
    predicted, speed = (_at(time, samples.time, values) for values in (predicted, _speeds(subject, part)))
    errors = torque_errors(time, measured, predicted, speed, model.row_labels)
    replay = _replayed(subject, result, part, horizon, friction)
    motions = None
    if replay is not None and replay.ok:
        motions = motion_errors(replay, samples, {j.name: j.unit for j in subject.robot.joints})
    total, failed = overall(measured, predicted), None if replay is None else failure(replay)
    judged = verdict(errors, total, result.training_error, motions, failed, tolerances or Tolerances())
    return Verification(
        part, model.row_labels, time, measured, predicted, errors, total, result.training_error, replay, motions, judged
    )


def judging_subject(result: StoredResult) -> Subject:
    """Model that predicts what was measured at every instant, in the result's parameters.

    Raises
    ------
    InputError
        The model's base parameters are not those of the result.
    """
    task: Task = replace(result.task, model=_POINTWISE.get(result.task.model, result.task.model))
    subject = subject_of(result.robot, task, result.recipe.sign_width or 0.0)
    if subject.base.names != result.names:
        raise InputError(
            f"the {task.model} model has the parameters {', '.join(subject.base.names)}, "
            f"the result has {', '.join(result.names)}"
        )
    return subject


def _recorded(subject: Subject, part: Prepared) -> tuple[Array, Array]:
    """Instants of the log within the motion, and what was measured at them, shape (N, r)."""
    log, samples = part.log, part.samples
    within = (log.time >= samples.time[0]) & (log.time <= samples.time[-1])
    y = subject.model.right_side(samples, measured_channel(log, subject)[within])
    return log.time[within], y.reshape(-1, len(subject.model.row_labels))


def _at(time: Array, known: Array, values: Array) -> Array:
    """Values between their instants, linearly, shape (N, r)."""
    return np.column_stack([np.interp(time, known, column) for column in values.T])


def _speeds(subject: Subject, part: Prepared) -> Array:
    model, dq = subject.model, part.samples.dq
    if isinstance(model, PartialModel):
        return np.asarray(dq @ np.linalg.pinv(model.motion.matrix)[model.used].T)
    if isinstance(model, DifferentialModel):
        return dq
    return np.full((dq.shape[0], len(model.row_labels)), np.nan)


def _replayed(
    subject: Subject, result: StoredResult, part: Prepared, horizon: float, friction: FrictionCurves | None
) -> Replay | None:
    """Simulated motion of the models of torques that have an equation for every moving coordinate."""
    model = subject.model
    whole = isinstance(model, DifferentialModel) or (
        isinstance(model, PartialModel) and len(model.used) == len(model.motion.labels)
    )
    if not whole:
        return None
    samples = part.samples
    return windowed_motion(
        model,
        result.coefficients,
        subject.base,
        samples.time,
        part.measured,
        samples.q,
        samples.dq,
        min(horizon, float(samples.time[-1] - samples.time[0])),
        friction=friction,
        sign_width=result.recipe.sign_width or None,
    )
