"""A criterion of one's own: the variance of some parameters only, whatever becomes of the others.

With M = [[A, B], [B', C]], A that of the wanted parameters, their covariance is the inverse of the Schur complement
``S = A - B C^-1 B'``; minimised is the trace of its inverse, the block of M^-1.

The figure shows what that costs the other parameters. Takes about 3 s.

From the command line: ``excite design irp6 --criterion own_criterion:FirstThree --out designs/first`` in this folder.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import excite


class VarianceOfSome(excite.Criterion):
    """``sqrt(tr (M^-1)_ww)`` of the wanted columns w."""

    name = "variance-of-some"
    stages = (1.0,)

    def __init__(self, wanted):
        self.wanted = list(wanted)

    def value(self, M):
        """The square root of the sum of their variances."""
        return float(np.sqrt(np.trace(np.linalg.inv(M)[np.ix_(self.wanted, self.wanted)])))

    def smooth(self, M, sharpness):
        """Half its logarithm, and the gradient ``-(1/2t) M^-1 E E' M^-1`` with the unit columns E of the wanted."""
        inverse = np.linalg.inv(M)
        E = np.eye(len(M))[:, self.wanted]
        trace = float(np.trace(E.T @ inverse @ E))
        return 0.5 * np.log(trace), -0.5 / trace * inverse @ E @ E.T @ inverse


class FirstThree(VarianceOfSome):
    """Of the first three base parameters."""

    def __init__(self):
        super().__init__(range(3))


if __name__ == "__main__":
    designs = {
        str(getattr(criterion, "name", criterion)): excite.design_trajectory(
            "irp6", criterion=criterion, search=excite.Search(starts=1)
        )
        for criterion in ("trace", FirstThree())
    }
    figure = Figure(figsize=(5.8, 3.3), layout="constrained")
    ax = figure.subplots()
    for (name, design), colour, marker in zip(designs.items(), ("#D55E00", "#0072B2"), "so", strict=True):
        deviations = [prediction.standard_deviation for prediction in design.predicted]
        print(
            f"{name:16}",
            *(f"{prediction.name} {prediction.standard_deviation:.3f}" for prediction in design.predicted[:3]),
        )
        ax.plot(deviations, marker, color=colour, label=name)
    ax.axvspan(-0.5, 2.5, color="#CFE6F3", zorder=0)
    ax.set_xticks(range(len(deviations)), [prediction.name for prediction in design.predicted])
    ax.set(title="wanted are the first three", ylabel="predicted standard deviation", yscale="log")
    ax.legend(frameon=False)
    for folder in sys.argv[1:]:  # without one, nothing is written
        figure.savefig(Path(folder) / "own_criterion.png", dpi=130)
