"""Mass, centre and inertia of what a robot holds, from logs."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from excite.identification.identification import Identification
from excite.identification.prediction import instantaneous_target, without_friction
from excite.identification.preparation import drives_of_torques, prepare
from excite.identification.procedure import LogLike
from excite.identification.result import provenance_of
from excite.identification.result_json import load_result
from excite.information.target import target_of
from excite.logs.log import Log
from excite.payload.held_body import RATED, Frame, frame_numbers
from excite.payload.known_gains import KnownGains, read_gains, stated_gains
from excite.payload.load_estimate import LoadEquations, LoadEstimate, estimate_load
from excite.payload.load_rows import (
    LIKELY_CAUSE,
    LogChoice,
    bare_task,
    calibrated_gains,
    check_pair,
    loaded_parts,
    modelled_equations,
    paired_equations,
    size_of,
    without_load,
    wrench_equations,
)
from excite.payload.payload_result import PayloadResult
from excite.tasks.installation import Installation
from excite.tasks.robot_of_task import robot_and_task
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import InputError, percent
from regressors.models.load import LoadModel, Sensor
from regressors.numerical import numerical_work, one_thread
from regressors.quantities import Tips, check
from regressors.robot.inertia import rotation_from_rpy
from regressors.robot.robot import Robot

_UNLIKE = 3.0  # times as large as without the load: residuals that the load does not explain
_UNEXPLAINED = 0.3  # of what varies, in the middle one of the equations
_LEAST_KNOWN = 0.5  # half of the mass's interval over the mass, from which on it counts as not shown
_POSSIBLE = (
    "no body has the estimated inertia, which the motion shows too little; stated is the possible body that the logs "
    "exclude least"
)

_Gains = KnownGains | float | None  # those that are given, or the deviation of stated ones


@checked
@numerical_work("the identification of the payload", LIKELY_CAUSE)
def identify_payload(
    robot: Robot | str,
    loaded: LogLike | Sequence[LogLike],
    /,
    *,
    without: LogLike | Sequence[LogLike] = (),
    result: Identification | str | Path | None = None,
    wrench: bool = False,
    gains: KnownGains | str | Path | None = None,
    gain_deviation: float | None = None,
    logs: LogChoice | None = None,
    frame: Sequence[float] | None = None,
    frame_name: str | None = None,
    rated: float | None = None,
    base_link: str | None = None,
    tip: Tips = None,
    snap_angles: bool = True,
    xacro: bool = False,
    installation: Installation | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> PayloadResult:
    """Identify a payload from logs with it, and logs without it or the robot's identified model.

    With joint torques, ``y = (1 + e) (W beta + K phi)`` is solved for the robot's parameters beta, those phi of the
    load, and the relative errors e of the drives' gains, see `excite.payload.load_estimate`; the 99 % intervals count
    noise that is correlated in time, friction that differs between logs, the covariance of the robot's parameters and
    that of the gains. With a force/torque sensor, which carries the load, ``y = K phi + offset``.

    Parameters
    ----------
    robot : Robot or str
    loaded : Log, frame, dict of columns, Simulation, path, or a sequence of them
        With the load, fixed to the last link.
    without : Log, frame, dict of columns, Simulation, path, or a sequence of them
        Without it.
    result : Identification or path, optional
        Instead: the robot's identified model.
    wrench : bool
        The logs are of a force/torque sensor; those without the load are then optional.
    gains : KnownGains or path, optional
        Calibrated gains of the drives; as stated if not given.
    gain_deviation : float, optional
        Relative standard deviation of stated gains, instead of that of `excite.payload.known_gains.stated_gains`.
    logs : LogChoice, optional
        How the logs are read.
    frame : sequence of float, optional
        Origin x, y, z, and roll, pitch, yaw, of the frame in which the load is stated, and the wrench measured, in the
        last link's frame [m, rad]; that frame itself if not given.
    frame_name : str, optional
        What that frame is.
    rated : float, optional
        Largest load of the robot [kg].
    base_link, tip, snap_angles, xacro, installation
        See `excite.identify`.
    progress : callable
        Called with a description of each step.

    Returns
    -------
    PayloadResult

    Raises
    ------
    InputError
        Logs that do not fit, neither logs without the load nor a model, a motion that does not show the load.
    """
    began, cpu = time.monotonic(), time.process_time()
    choice = logs if logs is not None else LogChoice()
    given = not (isinstance(without, list | tuple) and not without)
    _check_given(given, result, wrench, gains, gain_deviation)
    check("known_mass", rated, "`rated`")
    x, usual = frame_numbers(frame), "frame of the last link" if frame is None else "given frame"
    place = Frame(usual if frame_name is None else frame_name, rotation_from_rpy(x[3:]), x[:3])
    stated = read_gains(Path(gains)) if isinstance(gains, str | Path) else gain_deviation if gains is None else gains
    whole, task = robot_and_task(robot, base_link, tip, installation, snap_angles, xacro)
    task = bare_task(whole, task)
    with one_thread():
        with_load = choice.read(loaded, whole, choice.rows, progress)
        bare = choice.read(without, whole, choice.without_rows, progress) if given else []
        check_pair(bare, with_load)
        if wrench:
            equations, known = _of_wrench(whole, task, bare, with_load, choice, place), None
        elif result is not None:
            equations, known = _of_model(whole, result, with_load, choice, stated)
        else:
            model = without_load(whole, task, bare, choice.recipe([*bare, *with_load], choice.without_rows), progress)
            parts = loaded_parts(model, with_load, choice.rows)
            known = _gains(model.target.robot, stated, with_load)
            equations = paired_equations(model, parts, model.recipe, known)
        progress("estimating the load")
        estimate = estimate_load(equations)
    if wrench:  # phi is about the sensor's frame
        T = place.to_link
        estimate = replace(estimate, phi=T @ estimate.phi, covariance=T @ estimate.covariance @ T.T)
    named = tuple(log.reference for log in bare), tuple(log.reference for log in with_load)
    largest = rated if rated is not None else RATED.get(whole.name)
    held = PayloadResult(whole, place, estimate, "wrench" if wrench else "joint torques", known, *named, rated=largest)
    spent = time.monotonic() - began, time.process_time() - cpu
    return replace(
        held,
        notes=_notes(held, equations),
        doubts=_doubts(held, equations),
        provenance=provenance_of(spent, choice.mapping, tuple(choice.drop), 0),
    )


def _check_given(without: bool, result: object, wrench: bool, gains: object, gain_deviation: float | None) -> None:
    if gains is not None and gain_deviation is not None:
        raise InputError("`gain_deviation` is of stated gains, and `gains` has deviations of its own; give one of them")
    if gain_deviation is not None and not (np.isfinite(gain_deviation) and 0 <= gain_deviation <= 1):
        raise InputError(f"`gain_deviation` must be a number from 0 to 1, given {gain_deviation:g}")
    if wrench:
        for name, value in (("result", result), ("gains", gains), ("gain_deviation", gain_deviation)):
            if value is not None:
                raise InputError(f"a wrench does not depend on the robot's drives; leave out `{name}`")
        return
    if without and result is not None:
        raise InputError("`without` and `result` both say what the robot is without the load; give one of them")
    if not without and result is None:
        raise InputError(
            "joint torques show the robot and its load together; give a log `without` the load, or the `result` of an "
            "identification of the robot"
        )


def _gains(robot: Robot, gains: _Gains, loaded: Sequence[Log]) -> KnownGains:
    """Gains of the drives that are given, or as stated, with a deviation that may be given."""
    drives, _ = drives_of_torques(robot, each=False)
    if isinstance(gains, KnownGains):
        return gains.of(drives).later(log.sha256 for log in loaded)
    return stated_gains(drives) if gains is None else stated_gains(drives, gains, 0.0)


def _of_wrench(
    robot: Robot, task: Task, bare: Sequence[Log], loaded: Sequence[Log], choice: LogChoice, place: Frame
) -> LoadEquations:
    model = LoadModel(robot, Sensor(None, place.rotation, place.translation))
    target = target_of(robot, task.changed(model=model, joint_rotors=False, offset=False, load_share=False))
    both = [*bare, *loaded]
    before = [prepare(log, robot, target, choice.recipe(both, choice.without_rows)) for log in bare]
    recipe = choice.recipe(both, choice.rows)
    return wrench_equations(target, before, [prepare(log, robot, target, recipe) for log in loaded], recipe)


def _of_model(
    robot: Robot, result: Identification | str | Path, loaded: Sequence[Log], choice: LogChoice, gains: _Gains
) -> tuple[LoadEquations, KnownGains]:
    result = load_result(result) if isinstance(result, str | Path) else result
    if result.robot.sha256() != robot.sha256():
        raise InputError(
            f"{result.name} is of {result.robot.name} (description {result.robot.sha256()[:12]}), not of {robot.name} "
            f"({robot.sha256()[:12]}) as given"
        )
    own = choice.recipe(loaded, choice.rows)
    low_pass = result.recipe.low_pass if own.low_pass is None else own.low_pass
    recipe = replace(result.recipe, rows=choice.rows, low_pass=low_pass, estimator="weighted", described_within=None)
    target = instantaneous_target(robot, result.task, recipe)
    if target.model.torque_equations() is None or not target.motion.complete:
        raise InputError(f"{result.name}: a payload needs the differential model of all joints")
    parts = [replace(prepare(log, robot, target, recipe), standing=()) for log in loaded]
    if (friction := result.friction) is not None:
        parts = [without_friction(part, target, friction, recipe) for part in parts]
    calibrated = calibrated_gains(result)
    if calibrated is not None and gains is not None:
        raise InputError(f"{result.name} has calibrated gains of its own; leave out `gains` and `gain_deviation`")
    if calibrated is None:
        known = _gains(target.robot, gains, loaded)
    else:
        known = calibrated.of(drives_of_torques(target.robot, each=False)[0])
    return modelled_equations(target, parts, recipe, known, result), known


def _notes(held: PayloadResult, equations: LoadEquations) -> tuple[str, ...]:
    link, place = held.robot.links[-1].name, held.frame
    where = "whose origin is at {:g}, {:g}, {:g} m of link ".format(*place.translation) + link
    if not np.any(place.translation) and np.allclose(place.rotation, np.eye(3)):
        where = f"link {link} of {held.robot.name}; if the flange is elsewhere, give its `frame`"
    notes = [f"centre and inertia are in the {place.name}, {where}"]
    if held.gains is not None:
        notes.append(held.gains.origin)
    if held.estimate.phi[0] > 0 and held.constrained:
        notes.append(_POSSIBLE)
    if held.source == "wrench":
        notes.append("the sensor's offsets are estimated with the load")
    else:
        counted = "correlated noise, friction that differs between the logs, and the gains of the drives"
        robot = ", and the robot's identified parameters" if equations.known is not None else ""
        notes.append(f"the intervals include {counted}{robot}")
    if held.rated is not None and held.intervals[0, 1] > held.rated:
        word = "is heavier" if held.intervals[0, 0] > held.rated else "may be heavier"
        notes.append(f"warning: the load {word} than the {held.rated:g} kg that {held.robot.name} may carry")
    return tuple(notes)


def _doubts(held: PayloadResult, equations: LoadEquations) -> tuple[str, ...]:
    doubts = []
    mass, (low, high) = float(held.estimate.phi[0]), held.intervals[0]
    half = held.estimate.quantile * float(held.deviation[0])
    of_gains = 0.0 if held.gains is None else held.estimate.quantile * np.sqrt(held.mass_variance_by_gains)
    if mass <= 0:
        doubts.append(
            f"the identified mass is {mass:.3g} kg, which no load has: check which log is with the load, and the sign "
            "and unit of the torques"
        )
    elif half > _LEAST_KNOWN * mass + of_gains:
        doubts.append(
            f"the motion hardly shows the mass, which lies between {low:.3g} and {high:.3g} kg: move joints whose axes "
            "are not vertical, and longer, as `design_payload_motion` does"
        )
    if mass > 0 and held.constrained and held.far_from_estimate:
        doubts.append(
            "no possible body has a mass and a centre within their intervals: check the frame of the sensor, and "
            "that the logs are of this robot"
        )
    return (*doubts, *_unlike(held.estimate, equations))


def _misfit(estimate: LoadEstimate, equations: LoadEquations) -> list[str]:
    """Where a rigid load, with the robot or the sensor's offsets, leaves much of what varies unexplained."""
    y, name = equations.observations.y, equations.observations.equations
    parts = []
    for j in range(len(name)):
        own = equations.observations.equation == j
        spread = float(np.std(y[own]))
        parts.append(size_of(estimate.residuals[own]) / spread if spread > 0 else 0.0)
    worst = int(np.argmax(parts))
    if np.median(parts) < _UNEXPLAINED:
        return []
    return [
        f"a rigid load leaves {percent(parts[worst])} of {name[worst][0]} unexplained: check the frame of the "
        "sensor, and that the log and the model are of this robot"
    ]


def _unlike(estimate: LoadEstimate, equations: LoadEquations) -> list[str]:
    """Where residuals with the load are much larger than those without."""
    carries = np.any(equations.load, axis=1)
    if carries.all():
        return _misfit(estimate, equations)
    doubts = []
    for j, (name, unit) in enumerate(equations.observations.equations):
        own = equations.observations.equation == j
        without, loaded = (size_of(estimate.residuals[own & rows]) for rows in (~carries, carries))
        part = loaded / max(size_of(equations.observations.y[own & carries]), 1e-12)
        if loaded > _UNLIKE * without and part > 0.2:
            doubts.append(
                f"{name}: a rigid load explains the log with it only to {loaded:.2g} {unit}, the robot that without to "
                f"{without:.2g} {unit}: check that both are of this robot, and that the load is fixed"
            )
    return doubts[:1]
