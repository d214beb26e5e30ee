"""Views and figures of plans, campaigns, verifications, studies and repetitions: terminal and page say the same."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.stats
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from reported import ParsedPage, misplaced
from written_results import plan, verification

import excite
from excite.cli.summary import print_verdict, print_view
from excite.design.friction_runs.friction_plan import FrictionPlan
from excite.design.friction_runs.plan_friction import plan_friction
from excite.design.friction_runs.schedule import Schedule
from excite.design.sweeps.sweep_table import BROKEN, DESIGNED, CellFacts, SweepRow, SweepTable
from excite.study.repetitions import Repetitions
from excite.study.time_study import TimeCourse, TimeStudy
from excite.verification.verification import MeasuredMotion
from excite.views.campaign_view import campaign_view, cells_view, leading_cells
from excite.views.experiment_views import study_view
from excite.views.friction_plots import friction_plan_figure
from excite.views.friction_views import friction_plan_view
from excite.views.page_text import _cells
from excite.views.parameters_plot import DOTS, repetitions_figure
from excite.views.style import BAND, BLUE, DARK, GREEN, VERMILLION
from excite.views.verification_view import verification_view
from excite.views.view import Column, Format, View, ViewTable
from excite.views.write_report import report_text
from regressors.readers.library import built_in

# Views of friction plans and campaigns: terminal and page say the same.


FACTS = CellFacts(
    robot="irp6", model="differential", parameters=13, duration=2.0, criterion=3.0, limit_use=0.5,
    tightest_limit="joint q1 velocity",
)  # fmt: skip
ROWS = (
    SweepRow("a", {"seed": "0"}, DESIGNED, 1, {"condition_number": 7.0}, FACTS),
    SweepRow("b", {"seed": "1"}, BROKEN, 1, {"condition_number": 5.0}, replace(FACTS, limit_use=1.5)),
    SweepRow("c", {"seed": "2"}, "infeasible", reason="no motion"),
)
SUBJECTS = {
    "verification": (lambda: verification("old"), verification_view),
    "friction plan": (lambda: plan("old"), friction_plan_view),
    "cells": (lambda: SweepTable(ROWS), cells_view),
    "campaign": (lambda: excite.plan_campaign("irp6"), campaign_view),
}


def subject(name: str) -> tuple[Any, View]:
    make, view = SUBJECTS[name]
    made = make()
    return made, view(made)


@pytest.mark.parametrize("name", SUBJECTS)
def test_every_number_of_the_tables_is_on_the_page(name: str) -> None:
    made, view = subject(name)
    page = ParsedPage(report_text(made))
    for table in view.tables:
        numbers = [k for k, each in enumerate(table.columns) if each.format not in (Format.TEXT, Format.UNIT)]
        expected = [[row[k] for k in numbers if row[k] is not None and math.isfinite(row[k])] for row in table.rows]
        assert page.numbers(table.name) == expected, table.name


def test_unknown_numbers_stand_in_columns_of_numbers() -> None:
    columns = (Column("joint", Format.TEXT), Column("limit"), Column("share", Format.PERCENT))
    headings, rows = _cells(ViewTable("limits", "Limits", columns, (("q1", math.inf, 0.5), ("q2", math.inf, None))))
    assert headings == [("joint", False), ("limit", True), ("share", True)]
    assert [[state for *_, state in row] for row in rows] == [["", "missing", ""], ["", "missing", "missing"]]


@pytest.mark.parametrize("name", SUBJECTS)
def test_the_terminal_has_the_same_tables(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "250")
    view = subject(name)[1]
    print_verdict(view)
    print_view(view)
    printed = capsys.readouterr().out
    assert view.verdict in printed
    for table in (each for each in view.tables if not each.folded):
        assert table.title in printed
        for row in table.rows:
            assert str(row[0]) in printed


def test_a_summary_of_cells_begins_with_the_best() -> None:
    leading = leading_cells(SweepTable(ROWS)).brief
    assert [column.heading for column in leading.columns][:3] == ["seed", "status", "group"]
    assert [row[:4] for row in leading.rows] == [("1", BROKEN, 1, 5.0), ("0", DESIGNED, 1, 7.0)]


def test_a_plan_that_breaks_limits_does_not_hold() -> None:
    made = plan("old")
    (c,) = made.coordinates
    use = replace(c.limits[0], margin=-1.0)
    broken = friction_plan_view(replace(made, coordinates=(replace(c, limits=(use, *c.limits[1:])),)))
    assert not broken.holds
    assert f"It breaks 1 limit: {use.label}." in broken.verdict
    assert any(f"{use.label} does not hold" in remark for remark in broken.remarks)


# The view of a verification: terminal, page and file say the same.


def test_without_curves_nothing_is_drawn() -> None:
    v = verification("old")
    without = dataclasses.replace(v, time=np.zeros(0), motion=MeasuredMotion(), replay=None)
    assert verification_view(without).figures == ()
    assert len(verification_view(v).figures) == 2


# The view of a study: what has no size or no value is named.


@pytest.fixture
def course() -> TimeCourse:
    """One parameter known within 10 %, one that is zero, one that is not identified."""
    one = np.ones((2, 3))
    values, deviation = one * [1.0, 0.0, np.nan], one * [0.1, 0.2, np.inf]
    known = np.array([1.0, 0.0, 1.0])
    names, unknown = ("a", "b", "c"), np.full(2, np.inf)
    return TimeCourse("log", names, ("kg",) * 3, np.arange(2.0), values, deviation, 2.6, unknown, known, "truth")


def test_the_worst_parameter_is_named(course: TimeCourse) -> None:
    for kept, said in (([0], "a, 10 %"), ([0, 1], "b, 0.2 kg of zero"), ([0, 2], "c, not identified")):
        names, units = tuple(course.names[k] for k in kept), course.units[: len(kept)]
        columns = {name: getattr(course, name)[..., kept] for name in ("values", "deviation", "reference")}
        some = dataclasses.replace(course, names=names, units=units, **columns)
        assert study_view(TimeStudy("arm", "", (some,), 0.05)).tables[0].rows[0][-1] == said


def test_terminal_and_page_say_what_never_happens(course: TimeCourse, capsys: pytest.CaptureFixture[str]) -> None:
    study = TimeStudy("arm", "", (course,), 0.05)
    print_view(study_view(study))
    printed = capsys.readouterr().out
    page = "".join(ParsedPage(report_text(study)).of("main")[0].text)
    for text in (printed, page):
        assert "rank too low" in text
        assert "never" in text
        assert " nan" not in text


def test_without_a_deviation_nothing_is_said_of_scatter(course: TimeCourse) -> None:
    repeated = course.with_repetitions(np.ones((2, 2, 3)), ())
    without = dataclasses.replace(repeated, deviation=np.full((2, 3), np.inf))
    assert study_view(TimeStudy("arm", "", (without,), 0.05)).remarks == ()
    assert "2 repetitions scatter by" in study_view(TimeStudy("arm", "", (repeated,), 0.05)).remarks[0]


def test_the_soonest_motion_is_named(course: TimeCourse) -> None:
    known = dataclasses.replace(course, deviation=np.full((2, 3), 1e-3), values=np.ones((2, 3)))
    good = dataclasses.replace(known, name="good", reference=np.ones(3))
    view = study_view(TimeStudy("arm", "", (course, good), 0.05))
    assert view.verdict == "good determines every parameter to 5 % soonest, after 0 s"
    view = study_view(TimeStudy("arm", "", (course,), 0.05))
    assert (view.holds, view.verdict[:54]) == (False, "No motion determines every parameter to 5 %; log leave")


# Figure of a friction plan: break-away tests and ramps of torque are drawn as planned, on scales of their own.


SHORT = Schedule(percent=(50.0,), warm_up=4.0, breakaways=2, creeping=2.0, rate=200.0, pause=1.3, ramping=2.5)
COLUMNS = 4


@cache
def friction_plan() -> FrictionPlan:
    return plan_friction(built_in("irp6"), SHORT, drives=("1", "3"))


@cache
def figure() -> Figure:
    return friction_plan_figure(friction_plan())


def curve(ax: Axes, colour: str) -> np.ndarray:
    (line,) = [line for line in ax.lines if line.get_color() == colour]
    return np.asarray(line.get_xydata())


@pytest.mark.parametrize("k", [0, 1])
def test_break_away_tests_fill_their_panel(k: int) -> None:
    c, ax = friction_plan().coordinates[k], figure().axes[COLUMNS * k + 2]
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
    c, ax = friction_plan().coordinates[k], figure().axes[COLUMNS * k + 3]
    drawn = curve(ax, DARK)
    samples, torque, segments = c.ramps.samples(c.place.pose)
    inside = np.array([segment != "rest" for segment in segments])
    inside[1:-1] &= inside[2:] & inside[:-2]  # the torque falls at once at the end of a ramp
    np.testing.assert_allclose(np.interp(samples.time[inside], *drawn.T), torque[inside], rtol=0, atol=1e-9)
    assert np.abs(drawn[:, 1]).max() == pytest.approx(c.ramps.largest)
    assert ax.get_ylabel() == "torque [Nm]"


def test_texts_stay_inside_and_apart() -> None:
    assert misplaced(figure()) == []


# Figure of repetitions: errors over predicted half-widths, and the shares that their intervals contain.


B, DEGREES = 5, 300
NAMES = tuple(f"a_long_$name$_of_parameter_{k}" for k in range(B))


def repetitions(count: int, wrong: float = 1.0) -> Repetitions:
    """Normal estimates with deviations of 1 to 5; the last prediction is wrong by a factor."""
    rng, sigma = np.random.default_rng(1), np.arange(1.0, B + 1.0)
    beta = np.array([10.0, 0.0, -3.0, 1e-6, 2.0])
    predicted = np.tile(sigma * np.append(np.ones(B - 1), wrong), (count, 1))
    estimates = beta + sigma * rng.standard_normal((count, B))
    units = ("kg m^2", "kg m", "Nm", "Nm s/rad", "N")
    return Repetitions(NAMES, units, beta, estimates, predicted, np.ones((count, 3)), DEGREES, 7)


def dots(figure: Figure) -> list[np.ndarray]:
    return [np.asarray(line.get_xdata()) for line in figure.axes[0].lines if line.get_color() == BLUE]


@pytest.mark.parametrize("count", [2, 50, DOTS + 100])
def test_dots_are_errors_over_predicted_half_widths(count: int) -> None:
    r = repetitions(count)
    figure = repetitions_figure(r, "robot $x$")
    (ax,) = figure.axes
    half = scipy.stats.t.ppf(0.995, DEGREES) * np.arange(1.0, B + 1.0)
    expected = (r.estimates - r.beta) / half
    for drawn, own in zip(dots(figure), expected.T, strict=True):
        np.testing.assert_allclose(drawn, own[:DOTS], rtol=1e-12)
    thick = [line for line in ax.lines if line.get_color() == DARK and line.get_linewidth() > 1.3]
    lines = [line.get_xdata() for line in thick if np.size(line.get_xdata()) == 2]
    for drawn, own in zip(lines, expected.T, strict=True):
        np.testing.assert_allclose(drawn, np.percentile(own, [0.5, 99.5]))
    (band,) = [p for p in ax.patches if p.get_facecolor() == to_rgba(BAND)]
    assert (band.get_x(), band.get_width()) == (-1.0, 2.0)


def test_intervals_that_are_too_narrow_are_marked() -> None:
    def marked(r: Repetitions) -> list[str]:
        texts = repetitions_figure(r, "robot").axes[0].texts
        return [text.get_text() for text in texts if text.get_color() == VERMILLION]

    wrong = repetitions(300, wrong=0.3)
    assert marked(repetitions(300)) == []
    assert marked(wrong) == [f"{100 * wrong.coverage[-1]:.1f} %"]


def test_far_errors_and_missing_predictions_are_drawn_at_the_edge_or_not() -> None:
    figure = repetitions_figure(repetitions(40, wrong=1e-6), "robot")
    assert figure.axes[0].get_xlim() == (-6.0, 6.0)
    assert all(np.abs(each).max() <= 6.0 for each in dots(figure))
    assert len(dots(repetitions_figure(repetitions(40, wrong=0.0), "robot"))) == B - 1


def test_texts_of_repetitions_stay_inside_and_apart() -> None:
    figure = repetitions_figure(repetitions(30), "robot")
    assert misplaced(figure) == []
    (ax,) = figure.axes
    assert not any(text.get_window_extent().overlaps(ax.bbox) for text in ax.texts)
