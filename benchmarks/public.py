"""This project beside the systems that install from the registries, on three robots: ``python benchmarks/public.py``.

Every system gets the same robot, limits, base columns and processor time, on one thread, and hands over a motion;
one judge, which imports nothing of this project, says what the motion is worth. Every finished run is saved at once;
``--resume`` goes on where an earlier call has stopped. figaroh runs in an environment of its own::

    python3 -m venv figaroh && figaroh/bin/pip install figaroh cyipopt-wheels example-robot-data ruamel.yaml
    python benchmarks/public.py --figaroh-python figaroh/bin/python
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import statistics
import sys
from collections.abc import Callable, Sequence
from typing import Any

import record
from measure import HERE

sys.path.insert(0, str(HERE / "peers"))
import precision
from cases import NAMES, NOISE, case
from runs import Run, complete, figaroh_versions, motion
from verdict import SECONDS, verdict

SYSTEMS = ("excite", "slsqp", "figaroh", "random")
BUDGET, SEEDS = 20.0, 2
RESULTS = HERE / "results" / "public.json"

HEAD = (
    "system",
    "cond(W)",
    "robot s to 5 %",
    "slowest parameter",
    f"precise after {SECONDS:g} s",
    "limits as delivered",
    "CPU s",
)


def judged(run: Run, python: str) -> dict[str, Any]:
    """One run, and what its motion is worth."""
    found = motion(run, python)
    return found if "failure" in found else {**found, "verdict": verdict(case(run["case"]), found["trajectory"])}


def _each(runs: Sequence[Run], of: Callable[[Run], float], form: str) -> str:
    """Median, and the least and the largest where they differ."""
    values = [of(run) for run in runs]
    ends = [format(value, form) for value in (min(values), max(values))]
    middle = format(statistics.median(values), form)
    return middle if ends[0] == ends[1] else f"{middle} ({ends[0]}-{ends[1]})"


def row(system: str, runs: Sequence[Run]) -> list[object]:
    """One line of the table of a case."""
    good = [run for run in runs if "failure" not in run]
    if not good:
        return [system, f"failed: {runs[0]['failure']}", *[""] * (len(HEAD) - 2)]
    worst = max(run["verdict"]["limit_use_as_delivered"] for run in good)
    return [
        system + (f", {len(runs) - len(good)} of {len(runs)} failed" if len(good) < len(runs) else ""),
        _each(good, lambda run: run["verdict"]["condition_number"], ".1f"),
        _each(good, lambda run: run["verdict"]["robot_seconds"], ".0f"),
        ", ".join(dict.fromkeys(run["verdict"]["worst_parameter"] for run in good)),
        _each(good, lambda run: 100 * run["verdict"]["share_after_a_minute"], ".0f") + " %",
        "kept" if all(run["verdict"]["limits_kept"] for run in good) else f"exceeded by {100 * (worst - 1):.1f} %",
        _each(good, lambda run: run["cpu"], ".0f"),
    ]


def text(runs: Sequence[Run], figaroh: dict[str, str] | str) -> str:
    """The tables of all cases."""
    parts = []
    for name in NAMES:
        rows = []
        for system in SYSTEMS:
            some = [run for run in runs if (run["case"], run["system"]) == (name, system)]
            if some:
                rows.append(row(system, some))
            elif system == "figaroh" and isinstance(figaroh, str):
                rows.append([system, f"not installed: {figaroh}", *[""] * (len(HEAD) - 2)])
        if rows:
            parts += [f"**{case(name).title}**", record.table(HEAD, rows)]
    seeds = len({run["seed"] for run in runs})
    budgets = ", ".join(f"{budget:g}" for budget in sorted({run["budget"] for run in runs}))
    versions = "" if isinstance(figaroh, str) else ", ".join(f"{name} {of}" for name, of in figaroh.items())
    parts.append(
        f"{seeds} seeds, {budgets} s of processor time for each run; median, and smallest and largest in parentheses. "
        + (f"In figaroh's environment: {versions}." if versions else "")
    )
    return "\n\n".join(parts)


LIMITATIONS = (
    "what favours us: we stated the problems and have tuned our search on these three robots; the harmonics and the "
    "rest at both ends are those of our default family; the other systems run as we could set them up, not as their "
    "authors would; torque limits and collisions are left out, and friction but on the IRp-6",
    "`excite` ends by itself; the others go on until the budget is spent, and the best of their motions is chosen "
    "outside of it. Processor time is that of the whole process, with imports, set-up and that choice, on a machine "
    "that other work shares, which inflates it, and not for all runs equally; elsewhere they come farther, or less far",
    "no system designs for precision here: all minimise the condition number, and the robot's time is what comes of it",
    f"robot seconds: whole runs of the motion, until the half-width of the {100 * precision.CONFIDENCE:g} % interval "
    f"of every base parameter is at most {100 * precision.SHARE:g} % of its described value, or of "
    f"{precision.FLOOR:g} times the largest described value of the same unit where that is more; that floor belongs "
    "to the whole arm, and asks little of light wrists",
    f"the noise: normal, independent at 100 Hz, of known deviation, {100 * NOISE:g} % of each torque limit; robot "
    "seconds grow with its square, and real noise is coloured; ways from the end of a motion to its start are not "
    "counted",
    "motions that break a limit over continuous time are drawn together about the middle until they do not, and then "
    "judged; `limits as delivered` is before",
    "figaroh leaves columns and limits to subclasses: ours gives it the case's columns and all limits at 10 Hz (its "
    "own class has torques instead of accelerations), 11 waypoints at which it rests, and keeps its best iterate, "
    "which it would lose when it is stopped; its initial guesses break velocity limits, as they count on cubics where "
    "its pieces are quintics; on Linux, PyPI has no wheel of `cyipopt`, but one of `cyipopt-wheels`",
    "SLSQP (SciPy, finite differences, Pinocchio's regressors at 100 instants) and the random motions are our scripts; "
    "peers that no registry has, or that need compilers, are not here",
)


def save(runs: list[Run], before: float, figaroh: dict[str, str] | str) -> None:
    """Results so far."""
    runs = sorted(runs, key=lambda run: (NAMES.index(run["case"]), SYSTEMS.index(run["system"]), run["seed"]))
    content = {"budget": BUDGET, "figaroh": figaroh, "runs": runs}
    record.save("public", before, content, text(runs, figaroh), LIMITATIONS)


def main() -> None:
    """All systems on all cases."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=SEEDS, metavar="N", help="seeds 0 to N - 1 (%(default)s)")
    parser.add_argument("--budget", type=float, default=BUDGET, metavar="S", help="CPU time of a run (%(default)s)")
    parser.add_argument("--only", choices=SYSTEMS, nargs="+", default=SYSTEMS, metavar="SYSTEM", help=str(SYSTEMS))
    parser.add_argument("--cases", choices=NAMES, nargs="+", default=NAMES, metavar="CASE", help=str(NAMES))
    parser.add_argument("--resume", action="store_true", help="keep the finished runs of an earlier call")
    parser.add_argument("--figaroh-python", default=sys.executable, metavar="PATH", help="where figaroh is installed")
    asked = parser.parse_args()
    before, figaroh = record.load(), figaroh_versions(asked.figaroh_python)
    earlier = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {"runs": [], "figaroh": figaroh}
    if isinstance(figaroh, str) and "figaroh" in asked.only:
        print(f"figaroh is left out: {figaroh}", file=sys.stderr)
    systems = [system for system in asked.only if system != "figaroh" or not isinstance(figaroh, str)]
    wanted = [
        {"case": name, "system": system, "seed": seed, "budget": asked.budget}
        for seed in range(asked.seeds)
        for name in asked.cases
        for system in systems
    ]
    kept = [run for run in earlier["runs"] if asked.resume or (run["case"], run["system"]) not in chosen(wanted)]
    if isinstance(figaroh, str) and not isinstance(earlier["figaroh"], str):
        figaroh = earlier["figaroh"]  # of the runs that are kept

    def make(run: Run) -> Run:
        return judged(run, asked.figaroh_python if run["system"] == "figaroh" else sys.executable)

    def save_quietly(runs: list[Run]) -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            save(runs, before, figaroh)

    try:
        runs = complete(wanted, kept, make, save_quietly)
    except KeyboardInterrupt:
        print("Interrupted; the finished runs are saved. --resume makes the others.", file=sys.stderr)
        raise SystemExit(130) from None
    save(runs, before, figaroh)


def chosen(wanted: Sequence[Run]) -> set[tuple[str, str]]:
    """Cases and systems of some runs."""
    return {(run["case"], run["system"]) for run in wanted}


if __name__ == "__main__":
    main()
