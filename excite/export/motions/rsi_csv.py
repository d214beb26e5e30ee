"""Positions for clients of KUKA's Robot Sensor Interface or Fast Robot Interface, and what these record."""

from __future__ import annotations

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_format import MotionFile, MotionFormat, Recorder, columns, rows_of, xml_comment
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


_AXES = range(1, 7)


def rsi_recorder(motion: SampledDesign) -> Recorder:
    """Configuration of the RSI object ETHERNET: measured axes and motor currents in every cycle."""
    return Recorder(
        {
            "time": {"column": "time", "unit": "s"},
            "position": {"columns": columns("AIPos.A{}", _AXES), "unit": "deg"},
            "current": {"columns": columns("MACur.A{}", _AXES), "unit": "A", "gain": [1.0] * 6},
        },
        (
            "record: the elements AIPos and MACur of every telegram, as a CSV file with the columns time [s] (from "
            "IPOC [ms]), AIPos.A1 ... AIPos.A6 [deg], MACur.A1 ... MACur.A6",
            "rate: 250 Hz (cycle of 4 ms)",
            "start marker: the first change of AIPos",
            "gain: torque of the joint per unit of its current [Nm/A]; 1 gives torques in the unit of the currents",
        ),
        ".xml",
        _ethernet(motion),
        (
            "the gains of the currents in the mapping are 1: write the torque per unit of current there, or calibrate "
            "them with `loaded` and `known_mass`",
        ),
    )


def _ethernet(motion: SampledDesign) -> str:
    corrections = "\n".join(f'      <ELEMENT TAG="AK.A{k}" TYPE="DOUBLE" INDX="{k}" HOLDON="1" />' for k in _AXES)
    return (
        f'<?xml version="1.0"?>\n<!--\n{xml_comment(motion)}\n  Set the address and port of your computer.\n-->\n'
        "<ROOT>\n  <CONFIG>\n"
        "    <IP_NUMBER>192.168.1.2</IP_NUMBER>\n    <PORT>49152</PORT>\n    <SENTYPE>excite</SENTYPE>\n"
        "    <ONLYSEND>FALSE</ONLYSEND>\n  </CONFIG>\n  <SEND>\n    <ELEMENTS>\n"
        '      <ELEMENT TAG="DEF_AIPos" TYPE="DOUBLE" INDX="INTERNAL" />\n'
        '      <ELEMENT TAG="DEF_MACur" TYPE="DOUBLE" INDX="INTERNAL" />\n'
        f"    </ELEMENTS>\n  </SEND>\n  <RECEIVE>\n    <ELEMENTS>\n{corrections}\n"
        "    </ELEMENTS>\n  </RECEIVE>\n</ROOT>\n"
    )


def fri_recorder(motion: SampledDesign) -> Recorder:
    """States of a client of the Fast Robot Interface."""
    seven = range(7)
    return Recorder(
        {
            "time": {"column": "time", "unit": "s"},
            "position": {"columns": columns("measuredJointPosition[{}]", seven), "unit": "rad"},
            "effort": {"columns": columns("measuredTorque[{}]", seven), "unit": "Nm"},
        },
        (
            "record: getMeasuredJointPosition() and getMeasuredTorque() of LBRState in every cycle, as a CSV file with "
            "the columns time [s], measuredJointPosition[0] ..., measuredTorque[0] ...",
            f"rate: {motion.rate:g} Hz, that of the session",
            "start marker: the session changes to COMMANDING_ACTIVE",
        ),
    )
