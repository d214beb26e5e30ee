"""Recipe of the RTDE client library of Universal Robots, and the mapping of its CSV files."""

from __future__ import annotations

from excite.export.motions.recorder import Recorder, columns, xml_comment
from excite.export.motions.sampled_design import SampledDesign

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
