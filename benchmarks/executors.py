"""What executors cost and gain: 200 starts on one worker and on two, and the overhead of a cell of a sweep."""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import record

import excite
from excite.design.executors.dask_cluster import DaskStarts, unit_executor
from excite.design.executors.unit_executor import UnitExecutor, Work
from excite.design.formulation import formulate
from excite.design.multistart import run_in_pool
from excite.design.start_results import StartResult, read_starts

ROBOT, HARMONICS = "irp6", 5
FEW, MANY = 10, 40  # cells; the difference is free of what a sweep costs once
_REST = 5.0  # seconds for which processes without work are watched
_TICKS = os.sysconf("SC_CLK_TCK")
LIMITATIONS = (
    "wanted: from 1 to 2 workers at least 1.6 in wall time, at most 50 ms of overhead for a cell",
    "wall times depend on what else the machine does, see the load; runs with one worker and with two alternate, and "
    "the middle one of the ratios counts",
    "Dask: scheduler, workers and client on this one machine; no network, and no SLURM",
    "beside it: processor time of all processes less that of the threads in which cells are designed and saved, with "
    "all that Dask's scheduler and workers do meanwhile; with nothing to do: what these use of it in any case, as in "
    f"the {_REST:g} s before the sweep",
    f"cells: sweeps of {FEW} and of {MANY}, so that processes have started already; as small as designs get",
)


@dataclass(frozen=True)
class Times:
    """Of a sweep [s]: ``cpu`` of all processes, ``work`` of the threads in which cells run, and ``wall``.

    ``idle`` is what other processes use in that time with nothing to do.
    """

    cpu: float
    work: float
    wall: float
    idle: float


@contextmanager
def dask(workers: int) -> Iterator[tuple[str, list[int]]]:
    """Address of a scheduler, and the processes of it and its workers."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scheduler.json"
        base = [sys.executable, "-m"]
        commands = [[*base, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]]
        commands += workers * [[*base, "distributed.cli.dask_worker", "--nthreads", "1", "--no-nanny"]]
        with (Path(folder) / "log").open("wb") as log:
            processes = [
                subprocess.Popen([*each, "--scheduler-file", str(file), "--no-dashboard"], stdout=log, stderr=log)
                for each in commands
            ]
        try:
            while not (file.exists() and file.read_text()):
                time.sleep(0.05)
            _wait_for_workers(str(file), workers)
            yield f"dask-file:{file}", [process.pid for process in processes]
        finally:
            for process in processes:
                process.kill()
                process.wait()


def _wait_for_workers(file: str, count: int) -> None:
    from distributed import Client

    with Client(scheduler_file=file, set_as_default=False) as client:
        client.wait_for_workers(count)


def cpu(others: list[int]) -> float:
    """Processor time of this process, its children that have ended, and others that run [s]."""
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime
    for process in others:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        spent += (int(fields[11]) + int(fields[12])) / _TICKS
    return spent


def starts(executor: str, workers: int, count: int) -> dict[str, float]:
    """Wall and processor time of a search, and the hash of its results."""
    task = excite.Task(ROBOT, harmonics=HARMONICS, starts=count, workers=workers)
    formulation = formulate(excite.load_robot(ROBOT), task)

    def run(execute: Callable[..., None], others: list[int]) -> dict[str, float]:
        with tempfile.TemporaryDirectory() as folder:
            began, spent = time.monotonic(), cpu(others)
            execute(formulation, [range(count)], Path(folder), _nothing)
            measured = {"wall": time.monotonic() - began, "cpu": cpu(others) - spent}
            results = read_starts(Path(folder))
            return measured | {
                "starts": sum(start.cpu for start in results),
                "sum": sum(start.value for start in results),
            }

    if executor == "process":
        return run(run_in_pool, [])
    with dask(workers) as (address, processes):
        return run(DaskStarts(address), processes)


def _nothing(_: StartResult) -> None:
    pass


def _timed(common: tuple[Work, Any], unit: Any) -> tuple[float, Any]:
    began = time.thread_time()
    result = common[0](common[1], unit)
    return time.thread_time() - began, result


class _Timed:
    """Another executor, which adds up the processor time of the threads in which its units run."""

    def __init__(self, executor: UnitExecutor) -> None:
        self._executor, self.shares_disk, self.cpu = executor, executor.shares_disk, 0.0

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        for index, (spent, result) in self._executor.run(_timed, (work, common), units):
            self.cpu += spent
            yield index, result


def sweep(executor: str, count: int) -> Times:
    """A sweep with two workers."""

    def run(address: str, others: list[int]) -> Times:
        idle = _idle(others)
        with tempfile.TemporaryDirectory() as folder:
            began, spent, timed = time.monotonic(), cpu(others), _Timed(unit_executor(address, 2))
            excite.run_sweep(_tasks(count), folder, executor=timed)
            wall = time.monotonic() - began
            return Times(cpu(others) - spent, timed.cpu, wall, idle * wall)

    if executor != "dask":
        return run(executor, [])
    with dask(2) as (address, processes):
        return run(address, processes)


def _idle(processes: list[int]) -> float:
    """Share of a core that processes use with nothing to do."""
    if not processes:
        return 0.0
    before = cpu(processes)
    time.sleep(_REST)
    return (cpu(processes) - before) / _REST


def _tasks(count: int) -> dict[str, excite.Task]:
    return {f"seed={k}": excite.Task(ROBOT, harmonics=3, starts=1, seed=k, executor="serial") for k in range(count)}


def main() -> None:
    """Starts on the pool and on Dask, then cells."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    before = record.load()
    runs: dict[str, list[dict[str, dict[str, float]]]] = {"process": [], "dask": []}
    for _ in range(given.rounds):
        for executor, measured in runs.items():
            measured.append({str(workers): starts(executor, workers, given.starts) for workers in (1, 2)})
            print(executor, json.dumps(measured[-1]), file=sys.stderr)
    sums = {each["sum"] for measured in runs.values() for pair in measured for each in pair.values()}
    cells: dict[str, list[dict[str, float]]] = {"serial": [], "process": [], "dask": []}
    for name in cells:
        sweep(name, 1)  # imports
    for _ in range(given.rounds):
        for name, slopes in cells.items():
            few, many = asdict(sweep(name, FEW)), asdict(sweep(name, MANY))
            slopes.append({part: (many[part] - few[part]) / (MANY - FEW) for part in few})
            print(name, slopes[-1], file=sys.stderr)
    content = {"starts": given.starts, "runs": runs, "equal": len(sums) == 1, "cells": cells}
    record.save("executors", before, content, _text(content), LIMITATIONS)


