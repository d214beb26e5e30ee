"""Record what design problems are at points: objective, gradient, limits and their Jacobians; and check them.

``--out FILE`` draws the points, evaluates them, and writes both; ``--check FILE`` evaluates the points of the file with
the package of the running interpreter, and compares to 1e-12 of the size of each quantity. What is inside the package
is reached through `problem_access.py` only. As with `record.py`, compare within one kind of machine.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from instructions import KERNEL, environment
from point_cases import PROBLEMS
from problem_access import Array, Imposed, drawn, imposed, objective, problem_of, reported, sharpnesses

POINTS = 72  # of each problem
TOLERANCE = 1e-12
_SHOWN = 3  # of what differs in a problem
_SMALL = 0.02  # of the size of x, that every other point is moved by
_DIRECTIONS, _ROWS, _INSTANTS, _PROJECTIONS = 2, 4, 40, 3


def points_of(problem: Any) -> Array:
    """Random motions within the limits, and the same a little beside, shape (points, x's shape)."""
    rng = np.random.default_rng(11)
    motions = [drawn(problem, rng) for _ in range(POINTS // 2)]
    beside = [x + _SMALL * np.sqrt(np.mean(x**2)) * rng.standard_normal(x.shape) for x in motions]
    return np.array([*motions, *beside])


def projected(a: Array) -> Array:
    """Norm of an array, and its products with seeded random vectors."""
    directions = np.random.default_rng(a.size).standard_normal((_PROJECTIONS, a.size))
    return np.array([np.linalg.norm(a), *(directions @ a.ravel())])


def _of_limit(limit: Imposed, x: Array) -> dict[str, Array]:
    """Values at all instants; the Jacobian times directions, and some of its rows."""
    values = limit.values(x)
    functions, instants = values.shape
    rng = np.random.default_rng(values.size + x.size)
    some = np.sort(rng.choice(instants, size=min(_INSTANTS, instants), replace=False))
    directions = rng.standard_normal((_DIRECTIONS, *x.shape))
    pairs = rng.integers(functions, size=_ROWS), np.sort(rng.choice(instants, size=_ROWS, replace=False))
    return {
        "values": projected(values),
        "changes": np.array([projected(limit.changes(x, d, some)) for d in directions]),
        "rows": np.array([projected(row) for row in limit.rows(x, *pairs)]),
    }


def evaluated(problem: Any, x: Array) -> dict[str, Array]:
    """All quantities of a problem at one point, by name."""
    first, last = (objective(problem, x, sharpness) for sharpness in sharpnesses(problem))
    found = {
        "objective, first stage": np.array(first.value),
        "objective, last stage": np.array(last.value),
        "gradient, first stage": first.gradient,
        "gradient, last stage": last.gradient,
        "criterion": np.array(first.criterion),
        "criterion as reported": np.array(reported(problem, x)),
    }
    for label, limit in imposed(problem).items():
        found |= {f"{label}: {what}": value for what, value in _of_limit(limit, x).items()}
    return found


def quantities(problem: Any, points: Array) -> dict[str, Array]:
    """All quantities at all points, each of shape (points, ...), and the bounds of the limits."""
    found = [evaluated(problem, x) for x in points]
    bounds = {f"{label}: bounds": limit.bounds for label, limit in imposed(problem).items()}
    return {name: np.array([values[name] for values in found]) for name in found[0]} | bounds


def _difference(was: Array, found: Array) -> float:
    """Largest difference, each point's as a part of the size of the quantity there."""
    if was.shape != found.shape:
        return np.inf
    equal = (was == found) | (np.isnan(was) & np.isnan(found))
    with np.errstate(invalid="ignore"):  # bounds that are infinite
        apart = np.where(equal, 0.0, np.abs(found - was)).reshape(len(was), -1).max(axis=1)
    size = np.abs(np.where(np.isfinite(was), was, 0.0)).reshape(len(was), -1).max(axis=1)
    return float(np.max(apart / np.where(size > 0.0, size, 1.0)))


def recorded() -> dict[str, Array]:
    """Points and quantities of all problems, by problem and name."""
    found = {}
    for name, (robot, options) in PROBLEMS.items():
        problem = problem_of(robot, options)
        points = points_of(problem)
        values = quantities(problem, points)
        found |= {f"{name}|{what}": value for what, value in {"x": points, **values}.items()}
        print(f"{name}: {len(points)} points, {len(values)} quantities", flush=True)
    return found


def check(known: dict[str, Array]) -> list[str]:
    """Names of the problems that differ; prints how each compares.

    Parameters
    ----------
    known : dict
        As `recorded` made it.
    """
    failed = []
    for name, (robot, options) in PROBLEMS.items():
        was = {key.split("|")[1]: value for key, value in known.items() if key.split("|")[0] == name}
        found = quantities(problem_of(robot, options), was.pop("x"))
        apart = {what: _difference(value, found[what]) if what in found else np.inf for what, value in was.items()}
        worst = sorted(apart, key=lambda what: -apart[what])
        good = apart[worst[0]] <= TOLERANCE
        told = ", ".join(f"{apart[what]:.2g} ({what})" for what in worst[: 1 if good else _SHOWN])
        more = f", {len(found.keys() - was)} quantities more" if found.keys() - was else ""
        print(f"{name}: {'ok' if good else 'DIFFERS'}, at most {told}{more}", flush=True)
        failed += [] if good else [name]
    return failed


def main() -> int:
    """Record or check; 1 if anything differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--out", type=Path, metavar="FILE", help="record to this file (.npz)")
    what.add_argument("--check", type=Path, metavar="FILE", help="compare with this recording")
    parser.add_argument("--kernel", default=KERNEL, help="of OpenBLAS; another one shows what rounding alone does")
    given = parser.parse_args()
    _with_instructions(given.kernel)
    if given.out:
        np.savez_compressed(given.out, **recorded())
        return 0
    with np.load(given.check) as known:
        return 1 if check(dict(known)) else 0


def _with_instructions(kernel: str) -> None:
    """Begin anew with the instructions that round as recorded; they are chosen when NumPy is imported."""
    wanted = environment(kernel)
    if wanted != dict(os.environ):
        os.execve(sys.executable, [sys.executable, *sys.argv], wanted)


if __name__ == "__main__":
    sys.exit(main())
