"""Tables of the study of separate friction."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import record

SEPARATE, TOGETHER, OFFSETS = "separate", "all at once", "all at once, with offsets"
DESIGNED = "designed"
MOTIONS = {False: "joint by joint", True: "designed motion"}


def text(content: dict[str, Any]) -> str:
    """Verdict, summary, curves, and every parameter."""
    cases, lengths, several = content["cases"], content["motions_s"], content["repetitions"]
    alone = _list(length for name, length in lengths.items() if name != DESIGNED)
    parts = [
        f"Friction runs of {_list(content['friction_runs_s'])} s with {_list(content['windows'])} windows; drives "
        f"alone for {alone} s, the designed motion {lengths[DESIGNED]:.3g} s. {several[0]} repetitions "
        "of the differential model and of energy in windows of 5 ms where friction is Tustin's in both experiments, "
        f"{several[1]} of everything else.",
        verdict(cases),
        "As in Fig. 5 of the paper, drive 1 alone, recursive estimate: X1 stays within 2 % of the truth from "
        + ", ".join(f"{time:.2g} s on ({model}, {way})" for _, model, way, time in content["settling_s"])
        + "; at the end both are equally good, since on ways to and fro errors of friction hardly look like inertia.",
        "Errors in percent of the true parameters, geometric means over the mass parameters; half of the 99 % interval "
        "is the stated one; the last column is the rms error over that of 'separate':",
        record.table(SUMMARY, [row for case in cases for row in _summary(case)]),
        "Measured curves: forms chosen by BIC in how many repetitions, and rms error of the curve over all speeds:",
        record.table(
            ("friction", "drive", "forms", "rms error [Nm]"),
            [row for case in (cases[0], cases[2]) for row in _curves(case)],
        ),
        "Bias, standard deviation, rms error in percent of the true parameter; how often it is in its 99 % interval:",
    ]
    for case in cases:
        parts += [f"### Friction: {case['case']}", _parameters(case)]
    parts.append("![Mass parameter of the first joint over time](results/friction_separate.png)")
    return "\n\n".join(parts)


def verdict(cases: list[dict[str, Any]]) -> str:
    """Which way is better, by how much, and at which change of friction no longer."""
    same, lower, linear, smooth = ({key: _wanted(case, *key) for key in _kinds(case)} for case in cases)
    rows = []
    for motion, model in lower:
        best, worse, offsets = (same[motion, model][way] for way in (SEPARATE, TOGETHER, OFFSETS))
        changed, straight, turning = (case[motion, model] for case in (lower, linear, smooth))
        rows.append(
            [
                motion,
                model,
                *(f"{one['rms'] / best['rms']:.2g}" for one in (worse, offsets)),
                f"{turning[TOGETHER]['rms'] / turning[SEPARATE]['rms']:.2g}",
                f"{straight[TOGETHER]['rms'] / straight[SEPARATE]['rms']:.2g}",
                f"{changed[TOGETHER]['rms'] / changed[SEPARATE]['rms']:.2g}",
                *(f"{10 * one['rms'] / changed[SEPARATE]['bias']:.2g} %" for one in (worse, offsets)),
            ]
        )
    short = [same[key] for key in lower]
    deviations = [found[TOGETHER]["deviation"] / found[SEPARATE]["deviation"] for found in short]
    said = (
        "Verdict: friction measured separately takes away the bias that the two columns of eq. (1) leave where "
        f"friction is not Coulomb and viscous ({_range(found[TOGETHER]['bias'] for found in short)} % all at once, "
        f"{_range(found[SEPARATE]['bias'] for found in short)} % separately), not the scatter "
        f"({_range(deviations)} times as much all at once); where friction is that of eq. (1) it gains nothing, and "
        "the more friction changes in between, the less it gains. Rms error of 'all at once' over that of 'separate', "
        "and the change of friction between the experiments at which both are even if the bias grows with it:"
    )
    return f"{said}\n\n{record.table(VERDICT, rows)}"


VERDICT = (
    "motion", "model", "Tustin's friction", "the same, with offsets too", "Tustin's, never sticking",
    "Coulomb and viscous friction", "Tustin's, 10 % lower", "even at a change of", "even, with offsets too",
)  # fmt: skip


def _kinds(case: dict[str, Any]) -> list[tuple[str, str]]:
    return [(motion, model) for motion, chosen in _motions(case).items() for model in _names(chosen, "model")]


def _wanted(case: dict[str, Any], motion: str, model: str) -> dict[str, dict[str, Any]]:
    """Means over all parameters, by way."""
    chosen = _motions(case)[motion]
    return {way: _together(_of(chosen, model, way)) for way in _names(chosen, "friction")}


SUMMARY = (
    "friction", "motion", "model", "way", "bias", "deviation", "rms error", "largest rms error", "half interval",
    "in 99 % intervals",
    "rms error against separate",
)  # fmt: skip


def _names(ways: list[dict[str, Any]], key: str) -> list[str]:
    return list(dict.fromkeys(way[key] for way in ways))


def _motions(case: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Ways by kind of motion, the drives that move alone taken together."""
    return {
        said: [way for way in case["ways"] if (way["motion"] == DESIGNED) == designed]
        for designed, said in MOTIONS.items()
    }


