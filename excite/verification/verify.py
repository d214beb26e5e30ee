"""Verify a result on a log that was not used to identify: predicted torques, simulated motion, and a verdict."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.identification.choices.cutoff_and_rows import HIGHEST
from excite.identification.doubts import answers
from excite.identification.equations import nearest
from excite.identification.identification import Identification, stated_covariance
from excite.identification.identify import check_rows
from excite.identification.large_residual import with_external_forces
from excite.identification.log_faults import load_that_explains
from excite.identification.prediction import (
    LogPrediction,
    best_within_region,
    known_temperatures,
    mean_friction,
    prediction,
    relative_error,
)
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.procedure import log_of
from excite.identification.recipe import AUTO, Recipe
from excite.identification.result_json import load_result
from excite.information.target import IdentificationTarget, least_speeds
from excite.logs.base_motion import measured_equations
from excite.logs.event import LEFT_OUT
from excite.logs.log import Log
from excite.logs.mapping import LogMapping, read_mapping
from excite.logs.signals.method import interpolated
from excite.logs.signals.periods import mean_rate, measurement_noise, motion_ends
from excite.simulation.replay import Replay, windowed_motion
from excite.tasks.further_settings import Tolerances
from excite.verification.simulated_motion import (
    SAMPLE,
    WHOLE,
    longest_replay,
    most_windows,
    motion_errors,
    motion_remarks,
    shortest_horizon,
)
from excite.verification.verdict import (
    CorrectedError,
    TorqueError,
    Verdict,
    at_standstill,
    corrected_errors,
    in_motion,
    torque_errors,
    verdict,
)
from excite.verification.verification import MeasuredMotion, Verification, VerifiedLog
from regressors.arguments import checked
from regressors.errors import InputError, cut, percent
from regressors.numerical import numerical_work, one_thread
from regressors.quantities import check
from regressors.work_prediction import announce

HORIZON = 0.5
_MOSTLY = 0.8  # of the error arises in motion, or it is said how much


@checked
@one_thread()
@numerical_work(
    "the verification",
    "rows that hardly move, or numbers of very different sizes are the likely cause: "
    "check the units of the log and `rows`",
)
def verify(
    result: Identification | str | Path,
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

    Torques are predicted in all rows. The motion of a log of up to 60 s is simulated as a whole; of longer logs, in
    windows that are spread evenly over the log, see `excite.verification.simulated_motion.most_windows`.

    Parameters
    ----------
    result : Identification or path
        Just identified or loaded, or its folder.
    log : Log, frame, dict of columns, path or Simulation
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
    check("horizon", horizon)
    result = load_result(result) if isinstance(result, str | Path) else result
    recipe = _recipe(result, rows, signals, temperature)
    mapping = read_mapping(mapping) if isinstance(mapping, str | Path) else mapping
    log = log_of(log, result.robot, mapping, tuple(drop), recipe.row_numbers)
    slower = recipe.cutoff is not None and recipe.cutoff > HIGHEST * log.rate
    recipe = replace(recipe, cutoff=HIGHEST * log.rate) if slower else recipe
    check_rows("the verification", [log])
    if log.sha256 in result.training and not training_too:
        raise InputError(
            f"{log.source} is a log that the result was identified from: it cannot show whether the result holds "
            f"elsewhere; take another one, or allow it with `training_too`"
        )
    target = _as_measured(judging_target(result), mapping)
    simulated = target.model.torque_equations() is not None
    announce(f"the verification on {cut(log.source)}", verification_seconds(log, simulated=simulated))
    part = prepare(with_external_forces(result.robot, target, log, recipe), result.robot, target, recipe)
    predicted = prediction(target, part, recipe, result.coefficients, result.friction)
    tolerances = tolerances if tolerances is not None else Tolerances()
    replay, length = _replayed(target, result, part, horizon)
    above = motion_ends(part.samples.q, mean_rate(part.samples.time))
    still = _still(target, part, predicted, recipe)
    compared = errors, corrected, total, whole = _errors(target, predicted, above, still)
    free = ~predicted.left_out  # rows about which nothing happened
    event_free = relative_error(predicted.measured[free], predicted.predicted[free])
    units = {j.name: j.unit for j in target.robot.joints}
    motions = motion_errors(replay, part.samples, units) if replay is not None and replay.ok else None
    doubted = tuple(f"{doubt.what}: {doubt.cause}" for doubt in result.doubts)
    further = result.training_error, motions or (), doubted, tolerances
    judged = verdict(*compared, *further)
    explained = all(doubt.about == "bodies" for doubt in result.doubts)  # else its covariance says nothing
    if judged.contradicted and explained and stated_covariance(result) is not None:
        best, decisive = best_within_region(result.estimate, target, part, recipe, predicted)
        within = _errors(target, prediction(target, part, recipe, best, result.friction), above, still)
        judged = judged.within_region(verdict(*within, *further), decisive)
    remarks = (
        *judged.remarks,
        *motion_remarks(replay, length, horizon),
        *_friction_remarks(result, target, part, recipe),
        *_event_remarks(part, predicted, event_free),
        *([f"positions are low-passed at {recipe.cutoff:.3g} Hz, since this log has fewer rows"] if slower else []),
    )
    return Verification(
        robot=result.robot,
        log=VerifiedLog.of(part),
        tolerances=tolerances,
        time=predicted.time,
        measured=predicted.measured,
        predicted=predicted.predicted,
        motion=MeasuredMotion(tuple(part.log.joints), part.samples.time, part.samples.q),
        torques=errors,
        relative_error=total,
        training_error=result.training_error,
        replay=replay,
        motions=motions,
        verdict=replace(
            judged,
            against=(*judged.against, *_other_load(target, part, predicted, judged)),
            remarks=remarks,
            answers=(_torques_answer(judged, whole, in_motion(errors), tolerances), *answers(result)),
        ),
        corrected=corrected,
        corrected_total=whole,
        event_free_error=event_free,
        horizon=length,
    )


def _still(
    target: IdentificationTarget, part: PreparedLog, predicted: LogPrediction, recipe: Recipe
) -> NDArray[np.bool_]:
    """Where friction may hold a drive, as the identification has it, shape (N, r)."""
    still = at_standstill(predicted.speed)
    if not recipe.standstill:
        return still
    slow = least_speeds(target, part.samples) < recipe.standstill
    return still | slow[nearest(part.samples.time, predicted.time)]


def _errors(
    target: IdentificationTarget, predicted: LogPrediction, above: float, still: NDArray[np.bool_]
) -> tuple[tuple[TorqueError, ...], tuple[CorrectedError, ...], float, CorrectedError]:
    """Errors of every equation, without noise too, and the same two over all equations."""
    measured, torques = predicted.measured, predicted.predicted
    noise = measurement_noise(measured, measured - torques, mean_rate(predicted.time), above)
    corrected, whole = corrected_errors(measured, torques, noise)
    errors = torque_errors(predicted.time, measured, torques, still, target.model.row_labels)
    return errors, corrected, relative_error(measured, torques), whole


def _other_load(
    target: IdentificationTarget, part: PreparedLog, predicted: LogPrediction, judged: Verdict
) -> tuple[str, ...]:
    """The load that the log has and the result lacks, or the reverse, where that explains what contradicts."""
    if judged.holds or (judged.unknown and not judged.contradicted):
        return ()
    rows = (predicted.measured, predicted.measured - predicted.predicted)
    measured, error = (interpolated(part.samples.time, predicted.time, values) for values in rows)
    load = load_that_explains(target, part.samples, error, measured)
    if load is None:
        return ()
    mass, text = load
    whose = "this log has it, and the result lacks it" if mass > 0 else "the result has it, and this log lacks it"
    return (f"{text}; {whose}: verify with a log of the same load, or identify again",)


def _torques_answer(judged: Verdict, whole: CorrectedError, moving: float, tolerances: Tolerances) -> str:
    """Whether the torques of the log are predicted, and within what."""
    within = f"torques: off by {percent(whole.relative)} of what was measured, apart from noise"
    if moving < _MOSTLY and whole.relative > tolerances.torque / 2:
        within += f", and by {percent(whole.relative * moving)} in motion"
    if not (judged.contradicted or judged.undecided or judged.unknown):
        return f"{within}; every joint is confirmed"
    verbs = ("confirmed for", "contradicted for", "not to be judged for", "not known for")
    named = zip(verbs, (judged.confirmed, judged.contradicted, judged.undecided, judged.unknown), strict=True)
    return "; ".join([within, *(f"{verb} {', '.join(names)}" for verb, names in named if names)])


def _friction_remarks(
    result: Identification, target: IdentificationTarget, part: PreparedLog, recipe: Recipe
) -> tuple[str, ...]:
    """At which temperatures and speeds known friction was used."""
    if result.friction is None:
        return ()
    temperatures = known_temperatures(part, target.robot, result.friction, recipe)
    return (*temperatures, *result.friction.speed_notes(target.robot, part.samples.dq))


def _event_remarks(part: PreparedLog, predicted: LogPrediction, event_free: float) -> tuple[str, ...]:
    """Which rows events leave out, and the error without them."""
    if not part.left_out:
        return ()
    found = [note for note in part.notes if note.startswith(LEFT_OUT)]
    if np.any(predicted.left_out):
        found.append(f"without these rows predictions miss {percent(event_free, 3)}")
    return tuple(found)


def judging_target(result: Identification) -> IdentificationTarget:
    """Identification target that predicts the measurements at every instant, in the result's parameters."""
    target = result.target_of_instants
    if target.base.names != result.names:
        raise InputError(
            f"{result.name}: its model has the parameters {', '.join(target.base.names)}, "
            f"but the result has {', '.join(result.names)}"
        )
    return target


