"""Load shares of an identified model: what its drives carry under given torques."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from regressors.friction.curves import carried_along, smooth_direction, torques_at_drives
from regressors.friction.load_share import carried_expression
from regressors.models.base import Base
from regressors.models.columns import LOAD_SHARE
from regressors.models.drives import drive_rows
from regressors.models.model import RegressorModel
from regressors.robot.robot import Robot
from regressors.samples import Array
from regressors.symbolic.kinematics import sparse

_MOST = 0.99  # from 1 on, a drive would hold any load


def load_shares(model: RegressorModel, base: Base, beta: Array) -> dict[int, float]:
    """Load share of every drive that has one among the base parameters, by the drive's number."""  # beta (b,)
    composition = model.composition
    values = composition.matrix[:, base.index] @ beta
    pairs = zip(composition.standard, values, strict=True)
    shares = {c.owner: float(v) for c, v in pairs if c.kind == LOAD_SHARE and c.owner is not None}
    return {number: float(np.clip(share, -_MOST, _MOST)) for number, share in shares.items()}


def carried_along_motion(
    robot: Robot, shares: Mapping[int, float], N: Array, dq: ca.SX, tau: ca.SX, width: float
) -> ca.SX:
    """Torques of moving coordinates that the drives carry: tau of ``tau + F.l s |tau| = given``, drive by drive.

    The load is the identified robot's own. The model's regressor takes that of fixed parameters; both are the same
    where these are those of the estimate.
    """  # N (n, k); dq (n, 1); tau (k, 1)
    joints = ca.mtimes(sparse(carried_along(robot, N)), tau)
    to_drives, direction = torques_at_drives(robot), smooth_direction(robot, dq, width)
    z = ca.mtimes(sparse(to_drives), joints)
    moving = [number for number in drive_rows(robot) if _turns(robot, number)]
    loads = [
        carried_expression(z[k], shares[number] * direction[k]) if number in shares else z[k]
        for k, number in enumerate(moving)
    ]
    return ca.mtimes(sparse(N.T @ np.linalg.inv(to_drives)), ca.vertcat(*loads))


def _turns(robot: Robot, number: int) -> bool:
    return robot.transmission is None or not robot.transmission.drives[number - 1].rests
