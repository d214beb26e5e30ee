"""``trajectory.csv``: the motion of every joint of the robot at a uniform rate, SI, floats that read back exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from excite.design import Design
from excite.files.atomic import replacing
from regressors.samples import Array


def trajectory_columns(design: Design) -> tuple[list[str], Array]:
    """Header and table: ``time``, then position, velocity, acceleration of each joint.

    Joints that rest are there too, at their resting position; velocity and acceleration at both ends are exact zeros.

    Returns
    -------
    header : list of str
    table : ndarray, shape (N, 1 + 3 n)
        [s, rad, rad/s, rad/s^2, or with m]
    """
    samples, robot = design.samples, design.task.limits.applied(design.robot)
    moving = {name: k for k, name in enumerate(design.moving.joint_names)}
    header, columns = ["time"], [samples.time]
    for joint, name in enumerate(robot.joint_names):
        header += [f"{name}.{what}" for what in ("position", "velocity", "acceleration")]
        if name in moving:
            k = moving[name]
            q, dq, ddq = samples.q[:, k], samples.dq[:, k], samples.ddq[:, k]
        else:
            rest = float(np.clip(0.0, robot.limits.lower[joint], robot.limits.upper[joint]))
            q, dq, ddq = np.full_like(samples.time, rest), np.zeros_like(samples.time), np.zeros_like(samples.time)
        columns += [q, dq, ddq]
    return header, np.column_stack(columns)


def write_trajectory(design: Design, path: Path) -> None:
    """Write the motion of a design.

    Parameters
    ----------
    design : Design
    path : Path
    """
    header, table = trajectory_columns(design)
    with replacing(path) as stream:
        np.savetxt(stream, table, fmt="%.17g", delimiter=",", header=",".join(header), comments="")
