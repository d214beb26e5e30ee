"""Figures of a design: what is drawn agrees with the motion, its limits, its spectrum and its search."""

import dataclasses
import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from matplotlib.transforms import Bbox

import excite.plots
from constraints.linear import linear_limits
from excite.design.design import Design
from excite.design.multistart import RUNNING, StartResult
from excite.design.optimisation import design_trajectory
from excite.information.metrics import PredictedAccuracy
from excite.plots import convergence_figure, motion_figure, spectrum_figure, write_figures
from excite.plots.motion_plot import motion_functions, view_range
from excite.plots.style import BLUE, FORBIDDEN, GREY, VERMILLION, shortened, significant, typeset
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import load_robot
from regressors.robot.robot import Drive, Limits, Robot, Transmission

MINUS = "\N{MINUS SIGN}"
ROWS = ("q1", "q2", "q3", "drives z3, z4: q2 + q3")
MATRIX = {"q1": [1, 0, 0], "q2": [0, 1, 0], "q3": [0, 0, 1], "drives z3, z4: q2 + q3": [0, 1, 1]}
# Limits of the built-in irp6 with joints 4 and 5 at rest: lower, upper; None where there is none.
BOUNDS = {
    ("q1", 0): (-2.96706, 2.96706),
    ("q1", 1): (-1.266, 1.266),
    ("q1", 2): (-2.10, 2.10),
    ("q2", 0): (-0.69813, 0.69813),
    ("q2", 1): (-1.137, 1.137),
    ("q2", 2): (-1.89, 1.89),
    ("q3", 0): (-0.69813, 0.69813),
    ("q3", 1): None,
    ("q3", 2): None,
    ("drives z3, z4: q2 + q3", 0): (-0.69813, 0.43633),
    ("drives z3, z4: q2 + q3", 1): (-1.137, 1.137),
    ("drives z3, z4: q2 + q3", 2): (-1.89, 1.89),
}


@pytest.fixture(scope="module")
def design() -> Design:
    return design_trajectory(Task("irp6", starts=1, harmonics=3, executor="serial"))


@pytest.fixture(scope="module")
def motion(design: Design) -> Figure:
    return motion_figure(design)


def panel(figure: Figure, row: str, derivative: int, columns: int = 3) -> Axes:
    return figure.axes[columns * ROWS.index(row) + derivative]


def shaded(ax: Axes) -> list[tuple[float, float]]:
    """Vertical extents of the forbidden regions, from below."""
    areas = [p for p in ax.patches if isinstance(p, Rectangle) and p.get_facecolor() == to_rgba(FORBIDDEN)]
    return sorted((p.get_y(), p.get_y() + p.get_height()) for p in areas)


def curve(ax: Axes) -> np.ndarray:
    (line,) = [line for line in ax.lines if line.get_color() == BLUE]
    return np.array(line.get_xydata())


def dots(ax: Axes) -> list[tuple[float, float]]:
    return [tuple(line.get_xydata()[0]) for line in ax.lines if line.get_marker() == "o"]


def with_starts(design: Design, histories: dict[int, list[float]], best: int, running: tuple[int, ...] = ()) -> Design:
    x = design.starts[0].x
    starts = tuple(
        StartResult(k, x, min(history), RUNNING if k in running else "done", history, len(history), 0.25)
        for k, history in histories.items()
    )
    return dataclasses.replace(design, starts=starts, best_start=best)


def with_predictions(design: Design, deviations: list[float]) -> Design:
    predicted = tuple(
        PredictedAccuracy(f"m{k}", f"m{k} + l2^2 m{k + 1} - a_very_long_length m{k + 2} + I{k}xx + I{k}yy", "kg", s)
        for k, s in enumerate(deviations)
    )
    spectrum = np.geomspace(500.0, 5.0, len(deviations))
    return dataclasses.replace(design, predicted=predicted, spectrum=spectrum)


def motion_row_names(figure: Figure) -> list[str]:
    return [name for ax in figure.axes if (name := ax.get_title(loc="left").strip())]


# --- motion


