"""Command lines with any values, by the thousand: how each command ends, how long it takes, how memory grows.

    .venv/bin/python benchmarks/fuzz/fuzz.py --cases 100000 --seed 0

Commands run in this process on a robot of two joints, with the judge of `tests/builders/value_fuzzer.py`: exit status
0, 1 or 2, an error of one line, no warning, no number in a file that is not finite, at most 10 s of processor time.
Problems are collected, not raised, so that one does not hide the next. Writes ``results/fuzz.json`` and
``results/fuzz.md``; with ``--minutes`` it stops after that time, and says how many cases were run.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import time
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path

from hypothesis import HealthCheck, given, seed, settings

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "tests" / "builders"))

from value_fuzzer import BASE, Ended, command_lines, file_cases, memory, prepared, run  # noqa: E402

FILES = "files"  # numbers of files, rather than options
ROUND = 50  # cases of a command before the next one has its turn
CAP = 4000.0  # of memory [MB]


@dataclass
class Tally:
    """What the cases of one command came to.

    Parameters
    ----------
    statuses : dict
        Number of cases by exit status.
    problems : dict
        Problem to its first command line.
    cpu, slowest : float
        Of all cases, and of the slowest [s of processor time].
    memory : float
        Largest memory of the process when they had ended [MB].
    """

    statuses: dict[int, int] = field(default_factory=lambda: {0: 0, 1: 0, 2: 0})
    problems: dict[str, str] = field(default_factory=dict)
    cpu: float = 0.0
    slowest: float = 0.0
    memory: float = 0.0

    def add(self, arguments: list[str], ended: Ended, cpu: float) -> None:
        self.statuses[ended.status] = self.statuses.get(ended.status, 0) + 1
        for problem in ended.problems:
            self.problems.setdefault(problem, " ".join(" ".join(word[:400].split()) for word in arguments))
        self.cpu, self.slowest = self.cpu + cpu, max(self.slowest, cpu)
        self.memory = memory()


def fuzz(name: str, folder: Path, cases: int, number: int, tally: Tally, until: float) -> None:
    """Run one round of cases of a command."""

    @seed(number)
    @settings(max_examples=cases, database=None, deadline=None, suppress_health_check=list(HealthCheck))
    @given(file_cases() if name == FILES else command_lines(name).map(lambda arguments: (arguments, {})))
    def one(case: tuple[list[str], dict[str, str]]) -> None:
        if time.monotonic() < until:
            began, (arguments, files) = time.process_time(), case
            ended = run(arguments, folder, files=files)
            tally.add([*arguments, *files.values()], ended, time.process_time() - began)

    one()


def text_of(tallies: dict[str, Tally], seed_of_all: int) -> str:
    rows = ["| command | cases | done (0) | not held (1) | refused (2) | problems | slowest [s] | memory [MB] |"]
    rows.append("|---|---|---|---|---|---|---|---|")
    for name, t in tallies.items():
        ends = " | ".join(str(t.statuses[status]) for status in (0, 1, 2))
        total = sum(t.statuses.values())
        rows.append(f"| {name} | {total} | {ends} | {len(t.problems)} | {t.slowest:.1f} | {t.memory:.0f} |")
    count = sum(sum(t.statuses.values()) for t in tallies.values())
    spent = sum(t.cpu for t in tallies.values())
    rows += ["", f"{count} cases, seed {seed_of_all}, {spent:.0f} s of processor time; cap of the memory {CAP:.0f} MB."]
    rows += [f"- {name}: {what}: `{line}`" for name, t in tallies.items() for what, line in t.problems.items()]
    return "\n".join(rows) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100_000, help="of all commands together")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="time after which it stops")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", nargs="*", default=[*BASE, FILES])
    parser.add_argument("--out", type=Path, default=HERE / "results")
    options = parser.parse_args()
    until = time.monotonic() + 60 * options.minutes
    tallies = {name: Tally() for name in options.commands}
    each = -(-options.cases // len(tallies))
    with prepared() as folder:
        for turn in range(-(-each // ROUND)):
            for name, tally in tallies.items():
                left = min(ROUND, each - turn * ROUND)
                fuzz(name, folder, left, options.seed + turn, tally, until)
                _write(options, tallies)
    sys.stdout.write(text_of(tallies, options.seed))
    return int(any(t.problems or t.memory > CAP for t in tallies.values()))


def _write(options: argparse.Namespace, tallies: dict[str, Tally]) -> None:
    machine = {"python": platform.python_version(), "excite-trajectories": version("excite-trajectories")}
    content = {"seed": options.seed, **machine, "commands": {name: asdict(t) for name, t in tallies.items()}}
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "fuzz.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    (options.out / "fuzz.md").write_text(text_of(tallies, options.seed), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
