"""Drives that gravity does not load, whatever the masses of the links, by the structure of the model."""

from __future__ import annotations

import numpy as np

from excite.friction.fit.points import DriveLog

_LOOKED_AT = 50  # poses of a log that are checked
_NOTHING = 1e-8  # Nm or N


def never_loaded(measured: DriveLog, drive: str) -> bool:
    """Whether gravity exerts no torque on a drive in the poses of a log, even if masses are unknown.

    With torques ``tau_q = C' tau_z`` the drive's is ``N' tau_q``, N the column of the inverse of C that moves it alone.
    """
    from excite.friction.plan.pose import Gravity

    line = np.linalg.pinv(measured.rows.T)[measured.names.index(drive)]
    rows = np.unique(np.linspace(0, measured.log.count - 1, _LOOKED_AT).astype(int))
    columns = [measured.log.joints.index(name) for name in measured.robot.joint_names]
    torque = Gravity(measured.robot).along(line, measured.log.q[rows][:, columns])
    return bool(np.all(np.abs(torque) <= _NOTHING))  # False where it is unknown (NaN)