def test_motion_has_a_row_per_joint_and_per_other_limited_function(motion: Figure) -> None:
    assert tuple(motion_row_names(motion)) == ROWS
    assert len(motion.axes) == 3 * len(ROWS)


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("row", ROWS)
def test_curve_is_the_sampled_motion(design: Design, motion: Figure, row: str, derivative: int) -> None:
    samples = design.samples
    expected = (samples.q, samples.dq, samples.ddq)[derivative] @ np.array(MATRIX[row], dtype=float)
    drawn = curve(panel(motion, row, derivative))
    np.testing.assert_array_equal(drawn[:, 0], samples.time)
    np.testing.assert_allclose(drawn[:, 1], expected, rtol=0, atol=1e-13)


def test_curves_of_limited_functions_are_the_constraints_values(design: Design, motion: Figure) -> None:
    for limit in linear_limits(design.moving):
        values = limit.values(design.samples)
        for k, row in enumerate(limit.matrix):
            (name,) = [name for name in ROWS if MATRIX[name] == row.tolist()]
            drawn = curve(panel(motion, name, limit.derivative))[:, 1]
            np.testing.assert_allclose(drawn, values[:, k], rtol=0, atol=1e-13)


@pytest.mark.parametrize(("key", "bounds"), BOUNDS.items())
def test_forbidden_regions_start_at_the_limits_and_fill_the_panel(
    motion: Figure, key: tuple[str, int], bounds: tuple[float, float] | None
) -> None:
    ax = panel(motion, *key)
    bottom, top = ax.get_ylim()
    lines = sorted(line.get_ydata()[0] for line in ax.lines if line.get_color() == VERMILLION)
    if bounds is None:
        assert shaded(ax) == []
        assert lines == []
        assert ax.get_title(loc="right") == "no limit"
        return
    np.testing.assert_allclose(shaded(ax), [(bottom, bounds[0]), (bounds[1], top)], rtol=0, atol=1e-12)
    np.testing.assert_allclose(lines, bounds, rtol=0, atol=0)


def test_extremes_over_continuous_time_are_marked_with_their_use(design: Design, motion: Figure) -> None:
    uses = {use.label: use for use in design.limits}
    for key, label in (
        (("q1", 0), "joint q1 position"),
        (("q1", 1), "drive z1 velocity"),
        (("drives z3, z4: q2 + q3", 2), "drive z3 acceleration"),
    ):
        ax = panel(motion, *key)
        assert dots(ax) == [(uses[label].time, uses[label].extreme)]
        assert f"{100 * uses[label].use:.1f} % used" in ax.get_title(loc="right")
    assert dots(panel(motion, "q3", 1)) == []


def test_owners_of_limits_are_named_where_they_are_not_the_joint(motion: Figure) -> None:
    assert panel(motion, "q1", 1).get_title(loc="right").startswith("drive z1, limit ")
    assert panel(motion, "q1", 0).get_title(loc="right").startswith("limit ")


def test_axes_are_labelled_with_units(motion: Figure) -> None:
    labels = [ax.get_ylabel() for ax in motion.axes[:3]]
    assert labels == ["position [rad]", "velocity [rad/s]", "acceleration [rad/s²]"]
    assert {ax.get_xlabel() for ax in motion.axes[-3:]} == {"time [s]"}


def test_motion_title_says_what_rests_and_whether_limits_hold(design: Design, motion: Figure) -> None:
    assert motion.get_suptitle() == "irp6: motion of 10 s, every limit that was checked is kept; q4, q5 rest"
    assert [text.get_text() for text in motion.texts if "not checked" in text.get_text()] == [
        "not checked: jerk, self-collision, obstacles"
    ]
    first = design.limits[0]
    broken = dataclasses.replace(first, extreme=first.bound * 1.05, margin=-0.05 * abs(first.bound), use=1.05)
    figure = motion_figure(dataclasses.replace(design, limits=(broken, *design.limits[1:])))
    assert "1 of 18 limits BROKEN" in figure.get_suptitle()
    (note,) = [text for text in figure.axes[0].findobj(Text) if "used" in text.get_text()]
    assert note.get_text().endswith("105.0 % used, BROKEN")
    assert note.get_color() == VERMILLION


