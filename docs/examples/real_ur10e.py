"""A real UR10e: identify from the log of one exciting motion, and judge by the log of another.

``python real_ur10e.py LOGS [FOLDER]``, with the folder of the logs, which are not part of the project. Their columns
are currents; ``ur10e.yaml`` says what they mean. Friction terms are chosen by what predicts the torques that are left
out. The figure shows the torques of the other log. Takes about 12 s.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import excite

if len(sys.argv) < 2:
    sys.exit("Name the folder with the logs of the UR10e.")
logs, *folders = map(Path, sys.argv[1:])
mapping = excite.read_mapping(Path(__file__).with_name("ur10e.yaml"))
result = excite.identify("ur10e", logs / "ur-20_02_12-40sec_12harm.csv", mapping=mapping)
print(f"{len(result.names)} parameters, training error {100 * result.training_error:.1f} %")
check = excite.verify(result, logs / "ur-20_02_12-50sec_12harm.csv", mapping=mapping)
print(f"torques of the other log: {100 * check.relative_error:.1f} % off")
print(check.verdict.text)

figure = Figure(figsize=(5.8, 3.3), layout="constrained")
for ax, measured, predicted, (joint, unit) in zip(
    figure.subplots(2, 3, sharex=True).flat, check.measured.T, check.predicted.T, check.equations, strict=True
):
    ax.plot(check.time - check.time[0], measured, color="#56B4E9", linewidth=0.8, label="measured")
    ax.plot(check.time - check.time[0], predicted, color="#D55E00", linewidth=1.0, label="predicted")
    ax.set_title(f"{joint.removesuffix('_joint').replace('_', ' ')} [{unit}]", fontsize=9)
    ax.set_xlim(10, 20)
figure.supxlabel("time [s]", fontsize=9)
figure.legend(
    *figure.axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=2, frameon=False, fontsize=8
)
for folder in folders:  # without one, nothing is written
    figure.savefig(folder / "real_ur10e.png", dpi=130)
