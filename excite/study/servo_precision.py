"""Runs of a motion after which servos are known as precisely as asked for, by rehearsal.

Intervals of servos follow from their simulated response, not from a matrix. So the runs are rehearsed: servos follow
the commands, an error is added that is alike for some time, as what the model leaves of real motions is, and the servos
are identified as from any log. Twice as many runs are tried until the intervals are narrow enough. They need not become
so: intervals allow for a model that is off everywhere, which more runs of one motion do not tell from the servos.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import scipy

from excite.design.design import Design
from excite.identification.estimator import CONFIDENCE
from excite.identification.servo_result import ServoResult, unit_of
from excite.identification.servos import identify_servos
from excite.information.matrix import noise_per_row
from excite.information.precision_forecast import (
    FrontPoint,
    ParameterPrecision,
    PrecisionForecast,
    PrecisionSearch,
    TriedPeriod,
)
from excite.logs.log import Log, counted
from excite.simulation.servo_motion import followed
from excite.tasks.precision_target import PrecisionTarget
from regressors.errors import InputError, check_names, listed_names
from regressors.models.servo_response import QUANTITIES, RATIOS, SYMBOLS, scale_shown_by
from regressors.robot.robot import Robot
from regressors.samples import Array

_RATE = 50.0  # of the log [Hz]
_LEAST, _LONGEST = 30.0, 300.0  # of rehearsals [s]
_ERROR, _ALIKE = 2e-3, 0.1  # of servos of which nothing is known [rad or m], and how long errors are alike [s]
_ROOM = 1.7  # half-widths of one log over those of another of the same motion, at most
_ASKED = ("K", "D", "J", "Fc", "d", "L")  # what every servo has


def rehearsed(design: Design, asked: PrecisionTarget, report: Callable[[str], None] = lambda _: None) -> Design:
    """The design with the number of runs that its servos take, and the half-widths after them."""
    _check(asked)
    servos, error, assumed = _servos(design)
    seconds, most = design.sequence.duration, design.task.objective.max_time
    command = design.sequence.at(np.arange(round(seconds * _RATE)) / _RATE)[0].q
    runs, course = math.ceil(_LEAST / seconds), []
    while True:
        report(f"rehearsing {counted(runs, 'run')} of {seconds:.4g} s with simulated servos")
        log = played(servos, np.tile(command, (runs, 1)), error, design.task.search.seed)
        result = identify_servos(servos.robot, log)
        parameters = tuple(_precisions(result, servos, asked))
        course.append((runs, max(each.use for each in parameters)))
        if course[-1][1] <= 1.0 or 2 * runs * seconds > min(most, _LONGEST):
            break
        runs *= 2
    period, richness = design.task.trajectory.period, design.task.trajectory.richness[1]
    known = (period, richness, seconds, runs, runs * seconds, course[0][1])
    found = PrecisionSearch(
        asked=asked.to_dict(),
        noise=tuple(error.tolist()),
        max_time=most,
        period=period,
        forecast=PrecisionForecast(runs, seconds, asked.level, asked.probability, parameters),
        trials=(TriedPeriod(*known, tuple(course)),),
        front=tuple(FrontPoint(period, n, n * seconds, use) for n, use in course),
    )
    return replace(design, precision_search=found, notes=(*design.notes, assumed, *_not_counted(result)))


def _check(asked: PrecisionTarget) -> None:
    if asked.groups or asked.torques is not None or asked.scales or asked.level != CONFIDENCE:
        raise InputError(
            "precision: of servos, give `share:`, `parameters:` by their symbols, or both, at the level of "
            f"{CONFIDENCE:g}; they have no groups, scales or torques"
        )
    check_names("quantity of a servo", asked.parameters, SYMBOLS)


# of usual servos: D/K [s], root of J/K [s], Fc/L, [s]
_CONSTANT, _REACTION, _FRICTION, _DELAY = 0.04, 0.026, 0.05, 0.02
_FAST = 5.0  # speed without load where none is stated [rad/s or m/s]
_STRONG = 3.0  # times what the arm needs, where no torque is stated


def usual_servos(robot: Robot) -> Array:
    """Servos of the stated torque and speed, and otherwise as desktop arms have them, shape (n, p)."""
    needed = max(load for load, _, _ in scale_shown_by(robot))
    limit, speed = robot.limits.torque, robot.limits.velocity
    L = np.where(np.isfinite(limit), limit, _STRONG * max(needed, 1e-3))
    D = L / np.where(np.isfinite(speed), speed, _FAST)
    K = D / _CONSTANT
    given = {"K": K, "D": D, "J": K * _REACTION**2, "Fc": _FRICTION * L, "d": np.full(robot.n, _DELAY), "L": L}
    return np.column_stack([np.clip(given.get(q.symbol, np.zeros(robot.n)), q.least, q.most) for q in QUANTITIES])


def _servos(design: Design) -> tuple[ServoResult, Array, str]:
    """Servos to rehearse with, the error of their motion (n,), and what was assumed."""
    robot, task = design.robot, design.task
    names, given = robot.joint_names, task.objective.servos
    if given is None:
        values, error = usual_servos(robot), np.full(robot.n, _ERROR)
        whose = "usual servos of the stated torque and speed, as `servos` names none that are identified"
    else:
        if lacking := [name for name in names if name not in given.joints]:
            raise InputError(f"servos {given}: nothing is known of the servo of {listed_names(lacking)}")
        place = [given.joints.index(name) for name in names]
        values, error = np.array(given.values)[place], np.array(given.error)[place]
        whose = f"the servos {given}"
    if task.objective.noise is not None:
        moved = [names.index(name) for name in design.moving.joint_names]
        error[moved] = noise_per_row(task.objective.noise, design.target.model)
    assumed = (
        f"the precision was rehearsed with {whose}, and with errors of the motion of up to {error.max():.2g} rad (or "
        f"m) that last {_ALIKE:g} s; state other errors by `noise`"
    )
    return ServoResult(robot, values, np.zeros_like(values), (), (), 0), error, assumed


def played(servos: ServoResult, command: Array, error: Array, seed: int) -> Log:
    """What is measured of commands, shape (N, n), with errors of the motion (n,) that are alike for some time."""
    alike, rng = math.exp(-1.0 / (_RATE * _ALIKE)), np.random.default_rng(seed)
    steps = rng.standard_normal(command.shape) * math.sqrt(1.0 - alike**2)
    noise = error * scipy.signal.lfilter([1.0], [1.0, -alike], steps, axis=0)
    q = followed(servos, command, 1.0 / _RATE, command[0], np.zeros(servos.robot.n)) + noise
    q = np.where(np.ptp(command, axis=0) > 0.0, q, command)  # what rests shows nothing
    time = np.arange(len(command)) / _RATE
    return Log("rehearsal", "", servos.robot.joint_names, time, q, command=command)


def _precisions(result: ServoResult, servos: ServoResult, asked: PrecisionTarget) -> Iterator[ParameterPrecision]:
    """Half-widths beside what is allowed; of torques ratios to the stiffness where no mass shows it."""
    ratios, of_ratios = servos.ratios[0], result.ratios[1]
    for j, joint in enumerate(servos.robot.joints):
        if np.isinf(result.half_width[j]).all():
            continue
        scaled = np.isfinite(result.half_width[j, 0])
        for k, quantity in enumerate(QUANTITIES):
            share = asked.parameters.get(quantity.symbol, asked.share if quantity.symbol in _ASKED else None)
            name, unit = f"{quantity.name} {joint.name}", unit_of(quantity, joint.kind)
            value, half = servos.values[j, k], result.half_width[j, k]
            if not scaled and k in RATIOS and quantity.symbol not in asked.parameters:
                place = RATIOS.index(k)
                value, half = ratios[j, place], of_ratios[j, place]
                unit = quantity.over_stiffness[joint.kind == "prismatic"]
                name = f"{quantity.name} over stiffness {joint.name}"
            if np.isfinite(half) or quantity.symbol in asked.parameters:
                allowed = None if share is None or value == 0.0 else float(share * abs(value))
                yield ParameterPrecision(name, unit, float(_ROOM * half), allowed)


def _not_counted(result: ServoResult) -> Iterator[str]:
    """What the motion does not show, so that no precision of it is promised."""
    unknown, names = np.isinf(result.half_width), np.array(result.robot.joint_names)
    still = unknown.all(axis=1)
    unscaled, far = unknown[:, 0] & ~still, unknown[:, SYMBOLS.index("L")] & ~unknown[:, 0]
    told = {
        "too little motion to promise a precision": still,
        "too little load by known masses, so that ratios to the stiffness count in the place of torques": unscaled,
        "the torque limit is not reached, and no precision of it is promised": far,
    }
    for text, joints in told.items():
        if joints.any():
            yield f"{listed_names(names[joints].tolist())}: {text}"
