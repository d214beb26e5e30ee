"""Positions for a client of KUKA's Robot Sensor Interface (six axes) or of the Fast Robot Interface (seven)."""

from __future__ import annotations

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_format import MotionFile, MotionFormat
from excite.export.motions.number_rows import rows_of
from excite.export.motions.recorder import Recorder
from excite.export.motions.rsi_recorder import fri_recorder, rsi_recorder
from excite.export.motions.sampled_design import SampledDesign


class RsiCsv(MotionFormat):
    """One row in a cycle, with a header.

    RSI, six axes: ``time`` [s], positions ``A1`` to ``A6`` and the corrections ``AK.A1`` to ``AK.A6`` from the first
    pose, which an AXISCORR in absolute mode takes [deg]. FRI, seven joints: ``time`` [s], ``J1`` to ``J7`` [rad].
    """

    name = "rsi"
    suffix = ".csv"
    default_rate, slowest, fastest = 250.0, 10.0, 1000.0
    joints = (6, 7)
    interpolation = Interpolation.LINEAR
    whole_nanoseconds = True
    checked = (
        "when excite is tested, NumPy reads such files back; none was played on a robot: neither RSI nor FRI has a "
        "file of its own"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Comment, header and rows."""
        q = motion.samples.q
        if q.shape[1] == 7:
            names, table = [f"J{k}" for k in range(1, 8)], q
        else:
            degrees, axes = np.degrees(q), range(1, 7)
            names = [*(f"A{k}" for k in axes), *(f"AK.A{k}" for k in axes)]
            table = np.column_stack([degrees, degrees - degrees[0]])
        comment = "".join(f"# {line}\n" for line in motion.heading)
        rows = rows_of(table + 0.0)
        lines = "".join(f"{t:.9f},{row}\n" for t, row in zip(motion.time.tolist(), rows, strict=True))
        return MotionFile(f"{comment}{','.join(['time', *names])}\n{lines}".encode())

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """The client itself."""
        return fri_recorder(motion) if motion.robot.n == 7 else rsi_recorder(motion)
