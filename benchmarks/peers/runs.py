"""Which runs are left, made one after the other and handed over as soon as each has ended."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parent))
from measure import measured  # noqa: E402

Run = dict[str, Any]
SYSTEMS = ("excite", "slsqp", "figaroh", "random")
#: What tells one run from another.
KEY = ("case", "system", "seed", "budget")
_FIGAROH = """
import cyipopt, figaroh.optimal.base_optimal_trajectory, json, pinocchio, ruamel.yaml
from importlib.metadata import version
versions = {name: version(name) for name in ("figaroh", "pin", "example-robot-data")}
print(json.dumps({**versions, "cyipopt": cyipopt.__version__}))
"""


def key(run: Mapping[str, Any]) -> tuple[Any, ...]:
    """What tells a run from others."""
    return tuple(run[name] for name in KEY)


def complete(
    wanted: Iterable[Run], earlier: Iterable[Run], make: Callable[[Run], Run], save: Callable[[list[Run]], None]
) -> list[Run]:
    """Make the runs that are left, and save all after each.

    Parameters
    ----------
    wanted : iterable of dict
        With the entries `KEY`.
    earlier : iterable of dict
        Finished runs; those that are wanted are not made again unless they failed, the others are kept.
    make : callable
        The result of a run, added to what was wanted.
    save : callable
        Gets all finished runs.
    """
    done = {key(run): run for run in earlier}
    left = [run for run in wanted if "failure" in done.get(key(run), {"failure": "not made yet"})]
    for number, run in enumerate(left, start=1):
        print(f"{number} of {len(left)}: {run['system']} on {run['case']}, seed {run['seed']}", file=sys.stderr)
        done[key(run)] = {**run, **make(run)}
        save(list(done.values()))
    return list(done.values())


def figaroh_versions(python: str) -> dict[str, str] | str:
    """Versions in the environment of that interpreter, or why figaroh cannot run there."""
    try:
        found = subprocess.run([python, "-c", _FIGAROH], capture_output=True, text=True)
    except OSError as error:
        return str(error)
    if found.returncode:
        return found.stderr.strip().splitlines()[-1]
    versions: dict[str, str] = json.loads(found.stdout.splitlines()[-1])
    return versions


def motion(run: Run, python: str) -> dict[str, Any]:
    """What a system prints, and its processor time, in a fresh, single-threaded process; or how it failed."""
    wanted = {"system": run["system"], "case": run["case"], "seed": run["seed"], "cpu": run["budget"]}
    try:
        took = measured([python, os.fspath(HERE / "worker.py"), json.dumps(wanted)], threads=1)
    except subprocess.CalledProcessError as error:
        return {"failure": f"exit status {error.returncode}"}
    return {"cpu": took.cpu, "wall": took.wall, **took.result}
