"""The do-it-yourself baseline: SciPy's SLSQP with finite differences over Pinocchio's regressors.

A Fourier series at rest at both ends (the two conditions are eliminated), ``log cond(W[:, columns])`` at some instants
as objective, all limits at 100 instants as linear constraints with their exact Jacobian, random feasible starts one
after the other until the processor time is spent. Every iterate is judged at 1001 instants, outside the measured time;
one that exceeds a limit between the 100 instants is shrunk into the limits first.

Run alone it shows the course of one run on P1 beside that of a comparable baseline measured with the other systems.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import record
import scipy.linalg
from judge import Array, Motion, base_columns, column_names, condition_numbers, limit_use, regressor
from measure import script
from problems import HARMONICS, PERIOD, PROBLEMS, Problem
from scipy.optimize import minimize

LIMIT_INSTANTS = 100
SPACING = 0.05  # [s] of processor time between two iterates that are kept
_PEERS = {30: 14.5, 50: 13.1, 100: 12.6, 200: 12.2}
#: Per derivative L, lower, upper of ``lower <= L q^(d) <= upper``.
Limits = tuple[tuple[Array, Array, Array], ...]
_OMEGA = 2 * np.pi / PERIOD * np.arange(1, HARMONICS + 1)


def spent() -> float:
    """Processor time of this process since it began, with that of its children (a compiler, say) [s]."""
    return sum(os.times()[:4])


class SpentError(Exception):
    """The processor time is used up."""


def _series(time: Array, derivative: int) -> Array:
    """Offset, cosines and sines with amplitudes of equal velocity, shape (N, 2K+1)."""
    phase = np.outer(time, _OMEGA) + derivative * np.pi / 2
    size = _OMEGA ** (derivative - 1)
    return np.hstack([np.full((time.size, 1), float(derivative == 0)), size * np.cos(phase), size * np.sin(phase)])


_ENDS = np.vstack([_series(np.zeros(1), derivative) for derivative in (1, 2)])
_FREE = scipy.linalg.null_space(_ENDS)  # coefficients of motions at rest at t = 0, shape (2K+1, 2K-1)


def bases(count: int) -> list[Array]:
    time = np.linspace(0.0, PERIOD, count, endpoint=False)
    return [_series(time, derivative) @ _FREE for derivative in range(3)]


def limits_of(problem: Problem) -> Limits:
    """Limits of an arm whose joints are not coupled."""
    return tuple((np.eye(len(problem.lower)), *problem.bounds(derivative)) for derivative in range(3))


def two_sided(limits: Limits) -> tuple[Array, Array, Array]:
    """``lower <= A x <= upper`` for all limits at the instants of the grid."""
    A = [np.kron(L, basis) for (L, _, _), basis in zip(limits, bases(LIMIT_INSTANTS), strict=True)]
    lower, upper = (np.concatenate([np.repeat(limit[side], LIMIT_INSTANTS) for limit in limits]) for side in (1, 2))
    return np.vstack(A), lower, upper


def limit_rows(limits: Limits) -> tuple[Array, Array]:
    """The same as ``A x <= b``."""
    A, lower, upper = two_sided(limits)
    return np.vstack([A, -A]), np.concatenate([upper, -lower])


def random_start(middle: Array, A: Array, b: Array, rng: np.random.Generator) -> Array:
    """A random motion inside the limits: every joint in turn goes from the middle most of the way to a limit."""
    n, size = len(middle), _FREE.shape[1]
    x = np.outer(middle, np.linalg.pinv(_FREE)[:, 0])
    for joint in range(n):
        direction = np.zeros((n, size))
        direction[joint] = rng.normal(size=size)
        slope = A @ direction.ravel()
        room = b - A @ x.ravel()
        x = x + rng.uniform(0.6, 0.95) * np.min(room[slope > 0] / slope[slope > 0]) * direction
    return x.ravel()


def motion_of(x: Array) -> dict[str, Any]:
    """Trajectory in the form of `judge.Motion`."""
    series = x.reshape(-1, _FREE.shape[1]) @ _FREE.T
    cosine, sine = np.split(series[:, 1:] / np.tile(_OMEGA, 2), 2, axis=1)
    return {"period": PERIOD, "offset": series[:, 0].tolist(), "cosine": cosine.tolist(), "sine": sine.tolist()}


def iterates(problem: Problem, wanted: Mapping[str, Any]) -> list[tuple[float, Array]]:
    """Processor time since the process began, and the iterate, of starts one after the other."""
    names = column_names(problem)
    columns = [names.index(name) for name in wanted["columns"]]
    A, b = limit_rows(limits_of(problem))
    objective = log_condition(lambda *state: regressor(problem, *state)[:, columns], wanted["instants"])
    rng = np.random.default_rng(wanted["seed"])
    middle = sum(problem.bounds(0)) / 2
    return descents([objective], A, b, lambda: random_start(middle, A, b, rng), wanted["cpu"])


def log_condition(columns: Callable[..., Array], instants: int) -> Callable[[Array], float]:
    """``log cond(W)`` of a motion, W at so many instants; ``columns(q, dq, ddq)`` is W."""
    steps = bases(instants)

    def objective(x: Array) -> float:
        X = x.reshape(-1, _FREE.shape[1])
        sigma = np.linalg.svd(columns(*(step @ X.T for step in steps)), compute_uv=False)
        return float(np.log(sigma[0] / sigma[-1]))

    return objective


def descents(
    objectives: Sequence[Callable[[Array], Any]],
    A: Array,
    b: Array,
    begin: Callable[[], Array],
    cpu: float,
    *,
    gradients: bool = False,
) -> list[tuple[float, Array]]:
    """Processor time since the process began, and the iterate, of descents from one start after the other.

    Every descent minimises the objectives in turn, each from the end of that before; with ``gradients`` they give value
    and gradient.
    """
    kept: list[tuple[float, Array]] = []

    def callback(x: Array) -> None:
        now = spent()
        if now > cpu:
            raise SpentError
        if now - kept[-1][0] > SPACING:
            kept.append((now, x.copy()))

    limits = {"type": "ineq", "fun": lambda x: b - A @ x, "jac": lambda x: -A}
    options = {"maxiter": 100_000, "ftol": 1e-7}
    common = {"method": "SLSQP", "constraints": [limits], "options": options, "callback": callback}
    with suppress(SpentError):
        while spent() < cpu:
            x = begin()
            kept.append((spent(), x))
            for objective in objectives:
                x = minimize(objective, x, jac=gradients or None, **common).x
                kept.append((spent(), x))
    return kept


def shrunk(problem: Problem, plain: dict[str, Any]) -> tuple[dict[str, Any], float]:
    """The motion, and its largest use of a limit; where that is above 1, drawn together until no limit is broken.

    Every position, velocity and acceleration about the middle of its range shrinks by the same factor.
    """
    use = limit_use(problem, Motion.of(plain), dense=False)["exact"]
    scale = max(1.0, use)
    middle = sum(problem.bounds(0)) / 2
    offset = middle + (np.array(plain["offset"]) - middle) / scale
    smaller = {part: (np.array(plain[part]) / scale).tolist() for part in ("cosine", "sine")}
    return {**plain, **smaller, "offset": offset.tolist()}, use


def course(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Every improvement of the best value, with when it came.

    Parameters
    ----------
    wanted : mapping
        ``problem``, ``convention``, ``columns`` (names), ``instants`` of the objective, ``cpu`` [s], ``seed``.
    """
    problem = PROBLEMS[wanted["problem"]]
    improvements: list[tuple[float, float]] = []
    best: dict[str, Any] = {}
    best_use = 0.0
    for cpu, x in iterates(problem, wanted):
        plain, use = shrunk(problem, motion_of(x))
        value = condition_numbers(problem, Motion.of(plain))[wanted["convention"]]
        if not improvements or value < improvements[-1][1]:
            improvements.append((cpu, value))
            best, best_use = plain, use
    return {"improvements": improvements, "trajectory": best, "limit_use_before_shrinking": best_use}


