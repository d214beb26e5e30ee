"""Figures of a design: what is drawn agrees with the motion, its limits, its spectrum and its search."""

from __future__ import annotations

import itertools
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from pinocchio_chains import drive_torques, whole_motion
from reported import misplaced

from constraints.linear import linear_limits
from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.design.start_results import RUNNING, StartResult
from excite.design.stated_limits import Unchecked
from excite.information.matrix import PredictedAccuracy
from excite.information.prior import base_sizes
from excite.information.target import target_of
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.task import Task
from excite.views.figures import write_figures
from excite.views.motion_plot import motion_figure, motion_functions
from excite.views.search_plot import convergence_figure
from excite.views.spectrum_plot import spectrum_figure
from excite.views.style import BLUE, FORBIDDEN, GREY, VERMILLION, significant, typeset
from excite.views.world_plot import phase_figure
from regressors.readers.library import load_robot
from regressors.robot.inertia import inertia_tensor
from regressors.robot.robot import Drive, Limits, Robot, Transmission

MINUS = "\N{MINUS SIGN}"
ROWS = ("q1", "q2", "q3", "drives z3, z4: q2 + q3")
TORQUES = ("drive z1", "drive z2", "drive z3", "drive z4", "drive z5")
MATRIX = {"q1": [1, 0, 0], "q2": [0, 1, 0], "q3": [0, 0, 1], "drives z3, z4: q2 + q3": [0, 1, 1]}
# Limits of the built-in irp6 with joints 4 and 5 at rest: lower, upper; None where there is none.
UPPER = {ROWS[0]: (2.96706, 1.266, 2.10), ROWS[1]: (0.69813, 1.137, 1.89), ROWS[2]: (0.69813, None, None)}
UPPER |= {ROWS[3]: (0.43633, 1.137, 1.89)}
BOUNDS = {(row, k): None if x is None else (-x, x) for row, uppers in UPPER.items() for k, x in enumerate(uppers)}
BOUNDS[ROWS[3], 0] = (-0.69813, 0.43633)


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
    status = {k: RUNNING if k in running else "done" for k in histories}
    starts = tuple(StartResult(k, x, min(h), status[k], h, len(h), 0.25) for k, h in histories.items())
    return replace(design, results=starts, best_start=best)


TERMS = "l2^2 m1 - a_very_long_length m2 + I3xx + I3yy"


def with_predictions(design: Design, percent: list[float]) -> Design:
    """A design of an arm with 57 base parameters, of which the last 14, of friction, have no known size."""
    target = target_of(load_robot("panda"), Task("panda"))
    base, sizes = target.base, base_sizes(target.model, target.base)
    known = np.where(np.isfinite(sizes), sizes, 1.0)
    each = zip(base.names, base.units, known, percent, strict=False)
    predicted = tuple(PredictedAccuracy(n, f"{n} + {TERMS}", unit, p / 100 * size) for n, unit, size, p in each)
    spectrum = np.geomspace(500.0, 5.0, len(percent))
    measured = replace(design.measured, predicted=predicted, spectrum=spectrum)
    return replace(design, formulated=(target, design.nonlinear), measured=measured)


# --- motion


def test_motion_has_a_row_per_joint_and_per_other_limited_function(motion: Figure) -> None:
    names = [name for ax in motion.axes if (name := ax.get_title(loc="left").strip())]
    assert names == [*ROWS, *TORQUES]
    assert len(motion.axes) == 3 * len(ROWS) + len(TORQUES)
    labels = [ax.get_ylabel() for ax in motion.axes[:3]]
    assert labels == ["position [rad]", "velocity [rad/s]", "acceleration [rad/s²]"]
    assert {ax.get_xlabel() for ax in motion.axes[-3:]} == {"time [s]"}
    assert panel(motion, "q1", 1).get_title(loc="right").startswith("drive z1, limit ")
    assert panel(motion, "q1", 0).get_title(loc="right").startswith("limit ")
    assert misplaced(motion) == []


def torque_panels(figure: Figure) -> list[Axes]:
    return [ax for ax in figure.axes if ax.get_ylabel() == "torque [Nm]"]


