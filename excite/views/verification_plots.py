"""Verification of a result on another log: torques and motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from excite.simulation.replay import Replay
from excite.verification.verification import Verification
from excite.verification.verify_servos import ServoVerification
from excite.views.identification_plots import MEASURED, PREDICTED, fit_figure, relative_error
from excite.views.panels import BINS, Panel, Timeline, ends, extremes, head, legend_below, panels, value_axis
from excite.views.style import DARK, PURPLE, SKY, VERMILLION, significant
from regressors.errors import InputError
from regressors.samples import Array

_DOT = 2.2  # [pt]
_NUMBERS = 8  # on an axis of time
_NAME_LENGTH = 50


def predicted_torques_figure(verification: Verification) -> Figure:
    """Draw measured and predicted torques over time with their difference [KD96] Fig. 16."""
    v = verification
    title = f"{_name(v)}: predicted within {relative_error(v.measured, v.predicted)} over all equations"
    if v.training_error is not None:
        title += f" (training logs: {significant(100 * v.training_error, 3)} %)"
    log = np.zeros(v.time.size, dtype=np.intp)
    rows = [(v.time, log, measured, predicted) for measured, predicted in zip(v.measured.T, v.predicted.T, strict=True)]
    return fit_figure(title, [""], v.equations, rows, "predicted")


def simulated_motion_figure(verification: Verification) -> Figure:
    """Draw positions simulated from the measured torques, and measured ones [KD96] Fig. 17."""
    replay, samples = verification.replay, verification.motion
    if replay is None:
        raise InputError("no motion was simulated: the model has no torque equation for every moving joint")
    joints, errors = samples.joints, verification.motions
    title = f"{_name(verification)}: motion simulated from the measured torques"
    figure, rows = panels(len(joints), Panel((6.8, 3.8), 1.4 if len(joints) > 1 else 3.0, left=0.95), title)
    difference, whole = replay.q - samples.q, ((0, samples.time.size),)
    failed = "" if replay.failed_at is None else f"failed at {replay.failed_at:.3f} s: {replay.outcome.value}"
    for j, (name, (over, beside)) in enumerate(zip(joints, rows, strict=True)):
        bottom, unit = j == len(joints) - 1, "rad or m" if errors is None else errors[j].unit
        _draw(over, samples.time, samples.q[:, j], whole, bottom, **MEASURED)
        _draw(over, replay.time, replay.q[:, j], replay.bounds, bottom, **PREDICTED)
        beside.axhline(0.0, color=DARK, linewidth=0.6)
        _draw(beside, replay.time, difference[:, j], replay.bounds, bottom, color=VERMILLION, linewidth=0.9)
        for ax, values in ((over, replay.q[:, j]), (beside, difference[:, j])):
            ax.plot(replay.time[[*replay.starts]], values[[*replay.starts]], "o", color=DARK, markersize=_DOT, zorder=3)
            if replay.failed_at is not None:
                ax.axvline(replay.failed_at, color=PURPLE, linewidth=1.2)
        value_axis(over, f"position [{unit}]")
        value_axis(beside, f"difference [{unit}]")
        head(over, name, failed if j == 0 else "", VERMILLION)
        if errors is not None:
            e = errors[j]
            rms, travel, relative = (significant(x, 3) for x in (e.error, e.travel, 100 * e.relative))
            head(beside, "", f"rms {rms} {unit} of {travel} {unit} travelled: {relative} %")
    legend_below(figure, _motion_legend(replay))
    return figure


def servo_motion_figure(verification: ServoVerification) -> Figure:
    """Draw commanded, measured and predicted positions of every servo, and the difference of the last two."""
    v = verification
    title = f"{ends(PurePath(v.log.file).name, _NAME_LENGTH)}: motion predicted from the commands alone"
    figure, rows = panels(len(v.fits), Panel((6.8, 3.8), 1.4 if len(v.fits) > 1 else 3.0, left=0.95), title)
    whole, command = ((0, v.time.size),), {"color": SKY, "linewidth": 0.9}
    for j, (fit, (over, beside)) in enumerate(zip(v.fits, rows, strict=True)):
        bottom = j == len(rows) - 1
        for values, style in ((v.command, command), (v.measured, MEASURED), (v.predicted, PREDICTED)):
            _draw(over, v.time, values[:, j], whole, bottom, **style)
        beside.axhline(0.0, color=DARK, linewidth=0.6)
        _draw(beside, v.time, v.predicted[:, j] - v.measured[:, j], whole, bottom, color=VERMILLION, linewidth=0.9)
        value_axis(over, f"position [{fit.unit}]")
        value_axis(beside, f"difference [{fit.unit}]")
        head(over, fit.joint)
        head(beside, "", f"{1e3 * fit.position_error:.2g} m{fit.unit}, rms")
    named = (("commanded", command), ("measured", MEASURED), ("predicted", PREDICTED))
    legend_below(figure, [Line2D([], [], label=label, **style) for label, style in named])
    return figure


def _draw(ax: Axes, time: Array, values: Array, windows: Sequence[tuple[int, int]], bottom: bool, **style: Any) -> None:
    """Draw a curve with a gap before every restart; long ones by their extremes."""
    timeline = Timeline.of([""], time, np.zeros(time.size, dtype=np.intp))
    drawn = [first + extremes(values[first:stop], max(1, BINS // len(windows))) for first, stop in windows]
    again = np.cumsum([part.size for part in drawn[:-1]], dtype=np.intp)
    kept = np.concatenate(drawn)
    after = time[[first for first, _ in windows[1:]]]
    ax.plot(np.insert(time[kept], again, after), np.insert(values[kept], again, np.nan), **style)
    timeline.dress(ax, bottom=bottom, numbers=_NUMBERS)


def _motion_legend(replay: Replay) -> list[Line2D]:
    first, stop = replay.bounds[0]
    window = replay.time[stop] - replay.time[first] if stop < replay.time.size else None
    how = "every {} s where it is simulated" if replay.left_out else "anew every {} s"
    anew = "starts at the measured state" + ("" if window is None else f", {how.format(significant(window, 2))}")
    handles = [
        Line2D([], [], **MEASURED, label="measured"),
        Line2D([], [], **PREDICTED, label="simulated"),
        Line2D([], [], color=VERMILLION, linewidth=0.9, label="simulated less measured"),
        Line2D([], [], color=DARK, marker="o", markersize=_DOT, linestyle="", label=anew),
    ]
    if replay.failed_at is not None:
        handles.append(Line2D([], [], color=PURPLE, linewidth=1.2, label="failed"))
    return handles


def _name(verification: Verification) -> str:
    return ends(PurePath(verification.log.file).name, _NAME_LENGTH)
