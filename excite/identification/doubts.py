"""All checks of a result, and the error of predictions that the noise of its logs alone leads one to expect."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from excite.identification.equations import measured_regressor
from excite.identification.estimator import Estimate
from excite.identification.impossible_parameters import (
    POSES,
    allowed_poses,
    described_coefficients,
    impossible_parameters,
    inertial_columns,
    negative_inertia,
)
from excite.identification.large_residual import (
    LARGEST,
    UNEXPLAINED,
    Doubt,
    cause_of_residual,
    large_residual,
    left_out_rows,
    missing_terms,
    noisy_derivatives,
)
from excite.identification.log_faults import every_joint_moves, load_that_explains
from excite.identification.noise import residual_diagnostics
from excite.identification.observations import GroupFactors, Observations
from excite.identification.prediction import LogPrediction, fit_error, prediction
from excite.identification.preparation import HELD
from excite.identification.result import WHOLE
from excite.identification.spoilt_log import spoilt_log
from excite.information.target import IdentificationTarget
from excite.logs.signals.method import interpolated
from excite.logs.signals.periods import mean_rate, measurement_noise, motion_ends
from regressors.errors import listed_names, percent
from regressors.numerical import one_thread
from regressors.robot.columns import OFFSET, drive_column
from regressors.robot.friction.load_and_temperature import drives_with_friction
from regressors.robot.robot import drive_numbers
from regressors.robot.symbolic.loops import loops_of
from regressors.samples import Array, Samples

if TYPE_CHECKING:
    from excite.identification.identification import Identification


@one_thread()
def doubts_of(result: Identification) -> tuple[Doubt, ...]:
    """Reasons why a result cannot be right; empty if there are none."""
    target = result.target_of_instants
    found = (_nothing_shown(result),) if len(result.estimate.unseen) == len(result.names) else _found(result, target)
    timed = any(choice.name == "delay" for choice in result.choices)
    spoilt = spoilt_log(target, result.prepared, result.friction, doubtful=bool(found), timed=timed)
    return found if spoilt is None else (spoilt,)  # the others follow from it


def _nothing_shown(result: Identification) -> Doubt:
    """Doubt where no parameter has a value."""
    what = f"the logs show none of the {len(result.names)} parameters"
    cause = "they are too short, or what moves in them is as small as their noise"
    return Doubt(what, cause, "record a designed motion (`design_trajectory`)", about="torques")


def _found(result: Identification, target: IdentificationTarget) -> tuple[Doubt, ...]:
    """A large residual, or bodies and drives that cannot be."""
    above = max(motion_ends(part.log.q, mean_rate(part.log.time)) for part in result.prepared)
    noisy = noisy_derivatives(result.observations, result.estimate.predicted(result.observations), above)
    residual = _residual(result, target, noisy, above)
    checks = [residual]
    if residual is None:  # else the others follow from it
        inertia = _negative_inertia(result, target, noisy) if target.base.names == result.names else None
        checks.append(inertia if inertia and inertia.about == "bodies" else None)
        checks.append(
            impossible_parameters(result.estimate, result.target.base, _shares(result), noisy, _tried(result))
        )
        checks.append(None if result.symmetry is None else result.symmetry.doubt)
    return tuple(doubt for doubt in checks if doubt is not None)


def _negative_inertia(
    result: Identification, target: IdentificationTarget, noisy: tuple[str, str] | None = None
) -> Doubt | None:
    poses = allowed_poses(target.robot, _motions(result).q)
    return negative_inertia(target, result.estimate, poses, _tried(result), noisy)


@one_thread()
def warnings_of(result: Identification) -> tuple[Doubt, ...]:
    """What the logs do not determine, although the result may be right; empty if there is nothing."""
    target = result.target_of_instants
    checks = [left_out_rows(part.log.source, part.left_out_share) for part in result.prepared]
    if target.base.names == result.names and _residual_size(result) <= LARGEST:  # a larger one is no noise
        errors = expected_error(target, result.observations, result.estimate, _motions(result))
        few = few_data(len(result.prepared), *errors, result.estimate.method, _excess(result), tried=_tried(result))
        checks.append(_resting(result) or few)  # which follows from it
        inertia = _negative_inertia(result, target)
        checks.append(inertia if inertia and inertia.about == "inertia" else None)
        checks.append(_untold_load(result, target))
    return tuple(warning for warning in checks if warning is not None)


def _resting(result: Identification) -> Doubt | None:
    """Why some parameters do not show where joints of the model rest in all logs."""
    target, way = result.target_of_instants, np.ptp(_motions(result).q, axis=0)
    names = zip(target.robot.joint_names, way, strict=True)
    still = [name for name, x in names if x <= HELD and name not in target.robot.base_joints]
    if not still or not every_joint_moves(target):
        return None
    cure = "add a log in which every joint moves, or, where they rest at zero, leave them out of the model (`joints`)"
    what = f"{listed_names(still)} {'rests' if len(still) == 1 else 'rest'} in all logs"
    return Doubt(what, "nothing shows the inertia and the friction there", cure)


def _untold_load(result: Identification, target: IdentificationTarget) -> Doubt | None:
    """Warning where the bodies depart from the described ones as with a load at the last link."""
    known = described_coefficients(target)
    if known is None or not every_joint_moves(target):
        return None
    motion = _motions(result)
    some = motion.rows(np.unique(np.linspace(0, motion.time.size - 1, _INSTANTS).astype(int)))
    Y = target.model.instants(some)[:, target.base.index].reshape(some.time.size, -1, target.base.rank)
    inertial = inertial_columns(target.base)
    difference = Y[:, :, inertial] @ (result.coefficients - known)[inertial]
    load = load_that_explains(target, some, difference, Y @ result.coefficients)
    if load is None or load[0] < 0:
        return None
    return Doubt(
        f"the robot seems to carry something that its description lacks: {load[1]}",
        "either it does, and the parameters are those of the robot with that load, or its description has wrong masses",
        "identify again from a log without a load, or say with `identify_payload` what it is; if there was none, go on",
    )


WELL = 0.05  # relative deviation of a parameter that is well known


def answers(result: Identification) -> tuple[str, ...]:
    """Whether a possible robot has the parameters of a result, how many are known, and which are not: sentences."""
    limbs = () if result.symmetry is None else (result.symmetry.text,)
    return _possible(result), *limbs, f"parameters: {known_text(result)}", *unknown_texts(result)


def _possible(result: Identification) -> str:
    bodies = [doubt.what for doubt in result.doubts if doubt.about == "bodies"]
    if bodies:
        return f"bodies: no possible robot has these parameters: {bodies[0]}"
    if any(doubt.about == "torques" for doubt in result.doubts):
        return "bodies: not checked, since the torques are not explained"
    if left_open := [warning.what for warning in result.warnings if warning.about == "inertia"]:
        return f"bodies: the data leave open whether a possible robot has these parameters: {left_open[0]}"
    if result.estimate.method == "physical":
        return "bodies: physically possible, since the estimator allows no others"
    return f"bodies: no sign of impossible ones (checked: signs of the parameters, mass matrix in some {POSES} poses)"


def known_text(result: Identification) -> str:
    """How many parameters are known; an offset that may be zero is none that is missing."""
    counted = ~_offsets(result)
    count, known = int(counted.sum()), int(np.sum(result.estimate.relative_deviation[counted] < WELL))
    found = f"all {count}" if known == count else f"{known} of {count}"
    aside = " (offsets aside)" * (not counted.all())
    rest = f", {count - known} {'is' if count - known == 1 else 'are'} not" * (known < count)
    return f"{found}{aside} are known to {100 * WELL:g} %{rest}"


def _offsets(result: Identification) -> NDArray[np.bool_]:
    """Which parameters are offsets of drives."""
    offsets = {drive_column(number, OFFSET).name for number in drive_numbers(result.robot)}
    return np.array([name in offsets for name in result.names], dtype=bool)


_MANY = 40  # names: the table has them all


def unknown_texts(result: Identification) -> Iterator[str]:
    """Which parameters may be zero, and which do not show, with what would show them: a sentence each."""
    estimate = result.estimate
    with np.errstate(invalid="ignore"):
        uncertain = np.isfinite(estimate.deviation) & (estimate.relative_deviation > 1) & ~_offsets(result)
        vague = np.array(result.names)[uncertain].tolist()
    # parts of the friction of a drive that make up for each other may be zero, and their sum not
    wholes = {whole: width for whole, width in result.facts.friction_of_drives.items() if width < 1}
    parts = {name for whole in wholes for name in whole.split(WHOLE)}.intersection(vague)
    if alone := [name for name in vague if name not in parts]:
        yield f"may be zero, as far as these logs show: {listed_names(alone, _MANY)}"
    if parts:
        known = [f"{w} to {percent(width)}" for w, width in wholes.items() if not parts.isdisjoint(w.split(WHOLE))]
        yield f"parts of friction may be zero, but not as a whole over speed, which is known: {', '.join(known)}"
    if estimate.unseen:
        named = ", ".join(estimate.unseen)
        yield f"not shown by these logs: {named}; design a motion for them, or state what is known beforehand"


def _tried(result: Identification) -> str:
    """The estimator, or ``physical`` where that was tried and predicted worse: it is not advised again."""
    return "physical" if any(choice.name == "estimator" for choice in result.choices) else result.estimate.method


def _excess(result: Identification) -> float:
    """Relative error of least squares in left-out blocks beyond that of the estimate's own rows; 0 where not known."""
    of_estimator = [c for one in result.choices if one.name == "estimator" for c in one.candidates]
    scored = [c.error for c in of_estimator if c.value == "weighted"]
    return float(np.sqrt(max(0.0, scored[0] ** 2 - _residual_size(result) ** 2))) if scored else 0.0


