"""Draw the figures of docs/paper.md: ``python docs/draw_paper.py [NAME ...]``, without a name all of them.

They show what the figures and tables of Kozlowski and Dutkiewicz (1996) show, from results of our own benchmarks. The
numbers that the paper prints stand beside them; its curves, which are pictures only, do not.
"""

from __future__ import annotations

import argparse
import io
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from fill_numbers import PRINTED_BREAK_AWAY, PRINTED_CONDITIONS, result
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from excite.views.style import (
    BLUE,
    COLOURS,
    DARK,
    FORBIDDEN,
    GREEN,
    GREY,
    LABEL,
    NOTE,
    VERMILLION,
    drawing_style,
    figure_of,
    log_scale,
    significant,
)

OUT = Path(__file__).resolve().parent / "figures"
OF_FIGURES = "identification/results/paper_figures"
WIDTH = 7.4  # in
_PLACES = re.compile(r' (?:d|x|y)="[^"]*"')  # of lines and marks, not of text
LIMITS = {"position": (-0.69813, 0.69813), "velocity": 1.137, "acceleration": 1.89}  # of joint and drive 2, irp6.yaml


def panel(ax: Axes, title: str, horizontal: str, vertical: str) -> Axes:
    """A panel with its names."""
    ax.set_title(title, loc="left", fontsize=LABEL, color=DARK)
    ax.set_xlabel(horizontal, fontsize=NOTE, color=DARK)
    ax.set_ylabel(vertical, fontsize=NOTE, color=DARK)
    return ax


def numbers(values: Sequence[float | None]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """A curve with gaps where there is no value yet."""
    return np.array([np.nan if value is None else value for value in values])


def lines_below(figure: Figure, ax: Axes, columns: int) -> None:
    """One legend for all panels, below them."""
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=columns, fontsize=NOTE)


def friction() -> Figure:
    """Figs. 2 to 4: friction over velocity of the three joints."""
    content = result(f"{OF_FIGURES}/friction")
    figure = figure_of(WIDTH, 3.1, "")
    panels = figure.subplots(1, 3, sharey=True)
    for number, (ax, drive) in enumerate(zip(panels, PRINTED_BREAK_AWAY, strict=True), 1):
        found = content[drive]
        panel(
            ax, f"Fig. {number + 1}: joint {number}", "velocity [rad/s]", "friction torque [Nm]" if number == 1 else ""
        )
        speeds, fitted = np.array(found["speeds"]), np.array(found["fitted"][0])
        for side in (speeds < 0, speeds > 0):
            ax.plot(speeds[side], fitted[side], color=BLUE, label="fitted curve" if speeds[side][0] > 0 else None)
        runs = np.array([point[:2] for point in found["points"]])
        ax.plot(*runs.T, "o", color=VERMILLION, markersize=3, label="mean torque of a run")
        ax.plot([0, 0], PRINTED_BREAK_AWAY[drive], "D", color=DARK, markersize=4, label="break-away torque, printed")
    lines_below(figure, panels[0], 3)
    return figure


def temperature() -> Figure:
    """Fig. 2: friction of the first joint, by temperature."""
    content = result(f"{OF_FIGURES}/temperature")
    figure = figure_of(WIDTH, 3.4, "")
    curve, over = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    panel(curve, "Fig. 2: joint 1", "velocity [rad/s]", "friction torque [Nm]")
    speeds, shades = np.array(content["speeds"]), matplotlib.colormaps["plasma"](np.linspace(0.05, 0.8, 6))
    points = np.array(content["points"])
    for at, fitted, colour in zip(content["temperatures"], content["fitted"], shades, strict=True):
        for side in (speeds < 0, speeds > 0):
            label = f"{at:.0f} °C" if speeds[side][0] > 0 else None
            curve.plot(speeds[side], np.array(fitted)[side], color=colour, label=label)
        if at in (content["temperatures"][0], content["temperatures"][-1]):
            curve.plot(*points[points[:, 2] == at, :2].T, "o", color=colour, markersize=2.5)
    curve.legend(fontsize=NOTE, loc="upper left")
    panel(over, "at three speeds", "temperature [°C]", "friction torque [Nm]")
    fastest = points[:, 0].max()
    for share, colour in zip((0.05, 0.5, 1.0), (GREEN, BLUE, VERMILLION), strict=True):
        near = np.abs(points[:, 0] / fastest - share) < 0.01
        place = int(np.argmin(np.abs(speeds - share * fastest)))
        over.plot(content["temperatures"], np.array(content["fitted"])[:, place], color=colour)
        over.plot(
            points[near, 2], points[near, 1], "o", color=colour, markersize=3.5, label=f"{share * fastest:.2f} rad/s"
        )
    over.legend(fontsize=NOTE, loc="upper right")
    over.set_ylim(0, 52)
    return figure


