"""Drive gains calibrated from logs with and without a load of known mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.stats

from excite.identification.allowances import estimate_changes
from excite.identification.drive_gains import (
    BLOCKS,
    GainCalibration,
    LogFile,
    block_deviation,
    corrections,
    drive_gains,
    drives_of_torques,
)
from excite.identification.equations import equations_of, right_sides
from excite.identification.estimate import CONFIDENCE, allowing_for
from excite.identification.estimation import estimate_parameters
from excite.identification.identification import Identification
from excite.identification.observations import Observations, join_observations
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.logs.log import Log
from excite.trajectories import Trajectory
from regressors.errors import InputError, UnknownName
from regressors.models.load import PayloadModel
from regressors.samples import Array

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
    gains = drive_gains(observations, load, known_mass, common=kind == "common")
    deviation = block_deviation(observations, load, gains, common=kind == "common")
    half = deviation * float(scipy.stats.t.ppf(0.5 + CONFIDENCE / 2, BLOCKS - 1))
    if np.any(blind := half > _LEAST_KNOWN * gains.factor):
        raise InputError(
            f"the load hardly acts on {', '.join(np.array(names)[blind])}: the gain would be known to "
            f"{100 * float(np.max(half / gains.factor)):.2g} % only; move these joints more in the `loaded` logs, or "
            "give `gains='common'`"
        )
    files = tuple(LogFile(log.source, log.sha256) for log in loaded)
    return GainCalibration(kind, names, gains.factor, deviation, half, float(known_mass), gains.stated_mass, files)


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
    changes = [
        right_sides(target, part, recipe, corrections(target.robot, part.measured, factors, common=common))
        for part in result.prepared
    ]
    steps = estimate_changes(result.estimate, result.observations, np.concatenate(changes))
    errors = steps * calibration.deviation[: steps.shape[1]]
    notes = (*calibration.notes, "intervals allow for the uncertainty of the drive gains")
    return replace(result, estimate=allowing_for(result.estimate, errors, *notes), calibration=calibration)
