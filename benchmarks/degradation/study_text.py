"""Tables of the degradation study."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import record
from causes import naming

WANTED, WORST = 1.3, 2.0


def judged(results: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The results with the ratio of default to best, and the messages that name the cause."""
    usual = {one["robot"]: one["default"]["messages"] for one in results if one["kind"] == "as simulated"}
    return [{**one, "ratio": _ratio(one), "named": _named(one, usual.get(one["robot"], []))} for one in results]


def _ratio(one: dict[str, Any]) -> float | None:
    error = one["default"]["error"]
    return None if error is None else error / one["best"]["error"]


def _named(one: dict[str, Any], usual: list[str]) -> list[str]:
    return naming(one["kind"], one["default"]["messages"], usual)


def summary(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Shares of the cases, and the worst ratio; a refusal counts as worse than any ratio."""
    ratios = np.array([np.inf if one["ratio"] is None else one["ratio"] for one in results])
    silent = [one for one, ratio in zip(results, ratios, strict=True) if ratio > WORST and not one["named"]]
    worst = results[int(np.argmax(ratios))]
    return {
        "cases": len(results),
        "share_within_1.3": float(np.mean(ratios <= WANTED)),
        "share_within_2": float(np.mean(ratios <= WORST)),
        "refused": int(np.sum(np.isinf(ratios))),
        "worst_ratio": None if np.isinf(ratios.max()) else float(ratios.max()),
        "worst_case": f"{worst['robot']}: {_case(worst)}",
        "beyond_2_without_naming_the_cause": [f"{one['robot']}: {_case(one)}" for one in silent],
        "median_ratio": float(np.median(ratios)),
    }


def _case(one: dict[str, Any]) -> str:
    return f"{one['kind']}, {one['level']}" if one["level"] else str(one["kind"])


def study_text(results: Sequence[dict[str, Any]]) -> str:
    """The summary in words, a table by robot and case, and the messages that name a cause."""
    said = summary(results)
    worst = "a refusal" if said["worst_ratio"] is None else f"{said['worst_ratio']:.3g}"
    lines = [
        f"Of {said['cases']} cases, the error with plain defaults is at most {WANTED:g} times that of the best fixed "
        f"choice in {100 * said['share_within_1.3']:.0f} %, at most {WORST:g} times in "
        f"{100 * said['share_within_2']:.0f} %. Median ratio {said['median_ratio']:.3g}, worst {worst} "
        f"({said['worst_case']}). Beyond {WORST:g} times without a message that names the cause: "
        f"{len(said['beyond_2_without_naming_the_cause'])} cases.",
    ]
    head = (
        "case", "default %", "best fixed %", "ratio", "true torque: default %, best %", "best fixed choice", "named",
        "CPU s, wall s",
    )  # fmt: skip
    for robot in dict.fromkeys(one["robot"] for one in results):
        own = [one for one in results if one["robot"] == robot]
        lines += [f"**{robot}**", record.table(head, [_row(one) for one in own])]
    if quoted := _quoted(results):
        lines += ["Messages that name a cause:", "\n".join(f"- {text}" for text in quoted)]
    return "\n\n".join(lines)


def _row(one: dict[str, Any]) -> list[object]:
    default, best, seconds = one["default"], one["best"], one["default_seconds"]
    ratio = one["ratio"]
    shown = "refused" if ratio is None else f"{ratio:.2f}" if ratio <= WANTED else f"**{ratio:.2f}**"
    return [
        _case(one),
        _percent(default["error"]),
        _percent(best["error"]),
        shown,
        f"{_percent(default['true_error'])}, {_percent(best['true_error'])}",
        f"{best['cutoff']:g} Hz, {best['terms']}, sign over {best['width']:g} rad/s, {1000 * best['delay']:g} ms, "
        f"{best['estimator']}",
        "yes" if one["named"] else "no",
        f"{seconds['cpu']:.1f}, {seconds['wall']:.1f}",
    ]


def _percent(error: float | None) -> str:
    return "-" if error is None else f"{100 * error:.3g}"


def _quoted(results: Sequence[dict[str, Any]]) -> list[str]:
    """One message for each kind of degradation."""
    first: dict[str, str] = {}
    for one in results:
        for text in one["named"][:1]:
            first.setdefault(one["kind"], text)
    return [f'{kind}: "{text}"' for kind, text in first.items()]
