"""A model of one's own: friction that grows with the square of the speed, ``tau = Y theta + diag(dq |dq|) D``.

The figure shows how accurately drag is identified beside the rest. Takes about 3 s.

From the command line: ``excite design irp6 --model own_model:DragModel --out designs/drag`` in this folder.
"""

import sys
from pathlib import Path

import casadi as ca
from matplotlib.figure import Figure

import excite


class DragModel(excite.DifferentialModel):
    """Joint torques with drag in every joint, as of a robot under water, or of churned oil."""

    def __init__(self, robot, terms=None, *, sign_width=0.0):
        super().__init__(robot, terms, sign_width=sign_width)
        drag = (excite.Column(f"D{j}", "Nm s^2/rad^2", "drag") for j in robot.joint_names)
        self.columns = (*self.columns, *drag)

    def rows(self, q, dq, ddq):
        """Torques per parameter, shape (n, p)."""
        return ca.horzcat(super().rows(q, dq, ddq), ca.diag(dq * ca.fabs(dq)))


if __name__ == "__main__":
    model = DragModel(excite.load_robot("irp6"))
    design = excite.design_trajectory(model, search=excite.Search(starts=1))
    print(design)
    figure = Figure(figsize=(5.8, 3.3), layout="constrained")
    ax = figure.subplots()
    for k, prediction in enumerate(design.predicted):
        drag = prediction.name.startswith("D")
        ax.bar(k, prediction.standard_deviation, color="#D55E00" if drag else "#56B4E9")
    ax.set_xticks(range(len(design.predicted)), design.base.names, fontsize=8)
    ax.set(title="drag is identified beside the rest", ylabel="predicted standard deviation [SI]")
    print(", ".join(design.base.names))
    for folder in sys.argv[1:]:  # without one, nothing is written
        figure.savefig(Path(folder) / "own_model.png", dpi=130)
