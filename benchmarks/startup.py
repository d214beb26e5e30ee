"""How soon the command line answers, and how long the symbolic set-up of a 7-axis arm takes."""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import record
from measure import Measured, measured, script

TIMES, ARMS = 9, ("panda", "iiwa7")
COMMANDS = ("--help", "--version", "robots")
THREADS = {"one thread": 1, "threads as installed": None}
STEPS = ("robot", "model, base parameters, value", "gradient")
_SETUP = {"mode": "setup"}


def median(values: list[float]) -> str:
    """Median with the range."""
    return f"**{statistics.median(values):.2f}** ({min(values):.2f}-{max(values):.2f})"


def repeated(run: Callable[[], Measured]) -> list[Measured]:
    """Several runs; one before them fills the disk's cache."""
    run()
    return [run() for _ in range(TIMES)]


LIMITATIONS = (
    f"median of {TIMES} runs (lowest-highest) with files in the disk's cache",
    "wanted: `excite --help` within 0.3 s of wall time, set-up within 1 s of processor time",
    "set-up is that of `excite design`, with friction: model, base parameters, the function that evaluates the "
    "regressor and its gradient, including the check that random motions show all parameters",
    "imports include the start of the interpreter; with several BLAS threads, processor time includes what they spend "
    "waiting for each other, which grows with the load of the machine",
)


def main() -> None:
    """Commands, then arms."""
    before = record.load()
    excite = str(Path(sys.executable).parent / "excite")
    answers = {name: [run.wall for run in repeated(partial(measured, [excite, name]))] for name in COMMANDS}
    lines = [record.table(["command", "wall s"], [[f"`excite {k}`", median(v)] for k, v in answers.items()]), ""]
    setups = {
        f"{arm}, {label}": [
            run.result for run in repeated(partial(script, "ours.py", _SETUP | {"robot": arm}, threads))
        ]
        for arm in ARMS
        for label, threads in THREADS.items()
    }
    rows = []
    for arm, runs in setups.items():
        whole = [sum(run[step] for step in STEPS) for run in runs]
        rows.append([arm, median(whole), *(median([run[step] for run in runs]) for step in ("imports", *STEPS))])
    lines.append(record.table(["arm, BLAS threads; CPU s", "set-up without imports", "imports", *STEPS], rows))
    record.save("startup", before, {"answers": answers, "setups": setups}, "\n".join(lines), LIMITATIONS)


if __name__ == "__main__":
    main()
