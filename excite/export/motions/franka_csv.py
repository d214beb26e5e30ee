"""Joint positions for the control loop of libfranka: seven numbers in a row, one row in a millisecond."""

from __future__ import annotations

from excite.export.motions.certificate import Interpolation
from excite.export.motions.franka_limits import check_rates, is_fr3
from excite.export.motions.motion_format import MotionFile, MotionFormat
from excite.export.motions.number_rows import rows_of
from excite.export.motions.recorder import Recorder, columns
from excite.export.motions.sampled_design import SampledDesign


class FrankaCsv(MotionFormat):
    """Positions of seven joints [rad] separated by commas, without a header and without a comma at the end of a row.

    Lines that begin with # name the design; a reader skips them.
    """

    name = "franka"
    suffix = ".csv"
    default_rate = slowest = fastest = 1000.0
    joints = (7,)
    interpolation = Interpolation.LINEAR
    checked = "when excite is tested, NumPy reads such files back; none was played on a robot"

    def check(self, motion: SampledDesign) -> None:
        """Raise `BrokenLimitError` where libfranka would refuse the velocities, accelerations or jerks."""
        check_rates(motion.robot, motion.samples.q)

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Comment and rows; the numbers read back exactly."""
        about = (*motion.heading, "columns: position of each joint [rad]; one row in a millisecond")
        comment = "".join(f"# {line}\n" for line in about)
        rows = "".join(f"{row}\n" for row in rows_of(motion.samples.q))
        whose = "the FR3, whose velocity limits fall with the position" if is_fr3(motion.robot) else "the Panda"
        return MotionFile(
            f"{comment}{rows}".encode(),
            (f"differences of the rows keep libfranka's limits of velocity, acceleration and jerk for {whose}",),
        )

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """A file in the layout of libfranka's ``logToCSV``."""
        seven = range(7)
        return Recorder(
            {
                "time": {"column": "time", "unit": "ms"},
                "position": {"columns": columns("state.q[{}]", seven), "unit": "rad"},
                "velocity": {"columns": columns("state.dq[{}]", seven), "unit": "rad/s"},
                "effort": {"columns": columns("state.tau_J[{}]", seven), "unit": "Nm"},
            },
            (
                "record: franka::RobotState of every cycle, in the layout of franka::logToCSV; the log that libfranka "
                "keeps itself is short",
                "rate: 1000 Hz",
                "start marker: state.q_d begins to change",
            ),
        )
