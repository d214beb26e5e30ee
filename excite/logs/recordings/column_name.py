"""What the name of a column says: quantity, unit, whether it was measured, and which joint's it is."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from excite.logs.recordings.stated_unit import NONE, stated_unit

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


@dataclass(frozen=True)
class ColumnName:
    """What a name says."""

    # ``time``, ``position``, ``velocity``, ``effort``, ``current`` or ``temperature``; empty where it says nothing
    quantity: str
    unit: str  # in the words of the mapping; empty where it says nothing
    # what is left of the name's words without these: a number or the name of a joint, and what stands before it
    label: tuple[str, ...]
    measured: bool  # whether it is not of something desired, commanded or limited


def parsed_name(name: str, unit: str = "") -> ColumnName:
    """What the name of a column says."""
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
        if unit != NONE and len(words) > count and len("".join(words[-count:])) > 1:
            return words[:-count], unit
    return words, NONE


def is_clock(name: str, unit: str = "") -> bool:
    """Whether a name says that a column is a time."""
    parsed = parsed_name(name, unit)
    return parsed.quantity == "time" and not any(word.isdigit() for word in parsed.label)
