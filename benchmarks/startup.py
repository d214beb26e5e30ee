"""How soon the command line answers, what is beside the search of a design, and what the commands after it cost."""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import record
from measure import Measured, measured, script
from problems import HARMONICS, PERIOD, PROBLEMS

TIMES, ARMS = 9, ("panda", "iiwa7")
COMMANDS = ("--help", "--version", "robots")
THREADS = {"one thread": 1, "threads as installed": None}
STEPS = ("robot", "model, base parameters, value", "gradient")
_SETUP = {"mode": "setup"}
DESIGNS, DESIGN_RUNS, STARTS = ("P1", "irp6", "P2"), 3, 12
RECORDS, RECORD_RUNS, NOISE = ("irp6", "panda"), 5, 0.1  # Nm
EXCITE = str(Path(sys.executable).parent / "excite")


def median(values: list[float]) -> str:
    """Median with the range."""
    return f"**{statistics.median(values):.2f}** ({min(values):.2f}-{max(values):.2f})"


def repeated(run: Callable[[], Measured]) -> list[Measured]:
    """Several runs; one before them fills the disk's cache."""
    run()
    return [run() for _ in range(TIMES)]


def robot_options(name: str) -> list[str]:
    """Robot and options of ``excite design`` for a common problem; a built-in robot as it is."""
    if name not in PROBLEMS:
        return [name]
    problem = PROBLEMS[name]
    positions = (f"{low}:{high}" for low, high in zip(problem.lower, problem.upper, strict=True))
    return [
        str(problem.path),
        *("--tip", problem.tip, "--no-friction", "--no-rotor", "--no-self-collision", "--floor", "none"),
        *("--period", str(PERIOD), "--harmonics", str(HARMONICS)),
        f"--position-limit={','.join(positions)}",
        f"--velocity-limit={','.join(map(str, problem.velocity))}",
        f"--acceleration-limit={','.join(map(str, problem.acceleration))}",
    ]


def fixed_cost(name: str, figures: tuple[str, ...]) -> dict[str, float]:
    """Processor time of ``excite design`` and all its processes, and of that the time of the starts [s]."""
    with tempfile.TemporaryDirectory() as folder:
        out = ["--out", folder, "--starts", str(STARTS)]
        whole = measured([EXCITE, "--quiet", "design", *robot_options(name), *out, *figures]).cpu
        files = Path(folder, "starts").glob("start-*.json")
        return {"command": whole, "starts": sum(json.loads(file.read_text())["cpu"] for file in files)}


def fixed_costs() -> dict[str, list[dict[str, float]]]:
    """Every design without figures and with them, in turns."""
    cases = {
        f"{name}, {label}": partial(fixed_cost, name, figures)
        for name in DESIGNS
        for label, figures in (("without figures", ("--figures", "none")), ("with figures", ()))
    }
    runs: dict[str, list[dict[str, float]]] = {case: [] for case in cases}
    for _ in range(DESIGN_RUNS):
        for case, run in cases.items():
            runs[case].append(run())
    return runs


def after_design(robot: str) -> dict[str, list[float]]:
    """Processor time of the commands that follow the design of a motion of 10 s [s]."""
    with tempfile.TemporaryDirectory() as folder:
        design, result, page, *logs = (
            str(Path(folder, x)) for x in ("design", "result", "page.html", "1.csv", "2.csv")
        )

        def excite(*words: str) -> float:
            return measured([EXCITE, "--quiet", *words], threads=1).cpu

        excite("design", robot, "--starts", "2", "--figures", "none", "--out", design)
        for seed, log in enumerate(logs):
            excite("simulate", design, "--torque-noise", str(NOISE), "--seed", str(seed), "--out", log)
        identify = ("identify", robot, logs[0], "--design", design, "--out", result, "--force")
        commands = {
            "identify, without figures": (*identify, "--figures", "none"),
            "identify": identify,
            "verify, without figures": ("verify", result, logs[1], "--figures", "none"),
            "verify": ("verify", result, logs[1]),
            "report": ("report", design, result, f"{result}/verification-2.json", "--out", page, "--force"),
        }
        return {name: [excite(*words) for _ in range(RECORD_RUNS)] for name, words in commands.items()}


LIMITATIONS = (
    f"median of {TIMES} runs (lowest-highest) with files in the disk's cache",
    "wanted: `excite --help` within 0.3 s of wall time, set-up within 1 s of processor time",
    "set-up is that of `excite design`, with friction: model, base parameters, the function that evaluates the "
    "regressor and its gradient, including the check that random motions show all parameters",
    "fixed costs are the processor time of `excite design` with all its processes, less that of its "
    f"{STARTS} starts as their files have it: start, imports, set-up, worker processes, certificate and files; P1 and "
    f"P2 are the common problems without self-collision; median of {DESIGN_RUNS} runs; wanted for P1: 2 s without "
    "figures, 3 s with them; processor time grows with the load, on cores that share what they compute with",
    f"commands after a design: 20,001 rows with {NOISE} Nm of white noise, every choice by the tool, one BLAS thread; "
    f"the page is of design, result and verification; median of {RECORD_RUNS} runs; wanted: 2 s for the page",
    "imports include the start of the interpreter; with several BLAS threads, processor time includes what they spend "
    "waiting for each other, which grows with the load of the machine",
)


def main() -> None:
    """Commands, then arms."""
    before = record.load()
    answers = {name: [run.wall for run in repeated(partial(measured, [EXCITE, name]))] for name in COMMANDS}
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
    fixed = fixed_costs()
    rows = []
    for case, costs in fixed.items():
        beside = [cost["command"] - cost["starts"] for cost in costs]
        rows.append([case, median(beside), median([cost["starts"] for cost in costs])])
    lines += ["", record.table([f"`excite design`, {STARTS} starts; CPU s", "fixed costs", "starts"], rows)]
    after = {robot: after_design(robot) for robot in RECORDS}
    rows = [[robot, *map(median, costs.values())] for robot, costs in after.items()]
    lines += ["", record.table(["after a design of; CPU s", *after[RECORDS[0]]], rows)]
    content = {"answers": answers, "setups": setups, "fixed_costs": fixed, "after_design": after}
    record.save("startup", before, content, "\n".join(lines), LIMITATIONS)


if __name__ == "__main__":
    main()
