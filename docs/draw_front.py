"""Draw the pictures of the README: ``python docs/draw_front.py --out docs/front.png --moving docs/front.gif``.

``front.png``: left, the motion of the README's first command, each quantity as a share of its limit; right, what a
simulated log of it with noisy torques and encoder counts identifies: every parameter with its 99 % interval beside its
true value. ``front.gif``: the arm plays the motion, beside it the velocities of its drives, and the condition number of
what has been played so far.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke
from PIL import Image

import excite
from constraints.clearance import link_poses
from excite.trajectories.sequence import whole_pose

COLOURS = ("#0072B2", "#D55E00", "#009E73")  # Okabe and Ito: told apart without red and green
DARK = "#333333"
FRAMES_PER_S, DOTS, SHADES = 10, 96, 32  # of the moving picture, its resolution [1/in], and its colours
VIEW = np.radians([-62.0, 22.0])  # azimuth and elevation from which the arm is seen
LINKS = ("#9A9A9A", "#9A9A9A", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9")  # from the base on
Values = np.ndarray[Any, np.dtype[np.float64]]


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


def seen(points: Values) -> tuple[Values, Values]:
    """Points in the plane of the picture, and how near they are, of points in space, shape (..., 3)."""
    turn, lift = VIEW
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    toward = np.array([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)])
    return np.stack([points @ right, points @ np.cross(toward, right)], axis=-1), points @ toward


def bodies_of(design: excite.Design, q: Values) -> tuple[list[tuple[str, Values, float]], Values]:
    """Link, ends over time, shape (N, 2, 3), and radius of each capsule of the robot; and the way of its last link.

    Parameters
    ----------
    design : Design
    q : ndarray, shape (N, n)
        Of the joints that move.
    """
    poses = link_poses(design.robot, whole_pose(design.robot, design.moving.joint_names, q))
    assert design.shape is not None
    found = []
    for part in design.shape.parts:
        R, p = poses[part.link][:, :3, :3], poses[part.link][:, None, :3, 3]
        ends = np.array([part.capsule.start, part.capsule.end])
        found.append((part.link, np.einsum("nij,kj->nki", R, ends) + p, part.capsule.radius))
    return found, poses[design.robot.links[-1].name][:, :3, 3]


def set_scene(ax: Axes, bodies: list[tuple[str, Values, float]]) -> float:
    """Make a panel as large as the robot's motion, and draw the floor; points per metre."""
    ax.set_axis_off()
    reach = max(float(np.linalg.norm(ends[..., :2], axis=-1).max()) for _, ends, _ in bodies)
    half = 0.65 * reach
    corners = np.array([[x, y, 0.0] for x in (-half, half) for y in (-half, half)])
    places = np.concatenate([seen(corners)[0], *(seen(ends)[0].reshape(-1, 2) for _, ends, _ in bodies)])
    (left, low), (right, high) = places.min(axis=0) - 0.08 * reach, places.max(axis=0) + 0.08 * reach
    ax.set(xlim=(left, right), ylim=(low, high), aspect="equal")
    ax.figure.canvas.draw()  # places the panel
    for at in np.linspace(-half, half, 9):
        for line in ([[at, -half, 0], [at, half, 0]], [[-half, at, 0], [half, at, 0]]):
            ax.plot(*seen(np.array(line))[0].T, color="#DDDDDD", linewidth=0.7, zorder=1)
    return float(np.ptp(ax.transData.transform([(0, 0), (1, 0)])[:, 0]) * 72 / ax.figure.dpi)


def draw_arm(ax: Axes, bodies: list[tuple[str, Values, float]], k: int, dots: float, solid: float = 1.0) -> None:
    """Capsules of the links at an instant, from far to near."""
    links = list(dict.fromkeys(link for link, _, _ in bodies))
    for link, ends, radius in sorted(bodies, key=lambda each: seen(each[1][k])[1].mean()):
        width = 2 * radius * dots
        edge = [Stroke(linewidth=width + 1.6, foreground="white"), Normal()]
        ax.plot(
            *seen(ends[k])[0].T,
            color=LINKS[min(links.index(link), len(LINKS) - 1)],
            linewidth=width,
            alpha=solid,
            solid_capstyle="round",
            path_effects=edge if solid == 1.0 else None,
            zorder=3 if solid == 1.0 else 2,
        )


