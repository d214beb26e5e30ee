"""What changes of a design's problem bring: by improving its motion, and by searches from scratch of some of them.

.venv/bin/python benchmarks/sensitivity.py
"""

from __future__ import annotations

from typing import Any

from record import load, save, table

import excite
from excite.optimality.sensitivity import sensitivity

STARTS = 12
ROBOTS: dict[str, dict[str, Any]] = {"irp6": {}, "panda": {"friction": False}}
FROM_SCRATCH: dict[str, dict[str, Any]] = {
    "10 harmonics instead of 5": {"harmonics": 10},
    "15 s instead of 10 s, with 8 harmonics": {"period": 15.0, "harmonics": 8},
    "15 s instead of 10 s": {"period": 15.0},
}


def of(robot: str, options: dict[str, Any]) -> dict[str, Any]:
    """The changes of one robot's design."""
    task = excite.Task(robot).changed(starts=STARTS, executor="serial", **options)
    design = excite.design_trajectory(task)
    result = sensitivity(design)
    searched = {
        change: excite.design_trajectory(task.changed(**what)).condition_number for change, what in FROM_SCRATCH.items()
    }
    rows = [
        {"change": row.change, "value": row.value, "gain": row.gain, "from_scratch": searched.get(row.change)}
        for row in result.rows
    ]
    return {
        "robot": robot,
        "condition_number": design.condition_number,
        "reference": result.reference,
        "rows": rows,
        "cpu_seconds": result.cpu_seconds,
    }


def _text(robot: dict[str, Any]) -> str:
    """One robot's table."""
    rows = []
    for row in robot["rows"]:
        searched = "" if row["from_scratch"] is None else f"{row['from_scratch']:.2f}"
        rows.append((row["change"], f"{row['value']:.2f}", f"{100 * row['gain']:.1f} %", searched))
    return (
        f"{robot['robot']}, 10 s, 5 harmonics, {STARTS} starts: condition number {robot['condition_number']:.2f}, "
        f"refined {robot['reference']:.2f}; {robot['cpu_seconds']:.1f} CPU s for all changes.\n\n"
        + table(("change", "improving the motion", "gain", f"from scratch, {STARTS} starts"), rows)
    )


def main() -> None:
    before = load()
    robots = [of(robot, options) for robot, options in ROBOTS.items()]
    save(
        "sensitivity",
        before,
        {"robots": robots},
        "\n\n".join(map(_text, robots)),
        (
            "Two robots, one seed; the condition number only.",
            "Limits were not loosened in searches from scratch.",
            "A search from scratch is not the best possible either.",
        ),
    )


if __name__ == "__main__":
    main()
