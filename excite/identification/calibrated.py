"""Identification in torques whose gains are calibrated from a load of known mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from excite.identification.calibration import KINDS, calibrate, with_calibration
from excite.identification.estimation import estimate_parameters
from excite.identification.identification import Identification
from regressors.errors import InputError, UnknownName

if TYPE_CHECKING:
    from excite.logs.log import Log
    from excite.trajectories import Trajectory


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
    """Calibrate the gains, and identify once more in corrected torques."""
    if twice := {log.sha256 for log in logs} & {log.sha256 for log in loaded}:
        names = ", ".join(log.source for log in loaded if log.sha256 in twice)
        raise InputError(f"{names}: the same log is given with and without the load")
    calibration = calibrate(bare, loaded, known_mass, kind)
    recipe = replace(bare.recipe, torque_factors=tuple(calibration.factors.items()))
    result = estimate_parameters(bare.robot, bare.task, logs, recipe, commanded=commanded)
    return with_calibration(result, calibration)
