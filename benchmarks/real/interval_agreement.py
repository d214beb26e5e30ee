"""Whether the intervals of the same parameters from two logs of one robot agree."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.stats
from friction_columns import COMPARED
from numpy.typing import NDArray

Array = NDArray[np.float64]
QUANTILE = float(scipy.stats.norm.ppf(0.995))
GROUPS = ALL, BODIES, ROTORS, FRICTION = ("all", "bodies", "rotors", "friction")
WITH_INTERVALS = ("OLS", "weighted")


def agreements(cases: Sequence[dict[str, Any]], pairs: Sequence[Sequence[str]]) -> list[dict[str, Any]]:
    """Of every pair of logs: how many parameters are within the combined 99 % interval, and their z.

    Parameters
    ----------
    cases : sequence of dict
        Of single logs, see `training_case.training_case`.
    pairs : sequence of (str, str)
    """
    by_log = {case["train"][0]: case for case in cases if len(case["train"]) == 1 and "ours" in case}
    rows = []
    for first, second in pairs:
        if first not in by_log or second not in by_log:
            continue
        one, other = by_log[first], by_log[second]
        rows.append({"pair": [first, second], "method": "ours", **_ours(one["ours"], other["ours"])})
        for a, b in zip(one["rivals"], other["rivals"], strict=True):
            if a["estimator"] in WITH_INTERVALS and a["friction"] == COMPARED:
                name = f"{a['estimator']}, white, {a['cutoff']:g} Hz"
                rows.append({"pair": [first, second], "method": name, **_rival(a, b, one["rival_groups"])})
    return rows


def _rival(a: dict[str, Any], b: dict[str, Any], groups: Sequence[str]) -> dict[str, Any]:
    va, vb, da, db = (np.array(x) for x in (a["values"], b["values"], a["deviation"], b["deviation"]))
    return _compared(va - vb, np.hypot(da, db), QUANTILE * np.hypot(da, db), groups, va.size)


def _ours(a: dict[str, Any], b: dict[str, Any]) -> dict[str, Any]:
    """Of the parameters that mean the same in both results and have an interval in both."""
    one, other = _parameters(a), _parameters(b)
    common = [key for key in one if key in other]
    at = np.array([one[key] for key in common]).reshape(-1, 3)
    bt = np.array([other[key] for key in common]).reshape(-1, 3)
    groups, deviation, half_width = [_group(str(key[0])) for key in common], *np.hypot(at, bt).T[1:]
    return _compared(at[:, 0] - bt[:, 0], deviation, half_width, groups, max(len(a["names"]), len(b["names"])))


def _parameters(ours: dict[str, Any]) -> dict[tuple[object, ...], tuple[float, float, float]]:
    """Value, deviation and half width by name, expression and, for friction, the terms that its drive has."""
    found: dict[tuple[object, ...], tuple[float, float, float]] = {}
    drives = [_drive(name) for name in ours["names"]]
    for k, name in enumerate(ours["names"]):
        terms = tuple(n for n, d in zip(ours["names"], drives, strict=True) if d == drives[k]) if drives[k] else ()
        numbers = (ours["values"][k], ours["deviation"][k], ours["half_width"][k])
        if None not in numbers:
            found[(name, ours["expressions"][k], terms)] = numbers
    return found


def _drive(name: str) -> str | None:
    """Number of the drive whose friction a parameter is."""
    match = re.match(r"F(\d+)", name)
    return match[1] if match else None


def _group(name: str) -> str:
    return FRICTION if _drive(name) else ROTORS if name.startswith("Ia") else BODIES


def _compared(difference: Array, deviation: Array, half_width: Array, groups: Sequence[str], of: int) -> dict[str, Any]:
    """Counts of all parameters and of each group, which sums over pairs can be made of."""
    agree, square = np.abs(difference) <= half_width, (difference / deviation) ** 2
    found: dict[str, Any] = {"of": of}
    for group in GROUPS:
        own = np.array([group in (ALL, one) for one in groups], dtype=bool)
        found[group] = {"compared": int(own.sum()), "agree": int(agree[own].sum()), "square": float(square[own].sum())}
    return found
