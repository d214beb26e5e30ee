"""What every number may be: unit, least, most, whole or not, for options, files and the API alike.

The bounds are generous for every robot there is, and tight enough that all that is inside them can be computed with or
is refused for a stated reason. `QUANTITIES` has one entry for each option that is a number, by its name in Python.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Integral, Real

from regressors.errors import InputError, UnknownName

_PLAIN = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?", re.ASCII)
_WORDS = {"inf": math.inf, "+inf": math.inf, "-inf": -math.inf, "infinity": math.inf, "nan": math.nan}
_LONGEST = 40  # characters of a value that a message shows
_DIGITS = 4000  # that Python converts


@dataclass(frozen=True)
class Quantity:
    """What one number may be."""

    unit: str  # empty for plain numbers
    least: float  # both are allowed
    most: float
    whole: bool = False  # only whole numbers
    zero: bool = False  # zero too, although it is below the least
    infinite: bool = False  # infinity too, for no bound

    def holds(self, number: float) -> bool:
        """Whether it may be this number."""
        if self.whole and not isinstance(number, Integral):
            return False
        return (
            self.least <= number <= self.most or (self.zero and number == 0) or (self.infinite and number == math.inf)
        )

    @property
    def range(self) -> str:
        """Such as ``a number from 0.001 to 100000 s``."""
        kind = "a whole number" if self.whole else "a number"
        unit = f" {self.unit}" if self.unit else ""
        more = [*(["0"] if self.zero else []), *(["inf"] if self.infinite else [])]
        return f"{' or '.join([*more, kind])} from {_plain(self.least)} to {_plain(self.most)}{unit}"


def _plain(number: float) -> str:
    if number == 2**63 - 1:
        return "2^63 - 1"
    return f"{number:.0f}" if number == round(number) and abs(number) < 1e9 else f"{number:g}"


TIME = Quantity("s", 1e-6, 1e5)
SPEED = Quantity("rad/s or m/s", 1e-9, 1e6)
DISTANCE = Quantity("rad or m", 1e-12, 1e4)
NOISE = Quantity("", 1e-12, 1e12, zero=True)
COUNT = Quantity("", 1, 10**6, whole=True)

QUANTITIES: Mapping[str, Quantity] = {
    # options of one kind
    **dict.fromkeys(("sensor_xyz", "frame", "tool_box", "tool_point", "floor", "length"), Quantity("m", -1e4, 1e4)),
    **dict.fromkeys(("mount", "sensor_rpy", "angle"), Quantity("rad", -1e4, 1e4)),
    **dict.fromkeys(("position", "home", "via", "pose"), Quantity("rad or m", -1e4, 1e4)),
    **dict.fromkeys(
        ("window_length", "max_time", "impact_duration", "horizon", "shortest", "creeping", "ramping", "window"), TIME
    ),
    **dict.fromkeys(("settle", "warm_up", "pause"), replace(TIME, zero=True)),
    **dict.fromkeys(("rate", "cutoff", "low_pass", "wrench_rate", "noise_corner"), Quantity("Hz", 1e-6, 1e7)),
    **dict.fromkeys(("stribeck_speed", "velocity"), SPEED),
    **dict.fromkeys(("torque_tolerance", "motion_tolerance", "below"), Quantity("%", 1e-6, 1e6)),
    **dict.fromkeys(("known_mass", "mass"), Quantity("kg", 1e-9, 1e9)),
    **dict.fromkeys(("torque_margin", "model_error"), Quantity("", 0.0, 0.999)),
    **dict.fromkeys(("periods", "points"), COUNT),
    **dict.fromkeys(("repeat", "repeats", "breakaways"), replace(COUNT, least=0)),
    **dict.fromkeys(("carried", "prior_value", "friction_parameter", "gain"), Quantity("", -1e12, 1e12)),
    **dict.fromkeys(("payload", "load", "ratio"), Quantity("", -1e9, 1e9)),
    **dict.fromkeys(("precision", "prior"), Quantity("", 1e-9, 1e9)),
    **dict.fromkeys(("torque_factors", "described_within"), Quantity("", 1e-6, 1e6)),
    **dict.fromkeys(("breakaway", "position_step"), replace(DISTANCE, zero=True)),
    **dict.fromkeys(("harmonics", "at_once"), Quantity("", 1, 1000, whole=True)),
    **dict.fromkeys(("intervals", "plausible_robots", "workers"), Quantity("", 1, 10_000, whole=True)),
    **dict.fromkeys(("samples", "column"), Quantity("", 1, 100_000, whole=True)),
    **dict.fromkeys(("torque_noise", "coloured_noise"), replace(NOISE, unit="Nm or N")),
    **dict.fromkeys(("sign_width", "standstill"), replace(SPEED, zero=True, least=1e-12)),
    **dict.fromkeys(("percent", "creep"), Quantity("%", 1e-6, 100.0)),
    # installation
    "gravity": Quantity("m/s^2", -1e4, 1e4),
    # trajectory
    "period": Quantity("s", 1e-3, 1e5),
    "order": Quantity("", 1, 10, whole=True),
    # objective
    "noise": replace(NOISE, zero=False),
    "prior_deviation": Quantity("", 1e-12, 1e12),
    # limits
    "acceleration": Quantity("rad/s^2 or m/s^2", 1e-9, 1e9),
    "jerk": Quantity("rad/s^3 or m/s^3", 1e-9, 1e12),
    "torque_uncertainty": Quantity("", 1e-6, 10.0),
    "velocity_scaling": Quantity("", 1e-3, 1.0),
    "tool_speed": Quantity("m/s", 1e-9, 1e6),
    # search
    "starts": Quantity("", 1, 10**7, whole=True),
    "rounds": Quantity("", 0, 10**6, whole=True),
    "budget": Quantity("s", 0.1, 1e7),
    "seed": Quantity("", 0, 2**63 - 1, whole=True),
    # output
    "speed": Quantity("", 1e-6, 1.0),
    # posterior
    "level": Quantity("", 0.5, 0.9999),
    # identification
    "every": Quantity("", 1, 10**9, whole=True),
    "temperature": Quantity("deg C", -273.15, 1e4),
    "delay": Quantity("s", -1e4, 1e4),
    "bias": Quantity("N and Nm", -1e6, 1e6),
    # simulation
    "bandwidth": Quantity("Hz", 1e-6, 1e5),
    "catch": replace(DISTANCE, least=1e-9),
    "encoder": Quantity("counts per revolution", 1, 1e12),
    "position_noise": replace(NOISE, unit="rad or m"),
    "velocity_noise": replace(NOISE, unit="rad/s or m/s"),
    "wrench_noise": replace(NOISE, unit="N and Nm"),
    "impact_time": Quantity("s", -1e6, 1e6),
    "impact_torque": Quantity("Nm or N", -1e9, 1e9),
    "friction_drift": Quantity("", -0.999, 1e3),
    "torque_gain": Quantity("", -1e6, 1e6),
    # verification and study
    "count": replace(COUNT, least=2),
    # payloads
    "gain_deviation": Quantity("", 0.0, 1.0),
    # friction experiments
    "longest": replace(TIME, infinite=True),
    "stroke": replace(DISTANCE, infinite=True),
    "torque_ramp": Quantity("Nm or N", 0.0, 1e9),
    "tolerance": Quantity("", 1e-9, 1e3),
    "exponent": Quantity("", 0.01, 100.0),
    # files
    "ticks": Quantity("counts per revolution", -1e12, 1e12),
    "reading": Quantity("", -1e15, 1e15),
    "skip": Quantity("", 0, 10**9, whole=True),
    "moment": Quantity("kg m or kg m^2", -1e12, 1e12),
    "bound": Quantity("", -1e20, 1e20, infinite=True),
}


def check(name: str, value: object, called: str | None = None) -> None:
    """Raise `InputError` where a number, or one of several, is not what its quantity may be."""
    if (wrong := fault(name, value)) is not None:
        raise InputError(f"{called or f'`{name}`'} {wrong}")


def check_options(part: object, names: Iterable[str]) -> None:
    """Check options of an object by their names."""
    for name in names:
        check(name, getattr(part, name))


def fault(name: str, value: object) -> str | None:
    """What is wrong with a number, or with the first wrong one of several, as a sentence's end; None if nothing."""
    quantity = QUANTITIES[name]
    for number in _numbers(value):
        real = isinstance(number, Real) and not isinstance(number, bool)
        if not real or not quantity.holds(number):  # type: ignore[arg-type]
            return f"must be {quantity.range}, given {shown(number)}"
    return None


