"""What the name of a column says: quantity, unit, whether it was measured, and which joint's it is."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

QUANTITIES: Mapping[str, frozenset[str]] = {
    "position": frozenset(
        "position positions pos q qs angle angles theta phi qpos jointpos jointposition jointpositions achsposition "
        "jointangle jointangles qactual".split()
    ),
    "velocity": frozenset(
        "velocity velocities vel dq qd qdot qvel dtheta thetadot omega speed speeds dqs qds jointvel jointvelocity "
        "jointvelocities dphi".split()
    ),
    "effort": frozenset("effort efforts torque torques tau tauj moment moments trq".split()),
    "current": frozenset("current currents cur i iq amps motorcurrent".split()),
    "temperature": frozenset("temperature temperatures temp temps".split()),
}
_TIMES = frozenset("time times timestamp timestamps t stamp elapsed zeit clock timesec times0 timens timems".split())
_COMMANDED = frozenset(
    "target targets desired des d cmd command commanded commands reference ref goal setpoint error err errors soll "
    "feedforward ff ddq acc acceleration accelerations ddtheta qddot qdd ext external hat filtered window limit "
    "limits tcp cartesian min max std".split()
)
_UNITS: Mapping[str, tuple[str, str]] = {  # literal: quantity, unit of the mapping
    "rad": ("position", "rad"), "radian": ("position", "rad"), "radians": ("position", "rad"),
    "deg": ("position", "deg"), "degree": ("position", "deg"), "degrees": ("position", "deg"), "\N{DEGREE SIGN}": ("position", "deg"),
    "turns": ("position", "turns"), "rev": ("position", "rev"),
    "ticks": ("position", "ticks"), "counts": ("position", "ticks"), "inc": ("position", "ticks"),
    "m": ("position", "m"), "mm": ("position", "mm"),
    "rad/s": ("velocity", "rad/s"), "rads": ("velocity", "rad/s"), "rad/sec": ("velocity", "rad/s"),
    "rad_s": ("velocity", "rad/s"), "radps": ("velocity", "rad/s"), "deg/s": ("velocity", "deg/s"),
    "deg_s": ("velocity", "deg/s"), "degps": ("velocity", "deg/s"), "dps": ("velocity", "deg/s"),
    "deg/sec": ("velocity", "deg/s"), "\N{DEGREE SIGN}/s": ("velocity", "deg/s"), "rpm": ("velocity", "rpm"),
    "1/min": ("velocity", "rpm"), "m/s": ("velocity", "m/s"), "mm/s": ("velocity", "mm/s"), "rev/s": ("velocity", "rev/s"),
    "nm": ("effort", "Nm"), "n.m": ("effort", "Nm"), "n*m": ("effort", "Nm"), "n m": ("effort", "Nm"),
    "n\N{MIDDLE DOT}m": ("effort", "Nm"), "mnm": ("effort", "mNm"), "knm": ("effort", "kNm"), "n": ("effort", "N"), "kn": ("effort", "kN"),
    "a": ("current", "A"), "amp": ("current", "A"), "ampere": ("current", "A"), "ma": ("current", "mA"),
    "degc": ("temperature", "degC"), "\N{DEGREE SIGN}c": ("temperature", "degC"), "celsius": ("temperature", "degC"),
    "c": ("temperature", "degC"), "k": ("temperature", "K"), "degf": ("temperature", "degF"),
    "s": ("time", "s"), "sec": ("time", "s"), "secs": ("time", "s"), "seconds": ("time", "s"), "ms": ("time", "ms"),
    "msec": ("time", "ms"), "us": ("time", "us"), "\N{MICRO SIGN}s": ("time", "us"), "usec": ("time", "us"), "ns": ("time", "ns"),
    "nsec": ("time", "ns"), "nanosec": ("time", "ns"),
}  # fmt: skip
_BRACKET = re.compile(r"[\[(]\s*([^\])]*?[^\])\d\s][^\])]*?)\s*[\])]\s*$")
_PARTS = re.compile(r"[A-Z]{2,}(?=[A-Z][a-z]|\d|\b|_)|[A-Z]?[a-z]+|[A-Z]+|\d+")


@dataclass(frozen=True)
class ColumnName:
    """What a name says.

    Parameters
    ----------
    quantity : str
        ``time``, ``position``, ``velocity``, ``effort``, ``current`` or ``temperature``; empty where it says nothing.
    unit : str
        In the words of the mapping; empty where it says nothing.
    label : str
        What is left of the name without these: a number or the name of a joint, with what stands before it.
    measured : bool
        Whether it is not of something desired, commanded or limited.
    """

    quantity: str
    unit: str
    label: str
    measured: bool


def stated_unit(text: str) -> tuple[str, str]:
    """Quantity and unit that a text such as ``[deg/s]`` states; two empty strings for none.

    Parameters
    ----------
    text : str
    """
    return _UNITS.get(text.strip().strip("[]()").strip().lower(), ("", ""))


def parsed_name(name: str, unit: str = "") -> ColumnName:
    """What the name of a column says.

    Parameters
    ----------
    name : str
    unit : str
        That the file states beside it, literally.
    """
    of, given = stated_unit(unit)
    bare = name
    if not given and (bracket := _BRACKET.search(name)):
        of, given = stated_unit(bracket[1])
        bare = name[: bracket.start()] if given else name
    parts = _PARTS.findall(bare)
    words = [part.lower() for part in parts]
    if not given and len(words) > 1 and len(words[-1]) > 1 and words[-1] in _UNITS:
        of, given = _UNITS[words[-1]]
        words.pop()
    elif not given and len(words) > 2 and f"{words[-2]}_{words[-1]}" in _UNITS:
        of, given = _UNITS[f"{words[-2]}_{words[-1]}"]
        words = words[:-2]
    quantity, place = _quantity(words)
    if not quantity and of in QUANTITIES:
        quantity = of
    measured = not any(word in _COMMANDED for k, word in enumerate(words) if k != place)
    rest = [word for k, word in enumerate(words) if k != place]
    matching = given if not of or of == quantity or _of_line(of, quantity) else ""
    return ColumnName(quantity, matching, " ".join(rest), measured)


def _of_line(of: str, quantity: str) -> bool:
    return of == "position" and quantity == "effort"


def _quantity(words: list[str]) -> tuple[str, int]:
    """Quantity that one of the words means, and its place; the last word that means one."""
    for k in reversed(range(len(words))):
        for quantity, known in QUANTITIES.items():
            if words[k] in known:
                return quantity, k
        if words[k] in _TIMES:
            return "time", k
    return "", -1


def is_clock(name: str) -> bool:
    """Whether a name says that a column is a time.

    Parameters
    ----------
    name : str
    """
    return parsed_name(name).quantity == "time"
