"""What the number of harmonics brings and costs: fixed numbers, and `--harmonics auto`, for two robots."""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import record
from measure import measured

SETTINGS: dict[str, list[str]] = {"irp6": [], "panda": ["--no-friction", "--no-rotor"]}
FIXED, STARTS, SEED = (5, 7, 10, 14, 20), 4, 0


def design(robot: str, harmonics: str) -> dict[str, Any]:
    """One run of the command line, as a user has it."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "design"
        run = measured(
            [
                *(sys.executable, "-m", "excite", "design", robot, *SETTINGS[robot], "--figures", "none"),
                *("--harmonics", harmonics, "--starts", str(STARTS), "--seed", str(SEED), "--out", str(out)),
            ],
            threads=1,
        )
        content = json.loads((out / "design.json").read_text(encoding="utf-8"))
    return {
        "harmonics": content["task"]["harmonics"],
        "condition_number": content["criteria"]["condition_number"],
        "feasible": content["feasible"],
        "tried": content["solver"].get("harmonics", []),
        "note": content["notes"][-1] if harmonics == "auto" else "",
        "cpu_seconds": run.cpu,
        "wall_seconds": run.wall,
    }


def rows(robot: str, runs: dict[str, dict[str, Any]]) -> list[list[object]]:
    """Lines of the table of one robot."""
    return [
        [
            robot,
            asked if asked != "auto" else f"auto: {run['harmonics']}",
            f"**{run['condition_number']:.2f}**" if asked == "auto" else f"{run['condition_number']:.2f}",
            f"{run['cpu_seconds']:.1f}",
            "yes" if run["feasible"] else "NO",
            ", ".join(f"{trial['harmonics']}: {trial['value']:.2f}" for trial in run["tried"]) or "-",
        ]
        for asked, run in runs.items()
    ]


HEAD = ("robot", "harmonics", "cond(W)", "CPU s", "limits hold", "values on the way")
LIMITATIONS = (
    f"10 s, {STARTS} starts, seed {SEED}, default limits, left-to-right base; panda without friction and rotors; the "
    "fixed numbers begin with random motions, auto begins each number after the first with the best motion so far",
    "one seed: with more starts the fixed numbers may come out lower",
    "CPU time is that of the whole command with its workers, on a shared machine where it varies by some ten per cent",
)


def main() -> None:
    """Both robots."""
    before = record.load()
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for robot in SETTINGS:
        found[robot] = {asked: design(robot, asked) for asked in (*map(str, FIXED), "auto")}
        print(record.table(HEAD, rows(robot, found[robot])), flush=True)
    text = record.table(HEAD, [row for robot, runs in found.items() for row in rows(robot, runs)])
    record.save("harmonics_auto", before, {"starts": STARTS, "seed": SEED, "robots": found}, text, LIMITATIONS)


if __name__ == "__main__":
    main()
