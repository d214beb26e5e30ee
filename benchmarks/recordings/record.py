"""Record what the command line does, as numbers, and check that another checkout does the same.

``--out FILE`` runs every case of `cases.py` in a folder of its own and writes what came out; ``--check FILE`` runs them
again and says what differs. Numbers are compared within one kind of machine: another build of NumPy rounds differently,
and an optimisation makes more of it. There, record first at the older revision, in a worktree of it (``git worktree
add``) whose interpreter ``--python`` names.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cases import Case, chosen
from compared import differences
from instructions import KERNEL, environment
from outcome import printed, written

HERE = Path(__file__).resolve().parent
_SHOWN = 3  # differences of a case


@dataclass(frozen=True)
class Ran:
    """One case that has been run.

    Parameters
    ----------
    outcome : dict
        Exit status, what was printed, what was written.
    seconds : float
        Wall time.
    message : str
        End of the standard error.
    """

    outcome: dict[str, Any]
    seconds: float
    message: str


@dataclass(frozen=True)
class Place:
    """Where and with what cases are run.

    Parameters
    ----------
    python : str
        Interpreter that has excite.
    folder : Path
        Each case runs in a folder of its name here, and writes to one of its name in that.
    given : Path, optional
        Folder of another run, from which cases take what they need; this one if not given.
    kernel : str
        Of OpenBLAS.
    """

    python: str
    folder: Path
    given: Path | None = None
    kernel: str = KERNEL

    def prepared(self, case: Case) -> Path:
        """Folder for a case, with the inputs and what it needs."""
        folder = self.folder / case.name
        folder.mkdir(parents=True)
        (folder / "inputs").symlink_to(HERE / "inputs")
        for name in case.needs:
            (folder / name).symlink_to((self.given or self.folder) / name / name)
        return folder


def run(case: Case, place: Place) -> Ran:
    """Run one case to its end."""
    began, folder = time.monotonic(), place.prepared(case)
    done = subprocess.run(
        [place.python, "-P", "-m", "excite", *case.arguments],
        cwd=folder,
        env={**environment(place.kernel), "MPLBACKEND": "Agg", "COLUMNS": "160"},
        capture_output=True,
        text=True,
        check=False,
    )
    out = done.stdout if done.returncode == 0 else ""
    outcome = {
        "status": done.returncode,
        "printed": printed(out, case.prints) if out else None,
        "files": written(folder / case.name),
    }
    return Ran(outcome, time.monotonic() - began, done.stderr[-500:])


def run_all(cases: Mapping[str, Case], place: Place, jobs: int, told: Callable[[Case, Ran], None]) -> dict[str, Ran]:
    """Run cases, each after those that it needs, several at a time.

    Parameters
    ----------
    cases : mapping of str to Case
        In an order in which needs come first.
    place : Place
    jobs : int
    told : callable
        Called with each case when it has ended, in their order.
    """
    futures: dict[str, Future[Ran]] = {}

    def after_needs(case: Case) -> Ran:
        for name in case.needs:
            futures[name].result()
        return run(case, place)

    ended: dict[str, Ran] = {}
    with ThreadPoolExecutor(jobs) as pool:  # takes cases in their order: none waits for one that has not begun
        for case in cases.values():
            futures[case.name] = pool.submit(after_needs, case)
        for case in cases.values():
            ended[case.name] = futures[case.name].result()
            told(case, ended[case.name])
    return ended


def _table(content: Mapping[str, Any]) -> str:
    """One case a line."""
    lines = [f" {json.dumps(name)}: {json.dumps(part, separators=(',', ':'))}" for name, part in content.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _tell_run(case: Case, ran: Ran) -> None:
    status = ran.outcome["status"]
    why = f" ({_last_line(ran.message)})" if status else ""
    print(f"{case.name}: status {status}{why}, {ran.seconds:.1f} s", flush=True)


def _last_line(text: str) -> str:
    return (text.strip().splitlines() or ["no message"])[-1]


class Checker:
    """Compares what cases do with what was recorded of them.

    Parameters
    ----------
    recorded : mapping of str to dict
        Outcomes by the names of cases.
    """

    def __init__(self, recorded: Mapping[str, Any]) -> None:
        self.recorded = recorded
        self.failed: list[str] = []

    def __call__(self, case: Case, ran: Ran) -> None:
        """Print how one case compares."""
        if case.name not in self.recorded:
            self.failed.append(case.name)
            print(f"{case.name}: not recorded", flush=True)
            return
        unlike, added = differences(self.recorded[case.name], json.loads(json.dumps(ran.outcome)))
        more = f", {len(added)} leaves more, such as {added[0]}" if added else ""
        print(f"{case.name}: {f'{len(unlike)} differ' if unlike else 'ok'}{more} ({ran.seconds:.1f} s)", flush=True)
        for difference in unlike[:_SHOWN]:
            print(f"    {difference} ({difference.excess:.3g} times what is allowed)")
        if unlike:
            self.failed.append(case.name)
            print(f"    {_last_line(ran.message)}")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--out", type=Path, metavar="FILE", help="record to this file")
    what.add_argument("--check", type=Path, metavar="FILE", help="compare with this recording")
    parser.add_argument("--only", default="*", metavar="GLOB", help="cases, and those that they need: 'identify-*'")
    parser.add_argument("--python", default=sys.executable, metavar="PATH", help="interpreter that has excite")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="commands at a time")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="new folder to run in, and to leave there")
    parser.add_argument("--given", type=Path, metavar="DIR", help="what cases need is taken from a run kept there")
    parser.add_argument("--kernel", default=KERNEL, help="of OpenBLAS; another one shows what rounding alone does")
    return parser.parse_args()


def main() -> int:
    """Record or check; 1 if anything differs."""
    given = _arguments()
    cases = chosen(given.only)
    if not cases:
        print(f"no case has a name like {given.only!r}", file=sys.stderr)
        return 2
    recorded = json.loads(given.check.read_text(encoding="utf-8")) if given.check else {}
    checker = Checker(recorded)
    with tempfile.TemporaryDirectory() as scratch:
        kept = given.given.absolute() if given.given else None
        place = Place(given.python, (given.keep or Path(scratch)).absolute(), kept, given.kernel)
        ended = run_all(cases, place, given.jobs, checker if given.check else _tell_run)
    print(f"{len(ended)} cases, {sum(ran.seconds for ran in ended.values()):.0f} s of commands")
    if given.out:
        given.out.write_text(_table({name: ran.outcome for name, ran in ended.items()}), encoding="utf-8")
    if checker.failed:
        print(f"{len(checker.failed)} differ: {', '.join(checker.failed)}")
    return 1 if checker.failed else 0


if __name__ == "__main__":
    sys.exit(main())
