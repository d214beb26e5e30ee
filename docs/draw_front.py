"""Draw the picture of the README: ``python docs/draw_front.py --out docs/front.png``.

Left, the motion of the README's first command, each quantity as a share of its limit. Right, what a simulated log of it
with noisy torques and encoder counts identifies: every parameter with its 99 % interval beside its true value.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import excite

COLOURS = ("#0072B2", "#D55E00", "#009E73")  # Okabe and Ito: told apart without red and green
DARK = "#333333"


def tidy(ax: Axes, title: str) -> None:
    """Give a panel its title, a light grid, and lines only where they are read."""
    ax.set_title(title, fontsize=10, color=DARK, loc="left")
    ax.grid(True, color="#DDDDDD", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=8, colors=DARK)
    ax.spines[["top", "right"]].set_visible(False)


def draw_motion(axes: list[Axes], design: excite.Design) -> None:
    """Positions of joints, velocities and accelerations of drives over time, as shares of their limits."""
    samples = design.trajectory.samples(np.linspace(0.0, design.trajectory.duration, 1001))
    limits, drives = design.moving.limits, design.moving.transmission
    middle, half = (limits.upper + limits.lower) / 2, (limits.upper - limits.lower) / 2
    shares = {
        "position": (samples.q - middle) / half,
        "velocity": samples.dq @ drives.coupling.T / drives.limits.velocity,
        "acceleration": samples.ddq @ drives.coupling.T / drives.limits.acceleration,
    }
    for ax, (name, share) in zip(axes, shares.items(), strict=True):
        for joint, column, colour in zip(design.moving.joint_names, share.T[:3], COLOURS, strict=True):
            ax.plot(
                samples.time, 100 * column, color=colour, linewidth=1.4, label=joint if name == "position" else None
            )
        for edge in (-100, 100):
            ax.axhline(edge, color=DARK, linewidth=0.9, linestyle="--")
        ax.set_ylabel(f"{name}\n[% of limit]", fontsize=8, color=DARK)
        ax.set_ylim(-115, 115)
    axes[0].legend(ncols=3, fontsize=7, frameon=False, loc="upper right", bbox_to_anchor=(1.0, 1.32))
    axes[-1].set_xlabel("time [s]", fontsize=8, color=DARK)


def draw_parameters(ax: Axes, design: excite.Design) -> None:
    """Identified parameters with their intervals, in per cent of the true values."""
    log = excite.simulate(design, encoder=4000, torque_noise=1.0, seed=1)
    result = excite.identify(design.robot.name, log, design=design)
    true = result.reference.values
    for place in range(len(result.names)):
        value, interval = (100 * x[place] / true[place] for x in (result.coefficients, result.estimate.interval))
        ax.plot(interval, [place, place], color=COLOURS[0], linewidth=1.8)
        ax.plot([value], [place], "o", color=COLOURS[0], markersize=4)
    ax.axvline(100, color=DARK, linewidth=0.9, linestyle="--")
    ax.invert_yaxis()
    ax.set_yticks(range(len(result.names)), result.names)
    ax.set_xlabel("estimate and 99 % interval [% of the true value]", fontsize=8, color=DARK)


def main() -> None:
    """Design, simulate, identify and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    design = excite.design_trajectory("irp6", search=excite.Search(seed=0))
    figure = Figure(figsize=(9.6, 4.2), layout="constrained", facecolor="white")
    left, right = figure.subfigures(1, 2, width_ratios=(1.15, 1.0))
    axes = list(left.subplots(3, 1, sharex=True))
    for ax, title in zip(axes, ("the designed motion", "", ""), strict=True):
        tidy(ax, title)
    panel = right.subplots()
    tidy(panel, f"identified from one simulated log; cond W = {design.condition_number:.1f}")
    draw_motion(axes, design)
    draw_parameters(panel, design)
    figure.savefig(out, dpi=130)


if __name__ == "__main__":
    main()