def _as_measured(target: IdentificationTarget, mapping: LogMapping | None) -> IdentificationTarget:
    """The target with those of its equations whose efforts a log has by its mapping."""
    used = [name for name, _ in target.model.row_labels]
    measured = measured_equations(mapping, target.robot)
    kept = used if measured is None else [name for name in used if name in measured]
    if not kept:
        measured_equations(mapping, target.robot, used)  # which says what is missing
    return target if kept == used else replace(target, model=target.model.restricted(target.motion, kept))


def _recipe(
    result: Identification, rows: str | None, signals: str | None, temperature: tuple[float, ...] | None
) -> Recipe:
    """Recipe of the result without the settings that belong to the logs that it was identified from."""
    if temperature is not None and result.friction is None:
        raise InputError(
            f"`temperature` is for known friction, but {result.name} was identified without friction curves"
        )
    recipe = replace(
        result.recipe, rows=rows or AUTO, average=False, period=None, harmonics=None, low_pass=None, every=None
    )
    if signals is not None:
        velocities = recipe.measured_velocity and not recipe.signals_chosen
        recipe = replace(recipe, signals=signals, cutoff=None, measured_velocity=velocities, signals_chosen=False)
    return recipe if temperature is None else replace(recipe, temperature=temperature)


def _replayed(
    target: IdentificationTarget, result: Identification, part: PreparedLog, horizon: float
) -> tuple[Replay | None, float | None]:
    """Simulated motion of the models of torques that have an equation for every moving coordinate, and its horizon."""
    model, samples = target.model, part.samples
    equations = model.torque_equations()
    if equations is None or equations.unused:
        return None, None
    friction = None if result.friction is None else mean_friction(result.friction, target.robot, part.temperature)
    duration = float(samples.time[-1] - samples.time[0])

    def replayed(length: float, width: float | None) -> Replay:
        return windowed_motion(
            model, result.coefficients, target.base, samples.time, part.measured, samples.q, samples.dq, length,
            friction=friction, sign_width=width, most=most_windows(duration, length),
        )  # fmt: skip

    def simulate(length: float) -> Replay:
        try:
            return replayed(length, result.recipe.common_width or None)
        except InputError:  # so sharp a sign change takes too many steps: use the sharpest that does not
            return replayed(length, None)

    return longest_replay(simulate, min(horizon, duration), shortest_horizon(samples.time))


_REPLAYS = 2.0  # from one to half a dozen: the horizon is halved until the motion does not diverge
_ONE, _ROW = 3e-3, 3.6e-7  # seconds of a simulated motion for each joint to the third power, and of each row of it
_EQUATIONS = 5e-7  # seconds of the predicted torques for each row and pair of joints


def verification_seconds(log: Log, *, simulated: bool) -> float:
    """Time of a verification on one core, without figures [s]; right within a factor of four.

    The unit that it grows with is one evaluation of the equations of motion, whose instructions grow with the third
    power of the joints; there are about sixteen of them to a row. Measured with 1000 to 20,000 rows of 6 and 7 joints;
    robots with parallel axes take less, and a light wrist, for which the motion restarts often, takes more. Of a log
    longer than `WHOLE`, no more than `SAMPLE` is simulated.
    """
    joints, duration = len(log.joints), float(log.time[-1] - log.time[0])
    seconds = 0.1 + _EQUATIONS * log.count * joints**2
    rows = log.count if duration <= WHOLE else log.count * SAMPLE / duration
    return float(seconds + simulated * _REPLAYS * (_ONE + _ROW * rows) * joints**3)