def test_torques_are_those_of_pinocchio_within_reserve_and_friction(design: Design, motion: Figure) -> None:
    torques = drive_torques(design.robot, whole_motion(design.robot, design.moving.joint_names, design.samples))
    transmission = design.robot.transmission
    for k, (ax, drive) in enumerate(zip(torque_panels(motion), transmission.drives, strict=True)):
        np.testing.assert_allclose(curve(ax)[:, 1], torques[:, k], rtol=0, atol=1e-9)
        moves = np.any(transmission.coupling[k, :3] != 0.0)
        most = 0.9 * transmission.limits.torque[k] - (drive.coulomb or 0.0) * moves
        lines = sorted(line.get_ydata()[0] for line in ax.lines if line.get_color() == VERMILLION)
        np.testing.assert_allclose(lines, [-most, most], rtol=1e-12)
        ((time, extreme),) = dots(ax)
        (use,) = [use for use in design.limits if use.label == f"drive {drive.name} torque"]
        assert (time, extreme) == (use.time, use.extreme)
        assert ax.get_ylim()[0] < -most < most < ax.get_ylim()[1]


@pytest.mark.slow
def test_torques_on_the_way_from_home_are_those_of_every_joint(design: Design) -> None:
    task = design.task.changed(home=(0.1, 0.0, 0.1, 0.2, -0.3))
    home = design_trajectory(task.changed(harmonics=2, weighted=False))
    whole, _ = home.sequence.sampled()
    torques = drive_torques(home.robot, whole)
    for k, ax in enumerate(torque_panels(motion_figure(home))):
        np.testing.assert_allclose(curve(ax)[:, 1], torques[:, k], rtol=0, atol=1e-9)


def test_without_checked_torques_there_are_none_and_the_reason_is_said(design: Design) -> None:
    limits = tuple(use for use in design.limits if not use.label.endswith("torque"))
    unchecked = replace(design, unchecked=(Unchecked("torque", "no mass is stated"),))
    figure = motion_figure(replace(unchecked, certified=limits, formulated=(design.target, ())))
    assert torque_panels(figure) == []
    assert "not checked: torque (no mass is stated)" in notes(figure)


def test_curves_are_the_sampled_motion(design: Design, motion: Figure) -> None:
    samples = design.samples
    for row, derivative in itertools.product(ROWS, range(3)):
        expected = (samples.q, samples.dq, samples.ddq)[derivative] @ np.array(MATRIX[row], dtype=float)
        drawn = curve(panel(motion, row, derivative))
        np.testing.assert_array_equal(drawn[:, 0], samples.time)
        np.testing.assert_allclose(drawn[:, 1], expected, rtol=0, atol=1e-13)


def test_forbidden_regions_start_at_the_limits_and_fill_the_panel(motion: Figure) -> None:
    for key, bounds in BOUNDS.items():
        ax = panel(motion, *key)
        bottom, top = ax.get_ylim()
        lines = sorted(line.get_ydata()[0] for line in ax.lines if line.get_color() == VERMILLION)
        if bounds is None:
            assert (shaded(ax), lines, ax.get_title(loc="right")) == ([], [], "no limit"), key
        else:
            np.testing.assert_allclose(shaded(ax), [(bottom, bounds[0]), (bounds[1], top)], rtol=0, atol=1e-12)
            np.testing.assert_array_equal(lines, bounds)


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


def test_motion_title_says_what_rests_and_whether_limits_hold(design: Design, motion: Figure) -> None:
    assert motion.get_suptitle() == "irp6: motion of 10 s, every limit that was checked is kept"
    said = notes(motion)
    kinds = "position (5), velocity (4), acceleration (4), torque (5), distance (12)"
    assert said[:1] == [f"checked, with the number of limits: {kinds}"]
    assert "not checked: jerk (no limit is stated), obstacles (" in said[1]
    assert "at rest: q4, q5" in said
    first = design.limits[0]
    broken = replace(first, extreme=first.bound * 1.05, margin=-0.05 * abs(first.bound), use=1.05)
    figure = motion_figure(replace(design, certified=(broken, *design.limits[1:])))
    assert "1 of 30 limits BROKEN" in figure.get_suptitle()
    (note,) = [text for text in figure.axes[0].findobj(Text) if "used" in text.get_text()]
    assert note.get_text().endswith("105.0 % used, BROKEN")
    assert note.get_color() == VERMILLION


