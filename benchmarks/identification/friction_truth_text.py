"""Tables of the study of friction curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import record
from friction_truth_case import NOISE, RATE
from friction_truth_planned import ALL_FORMS, SCHEDULE

LIMITATIONS = (
    "The paper prints stiction only; Coulomb friction below it, viscous friction and the Stribeck speed are assumed.",
    "Gravity and inertia are subtracted with the true parameters.",
    "Noise of the torques is white, 1 Nm on each joint's: sqrt(2) Nm on a drive whose torque is the difference of "
    "those of two joints (z2, and z3 in the planned experiment).",
    "Each motion is simulated once, so what it does to the positions is the same in all experiments: a bias.",
    "Friction that sticks is Dahl's, over 1e-5 rad: a harmonic drive gives way further before it breaks loose.",
    "Intervals of break-away torques are wide on purpose: the instant at which a drive breaks loose is told from few "
    "encoder counts, and this doubt is stated for every ramp.",
)


def text(alone: Sequence[dict[str, Any]], planned: Sequence[dict[str, Any]]) -> str:
    """All tables."""
    counts = ", ".join(f"{one['experiments']} {_positions(one)}" for one in planned[:2])
    spans = "; ".join(
        f"{one['drive']} {one['windows']} windows of {one['durations'][0]:.2f} to {one['durations'][1]:.2f} s and "
        f"{one['ramps']} ramps"
        for one in planned
        if one["encoder"]
    )
    parts = [
        f"Torque noise of {NOISE:g} Nm at {RATE:g} Hz. {_worst(alone, planned)}",
        "### The planned experiment",
        f"Runs and torque ramps of `excite friction plan` (11 speeds both ways, windows of at most "
        f"{SCHEDULE.longest:g} s, {SCHEDULE.breakaways} ramps each way), simulated with friction that sticks, under PD "
        f"control; then all that `excite friction fit --plan` does. Experiments per drive: {counts}. {spans}.",
        _parameters(planned),
        "Break-away torques, means of the ramps of one direction:",
        _break_aways(planned),
        "### The form chosen by BIC",
        f"Among all six forms, in {ALL_FORMS} of the experiments each; the truth within the 99 % band of the curve "
        "that is then told, at 5, 15, 35, 65 and 100 % of the largest speed, both ways.",
        _forms(planned),
        "### Windows alone",
        f"{alone[0]['experiments']} experiments each on a course made by hand, 22 runs per drive, friction with a "
        f"smooth sign ({', '.join(str(one['windows']) for one in alone)} windows), the form given.",
        _parameters(alone),
    ]
    return "\n\n".join(parts)


def _worst(alone: Sequence[dict[str, Any]], planned: Sequence[dict[str, Any]]) -> str:
    """In a sentence, the range of coverages."""
    said = []
    for name, found in (("the planned experiment", planned), ("windows alone", alone)):
        raw, centred = (
            [share for one in found if one["encoder"] for share in one[key]]
            for key in ("within_percent", "within_percent_without_bias")
        )
        said.append(
            f"in {min(raw):.1f} to {max(raw):.1f} % of the experiments for {name} ({min(centred):.1f} to "
            f"{max(centred):.1f} % with the bias of the motion taken off)"
        )
    return f"With encoder counts every parameter is within its 99 % interval {'; '.join(said)}."


def _parameters(found: Sequence[dict[str, Any]]) -> str:
    head = ["drive", "positions", "parameter", "truth", "bias", "99 % interval", "within", "within, bias taken off"]
    rows = [
        [one["drive"], _positions(one), name, f"{one['truth'][k]:g}", *_shares(one, k)]
        for one in found
        for k, name in enumerate(one["parameters"])
    ]
    return record.table(head, rows)


def _break_aways(found: Sequence[dict[str, Any]]) -> str:
    head = ["drive", "positions", "truth", "mean", "deviation", "bias", "99 % interval", "within", "bias taken off"]
    rows = []
    for one in found:
        of = one["break_away"]
        for k, truth in enumerate(of["truth"]):
            told = [f"{of['mean'][k]:.2f}", f"{of['deviation'][k]:.2g}"]
            rows.append([one["drive"], _positions(one), f"{truth:g}", *told, *_shares(of, k)])
    return record.table(head, rows)


def _forms(found: Sequence[dict[str, Any]]) -> str:
    head = ["drive", "positions", "true form", "chosen", "truth within the band", "at the worst speed"]
    rows = []
    for one in found:
        shares = one["inside_band_percent"]
        if not shares:
            continue
        chosen = "; ".join(f"{name} {count}" for name, count in one["chosen"].items())
        worst = min(range(len(shares)), key=shares.__getitem__)
        at = f"{shares[worst]:.0f} % at {one['told_at'][worst]} %"
        rows.append([one["drive"], _positions(one), one["true_form"], chosen, f"{sum(shares) / len(shares):.1f} %", at])
    return record.table(head, rows)


def _shares(of: dict[str, Any], k: int) -> list[str]:
    return [
        f"{of['bias'][k]:.2g}",
        f"+- {of['interval99'][k]:.2g}",
        f"{of['within_percent'][k]:.1f} %",
        f"{of['within_percent_without_bias'][k]:.1f} %",
    ]


def _positions(one: dict[str, Any]) -> str:
    return "encoder" if one["encoder"] else "exact"