def _motions(result: Identification) -> Samples:
    """Motions of all logs, one after the other."""
    return Samples.joined([part.samples for part in result.prepared])


def _shares(result: Identification) -> Array:
    """``||W_j beta_j|| / ||y||``, shape (b,)."""
    size = float(np.linalg.norm(result.observations.y))
    factors = GroupFactors.of(result.observations)
    columns = factors.stacked(np.ones(len(factors.R)))[:, -result.target.base.rank - 1 : -1]
    sizes = np.linalg.norm(columns, axis=0) * np.abs(result.coefficients)
    return np.asarray(sizes / size if size > 0 else sizes)


def _residual_size(result: Identification) -> float:
    return fit_error(result.observations, result.estimate)


def _residual(
    result: Identification, target: IdentificationTarget, noisy: tuple[str, str] | None, above: float
) -> Doubt | None:
    relative = _residual_size(result)
    if not relative > LARGEST or target.base.names != result.names:
        return None
    parts = [prediction(target, part, result.recipe, result.coefficients, result.friction) for part in result.prepared]
    return large_residual(relative, _noise(parts, above), noisy or _missing(result, target, parts))


def _noise(parts: list[LogPrediction], above: float) -> float:
    """Norm of the noise of the measurements over that of the measurements."""
    square = 0.0
    for p in parts:
        if p.time.size > 1:
            noise = measurement_noise(p.measured, p.measured - p.predicted, mean_rate(p.time), above)
            square += p.time.size * float(np.sum(noise.square))
    size = sum(float(np.sum(p.measured**2)) for p in parts)
    return float(np.sqrt(square / size)) if size > 0 else 0.0


