"""Figure of a friction plan: break-away tests and ramps of torque are drawn as planned, on scales of their own."""

from __future__ import annotations

import dataclasses
import itertools
from functools import cache

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from excite.friction.plan.friction_plan import FrictionPlan
from excite.friction.plan.plan_friction import plan_friction
from excite.friction.plan.schedule import Schedule
from excite.views.friction_plots import friction_plan_figure
from excite.views.style import DARK, GREEN
from regressors.readers.library import built_in

SHORT = Schedule(percent=(50.0,), warm_up=4.0, breakaways=2, creeping=2.0, rate=200.0, pause=1.3, ramping=2.5)
COLUMNS = 4


@cache
def plan() -> FrictionPlan:
    return plan_friction(built_in("irp6"), SHORT, drives=("1", "3"))


@cache
def figure() -> Figure:
    return friction_plan_figure(plan())


def curve(ax: Axes, colour: str) -> np.ndarray:
    (line,) = [line for line in ax.lines if line.get_color() == colour]
    return np.asarray(line.get_xydata())


@pytest.mark.parametrize("k", [0, 1])
def test_break_away_tests_fill_their_panel(k: int) -> None:
    c, ax = plan().coordinates[k], figure().axes[COLUMNS * k + 2]
    drawn = curve(ax, GREEN)
    samples, segments = c.samples()
    own = [i for i, segment in enumerate(segments) if "stiction" in segment]
    s = 1e3 * (samples.q @ np.linalg.pinv(c.line[:, None])[0] - c.place.pose @ np.linalg.pinv(c.line[:, None])[0])
    way = np.interp(samples.time[own], *drawn.T)
    np.testing.assert_allclose(way, s[own], rtol=0, atol=2e-3 * np.ptp(s[own]))
    bottom, top = ax.get_ylim()
    assert np.ptp(drawn[:, 1]) > 0.7 * (top - bottom)
    assert np.ptp(drawn[:, 0]) > 0.95 * np.ptp(ax.get_xlim())
    assert ax.get_ylabel() == "way [mrad]"
    assert f"{len(c.breakaways)} at " in ax.get_title(loc="right")


@pytest.mark.parametrize("k", [0, 1])
def test_ramps_are_those_of_the_file(k: int) -> None:
    c, ax = plan().coordinates[k], figure().axes[COLUMNS * k + 3]
    assert c.ramps is not None
    drawn = curve(ax, DARK)
    samples, torque, segments = c.ramps.samples(c.place.pose)
    inside = np.array([segment != "rest" for segment in segments])
    inside[1:-1] &= inside[2:] & inside[:-2]  # the torque falls at once at the end of a ramp
    np.testing.assert_allclose(np.interp(samples.time[inside], *drawn.T), torque[inside], rtol=0, atol=1e-9)
    assert np.abs(drawn[:, 1]).max() == pytest.approx(c.ramps.largest)
    assert ax.get_ylabel() == "torque [Nm]"


def test_a_plan_without_tests_and_ramps_has_no_panels_for_them() -> None:
    bare = dataclasses.replace(SHORT, breakaways=0)
    drawn = friction_plan_figure(plan_friction(built_in("irp6"), bare, drives=("1",)))
    assert [ax.get_ylabel() for ax in drawn.axes] == ["position [rad]", "velocity [rad/s]"]


def test_texts_stay_inside_and_apart() -> None:
    drawn = figure()
    drawn.draw_without_rendering()
    texts = [text for ax in drawn.axes for text in (ax._left_title, ax._right_title, ax.yaxis.label)]  # type: ignore[attr-defined]
    boxes = {text: text.get_window_extent() for text in (*texts, *drawn.legends[0].get_texts()) if text.get_text()}
    assert all(drawn.bbox.x0 <= box.x0 < box.x1 <= drawn.bbox.x1 for box in boxes.values())
    pairs = itertools.combinations(boxes, 2)
    assert [(a.get_text(), b.get_text()) for a, b in pairs if boxes[a].overlaps(boxes[b])] == []
