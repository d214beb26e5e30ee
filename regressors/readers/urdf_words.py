"""Tags and attributes of a URDF: which are read, which are known but not needed, and what a misspelt one stands for.

What is not known is not read, so a misspelling of what matters is an error: ``<limits>`` would make a joint unlimited.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping

from regressors.readers.urdf_elements import XmlElement
from regressors.robot.finding import Finding

_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
READ: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {  # by tag: children and attributes
    "robot": (("link", "joint"), ("name",)),
    "link": (("inertial",), ("name",)),
    "joint": (("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"), ("name", "type")),
    "inertial": (("origin", "mass", "inertia"), ()),
    "origin": ((), ("xyz", "rpy")),
    "mass": ((), ("value",)),
    "inertia": ((), _INERTIA),
    "parent": ((), ("link",)),
    "child": ((), ("link",)),
    "axis": ((), ("xyz",)),
    "limit": ((), ("lower", "upper", "velocity", "effort")),
    "dynamics": ((), ("damping", "friction")),
    "mimic": ((), ("joint", "multiplier", "offset")),
}
_KNOWN: Mapping[str, tuple[str, ...]] = {  # not needed here, though others are
    "robot": ("material", "gazebo", "transmission", "sensor", "ros2_control", "version"),
    "link": ("visual", "collision", "contact", "self_collision_checking", "type"),
    "joint": ("calibration", "safety_controller"),
}
_MANY = ("link", "joint")  # that may stand in a document more than once


def check_words(robot: XmlElement) -> tuple[Finding, ...]:
    """Findings on what is not known, once nothing that matters is misspelt."""
    unknown: dict[tuple[str, str], list[str]] = defaultdict(list)
    todo = [robot]
    for element in todo:
        tags, attributes = READ[element.tag]
        todo.extend(child for child in element.children if child.tag in tags)
        present = {child.tag for child in element.children} - set(_MANY)
        for child in element.children:
            if child.tag not in tags and (
                word := _unknown(child, f"<{child.tag}>", child.tag, element.tag, 0, present)
            ):
                unknown[element.tag, word].append(element.label)
        for name in element.attributes:
            if name not in attributes and (
                word := _unknown(element, repr(name), name, element.tag, 1, set(element.attributes))
            ):
                unknown[element.tag, word].append(element.label)
    places: dict[tuple[str, tuple[str, ...]], list[str]] = defaultdict(list)
    for (tag, word), labels in unknown.items():
        places[tag, tuple(dict.fromkeys(labels))].append(word)
    return tuple(_finding(tag, labels, words) for (tag, labels), words in places.items())


def _unknown(element: XmlElement, shown: str, word: str, parent: str, which: int, present: set[str]) -> str | None:
    """An unknown tag or attribute in words, None for one that is known; a misspelling is refused."""
    known = _KNOWN.get(parent, ())
    if word in known or word.startswith("xmlns"):
        return None
    if ":" in word:
        local = word.rpartition(":")[2] in READ[parent][which]
        return f"{shown} (it would be read without its prefix)" if local else shown
    meant = nearest(word, READ[parent][which])
    if meant is not None and meant not in present:
        asked = f"<{meant}>" if which == 0 else repr(meant)
        element.fail(f"<{parent}> has no {shown}; did you mean {asked}? Correct it, or remove it")
    near = nearest(word, known)
    return shown if near is None else f"{shown} (did you mean {near!r}?)"


def _finding(tag: str, labels: tuple[str, ...], words: list[str]) -> Finding:
    others = f" and {len(labels) - 1} more" if len(labels) > 1 else ""
    return Finding("found", f"{labels[0]}{others}", f"not known in <{tag}>, and not read: {', '.join(words)}")


def nearest(word: str, candidates: Iterable[str]) -> str | None:
    """Candidate that a word is a misspelling of: one edit away, or two from candidates of five letters or more."""
    distances = {candidate: edits(word.lower(), candidate.lower()) for candidate in candidates}
    close = {candidate: d for candidate, d in distances.items() if d <= (1 if len(candidate) < 5 else 2)}
    return min(close, key=lambda candidate: close[candidate]) if close else None


def edits(a: str, b: str) -> int:
    """Insertions, deletions, substitutions and swaps that lead from one word to another [Damerau 1964]."""
    before: list[int] = []
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        following = [i]
        for j, y in enumerate(b, 1):
            cost = min(row[j] + 1, following[-1] + 1, row[j - 1] + (x != y))
            if i > 1 and j > 1 and x == b[j - 2] and a[i - 2] == y:
                cost = min(cost, before[j - 2] + 1)
            following.append(cost)
        before, row = row, following
    return row[-1]