def figure_5() -> Figure:
    """Fig. 5: the first link's mass parameter over time."""
    content = result(f"{OF_FIGURES}/figure-5")
    figure = figure_of(WIDTH, 2.9, "")
    ax = panel(figure.subplots(), "Fig. 5: joint 1 alone, energy model, windows of 5 ms", "time [s]", "X1 [kg m²]")
    said = {"all at once": "friction identified along", "separate": "friction measured before"}
    for (way, words), colour in zip(said.items(), (VERMILLION, BLUE), strict=True):
        paths = np.array([numbers(path) for path in content["estimates"][way]])
        for number, path in enumerate(paths):
            ax.plot(content["time"], path, color=colour, linewidth=0.8, alpha=0.7, label=None if number else words)
    ax.axhline(content["true"], color=DARK, linewidth=0.9, linestyle="--", label="true value")
    ax.set(ylim=(content["true"] - 1.2, content["true"] + 1.2), xlim=(0, content["time"][-1]))
    ax.legend(fontsize=NOTE, loc="lower right")
    return figure


def figure_6() -> Figure:
    """Fig. 6: second joint, differential model, before and after."""
    found = result(f"{OF_FIGURES}/motions")["row of joint 1"]
    figure = figure_of(WIDTH, 2.6, "")
    panels = figure.subplots(1, 3)
    units = ("rad", "rad/s", "rad/s²")
    for ax, key, (what, limit), unit in zip(panels, ("q", "dq2", "ddq2"), LIMITS.items(), units, strict=True):
        panel(ax, f"Fig. 6: {what}", "time [s]", f"joint 2 [{unit}]")
        for which, colour in (("initial", GREY), ("optimal", BLUE)):
            values = np.array(found[which][key])
            ax.plot(found["time"], values[:, 1] if key == "q" else values, color=colour, label=which)
        low, high = limit if isinstance(limit, tuple) else (-limit, limit)
        ax.axhline(low, color=VERMILLION, linewidth=0.9, linestyle="--", label="limit")
        ax.axhline(high, color=VERMILLION, linewidth=0.9, linestyle="--")
    lines_below(figure, panels[0], 3)
    return figure


