"""An arm in a cell: one arm, designed with and without a world file that says where the obstacles are.

``cell.yaml`` describes a table, a wall, a machine and the arm's capsules. The figure shows the way of the flange from
the side, and the distance of the nearest two bodies over time. Takes about 7 s.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import excite
from constraints.collision_limits import Clearance

BLUE, VERMILLION, GREY = "#0072B2", "#D55E00", "#BBBBBB"
robot = excite.load_robot("iiwa7")
limits = excite.LimitChoice(world=excite.read_world(Path(__file__).with_name("cell.yaml")))
search = excite.Search(starts=1, seed=0)
nothing = excite.LimitChoice(self_collision=False, floor="none")
careless = excite.design_trajectory(robot, harmonics=4, search=search, limits=nothing)
careful = excite.design_trajectory(robot, harmonics=4, search=search, limits=limits)


def nearest(design):
    """Distance of the nearest two bodies at every instant [m]."""
    distances = [
        limit.shown(limit.values(design.samples)) for limit in careful.nonlinear if isinstance(limit, Clearance)
    ]
    return np.hstack(distances).min(axis=1)


def joint_origins(q):
    """Origins of the links' frames in the frame of the base, shape (1 + n, 3) [m]."""
    pose, origins = np.eye(4), [np.zeros(3)]
    for joint, angle in zip(robot.joints, q, strict=True):
        pose = pose @ joint.motion(angle)
        origins.append(pose[:3, 3])
    return np.array(origins)


figure = Figure(figsize=(5.8, 3.3), layout="constrained")
side, over_time = figure.subplots(1, 2, width_ratios=(1.2, 1))
side.axhline(0, color=GREY, linewidth=6)
side.axvspan(-0.8, -0.5, color=GREY)
side.add_patch(Rectangle((0.4, 0), 0.5, 0.7, color=GREY))
for x, z, name in ((-0.65, 1.3, "wall"), (0.65, 0.35, "machine"), (0.0, -0.09, "table")):
    side.text(x, z, name, ha="center", fontsize=9)
for name, design, colour in (("without the cell", careless, VERMILLION), ("with the cell", careful, BLUE)):
    distance, origins = nearest(design), np.array([joint_origins(q) for q in design.samples.q])
    print(
        f"{name + ':':17} cond W = {design.condition_number:.1f}, nearest bodies {100 * distance.min():5.1f} cm apart"
    )
    side.plot(*origins[:, -1, [0, 2]].T, color=colour, linewidth=1.8, label=name)
    over_time.plot(design.samples.time, 100 * distance, color=colour, linewidth=1.8, label=name)
for origins_now in origins[:: len(origins) // 8]:
    side.plot(origins_now[:, 0], origins_now[:, 2], color="#333333", linewidth=0.7, alpha=0.5)
side.set(title="from the side", xlabel="x [m]", ylabel="z [m]", xlim=(-0.8, 0.9), ylim=(-0.15, 1.4), aspect="equal")
over_time.axhspan(-100, 2, color="#F7DCC6")
over_time.text(0.3, -38, "closer than the clearance", fontsize=8)
over_time.set(title="nearest bodies", xlabel="time [s]", ylabel="distance [cm]", ylim=(-40, 30))
over_time.legend(frameon=False, fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 0.12))
for folder in sys.argv[1:]:  # without one, nothing is written
    figure.savefig(Path(folder) / "arm_in_a_cell.png", dpi=130)
