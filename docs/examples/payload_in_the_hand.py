"""A payload in the hand: what an arm holds, from its joint torques, with and without the load.

A short motion in a box of 20 cm, played twice in simulation. The figure shows torques of both, and the identified
centre of mass with its 99 % intervals. Takes about 5 s.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import excite

pose = (0, -0.4, 0, -2, 0, 1.8, 0.785)
motion = excite.design_payload_motion("panda", 0.2, pose=pose, limits=excite.LimitChoice(velocity=(2,)))
load = excite.Payload([2, 0.02, 0, 0.3, 0.06, 0, 0, 0.06, 0, 0.01])
without, held = (
    excite.simulate(motion.design, rate=200, torque_noise=0.1, seed=seed, load=carried)
    for seed, carried in ((1, None), (2, load))
)
payload = excite.identify_payload("panda", held, without=without, gain_deviation=0.01)
true = (load.phi[0], *load.phi[1:4] / load.phi[0])
for name, unit, scale, estimate, (low, high), is_true in zip(
    ("mass", "x", "y", "z"), ("kg", "mm", "mm", "mm"), (1, 1e3, 1e3, 1e3),
    payload.body.listed, payload.intervals, true, strict=False,
):  # fmt: skip
    print(
        f"{name:4} {scale * estimate:6.2f} {unit}, 99 % from {scale * low:6.2f} to {scale * high:6.2f}, "
        f"true {scale * is_true:6.2f}"
    )

figure = Figure(figsize=(5.8, 3.3), layout="constrained")
torques, centre = figure.subplots(1, 2, width_ratios=(3, 2))
for log, colour, name in ((without.log, "#56B4E9", "without the load"), (held.log, "#D55E00", "with it")):
    torques.plot(log.time, log.effort[:, [1, 3]], color=colour, linewidth=1.2, label=(name, None))
torques.set(title="torques of joints 2 and 4", xlabel="time [s]", ylabel="torque [Nm]")
torques.legend(frameon=False, fontsize=8, ncols=2)
x, z = 1e3 * payload.body.centre[[0, 2]]
half = 1e3 * np.diff(payload.intervals[[1, 3]])[:, :, None][:, 0] / 2
centre.errorbar([x], [z], half[1], half[0], "o", color="#0072B2", capsize=5, label="estimate, 99 %")
centre.plot([1e3 * true[1]], [1e3 * true[3]], "x", color="#D55E00", markersize=9, markeredgewidth=2, label="true")
centre.set(title="centre of the load", xlabel="x [mm]", ylabel="z [mm]", xlim=(8, 12), ylim=(148, 152))
centre.legend(frameon=False, fontsize=8)
for folder in sys.argv[1:]:  # without one, nothing is written
    figure.savefig(Path(folder) / "payload_in_the_hand.png", dpi=130)
