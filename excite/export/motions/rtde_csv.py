"""Targets of the joints as a CSV file of the RTDE client library of Universal Robots, which its CSVReader reads."""

from __future__ import annotations

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_format import MotionFile, MotionFormat
from excite.export.motions.number_rows import rows_of
from excite.export.motions.recorder import Recorder
from excite.export.motions.rtde_recorder import rtde_recorder
from excite.export.motions.sampled_design import SampledDesign


class RtdeCsv(MotionFormat):
    """``timestamp`` [s], ``target_q_0`` to ``_5`` [rad], ``target_qd`` [rad/s], ``target_qdd`` [rad/s^2].

    Separated by spaces. The reader makes a number of every cell and takes no comments, so that the hash of the design
    is the name of the last column, whose cells are 0.
    """

    name = "rtde"
    suffix = ".csv"
    default_rate, slowest, fastest = 500.0, 1.0, 500.0
    joints = (6,)
    interpolation = Interpolation.NOT_DOCUMENTED
    checked = (
        "the file has the layout that the CSVReader of the RTDE client library reads; none was played on a robot, and "
        "what it makes of the targets depends on the program that takes them"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Header and rows."""
        names = ["timestamp", *(f"{what}_{k}" for what in ("target_q", "target_qd", "target_qdd") for k in range(6))]
        samples = motion.samples
        table = np.column_stack([samples.time, samples.q, samples.dq, samples.ddq])
        head = " ".join([*names, f"design_sha256_{motion.sha256}"])
        rows = "".join(f"{row} 0\n" for row in rows_of(table, " "))
        return MotionFile(f"{head}\n{rows}".encode())

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """The RTDE client."""
        return rtde_recorder(motion, name)
