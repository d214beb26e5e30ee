"""``trajectory.csv``: the motion of every joint of the robot at a uniform rate, SI, floats that read back exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from excite.design.design import Design
from excite.logs.csv_header import header_text
from excite.storage.atomic import replacing
from excite.storage.finite import check_table
from regressors.samples import Array, Samples

SEGMENT = "segment"


def trajectory_columns(design: Design, speed: float = 1.0) -> tuple[list[str], Array]:
    """Header and table: ``time``, then position, velocity, acceleration of each joint.

    Locked joints are included, at their resting position; velocity and acceleration at both ends are exact zeros.
    """  # result (N, 1 + 3 n)
    return _columns(design, design.sequence.sampled(speed)[0])


def _columns(design: Design, samples: Samples) -> tuple[list[str], Array]:
    header, columns = ["time"], [samples.time]
    for joint, name in enumerate(design.robot.joint_names):
        header += [f"{name}.{what}" for what in ("position", "velocity", "acceleration")]
        columns += [samples.q[:, joint], samples.dq[:, joint], samples.ddq[:, joint]]
    return header, np.column_stack(columns)


def write_trajectory(design: Design, path: Path, speed: float = 1.0) -> None:
    """Write the motion of a design; with approach and return, a last column ``segment`` is added."""
    samples, segments = design.sequence.sampled(speed)
    header, table = _columns(design, samples)
    form = ",".join(["%.17g"] * len(header))
    check_table(path, header, table)
    with replacing(path) as stream:
        if design.approach_and_return is None:
            np.savetxt(stream, table, fmt=form, header=header_text(header), comments="")
            return
        stream.write(header_text([*header, SEGMENT]) + "\n")
        stream.writelines(f"{form % tuple(row)},{segment}\n" for row, segment in zip(table, segments, strict=True))
