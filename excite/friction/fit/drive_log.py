"""A log in which a drive moves, and the parts of a plan that it contains."""

from __future__ import annotations

from dataclasses import dataclass

from excite.friction.fit.plan_match import PlanMatch
from excite.friction.fit.points import DriveLog
from excite.friction.fit.ramp_match import Ramped
from excite.friction.fit.rigid_torques import RigidModel
from regressors.errors import InputError


@dataclass(frozen=True, eq=False)
class Source:
    """A log in which a drive moves.

    Parameters
    ----------
    number : int
        Of the log.
    measured : DriveLog
    model : RigidModel, optional
        Without friction.
    unknown : InputError, optional
        Why there is no model.
    plan_match : PlanMatch, optional
        Where it has the runs of a plan; with a plan but no runs, only break-aways are evaluated.
    ramped : Ramped, optional
        Where it has the drive's torque ramps of a plan.
    """

    number: int
    measured: DriveLog
    model: RigidModel | None
    unknown: InputError | None = None
    plan_match: PlanMatch | None = None
    ramped: Ramped | None = None
