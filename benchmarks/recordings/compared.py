"""Two recordings of one case, leaf by leaf."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

RELATIVE, ABSOLUTE = 1e-9, 1e-12


@dataclass(frozen=True)
class Difference:
    """One leaf that is not what it was.

    Parameters
    ----------
    path : str
    was, found
        Their values.
    excess : float
        The difference of two numbers as a multiple of what is allowed; infinite for anything else.
    """

    path: str
    was: Any
    found: Any
    excess: float = math.inf

    def __str__(self) -> str:
        return f"{self.path}: was {_short(self.was)}, is {_short(self.found)}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


class _Missing:
    def __repr__(self) -> str:
        return "missing"


MISSING = _Missing()


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every leaf with its path; lists also have their length, so that none grows unnoticed.

    Parameters
    ----------
    value : dict, list, str, number, bool or None
    path : str
        Of the value itself.
    """
    if isinstance(value, dict):
        yield path + "{}", None
        for key, part in value.items():
            yield from leaves(part, f"{path}/{key}")
    elif isinstance(value, list):
        yield path + "[]", len(value)
        for k, part in enumerate(value):
            yield from leaves(part, f"{path}/{k}")
    else:
        yield path, value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _group(path: str) -> str:
    """Path of all leaves that are of one kind: indices left out, projections beside their norm."""
    return re.sub(r"/\d+(?=/|$)", "/*", re.sub(r"/(norm|projections/\d+)$", "/*", path))


def _scales(recorded: dict[str, Any]) -> dict[str, float]:
    """Largest finite number of each group."""
    found: dict[str, float] = {}
    for path, value in recorded.items():
        if _is_number(value) and math.isfinite(value):
            found[_group(path)] = max(found.get(_group(path), 0.0), abs(value))
    return found


def _difference(path: str, was: Any, found: Any, scale: float) -> Difference | None:
    if not (_is_number(was) and _is_number(found)):
        return None if type(was) is type(found) and was == found else Difference(path, was, found)
    if was == found or (math.isnan(was) and math.isnan(found)):
        return None
    allowed = RELATIVE * abs(was) + ABSOLUTE * scale
    excess = abs(found - was) / allowed if allowed > 0.0 else math.inf
    return Difference(path, was, found, excess) if not excess <= 1.0 else None


def differences(recorded: Any, found: Any) -> tuple[list[Difference], list[str]]:
    """Leaves that differ or are missing, the worst first, and the paths of leaves that were not there before.

    Parameters
    ----------
    recorded, found : dict
    """
    before, after = dict(leaves(recorded)), dict(leaves(found))
    scales = _scales(before)
    pairs = ((path, was, after.get(path, MISSING)) for path, was in before.items())
    unlike = [_difference(path, was, now, scales.get(_group(path), 0.0)) for path, was, now in pairs]
    worst = sorted((d for d in unlike if d is not None), key=lambda d: -d.excess)
    return worst, [path for path in after if path not in before]