def drawn_texts(ax: Axes) -> list[Text]:
    """Titles, labels, and the numbers beside the vertical axis that are in view."""
    bottom, top = ax.get_ylim()
    numbers = [t for y, t in zip(ax.get_yticks(), ax.get_yticklabels(), strict=True) if bottom <= y <= top]
    titles = [child for child in ax.get_children() if isinstance(child, Text) and child.get_text().strip()]
    return [*titles, ax.yaxis.label, *([ax.xaxis.label] if ax.get_xlabel() else []), *numbers]


def extent(text: Text) -> Bbox:
    """Where a text is, without the empty line at the end of a row's name."""
    box = text.get_window_extent()
    bottom = 0.5 * (box.y0 + box.y1) if text.get_text().endswith("\n") else box.y0
    return Bbox([[box.x0, bottom], [box.x1, box.y1]])


def test_motion_texts_do_not_overlap_and_stay_inside(motion: Figure) -> None:
    motion.draw_without_rendering()
    texts = [text for ax in motion.axes for text in drawn_texts(ax)]
    boxes = {text: extent(text) for text in (*texts, *motion.texts, *motion.legends[0].get_texts())}
    assert all(motion.bbox.x0 <= box.x0 and box.x1 <= motion.bbox.x1 for box in boxes.values())
    assert all(motion.bbox.y0 <= box.y0 and box.y1 <= motion.bbox.y1 for box in boxes.values())
    pairs = itertools.combinations(boxes, 2)
    assert [(a.get_text(), b.get_text()) for a, b in pairs if boxes[a].overlaps(boxes[b])] == []


def test_jerk_has_a_column_where_it_has_limits(design: Design) -> None:
    limited = LimitChoice(jerk=(7500.0,)).applied(design.moving)
    target = dataclasses.replace(design.target, robot=limited)
    uses = [dataclasses.replace(design.limits[0], label=f"joint q{k} jerk", unit="rad/s^3") for k in (1, 2, 3)]
    far = [dataclasses.replace(use, extreme=1.0, bound=7500.0, use=1.0 / 7500.0) for use in uses]
    figure = motion_figure(dataclasses.replace(design, target=target, limits=(*design.limits, *far)))
    assert len(figure.axes) == 4 * len(ROWS)
    ax = panel(figure, "q1", 3, columns=4)
    assert ax.get_ylabel() == "jerk [rad/s³]"
    np.testing.assert_allclose(curve(ax)[:, 1], design.samples.dddq[:, 0], rtol=0, atol=1e-13)
    assert shaded(ax) == []
    assert "limit 7500 (out of view): 0.0 % used" in ax.get_title(loc="right")


def coupled_robot() -> Robot:
    """Two joints; drives on q1, on q1 - 0.5 q2 twice with different zeros, and on q2 without position limits."""
    robot = load_robot("irp6")
    limits = Limits.none(4)
    position = np.array([3.0, 1.0, 1.5, np.inf])
    limits = dataclasses.replace(limits, lower=-position, upper=position, velocity=np.array([np.inf, 2.0, 1.0, 5.0]))
    coupling = np.array([[1.0, 0.0], [1.0, -0.5], [1.0, -0.5], [0.0, 1.0]])
    drives = tuple(Drive(f"z{k}") for k in (1, 2, 3, 4))
    return robot.replace(
        joints=robot.joints[:2],
        links=robot.links[:2],
        limits=dataclasses.replace(Limits.none(2), lower=np.array([-2.0, -2.0]), upper=np.array([2.0, 2.0])),
        transmission=Transmission(coupling, drives, limits, np.array([1.5, 0.25, -0.25, 0.0])),
        structure=type(robot.structure)(),
    )


