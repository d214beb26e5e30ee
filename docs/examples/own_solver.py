"""A solver of one's own: random steps that stay within the limits and are kept where they improve the criterion.

The figure shows how it gets on, beside the built-in solver. Takes about 3 s.

From the command line: ``excite design irp6 --solver own_solver:RandomWalk --out designs/walk`` in this folder.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import excite
from excite.design.solvers.solver import SolverResult, Status


class RandomWalk(excite.Solver):
    """Accepts a random step if it improves the criterion.

    Parameters
    ----------
    steps : int
    """

    name = "random-walk"

    def __init__(self, steps=300):
        self.steps = steps

    def solve(self, problem, starts, watch=None):
        """Walk from the best of some starts."""
        rng = np.random.default_rng(0)
        sharpness = problem.criterion.stages[-1]
        x = min(starts, key=lambda start: problem.point(start, sharpness).value)
        value = problem.criterion_value(problem.point(x, sharpness))
        history = [value]
        for _ in range(self.steps):
            direction = rng.normal(size=x.shape)
            step = min(0.05, 0.9 * problem.longest_step(x, direction))
            trial = x + step * direction
            new = problem.criterion_value(problem.point(trial, sharpness))
            if new < value and problem.nonlinear_hold(trial):
                x, value = trial, new
                history.append(value)
                if watch is not None:
                    watch(x, value)
        return SolverResult(x, value, Status.ITERATION_LIMIT, history, self.steps)


if __name__ == "__main__":
    figure = Figure(figsize=(5.8, 3.3), layout="constrained")
    ax = figure.subplots()
    for solver, colour in ((RandomWalk(), "#D55E00"), ("sqp", "#0072B2")):
        design = excite.design_trajectory("irp6", search=excite.Search(starts=1, solver=solver))
        print(f"{getattr(solver, 'name', solver):11} cond W = {design.condition_number:.1f}")
        ax.plot(design.starts[0].history, color=colour, linewidth=1.8, label=getattr(solver, "name", solver))
    ax.set(xlabel="improvement", ylabel="cond(W)", yscale="log")
    ax.legend(frameon=False)
    for folder in sys.argv[1:]:  # without one, nothing is written
        figure.savefig(Path(folder) / "own_solver.png", dpi=130)
