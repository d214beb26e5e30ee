"""Does it pay to score tens of thousands of candidate motions at once, in JAX, before the solver begins?

Random motions within the limits are drawn and scored in batches; the best of them are handed to the solver one after
the other. Beside it, with the processor time of it all: random starts as the search makes them, and the search that is
the default, which combines motions. What a GPU would bring at best is the time without that of the batches.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import ours
import record

from excite.design.formulation import Formulation, formulate
from excite.design.problem import Problem
from excite.design.search_rounds import Rounds
from excite.design.solvers.limit_rows import LinearRows
from excite.design.solvers.sqp import SequentialQuadratic
from excite.design.starts import optimise_starts
from excite.tasks.search import Search
from excite.tasks.task import Task
from regressors.jax_models import JaxModel
from regressors.readers.library import load_robot
from regressors.samples import Array

CANDIDATES, BATCH, SEEDS = 20_000, 1000, range(3)
BUDGETS = {"IRp-6 differential": 6.0, "P1 gautier": 12.0}  # of processor time [s]
_INSTANTS, _OF_LIMITS = 60, 8  # instants of a score; the limits are looked at on every 8th instant of the grid


def formulation(case: str) -> Formulation:
    """Its information matrix is in the base columns of the model themselves."""
    if case.startswith("IRp-6"):
        return formulate(load_robot("irp6"), Task("irp6"))
    return ours.formulation({"problem": "P1", "convention": "gautier", "task": {"torque_margin": "none"}})


class Screen:
    """Motions drawn and scored in batches."""

    def __init__(self, made: Formulation) -> None:
        problem = made.problem
        self.n, self.size = problem.shape
        linear = LinearRows(problem.limits.linear_in_x, problem.shape)
        flat = np.arange(0, linear.count, _OF_LIMITS)
        self.rows = jnp.asarray(linear.rows(flat).reshape(flat.size, self.n, self.size))
        self.rest = jnp.asarray(problem.rest)
        self.at_rest = jnp.asarray(linear.values(problem.rest).ravel()[flat])
        time_of = problem.family.duration * np.arange(_INSTANTS) / _INSTANTS
        self.basis = [jnp.asarray(problem.family.basis(time_of, d)) for d in range(3)]
        motion = made.blueprint.motion
        self.N, self.held = jnp.asarray(motion.matrix), np.outer(motion.offset, problem.family.constant)
        self.model = JaxModel(made.target.model, made.target.base.index)
        self.draw_and_score = jax.jit(partial(self._draw_and_score, count=BATCH))

    def _part(self, change: Any) -> Any:
        """Largest part of a change from rest within the limits, shape (count,)."""
        room = jnp.where(change > 0, 1.0 - self.at_rest, -1.0 - self.at_rest)
        return jnp.min(jnp.where(change != 0, room / change, jnp.inf), axis=-1)

    def _draw_and_score(self, key: Any, count: int) -> tuple[Any, Any]:
        of_step, of_part = jax.random.split(key)
        step = jax.random.normal(of_step, (count, self.n, self.size))
        each = jnp.einsum("rns,cns->cnr", self.rows, step)
        parts = self._part(each) * jax.random.uniform(of_part, (count, self.n), minval=0.6, maxval=0.95)
        whole = self._part(jnp.einsum("cnr,cn->cr", each, parts))
        x = self.rest + (parts * jnp.minimum(1.0, 0.95 * whole)[:, None])[..., None] * step
        joints = jnp.einsum("jn,cns->cjs", self.N, x) + self.held
        W = self.model.rows(*(jnp.einsum("ts,cjs->ctj", B, joints) for B in self.basis))
        W = W.reshape(count, -1, W.shape[-1])
        eigenvalues = jnp.linalg.eigvalsh(jnp.einsum("cri,crj->cij", W, W))
        return x, eigenvalues[:, -1] / jnp.maximum(eigenvalues[:, 0], 1e-300)

    def best(self, seed: int) -> list[Array]:
        """All candidates, the best first."""
        with jax.enable_x64(True):
            keys = jax.random.split(jax.random.key(seed), CANDIDATES // BATCH)
            drawn = [self.draw_and_score(key) for key in keys]
            scores = np.concatenate([np.asarray(score) for _, score in drawn])
            xs = np.concatenate([np.asarray(x) for x, _ in drawn])
        return list(xs[np.argsort(scores, kind="stable")])


def screened(made: Formulation, seed: int) -> Iterator[tuple[float, float]]:
    """Best value after each start, and the processor time of the batches."""
    began, problem, solver = time.process_time(), made.problem, SequentialQuadratic()
    with jax.enable_x64(True):
        guesses = Screen(made).best(seed)
    screening, best = time.process_time() - began, math.inf
    for x in guesses:
        inside = problem.drawn(x, min(1.0, 0.999 * problem.reach(x)))
        best = min(best, problem.exact_value(solver.solve(problem, [inside]).x))
        yield best, screening


def plain(made: Formulation, seed: int) -> Iterator[tuple[float, float]]:
    """Random starts as the search makes them: each takes the best of a race."""
    best, solver = math.inf, SequentialQuadratic()
    for k in range(10**6):
        best = min(best, optimise_starts(made.problem, solver, seed, [k], None)[0].value)
        yield best, 0.0


def default(made: Formulation, seed: int) -> Iterator[tuple[float, float]]:
    """The search that is the default, without end."""
    rounds, results, best, solver = Rounds(Search(seed=seed, rounds=10**6)), [], math.inf, SequentialQuadratic()
    while True:
        results = optimise_starts(made.problem, solver, seed, list(rounds.following(results)), None)
        best = min([best, *(result.value for result in results)])
        yield best, 0.0


METHODS: dict[str, Callable[[Formulation, int], Iterator[tuple[float, float]]]] = {
    "screened in JAX": screened, "random starts": plain, "default search": default
}  # fmt: skip


def run(case: str, method: str, seed: int) -> dict[str, Any]:
    """Best value within the budget of processor time, and within it without the batches."""
    made = formulation(case)
    warm: Problem = made.problem
    warm.gradient(warm.point(warm.rest, 1.0))
    began, inside, free = time.process_time(), math.inf, math.inf
    screening, starts = 0.0, 0
    for best, screening in METHODS[method](made, seed):
        spent = time.process_time() - began
        if spent - screening > BUDGETS[case]:
            break
        starts += 1
        free = best
        inside = best if spent <= BUDGETS[case] else inside
    found = {"within": inside, "within without batches": free, "screening": screening, "starts or rounds": starts}
    return {"case": case, "method": method, "seed": seed, **found}


def main() -> None:
    """Every method on every case."""
    load, runs = record.load(), list[dict[str, Any]]()
    for case in BUDGETS:
        for method in METHODS:
            for seed in SEEDS:
                runs.append(run(case, method, seed))
                print(runs[-1], file=sys.stderr, flush=True)
    head = ("case", "method", "CPU s", "of which batches", "median", "best", "worst", "median, batches for nothing")
    rows = []
    for case, budget in BUDGETS.items():
        for method in METHODS:
            some = [r for r in runs if r["case"] == case and r["method"] == method]
            values = np.array([r["within"] for r in some])
            rows.append([
                case, method, f"{budget:g}", f"{np.median([r['screening'] for r in some]):.1f}",
                *(f"{f(values):.4g}" for f in (np.median, np.min, np.max)),
                f"{np.median([r['within without batches'] for r in some]):.4g}",
            ])  # fmt: skip
    record.save("screening", load, {"runs": runs}, record.table(head, rows), LIMITATIONS)


LIMITATIONS = (
    f"{CANDIDATES} candidates of {_INSTANTS} instants, scored by the condition number, in one process; {len(SEEDS)} "
    "seeds; 'inf': the batches took longer than the budget",
    "batches for nothing: the value when the solver alone has spent the budget, which bounds what a GPU would bring; "
    "no GPU was measured",
    "the default search in one process, without its end",
)

if __name__ == "__main__":
    main()