def value_at(improvements: list[tuple[float, float]], cpu: float) -> float:
    """Best value after so much processor time."""
    return min((value for at, value in improvements if at <= cpu), default=np.inf)


def baseline(problem: str, convention: str, seed: int, cpu: float, instants: int) -> dict[str, Any]:
    """The course of a baseline in a fresh, single-threaded process."""
    columns = base_columns(problem)[convention]
    wanted = {"problem": problem, "convention": convention, "columns": columns, "seed": seed}
    found: dict[str, Any] = script("baseline_slsqp.py", wanted | {"cpu": cpu, "instants": instants}, threads=1).result
    return {"problem": problem, "seed": seed, "instants": instants, **found}


LIMITATIONS = (
    "one seed; seeds differ by several per cent",
    "the comparable baseline (SLSQP, finite differences, pivoted columns) was measured on another day; its samples "
    "and its code differ in detail",
    f"its limits hold at {LIMIT_INSTANTS} instants; a motion that exceeds one between them is shrunk until it does not "
    "before it is judged, which the comparable baseline was spared",
)


def main() -> None:
    """Course on P1 for objectives at 100, 200 and 1001 instants."""
    before = record.load()
    with ThreadPoolExecutor(2) as pool:
        runs = list(pool.map(partial(baseline, "P1", "pivoted-lapack", 0, 100.0), (100, 200, 1001)))
    head = ["objective at", *(f"{cpu} s" for cpu in _PEERS if cpu <= 100), "exceeded a limit by"]
    rows: list[list[object]] = [
        [
            f"{run['instants']} instants",
            *(f"{value_at(run['improvements'], cpu):.2f}" for cpu in _PEERS if cpu <= 100),
            f"{100 * (run['limit_use_before_shrinking'] - 1):.1f} %",
        ]
        for run in runs
    ]
    rows.append(["measured with the other systems", *(str(v) for cpu, v in _PEERS.items() if cpu <= 100), "1 %"])
    text = "P1, pivoted-lapack: best condition number after so much processor time.\n\n" + record.table(head, rows)
    record.save("baseline_slsqp", before, {"runs": runs}, text, LIMITATIONS)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(course(json.loads(sys.argv[1]))))
    else:
        main()