def test_limits_on_one_function_meet_where_they_bind(design: Design) -> None:
    robot = coupled_robot()
    labels = [label for limit in linear_limits(robot) for label in limit.labels]
    uses = [dataclasses.replace(design.limits[0], label=label, use=0.1 * k) for k, label in enumerate(labels)]
    q1, q2, drive = motion_functions(robot, linear_limits(robot), uses)
    assert [function.name for function in (q1, q2, drive)] == ["q1", "q2", "drives z2, z3: q1 - 0.5 q2 + 0.25"]
    assert q1.allowed(0) == (-2.0, 1.5)  # z1 = q1 + 1.5 is at most 3
    assert q2.allowed(0) == (-2.0, 2.0)
    assert q2.allowed(1) == (-5.0, 5.0)
    assert drive.allowed(0) == (-1.0, 1.0)  # z3, drawn as z2, is half a radian higher: -1 to 2
    assert drive.allowed(1) == (-1.0, 1.0)
    assert drive.allowed(2) == (-np.inf, np.inf)
    tightest = drive.tightest(0)
    assert tightest is not None
    assert tightest.owner == "drive z3"
    assert tightest.extreme == pytest.approx(design.limits[0].extreme + 0.5)


@pytest.mark.parametrize(
    ("low", "high", "allowed", "seen"),
    [
        (-1.0, 1.0, (-2.0, 2.0), (-2.0, 2.0)),
        (-1.0, 1.0, (-np.inf, np.inf), (-1.0, 1.0)),
        (-1.0, 1.0, (-100.0, 2.0), (-1.0, 2.0)),
        (-1.0, 1.0, (-0.5, 0.5), (-1.0, 1.0)),
        (-1.0, 1.0, (1.5, 2.0), (-1.0, 2.0)),
        (0.3, 0.3, (-5.0, 5.0), (-5.0, 5.0)),
        (0.3, 0.3, (-np.inf, np.inf), (0.3, 0.3)),
    ],
)
def test_view_holds_the_curve_and_bounds_that_do_not_flatten_it(
    low: float, high: float, allowed: tuple[float, float], seen: tuple[float, float]
) -> None:
    bottom, top = view_range(np.array([low, high]), allowed)
    pad = 0.1 * (seen[1] - seen[0]) or 1.0
    assert (bottom, top) == pytest.approx((seen[0] - pad, seen[1] + pad))


# --- spectrum


def test_spectrum_shows_every_singular_value(design: Design) -> None:
    spectrum, bars = spectrum_figure(design).axes
    assert spectrum.get_yscale() == "log"
    (markers,) = [line for line in spectrum.lines if line.get_marker() == "o"]
    np.testing.assert_array_equal(markers.get_ydata(), design.spectrum)
    assert spectrum.get_ylim()[0] < design.spectrum[-1] < design.spectrum[0] < spectrum.get_ylim()[1]
    title = spectrum.get_title(loc="left")
    assert f"= {design.condition_number:.2f}" in title
    assert "left-to-right QR base (Gautier 1991), SI, unscaled" in title
    assert len(bars.patches) == len(design.predicted) == 13


def test_bars_are_the_predicted_deviations_with_units(design: Design) -> None:
    _, ax = spectrum_figure(design).axes
    np.testing.assert_array_equal(
        [bar.get_width() for bar in ax.patches], [p.standard_deviation for p in design.predicted]
    )
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert names[0] == "X1 = I1zz + I2xx + I3yy + n1² Ia1"
    assert names[7:10] == ["F1c", "F2c", "F3c"]
    assert ax.yaxis_inverted()
    written = [text.get_text() for text in ax.texts]
    assert written[0].endswith(" kg m²")
    assert written[-1].endswith(" Nm s/rad")
    assert "for noise of 1 Nm (assumed) in each row, independent in 3003 rows" in ax.get_title(loc="left")


def test_stated_noise_is_not_called_assumed(design: Design) -> None:
    stated = dataclasses.replace(design, task=design.task.changed(noise=(2.0, 0.5, 1.0)))
    title = spectrum_figure(stated).axes[1].get_title(loc="left")
    assert "for noise of 0.5 to 2 Nm in each row, independent" in title


