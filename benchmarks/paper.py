"""The cases of Kozlowski and Dutkiewicz (1996) on the IRp-6: their condition numbers beside those reached here."""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import record
from measure import measured

FREE_SPACE = ("--floor", "none", "--no-self-collision")


@dataclass(frozen=True)
class Case:
    """One row of the table.

    Parameters
    ----------
    name : str
    paper : str
        Condition numbers that the paper states.
    known : str
        Best of 60 starts of a prototype within the same limits.
    wanted : float, optional
        Condition number to reach.
    budget : float, optional
        Processor time for it [s].
    options : tuple of str
        Of ``excite design irp6``.
    """

    name: str
    paper: str
    known: str
    wanted: float | None
    budget: float | None
    options: tuple[str, ...]


LOAD = ("--period", "6.4")
CASES = (
    Case("differential, axes 1-3, 13 parameters, 10 s", "1e14 -> 1e13", "39.3", 41.0, 20.0, ()),
    Case("energy short (5 ms), axes 1-3, 13 parameters, 10 s", "not satisfactory", "54.7", 57.0, 30.0,
         ("--model", "energy")),
    Case("energy long, axes 1-3, 13 parameters, 10 s", "not satisfactory", "163", 165.0, 40.0,
         ("--model", "energy", "--window", "long")),
    Case("energy, drive 2 alone, 10 s", "3000 -> 500", "-", None, None, ("--model", "energy", "--drives", "2")),
    Case("the same, joint 2 alone (drive 3 follows)", "-", "-", None, None, ("--model", "energy", "--joints", "2")),
    Case("differential, row of joint 1 only, 10 s", "1.9e5 -> 88, not realisable", "-", None, None,
         ("--equations", "1")),
    Case("load, differential, axes 1-5, 6.4 s", "90830 -> 3000 in 60 h", "5.85", 6.0, 40.0, ("--model", "load", *LOAD)),
    Case("load, integral long, axes 1-5, 6.4 s", "worse than differential", "13.6", 14.0, 90.0,
         ("--model", "load-integral", "--window", "long", *LOAD)),
    Case("load, integral short (5 ms), axes 1-5, 6.4 s", "worse than differential", "-", None, None,
         ("--model", "load-integral", *LOAD)),
    Case("load, differential, torques only, 6.4 s", "-", "-", None, None,
         ("--model", "load", "--equations", "nx,ny,nz", *LOAD)),
    Case("differential, axes 1-3, from the paper's start", "1e14 -> 1e13", "-", None, None,
         ("--start", "quintic,quintic,cosine")),
    Case("load, differential, from the paper's start", "90830 -> 3000 in 60 h", "-", None, None,
         ("--model", "load", "--start", "sines", *LOAD)),
    Case("differential, axes 1-3, 10 s, 8 harmonics", "-", "-", None, None, ("--harmonics", "8")),
    Case("differential, axes 1-3, 10 s, 60 starts", "1e14 -> 1e13", "39.3", None, None, ("--starts", "60")),
)  # fmt: skip

HEAD = ("case", "paper", "known", "wanted", "here", "normalised", "parameters", "limits hold", "CPU s", "budget s")

LIMITATIONS = (
    "paper: condition numbers as printed, before and after its optimisation; it ignores the robot's limits",
    "known: 60 starts of a prototype within the same limits, at rest at both ends",
    "here: limits of the IRp-6 held over continuous time, at rest at both ends, 5 harmonics unless said, seed 0",
    "normalised: the condition number of the same motion with every column of W divided by its length",
    "processor time is that of the whole command with worker processes and figures, on a shared machine",
    "the condition number is the program's own, with exact friction signs; the tests check the models "
    "against Pinocchio and the paper's corrected equations",
)


def run(case: Case) -> dict[str, Any]:
    """One case through the command line."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "design"
        arguments = ["design", "irp6", "--seed", "0", "--out", str(out), *FREE_SPACE, *case.options]
        took = measured([sys.executable, "-m", "excite", *arguments])
        content = json.loads((out / "design.json").read_text(encoding="utf-8"))
        first = json.loads((out / "starts" / "start-0000.json").read_text(encoding="utf-8"))
    criteria = content["criteria"]
    return {
        "case": case.name,
        "options": list(case.options),
        "condition_number": criteria["condition_number"],
        "column_normalised": criteria["condition_number_column_normalised"],
        "parameters": content["base"]["rank"],
        "feasible": content["feasible"],
        "start_0": [first["history"][0], first["value"]],
        "cpu_seconds": took.cpu,
        "wall_seconds": took.wall,
    }


def row(case: Case, found: dict[str, Any]) -> list[object]:
    """One line of the table."""
    return [
        case.name,
        case.paper,
        case.known,
        "-" if case.wanted is None else f"<= {case.wanted:g}",
        f"**{found['condition_number']:.4g}**",
        f"{found['column_normalised']:.3g}",
        found["parameters"],
        "yes" if found["feasible"] else "NO",
        f"{found['cpu_seconds']:.1f}",
        "-" if case.budget is None else f"{case.budget:g}",
    ]


def main() -> None:
    """Every case in turn."""
    before = record.load()
    found = [run(case) for case in CASES]
    text = record.table(HEAD, [row(case, result) for case, result in zip(CASES, found, strict=True)])
    record.save("paper", before, {"runs": found}, text, LIMITATIONS)


if __name__ == "__main__":
    main()
