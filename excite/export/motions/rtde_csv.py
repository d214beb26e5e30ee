"""Targets for the RTDE client library of Universal Robots, and the recipe of what it records."""

from __future__ import annotations

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_format import MotionFile, MotionFormat, Recorder, columns, rows_of, xml_comment
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


MARKER = 24  # integer register for the segment; 24 to 47 are for external RTDE clients
FIELDS = (
    ("timestamp", "DOUBLE"),
    ("target_q", "VECTOR6D"),
    ("target_qd", "VECTOR6D"),
    ("target_qdd", "VECTOR6D"),
    ("target_current", "VECTOR6D"),
    ("target_moment", "VECTOR6D"),
    ("actual_q", "VECTOR6D"),
    ("actual_qd", "VECTOR6D"),
    ("actual_current", "VECTOR6D"),
    ("joint_temperatures", "VECTOR6D"),
    ("runtime_state", "UINT32"),
    (f"output_int_register_{MARKER}", "INT32"),
)
_FASTEST = 500.0


def rtde_recorder(motion: SampledDesign, name: str) -> Recorder:
    """``record_configuration.xml`` of the library's example ``record.py``, and how its file is read."""
    six = range(6)
    return Recorder(
        {
            "separator": "whitespace",
            "time": {"column": "timestamp", "unit": "s"},
            "position": {"columns": columns("actual_q_{}", six), "unit": "rad"},
            "velocity": {"columns": columns("actual_qd_{}", six), "unit": "rad/s"},
            "current": {"columns": columns("actual_current_{}", six), "unit": "A", "gain": [1.0] * 6},
            "temperature": {"columns": columns("joint_temperatures_{}", six), "unit": "degC"},
        },
        (
            f"record: python record.py --config {name}.record.xml --frequency {_FASTEST:g} --output {name}.log.csv",
            f"rate: {_FASTEST:g} Hz of e-Series, 125 Hz of CB-Series",
            f"start marker: output_int_register_{MARKER} is 1 on the approach, 2 while it excites, 3 on the return",
            "gain: torque constants of the drives [Nm/A]; 1 gives torques in amperes",
        ),
        ".xml",
        _recipe(motion),
        (
            "the gains of the currents in the mapping are 1: write the torque constants [Nm/A] of the joints there, or "
            "calibrate them with `loaded` and `known_mass`; controllers since 5.23 also have the field "
            "actual_current_as_torque",
        ),
    )


def _recipe(motion: SampledDesign) -> str:
    fields = "\n".join(f'        <field name="{name}" type="{kind}"/>' for name, kind in FIELDS)
    return (
        f'<?xml version="1.0"?>\n<!--\n{xml_comment(motion)}\n-->\n<rtde_config>\n    <recipe key="out">\n{fields}\n'
        "    </recipe>\n</rtde_config>\n"
    )