def _missing(result: Identification, target: IdentificationTarget, parts: list[LogPrediction]) -> tuple[str, str]:
    """What the model lacks, as the cause of a large residual."""
    equations = target.model.torque_equations()
    if equations is None:
        return UNEXPLAINED
    residual = np.concatenate([p.measured - p.predicted for p in parts])
    speed = np.concatenate([p.speed for p in parts])
    along = [(part.samples.time, equations.speeds(part.samples.ddq)) for part in result.prepared]
    acceleration = [interpolated(p.time, *one) for p, one in zip(parts, along, strict=True)]
    terms = missing_terms(residual, speed, np.concatenate(acceleration))
    return cause_of_residual(*terms, [name for name, _ in target.model.row_labels], _without_curve(result, target))


def _without_curve(result: Identification, target: IdentificationTarget) -> list[str]:
    """Drives that move and have no friction curve, where friction is known."""
    if result.friction is None:
        return []
    speeds = np.concatenate([part.samples.dq for part in result.prepared])
    drives = [(name, row) for name, row in drives_with_friction(target.robot) if name not in result.friction.curves]
    return [name for name, row in drives if np.ptp(speeds @ np.asarray(row, dtype=float)) > 0]


_MOTIONS = 12
_INSTANTS = 1500
_LEAST = 1e-12  # of the largest eigenvalue


