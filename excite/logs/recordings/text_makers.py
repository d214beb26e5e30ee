"""Tables in text whose columns are defined by the program that writes them.

- Universal Robots, Real-Time Data Exchange (RTDE) Guide, table of the outputs of the controller: ``timestamp`` [s],
  ``actual_q`` [rad], ``actual_qd`` [rad/s], ``actual_current`` [A], ``joint_temperatures`` [deg C], and since PolyScope
  5.23 ``actual_current_as_torque`` [Nm]; the clients of the RTDE number the elements of a vector, ``actual_q_0``.
- libfranka, ``franka::logToCSV``: ``time`` [ms], ``state.q[0]`` [rad], ``state.dq[0]`` [rad/s], and ``state.tau_J[0]``
  [Nm], measured torques on the side of the links.
- The house format, see `excite.logs.log_reading.read_log`.
- PlotJuggler, CSV exporter: ``__time`` [s]; topics keep their names, those of ``sensor_msgs/JointState`` as
  ``/TOPIC/JOINT/position`` [rad], ``velocity`` [rad/s], ``effort`` [Nm].
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from excite.logs.recordings.recording import JOINT_STATE, Meaning


@dataclass(frozen=True)
class TextMaker:
    """A program that writes tables."""

    name: str
    marks: frozenset[str]  # columns by which its tables are recognised
    clock: str  # column of the time, and its unit
    unit: str
    # quantity and unit by the pattern of a column's name, whose group is the joint
    columns: Mapping[str, tuple[str, str]]
    why: str  # source of the definitions

    def meanings(self, names: Sequence[str]) -> dict[str, Meaning]:
        """What the columns of a table are, of those that are defined."""
        defined = ((name, self._meaning(name)) for name in names)
        return {name: meaning for name, meaning in defined if meaning is not None}

    def _meaning(self, name: str) -> Meaning | None:
        for pattern, (quantity, unit) in self.columns.items():
            if match := re.fullmatch(pattern, name):
                return Meaning(quantity, match[1], unit, self.why)
        return None


MAKERS = (
    TextMaker(
        "Universal Robots RTDE recording",
        frozenset({"timestamp", "actual_q_0"}),
        "timestamp",
        "s",
        {
            r"actual_q_(\d)": ("position", "rad"),
            r"actual_qd_(\d)": ("velocity", "rad/s"),
            r"actual_current_(\d)": ("current", "A"),
            r"actual_current_as_torque_(\d)": ("effort", "Nm"),
            r"joint_temperatures_(\d)": ("temperature", "degC"),
        },
        "RTDE Guide of Universal Robots",
    ),
    TextMaker(
        "libfranka log",
        frozenset({"time", "success_rate", "state.q[0]"}),
        "time",
        "ms",
        {
            r"state\.q\[(\d)\]": ("position", "rad"),
            r"state\.dq\[(\d)\]": ("velocity", "rad/s"),
            r"state\.tau_J\[(\d)\]": ("effort", "Nm"),
        },
        "franka::logToCSV",
    ),
    TextMaker(
        "PlotJuggler",
        frozenset({"__time"}),
        "__time",
        "s",
        {
            r"/(?:.*/)?joint_states/([^/]+)/position": ("position", "rad"),
            r"/(?:.*/)?joint_states/([^/]+)/velocity": ("velocity", "rad/s"),
            r"/(?:.*/)?joint_states/([^/]+)/effort": ("effort", "Nm"),
        },
        JOINT_STATE,
    ),
)

HOUSE = TextMaker(
    "excite log",
    frozenset({"time"}),
    "time",
    "s",
    {
        r"(.+)\.position": ("position", "rad"),
        r"(.+)\.velocity": ("velocity", "rad/s"),
        r"(.+)\.effort": ("effort", "Nm"),
        r"(.+)\.temperature": ("temperature", "degC"),
        r"wrench\.((?:force|torque)\.[xyz])": ("wrench", "N"),
    },
    "the house format",
)


def maker_of(titles: Sequence[str]) -> TextMaker | None:
    """Program that writes a table with these columns, None if it is unknown."""
    there = set(titles)
    if there >= HOUSE.marks and any(title.endswith(".position") for title in titles):
        return HOUSE
    return next((maker for maker in MAKERS if there >= maker.marks), None)
