"""Figure of the study of friction curves: one experiment of each drive as in [KD96] Figs. 2-4, and all coverages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from friction_truth_case import TRUTH
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from excite.friction.friction_fit import Characteristic
from excite.views.style import BLUE, DARK, GREY, LABEL, NOTE, VERMILLION, drawing_style, figure_of
from regressors.samples import Array

ASKED = (97.5, 100.0)  # [%]
MARKS = (("o", VERMILLION, "windows"), ("^", GREY, "break-aways at rest"))


@drawing_style("screen")
def figure(
    one_each: Sequence[Characteristic], alone: Sequence[dict[str, Any]], planned: Sequence[dict[str, Any]]
) -> Figure:
    """Points, curve and band of an experiment with encoder counts, and how often intervals contain the truth.

    Parameters
    ----------
    one_each : sequence of Characteristic
    alone, planned : sequence of dict
        Shares of every drive.
    """
    drawing = figure_of(
        11.0, 9.6, "Friction found by a planned experiment on a simulated IRp-6, and its 99 % intervals"
    )
    curves, misses, shares = drawing.subplots(3, len(one_each), sharey="row", height_ratios=[1.0, 0.8, 1.0])
    for above, below, found in zip(curves, misses, one_each, strict=True):
        _curve(above, found)
        _miss(below, found)
    for ax, found in zip(shares, one_each, strict=True):
        _coverage(ax, *(next(s for s in of if s["drive"] == found.drive and s["encoder"]) for of in (planned, alone)))
    curves[0].set_ylabel("friction torque [Nm]", fontsize=LABEL, color=DARK)
    misses[0].set_ylabel("less the truth [Nm]", fontsize=LABEL, color=DARK)
    for ax, place in ((curves[0], "lower right"), (misses[0], "upper left"), (shares[0], "lower left")):
        ax.legend(loc=place, fontsize=NOTE)
    return drawing


def _curve(ax: Axes, found: Characteristic) -> None:
    """Torques over velocity."""
    for v, torque, _, truth in _sides(found):
        ax.plot(v, torque, color=BLUE, linewidth=1.4, label="fit" if v[0] > 0 else None)
        ax.plot(v, truth, color=DARK, linewidth=1.0, linestyle="--", label="truth" if v[0] > 0 else None)
    for points, (marker, colour, label) in zip((found.points, found.rests), MARKS, strict=True):
        ax.plot([p.speed for p in points], [p.torque for p in points], marker, color=colour, markersize=4.0,
                linestyle="none", label=label)  # fmt: skip
    ax.set_title(f"{found.drive}: one experiment", loc="left", fontsize=LABEL, color=DARK)


def _miss(ax: Axes, found: Characteristic) -> None:
    """The same less the truth, with the band."""
    ax.axhline(0.0, color=DARK, linewidth=0.9, linestyle="--")
    for v, torque, half, truth in _sides(found):
        ax.fill_between(v, torque - half - truth, torque + half - truth, color=BLUE, alpha=0.25, linewidth=0,
                        label="99 % band of the fit" if v[0] > 0 else None)  # fmt: skip
        ax.plot(v, torque - truth, color=BLUE, linewidth=1.2)
    for points, (marker, colour, _) in zip((found.points, found.rests), MARKS, strict=True):
        v = np.array([p.speed if p.speed else np.copysign(1e-12, p.speed) for p in points])
        errors = np.array([p.torque for p in points]) - TRUTH[found.drive].torque(v)
        ax.errorbar(v, errors, [2.576 * p.deviation for p in points], fmt=marker, color=colour, markersize=3.5,
                    elinewidth=0.7)  # fmt: skip
    ax.set_xlabel("velocity of the drive [rad/s]", fontsize=LABEL, color=DARK)


def _sides(found: Characteristic) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Velocities, the fit's torque and half its band, and the true torque, in each direction."""
    assert found.fit is not None
    fastest = max(abs(p.speed) for p in found.points)
    for sign in (1.0, -1.0):
        v = sign * np.geomspace(1e-4 * fastest, fastest, 400)
        yield v, *found.fit.band(v), TRUTH[found.drive].torque(v)


def _coverage(ax: Axes, planned: dict[str, Any], alone: dict[str, Any]) -> None:
    names = planned["parameters"]
    rows = np.arange(len(names))[::-1]
    ax.axvspan(*ASKED, color=GREY, alpha=0.2, linewidth=0, label="99 % +- 1.5 %")
    ax.axvline(99.0, color=GREY, linewidth=0.8)
    ax.plot(alone["within_percent"], rows - 0.15, "s", color=VERMILLION, markersize=4.0, label="windows alone")
    ax.plot(planned["within_percent"], rows + 0.15, "o", color=BLUE, markersize=4.5, label="planned experiment")
    ax.set_yticks(rows, [name.replace(".", " ") for name in names], fontsize=NOTE)
    ax.set_xlim(min(95.0, *planned["within_percent"], *alone["within_percent"]) - 0.3, 100.3)
    ax.set_xlabel("truth within its interval [% of experiments]", fontsize=LABEL, color=DARK)
    ax.set_title(f"{planned['drive']}: parameters, encoder counts", loc="left", fontsize=LABEL, color=DARK)
