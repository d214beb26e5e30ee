"""Identification from logs, step by step: logs made ready, equations, estimate, intervals; gains by a known load."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
import scipy

from excite.identification.allowances import (
    PRESLIDING,
    FrictionScale,
    allowing_for_curves,
    allowing_for_pull,
    allowing_for_scale,
    estimate_changes,
    fitted_scale,
    with_uncertainty,
)
from excite.identification.between_logs import LogScatter, allowing_for_logs, estimate_each, log_scatter
from excite.identification.biases import (
    allowing_for_motion_noise,
    allowing_for_standstill,
    friction_mismatch,
    without_standstill,
)
from excite.identification.covariance import condition_number
from excite.identification.drive_gains import BLOCKS, GainCalibration, corrections, drive_gains
from excite.identification.equations import equations, equations_of, nuisance_columns, right_sides
from excite.identification.estimator import CONFIDENCE, Context, Estimate, Estimator, allowing_for, noted
from excite.identification.identification import Identification
from excite.identification.observations import Observations, join_observations
from excite.identification.prediction import beside_curves, check_for_curves, check_joint_torques, without_friction
from excite.identification.preparation import PreparedLog, drives_of_torques, prepare
from excite.identification.presliding import presliding_note, with_presliding, with_whole_window
from excite.identification.recipe import Recipe
from excite.identification.result import FitData, reference_of
from excite.information.nearly_unidentifiable import left_out_by_rounding
from excite.information.target import IdentificationTarget, friction_of_moving, left_out_notes, target_of
from excite.logs.frame import FrameLike, is_frame
from excite.logs.log import Log
from excite.logs.log_checks import with_every_joint
from excite.logs.log_reading import read_log, with_sidecar
from excite.logs.mapping import LogMapping, read_mapping
from excite.storage.result_folder import read_settled_files
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.errors import InputError, UnknownName, percent
from regressors.models.load import PayloadModel
from regressors.models.nominal import standard_values
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array


class Measured(Protocol):
    """What has a log, such as a simulation."""

    @property
    def measured(self) -> Log:
        """The log."""


LogLike = Log | str | Path | Measured | FrameLike


def read_logs(
    given: LogLike | Sequence[LogLike],
    robot: Robot,
    mapping: LogMapping | str | Path | None,
    drop: tuple[str, ...],
    progress: Callable[[str], None],
    only: tuple[int, int] | None = None,
) -> list[Log]:
    """Read logs and refuse duplicates; simulated ones keep their true parameters."""
    layout = read_mapping(Path(mapping)) if isinstance(mapping, str | Path) else mapping
    logs: dict[str, Log] = {}
    several = isinstance(given, list | tuple)
    for k, item in enumerate(given if isinstance(given, list | tuple) else (given,), 1):
        if isinstance(item, str | Path):
            progress(f"reading {item}")
        log = log_of(item, robot, layout, drop, only, f"frame {k}" if several else "frame")
        if log.sha256 in logs:
            raise InputError(f"{log.source} has the same content as {logs[log.sha256].source}; give each log once")
        logs[log.sha256] = log
    return list(logs.values())


def log_of(
    given: LogLike,
    robot: Robot,
    mapping: LogMapping | str | Path | None = None,
    drop: tuple[str, ...] = (),
    only: tuple[int, int] | None = None,
    source: str = "frame",
) -> Log:
    """Log with its hash, from a log, its file, a simulation, or a frame, which has no name of its own."""
    if isinstance(given, str | Path):
        path = Path(given)
        log = read_settled_files(path, lambda: with_sidecar(read_log(path, None, mapping, drop, only, robot), robot))
    elif is_frame(given):
        log = Log.from_frame(given, mapping, robot=robot, drop=drop, only=only, source=source)  # type: ignore[arg-type]
    elif isinstance(measured := getattr(given, "measured", given), Log):
        log = replace(measured, sha256=measured.identity)
    else:
        what = "a log, the name of its file, a simulation, a frame or a dict of columns"
        raise InputError(f"expected {what}; given {type(given).__name__}")
    return with_every_joint(log, robot) if robot.closures else log


def measured_logs(
    robot: Robot,
    task: Task,
    logs: Sequence[Log],
    recipe: Recipe,
    friction: FrictionCurves | None,
    found: frozenset[str],
    commanded: Trajectory | None,
    progress: Callable[[str], None],
) -> tuple[Task, Context, FrictionCurves | None, frozenset[str]]:
    """Task and recipe completed from the motion of each log, known friction, and which settings were found there."""
    own, friction = friction is None, task.known_friction if friction is None else friction
    if friction is not None and (recipe.friction_scale or not own):
        task = beside_curves(task, robot, friction)
    made_for = task, recipe.common_width
    target = target_of(robot, *made_for)
    if friction is not None:
        check_joint_torques(target)
        friction = friction_of_moving(friction, robot, target.robot)
        task = task if task.known_friction is None else task.changed(friction_curves=friction)
    else:
        check_for_curves(recipe)
    parts = []
    for log in logs:
        progress(f"reading the motion of {log.source}")
        parts.append(prepare(log, robot, target, recipe))
    task = with_whole_window(task, target, parts[0])
    if recipe.sign_width is None and not recipe.breakaway:
        found |= {PRESLIDING}
    recipe = with_presliding(recipe, target, parts, friction)
    if (task, recipe.common_width) != made_for:
        target = target_of(robot, task, recipe.common_width)
    moving = tuple(without_standstill(part, target, recipe.standstill) for part in parts)
    measured = Context(target, moving, recipe, standard_values(target.robot), commanded)
    return task, measured, friction, found if friction is None else found - {PRESLIDING}


def estimate_parameters(
    robot: Robot,
    task: Task,
    logs: Sequence[Log],
    recipe: Recipe | None = None,
    *,
    commanded: Trajectory | None = None,
    friction: FrictionCurves | None = None,
    found: frozenset[str] = frozenset(),
    progress: Callable[[str], None] = lambda _: None,
) -> Identification:
    """Identify parameters from one log or several."""
    if not logs:
        raise InputError("no logs to identify from")
    recipe = recipe if recipe is not None else Recipe()
    estimator = recipe.chosen_estimator()
    estimator.check(commanded)
    fitted, measured, known, found = measured_logs(robot, task, logs, recipe, friction, found, commanded, progress)
    progress("building the equations")
    target = measured.target
    context, curves, scale = _less_friction(measured, known)
    observations = equations(target, context.prepared, measured.recipe)
    observations = observations.held() if estimator.holds_rows else observations
    if len(observations.y) <= len(observations.names):
        raise InputError(
            f"{', '.join(observations.logs)}: {len(observations.y)} equations are too few for "
            f"{len(observations.names)} parameters"
        )
    progress(f"estimating {len(observations.names)} parameters from {len(observations.y)} equations")
    estimate = estimator.estimate(observations, context)
    estimate, scatter = _with_deviations(estimate, estimator, observations, context, found)
    if known is not None:
        estimate = allowing_for_curves(estimate, observations, measured, known)
        if scale is not None:
            estimate = allowing_for_scale(estimate, observations, measured, known, scale)
    mismatch = friction_mismatch(estimate, observations, context) if curves is None else None
    return Identification(
        robot,
        fitted,
        measured.recipe,
        noted(replace(estimate, mismatch=mismatch), *_notes(robot, task, measured, known)),
        condition_number(observations),
        FitData(target, context.prepared, observations),
        friction=curves,
        friction_scale=scale,
        reference=reference_of(target, logs),
        scatter=scatter,
    )


def _less_friction(
    measured: Context, friction: FrictionCurves | None
) -> tuple[Context, FrictionCurves | None, FrictionScale | None]:
    """The logs less known friction, times its fitted factors where it is scaled; that friction, and the factors."""
    if friction is None:
        return measured, None, None
    target, recipe, scale = measured.target, measured.recipe, None

    def less(friction: FrictionCurves) -> Context:
        parts = (without_friction(part, target, friction, recipe) for part in measured.prepared)
        return replace(measured, prepared=tuple(parts))

    if recipe.friction_scale:
        scale = fitted_scale(equations(target, less(friction).prepared, recipe), measured, friction)
        friction = scale.of(friction)
    return less(friction), friction, scale


def _notes(robot: Robot, asked: Task, measured: Context, known: FrictionCurves | None) -> tuple[str, ...]:
    """How the robot was read, how friction changes sign, and what known friction leaves out of what was asked for."""
    target = measured.target
    notes = (*left_out_by_rounding(target.robot, target.base), *robot.reading_notes)
    notes = (*notes, *presliding_note(measured.recipe, target, known=known is not None))
    return notes if known is None else (*notes, *left_out_notes(asked.model, target, known))


def _with_deviations(
    estimate: Estimate, estimator: Estimator, observations: Observations, context: Context, found: frozenset[str]
) -> tuple[Estimate, LogScatter | None]:
    """The estimate with the deviations that noise, motion, a pull and several logs give it, and their scatter."""
    estimate = with_uncertainty(estimate, observations, context, found=found)
    estimate = allowing_for_motion_noise(estimate, estimator, context)
    estimate = allowing_for_standstill(estimate, estimator, observations, context)
    estimate = allowing_for_pull(estimate, estimator, observations)
    if len(context.prepared) == 1:
        return estimate, None
    scatter = log_scatter(estimate_each(estimator, observations, context, found=found))
    return allowing_for_logs(estimate, scatter), scatter


KINDS = ("each", "common")


_LEAST_KNOWN = 0.5  # half of an interval, of the gain, from which on a load does not act


def calibrate(bare: Identification, loaded: Sequence[Log], known_mass: float, kind: str) -> GainCalibration:
    """Calibrate the gains of the drives."""
    target, recipe = bare.target, replace(bare.recipe, standstill=0.0)
    if target.model.torque_equations() is None or not target.motion.complete:
        raise InputError("drive gains are calibrated with the differential model of all joints of the load's arm")
    if bare.friction is not None:
        raise InputError(
            "friction curves are in the torques that the gains are to correct; leave out `friction_curves` where "
            "`loaded` logs calibrate the gains"
        )
    names, D = drives_of_torques(target.robot, each=kind == "each")
    parts = [*bare.prepared, *(prepare(log, bare.robot, target, recipe) for log in loaded)]
    parts = [replace(part, standing=()) for part in parts]
    observations = join_observations([at_drives(equations_of(target, part, recipe), D, names) for part in parts])
    carries = [float(k >= len(bare.prepared)) for k in range(len(parts))]
    load = np.concatenate([c * load_rows(part, target, recipe, D) for c, part in zip(carries, parts, strict=True)])
    factor, deviation, stated_mass = drive_gains(observations, load, known_mass, common=kind == "common")
    half = deviation * float(scipy.special.stdtrit(BLOCKS - 1, 0.5 + CONFIDENCE / 2))
    if np.any(blind := half > _LEAST_KNOWN * factor):
        raise InputError(
            f"the load hardly acts on {', '.join(np.array(names)[blind])}: the gain would be known to "
            f"{percent(float(np.max(half / factor)))} only; move these joints more in the `loaded` logs, or "
            "give `gains='common'`"
        )
    files = tuple({"file": log.source, "sha256": log.sha256} for log in loaded)
    return GainCalibration(kind, names, factor, deviation, half, float(known_mass), stated_mass, files)


def at_drives(observations: Observations, D: Array, names: tuple[str, ...]) -> Observations:
    """Equations of the drives' torques instead of the joints'."""  # D (n, n)
    n, p = D.shape[0], observations.W.shape[1]
    W = np.einsum("ij,njp->nip", D, observations.matrix.reshape(-1, n, p)).reshape(-1, p)
    y = (observations.y.reshape(-1, n) @ D.T).ravel()
    units = (unit for _, unit in observations.equations)
    return replace(observations, W=W, y=y, equations=tuple(zip(names, units, strict=True)))


def load_rows(part: PreparedLog, target: IdentificationTarget, recipe: Recipe, D: Array) -> Array:
    """Torques of the drives per parameter of a load at the last link, in a log's rows, shape (m, 10).

    Of the joints ``tau_j = l_j' F + s_j' N`` with ``[F; N] = K phi`` of the last link's frame [KD96] eq. (8)-(10).
    """  # D (n, n)
    n = D.shape[0]
    K = PayloadModel(target.robot).instants(part.samples).reshape(-1, n, 10)
    rows = right_sides(target, part, recipe, np.moveaxis(K, 2, 0))
    return np.asarray(np.einsum("ij,njp->nip", D, rows.reshape(-1, n, 10)).reshape(-1, 10))


def check_given(loaded: object, known_mass: float | None, kind: str) -> bool:
    """Whether gains are to be calibrated."""
    given = not (isinstance(loaded, list | tuple) and not loaded)
    if kind not in KINDS:
        raise UnknownName("kind of gains", kind, KINDS)
    if given and known_mass is None:
        raise InputError("`loaded` logs calibrate the drive gains from a known mass; give `known_mass` [kg]")
    if not given and known_mass is not None:
        raise InputError("`known_mass` is that of a load in logs of its own; give them as `loaded`")
    return given


def calibrated(
    bare: Identification,
    logs: Sequence[Log],
    loaded: Sequence[Log],
    known_mass: float,
    kind: str,
    *,
    commanded: Trajectory | None = None,
) -> Identification:
    """Calibrate the gains, and identify once more in corrected torques; intervals allow for the gains' uncertainty."""
    if twice := {log.sha256 for log in logs} & {log.sha256 for log in loaded}:
        names = ", ".join(log.source for log in loaded if log.sha256 in twice)
        raise InputError(f"{names}: the same log is given with and without the load")
    calibration = calibrate(bare, loaded, known_mass, kind)
    recipe = replace(bare.recipe, torque_factors=tuple(calibration.factors.items()))
    result = estimate_parameters(bare.robot, bare.task, logs, recipe, commanded=commanded)
    common, factors, target = kind == "common", calibration.factors, result.target
    context = Context(target, result.prepared, recipe)
    changes = nuisance_columns(context, lambda p: corrections(target.robot, p.measured, factors, common=common))
    steps = estimate_changes(result.estimate, result.observations, changes)
    errors = steps * calibration.deviation[: steps.shape[1]]
    notes = (*calibration.notes, "intervals allow for the uncertainty of the drive gains")
    return replace(result, estimate=allowing_for(result.estimate, errors, *notes), calibration=calibration)