def expected_error(
    target: IdentificationTarget, observations: Observations, estimate: Estimate, travelled: Samples, seed: int = 0
) -> tuple[float, float | None]:
    """``sqrt(sum_j tr(C W_j' W_j) / sum_j |tau_j|^2)`` over random motions of the size of the logs'.

    ``C = (sum_j W_j' W_j / s_j^2)^-1`` is the covariance of least squares from these equations, with ``s_j^2`` the mean
    square of the residuals of equation j times rows over effective rows, since they are correlated. It has no part
    from errors of the model, nor from what the estimator knows beyond the data: it says what the data determine. The
    second error is with one motion as long as the logs and as noisy, the one with the least among the random ones; None
    where it cannot be told.
    """
    rng = np.random.default_rng(seed)
    r = len(target.model.row_labels)
    others = [other_motion(travelled, rng) for _ in range(_MOTIONS)]
    if target.robot.closures:
        others = list(map(loops_of(target.robot).states, others))
    motions = [measured_regressor(target, other) for other in others]
    gram = np.sum([W.T @ W for W in motions], axis=0)
    torque = float(sum(np.sum((W @ estimate.coefficients) ** 2) for W in motions))
    noise = _effective_noise(estimate, observations)
    factors = GroupFactors.of(observations)
    weighted = factors.stacked(noise)[:, :-1]
    determined = _inverse(weighted.T @ weighted)
    # of windows, whose noise is not that of torques; nor are motions of closed loops designed
    if observations.equations != target.model.row_labels or target.robot.closures:
        return _ratio(determined, gram, torque), None
    counts = factors.count.reshape(-1, r)
    log_rows = counts.sum(axis=0)
    squares = np.where(counts > 0, noise.reshape(-1, r), 0.0) ** 2
    per_equation = np.sqrt((counts * squares).sum(axis=0) / np.maximum(log_rows, 1))
    share = np.sqrt(log_rows * r / motions[0].shape[0])  # none of an equation without rows
    share = np.divide(share, per_equation, out=np.zeros(r), where=per_equation > 0)
    alone = (W * np.tile(share, len(W) // r)[:, None] for W in motions)
    designed = min(_ratio(_inverse(A.T @ A), gram, torque) for A in alone)
    return _ratio(determined, gram, torque), designed


def _effective_noise(estimate: Estimate, observations: Observations) -> Array:
    """Noise that white residuals would need for the same uncertainty, per group; shape (groups,)."""
    noise = np.full(len(observations.logs) * len(observations.equations), np.inf)
    for g, one in zip(np.unique(observations.group), residual_diagnostics(estimate, observations), strict=True):
        noise[g] = one.rms * np.sqrt(one.rows / one.effective)
    least = 1e-9 * noise[np.isfinite(noise)].max(initial=0.0) or 1.0
    return np.asarray(np.maximum(noise, least))


def _inverse(M: Array) -> Array:
    """``M^-1``, directions that M does not show having a variance as large as numbers allow."""
    sizes = np.sqrt(np.diag(M))
    sizes = np.where(sizes > 0, sizes, 1.0)
    values, vectors = np.linalg.eigh(M / np.outer(sizes, sizes))
    half = vectors / np.sqrt(np.maximum(values, _LEAST * values[-1])) / sizes[:, None]
    return np.asarray(half @ half.T)


def _ratio(C: Array, gram: Array, torque: float) -> float:
    return float(np.sqrt(np.sum(C * gram) / torque)) if torque > 0 else np.inf


HARMONICS = 5
_POINTS = 200  # in a period


def other_motion(travelled: Samples, rng: np.random.Generator) -> Samples:
    """A random Fourier series of five harmonics within the ranges of positions, speeds and accelerations of another.

    Each joint has its own; of closed loops take those of the independent joints.
    """
    n = travelled.q.shape[1]
    low, high = travelled.q.min(axis=0), travelled.q.max(axis=0)
    speed, acceleration = _rms(travelled.dq), _rms(travelled.ddq)
    moving = (high - low > 1e-6 * (high - low).max(initial=0.0)) & (speed > 0)
    rate = float(np.median(acceleration[moving] / speed[moving])) if moving.any() else 1.0  # of the harmonics [rad/s]
    numbers = np.arange(1, HARMONICS + 1)  # mean squares of acceleration and velocity over the base frequency squared:
    period = 2 * np.pi * np.sqrt(float(np.sum(numbers**4) / np.sum(numbers**2))) / rate
    time = np.arange(_POINTS) * (period / _POINTS)
    k = numbers * 2 * np.pi / period
    amplitude, phase = rng.normal(size=(n, HARMONICS)), rng.uniform(0, 2 * np.pi, (n, HARMONICS))
    angle = np.multiply.outer(time, k)[:, None, :] + phase
    q, dq, ddq = (
        np.sum(amplitude * part, axis=-1) for part in (np.sin(angle), k * np.cos(angle), -(k**2) * np.sin(angle))
    )
    allowed = [(high - low) / np.maximum(np.ptp(q, axis=0), 1e-300), speed / _rms(dq), acceleration / _rms(ddq)]
    scale = np.where(moving, np.min(allowed, axis=0), 0.0)
    middle = (low + high) / 2 - scale * (q.max(axis=0) + q.min(axis=0)) / 2
    return Samples(time, middle + scale * q, scale * dq, scale * ddq, np.zeros_like(q))


def _rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(x**2, axis=0)))


