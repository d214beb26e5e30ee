"""From a robot to parameters and a verdict: design a motion, play it in simulation, identify, verify.

The figure shows the torques of a motion that was not used to identify: as measured, and as the identified model
predicts them. Takes about 6 s.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import excite

robot = excite.load_robot("irp6")  # or a robot YAML, or a URDF
model = excite.DifferentialModel(robot)
family, limits = excite.Fourier(period=10, harmonics=5), [excite.TorqueLimit(margin=0.2)]
design, other = (
    excite.design_trajectory(model, family, constraints=limits, search=excite.Search(starts=1, seed=seed))
    for seed in (0, 1)
)
print(design)

log = excite.simulate(design, noise=2.0, seed=1)  # what the robot would measure; read_log("run.csv") of a real one
result = excite.identify(model, log, design=design)
for name, value, deviation, unit in zip(
    result.names, result.coefficients, result.estimate.deviation, result.units, strict=True
):
    print(f"{name:4} {value:8.3g} +- {deviation:.1g} {unit}")

check = excite.verify(result, excite.simulate(other, noise=2.0, seed=2))
print(f"torques of the other motion: {100 * check.relative_error:.1f} % off, noise included")
print(check.verdict.text)

figure = Figure(figsize=(5.8, 3.3), layout="constrained")
axes = figure.subplots(3, sharex=True)
for ax, measured, predicted, (joint, unit) in zip(
    axes, check.measured.T, check.predicted.T, check.equations, strict=True
):
    ax.plot(check.time, measured, color="#56B4E9", linewidth=1.0, label="measured")
    ax.plot(check.time, predicted, color="#D55E00", linewidth=1.6, label="predicted")
    ax.set_ylabel(f"{joint} [{unit}]")
axes[0].set_title("another motion", fontsize=11, loc="left")
axes[0].legend(ncols=2, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0))
axes[-1].set_xlabel("time [s]")
for folder in sys.argv[1:]:  # without one, nothing is written
    figure.savefig(Path(folder) / "whole_chain.png", dpi=130)
