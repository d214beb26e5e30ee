"""Compare designs: what another criterion or a shorter motion costs, all judged by the same measures.

Each search begins at the first design and follows its own criterion; ``compare`` judges all of them. The figure shows
the predicted standard deviation of every parameter. Takes about 5 s.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import excite

long, short = excite.Fourier(period=10, harmonics=5), excite.Fourier(period=5, harmonics=5)
first = excite.design_trajectory("irp6", long, search=excite.Search(starts=1, seed=0))
search = excite.Search(starts=1, begin=first)
designs = {
    "condition, 10 s": first,
    "D-optimal, 10 s": excite.design_trajectory("irp6", long, criterion="logdet", search=search),
    "A-optimal, 10 s": excite.design_trajectory("irp6", long, criterion="trace", search=search),
    "condition, 5 s": excite.design_trajectory("irp6", short, search=search),
}
print(f"{'minimised':16} {'cond W':>7} {'log det':>8} {'trace':>7}")
for name, judged in zip(designs, excite.compare(list(designs.values())), strict=True):
    by = judged.criteria
    print(f"{name:16} {by['condition_number']:7.1f} {by['log_det']:8.1f} {by['trace_inverse']:7.4f}")

figure = Figure(figsize=(5.8, 3.3), layout="constrained")
ax = figure.subplots()
for (name, design), marker, colour in zip(
    designs.items(), "osD^", ("#0072B2", "#D55E00", "#009E73", "#CC79A7"), strict=True
):
    deviations = [each.standard_deviation for each in design.predicted]
    ax.plot(deviations, marker, color=colour, markersize=6, label=name)
ax.set_xticks(range(len(deviations)), [each.name for each in design.predicted])
ax.set_yscale("log")
ax.set_ylabel("predicted standard deviation\n[SI, noise of 1 Nm]")
ax.grid(color="#DDDDDD")
ax.set_axisbelow(True)
ax.legend(ncols=2, frameon=False, fontsize=8)
for folder in sys.argv[1:]:  # without one, nothing is written
    figure.savefig(Path(folder) / "compare_designs.png", dpi=130)