def notes(figure: Figure) -> list[str]:
    """Lines below the title."""
    return figure.texts[1].get_text().split("\n")


@pytest.mark.parametrize("length", [56, 200])
def test_long_names_stay_inside_and_apart(design: Design, length: int) -> None:
    long = {name: f"{name}_$x$_" + (length - len(name) - 5) * "n" for name in design.robot.joint_names}

    def renamed(robot: Robot) -> Robot:
        return robot.replace(joints=tuple(replace(joint, name=long[joint.name]) for joint in robot.joints))

    checked = [(use, use.label.split()) for use in design.limits if not use.label.endswith("torque")]
    uses = tuple(replace(use, label=" ".join(long.get(word, word) for word in words)) for use, words in checked)
    target = replace(design.target, robot=renamed(design.moving))
    changed = {"robot": renamed(design.robot), "formulated": (target, ()), "certified": uses}
    figure = motion_figure(replace(design, **changed))
    assert misplaced(figure) == []
    if length <= 56:
        assert not any("\N{HORIZONTAL ELLIPSIS}" in text.get_text() for text in figure.findobj(Text))


def test_jerk_has_a_column_where_it_has_limits(design: Design) -> None:
    limited = LimitChoice(jerk=(7500.0,)).applied(design.moving)
    target = replace(design.target, robot=limited)
    uses = [replace(design.limits[0], label=f"joint q{k} jerk", unit="rad/s^3") for k in (1, 2, 3)]
    far = [replace(use, extreme=1.0, bound=7500.0, use=1.0 / 7500.0) for use in uses]
    changed = {"formulated": (target, design.nonlinear), "certified": (*design.limits, *far)}
    figure = motion_figure(replace(design, **changed))
    assert len(figure.axes) == 4 * len(ROWS) + len(TORQUES)
    ax = panel(figure, "q1", 3, columns=4)
    assert ax.get_ylabel() == "jerk [rad/s³]"
    np.testing.assert_allclose(curve(ax)[:, 1], design.samples.dddq[:, 0], rtol=0, atol=1e-13)
    assert shaded(ax) == []
    assert "limit 7500 (out of view): 0.0 % used" in ax.get_title(loc="right")


def coupled_robot() -> Robot:
    """Two joints; drives on q1, on q1 - 0.5 q2 twice with different zeros, and on q2 without position limits."""
    robot, position = load_robot("irp6"), np.array([3.0, 1.0, 1.5, np.inf])
    rates = {"velocity": np.array([np.inf, 2.0, 1.0, 5.0])}
    limits = replace(Limits.none(4), lower=-position, upper=position, **rates)
    coupling = np.array([[1.0, 0.0], [1.0, -0.5], [1.0, -0.5], [0.0, 1.0]])
    drives = tuple(Drive(f"z{k}") for k in (1, 2, 3, 4))
    return robot.replace(
        joints=robot.joints[:2],
        links=robot.links[:2],
        limits=replace(Limits.none(2), lower=np.array([-2.0, -2.0]), upper=np.array([2.0, 2.0])),
        transmission=Transmission(coupling, drives, limits, np.array([1.5, 0.25, -0.25, 0.0])),
        structure=type(robot.structure)(),
        shapes=(),
    )


