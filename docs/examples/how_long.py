"""How long must the motion be? Accuracy over the growing time of designed motions of 5, 10 and 20 s.

``study_over_time`` identifies again and again from the part of a motion that has passed. The figure shows the largest
relative standard deviation of all parameters, and cond(W). Takes about 14 s.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import excite

search = excite.Search(starts=1, seed=0)
periods = (5, 10, 20)
designs = [excite.design_trajectory("irp6", excite.Fourier(period, 5), search=search) for period in periods]
study = excite.study_over_time("irp6", designs=designs, below=0.02)

figure = Figure(figsize=(5.8, 3.3), layout="constrained")
deviation, condition = figure.subplots(1, 2)
for period, course, colour, dashes in zip(
    periods, study.courses, ("#0072B2", "#D55E00", "#009E73"), ("-", "--", "-."), strict=True
):
    last, known = course.condition_number[-1], 100 * np.sqrt(np.mean(course.relative_deviation[-1] ** 2))
    print(f"period {period:2} s: cond W = {last:.1f}, parameters known to {known:.2f} % (root mean square)")
    for ax, size in ((deviation, 100 * course.relative_deviation.max(axis=1)), (condition, course.condition_number)):
        ax.plot(course.time, size, dashes, color=colour, linewidth=1.8, label=f"period {period} s")
deviation.axhline(2, color="#333333", linewidth=0.8)
deviation.text(20, 2.1, "2 %", ha="right", fontsize=9)
deviation.set(title="largest standard deviation", ylabel="of the parameter [%]", ylim=(0.5, 100))
condition.set(title="cond(W)", ylim=(20, 1e4))
for ax in (deviation, condition):
    ax.set_yscale("log")
    ax.set_xlabel("time that has passed [s]")
    ax.grid(color="#DDDDDD")
condition.legend(frameon=False, fontsize=8)
for folder in sys.argv[1:]:  # without one, nothing is written
    figure.savefig(Path(folder) / "how_long.png", dpi=130)
