"""Long use, compressed: 1000 small designs and 10,000 tiny starts in one process; memory, open files and threads.

``python benchmarks/endurance/endurance.py`` writes ``results/endurance.json`` and ``results/endurance.md`` beside this
file. With ``--bound`` it exits with 1 where memory grows by more than that per unit of work.

A design is one start of a few iterations of each of three robots in turn, saved, read back, simulated for each tenth,
identified, and drawn for each fiftieth. A start is drawn and its first guess taken through one iteration per stage.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROBOTS = ("irp6", "ur10e", "panda")
WARM_UP = 0.2  # of the units of work; caches fill
PAGE = os.sysconf("SC_PAGE_SIZE")


def resident() -> int:
    """Resident memory of this process, or the largest so far where the system does not say [bytes]."""
    try:
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * PAGE
    except OSError:
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def entries(folder: str) -> int:
    """Number of names in a folder, such as the open files of this process; 0 where there is none."""
    return len(os.listdir(folder)) if os.path.isdir(folder) else 0


def state() -> dict[str, int]:
    """Memory, open files and threads now."""
    return {"bytes": resident(), "files": entries("/proc/self/fd"), "threads": entries("/proc/self/task")}


def design_once(number: int, folder: Path) -> None:
    """One unit of work: a design, and what is done with it."""
    import excite
    from excite.design.solvers.descent import SqpOptions
    from excite.design.solvers.sqp import SequentialQuadratic

    solver = SequentialQuadratic(SqpOptions(iterations=2))
    search = excite.Search(starts=1, seed=number, executor="serial", solver=solver)
    robot = ROBOTS[number % len(ROBOTS)]
    design = excite.design_trajectory(robot, search=search, period=5.0, harmonics=4)
    design.save(folder, replace=True)
    if number % 50 == 0:
        excite.write_figures(design, folder)
    if number % 10 == 0:
        stored = excite.load_design(folder, solver=solver)
        log = excite.simulate(stored, noise=1.0, rate=200.0, seed=number)
        excite.identify(robot, log, design=stored, choose=False).save(folder, replace=True)


@contextmanager
def starts(folder: Path) -> Iterator[Callable[[int], None]]:
    """Units of work that are one start each, of one problem."""
    import excite
    from excite.design.formulation import formulate
    from excite.design.solvers.descent import SqpOptions
    from excite.design.solvers.sqp import SequentialQuadratic
    from excite.design.starts import optimise_starts

    formulation = formulate(excite.load_robot("irp6"), excite.Task("irp6", period=4.0, harmonics=3))

    class OneGuess(SequentialQuadratic):
        """Takes the first guess and leaves out the race between them, which makes most of a start."""

        def solve(self, problem: Any, starts: Any, watch: Any = None) -> Any:
            return super().solve(problem, starts[:1], watch)

    problem, solver = formulation.problem, OneGuess(SqpOptions(iterations=1))
    yield lambda number: optimise_starts(problem, solver, 0, [number], folder) and None


def measured(work: Callable[[int], None], count: int, seconds: float) -> list[dict[str, Any]]:
    """State of the process while units of work are done, 50 times; fewer units where time is up."""
    began, seen, every = time.monotonic(), [], max(1, count // 50)
    for number in range(count):
        if time.monotonic() - began > seconds and len(seen) > 9:
            break
        work(number)
        if number % every == every - 1:
            gc.collect()
            seen.append({"done": number + 1, "seconds": time.monotonic() - began, **state()})
            print(f"{number + 1} of {count}: {seen[-1]['bytes'] / 1e6:.1f} MB", file=sys.stderr)
    return seen


def growth(seen: list[dict[str, Any]]) -> dict[str, float]:
    """Slope of memory by least squares after warming up [bytes per unit], and what was gained since then."""
    import numpy as np

    late = [each for each in seen if each["done"] > WARM_UP * seen[-1]["done"]]
    done, size = np.array([[each["done"], each["bytes"]] for each in late], dtype=float).T
    return {
        "units": float(seen[-1]["done"]),
        "seconds": float(seen[-1]["seconds"]),
        "bytes_per_unit": float(np.polyfit(done, size, 1)[0]),
        "first_bytes": float(size[0]),
        "last_bytes": float(size[-1]),
        "files_gained": float(late[-1]["files"] - late[0]["files"]),
        "threads_gained": float(late[-1]["threads"] - late[0]["threads"]),
    }


def table(results: dict[str, dict[str, float]]) -> str:
    """The results as Markdown."""
    lines = [
        "| in one process | units | s | memory after warming up [MB] | at the end [MB] | slope [bytes per unit] | "
        "files gained | threads gained |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, r in results.items():
        lines.append(
            f"| {name} | {r['units']:.0f} | {r['seconds']:.0f} | {r['first_bytes'] / 1e6:.1f} | "
            f"{r['last_bytes'] / 1e6:.1f} | {r['bytes_per_unit']:.0f} | {r['files_gained']:.0f} | "
            f"{r['threads_gained']:.0f} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--designs", type=int, default=1000)
    parser.add_argument("--starts", type=int, default=10_000)
    parser.add_argument("--minutes", type=float, default=600.0, help="end each part after about that long")
    parser.add_argument("--bound", type=float, help="largest slope of memory [bytes per unit]")
    parser.add_argument("--out", type=Path, default=HERE / "results")
    given = parser.parse_args()
    results: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        if given.designs:
            work = partial(design_once, folder=folder / "d")
            results["designs"] = growth(measured(work, given.designs, 60 * given.minutes))
        if given.starts:
            with starts(folder) as work:
                results["starts"] = growth(measured(work, given.starts, 60 * given.minutes))
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "endurance.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    (given.out / "endurance.md").write_text(table(results), encoding="utf-8")
    print(table(results))
    if given.bound is not None and any(
        r["bytes_per_unit"] > given.bound or r["files_gained"] > 0 or r["threads_gained"] > 0 for r in results.values()
    ):
        sys.exit(1)


if __name__ == "__main__":
    main()