def test_limits_on_one_function_meet_where_they_bind(design: Design) -> None:
    robot = coupled_robot()
    labels = [label for limit in linear_limits(robot) for label in limit.labels]
    uses = [replace(design.limits[0], label=label, use=0.1 * k) for k, label in enumerate(labels)]
    q1, q2, drive = motion_functions(robot, linear_limits(robot), uses)
    assert [function.name for function in (q1, q2, drive)] == ["q1", "q2", "drives z2, z3: q1 - 0.5 q2 + 0.25"]
    assert q1.allowed(0) == (-2.0, 1.5)  # z1 = q1 + 1.5 is at most 3
    assert q2.allowed(0) == (-2.0, 2.0)
    assert q2.allowed(1) == (-5.0, 5.0)
    assert drive.allowed(0) == (-1.0, 1.0)  # z3, drawn as z2, is half a radian higher: -1 to 2
    assert drive.allowed(1) == (-1.0, 1.0)
    assert drive.allowed(2) == (-np.inf, np.inf)
    tightest = max(drive.bounds[0], key=lambda bound: bound.use.use)
    assert tightest.owner == "drive z3"
    assert tightest.use.extreme - tightest.shift == pytest.approx(design.limits[0].extreme + 0.5)


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


def test_bars_are_the_predicted_deviations_over_sizes(design: Design) -> None:
    _, ax = spectrum_figure(design).axes
    deviation = {p.name: p.standard_deviation for p in design.predicted}
    width = dict(zip(deviation, [bar.get_width() for bar in ax.patches], strict=True))
    size = described_sizes(design.moving)
    assert len(size) == 8
    for name, value in size.items():
        assert width[name] == pytest.approx(100 * deviation[name] / value, rel=1e-9)
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert names[0] == "X1 = I1zz + I2xx + I3yy + n1² Ia1"
    assert names[2] == "X3 = I2zz + l2² m3 + I3zz + n2² Ia2\n+ n3² Ia3"
    assert names[7:10] == ["F1c", "F2c", "F3c"]
    assert ax.yaxis_inverted()
    written = [text.get_text() for text in ax.texts]
    assert written[0].endswith(" kg m²)")
    assert written[-1] == f"{significant(width['F3v'], 2)} % ({significant(deviation['F3v'], 2)} Nm s/rad)"
    assert "for noise of 1 Nm (assumed) in each row, independent in 3003 rows" in ax.get_title(loc="left")
    assert ax.get_xlabel() == "standard deviation / size of the parameter [%]"


def described_sizes(robot: Robot) -> dict[str, float]:
    """Of parameters with one or two terms: moments' lengths, largest principal moments, rotors, friction."""
    theta, drives = robot.links[2].theta, list(enumerate(robot.transmission.drives[:3], 1))
    largest = float(np.abs(np.linalg.eigvalsh(inertia_tensor(theta))).max())
    friction = {f"F{k}c": drive.coulomb for k, drive in drives} | {f"F{k}v": drive.viscous for k, drive in drives}
    return {"X5": np.sqrt(2) * largest, "X6": float(np.linalg.norm(theta[1:4])), **friction}


def test_a_parameter_without_a_size_has_its_deviation_written(design: Design) -> None:
    shown = with_predictions(design, np.geomspace(0.1, 9000.0, 57).tolist())
    figure = spectrum_figure(shown)
    texts = [text.get_text() for ax in figure.axes[1:] for text in ax.texts]
    assert sum(text.endswith(", size not known") for text in texts) == 14
    assert len(texts) == 57
    assert [t.get_text() for t in figure.legends[0].get_texts()][-1] == "deviation larger than the size"


def test_many_parameters_stand_in_two_columns_on_one_scale(design: Design) -> None:
    percent = np.geomspace(0.01, 90.0, 43).tolist()
    figure = spectrum_figure(with_predictions(design, percent))
    _, left, right = figure.axes
    assert [len(ax.patches) for ax in (left, right)] == [22, 21]
    assert left.get_xlim() == right.get_xlim()
    assert left.get_xscale() == right.get_xscale() == "log"
    widths = [bar.get_width() for ax in (left, right) for bar in ax.patches]
    np.testing.assert_allclose(widths, percent, rtol=1e-12)
    for label, p in zip(left.get_yticklabels(), design.predicted, strict=False):
        lines = label.get_text().split("\n")
        assert all(len(line) <= 42 for line in lines), p
        assert " ".join(lines).replace(MINUS, "-").endswith("+ l2² m1 - a_very_long_length m2 + I3xx + I3yy")


