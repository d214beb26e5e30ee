"""Headings below which ``--help`` lists the options of a command; those of a design follow the parts of a task."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from excite.tasks.task import PLACE

OUTPUT, OTHER = "Output", "Other"
_OF_PARTS: Mapping[str, str] = {
    "installation": "Robot",
    "model": "Model",
    "trajectory": "Motion",
    "objective": "Criterion",
    "limits": "Limits",
    "search": "Search",
    "output": "Home and rehearsal",
}
_SHARED: Mapping[str, tuple[str, ...]] = {
    "Robot": ("base_link", "tip", "snap_angles", "xacro"),
    "Limits": ("world",),
    "Logs": ("mapping", "drop", "rows", "without_rows", "loaded", "without"),
    OUTPUT: ("out", "rate"),
    OTHER: ("parts", "help"),
}
_ORDER = (*_OF_PARTS.values(), OUTPUT, OTHER)


def heading_of(name: str, own: Mapping[str, Iterable[str]]) -> str:
    """Heading of an option; what nothing is known of is about the output."""
    for table in (own, _SHARED):
        for heading, names in table.items():
            if name in names:
                return heading
    return _OF_PARTS[PLACE[name]] if name in PLACE else OUTPUT


def in_order(headings: Iterable[str], own: Iterable[str]) -> list[str]:
    """Headings in the order of the help: the robot, the command's own, those of a design, and the output last."""
    last = (OUTPUT, OTHER)
    ranked = ["Robot", *(name for name in own if name not in last), *_ORDER[:-2], "Logs", *last]
    return sorted(headings, key=ranked.index)