def _positions(case: str, first: int, columns: int) -> Figure:
    """Initial and optimal positions of every joint."""
    found = result(f"{OF_FIGURES}/motions")[case]
    joints = found["joints"]
    rows = -(-len(joints) // columns)
    figure = figure_of(WIDTH, 2.2 * rows + 0.3, "")
    panels = np.ravel(figure.subplots(rows, columns, sharey=True))
    for number, (ax, joint) in enumerate(zip(panels, joints, strict=False)):
        panel(ax, f"Fig. {first + number}: joint {joint[1:]}", "time [s]", "" if number % columns else "position [rad]")
        for which, colour in (("initial", GREY), ("optimal", BLUE)):
            ax.plot(found["time"], np.array(found[which]["q"])[:, number], color=colour, label=which)
    for ax in panels[len(joints) :]:
        ax.set_axis_off()
    lines_below(figure, panels[0], 2)
    return figure


def figure_7() -> Figure:
    """Figs. 7 to 9: integral model, three joints, before and after."""
    return _positions("energy, drive 2", 7, 3)


def figure_10() -> Figure:
    """Figs. 10 to 14: load, five joints, before and after."""
    return _positions("load, axes 1-5", 10, 3)


def singular_values() -> Figure:
    """Section 5.4: singular values of the regressor, before and after."""
    content = result(f"{OF_FIGURES}/motions")
    said = {
        "row of joint 1": "differential, row of joint 1",
        "axes 1-3": "differential, axes 1-3",
        "energy, drive 2": "energy, drive 2 alone",
        "load, axes 1-5": "load, axes 1-5",
    }
    figure = figure_of(WIDTH, 4.0, "")
    panels = figure.subplots(2, 2)
    for ax, (case, words) in zip(panels.flat, said.items(), strict=True):
        panel(ax, words, "number", "singular value [mixed SI]")
        for which, colour, mark in (("initial", GREY, "s"), ("optimal", BLUE, "o")):
            values = np.array(content[case][which]["singular_values"])
            condition = f"{which}, cond(W) {significant(values[0] / values[-1], 3)}"
            ax.plot(range(1, values.size + 1), values, marker=mark, color=colour, markersize=3.5, label=condition)
        ax.set_xticks(range(1, values.size + 1))
        log_scale(
            ax.yaxis,
            0.5 * min(each.get_ydata().min() for each in ax.lines),
            1.6 * max(each.get_ydata().max() for each in ax.lines),
        )
        ax.legend(fontsize=NOTE, loc="lower left")
    return figure


def conditions() -> Figure:
    """Section 5.4: condition numbers, printed and ours."""
    runs = {run["case"]: run["condition_number"] for run in result("results/paper")["runs"]}
    figure = figure_of(WIDTH, 3.4, "")
    ax = panel(figure.subplots(), "", "cond(W), logarithmic", "")
    marks = (("paper, before", "s", GREY), ("paper, after", "D", VERMILLION), ("ours, within all limits", "o", BLUE))
    for row, (case, printed) in enumerate(PRINTED_CONDITIONS.items()):
        texts = [re.match(r"[\d.e]+", text) for text in printed]
        values = [None if text is None else float(text[0]) for text in texts] + [runs[case]]
        known = [value for value in values if value is not None]
        ax.plot([min(known), max(known)], [row, row], color="#DDDDDD", linewidth=2, zorder=1)
        for value, (label, mark, colour) in zip(values, marks, strict=True):
            if value is not None:
                ax.plot(value, row, mark, color=colour, markersize=6, label=label if row == 0 else None)
        if texts[1] is None:
            ax.annotate(f"paper: {printed[1]}", (runs[case], row), (8, -3), textcoords="offset points", fontsize=NOTE)
    ax.set_yticks(range(len(PRINTED_CONDITIONS)), list(PRINTED_CONDITIONS), fontsize=NOTE)
    ax.invert_yaxis()
    log_scale(ax.xaxis, 1.0, 1e15)
    ax.legend(fontsize=NOTE, loc="lower right")
    return figure


def table_1() -> Figure:
    """Table I: parameters of the load."""
    content = result("identification/results/load_table1")
    truth, names, motions = content["truth"], content["names"], content["accuracy"]["motions"]
    figure = figure_of(WIDTH, 3.3, "")
    panels = figure.subplots(1, 2, width_ratios=(3, 6))
    ours = {"paper's": ("ours, the paper's motion", GREEN), "designed": ("ours, designed motion", BLUE)}
    for ax, part, title in (
        (panels[0], range(1, 4), "first moments [kg m]"),
        (panels[1], range(4, 10), "inertia [kg m²]"),
    ):
        panel(ax, title, "", "value and standard deviation")
        place = np.arange(len(part))
        printed = np.array([(truth["printed"][k], truth["printed_estimates"][k - 1]) for k in part])
        deviation = [truth["printed_deviations"][k - 1] for k in part]
        style: Mapping[str, Any] = {"markersize": 4, "capsize": 2.5, "elinewidth": 1.1}
        ax.plot(place - 0.27, printed[:, 0], "_", color=DARK, markersize=9, label="paper, computed")
        ax.errorbar(
            place - 0.09, printed[:, 1], deviation, fmt="D", color=VERMILLION, label="paper, estimated", **style
        )
        for shift, (motion, (label, colour)) in zip((0.09, 0.27), ours.items(), strict=True):
            values = [truth["parameters"][k] for k in part]
            spread = [motions[motion]["weighted"][k] for k in part]
            ax.errorbar(place + shift, values, spread, fmt="o", color=colour, label=label, **style)
        ax.set_xticks(place, [names[k] for k in part])
        ax.axhline(0, color=GREY, linewidth=0.7)
    lines_below(figure, panels[0], 4)
    return figure


def figure_15() -> Figure:
    """Fig. 15: estimates over time, optimal and not."""
    courses = result("identification/results/figure_15")["courses"]
    figure = figure_of(WIDTH, 2.9, "")
    panels = figure.subplots(1, 3)
    said = {"designed": "designed", "quintic.csv": "polynomial, fast", "slow-quintic.csv": "polynomial, slow"}
    for letter, k, ax in zip("abc", range(3), panels, strict=True):
        first = courses["designed"]
        panel(
            ax,
            f"Fig. 15{letter}: {first['names'][k]}",
            "time [s]",
            f"estimate [{first['units'][k].replace('^2', '²')}]",
        )
        true = first["true"][k]
        for (name, words), colour in zip(said.items(), COLOURS, strict=False):
            course = courses[name]
            time, values, spread = (
                numbers(x)[::2] for x in (course["time"], course["values"][k], course["scatter"][k])
            )
            ax.fill_between(time, values - spread, values + spread, color=colour, alpha=0.2, linewidth=0)
            ax.plot(time, values, color=colour, label=words, linewidth=1.1)
        ax.axhline(true, color=DARK, linewidth=0.9, linestyle="--", label="true value")
        ax.set_ylim(0.85 * true, 1.15 * true)
    lines_below(figure, panels[0], 4)
    return figure


def verification() -> Figure:
    """Figs. 16 and 17: torques of the third joint, positions of the first."""
    content = result(f"{OF_FIGURES}/verification")
    figure = figure_of(WIDTH, 4.2, "")
    top, bottom = figure.subplots(2, 1)
    panel(
        top,
        f"Fig. 16: joint 3, error {100 * content['relative'][2]:.1f} % of what was measured",
        "time [s]",
        "torque [Nm]",
    )
    top.plot(content["time"], content["measured"], color=GREY, linewidth=1.0, label="measured")
    top.plot(content["time"], content["predicted"], color=BLUE, linewidth=1.1, label="predicted")
    error = 1e3 * content["rms_position"][0]
    title = f"Fig. 17: joint 1, rms error {error:.2g} mrad; restarted every {content['horizon']:g} s"
    panel(bottom, title, "time [s]", "position [rad]")
    bottom.plot(content["motion_time"], content["position"], color=GREY, linewidth=2.6, label="measured")
    bottom.plot(content["motion_time"], content["simulated"], color=BLUE, linewidth=1.1, label="simulated")
    for ax in (top, bottom):
        ax.legend(fontsize=NOTE, loc="upper right")
    return figure


def screws() -> Figure:
    """Section 5.1: gear ratios of the ball screws."""
    import casadi as ca

    import excite

    robot, z = excite.load_robot("irp6-full"), ca.SX.sym("z")
    joints, drives = robot.limits, robot.transmission.limits
    figure = figure_of(WIDTH, 2.5, "")
    ax = panel(figure.subplots(), "", "drive coordinate [rad]", "gear ratio")
    ax.axhspan(165, 170, color=FORBIDDEN, linewidth=0, label="paper: 165 to 170")
    for k, limits, label, colour in ((1, joints, "z2 = q2", BLUE), (2, drives, "z3 = q2 + q3", GREEN)):
        at = np.linspace(limits.lower[k], limits.upper[k], 101)
        ratio = ca.Function("ratio", [z], [robot.transmission.drives[k].ratio.ratio(z)])
        ax.plot(at, [abs(float(ratio(each))) for each in at], color=colour, label=f"{label}, published geometry")
    ax.legend(fontsize=NOTE, loc="lower center")
    return figure


FIGURES: Mapping[str, Callable[[], Figure]] = {
    "screws": screws,
    "conditions": conditions,
    "singular-values": singular_values,
    "figure-6": figure_6,
    "figures-7-9": figure_7,
    "figures-10-14": figure_10,
    "friction": friction,
    "temperature": temperature,
    "figure-5": figure_5,
    "table-1": table_1,
    "figure-15": figure_15,
    "figures-16-17": verification,
}


def svg(figure: Figure) -> str:
    """The figure as a file that is the same every time, with hundredths of a point."""
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    short = _PLACES.sub(lambda places: re.sub(r"(?<=\.\d\d)\d+", "", places[0]), file.getvalue())
    return re.sub(r"\n\s+", "\n", re.sub(r"<!--.*?-->", "", short, flags=re.DOTALL))


def main() -> None:
    """Draw what is named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(FIGURES))
    OUT.mkdir(exist_ok=True)
    for name in parser.parse_args().names or FIGURES:
        with drawing_style("screen"):
            text = svg(FIGURES[name]())
        beside = OUT / f".paper-{name}.tmp"
        beside.write_text(text, encoding="utf-8")
        beside.replace(OUT / f"paper-{name}.svg")
        print(f"paper-{name}.svg: {len(text) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