@pytest.mark.parametrize("percent", [[0.1] * 5, [0.01, 0.2], [0.3]])
def test_bars_of_similar_length_stand_on_a_linear_scale(design: Design, percent: list[float]) -> None:
    ax = spectrum_figure(with_predictions(design, percent)).axes[1]
    assert ax.get_xscale() == "linear"
    assert ax.get_xlim()[0] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 20, 21, 57])
def test_bar_texts_do_not_overlap_and_stay_inside(design: Design, count: int) -> None:
    figure = spectrum_figure(with_predictions(design, np.geomspace(0.2, 500.0, count).tolist()))
    assert misplaced(figure) == []
    for ax in figure.axes[1:]:
        assert all(text.get_window_extent().x1 <= ax.bbox.x1 for text in ax.texts)
        assert not any("\N{HORIZONTAL ELLIPSIS}" in text.get_text() for text in (*ax.get_yticklabels(), *ax.texts))


# --- convergence

HISTORIES = {0: [300.0, 90.0, 95.0, 80.0], 2: [np.inf, 100.0, 60.0, 65.0, 40.0], 5: [150.0, 120.0]}


@pytest.fixture(scope="module")
def searched(design: Design) -> Design:
    return with_starts(design, HISTORIES, best=2, running=(5,))


def test_the_search_shows_every_start_and_what_is_minimised(searched: Design) -> None:
    """Objective and running minimum of each; the best one stands out, unfinished ones are hollow."""
    figure = convergence_figure(searched)
    (ax,) = figure.axes
    assert ax.get_yscale() == "log"
    lowest = [np.minimum.accumulate(history) for history in HISTORIES.values()]
    for style, expected in ((":", HISTORIES.values()), ("-", lowest)):
        drawn = {line.get_ydata().size - 1: line for line in ax.lines if line.get_linestyle() == style}
        for values in expected:
            seen = np.where(np.isfinite(values), values, np.nan)
            np.testing.assert_array_equal(drawn[len(values)].get_ydata()[:-1], seen)
            np.testing.assert_array_equal(drawn[len(values)].get_xdata()[:-1], np.arange(len(values)))
    lines = {line.get_ydata().size - 1: line for line in ax.lines if line.get_linestyle() == "-"}
    assert [lines[size].get_color() for size in (4, 5, 2)] == [GREY, BLUE, GREY]
    assert lines[5].get_linewidth() > lines[4].get_linewidth()
    assert lines[5].get_zorder() > lines[4].get_zorder()
    ends = {line.get_xdata()[0]: line.get_markerfacecolor() for line in ax.lines if line.get_marker() == "o"}
    assert ends == {3: GREY, 4: BLUE, 1: "white"}
    assert [text.get_text() for text in ax.texts] == ["40.00"]
    of_starts = ["best start (number 2): best so far", "other starts: best so far"]
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == [*of_starts, "objective at each iterate", "unfinished"]
    assert figure.get_suptitle() == "irp6: search from 3 starts (1 unfinished)"
    title = ax.get_title(loc="left")
    assert "minimised: cond(W), columns of the left-to-right QR base (Gautier 1991), SI, unscaled" in title
    assert "best start: 40.00 in the solver (with smoothed friction signs)" in title
    assert f"{searched.condition_number:.2f} in the written file (100 Hz)" in title


def test_starts_of_one_kind_are_curves_with_a_gap_between_them(design: Design) -> None:
    (ax,) = convergence_figure(with_starts(design, {0: [3.0, 2.0], 1: [9.0, 8.0, 7.0], 2: [5.0]}, best=0)).axes
    (line,) = [line for line in ax.lines if line.get_linestyle() == ":" and line.get_color() == GREY]
    np.testing.assert_array_equal(line.get_xdata(), [0, 1, 2, np.nan, 0, np.nan])
    np.testing.assert_array_equal(line.get_ydata(), [9, 8, 7, np.nan, 5, np.nan])


@pytest.mark.parametrize("base", ["pivoted", "orthonormal"])
def test_convergence_names_the_base_that_was_asked_for(searched: Design, base: str) -> None:
    asked = replace(searched, task=searched.task.changed(base=base))
    title = convergence_figure(asked).axes[0].get_title(loc="left")
    assert base in title
    assert significant(searched.criteria[f"condition_number_{base}"], 4) in title


