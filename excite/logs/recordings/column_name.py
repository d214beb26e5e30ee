"""What the name of a column says: quantity, unit as people write it, whether it was measured, and whose it is."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

_WORDS: Mapping[str, str] = {
    "position": "position positions pos q qs angle angles theta phi qpos jointpos jointposition jointpositions",
    "velocity": "velocity velocities vel dq qd qdot qvel dtheta thetadot omega speed speeds dqs qds jointvel",
    "effort": "effort efforts torque torques tau moment moments trq",
    "current": "current currents cur i iq amps motorcurrent",
    "temperature": "temperature temperatures temp temps",
    "time": "time times timestamp timestamps t stamp elapsed clock",
}
_QUANTITY_OF = {word: quantity for quantity, words in _WORDS.items() for word in words.split()}
_REFERRED = (
    "target targets desired des d cmd command commanded commands reference ref goal setpoint error err errors "
    "feedforward ff ddq acc acceleration accelerations ddtheta qddot qdd ext external hat filtered limit limits tcp "
    "cartesian min max std"
)
_NOT_MEASURED = frozenset(_REFERRED.split())
_BRACKET = re.compile(r"[\[(]([^\])]*)[\])]\s*$")
_PART = re.compile(r"[A-Z]{2,}(?=[A-Z][a-z]|\d|\b|_)|[A-Z]?[a-z]+|[A-Z]+|\d+")
_DEGREE, _MICRO, _DOT = "\N{DEGREE SIGN}", "\N{MICRO SIGN}", "\N{MIDDLE DOT}"
_WRITTEN: Mapping[tuple[str, str], str] = {  # quantity and unit of the mapping: how it is written, in lower case
    ("position", "rad"): "rad radian radians",
    ("position", "deg"): f"deg degree degrees {_DEGREE}",
    ("position", "turns"): "turns",
    ("position", "rev"): "rev",
    ("position", "ticks"): "ticks counts inc",
    ("position", "m"): "m",
    ("position", "mm"): "mm",
    ("velocity", "rad/s"): "rad/s rad/sec rad_s radps rads",
    ("velocity", "deg/s"): f"deg/s deg/sec deg_s degps dps {_DEGREE}/s",
    ("velocity", "rpm"): "rpm 1/min",
    ("velocity", "rev/s"): "rev/s",
    ("velocity", "m/s"): "m/s",
    ("velocity", "mm/s"): "mm/s",
    ("effort", "Nm"): f"nm n.m n*m n{_DOT}m",
    ("effort", "mNm"): "mnm",
    ("effort", "kNm"): "knm",
    ("effort", "N"): "n",
    ("effort", "kN"): "kn",
    ("current", "A"): "a amp ampere",
    ("current", "mA"): "ma",
    ("temperature", "degC"): f"degc celsius c {_DEGREE}c",
    ("temperature", "K"): "k",
    ("temperature", "degF"): "degf",
    ("time", "s"): "s sec secs seconds",
    ("time", "ms"): "ms msec",
    ("time", "us"): f"us usec {_MICRO}s",
    ("time", "ns"): "ns nsec nanosec",
}
_KNOWN = {text: meaning for meaning, texts in _WRITTEN.items() for text in texts.split()}
_NONE = ("", "")


@dataclass(frozen=True)
class ColumnName:
    """What a name says."""

    quantity: str  # time, position, velocity, effort, current or temperature; empty where it says nothing
    unit: str  # in the words of the mapping; empty where it says nothing
    label: tuple[str, ...]  # what is left of its words: a number or the name of a joint, and what stands before it
    measured: bool  # not of something desired, commanded or limited


def parsed_name(name: str, unit: str = "") -> ColumnName:
    """What the name of a column says, and the unit that the file states beside it, literally."""
    of, given = stated_unit(unit)
    if not given and (bracket := _BRACKET.search(name)):
        of, given = stated_unit(bracket[1])
        name = name[: bracket.start()] if given else name
    words = [part.lower() for part in _PART.findall(name)]
    if not given:
        words, (of, given) = _without_unit(words)
    place = next((k for k in reversed(range(len(words))) if words[k] in _QUANTITY_OF), None)
    quantity = "" if place is None else _QUANTITY_OF[words[place]]
    if not quantity or (quantity == "time" and of not in ("", "time")):
        quantity = of
    rest = tuple(word for k, word in enumerate(words) if k != place)
    fits = of == quantity
    return ColumnName(quantity, given if fits else "", rest, not _NOT_MEASURED.intersection(rest))


def _without_unit(words: list[str]) -> tuple[list[str], tuple[str, str]]:
    """Words without those of a unit at the end, as in ``pos_deg`` and ``vel_deg_s``, and that unit."""
    for count in (2, 1):
        unit = stated_unit("_".join(words[-count:]))
        if unit != _NONE and len(words) > count and len("".join(words[-count:])) > 1:
            return words[:-count], unit
    return words, _NONE


def is_clock(name: str, unit: str = "") -> bool:
    """Whether a name says that a column is a time."""
    parsed = parsed_name(name, unit)
    return parsed.quantity == "time" and not any(word.isdigit() for word in parsed.label)


def stated_unit(text: str) -> tuple[str, str]:
    """Quantity and unit that a text such as ``[deg/s]`` states; two empty strings for none."""
    return _KNOWN.get(text.strip().strip("[]()").strip().lower().replace("n m", "nm"), _NONE)