def _numbers(value: object) -> Iterable[object]:
    if value is None or isinstance(value, str):
        return
    if isinstance(value, Mapping):
        value = value.values()
    if hasattr(value, "__iter__"):
        for item in value:
            yield from _numbers(item)
    else:
        yield value


def shown(value: object) -> str:
    """A value for a message: short, on one line, printable."""
    if isinstance(value, Integral) and not isinstance(value, bool) and abs(int(value)) >= 10**_LONGEST:
        return f"a whole number of about {int(int(value).bit_length() * math.log10(2)) + 1} digits"
    if isinstance(value, float):
        return f"{value:.6g}"
    text = ascii(value) if isinstance(value, str) else repr(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 10]}...{text[-7:]}"


def number_of(text: str) -> float:
    """Number that a text states in plain digits, ``inf`` or ``nan``; not ``1_0``, nor digits of other scripts."""
    word = text.strip().lower()
    if word in _WORDS:
        return _WORDS[word]
    if not _PLAIN.fullmatch(word):
        raise ValueError(f"expected a number, given {shown(text)}")
    return float(word)


def whole_number_of(text: str) -> int:
    """Whole number that a text states in plain digits."""
    word = text.strip()
    if not re.fullmatch(r"[+-]?[0-9]+", word, re.ASCII) or len(word) > _DIGITS:
        raise ValueError(f"expected a whole number, given {shown(text)}")
    return int(word)


Tips = str | Sequence[str] | None
"""Last links of what moves, one or several; None for all limbs."""


def place_of(what: str, given: str, names: Sequence[str]) -> int:
    """Place of a thing by its name or by its number, 1 for the first."""
    if given in names:
        return names.index(given)
    numbers = [str(number) for number in range(1, len(names) + 1)]
    if (number := given.lstrip("0")) in numbers:  # compared as text: numbers of thousands of digits are refused by int
        return numbers.index(number)
    raise UnknownName(what, given, (f"{number} ({name})" for number, name in zip(numbers, names, strict=True)))
