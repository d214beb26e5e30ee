"""A load at a force/torque sensor: all ten parameters of what the sensor carries, from one motion of 5 s.

The wrench is linear in mass, first moments and inertia, so that the same design and identification apply. The figure
shows each estimate with its 99 % interval, and the true load of the simulation. Takes about 8 s.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import excite

sensor = excite.Sensor(translation=[0, 0, 0.107])  # at the flange, in the frame of the last link
model = excite.LoadModel(excite.load_robot("panda"), sensor)
design = excite.design_trajectory(model, excite.Fourier(5, 3), search=excite.Search(starts=1, seed=0))
print(design)

load = excite.Payload([1.5, 0.03, 0.015, 0.12, 0.015, 0.001, -0.003, 0.016, -0.001, 0.006])
log = excite.simulate(design, load=load, wrench_noise=(3, 0.1), seed=1)  # [N], [Nm]
result = excite.identify(model, log, design=design)
names, values, intervals = result.names, result.coefficients, np.array(result.estimate.interval)
for k, name in enumerate(names):
    print(f"{name:3} {values[k]:8.4f}, 99 % from {intervals[k, 0]:8.4f} to {intervals[k, 1]:8.4f} {result.units[k]}")

figure = Figure(figsize=(5.8, 3.3), layout="constrained")
mass, moment, inertia = figure.subplots(1, 3, width_ratios=(1, 2, 4))
for ax, part, title in (
    (mass, slice(0, 1), "mass [kg]"),
    (moment, slice(1, 4), "moment [kg m]"),
    (inertia, slice(4, 10), "inertia [kg m²]"),
):
    place, half = np.arange(10)[part], np.diff(intervals[part]).T / 2
    ax.errorbar(place, values[part], half, fmt="o", color="#0072B2", capsize=5, markersize=5, label="estimate, 99 %")
    ax.plot(place, load.phi[part], "_", color="#D55E00", markersize=16, markeredgewidth=2, label="true")
    ax.set_xticks(place, names[part], fontsize=9)
    ax.tick_params(axis="y", labelsize=8)
    ax.set_title(title, fontsize=10)
    ax.margins(x=0.3)
    ax.grid(axis="y", color="#DDDDDD")
inertia.legend(frameon=False, fontsize=8, loc="center")
for folder in sys.argv[1:]:  # without one, nothing is written
    figure.savefig(Path(folder) / "load_at_a_sensor.png", dpi=130)
