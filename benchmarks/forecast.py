"""Whether a search gains what it says that more of it would bring: ``python benchmarks/forecast.py``.

A design says "another N starts are expected to gain X %", see `excite.design.search_rounds.Rounds.left`. Here searches
go on for a stated time, and after every population what was expected of the next one is compared with what that one
brought.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import Any

import record
from measure import measured

PROBLEMS: dict[str, dict[str, Any]] = {  # with the processor time of a search [s]
    "IRp-6": {"robot": "irp6", "budget": 15},
    "IRp-6, energy": {"robot": "irp6", "model": "energy", "budget": 15},
    "IRp-6, load": {"robot": "irp6", "model": "load", "period": 6.4, "budget": 15},
    "IRp-6, trace": {"robot": "irp6", "criterion": "trace", "budget": 15},
    "IRp-6, B-splines": {"robot": "irp6", "trajectory": "bspline", "intervals": 10, "budget": 15},
    "Panda": {"robot": "panda", "budget": 60},
    "UR10e": {"robot": "ur10e", "budget": 40},
    "UR10e, 3 harmonics": {"robot": "ur10e", "harmonics": 3, "budget": 25},
    "iiwa 7": {"robot": "iiwa7", "budget": 60},
    "SO-101": {"robot": "so101", "velocity": [3.0], "acceleration": [10.0], "budget": 20},
}
HEAD = ("problem", "populations", "best by each seed", "expected of the next, mean", "brought, mean", "ratio")
LIMITATIONS = (
    "ends of populations of one search: what the last one in a search would have been followed by is not known",
    "gains are rare and of very different sizes: a ratio of one problem scatters by itself",
)


def run(problem: str, seed: int) -> dict[str, Any]:
    """Criteria at the ends of the populations of one search, in a process of its own."""
    options = json.dumps(PROBLEMS[problem] | {"seed": seed})
    ends = measured([sys.executable, __file__, "--run", options], 1).result
    return {"problem": problem, "seed": seed, "ends": ends}


def search(options: dict[str, Any]) -> list[float]:
    """The ends of the populations, with the same seed and options as on the command line."""
    import excite
    from excite.design.search_rounds import Rounds

    ends: list[float] = []
    take = Rounds._take

    def followed(rounds: Rounds, results: Any) -> None:
        take(rounds, results)
        ends[:] = rounds.ends

    Rounds._take = followed  # type: ignore[method-assign]
    task = excite.Task(**{name: tuple(x) if isinstance(x, list) else x for name, x in options.items()})
    excite.design_trajectory(task.changed(executor="serial"))
    return ends


def compared(ends: list[float]) -> list[tuple[float, float]]:
    """For every population but the first two, what was expected of it, and what it brought; both relative."""
    pairs = []
    for k in range(2, len(ends)):
        best, second = sorted(ends[:k])[:2]
        pairs.append(((second - best) / best / (k + 2), max(0.0, 1.0 - ends[k] / best)))
    return pairs


def rows(runs: list[dict[str, Any]]) -> list[list[object]]:
    """One line a problem, and one of all."""
    lines: list[list[object]] = []
    for name in [*PROBLEMS, "all"]:
        own = [found for found in runs if name in (found["problem"], "all")]
        pairs = [pair for found in own for pair in compared(found["ends"])]
        if not pairs:
            continue
        expected, brought = (sum(pair[k] for pair in pairs) / len(pairs) for k in (0, 1))
        best = ", ".join(f"{min(found['ends']):.4g}" for found in own if found["ends"]) if name != "all" else "-"
        ratio = f"{expected / brought:.2f}" if brought else "nothing was gained"
        lines.append([name, len(pairs), best, f"{expected:.3%}", f"{brought:.3%}", ratio])
    return lines


def main() -> None:
    """Search, compare, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(5)))
    parser.add_argument("--run", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.run:
        print(json.dumps(search(json.loads(asked.run))))
        return
    before = record.load()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        runs = list(pool.map(lambda one: run(*one), product(PROBLEMS, asked.seeds)))
    text = f"Gains of the next population, relative.\n\n{record.table(HEAD, rows(runs))}"
    record.save("forecast", before, {"runs": runs}, text, LIMITATIONS)


if __name__ == "__main__":
    main()
