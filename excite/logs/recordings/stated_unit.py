"""Units as people write them, in the words of a log mapping."""

from __future__ import annotations

from collections.abc import Mapping

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
NONE = ("", "")


def stated_unit(text: str) -> tuple[str, str]:
    """Quantity and unit that a text such as ``[deg/s]`` states; two empty strings for none."""
    return _KNOWN.get(text.strip().strip("[]()").strip().lower().replace("n m", "nm"), NONE)
