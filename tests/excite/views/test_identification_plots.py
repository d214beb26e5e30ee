"""Figures of identification and verification: what is drawn agrees with the numbers behind it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from reported import misplaced

from excite.identification.estimator import Estimate
from excite.identification.identification import Identification
from excite.identification.observations import Observations
from excite.identification.recipe import Recipe
from excite.identification.result import FitData, ReferenceValues
from excite.information.target import IdentificationTarget, target_of
from excite.simulation.replay import Outcome, Replay
from excite.tasks.further_settings import Tolerances
from excite.tasks.task import Task
from excite.verification.simulated_motion import motion_errors
from excite.verification.verdict import TorqueError, Verdict
from excite.verification.verification import MeasuredMotion, Verification, VerifiedLog
from excite.views.figures import drawn_figures, write_figures
from excite.views.identification_plots import (
    DENSE,
    MEASURED,
    PERCENTILES,
    PREDICTED,
    autocorrelation,
    envelope,
    estimates_figure,
    residuals_figure,
    settled_range,
    torques_figure,
)
from excite.views.identification_view import identification_figures
from excite.views.panels import BINS, ends, extremes
from excite.views.parameters_plot import decimal, differences, parameters_figure
from excite.views.style import BAND, BLUE, DARK, FORBIDDEN, VERMILLION
from excite.views.verification_plots import predicted_torques_figure, simulated_motion_figure
from excite.views.verification_view import verification_view
from regressors.errors import InputError
from regressors.readers.library import built_in, load_robot
from regressors.samples import Samples

EQUATIONS = (("q1", "Nm"), ("q2", "Nm"), ("slide", "N"))
COUNTS = (40, 60)  # instants of the two logs
STEP = 0.1
P = 13


@pytest.fixture(scope="module")
def target() -> IdentificationTarget:
    return target_of(load_robot("irp6"), Task("irp6"))


@pytest.fixture(scope="module")
def result(target: IdentificationTarget) -> Identification:
    """Three equations, two logs that begin at 5 s and at 100 s, thirteen parameters with a history."""
    rng = np.random.default_rng(1)
    instants = np.concatenate([5.0 + STEP * np.arange(COUNTS[0]), 100.0 + STEP * np.arange(COUNTS[1])])
    m = 3 * instants.size
    W, beta = rng.standard_normal((m, P)), np.linspace(1.0, 20.0, P)
    observations = Observations(
        W=W,
        y=W @ beta + 0.3 * rng.standard_normal(m),
        names=target.base.names,
        units=target.base.units,
        equation=np.tile(np.arange(3), instants.size),
        equations=EQUATIONS,
        log=np.repeat([0, 1], [3 * count for count in COUNTS]),
        logs=("/logs/first.csv", "/logs/second.csv"),
        time=np.repeat(instants, 3),
    )
    estimate = Estimate(
        method="recursive",
        names=observations.names,
        units=observations.units,
        values=beta + 0.01,
        covariance=np.diag(np.geomspace(1e-6, 1e4, P)),
        noise=np.full((2, 3), 0.3),
        degrees_of_freedom=m - P,
        history=(instants, beta + 0.01 + np.exp(-np.arange(instants.size))[:, None] * np.arange(P)),
    )
    data = FitData(target, (), observations)
    return Identification(load_robot("irp6"), Task("irp6"), Recipe(), estimate, 12.0, data)


def observing(result: Identification, observations: Observations) -> Identification:
    """The result of other equations."""
    return replace(result, data=replace(result.data, observations=observations))


@pytest.fixture(scope="module")
def known(result: Identification) -> Identification:
    """With known values: one inside its interval by a half, one outside by three, one unknown, the others met."""
    values, half = result.estimate.values.copy(), result.estimate.half_width
    values[0] -= 0.5 * half[0]
    values[1] += 3.0 * half[1]
    values[2] = np.nan
    return replace(result, reference=ReferenceValues("truth", values))


def with_unseen(result: Identification, *unseen: int) -> Identification:
    estimate = result.estimate
    values, covariance = estimate.values.copy(), estimate.covariance.copy()
    values[list(unseen)] = np.nan
    covariance[list(unseen), list(unseen)] = np.inf
    names = tuple(estimate.names[k] for k in unseen)
    changed = replace(estimate, values=values, covariance=covariance, unseen=names, fit=estimate.values)
    return replace(result, estimate=changed)


def curve(ax: Axes, colour: str) -> np.ndarray:
    """Ordinates of the longest line of a colour, without its gaps."""
    line = max((line for line in ax.lines if line.get_color() == colour), key=lambda line: len(line.get_xdata()))
    values = np.asarray(line.get_ydata(), dtype=float)
    return values[np.isfinite(values)]


MEASURED_COLOUR, PREDICTED_COLOUR = MEASURED["color"], PREDICTED["color"]


def legend_texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def texts_of(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


# --- torques and residuals


def test_torques_are_the_measured_and_predicted_rows_of_each_equation(result: Identification) -> None:
    figure = torques_figure(result)
    observations = result.observations
    assert len(figure.axes) == 2 * len(EQUATIONS)
    for j, (ax, below) in enumerate(zip(figure.axes[::2], figure.axes[1::2], strict=True)):
        own = np.arange(observations.y.size) % 3 == j
        predicted = observations.W[own] @ result.estimate.values
        np.testing.assert_array_equal(curve(ax, MEASURED_COLOUR), observations.y[own])
        np.testing.assert_allclose(curve(ax, PREDICTED_COLOUR), predicted, rtol=1e-13)
        e = observations.y[own] - predicted
        np.testing.assert_allclose(curve(below, DARK), e, rtol=0, atol=1e-12)
        assert below.get_xlim() == ax.get_xlim()
        ratio = 100 * np.linalg.norm(e) / np.linalg.norm(observations.y[own])
        note = ax.get_title(loc="right")
        assert float(note.removeprefix("rms error ").split()[0]) == pytest.approx(np.sqrt(np.mean(e**2)), rel=5e-3)
        assert float(note.split(": ")[1].removesuffix(" %")) == pytest.approx(ratio, rel=5e-3)
        assert ax.get_title(loc="left") == EQUATIONS[j][0]
    assert [ax.get_ylabel() for ax in figure.axes[::2]] == ["torque [Nm]", "torque [Nm]", "force [N]"]
    assert legend_texts(figure) == ["measured", "predicted by the estimate", "residual"]


def test_logs_stand_apart_and_keep_their_own_times(result: Identification) -> None:
    figure = torques_figure(result)
    above, ax = figure.axes[-2:]
    (band,) = [p for p in ax.patches if isinstance(p, Rectangle)]
    (line,) = [line for line in above.lines if line.get_color() == MEASURED_COLOUR]
    places = np.asarray(line.get_xdata())
    assert places[COUNTS[0] - 1] == pytest.approx(band.get_x())
    assert places[-COUNTS[1]] == pytest.approx(band.get_x() + band.get_width())
    assert band.get_width() > 0
    assert np.isnan(line.get_ydata()[COUNTS[0]])
    figure.draw_without_rendering()
    shown = [float(label.get_text()) for label in ax.get_xticklabels()]
    assert {5.0 <= t <= 9.0 or 100.0 <= t <= 106.0 for t in shown} == {True}
    for tick, own in zip(ax.get_xticks(), shown, strict=True):
        begin = 5.0 if own < 50 else places[-COUNTS[1]]
        assert tick - begin == pytest.approx(own - (5.0 if own < 50 else 100.0), abs=1e-9)
    assert {"first", "second", "time in each log [s]"} <= set(texts_of(figure))


@pytest.mark.parametrize("draw", [torques_figure, residuals_figure])
def test_rows_of_some_logs_and_equations_alone_are_drawn(result: Identification, draw: object) -> None:
    observations = result.observations
    own = np.flatnonzero((observations.equation == 0) & (observations.log == 0))
    cut = replace(observations.rows(own), equations=(("work", "J"),), logs=("one.csv",))
    figure = draw(observing(result, cut))
    assert figure.axes[0].get_ylabel() == "work [J]"
    assert "time in one [s]" in [ax.get_xlabel() for ax in figure.axes]
    moving = np.flatnonzero(observations.equation != 2)  # a joint that rests has no rows and no panel
    texts = texts_of(draw(observing(result, observations.rows(moving))))
    assert {"q1", "q2", "slide"} & set(texts) == {"q1", "q2"}


def test_residuals_and_their_autocorrelation_are_drawn(result: Identification) -> None:
    figure = residuals_figure(result)
    observations = result.observations
    assert len(figure.axes) == 2 * len(EQUATIONS)
    for j in range(3):
        over_time, over_lag = figure.axes[2 * j : 2 * j + 2]
        own = observations.equation == j
        e = observations.y[own] - observations.W[own] @ result.estimate.values
        np.testing.assert_allclose(curve(over_time, DARK), e, rtol=0, atol=1e-12)
        (line,) = [line for line in over_lag.lines if line.get_color() == BLUE]
        np.testing.assert_allclose(line.get_xdata(), STEP * np.arange(7), rtol=1e-9)
        (band,) = [p for p in over_lag.patches if p.get_facecolor() == to_rgba(BAND)]
        assert band.get_height() == pytest.approx(2 * 2.5758 / np.sqrt(sum(COUNTS)))
    assert figure.axes[-1].get_xlabel() == "lag [s]"


def test_curves_break_where_rows_were_left_out_and_lags_share_an_axis(result: Identification) -> None:
    first = np.flatnonzero((result.observations.equation == 1) & (result.observations.log == 0))
    kept = np.setdiff1d(np.arange(result.observations.y.size), first[10:16])
    some = observing(result, result.observations.rows(kept))
    for figure, colour in ((residuals_figure(some), DARK), (torques_figure(some), MEASURED_COLOUR)):
        lines = [line.get_ydata() for line in figure.axes[2].lines if line.get_color() == colour]
        gaps = [np.flatnonzero(np.isnan(y)).tolist() for y in lines if len(y) > 2]
        assert gaps == [[10, COUNTS[0] - 6 + 1]]  # the second one is between the logs
    assert len({ax.get_xlim() for ax in residuals_figure(some).axes[1::2]}) == 1


def test_an_envelope_has_the_percentiles_of_its_stretches() -> None:
    values = np.random.default_rng(3).normal(size=1003)
    values[200:300] = np.nan
    edges, bands = envelope(values, 10)
    assert (edges[0], edges[-1], bands.shape) == (0, 1003, (5, 10))
    for k in range(10):
        part = np.sort(values[edges[k] : edges[k + 1]])
        part = part[np.isfinite(part)]
        assert np.isnan(bands[:, k]).all() == (part.size == 0)
        if part.size:
            expected = [np.interp(p / 100 * (part.size - 1), np.arange(part.size), part) for p in PERCENTILES]
            np.testing.assert_allclose(bands[:, k], expected)


def test_long_logs_have_bands_in_place_of_a_solid_block(result: Identification) -> None:
    count = 2 * DENSE
    rng = np.random.default_rng(4)
    observations = replace(
        result.observations,
        W=rng.standard_normal((3 * count, P)),
        y=rng.standard_normal(3 * count),
        equation=np.tile(np.arange(3), count),
        log=np.zeros(3 * count, dtype=int),
        logs=("long.csv",),
        time=np.repeat(0.01 * np.arange(count), 3),
    )
    shown = observing(result, observations)
    for figure, panels in ((torques_figure(shown), slice(1, None, 2)), (residuals_figure(shown), slice(0, None, 2))):
        for ax in figure.axes[panels]:
            assert len(ax.collections) == 2
            assert np.ptp(ax.dataLim.intervalx) == pytest.approx(0.01 * (count - 1))
            assert max(len(line.get_xdata()) for line in ax.lines) < 1000
        assert {"median of the residuals", "90 % of the residuals", "all of them"} <= set(legend_texts(figure))


def test_autocorrelation_stays_within_logs_and_weighs_them_by_their_own_size() -> None:
    rng = np.random.default_rng(2)
    first, second = rng.standard_normal(50), 100.0 * rng.standard_normal(70)
    found = autocorrelation(np.concatenate([first, second]), np.repeat([0, 1], [50, 70]), 5)
    scaled = [first / np.sqrt(np.mean(first**2)), second / np.sqrt(np.mean(second**2))]
    for lag in range(6):
        expected = sum(sum(e[t] * e[t + lag] for t in range(len(e) - lag)) for e in scaled) / 120
        assert found[lag] == pytest.approx(expected, abs=1e-12)
    np.testing.assert_array_equal(autocorrelation(np.zeros(9), np.zeros(9, dtype=int), 3), np.zeros(4))


# --- long and several logs on one axis


def test_extremes_keep_every_peak_and_both_ends() -> None:
    values = np.sin(np.arange(40_000.0))
    values[[7, 20_001, 39_990]] = [9.0, -8.0, 7.0]
    kept = extremes(values)
    assert kept.size <= 2 * BINS + 2
    assert {0, 7, 20_001, 39_990, 39_999} <= set(kept.tolist())
    assert np.all(np.diff(kept) > 0)
    np.testing.assert_array_equal(extremes(np.arange(5.0)), np.arange(5))  # drawn whole
    values = np.ones(10_000)
    values[4000:4100] = np.nan
    assert np.any(np.isnan(values[extremes(values)]))


def test_long_names_keep_both_ends() -> None:
    names = {("abcdef", 6): "abcdef", ("abcdefgh", 5): "ab…gh", ("abcdefgh", 6): "ab…fgh"}
    assert {name: ends(*name) for name in names} == names


# --- parameters


def test_differences_are_in_half_widths_in_groups_with_numbers_and_units(known: Identification) -> None:
    figure = parameters_figure(known)
    ax = figure.axes[0]
    dots = [line for line in ax.lines if line.get_marker() == "o"]
    x = [float(line.get_xdata()[0]) for line in dots]
    np.testing.assert_allclose(x, [0.5, -3.0, *[0.0] * (P - 3)], rtol=0, atol=1e-9)
    assert [line.get_color() for line in dots] == [BLUE, VERMILLION, *[BLUE] * (P - 3)]
    (band,) = [p for p in ax.patches if p.get_facecolor() == to_rgba(BAND)]
    assert (band.get_x(), band.get_width()) == (-1.0, 2.0)
    assert "11 of 12 intervals contain it" in ax.get_title(loc="left")
    assert ax.get_xlabel() == "difference / half-width of the interval"
    texts = texts_of(figure)
    assert [text for text in texts if text in ("Links", "Rotors", "Friction", "Other")] == ["Links", "Friction"]
    assert {"X7 = m2c2x + l2 m3", "X3 = I2zz + l2² m3 + I3zz + n2² Ia2\n+ n3² Ia3", "F1c", "true"} <= set(texts)
    assert not any("\N{HORIZONTAL ELLIPSIS}" in text for text in texts)
    half = known.estimate.half_width[known.names.index("F1v")]
    assert f"± {decimal(half, half)} Nm s/rad" in texts


def test_half_widths_are_in_percent_and_those_beyond_the_axis_have_their_number(result: Identification) -> None:
    (ax,) = parameters_figure(result).axes
    bars = [p for p in ax.patches if p.get_facecolor() == to_rgba(BLUE)]
    percent = 100 * result.estimate.half_width / np.abs(result.estimate.values)
    np.testing.assert_allclose([bar.get_width() for bar in bars], np.minimum(percent, 300.0), rtol=1e-12)
    assert ax.get_xlabel() == "half-width of the interval / |value| [%]"
    assert ax.get_xlim()[1] == 300.0
    cut = [text.get_text() for text in ax.texts if text.get_text().endswith("\N{RIGHTWARDS ARROW}")]
    shown = [float(text.split()[0].replace(",", "")) for text in cut]
    assert shown == pytest.approx(percent[percent > 300.0].tolist(), rel=0.06)
    assert len(cut) >= 2
    (shaded,) = [p for p in ax.patches if p.get_facecolor() == to_rgba(FORBIDDEN)]
    assert shaded.get_x() == 100.0


def test_a_parameter_of_zero_is_not_measured_by_its_value(result: Identification) -> None:
    values = result.estimate.values.copy()
    values[0] = 0.0
    zero = replace(result, estimate=replace(result.estimate, values=values))
    texts = texts_of(parameters_figure(zero))
    assert "over 1,000,000 % \N{RIGHTWARDS ARROW}" in texts


def test_parameters_that_the_data_does_not_show_have_a_row_that_says_so(known: Identification) -> None:
    figure = parameters_figure(with_unseen(known, 1, 7))
    assert texts_of(figure).count("not identifiable individually") == 2
    assert "2 not identifiable individually" in figure.get_suptitle()
    dots = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert len(dots) == P - 3


def test_far_differences_leave_the_interval_visible(result: Identification) -> None:
    far = ReferenceValues("description", result.estimate.values - 1e5 * result.estimate.half_width)
    ax = parameters_figure(replace(result, reference=far)).axes[0]
    assert ax.get_xscale() == "symlog"
    assert ax.get_xlim()[1] > 1e5
    left, right = (ax.transData.transform((x, 0.0))[0] for x in (-1.0, 1.0))
    assert right - left > 0.05 * ax.bbox.width
    unknown = ReferenceValues("description", np.full(P, np.nan))  # drawn like no reference
    assert len(parameters_figure(replace(result, reference=unknown)).axes) == 1


def test_differences_are_unknown_without_an_interval() -> None:
    values, half = np.array([1.0, 1.0, np.nan, 1.0, 4.0]), np.array([0.0, np.inf, 1.0, 2.0, 2.0])
    known = np.array([1.0, 1.0, 1.0, np.nan, 1.0])
    np.testing.assert_array_equal(differences(values, half, known), [np.nan, np.nan, np.nan, np.nan, 1.5])


def test_values_are_written_as_far_as_their_interval_gives_meaning() -> None:
    texts = {(27.95301, 0.0793): "27.953", (-0.00082, 0.036): "-0.001", (-0.00002, 0.036): "0.000"}
    texts |= {(1234.5, 56.0): "1234", (1234.5, 560.0): "1230", (2.5e-6, 3.2e-7): "2.50e-06", (1e-9, 3.2e-7): "0"}
    texts |= {(0.25, 0.0): "0.2500", (0.25, np.inf): "0.2500"}
    assert {pair: decimal(*pair) for pair in texts} == texts


# --- estimates over time


def test_estimates_over_time_end_at_the_value_with_its_interval(known: Identification) -> None:
    figure, estimate = estimates_figure(known), known.estimate
    assert len(figure.axes) == P
    for k, ax in enumerate(figure.axes):
        np.testing.assert_array_equal(curve(ax, BLUE), estimate.history[1][:, k])
        (final,) = [line for line in ax.lines if line.get_color() == DARK]
        assert final.get_ydata()[0] == estimate.values[k]
        (band,) = [p for p in ax.patches if p.get_facecolor() == to_rgba(BAND)]
        assert band.get_y() + band.get_height() / 2 == pytest.approx(estimate.values[k])
        assert band.get_height() == pytest.approx(2 * estimate.half_width[k])
        dotted = [float(line.get_ydata()[0]) for line in ax.lines if line.get_linestyle() == ":"]
        assert dotted == ([] if k == 2 else [known.reference.values[k]])
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles[:1] + titles[-1:] == ["X1 [kg m²]", "F3v [Nm s/rad]"]
    assert legend_texts(figure)[-1] == "true value"
    hidden = estimates_figure(replace(with_unseen(known, 4), reference=None)).axes[4]
    assert [p for p in hidden.patches if p.get_facecolor() == to_rgba(BAND)] == []
    assert hidden.get_title(loc="right") == "not shown"
    without = replace(known, estimate=replace(estimate, history=None))
    with pytest.raises(InputError, match="estimator recursive keeps no history"):
        estimates_figure(without)
    assert [each.ending for each in identification_figures(without)] == ["parameters", "torques", "residuals"]


def test_a_reference_out_of_view_is_named_beside_an_arrow(result: Identification) -> None:
    far = result.estimate.values + np.where(np.arange(P) % 2, 1e6, -1e6)
    axes = estimates_figure(replace(result, reference=ReferenceValues("truth", far))).axes
    assert axes[0].get_title(loc="right") == "\N{DOWNWARDS ARROW} \N{MINUS SIGN}999999"
    assert axes[1].get_title(loc="right") == "\N{UPWARDS ARROW} 1.00e+06"
    assert axes[0].get_ylim()[0] > far[0]


def test_range_of_an_estimate_leaves_its_beginning_and_far_references_out() -> None:
    path = np.concatenate([np.full(25, 1e6), np.full(75, 2.0)])
    for known, ends_of in {np.nan: (0.9, 2.1), 3.0: (0.8, 3.2), 50.0: (0.9, 2.1), -1.0: (-1.3, 2.3)}.items():
        assert settled_range(path, 1.5, 0.5, known) == pytest.approx(ends_of)


# --- verification


def made_verification(outcome: Outcome = Outcome.DONE) -> Verification:
    """Three joints over 2 s; the simulated motion drifts, and starts anew at every half second."""
    time = 3.0 + 0.01 * np.arange(201)
    q = np.sin(time[:, None] * np.array([1.0, 2.0, 3.0]))
    samples = Samples(time, q, np.zeros_like(q), np.zeros_like(q), np.zeros_like(q))
    starts = (0, 50, 100, 150)
    drift = 0.1 * (np.arange(201) % 50)[:, None] / 50 * np.ones(3)
    simulated = q + drift
    if outcome is not Outcome.DONE:
        simulated[60:100] = np.nan
    failed_at = None if outcome is Outcome.DONE else float(time[60])
    replay = Replay(outcome, time, simulated, np.zeros_like(q), starts, (*starts[1:], time.size), failed_at, 0.01)
    measured = 10.0 * np.cos(time[:, None] * np.array([1.0, 2.0, 3.0]))
    parts = [(0.7, 0.2, 0.1), (0.02, 0.95, 0.03), (0.0, 0.0, 1.0)]
    torques = tuple(
        TorqueError(name, unit, 7.0, 0.5, 0.5 / 7.0, 1.0, 3.5, *part)
        for (name, unit), part in zip(EQUATIONS, parts, strict=True)
    )
    motions = motion_errors(replay, samples, {"q1": "rad", "q2": "rad", "slide": "m"}) if replay.ok else None
    return Verification(
        robot=built_in("irp6"),
        log=VerifiedLog("/logs/new.csv", "", time.size, float(time[0]), float(time[-1])),
        tolerances=Tolerances(),
        time=time,
        measured=measured,
        predicted=measured + 0.5,
        torques=torques,
        relative_error=0.07,
        training_error=0.05,
        motion=MeasuredMotion(("q1", "q2", "slide"), time, q),
        replay=replay,
        motions=motions,
        verdict=Verdict(),
    )


@pytest.fixture(scope="module")
def verification() -> Verification:
    return made_verification()


def test_predicted_torques_come_with_their_difference(verification: Verification) -> None:
    figure = predicted_torques_figure(verification)
    for j, (ax, below) in enumerate(zip(figure.axes[::2], figure.axes[1::2], strict=True)):
        np.testing.assert_array_equal(curve(ax, MEASURED_COLOUR), verification.measured[:, j])
        np.testing.assert_array_equal(curve(ax, PREDICTED_COLOUR), verification.predicted[:, j])
        np.testing.assert_allclose(curve(below, DARK), -0.5, rtol=0, atol=1e-12)
    assert [ax.get_ylabel() for ax in figure.axes[::2]] == ["torque [Nm]", "torque [Nm]", "force [N]"]
    assert figure.get_suptitle().startswith("new.csv: predicted within ")
    assert figure.get_suptitle().endswith("(training logs: 5.00 %)")


def test_simulated_motion_breaks_where_it_starts_anew(verification: Verification) -> None:
    figure = simulated_motion_figure(verification)
    replay = verification.replay
    assert len(figure.axes) == 6
    for j in range(3):
        over, beside = figure.axes[2 * j : 2 * j + 2]
        np.testing.assert_array_equal(curve(over, MEASURED_COLOUR), verification.motion.q[:, j])
        np.testing.assert_array_equal(curve(over, PREDICTED_COLOUR), replay.q[:, j])
        (line,) = [line for line in beside.lines if line.get_color() == VERMILLION]
        broken = np.flatnonzero(np.isnan(np.asarray(line.get_ydata())))
        np.testing.assert_array_equal(broken, [50, 101, 152])
        (dots,) = [line for line in beside.lines if line.get_marker() == "o"]
        np.testing.assert_array_equal(dots.get_xdata(), replay.time[[0, 50, 100, 150]])
        np.testing.assert_allclose(dots.get_ydata(), 0.0, rtol=0, atol=1e-15)
    assert [ax.get_ylabel() for ax in figure.axes[::2]] == ["position [rad]", "position [rad]", "position [m]"]
    assert "starts at the measured state, anew every 0.50 s" in legend_texts(figure)


def test_windows_that_are_not_simulated_stay_empty(verification: Verification) -> None:
    every = verification.replay
    q = np.full_like(every.q, np.nan)
    rows = np.r_[50:100, 150:201]
    q[rows] = every.q[rows]
    some = replace(every, q=q, starts=(50, 150), stops=(100, 201), left_out=2)
    figure = simulated_motion_figure(replace(verification, replay=some))
    over = figure.axes[0]
    np.testing.assert_array_equal(curve(over, PREDICTED_COLOUR), every.q[rows, 0])
    np.testing.assert_array_equal(curve(over, MEASURED_COLOUR), verification.motion.q[:, 0])
    assert "starts at the measured state, every 0.50 s where it is simulated" in legend_texts(figure)


def test_a_simulation_that_failed_says_where_and_why() -> None:
    figure = simulated_motion_figure(made_verification(Outcome.RAN_AWAY))
    assert figure.axes[0].get_title(loc="right") == "failed at 3.600 s: the motion diverges"
    assert legend_texts(figure)[-1] == "failed"


def test_a_model_without_motion_has_no_figure_of_it(verification: Verification, tmp_path: Path) -> None:
    without = replace(verification, replay=None, motions=None)
    with pytest.raises(InputError, match="no motion was simulated"):
        simulated_motion_figure(without)
    names = [path.name for path in write_figures(verification_view(without, "new"), tmp_path)]
    assert names == ["new_torques.png"]


# --- all of them


@pytest.mark.parametrize(
    "width",
    ["screen", pytest.param("single", marks=pytest.mark.slow), pytest.param("double", marks=pytest.mark.slow)],
)
def test_texts_stay_inside_and_apart(known: Identification, width: str) -> None:
    draws = dict.fromkeys((torques_figure, residuals_figure, parameters_figure, estimates_figure), known)
    draws |= dict.fromkeys((predicted_torques_figure, simulated_motion_figure), made_verification(Outcome.NOT_POSITIVE))
    drawn = drawn_figures(lambda: {draw.__name__: draw(of) for draw, of in draws.items()}, width)
    assert [(name, texts) for name, figure in drawn.items() if (texts := misplaced(figure))] == []
