"""Tables of the study of separate friction."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import record

SEPARATE, TOGETHER, DESIGNED = "separate", "all at once", "designed"
MOTIONS = {False: "joint by joint", True: "designed motion"}


def text(content: dict[str, Any]) -> str:
    """Verdict, summary, curves, and every parameter."""
    cases = content["cases"]
    runs, windows = content["friction_runs_s"], content["windows"]
    lengths = content["motions_s"]
    parts = [
        f"{content['repetitions']} repetitions. Friction runs of {_list(runs)} s with {_list(windows)} windows; drives "
        f"alone for {_list(x for name, x in lengths.items() if name != DESIGNED)} s, the designed motion "
        f"{lengths[DESIGNED]:.3g} s.",
        verdict(cases),
        "Errors in percent of the true parameters, geometric means over the mass parameters; the last column is the "
        "rms error of 'all at once' over that of 'separate':",
        record.table(SUMMARY, [row for case in cases for row in _summary(case)]),
        "Measured curves: forms chosen by BIC in how many repetitions, and rms error of the curve over all speeds:",
        record.table(
            ("friction", "drive", "forms", "rms error [Nm]"), [row for case in cases for row in _curves(case)]
        ),
        "Bias, standard deviation, rms error in percent of the true parameter; how often it is in its 99 % interval:",
    ]
    for case in cases:
        parts += [f"### {case['case'][0].upper()}{case['case'][1:]}", _parameters(case)]
    parts.append("![Mass parameter of the first joint over time](results/friction_separate.png)")
    return "\n\n".join(parts)


def verdict(cases: list[dict[str, Any]]) -> str:
    """What the numbers say, in a few sentences."""
    said = []
    for case in cases:
        better, all_, ratios = 0, 0, []
        for one, other in _pairs(case):
            gain = np.array(other["rms_error"]) / one["rms_error"]
            better, all_, ratios = better + int(np.sum(gain > 1)), all_ + gain.size, [*ratios, *gain]
        middle = float(np.exp(np.mean(np.log(ratios))))
        said.append(
            f"{case['case']}: the rms error is smaller with friction measured separately in {better} of {all_} cases, "
            f"'all at once' has {middle:.2g} times the error of 'separate'"
        )
    return "Verdict in numbers: " + "; ".join(said) + "."


SUMMARY = (
    "friction", "motion", "model", "way", "bias", "deviation", "rms error", "largest rms error", "in 99 % intervals",
    "all at once / separate",
)  # fmt: skip


def _pairs(case: dict[str, Any]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    ways = {(w["motion"], w["model"], w["friction"]): w for w in case["ways"]}
    return [(w, ways[motion, model, TOGETHER]) for (motion, model, way), w in ways.items() if way == SEPARATE]


def _summary(case: dict[str, Any]) -> list[list[object]]:
    """A line per kind of motion, model and way, the drives that move alone taken together."""
    rows: list[list[object]] = []
    models = list(dict.fromkeys(w["model"] for w in case["ways"]))
    for designed, motion in MOTIONS.items():
        for model in models:
            found = {}
            for way in (SEPARATE, TOGETHER):
                chosen = [
                    w
                    for w in case["ways"]
                    if (w["motion"] == DESIGNED) == designed and w["model"] == model and w["friction"] == way
                ]
                found[way] = _together(chosen)
            ratio = found[TOGETHER]["rms"] / found[SEPARATE]["rms"]
            for way, one in found.items():
                rows.append(
                    [
                        case["case"],
                        motion,
                        model,
                        way,
                        *(f"{one[key]:.2g} %" for key in ("bias", "deviation", "rms")),
                        f"{one['worst']:.2g} % ({one['where']})",
                        f"{one['within']:.0f} %",
                        f"{ratio:.2g}" if way == TOGETHER else "",
                    ]
                )
    return rows


def _together(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Means over all parameters of some identifications, in percent."""
    names = [_name(w, k) for w in found for k in range(len(w["names"]))]
    true = np.abs(np.concatenate([w["true"] for w in found]))
    bias, deviation, rms = (
        100 * np.abs(np.concatenate([w[key] for w in found])) / true for key in ("bias", "deviation", "rms_error")
    )
    middle = {
        key: float(np.exp(np.mean(np.log(x)))) for key, x in (("bias", bias), ("deviation", deviation), ("rms", rms))
    }
    worst = int(np.argmax(rms))
    within = 100 * float(np.mean(np.concatenate([w["within_99"] for w in found])))
    return {**middle, "worst": float(rms[worst]), "where": names[worst], "within": within}


def _name(way: dict[str, Any], k: int) -> str:
    name = str(way["names"][k])
    return f"{name} without I3" if (way["motion"], name) == ("z2", "X3") else name


def _curves(case: dict[str, Any]) -> list[list[object]]:
    rows = []
    for drive, forms in case["chosen_curves"].items():
        counted = ", ".join(f"{name} {count}" for name, count in sorted(forms.items(), key=lambda x: -x[1]))
        rows.append([case["case"], drive, counted, f"{case['rms_curve_error'][drive]:.2g}"])
    return rows


def _parameters(case: dict[str, Any]) -> str:
    ways = {(w["motion"], w["model"], w["friction"]): w for w in case["ways"]}
    models = list(dict.fromkeys(w["model"] for w in case["ways"]))
    columns = [(model, way) for model in models for way in (SEPARATE, TOGETHER)]
    rows: list[list[object]] = []
    for motion in dict.fromkeys(w["motion"] for w in case["ways"]):
        first = ways[motion, *columns[0]]
        for k, (unit, true) in enumerate(zip(first["units"], first["true"], strict=True)):
            best = {
                model: min(ways[motion, model, way]["rms_error"][k] for way in (SEPARATE, TOGETHER)) for model in models
            }
            cells = [_cell(ways[motion, *column], k, best[column[0]]) for column in columns]
            rows.append([motion, _name(first, k), f"{true:.4g} {unit}", *cells])
    return record.table(("motion", "parameter", "true", *(f"{model}; {way}" for model, way in columns)), rows)


def _cell(way: dict[str, Any], k: int, best: float) -> str:
    bias, deviation, rms = (100 * way[key][k] / abs(way["true"][k]) for key in ("bias", "deviation", "rms_error"))
    error = f"{rms:.2g}"
    bold = f"**{error}**" if way["rms_error"][k] == best else error
    return f"{bias:+.2g}, {deviation:.2g}, {bold}; {100 * way['within_99'][k]:.0f} %"


def _list(numbers: Iterable[float]) -> str:
    return ", ".join(f"{x:.3g}" for x in numbers)
