"""The view of a study: what has no size or no value is named."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from reported import ParsedPage

from excite.cli.view_text import print_view
from excite.study.time_study import TimeCourse, TimeStudy
from excite.views.study_view import study_view
from excite.views.write_report import report_text


@pytest.fixture
def course() -> TimeCourse:
    """One parameter known within 10 %, one that is zero, one that is not identified."""
    one = np.ones((2, 3))
    values, deviation = one * [1.0, 0.0, np.nan], one * [0.1, 0.2, np.inf]
    known = np.array([1.0, 0.0, 1.0])
    return TimeCourse(
        "log", ("a", "b", "c"), ("kg",) * 3, np.arange(2.0), values, deviation, 2.6, np.full(2, np.inf), known, "truth"
    )


@pytest.mark.parametrize(
    ("names", "said"), [((0,), "a, 10 %"), ((0, 1), "b, 0.2 kg of zero"), ((0, 2), "c, not identified")]
)
def test_the_worst_parameter_is_named(course: TimeCourse, names: tuple[int, ...], said: str) -> None:
    kept = list(names)
    some = dataclasses.replace(
        course,
        names=tuple(course.names[k] for k in kept),
        values=course.values[:, kept],
        deviation=course.deviation[:, kept],
        reference=course.reference[kept],
    )
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
    view = study_view(
        TimeStudy("arm", "", (course, dataclasses.replace(known, name="good", reference=np.ones(3))), 0.05)
    )
    assert view.verdict == "good determines every parameter to 5 % soonest, after 0 s"
    view = study_view(TimeStudy("arm", "", (course,), 0.05))
    assert (view.holds, view.verdict[:54]) == (False, "No motion determines every parameter to 5 %; fewest ar")
