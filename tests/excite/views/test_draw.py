"""``excite.draw``: the figures of an object as matplotlib objects, and no file."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import excite

QUICK = excite.Search(starts=1, seed=0, executor="serial")


@pytest.fixture(scope="module")
def design() -> excite.Design:
    return excite.design_trajectory("irp6", trajectory=excite.TrajectoryChoice(harmonics=3, period=4.0), search=QUICK)


@pytest.fixture(scope="module")
def result(design: excite.Design) -> excite.Identification:
    log = excite.simulate(design, rate=100.0, noise=1.0, seed=1)
    return excite.identify("irp6", log, choose=False, estimator="weighted")


def test_a_design_is_drawn(design: excite.Design, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    figures = excite.draw(design)
    assert list(figures) == ["motion", "phase", "spectrum", "convergence", "workspace"]
    assert all(isinstance(figure, Figure) for figure in figures.values())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_what_is_loaded_is_drawn_too(design: excite.Design, result: excite.Identification, tmp_path: Path) -> None:
    design.save(tmp_path / "design")
    result.save(tmp_path / "result")
    figures = excite.draw(excite.load_design(tmp_path / "design"), width="single")
    assert {"motion", "phase", "spectrum"} <= set(figures)
    assert {figure.get_figwidth() for figure in figures.values()} == {3.5}
    assert set(excite.draw(excite.load_result(tmp_path / "result"))) == {"torques", "residuals", "parameters"}


@pytest.mark.slow
def test_everything_that_has_figures_is_drawn(
    design: excite.Design, result: excite.Identification, tmp_path: Path
) -> None:
    log = excite.simulate(design, rate=100.0, noise=1.0, seed=2)
    plan = excite.plan_friction("irp6", drives=["z2"], torque_ramp=None)
    objects = {
        "result": ({"torques", "residuals", "parameters"}, result),
        "verification": ({"torques", "motion", "parts"}, excite.verify(result, log, training_too=True)),
        "study": ({"estimates_over_time"}, excite.study_over_time("irp6", [], designs=[design])),
        "plan": ({"runs"}, plan),
    }
    for name, (expected, made) in objects.items():
        assert set(excite.draw(made)) == expected, name
        (tmp_path / name).mkdir()
        files = excite.write_figures(made, tmp_path / name, formats="svg", width="double")
        assert len(files) == len(expected)
        assert {path.name.removesuffix(".svg").rpartition("simulated_")[2] for path in files} == expected, name


@pytest.mark.slow
@pytest.mark.parametrize("width", ["single", "double"])
def test_in_a_column_no_text_of_a_design_is_lost(design: excite.Design, width: str) -> None:
    for name, figure in excite.draw(design, width=width).items():
        figure.draw_without_rendering()
        ticks = of_ticks(figure)
        texts = [t for t in figure.findobj(Text) if t.get_text().strip() and t.get_visible() and t not in ticks]
        boxes = {text: text.get_window_extent() for text in texts}
        frame = figure.bbox.padded(1.0)
        for text, box in boxes.items():
            corners = ((box.x0, box.y0), (box.x1, box.y1))
            assert all(frame.contains(*corner) for corner in corners), (name, text.get_text())
        pairs = itertools.combinations([text for text in texts if not text.get_text().endswith("\n")], 2)
        assert [(a.get_text(), b.get_text()) for a, b in pairs if boxes[a].overlaps(boxes[b])] == [], name


def of_ticks(figure: Figure) -> set[object]:
    axes = [axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)]
    ticks = [tick for axis in axes for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks())]
    return {label for tick in ticks for label in (tick.label1, tick.label2)}
