"""A constraint of one's own: two joints that must not drift apart, ``|q_i - q_j| <= D``, since a hose joins them.

The figure shows that difference, with and without the constraint. Takes about 3 s.

From the command line: ``excite design irp6 --constraint own_constraint:ShortHose --out designs/hose`` in this folder.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import excite


class Difference(excite.Limit):
    """Largest difference of two joints' positions.

    Parameters
    ----------
    first, second : str
        Names of the joints.
    largest : float
        D [rad or m].
    """

    def __init__(self, first, second, largest):
        self.names, self.largest = (first, second), largest

    def imposed(self, robot, motion):
        """Constraints of the moving coordinates."""
        i, j = (robot.joint_index(name) for name in self.names)
        bound = np.array([self.largest])
        label = (f"joint {self.names[0]} less joint {self.names[1]}",)
        difference = excite.NonlinearConstraint(
            robot.n, lambda q, dq, ddq: q[i] - q[j], -bound, bound, bound, label, ("rad",)
        )
        return (difference.restricted(motion),)


class ShortHose(Difference):
    """A hose from the arm to the forearm."""

    def __init__(self):
        super().__init__("q2", "q3", 0.6)


if __name__ == "__main__":
    designs = [
        excite.design_trajectory("irp6", constraints=limits, search=excite.Search(starts=1))
        for limits in ([], [ShortHose()])
    ]
    figure = Figure(figsize=(5.8, 3.3), layout="constrained")
    ax = figure.subplots()
    for design, name, colour in zip(designs, ("without the hose", "with it"), ("#D55E00", "#0072B2"), strict=True):
        difference = design.samples.q[:, 1] - design.samples.q[:, 2]
        print(
            f"{name + ':':17} cond W = {design.condition_number:.1f}, |q2 - q3| up to {abs(difference).max():.2f} rad"
        )
        ax.plot(design.samples.time, difference, color=colour, linewidth=1.8, label=name)
    ax.axhspan(-0.6, 0.6, color="#CFE6F3", zorder=0)
    ax.set(xlabel="time [s]", ylabel="q2 - q3 [rad]", ylim=(-0.8, 1.7))
    ax.legend(frameon=False, ncols=2, loc="upper right")
    for folder in sys.argv[1:]:  # without one, nothing is written
        figure.savefig(Path(folder) / "own_constraint.png", dpi=130)