def moving_picture(design: excite.Design) -> list[Image.Image]:
    """Frames of the motion in real time."""
    motion, target = design.trajectory, design.target
    samples = motion.samples(np.arange(round(motion.duration * FRAMES_PER_S) + 1) / FRAMES_PER_S)
    bodies, tip = bodies_of(design, samples.q)
    drives = design.moving.transmission
    share = 100 * samples.dq @ drives.coupling.T / drives.limits.velocity
    rows = target.model.selected(samples, target.base.index)
    each = len(rows) // samples.time.size
    condition = np.array([np.linalg.cond(rows[: each * k]) for k in range(1, samples.time.size + 1)])
    return [_frame(bodies, tip, samples.time, share, condition, k) for k in range(samples.time.size)]


def _frame(
    bodies: list[tuple[str, Values, float]], tip: Values, time: Values, share: Values, condition: Values, k: int
) -> Image.Image:
    figure = Figure(figsize=(8.6, 3.9), dpi=DOTS, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    arm = figure.add_axes((0.0, 0.0, 0.46, 1.0))
    dots = set_scene(arm, bodies)
    arm.plot(*seen(tip[: k + 1])[0].T, color=COLOURS[1], linewidth=1.4, zorder=2)
    draw_arm(arm, bodies, k, dots)
    top, bottom = figure.add_axes((0.56, 0.58, 0.42, 0.33)), figure.add_axes((0.56, 0.13, 0.42, 0.31))
    tidy(top, "velocity of each drive [% of its limit]")
    for column, colour in zip(share.T[:3], COLOURS, strict=True):
        top.plot(time, column, color=colour, linewidth=0.7, alpha=0.45)
        top.plot(time[: k + 1], column[: k + 1], color=colour, linewidth=1.8)
        top.plot(time[k], column[k], "o", color=colour, markersize=4)
    top.set(xlim=(0, time[-1]), ylim=(-112, 112), yticks=(-100, 0, 100))
    tidy(bottom, "cond W of what was played" + (f": {condition[k]:.0f}" if condition[k] < 1e5 else ""))
    bottom.semilogy(time[: k + 1], condition[: k + 1], color=DARK, linewidth=1.8)
    bottom.set(xlim=(0, time[-1]), ylim=(10, 1e5))
    bottom.set_xlabel("time [s]", fontsize=8, color=DARK)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def save_moving(frames: list[Image.Image], out: Path) -> None:
    """One file with the colours of all frames, the last of which stays for two seconds."""
    palette = frames[len(frames) // 2].quantize(SHADES, dither=Image.Dither.NONE)
    colours = np.reshape(palette.getpalette(), (-1, 3))
    colours[colours.min(axis=1) > 245] = 255  # the background is the white of the page
    palette.putpalette(colours.ravel().tolist())
    few = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    last = [1000 // FRAMES_PER_S] * (len(few) - 1) + [2000]
    beside = out.with_name(f".{out.name}")
    few[0].save(beside, "GIF", save_all=True, append_images=few[1:], duration=last, loop=0, optimize=True)
    beside.replace(out)


def draw_still(design: excite.Design) -> Figure:
    """The motion, and what a log of it identifies."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained", facecolor="white")
    left, right = figure.subfigures(1, 2, width_ratios=(1.15, 1.0))
    axes = list(left.subplots(3, 1, sharex=True))
    for ax, title in zip(axes, ("the designed motion", "", ""), strict=True):
        tidy(ax, title)
    panel = right.subplots()
    tidy(panel, f"identified from one simulated log; cond W = {design.condition_number:.1f}")
    draw_motion(axes, design)
    draw_parameters(panel, design)
    return figure


def main() -> None:
    """Design, simulate, identify and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--moving", type=Path)
    given = parser.parse_args()
    design = excite.design_trajectory("irp6", search=excite.Search(seed=0))
    if given.moving:
        save_moving(moving_picture(design), given.moving)
    if given.out:
        draw_still(design).savefig(given.out, dpi=130)


if __name__ == "__main__":
    main()
