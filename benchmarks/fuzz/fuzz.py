"""Command lines with any values, by the thousand: how each command ends, how long it takes, how memory grows.

    .venv/bin/python benchmarks/fuzz/fuzz.py --cases 100000 --seed 0

Commands run in this process on a robot of two joints, with the judge of `tests/builders/value_fuzzer.py`: exit status
0, 1 or 2, an error of one line, no warning, no number in a file that is not finite, memory within the cap, and an end
soon after Ctrl-C where a command is still at work after some seconds. Problems are collected, not raised, so that one
does not hide the next. ``results/fuzz.json`` and ``results/fuzz.md`` are written after every round of cases, at the
end, and on Ctrl-C and SIGTERM; the same command goes on from them, unless ``--fresh`` is given. Two processes share the
work by ``--commands`` and ``--out``; ``--join`` puts their results together.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import sys
import time
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "tests" / "builders"))

from value_fuzzer import BASE, CAP, Ended, command_lines, file_cases, prepared, run  # noqa: E402

FILES = "files"  # numbers of files, rather than options
ROUND = 50  # cases of a command before the next one has its turn
SHOWN = 5  # command lines of those that took long
SIGNALLED = {128 + number for number in (signal.SIGINT, signal.SIGTERM)}


@dataclass
class Tally:
    """What the cases of one command came to.

    Parameters
    ----------
    rounds, begun : int
        How many are complete, and how many cases of the next one were run.
    statuses : dict
        Number of cases by exit status.
    problems : dict
        Problem to its first command line.
    stopped : list of str
        Some of the command lines that were at work until Ctrl-C.
    cpu, slowest : float
        Of all cases, and of the slowest [s of processor time].
    growth : float
        Largest of the memory during a case [MB].
    largest : str
        Its command line.
    resident : float
        Memory of the process after the last case [MB].
    """

    rounds: int = 0
    begun: int = 0
    statuses: dict[str, int] = field(default_factory=lambda: {"0": 0, "1": 0, "2": 0, "130": 0})
    problems: dict[str, str] = field(default_factory=dict)
    stopped: list[str] = field(default_factory=list)
    cpu: float = 0.0
    slowest: float = 0.0
    growth: float = 0.0
    largest: str = ""
    resident: float = 0.0

    @property
    def cases(self) -> int:
        return sum(self.statuses.values())

    def add(self, arguments: list[str], ended: Ended, cpu: float) -> None:
        self.begun += 1
        line = " ".join(" ".join(word[:400].split()) for word in arguments)
        status = str(ended.status)
        self.statuses[status] = self.statuses.get(status, 0) + 1
        for problem in ended.problems:
            self.problems.setdefault(problem, line)
        if ended.pressed and len(self.stopped) < SHOWN:
            self.stopped.append(line)
        if ended.growth > self.growth:
            self.growth, self.largest = ended.growth, line
        self.cpu, self.slowest, self.resident = self.cpu + cpu, max(self.slowest, cpu), _resident()


def _resident() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def fuzz(name: str, folder: Path, cases: int, number: int, tally: Tally, until: float) -> None:
    """Run what is left of one round of cases of a command; a seed gives the same cases in the same order.

    Raises
    ------
    KeyboardInterrupt
        A signal from outside has ended a case.
    """

    done_before, drawn = tally.begun, 0

    @seed(number)
    @settings(
        max_examples=cases,
        phases=[Phase.generate],
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(file_cases() if name == FILES else command_lines(name).map(lambda arguments: (arguments, {})))
    def one(case: tuple[list[str], dict[str, str]]) -> None:
        nonlocal drawn
        drawn += 1
        if drawn > done_before and time.monotonic() < until:
            began, (arguments, files) = time.process_time(), case
            ended = run(arguments, folder, files=files)
            if ended.status in SIGNALLED and not ended.pressed:
                raise KeyboardInterrupt
            tally.add([*arguments, *files.values()], ended, time.process_time() - began)

    one()
    if time.monotonic() < until:
        tally.rounds, tally.begun = tally.rounds + 1, 0


def text_of(tallies: dict[str, Tally], seed_of_all: int) -> str:
    rows = [
        "| command | cases | done (0) | not held (1) | refused (2) | stopped (130) | problems | slowest [s] "
        "| largest growth [MB] | memory at the end [MB] |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, t in tallies.items():
        ends = " | ".join(str(t.statuses[status]) for status in ("0", "1", "2", "130"))
        numbers = f"{len(t.problems)} | {t.slowest:.1f} | {t.growth:.0f} | {t.resident:.0f}"
        rows.append(f"| {name} | {t.cases} | {ends} | {numbers} |")
    count, spent = sum(t.cases for t in tallies.values()), sum(t.cpu for t in tallies.values())
    worst = max(tallies.values(), key=lambda t: t.growth)
    rows += [
        "",
        f"{count} cases, seed {seed_of_all}, {spent:.0f} s of processor time; cap of the memory {1e3 * CAP:.0f} MB.",
        f"Most memory: {worst.growth:.0f} MB by `{worst.largest}`.",
    ]
    rows += [f"- {name}: {what}: `{line}`" for name, t in tallies.items() for what, line in t.problems.items()]
    return "\n".join(rows) + "\n"


def options_given() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100_000, help="of all commands together")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="time after which it stops")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", nargs="*", default=[*BASE, FILES])
    parser.add_argument("--out", type=Path, default=HERE / "results")
    parser.add_argument("--fresh", action="store_true", help="do not go on from earlier results of the same seed")
    parser.add_argument(
        "--join", type=Path, nargs="+", help="run nothing: put together what runs in these folders found"
    )
    return parser.parse_args()


def main() -> int:
    options = options_given()
    if options.join:
        joined = {
            name: tally for folder in options.join for name, tally in _found(options, folder).items() if tally.cases
        }
        _write(options, joined)
        return int(any(t.problems for t in joined.values()))
    until = time.monotonic() + 60 * options.minutes
    tallies = _found(options, options.out)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    ended_early = False
    try:
        with prepared() as folder:
            _all_rounds(options, tallies, folder, until)
    except KeyboardInterrupt:
        ended_early = True
    _write(options, tallies)
    sys.stdout.write(text_of(tallies, options.seed))
    return 130 if ended_early else int(any(t.problems for t in tallies.values()))


def _all_rounds(options: argparse.Namespace, tallies: dict[str, Tally], folder: Path, until: float) -> None:
    each = -(-options.cases // len(tallies))
    rounds = -(-each // ROUND)
    for turn in range(min(t.rounds for t in tallies.values()), rounds):
        for name, tally in tallies.items():
            if tally.rounds == turn and time.monotonic() < until:
                left = min(ROUND, each - turn * ROUND)
                fuzz(name, folder, left, options.seed * 10**6 + turn, tally, until)
                _write(options, tallies)
        problems, count = (sum(len(t.problems) for t in tallies.values()), sum(t.cases for t in tallies.values()))
        sys.stderr.write(f"round {turn + 1} of {rounds}: {count} cases, {problems} problems\n")
        if time.monotonic() >= until:
            return


def _found(options: argparse.Namespace, folder: Path) -> dict[str, Tally]:
    """What earlier runs of the same seed came to; nothing at first."""
    path = folder / "fuzz.json"
    earlier: dict[str, Any] = {}
    if path.is_file() and not options.fresh:
        content = json.loads(path.read_text(encoding="utf-8"))
        earlier = content["commands"] if content["seed"] == options.seed else {}
    return {name: Tally(**earlier.get(name, {})) for name in options.commands}


def _write(options: argparse.Namespace, tallies: dict[str, Tally]) -> None:
    machine = {"python": platform.python_version(), "excite-trajectories": version("excite-trajectories")}
    content = {"seed": options.seed, **machine, "commands": {name: asdict(t) for name, t in tallies.items()}}
    options.out.mkdir(parents=True, exist_ok=True)
    _replace(options.out / "fuzz.json", json.dumps(content, indent=1) + "\n")
    _replace(options.out / "fuzz.md", text_of(tallies, options.seed))


def _replace(path: Path, text: str) -> None:
    new = path.with_name(f".{path.name}.new")
    new.write_text(text, encoding="utf-8")
    new.replace(path)


if __name__ == "__main__":
    sys.exit(main())
