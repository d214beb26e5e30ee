"""Friction, planned and fitted: runs of one drive at constant speeds, and the curve that they show.

``plan_friction`` finds a pose in which gravity cancels, and the runs; ``fit_friction`` reads their logs, fits several
forms and takes the one with the best BIC. The figure shows both. Takes about 6 s.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import excite

robot = excite.load_robot("irp6")
plan = excite.plan_friction(robot, drives=["z2"], seed=0)
print(plan)
with tempfile.TemporaryDirectory() as folder:
    plan.save(Path(folder) / "plan")
    log = excite.simulate(
        Path(folder) / "plan" / "z2.csv", controller="pd", bandwidth=10, torque_noise=5.0, rate=100, seed=1
    )
    fit = excite.fit_friction(robot, log, plan=plan)
(drive,) = fit.characteristics
true = robot.transmission.drives[1]
print(f"{len(drive.points)} runs; the form with the best BIC is {drive.fit.form.name}")
for name, value, half in zip(drive.fit.form.parameters, drive.fit.values, drive.fit.halfwidth, strict=True):
    print(f"{name:8} {value:6.2f} +- {half:.2f}, true {getattr(true, name, 0.0):.2f}")

figure = Figure(figsize=(5.8, 3.3), layout="constrained")
runs, curve = figure.subplots(1, 2)
runs.plot(log.log.time, log.log.q[:, log.log.joints.index("q2")], color="#0072B2", linewidth=1.0)
for middle, height, words in ((16, 0.6, "warm-up"), (66, 0.06, "break-away"), (136, 0.75, "constant speeds")):
    runs.text(middle, height, words, ha="center", fontsize=8)
runs.set(title="the planned runs", xlabel="time [s]", ylabel="joint q2 [rad]", ylim=(-0.9, 0.95))
speed, torque = np.array([(point.speed, point.torque) for point in drive.points]).T
for sign in (-1, 1):
    v = sign * np.linspace(1e-6, np.abs(speed).max(), 200)
    curve.plot(v, drive.curve.torque(v), color="#0072B2", linewidth=1.8, label="fitted curve" if sign > 0 else None)
curve.plot(speed, torque, "o", color="#D55E00", markersize=4, label="mean torque of each run")
curve.set(title="friction of drive z2", xlabel="speed [rad/s]", ylabel=f"friction [{drive.unit}]")
curve.legend(frameon=False, fontsize=8)
for out in sys.argv[1:]:  # without one, nothing is written
    figure.savefig(Path(out) / "friction.png", dpi=130)
