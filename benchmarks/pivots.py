"""How much "column-pivoted QR" leaves open: the best value in the base columns that each reading of it finds.

Several columns leave equal rests on these arms, and LAPACK decides such ties by rounding: the set that it finds depends
on the order in which the same random states are drawn and stacked.
"""

from __future__ import annotations

from typing import Any

import record
from judge import base_columns, lapack_columns
from measure import script
from problems import PROBLEMS

STARTS = 6
DRAWS = ("in turn", "state by state", "joint by joint")
ROWS = ("instants", "joints")


def reachable(problem: str, columns: list[str]) -> float:
    """Best condition number of a few starts in some base columns."""
    wanted = {"mode": "starts", "problem": problem, "convention": "pivoted-lapack", "starts": STARTS}
    found = script("ours.py", {**wanted, "columns": columns}, threads=1).result
    return float(min(start["value"] for start in found))


def readings(problem: str) -> list[dict[str, Any]]:
    """Every reading with its columns and value; equal sets are optimised once."""
    ways = [
        ("left to right QR", base_columns(problem)["gautier"]),
        ("ties to the left", base_columns(problem)["pivoted"]),
    ]
    for draws in DRAWS:
        for rows in ROWS:
            ways.append((f"LAPACK, drawn {draws}, stacked by {rows}", lapack_columns(PROBLEMS[problem], draws, rows)))
    values: dict[tuple[str, ...], float] = {}
    for _, columns in ways:
        if tuple(columns) not in values:
            values[tuple(columns)] = reachable(problem, columns)
    return [{"problem": problem, "way": way, "value": values[tuple(c)], "columns": c} for way, c in ways]


LIMITATIONS = (
    f"best of {STARTS} starts, as the solver reports it",
    "the sets that LAPACK finds may differ with another build of it; those found here are in pivots.json",
)


def main() -> None:
    """Both problems."""
    before = record.load()
    found = {problem: readings(problem) for problem in PROBLEMS}
    rows = [
        [one["way"], *(f"{found[problem][k]['value']:.2f}" for problem in PROBLEMS)]
        for k, one in enumerate(found["P1"])
    ]
    text = record.table(["base columns", *PROBLEMS], rows)
    record.save("pivots", before, {"readings": found}, text, LIMITATIONS)


if __name__ == "__main__":
    main()