def test_a_criterion_that_is_not_positive_stands_on_a_linear_scale(design: Design) -> None:
    (ax,) = convergence_figure(with_starts(design, {0: [3.0, -1.0, -2.0]}, best=0)).axes
    assert ax.get_yscale() == "linear"


# --- files


def test_written_figures_open_and_are_not_blank(design: Design, tmp_path: Path) -> None:
    paths = write_figures(design, tmp_path)
    assert [path.stem for path in paths] == ["motion", "phase", "spectrum", "convergence", "workspace"]
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    for path in paths:
        image = imread(path)
        assert min(image.shape[:2]) > 600
        assert len(np.unique(image[..., 0])) > 50
        assert (image[..., :3].min(axis=2) < 0.95).mean() > 0.01


def test_a_drawing_that_fails_leaves_the_old_file_and_no_other(
    design: Design, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "spectrum.png").write_bytes(b"old")

    def failing(design: Design) -> Figure:
        raise ZeroDivisionError

    monkeypatch.setattr("excite.views.spectrum_plot.spectrum_figure", failing)
    with pytest.raises(ZeroDivisionError):
        write_figures(design, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["spectrum.png"]
    assert (tmp_path / "spectrum.png").read_bytes() == b"old"


def test_pyplot_is_not_imported_and_designing_imports_no_matplotlib() -> None:
    code = (
        "import sys, excite.design.design; assert 'matplotlib' not in sys.modules; "
        "import excite.views.motion_plot; assert 'matplotlib' in sys.modules; "
        "unwanted = {'matplotlib.pyplot', 'scipy.optimize', 'scipy.signal', 'scipy.stats'} & set(sys.modules); "
        "assert not unwanted, unwanted"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# --- text


def test_texts_and_numbers_are_typeset() -> None:
    texts = {"-I2xx - l2^2 m3": f"{MINUS}I2xx {MINUS} l2² m3", "limit -2.1": f"limit {MINUS}2.1"}
    texts |= {"2.1e-05": "2.1e-05", "tool-joint": "tool-joint", "$a$": r"\$a\$", "rad/s^3": "rad/s³"}
    assert {text: typeset(text) for text in texts} == texts
    numbers = {(0.02, 2): "0.020", (416.0, 4): "416.0", (51320.4, 4): "51320", (1.2e-5, 2): "1.2e-05"}
    numbers |= {(3.2e9, 2): "3.2e+09", (0.0, 3): "0", (float("inf"), 3): "inf"}
    assert {number: significant(*number) for number in numbers} == numbers


# Phase plots: the motion within its limits, one panel per coordinate.


def test_phases_of_joints_and_drives_stay_within_the_tighter_bounds(design: Design) -> None:
    """Drive z1 is joint q1, and z4 turns along with z3 while joint 4 rests."""
    figure = phase_figure(design)
    assert tuple(ax.get_title(loc="left") for ax in figure.axes) == ROWS
    samples = design.trajectory.samples(np.linspace(0.0, 10.0, 2001))
    for ax, row in zip(figure.axes, MATRIX.values(), strict=True):
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("position [rad]", "velocity [rad/s]")
        curve = ax.lines[-2].get_xydata()
        np.testing.assert_allclose(curve, np.column_stack([samples.q @ row, samples.dq @ row]), atol=1e-12)
        start = ax.lines[-1].get_xydata()
        np.testing.assert_allclose(start, [[(samples.q @ row)[0], 0.0]], atol=1e-12)
        assert np.all(curve[:, 0] >= ax.get_xlim()[0])
        assert np.all(curve[:, 1] <= ax.get_ylim()[1])
    lines = [{round(float(x), 5) for line in ax.lines[:-2] for x in line.get_xydata().ravel()} for ax in figure.axes]
    assert {-2.96706, 2.96706, -1.266, 1.266} <= lines[0]
    assert {-0.69813, 0.43633, -1.137, 1.137} <= lines[3]
