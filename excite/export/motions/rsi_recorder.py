"""What KUKA's Robot Sensor Interface, or the Fast Robot Interface, sends while a motion is played."""

from __future__ import annotations

from excite.export.motions.recorder import Recorder, columns, xml_comment
from excite.export.motions.sampled_design import SampledDesign

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