def _text(content: dict[str, object]) -> str:
    runs, cells = content["runs"], content["cells"]
    assert isinstance(runs, dict)
    assert isinstance(cells, dict)
    rows = []
    for executor, pairs in runs.items():
        ratios = sorted(pair["1"]["wall"] / pair["2"]["wall"] for pair in pairs)
        middle = {k: statistics.median(pair[k]["wall"] for pair in pairs) for k in "12"}
        busy = statistics.median(pair["2"]["cpu"] / pair["1"]["cpu"] for pair in pairs)
        span = f"**{statistics.median(ratios):.2f}** ({ratios[0]:.2f}-{ratios[-1]:.2f})"
        rows.append([executor, f"{middle['1']:.0f}", f"{middle['2']:.0f}", span, f"{busy:.2f}"])
    head = ["executor", "wall s, 1 worker", "wall s, 2 workers", "ratio", "CPU, 2 over 1"]
    lines = [record.table(head, rows), ""]
    head = [
        "sweep",
        "wall ms for each further cell",
        "CPU ms of its design",
        "CPU ms beside it",
        "with nothing to do",
    ]
    lines.append(record.table(head, [_cell_row(name, slopes) for name, slopes in cells.items()]))
    same = "the same to the last digit" if content["equal"] else "NOT the same"
    return "\n".join(
        [f"{content['starts']} starts on {ROBOT}; the sum of their values is {same} in all runs.", "", *lines]
    )


def _cell_row(name: str, slopes: list[dict[str, float]]) -> list[str]:
    beside = sorted(1e3 * (each["cpu"] - each["work"]) for each in slopes)
    parts = ("wall", "work", "idle")
    wall, work, idle = (f"{1e3 * statistics.median(each[part] for each in slopes):.0f}" for part in parts)
    return [name, wall, work, f"**{statistics.median(beside):.0f}** ({beside[0]:.0f}-{beside[-1]:.0f})", idle]


if __name__ == "__main__":
    main()
