"""The share of parameters that are precise enough over the robot's time, one panel per case and a line per motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from cases import NAMES, case
from matplotlib.axes import Axes
from robot_time import SHARE

from excite.views.style import (
    BLUE,
    DARK,
    DPI,
    GREEN,
    GREY,
    LABEL,
    NOTE,
    VERMILLION,
    drawing_style,
    figure_of,
    log_scale,
)

ENDS = (8.0, 30_000.0)  # [s]
COLOURS = {"excite": BLUE, "slsqp": VERMILLION, "figaroh": GREEN, "random": GREY}


@drawing_style("screen")
def write(runs: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the runs that did not fail into a PNG."""
    drawing = figure_of(11.0, 4.2, "Parameters whose 99 % interval is within 5 %")
    for ax, name in zip(drawing.subplots(1, len(NAMES), sharey=True), NAMES, strict=True):
        _panel(ax, [run for run in runs if run["case"] == name and "failure" not in run], name)
    drawing.axes[0].set_ylabel("parameters [%]", fontsize=LABEL, color=DARK)
    drawing.axes[0].legend(loc="lower right", fontsize=NOTE)
    beside = path.with_suffix(".tmp")
    drawing.savefig(beside, dpi=DPI, format="png")
    beside.replace(path)


def _panel(ax: Axes, runs: Sequence[dict[str, Any]], name: str) -> None:
    named = set()
    for run in runs:
        widths = np.array(list(run["verdict"]["relative_half_widths_of_one_run"].values()))
        seconds = np.sort(np.maximum(1, np.ceil((widths / SHARE) ** 2))) * case(name).period
        shares = 100 * np.arange(1, len(seconds) + 1) / len(seconds)
        label = None if run["system"] in named else run["system"]
        named.add(run["system"])
        ax.step(seconds, shares, where="post", color=COLOURS[run["system"]], linewidth=1.4, label=label)
        ax.plot(seconds[-1:], shares[-1:], "o", color=COLOURS[run["system"]], markersize=4)
    log_scale(ax.xaxis, *ENDS)
    ax.set_xlabel("robot time [s]", fontsize=LABEL, color=DARK)
    ax.set_title(name, loc="left", fontsize=LABEL, color=DARK)
