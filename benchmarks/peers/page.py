"""The page of the public benchmark: what it is, a table for each case, and its limitations."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence

import record
import robot_time
from cases import NAMES, NOISE, case
from runs import SYSTEMS, Run
from verdict import SECONDS

HEAD = (
    "system",
    "cond(W)",
    "robot s to 5 %",
    "slowest parameter",
    f"precise after {SECONDS:g} s",
    "limits as delivered",
    "CPU s",
)


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


INTRODUCTION = """\
Every system gets the same robot, limits, base columns, period and processor time on one thread, and hands over a
motion. One judge, which imports nothing of excite, says what the motion is worth: its condition number at 100 Hz,
whether it keeps the limits over continuous time, how long the robot has to repeat it until every base parameter is
known to 5 % (`robot s to 5 %`, with the parameter that takes longest), and which part of the parameters is so after a
minute.

- `excite`: the search that `excite design` makes by default.
- `slsqp`: SciPy's SLSQP with finite differences from random motions, regressors by Pinocchio.
- `figaroh`: its optimal trajectory between waypoints, IPOPT with finite differences.
- `random`: the best of as many random motions as the time allows."""

FIGAROH = """\
figaroh runs where `--figaroh-python` says, in an environment of its own; without it, it is left out, and the tables say
why:

```sh
python3 -m venv figaroh && figaroh/bin/pip install figaroh cyipopt-wheels example-robot-data ruamel.yaml
.venv/bin/python benchmarks/public.py --figaroh-python figaroh/bin/python
```

Every finished run is on disk at once; `--resume` goes on where an earlier call has stopped. `--only`, `--cases`,
`--seeds` and `--budget` choose less or more."""


def case_table(name: str, runs: Sequence[Run], figaroh: dict[str, str] | str) -> str:
    """Table of one case, with a line for each system."""
    rows: list[Sequence[object]] = []
    for system in SYSTEMS:
        if some := [run for run in runs if run["system"] == system]:
            rows.append(row(system, some))
        elif system == "figaroh" and isinstance(figaroh, str):
            rows.append([system, f"not installed: {figaroh}", *[""] * (len(HEAD) - 2)])
    return f"**{case(name).title}**\n\n{record.table(HEAD, rows)}"


def text(runs: Sequence[Run], figaroh: dict[str, str] | str) -> str:
    """The whole page but its limitations."""
    by_case = {name: [run for run in runs if run["case"] == name] for name in NAMES}
    budgets = ", ".join(f"{budget:g}" for budget in sorted({run["budget"] for run in runs}))
    seeds = ", ".join(str(seed) for seed in sorted({run["seed"] for run in runs}))
    note = f"Seeds: {seeds}; {budgets} s of processor time a run; median (least-largest) where they differ."
    late = [run for run in runs if run["system"] == "excite" and run.get("cpu", 0.0) > run["budget"]]
    if late:
        places = ", ".join(f"{run['case']} ({run['cpu']:.0f} s)" for run in late)
        note += f" `excite` knows no such end, and took longer on {places}."
    if not isinstance(figaroh, str):
        note += " In figaroh's environment: " + ", ".join(f"{name} {of}" for name, of in figaroh.items()) + "."
    tables = [case_table(name, some, figaroh) for name, some in by_case.items() if some]
    picture = "![Share of precise parameters over the robot's time, a line per motion](public.png)"
    return "\n\n".join([INTRODUCTION, *tables, note, picture, FIGAROH])


LIMITATIONS = (
    "what favours us: we stated the problems and have tuned our search on these three robots; the harmonics and the "
    "rest at both ends are those of our default family; the other systems run as we could set them up, not as their "
    "authors would; torque limits and collisions are left out, and friction but on the IRp-6",
    "`excite` ends by itself; the others go on until the budget is spent, and the best of their motions is chosen "
    "outside of it. Processor time is that of the whole process, with imports, set-up and that choice, on a machine "
    "that other work shares, which inflates it, and not for all runs equally; elsewhere they come farther, or less far",
    "no system designs for precision here: all minimise the condition number, and the robot's time is what comes of it",
    "few seeds: differences of some per cent, or of one run of ten seconds, say nothing; and of two motions, the one "
    "of the lower condition number may need the longer time",
    f"robot seconds: whole runs of the motion, until the half-width of the {100 * robot_time.CONFIDENCE:g} % interval "
    f"of every base parameter is at most {100 * robot_time.SHARE:g} % of its described value, or of "
    f"{robot_time.FLOOR:g} times the largest described value of the same unit where that is more; that floor belongs "
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
