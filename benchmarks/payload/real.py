"""A real UR10e with a load of 2.805 kg: gains from one half of a pair of logs, the mass from the other.

The logs lie in the folder given as the argument (see this folder's README). Every setting is the tool's default; the
halves are those of the motion that the tool finds.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import excite
from excite.payload.identify_payload import identify_payload

HERE = Path(__file__).resolve().parent
MAPPING = HERE.parent / "identification" / "ur10e.yaml"
MASS = 2.805
LOGS = {"without": "ur-20_01_31-unload.csv", "with": "ur-20_01_31-load.csv"}
MOTION = {"without": (339, 2485), "with": (486, 2630)}  # rows, as 'excite identify' finds them


def halves() -> tuple[excite.LogChoice, excite.LogChoice]:
    """The first and the second half of both logs."""
    rows = {}
    for which, (first, last) in MOTION.items():
        middle = (first + last) // 2
        rows[which] = (f"{first}:{middle}", f"{middle}:{last}")
    one, two = (
        excite.LogChoice(mapping=MAPPING, rows=rows["with"][k], without_rows=rows["without"][k]) for k in (0, 1)
    )
    return one, two


def case(folder: Path, kind: str, calibrate_on: int) -> dict[str, Any]:
    """Gains from one half, the mass from the other."""
    choices = halves()
    bare, loaded = folder / LOGS["without"], folder / LOGS["with"]
    gains = excite.calibrate_gains("ur10e", loaded, bare, MASS, kind=kind, logs=choices[calibrate_on])
    found = identify_payload("ur10e", loaded, without=bare, gains=gains.gains, logs=choices[1 - calibrate_on])
    low, high = found.intervals[0].tolist()
    return {
        "gains": kind,
        "calibrated_on": ("first", "second")[calibrate_on],
        "factors": gains.gains.factor.tolist(),
        "deviations": gains.gains.deviation.tolist(),
        "mass": found.mass,
        "interval": [low, high],
        "error_percent": 100 * (found.mass / MASS - 1),
        "inside": low <= MASS <= high,
        "centre": found.body.centre.tolist(),
    }


def stated(folder: Path) -> dict[str, Any]:
    """The mass with the gains as stated."""
    choice = excite.LogChoice(mapping=MAPPING)
    found = identify_payload("ur10e", folder / LOGS["with"], without=folder / LOGS["without"], logs=choice)
    low, high = found.intervals[0].tolist()
    return {"mass": found.mass, "interval": [low, high], "inside": low <= MASS <= high}


def text(content: dict[str, Any]) -> str:
    """A table."""
    lines = [
        "# A real UR10e with 2.805 kg",
        "",
        "| gains | from half | mass of the other [kg] | 99 % | error | inside |",
    ]
    lines.append("|" + "---|" * 6)
    for c in content["cases"]:
        low, high = c["interval"]
        lines.append(
            f"| {c['gains']} | {c['calibrated_on']} | {c['mass']:.3f} | {low:.3f} to {high:.3f} "
            f"| {c['error_percent']:+.2f} % | {'yes' if c['inside'] else 'no'} |"
        )
    s = content["stated"]
    low, high = s["interval"]
    lines.append(
        f"| as stated | | {s['mass']:.3f} (whole logs) | {low:.3f} to {high:.3f} | | {'yes' if s['inside'] else 'no'} |"
    )
    return "\n".join([*lines, ""])


def main(folder: Path) -> None:
    """Run all cases and write the results."""
    cases = [case(folder, kind, half) for kind in ("each", "common") for half in (0, 1)]
    content = {"cases": cases, "stated": stated(folder)}
    results = HERE / "results"
    results.mkdir(exist_ok=True)
    (results / "real.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    (results / "real.md").write_text(text(content), encoding="utf-8")
    print(text(content))


if __name__ == "__main__":
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit(f"expected one argument: the folder with {LOGS['with']} and {LOGS['without']}")
    main(Path(sys.argv[1]))
