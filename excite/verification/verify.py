"""Verify a result on a log that was not used to identify: predicted torques, simulated motion, and a verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from excite.identification.given_logs import log_of
from excite.identification.known_friction import known_temperatures, mean_friction
from excite.identification.prediction import instantaneous_target, prediction, relative_error
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.recipe import AUTO, Recipe
from excite.identification.result import IdentificationResult
from excite.identification.saturated_rows import LEFT_OUT
from excite.information.target import IdentificationTarget
from excite.logs.log import Log
from excite.logs.mapping import LogMapping, read_mapping
from excite.simulation.replay import Replay, windowed_motion
from excite.verification.predicted_torques import torque_errors
from excite.verification.simulated_motion import failure, motion_errors
from excite.verification.verdict import Tolerances, verdict
from excite.verification.verification import Verification
from regressors.errors import InputError

HORIZON = 0.5


def verify(
    result: IdentificationResult,
    log: Log | str | Path | Any,
    *,
    mapping: LogMapping | str | Path | None = None,
    drop: Iterable[str] = (),
    rows: str | None = None,
    tolerances: Tolerances | None = None,
    horizon: float = HORIZON,
    signals: str | None = None,
    temperature: tuple[float, ...] | None = None,
    training_too: bool = False,
) -> Verification:
    """Verify a result on a log.

    Parameters
    ----------
    result : IdentificationResult
        Just identified, or loaded.
    log : Log, path or Simulation
    mapping : LogMapping or path, optional
        How a foreign file is laid out.
    drop : iterable of str
        Faulty rows of a file to leave out, see `excite.logs.log_reading.read_log`.
    rows : str, optional
        Which rows, see `Recipe`; found if not given.
    tolerances : Tolerances, optional
    horizon : float
        Time after which the simulated motion restarts from the measured state [s].
    signals : str, optional
        Registered method from positions to velocities and accelerations; that of the result if not given.
    temperature : tuple of float, optional
        Of the joints, where the log has none, see `Recipe`; that of the result if not given [deg C].
    training_too : bool
        Accept a log that the result was identified from.

    Raises
    ------
    InputError
        A log that the result was identified from, or that does not fit its robot; a horizon that is not positive.
    """
    if not (math.isfinite(horizon) and horizon > 0):
        raise InputError(f"horizon must be a positive number of seconds, given {horizon:g}")
    layout = read_mapping(Path(mapping)) if isinstance(mapping, str | Path) else mapping
    log = log_of(log, result.robot, layout, tuple(drop))
    if log.sha256 in result.training and not training_too:
        raise InputError(
            f"{log.source} is a log that the result was identified from: it cannot show whether the result holds "
            f"elsewhere; take another one, or allow it with `training_too`"
        )
    tolerances = tolerances if tolerances is not None else Tolerances()
    recipe = _recipe(result.recipe, rows, signals)
    if temperature is not None:
        if result.friction is None:
            raise InputError(
                f"`temperature` is for known friction, but {result.name} was identified without friction curves"
            )
        recipe = replace(recipe, temperature=temperature)
    target = judging_target(result)
    part = prepare(log, result.robot, target, recipe)
    samples, equations = part.samples, target.model.row_labels
    predicted = prediction(target, part, recipe, result.coefficients, result.friction)
    errors = torque_errors(predicted.time, predicted.measured, predicted.predicted, predicted.speed, equations)
    replay = _replayed(target, result, part, horizon)
    motions = None
    if replay is not None and replay.ok:
        motions = motion_errors(replay, samples, {j.name: j.unit for j in target.robot.joints})
    total = relative_error(predicted.measured, predicted.predicted)
    failed = None if replay is None else failure(replay)
    judged = verdict(errors, total, result.training_error, motions, failed, tolerances)
    if result.friction is not None:
        temperatures = known_temperatures(part, target.robot, result.friction, recipe)
        faster = result.friction.speed_notes(target.robot, samples.dq)
        judged = replace(judged, remarks=(*judged.remarks, *temperatures, *faster))
    if part.saturated:
        judged = replace(judged, remarks=(*judged.remarks, *(note for note in part.notes if note.startswith(LEFT_OUT))))
    return Verification(
        robot=result.robot,
        tolerances=tolerances,
        prepared=part,
        equations=equations,
        time=predicted.time,
        measured=predicted.measured,
        predicted=predicted.predicted,
        torques=errors,
        relative_error=total,
        training_error=result.training_error,
        replay=replay,
        motions=motions,
        verdict=judged,
    )


def judging_target(result: IdentificationResult) -> IdentificationTarget:
    """Identification target that predicts the measurements at every instant, in the result's parameters.

    Raises
    ------
    InputError
        The model's base parameters are not those of the result.
    """
    target = instantaneous_target(result.robot, result.task, result.recipe)
    if target.base.names != result.names:
        raise InputError(
            f"{result.name}: its model has the parameters {', '.join(target.base.names)}, "
            f"but the result has {', '.join(result.names)}"
        )
    return target


def _recipe(recipe: Recipe, rows: str | None, signals: str | None) -> Recipe:
    """Recipe of the result without the settings that belong to the logs that it was identified from."""
    recipe = replace(recipe, rows=rows or AUTO, average=False, period=None, harmonics=None, low_pass=None, every=None)
    return recipe if signals is None else replace(recipe, signals=signals, cutoff=None)


def _replayed(
    target: IdentificationTarget, result: IdentificationResult, part: PreparedLog, horizon: float
) -> Replay | None:
    """Simulated motion of the models of torques that have an equation for every moving coordinate."""
    model = target.model
    equations = model.torque_equations()
    if equations is None or equations.unused:
        return None
    samples = part.samples
    friction = None if result.friction is None else mean_friction(result.friction, target.robot, part.temperature)
    horizon = min(horizon, float(samples.time[-1] - samples.time[0]))

    def replayed(width: float | None) -> Replay:
        return windowed_motion(
            model, result.coefficients, target.base, samples.time, part.measured, samples.q, samples.dq, horizon,
            friction=friction, sign_width=width,
        )  # fmt: skip

    try:
        return replayed(result.recipe.common_width or None)
    except InputError:  # so sharp a sign change takes too many steps: use the sharpest that does not
        return replayed(None)
