"""A log in which a drive moves, and the parts of a plan that it contains."""

from __future__ import annotations

from dataclasses import dataclass

from excite.friction.fit.plan_match import PlanMatch, Ramped
from excite.friction.fit.points import DriveLog
from excite.friction.fit.rigid_torques import RigidModel
from regressors.errors import InputError


@dataclass(frozen=True, eq=False)
class Source:
    """A log in which a drive moves."""

    number: int  # of the log
    measured: DriveLog
    model: RigidModel | None  # without friction
    unknown: InputError | None = None  # why there is no model
    # where it has the runs of a plan; with a plan but no runs, only break-aways are evaluated
    plan_match: PlanMatch | None = None
    ramped: Ramped | None = None  # where it has the drive's torque ramps of a plan
