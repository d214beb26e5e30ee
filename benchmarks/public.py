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
import sys
from collections.abc import Sequence
from typing import Any

import record
from measure import HERE

sys.path.insert(0, str(HERE / "peers"))
import figure
from cases import NAMES, case
from page import LIMITATIONS, text
from runs import SYSTEMS, Run, complete, figaroh_versions, motion
from verdict import verdict

BUDGET, SEEDS = 30.0, 2
RESULTS = HERE / "results" / "public.json"


def judged(run: Run, python: str) -> dict[str, Any]:
    """One run, and what its motion is worth."""
    found = motion(run, python)
    return found if "failure" in found else {**found, "verdict": verdict(case(run["case"]), found["trajectory"])}


def save(runs: list[Run], before: float, figaroh: dict[str, str] | str) -> None:
    """Results so far."""
    runs = sorted(runs, key=lambda run: (NAMES.index(run["case"]), SYSTEMS.index(run["system"]), run["seed"]))
    figure.write(runs, RESULTS.with_suffix(".png"))
    content = {"figaroh": figaroh, "runs": runs}
    record.save("public", before, content, text(runs, figaroh), LIMITATIONS)


def options() -> argparse.Namespace:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=SEEDS, metavar="N", help="seeds 0 to N - 1 (%(default)s)")
    parser.add_argument("--budget", type=float, default=BUDGET, metavar="S", help="CPU time of a run (%(default)s)")
    parser.add_argument("--only", choices=SYSTEMS, nargs="+", default=SYSTEMS, metavar="SYSTEM", help=str(SYSTEMS))
    parser.add_argument("--cases", choices=NAMES, nargs="+", default=NAMES, metavar="CASE", help=str(NAMES))
    parser.add_argument("--resume", action="store_true", help="keep the finished runs of an earlier call")
    parser.add_argument("--figaroh-python", default=sys.executable, metavar="PATH", help="where figaroh is installed")
    return parser.parse_args()


def wanted_runs(asked: argparse.Namespace, systems: Sequence[str]) -> list[Run]:
    """All runs, the first seed of every case before the second."""
    return [
        {"case": name, "system": system, "seed": seed, "budget": asked.budget}
        for seed in range(asked.seeds)
        for name in asked.cases
        for system in systems
    ]


def main() -> None:
    """All systems on all cases."""
    asked, before = options(), record.load()
    figaroh = figaroh_versions(asked.figaroh_python)
    earlier = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {"runs": [], "figaroh": figaroh}
    systems = [system for system in asked.only if system != "figaroh" or not isinstance(figaroh, str)]
    if len(systems) < len(asked.only):
        print(f"figaroh is left out: {figaroh}", file=sys.stderr)
        figaroh = earlier["figaroh"]  # of the runs that are kept
    wanted = wanted_runs(asked, systems)
    renewed = set() if asked.resume else {(run["case"], run["system"]) for run in wanted}
    kept = [run for run in earlier["runs"] if (run["case"], run["system"]) not in renewed]

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


if __name__ == "__main__":
    main()
