"""Tables of the study of real logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import record
from friction_columns import COMPARED
from interval_agreement import ALL, GROUPS

USUAL = (COMPARED, 10.0)
ESTIMATORS = ("OLS", "weighted", "ridge", "physical (SDP)")


def page(robots: dict[str, Any], skipped: Sequence[str]) -> str:
    """All tables.

    Parameters
    ----------
    robots : dict
        By name: ``cases``, ``agreements``, ``origin``, ``licence``.
    skipped : sequence of str
        Reasons.
    """
    splits = [split for robot in robots.values() for split in robot["splits"]]
    logs = [f"- {name}: {robot['origin']}; licence: {robot['licence']}" for name, robot in robots.items()]
    parts = [
        in_words(splits),
        "### Unseen error",
        unseen_table(splits),
        "### Every rival",
        "Unseen error in percent with a filter of 5 Hz / of 10 Hz. Bold: below ours.",
        rivals_table(splits),
        "### Joints",
        joints_table(splits),
        "### Do intervals of two logs agree?",
        "Share of parameters whose estimates agree within their combined 99 % interval, and root mean square of the "
        "differences over their standard deviations: 99 % and 1.0 where intervals tell the whole uncertainty.",
        agreement_table(robots),
        "### Time",
        time_table(robots),
        "### What ours chose",
        "\n".join(choices(robots)),
        "### Logs",
        "\n".join([*logs, *(f"- skipped: {reason}" for reason in skipped)]),
    ]
    return "\n\n".join(part for part in parts if part)


def in_words(splits: Sequence[dict[str, Any]]) -> str:
    """Where ours wins and loses."""
    judged = [split for split in splits if "ours" in split]
    if not judged:
        return "Nothing was judged."
    reference = [usual(split, "OLS") for split in judged]
    wins = sum(split["ours"]["error"] < error for split, error in zip(judged, reference, strict=True))
    losses = [split for split in judged if split["best"]["error"] < split["ours"]["error"]]
    fixed, mean = best_fixed(judged)
    named = ", ".join(f"{split['name']} ({ratio(split):.2f})" for split in losses)
    return (
        f"Ours with plain defaults is better than ordinary least squares as usually done (Coulomb, viscous, offset, "
        f"10 Hz) on {wins} of {len(judged)} splits. The best of 48 rivals in hindsight is better than ours on "
        f"{len(losses)}" + (f": {named}; in parentheses ours / best" if losses else "") + f". The one rival that is "
        f"best over all splits is {fixed}: its errors are {mean:.3f} times ours (geometric mean)."
    )


def best_fixed(splits: Sequence[dict[str, Any]]) -> tuple[str, float]:
    """The rival with the least geometric mean of its errors over ours."""
    ratios = {
        name: float(np.exp(np.mean([np.log(s["rivals"][name]["error"] / s["ours"]["error"]) for s in splits])))
        for name in splits[0]["rivals"]
    }
    name = min(ratios, key=lambda key: ratios[key])
    return name, ratios[name]


def usual(split: dict[str, Any], estimator: str) -> float:
    """Error of an estimator with usual friction and filter."""
    return float(split["rivals"][f"{estimator}, {USUAL[0]}, {USUAL[1]:g} Hz"]["error"])


def ratio(split: dict[str, Any]) -> float:
    """Ours over the best in hindsight."""
    return float(split["ours"]["error"] / split["best"]["error"])


def percent(error: float) -> str:
    """In percent, three digits."""
    return f"{100 * error:.2f}" if error < 0.1 else f"{100 * error:.1f}"


def unseen_table(splits: Sequence[dict[str, Any]]) -> str:
    """Ours beside usual settings of every estimator, and the best in hindsight."""
    head = [
        "trained -> judged on",
        "ours %",
        *(f"{e} %" for e in ESTIMATORS),
        "best of 48 in hindsight %",
        "ours / best",
    ]
    head += ["the tool's verdict", "ours in training %"]
    rows: list[list[object]] = []
    for split in splits:
        if "ours" not in split:
            rows.append([split["name"], f"refused: {split['refused']}", *[""] * (len(head) - 2)])
            continue
        ours, best = split["ours"], split["best"]
        cells = [percent(usual(split, e)) for e in ESTIMATORS]
        training = split["training_error"]
        rows.append(
            [
                split["name"],
                f"**{percent(ours['error'])}**",
                *cells,
                f"{percent(best['error'])} ({best['name']})",
                f"{ratio(split):.3f}",
                "holds" if ours["holds"] else "does not hold",
                "-" if training is None else percent(training),
            ]
        )
    note = "Estimators in columns 3 to 6: Coulomb and viscous friction with offsets, rotors, 10 Hz."
    return record.table(head, rows) + "\n\n" + note


def rivals_table(splits: Sequence[dict[str, Any]]) -> str:
    """Every rival on every split, both filters in one cell."""
    judged = [split for split in splits if "ours" in split]
    if not judged:
        return ""
    rows: list[list[object]] = [["**ours**", "chosen", *(f"**{percent(s['ours']['error'])}**" for s in judged)]]
    kinds = dict.fromkeys((r["estimator"], r["friction"]) for r in judged[0]["rivals"].values())
    for estimator, friction in kinds:
        cells = []
        for split in judged:
            both = [
                r["error"] for r in split["rivals"].values() if (r["estimator"], r["friction"]) == (estimator, friction)
            ]
            cells.append(" / ".join(_marked(error, split["ours"]["error"]) for error in both))
        rows.append([estimator, friction, *cells])
    return record.table(["estimator", "friction", *(split["name"] for split in judged)], rows)


def _marked(error: float, ours: float) -> str:
    return f"**{percent(error)}**" if error < ours else percent(error)


def joints_table(splits: Sequence[dict[str, Any]]) -> str:
    """Errors of each joint: ours, usual least squares, the best in hindsight."""
    rows: list[list[object]] = []
    for split in splits:
        if "ours" not in split:
            continue
        name = f"OLS, {USUAL[0]}, {USUAL[1]:g} Hz"
        shown = {"ours": split["ours"], name: split["rivals"][name], f"best: {split['best']['name']}": split["best"]}
        for method, found in shown.items():
            rows.append([split["name"], method, percent(found["error"]), *(percent(e) for e in found["joints"])])
    joints = max((len(row) - 3 for row in rows), default=0)
    return record.table(["split", "method", "all %", *(f"joint {k + 1}" for k in range(joints))], rows)


def agreement_table(robots: dict[str, Any]) -> str:
    """Agreement of every pair of logs, and over all pairs of a robot."""
    head = ["robot", "logs", "method", "parameters compared", *(f"{group}: agree, rms z" for group in GROUPS)]
    rows: list[list[object]] = []
    for name, robot in robots.items():
        found = robot["agreements"]
        pairs = {" - ".join(one["pair"]): [one] for one in found}
        for pair in pairs:
            own = [one for one in found if " - ".join(one["pair"]) == pair]
            rows += [[name, pair, one["method"], *_agreed([one])] for one in own]
        if len(pairs) > 1:
            for method in dict.fromkeys(one["method"] for one in found):
                own = [one for one in found if one["method"] == method]
                rows.append([name, "**all**", method, *_agreed(own)])
    return record.table(head, rows) if rows else "No two logs of one robot."


def _agreed(found: Sequence[dict[str, Any]]) -> list[str]:
    """Counts, then share within the combined 99 % interval and rms z of each group."""
    counts = {group: sum(one[group]["compared"] for one in found) for group in GROUPS}
    cells = [f"{counts[ALL]} of {sum(one['of'] for one in found)}"]
    for group in GROUPS:
        agree, square = (sum(one[group][key] for one in found) for key in ("agree", "square"))
        count = counts[group]
        cells.append(f"{100 * agree / count:.0f} %, {np.sqrt(square / count):.2f}" if count else "-")
    return cells


def time_table(robots: dict[str, Any]) -> str:
    """Processor and wall time of ours, and medians of the rivals."""
    head = ["robot, trained on", "ours: CPU s, wall s", *(f"{e}: CPU s, wall s" for e in ESTIMATORS)]
    rows: list[list[object]] = []
    for name, robot in robots.items():
        for case in robot["cases"]:
            if "ours" not in case:
                continue
            cells = [_times(case["ours"]["cpu"], case["ours"]["wall"])]
            for estimator in ESTIMATORS:
                own = [rival for rival in case["rivals"] if rival["estimator"] == estimator]
                cells.append(_times(*(float(np.median([rival[key] for rival in own])) for key in ("cpu", "wall"))))
            rows.append([f"{name}, {' + '.join(case['train'])}", *cells])
    return record.table(head, rows)


def _times(cpu: float, wall: float) -> str:
    return f"{cpu:.2f}, {wall:.2f}"


def choices(robots: dict[str, Any]) -> list[str]:
    """What ours said that it chose, and its doubts, of every training set."""
    lines = []
    for name, robot in robots.items():
        for case in robot["cases"]:
            if "ours" in case:
                ours = case["ours"]
                said = [*ours["choices"], *(f"doubt: {text}" for text in ours["doubts"])]
                lines.append(f"- {name}, {' + '.join(case['train'])} ({ours['method']}): {'; '.join(said)}")
    return lines