def _of(ways: list[dict[str, Any]], model: str, friction: str) -> list[dict[str, Any]]:
    return [way for way in ways if way["model"] == model and way["friction"] == friction]


def _summary(case: dict[str, Any]) -> list[list[object]]:
    """A line per kind of motion, model and way."""
    rows: list[list[object]] = []
    for motion, chosen in _motions(case).items():
        for model in _names(chosen, "model"):
            best = _together(_of(chosen, model, SEPARATE))
            for way in _names(chosen, "friction"):
                one = _together(_of(chosen, model, way))
                if one:
                    rows.append(
                        [
                            case["case"],
                            motion,
                            model,
                            way,
                            *(f"{one[key]:.2g} %" for key in ("bias", "deviation", "rms")),
                            f"{one['worst']:.2g} % ({one['where']})",
                            f"{one['half']:.2g} %",
                            f"{one['within']:.0f} %",
                            f"{one['rms'] / best['rms']:.2g}",
                        ]
                    )
    return rows


def _together(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Means over all parameters of some identifications, in percent; empty for none."""
    if not found:
        return {}
    names = [_name(w, k) for w in found for k in range(len(w["names"]))]
    true = np.abs(np.concatenate([w["true"] for w in found]))
    keys = {"bias": "bias", "deviation": "deviation", "rms": "rms_error", "half": "half_width"}
    parts = {key: 100 * np.abs(np.concatenate([w[of] for w in found])) / true for key, of in keys.items()}
    middle = {key: float(np.exp(np.mean(np.log(x)))) for key, x in parts.items()}
    rms = parts["rms"]
    worst = int(np.argmax(rms))
    within = 100 * float(np.mean(np.concatenate([w["within_99"] for w in found])))
    return {**middle, "worst": float(rms[worst]), "where": names[worst], "within": within}


def _name(way: dict[str, Any], k: int) -> str:
    name = str(way["names"][k])
    return f"{name} without link 3" if way["motion"] == "z2" and name == "X3" else name


def _curves(case: dict[str, Any]) -> list[list[object]]:
    rows = []
    for drive, forms in case["chosen_curves"].items():
        counted = ", ".join(f"{name} {count}" for name, count in sorted(forms.items(), key=lambda x: -x[1]))
        rows.append([case["case"], drive, counted, f"{case['rms_curve_error'][drive]:.2g}"])
    return rows


def _parameters(case: dict[str, Any]) -> str:
    ways = {(w["motion"], w["model"], w["friction"]): w for w in case["ways"]}
    columns = list(dict.fromkeys((model, way) for _, model, way in ways))
    rows: list[list[object]] = []
    for motion in _names(case["ways"], "motion"):
        first = ways[motion, *columns[0]]
        for k, (unit, true) in enumerate(zip(first["units"], first["true"], strict=True)):
            best = {
                model: min(ways[motion, *c]["rms_error"][k] for c in columns if c[0] == model) for model, _ in columns
            }
            cells = [_cell(ways[motion, *column], k, best[column[0]]) for column in columns]
            rows.append([motion, _name(first, k), f"{true:.4g} {unit}", *cells])
    return record.table(("motion", "parameter", "true", *(f"{model}; {way}" for model, way in columns)), rows)


def _cell(way: dict[str, Any], k: int, best: float) -> str:
    bias, deviation, rms = (100 * way[key][k] / abs(way["true"][k]) for key in ("bias", "deviation", "rms_error"))
    error = f"{rms:.2g}"
    bold = f"**{error}**" if way["rms_error"][k] == best else error
    return f"{bias:+.2g}, {deviation:.2g}, {bold}; {100 * way['within_99'][k]:.0f} %"


def _range(numbers: Iterable[float]) -> str:
    values = sorted(numbers)
    return f"{values[0]:.2g} to {values[-1]:.2g}"


def _list(numbers: Iterable[float]) -> str:
    return ", ".join(f"{x:.3g}" for x in numbers)