_TOLERATED = 0.10  # of the torque: the tolerance of a verdict, which the next log then exceeds by noise alone
_USEFUL = 0.8  # of the error: a designed motion that does not gain more is not proposed


def few_data(
    logs: int, expected: float, designed: float | None, method: str, excess: float = 0.0, *, tried: str | None = None
) -> Doubt | None:
    """Warning where predictions on other motions are expected to fail by the noise of the logs alone, or did fail."""
    if not max(expected, excess) > _TOLERATED:
        return None
    what, noise = ("this log is", "its noise") if logs == 1 else (f"these {logs} logs are", "their noise")
    kept = (
        "only the condition that bodies are possible holds them down"
        if method == "physical"
        else "errors of the model come on top of that"
    )
    cause = (
        f"least squares predicts blocks of time that it was not given worse by {percent(excess)} of the torque"
        if excess > expected
        else f"{noise} alone makes predictions of other motions of the same ranges and speeds wrong by "
        f"{percent(expected)} of the torque"
    )
    return Doubt(f"{what} too little", f"{cause}, and {kept}", _cure(expected, designed, tried or method))


def _cure(expected: float, designed: float | None, method: str) -> str:
    physical = "" if method == "physical" else ", or admit only parameters of real bodies with `estimator='physical'`"
    if designed is None or designed > _USEFUL * expected:
        return f"add a log of another motion{physical}"
    return (
        f"play a motion designed for this (`design_trajectory`): of the same length, ranges and speeds it leaves "
        f"{percent(designed)} instead of {percent(expected)}; or add a log of another motion{physical}"
    )
