"""Draw the figures that tutorials begin with: ``python docs/draw_openings.py [NAME ...]``, without a name all.

Left, the arm at five instants of a designed motion, with the way of its last link. Right, what a simulated log of it
measured, and what the parameters that were identified from another log predict, for the joint with the largest torque.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import numpy as np
from draw_front import COLOURS, DARK, bodies_of, draw_arm, seen, set_scene, tidy
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import excite

OUT = Path(__file__).resolve().parent / "tutorials" / "figures"
SHARED = "cmeel.prefix/share/example-robot-data/robots"
#: Robot, options of its design, and noise of its torques [Nm].
ROBOTS: Mapping[str, tuple[str, Mapping[str, Any], float]] = {
    "irp6": ("irp6", {}, 1.0),
    "ur": ("ur10e", {}, 1.0),
    "franka": ("panda", {}, 0.1),
    "xarm": ("xarm_description/urdf/xarm7.urdf", {"acceleration": 8.0}, 0.5),
    "whole-robots": ("go2_description/urdf/go2.urdf", {"acceleration": 40.0}, 0.02),
    "desktop-arm": ("so101", {"acceleration": 20.0}, 0.02),
}
INSTANTS, COLOURS_KEPT = 401, 48


def opening(robot: str, limits: Mapping[str, Any], noise: float) -> Image.Image:
    """The figure of one robot."""
    place = str(distribution("example-robot-data").locate_file(f"{SHARED}/{robot}")) if "/" in robot else robot
    chosen = excite.LimitChoice(**{name: (value,) for name, value in limits.items()})
    design = excite.design_trajectory(place, limits=chosen, search=excite.Search(starts=4, seed=0))
    log, other = (excite.simulate(design, torque_noise=noise, seed=seed) for seed in (1, 2))
    check = excite.verify(excite.identify(place, log, design=design), other)

    figure = Figure(figsize=(8.6, 3.6), dpi=105, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    arm, torque = figure.add_axes((0.0, 0.0, 0.44, 1.0)), figure.add_axes((0.53, 0.16, 0.45, 0.7))
    bodies, tip = bodies_of(design, design.trajectory.samples(np.linspace(0, design.trajectory.duration, INSTANTS)).q)
    dots = set_scene(arm, bodies)
    arm.plot(*seen(tip)[0].T, color=COLOURS[1], linewidth=1.2, zorder=2)
    for k in np.linspace(0, INSTANTS - 1, 6).astype(int)[1:-1]:
        draw_arm(arm, bodies, int(k), dots, solid=0.18)
    draw_arm(arm, bodies, 0, dots)
    number = int(np.argmax(np.abs(check.measured).max(axis=0)))
    name, share = check.torques[number].name, 100 * check.relative_error
    tidy(torque, f"{name}; all joints predicted within {share:.2g} %")
    torque.plot(check.time, check.measured[:, number], color="#9A9A9A", linewidth=1.0, label="measured in a new log")
    torque.plot(check.time, check.predicted[:, number], color=COLOURS[0], linewidth=1.2, label="predicted")
    torque.set_xlabel("time [s]", fontsize=8, color=DARK)
    torque.set_ylabel("torque [Nm]", fontsize=8, color=DARK)
    torque.legend(fontsize=8, frameon=False, loc="upper right", ncols=2, bbox_to_anchor=(1.0, 1.0))
    torque.margins(y=0.2)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def main() -> None:
    """Draw what is named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(ROBOTS))
    for name in parser.parse_args().names or ROBOTS:
        out = OUT / f"{name}-opening.png"
        beside = out.with_name(f".{out.name}")
        opening(*ROBOTS[name]).quantize(COLOURS_KEPT, dither=Image.Dither.NONE).save(beside, "PNG", optimize=True)
        beside.replace(out)
        print(f"{out.name}: {out.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