def test_many_parameters_stand_in_two_columns_on_one_scale(design: Design) -> None:
    deviations = np.geomspace(1e-5, 1.0, 61).tolist()
    figure = spectrum_figure(with_predictions(design, deviations))
    _, left, right = figure.axes
    assert [len(ax.patches) for ax in (left, right)] == [31, 30]
    assert left.get_xlim() == right.get_xlim()
    assert left.get_xscale() == right.get_xscale() == "log"
    widths = [bar.get_width() for ax in (left, right) for bar in ax.patches]
    np.testing.assert_array_equal(widths, deviations)
    assert all(len(label.get_text()) <= 42 for label in left.get_yticklabels())
    assert left.get_yticklabels()[0].get_text().endswith("…")


@pytest.mark.parametrize("deviations", [[0.1] * 5, [0.01, 0.2], [0.3]])
def test_bars_of_similar_length_stand_on_a_linear_scale(design: Design, deviations: list[float]) -> None:
    ax = spectrum_figure(with_predictions(design, deviations)).axes[1]
    assert ax.get_xscale() == "linear"
    assert ax.get_xlim()[0] == 0.0


@pytest.mark.parametrize("count", [1, 13, 20, 21, 60])
def test_bar_texts_do_not_overlap_and_stay_inside(design: Design, count: int) -> None:
    figure = spectrum_figure(with_predictions(design, np.geomspace(0.002, 0.05, count).tolist()))
    figure.draw_without_rendering()
    for ax in figure.axes[1:]:
        for texts in ([*ax.get_yticklabels()], [*ax.texts]):
            boxes = [text.get_window_extent() for text in texts]
            assert all(figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1 for box in boxes)
            assert all(lower.y1 <= upper.y0 for upper, lower in itertools.pairwise(boxes))


# --- convergence

HISTORIES = {0: [300.0, 90.0, 95.0, 80.0], 2: [np.inf, 100.0, 60.0, 65.0, 40.0], 5: [150.0, 120.0]}


@pytest.fixture(scope="module")
def searched(design: Design) -> Design:
    return with_starts(design, HISTORIES, best=2, running=(5,))


def test_every_start_has_its_objective_and_its_running_minimum(searched: Design) -> None:
    (ax,) = convergence_figure(searched).axes
    assert ax.get_yscale() == "log"
    lowest = [np.minimum.accumulate(history) for history in HISTORIES.values()]
    for style, expected in ((":", HISTORIES.values()), ("-", lowest)):
        drawn = {line.get_ydata().size: line for line in ax.lines if line.get_linestyle() == style}
        for values in expected:
            seen = np.where(np.isfinite(values), values, np.nan)
            np.testing.assert_array_equal(drawn[len(values)].get_ydata(), seen)
            np.testing.assert_array_equal(drawn[len(values)].get_xdata(), np.arange(len(values)))


def test_best_start_stands_out_and_unfinished_ones_are_hollow(searched: Design) -> None:
    (ax,) = convergence_figure(searched).axes
    lines = {line.get_ydata().size: line for line in ax.lines if line.get_linestyle() == "-"}
    assert [lines[size].get_color() for size in (4, 5, 2)] == [GREY, BLUE, GREY]
    assert lines[5].get_linewidth() > lines[4].get_linewidth()
    assert lines[5].get_zorder() > lines[4].get_zorder()
    ends = {line.get_xdata()[0]: line.get_markerfacecolor() for line in ax.lines if line.get_marker() == "o"}
    assert ends == {3: GREY, 4: BLUE, 1: "white"}
    assert [text.get_text() for text in ax.texts] == ["40.00"]
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        "best start (number 2): best so far",
        "other starts: best so far",
        "objective at each iterate",
        "unfinished",
    ]


def test_convergence_says_what_is_minimised_and_what_it_took(searched: Design) -> None:
    figure = convergence_figure(searched)
    assert figure.get_suptitle() == "irp6: search from 3 starts (1 unfinished)"
    title = figure.axes[0].get_title(loc="left")
    assert "minimised: cond(W), columns of the left-to-right QR base (Gautier 1991), SI, unscaled" in title
    assert "best start: 40.00 in the solver (with smoothed friction signs)" in title
    assert f"{searched.condition_number:.2f} in the written file (100 Hz)" in title


