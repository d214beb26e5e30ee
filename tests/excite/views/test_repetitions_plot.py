"""Figure of repetitions: errors over predicted half-widths, and the shares that their intervals contain."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import scipy.stats
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from excite.study.repetitions import Repetitions
from excite.views.parameters_plot import DOTS, repetitions_figure
from excite.views.style import BAND, BLUE, DARK, VERMILLION

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
    lines = [
        np.asarray(line.get_xdata()) for line in ax.lines if line.get_color() == DARK and line.get_linewidth() > 1.3
    ]
    for drawn, own in zip([each for each in lines if each.size == 2], expected.T, strict=True):
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


def test_texts_stay_inside_and_apart() -> None:
    figure = repetitions_figure(repetitions(30), "robot")
    figure.draw_without_rendering()
    (ax,) = figure.axes
    texts = [*ax.texts, *ax.get_yticklabels(), *figure.legends[0].get_texts(), *figure.texts]
    boxes = {text: text.get_window_extent() for text in texts if text.get_text()}
    assert all(figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1 for box in boxes.values())
    assert not any(box.overlaps(ax.bbox) for text, box in boxes.items() if text in ax.texts)
    pairs = itertools.combinations(boxes, 2)
    assert [(a.get_text(), b.get_text()) for a, b in pairs if boxes[a].overlaps(boxes[b])] == []
