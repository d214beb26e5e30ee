"""A solver of one's own: random steps that stay within the limits and are kept where they improve the criterion.

From the command line: ``excite design irp6 --solver own_solver:RandomWalk --out designs/walk`` in this folder.
"""

import numpy as np

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
    for solver in (RandomWalk(), "sqp"):
        design = excite.design_trajectory("irp6", search=excite.Search(starts=1, solver=solver))
        print(design)
