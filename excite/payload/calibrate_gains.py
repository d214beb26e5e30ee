"""Factors of drive gains from logs with and without a load whose mass is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from excite.identification.preparation import drives_of_torques
from excite.identification.procedure import LogLike
from excite.payload.known_gains import KnownGains, stated_gains
from excite.payload.load_estimate import LoadEstimate, estimate_load
from excite.payload.load_rows import (
    LIKELY_CAUSE,
    LogChoice,
    bare_task,
    check_pair,
    loaded_parts,
    paired_equations,
    without_load,
)
from excite.storage.records import Shown
from excite.tasks.installation import Installation
from excite.tasks.robot_of_task import robot_and_task
from regressors.arguments import checked
from regressors.errors import InputError, check_names, percent
from regressors.numerical import numerical_work, one_thread
from regressors.quantities import Tips, check
from regressors.robot.robot import Robot

KINDS = ("each", "common")
_FREE = 10.0  # relative deviation of the factor of all drives before the known mass is used
_APART = 0.1  # and of each drive's about it
_ALIKE = 1e-4  # of each, where all are to have the same
_LEAST_KNOWN = 0.5  # half of an interval over the factor, from which on the load does not show it


@dataclass(frozen=True, eq=False, repr=False)
class CalibratedGains(Shown):
    """Gains from a load of known mass.

    Parameters
    ----------
    robot : str
    gains : KnownGains
    known_mass, stated_mass : float
        Mass of the load, and the one that is identified with the gains as stated [kg].
    quantile : float
        Half of a 99 % interval over the standard deviation.
    notes : tuple of str
    """

    robot: str
    gains: KnownGains
    known_mass: float
    stated_mass: float
    quantile: float
    notes: tuple[str, ...]

    def content(self) -> dict[str, Any]:
        """Plain values, for summaries."""
        rows = zip(self.gains.drives, self.gains.factor.tolist(), self.gains.deviation.tolist(), strict=True)
        return {
            "robot": self.robot,
            "known_mass": self.known_mass,
            "stated_mass": self.stated_mass,
            "drives": {
                name: {"factor": g, "deviation": s, "interval": [g - self.quantile * s, g + self.quantile * s]}
                for name, g, s in rows
            },
            "notes": list(self.notes),
        }

    def __repr__(self) -> str:
        """One line."""
        factors = ", ".join(f"{name} {g:.3f}" for name, g in zip(self.gains.drives, self.gains.factor, strict=True))
        return f"<CalibratedGains of {self.robot}: {factors}>"


@checked
@numerical_work("the calibration of gains", LIKELY_CAUSE)
def calibrate_gains(
    robot: Robot | str,
    loaded: LogLike | Sequence[LogLike],
    without: LogLike | Sequence[LogLike],
    mass: float,
    /,
    *,
    kind: str = "each",
    logs: LogChoice | None = None,
    base_link: str | None = None,
    tip: Tips = None,
    snap_angles: bool = True,
    xacro: bool = False,
    installation: Installation | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibratedGains:
    """Calibrate the gains of the drives with a load of known mass.

    The factor of all drives is free; that of each is known beforehand to be within about 10 % (standard deviation) of
    it, so that drives which the load hardly moves keep the common one.

    Parameters
    ----------
    robot : Robot or str
    loaded, without : Log, frame, dict of columns, Simulation, path, or a sequence of them
        With the load at the last link, and without it.
    mass : float
        Of the load [kg].
    kind : {"each", "common"}
        A factor of each drive, or one of all.
    logs : LogChoice, optional
    base_link, tip, snap_angles, xacro, installation
        See `excite.identify`.
    progress : callable

    Returns
    -------
    CalibratedGains

    Raises
    ------
    InputError
        Logs that do not fit, or a load that does not show the gains.
    """
    check_names("kind of gains", [kind], KINDS)
    check("known_mass", mass, "`mass`")
    choice = logs if logs is not None else LogChoice()
    whole, task = robot_and_task(robot, base_link, tip, installation, snap_angles, xacro)
    task = bare_task(whole, task)
    with one_thread():
        with_load = choice.read(loaded, whole, choice.rows, progress)
        bare = choice.read(without, whole, choice.without_rows, progress)
        check_pair(bare, with_load)
        model = without_load(whole, task, bare, choice.recipe([*bare, *with_load], choice.without_rows), progress)
        parts = loaded_parts(model, with_load, choice.rows)
        drives, _ = drives_of_torques(model.target.robot, each=False)
        prior = stated_gains(drives, _FREE, _APART if kind == "each" else _ALIKE)
        equations = paired_equations(model, parts, model.recipe, prior)
        progress("estimating the gains")
        free = estimate_load(replace(equations, gains=stated_gains(drives).relative))
        if free.phi[0] <= 0:
            raise InputError(
                f"with the stated gains the load would weigh {free.phi[0]:.3g} kg, which no load does: check which log "
                "is with the load, and the sign and unit of the torques"
            )
        estimate = estimate_load(equations, mass, start=mass / float(free.phi[0]))
    gains = _factors(drives, estimate, tuple(log.sha256 for log in with_load), mass)
    half = estimate.quantile * gains.deviation / gains.factor
    if half.max() > _LEAST_KNOWN:
        worst = drives[int(np.argmax(half))]
        raise InputError(
            f"the load hardly shows the gains: that of {worst} would be known to {percent(half.max())} only; move "
            "more joints against gravity in both logs, or take a heavier load"
        )
    stated = float(free.phi[0])
    note = f"the load weighs {mass:.4g} kg; with the stated gains it would be {stated:.4g} kg"
    return CalibratedGains(whole.name, gains, mass, stated, estimate.quantile, (note,))


def _factors(drives: Sequence[str], estimate: LoadEstimate, logs: tuple[str, ...], mass: float) -> KnownGains:
    """Factors ``g = 1 / (1 + e)``."""
    scale = 1.0 + estimate.gains
    if np.any(scale <= 0):
        raise InputError("the logs need gains that are not positive: check the sign and unit of the torques")
    factor = 1.0 / scale
    covariance = estimate.gains_covariance * np.outer(factor**2, factor**2)
    return KnownGains(tuple(drives), factor, covariance, f"drive gains as calibrated with a load of {mass:g} kg", logs)