@pytest.mark.parametrize("base", ["pivoted", "orthonormal"])
def test_convergence_names_the_base_that_was_asked_for(searched: Design, base: str) -> None:
    asked = dataclasses.replace(searched, task=searched.task.changed(base=base))
    title = convergence_figure(asked).axes[0].get_title(loc="left")
    assert base in title
    assert significant(searched.criteria[f"condition_number_{base}"], 4) in title


def test_a_criterion_without_a_written_measure_is_named(searched: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("excite.plots.convergence_plot._MEASURES", {})
    title = convergence_figure(searched).axes[0].get_title(loc="left")
    assert title == "minimised: condition, base gautier; best start 40.00"


def test_a_criterion_that_is_not_positive_stands_on_a_linear_scale(design: Design) -> None:
    (ax,) = convergence_figure(with_starts(design, {0: [3.0, -1.0, -2.0]}, best=0)).axes
    assert ax.get_yscale() == "linear"


# --- files


def test_written_figures_open_and_are_not_blank(design: Design, tmp_path: Path) -> None:
    paths = write_figures(design, tmp_path)
    assert [path.name for path in paths] == ["motion.png", "phase.png", "spectrum.png", "convergence.png"]
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    for path in paths:
        image = imread(path)
        assert min(image.shape[:2]) > 600
        assert len(np.unique(image[..., 0])) > 50
        assert (image[..., :3].min(axis=2) < 0.95).mean() > 0.01


def test_no_folder_no_files(design: Design, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("not a folder")
    with pytest.raises(InputError, match="cannot write"):
        write_figures(design, file)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert file.read_text() == "not a folder"


def test_a_drawing_that_fails_leaves_the_old_file_and_no_other(
    design: Design, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "spectrum.png").write_bytes(b"old")

    def failing(design: Design) -> Figure:
        raise ZeroDivisionError

    monkeypatch.setattr(excite.plots, "FIGURES", {"spectrum": failing})
    with pytest.raises(ZeroDivisionError):
        write_figures(design, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["spectrum.png"]
    assert (tmp_path / "spectrum.png").read_bytes() == b"old"


def test_pyplot_is_not_imported_and_designing_imports_no_matplotlib() -> None:
    code = (
        "import sys, excite.design.design; assert 'matplotlib' not in sys.modules; "
        "import excite.plots; assert 'matplotlib' in sys.modules; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# --- text


@pytest.mark.parametrize(
    ("text", "length", "expected"),
    [
        ("a + b", 10, "a + b"),
        ("I2zz + l2^2 m3 + I3zz + n2^2 Ia2", 26, "I2zz + l2^2 m3 + I3zz …"),
        ("a + one_very_long_name_indeed", 12, "a + one_ver…"),
        ("one_very_long_name_indeed", 12, "one_very_lo…"),
    ],
)
def test_shortened(text: str, length: int, expected: str) -> None:
    assert shortened(text, length) == expected
    assert len(expected) <= max(length, len(text))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("kg m^2", "kg m²"),
        ("rad/s^3", "rad/s³"),
        ("-I2xx - l2^2 m3", f"{MINUS}I2xx {MINUS} l2² m3"),
        ("limit -2.1", f"limit {MINUS}2.1"),
        ("2.1e-05", "2.1e-05"),
        ("tool-joint", "tool-joint"),
        ("$a$", r"\$a\$"),
    ],
)
def test_typeset(text: str, expected: str) -> None:
    assert typeset(text) == expected


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [
        (0.02, 2, "0.020"),
        (416.0, 4, "416.0"),
        (51320.4, 4, "51320"),
        (1.2e-5, 2, "1.2e-05"),
        (3.2e9, 2, "3.2e+09"),
        (0.0, 3, "0"),
        (float("inf"), 3, "inf"),
    ],
)
def test_significant(value: float, digits: int, expected: str) -> None:
    assert significant(value, digits) == expected
