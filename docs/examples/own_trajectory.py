"""A trajectory family of one's own: Fourier series of odd harmonics only, ``q(t) = c + sum_k odd a_k cos + b_k sin``.

Without even harmonics the second half of the motion mirrors the first, ``q(t + T/2) - c = -(q(t) - c)``: every speed
and acceleration is used in both directions. Only the coefficients are fewer; limits, extrema and files are those of
`excite.Fourier`.

The figure shows the second half of a motion mirrored onto the first. Takes about 3 s.

From the command line: ``excite design irp6 --trajectory own_trajectory:OddFourier --out designs/odd`` in this folder.
"""

import sys
from pathlib import Path

import numpy as np
import scipy.linalg
from matplotlib.figure import Figure

import excite


class OddFourier(excite.Fourier):
    """The harmonics 1, 3, 5 ... of as many as a Fourier series has.

    Parameters
    ----------
    period : float
        [s]
    harmonics : int
        Highest harmonic, at least 3.
    """

    name = "odd-fourier"

    def __init__(self, period, harmonics):
        super().__init__(period, harmonics)
        order = np.arange(1, harmonics + 1)
        even = np.concatenate([[False], order % 2 == 0, order % 2 == 0])  # of c, a_1 ... a_K, b_1 ... b_K
        self._Z = self._Z @ scipy.linalg.null_space(self._Z[even])  # of the motions at rest at both ends
        self.size = self._Z.shape[1]


if __name__ == "__main__":
    figure = Figure(figsize=(5.8, 3.3), layout="constrained")
    for ax, trajectory in zip(
        figure.subplots(1, 2, sharey=True), (OddFourier(10, 7), excite.Fourier(10, 4)), strict=True
    ):
        design = excite.design_trajectory("irp6", trajectory, search=excite.Search(starts=1))
        print(f"{trajectory.name:12} {trajectory.size} coefficients per joint, cond W = {design.condition_number:.1f}")
        time, (_, q2, _) = design.samples.time, design.samples.q.T
        second = time >= 5
        ax.plot(time[~second], q2[~second], color="#0072B2", linewidth=1.8, label="first half")
        ax.plot(time[second] - 5, (q2[0] + q2[second][0]) - q2[second], "--", color="#D55E00", label="second, mirrored")
        ax.set(title=trajectory.name, xlabel="time of the half [s]")
    figure.axes[0].set_ylabel("joint q2 [rad]")
    figure.axes[0].legend(frameon=False, fontsize=8)
    for folder in sys.argv[1:]:  # without one, nothing is written
        figure.savefig(Path(folder) / "own_trajectory.png", dpi=130)
