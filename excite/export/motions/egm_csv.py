"""Positions and velocities for a client of ABB's Externally Guided Motion, one row for each EgmSensor message."""

from __future__ import annotations

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_format import MotionFile, MotionFormat, Recorder, columns, rows_of
from excite.export.motions.sampled_design import SampledDesign

_AXES = range(1, 7)


class EgmCsv(MotionFormat):
    """Header, then ``time`` [s], ``planned.joints[1]`` to ``[6]`` [deg], ``speedRef.joints[1]`` to ``[6]`` [deg/s]."""

    name = "egm"
    suffix = ".csv"
    default_rate, slowest, fastest = 250.0, 10.0, 250.0
    joints = (6,)
    interpolation = Interpolation.LINEAR
    whole_nanoseconds = True
    checked = (
        "when excite is tested, NumPy reads such files back; none was played on a robot, and the filter that EGM puts "
        "after the positions is a setting of the controller"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Comment, header and rows."""
        names = ["time", *columns("planned.joints[{}]", _AXES), *columns("speedRef.joints[{}]", _AXES)]
        comment = "".join(f"# {line}\n" for line in motion.heading)
        table = np.degrees(np.column_stack([motion.samples.q, motion.samples.dq]))
        rows = rows_of(table + 0.0)
        lines = "".join(f"{t:.9f},{row}\n" for t, row in zip(motion.time.tolist(), rows, strict=True))
        return MotionFile(f"{comment}{','.join(names)}\n{lines}".encode())

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """Feedback of EGM with torques of the controller's test signals."""
        return abb_recorder(motion)


def abb_recorder(motion: SampledDesign) -> Recorder:
    """Positions of EgmRobot messages and torques of test signals, as a CSV file."""
    return Recorder(
        {
            "time": {"column": "time", "unit": "s"},
            "position": {"columns": columns("feedBack.joints[{}]", _AXES), "unit": "deg"},
            "effort": {"columns": columns("torque[{}]", _AXES), "unit": "Nm"},
        },
        (
            "record: feedBack.joints [deg] of every EgmRobot message, and the joint torques [Nm] of the controller's "
            "test signals (ABB TuneMaster), as a CSV file with the columns time [s], feedBack.joints[1] ..., "
            "torque[1] ...",
            "rate: 250 Hz",
            "start marker: the first change of feedBack.joints",
        ),
        notes=("EGM sends no torques: record them as test signals of the controller, on the same clock",),
    )
