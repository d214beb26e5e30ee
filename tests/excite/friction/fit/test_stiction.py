"""Break-away torques: of drives with creep before they break loose, as means, and as points of the curve at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from breakaway_ramps import RAMP, RATE, REST, away, planned, ramps, recorded
from played import irp6

from excite.friction.fit.breakaway_tests import broken_loose
from excite.friction.fit.breakaway_torque import break_aways, mean_break_aways, rest_points
from excite.friction.fit.curve_fit import chosen_fit, fit
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.friction_equations import Conditions, Form, forms
from excite.friction.fit.friction_fit import characteristics
from excite.friction.fit.plan_match import Source
from excite.friction.fit.points import Point, described_model, drive_log
from excite.logs.log import Log
from regressors.errors import InputError
from regressors.samples import Array

PAPER = [(14.1, 9.0), (18.0, 28.75), (14.1, 14.1)]  # the second one rises from rest, as the paper's own numbers do


@pytest.mark.parametrize(("stiction", "coulomb"), PAPER)
@pytest.mark.parametrize(("distance", "within"), [(1e-5, 0.03), (1e-4, 0.05)])
@pytest.mark.parametrize("controlled", [False, None])
def test_a_torque_that_rises_by_itself(
    stiction: float, coulomb: float, distance: float, within: float, controlled: bool | None
) -> None:
    """Creep moves the drive by several counts before it breaks loose, and its torque rises on while it sets off."""
    log = recorded(*ramps(stiction, coulomb, distance, controlled=False), noise=0.5)
    found = break_aways(drive_log(log, irp6()), "z1", None, controlled=controlled)
    assert [one.direction for one in found] == [1, -1]
    for one in found:
        assert one.direction * one.torque == pytest.approx(stiction, rel=within)
        assert one.direction * one.rate == pytest.approx(RATE, rel=0.05)
        assert 0.05 < one.deviation < 0.5
    late = log.effort[:, 0].max()  # what the largest torque would say
    assert late > 1.07 * stiction


@pytest.mark.parametrize(("stiction", "coulomb"), PAPER)
@pytest.mark.parametrize("controlled", [True, None])
def test_a_torque_that_a_controller_raises(stiction: float, coulomb: float, controlled: bool | None) -> None:
    log = recorded(*ramps(stiction, coulomb, 1e-5, controlled=True), noise=0.1)
    found = break_aways(drive_log(log, irp6()), "z1", None, controlled=controlled)
    assert [one.direction for one in found] == [1, -1]
    assert [one.direction * one.torque for one in found] == pytest.approx([stiction] * 2, rel=0.03)


def test_noise_does_not_make_torque_ramps_of_a_plan_those_of_a_controller() -> None:
    """Of a log by itself a few in a hundred are taken for one, and read where the torque is largest."""
    plan = planned("z1", 1.0)
    by_itself, by_plan = [], []
    for seed in range(24):
        part = drive_log(recorded(*ramps(14.1, 9.0, 1e-5, controlled=False), noise=1.0, seed=seed), irp6())
        by_itself += [abs(one.torque) for one in break_aways(part, "z1", None)]
        by_plan += [
            abs(o.torque) for o in broken_loose("z1", [Source(0, part, None)], FitSettings(gravity="none"), plan)
        ]
    assert max(by_itself) > 14.7
    assert len(by_plan) == 48
    assert by_plan == pytest.approx([14.1] * 48, abs=0.45)


def test_ramps_alone_are_not_enough() -> None:
    ahead = recorded(*ramps(14.1, 9.0, 1e-5, controlled=False), noise=0.1)
    plan = planned("z1", 1.0)
    with pytest.raises(InputError, match="z1: the logs contain break-away tests, but no runs at constant speed"):
        characteristics(irp6(), [ahead], FitSettings(), described_model, None, {"z1": plan})


def with_runs(t: Array, z: Array, tau: Array) -> Log:
    """Ramps, then runs there and back at several speeds in the same log."""
    runs = [np.zeros(250)]
    for speed in (0.1, 0.2, 0.4, 0.7, 1.0):
        ramp = np.linspace(0.0, speed, 100)
        there = np.concatenate([ramp, np.full(400, speed), ramp[::-1], np.zeros(200)])
        runs += [there, -there]
    v = np.concatenate(runs)
    way = np.cumsum(v) / 500.0
    friction = (9.0 + 5.1 * np.exp(-np.abs(v) / 0.12)) * np.sign(v) + 25.0 * v
    later = np.r_[tau, friction + 8.0 * np.gradient(v, 0.002)]
    return recorded(np.arange(t.size + v.size) / 500.0, np.r_[z, z[-1] + way], later, 0.3)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "4 break-away torques are points of the curve at speed zero"),
        ({"stiction": "report"}, "break-away torques are not in the curve: `stiction='report'`"),
        (
            {"model": "coulomb-viscous"},
            "break-away torques are not in the curve: `model='coulomb-viscous'` has no",
        ),
        ({"model": "table"}, "break-away torques are not in the curve: `model='table'` has no stiction"),
        ({"gravity": "symmetric"}, "2 pairs of break-away torques are points of the curve at speed zero"),
    ],
)
def test_what_becomes_of_break_aways_is_said(settings: dict[str, str], message: str) -> None:
    t, z, tau = ramps(14.1, 9.0, 1e-5, controlled=False)
    log = with_runs(np.r_[t, t], np.r_[z, z[-1] + z], np.r_[tau, tau])
    (one,) = characteristics(irp6(), [log], FitSettings(**settings), described_model, ("z1",))
    assert any(note.startswith(message) for note in one.notes)
    assert len(one.rests) == (0 if "not in the curve" in message else int(message[0]))
    assert [mean.count for mean in mean_break_aways(one.stiction)] == [2, 2]


@pytest.mark.parametrize(
    ("share", "counts", "message"),
    [
        (
            1.0,
            [1, 1],
            "without a plan, a break-away torque counts only if another one in the same direction repeats it",
        ),
        (0.3, [], "2 ramps that end in motion not counted: torque less than 0.5 times the friction"),
    ],
)
def test_without_a_plan_one_ramp_or_a_small_one_is_no_point_of_the_curve(
    share: float, counts: list[int], message: str
) -> None:
    t, z, tau = ramps(14.1, 9.0, 1e-5, controlled=False)
    (one,) = characteristics(irp6(), [with_runs(t, z, share * tau)], FitSettings(), described_model, ("z1",))
    assert any(note.startswith(message) for note in one.notes)
    assert one.rests == ()
    assert [mean.count for mean in mean_break_aways(one.stiction)] == counts
    assert any(note.startswith("the curve has no break-away torques: stiction is extrap") for note in one.notes)


def test_spans_limit_where_ramps_are_looked_for() -> None:
    measured = drive_log(recorded(*ramps(14.1, 9.0, 1e-5, controlled=False), noise=0.1), irp6())
    (one,) = break_aways(measured, "z1", None, spans=[(REST + RAMP, 2 * (REST + RAMP))])
    assert one.direction == -1


def test_gravity_about_a_balanced_pose_is_taken_off() -> None:
    t, z, tau = ramps(14.1, 9.0, 1e-5, controlled=True)
    measured = drive_log(recorded(t, z, tau - 60.0 * (z - 0.01), noise=0.1), irp6())
    plain, level = (
        [one.torque for one in break_aways(measured, "z1", None, controlled=True, balance=balance)]
        for balance in (None, lambda z: -60.0 * (z - 0.01))
    )
    assert level == pytest.approx([14.1, -14.1], rel=0.03)
    assert np.subtract(plain, level) == pytest.approx([0.6 - 60 * 3e-3] * 2, abs=0.2)


def test_setting_off_is_no_ramp() -> None:
    """A controller that sets off raises the torque at once; one whose torque drifts at rest does not move."""
    t = np.arange(0.0, 6.0, 0.002)
    z = 0.3 * np.clip(t - 2.0, 0.0, 1.0) - 0.3 * np.clip(t - 4.0, 0.0, 1.0)
    tau = np.where((t > 2.0) & (t < 3.0), 20.0, np.where((t > 4.0) & (t < 5.0), -20.0, 3.0))
    assert break_aways(drive_log(recorded(t, z, tau, 0.2), irp6()), "z1", None) == ()
    assert break_aways(drive_log(recorded(t, np.zeros_like(t), 3.0 * t, 0.2), irp6()), "z1", None) == ()


def test_means_have_the_interval_of_students_t() -> None:
    ahead, behind = mean_break_aways([away(14.0), away(-10.0, 0.3), away(15.0), away(14.5)])
    assert (ahead.direction, ahead.count, behind.direction, behind.count) == (1, 3, -1, 1)
    low, high = scipy.stats.t.interval(0.99, 2, loc=14.5, scale=scipy.stats.sem([14.0, 15.0, 14.5]))
    assert (ahead.torque - ahead.interval99, ahead.torque + ahead.interval99) == pytest.approx((low, high))
    assert behind.torque == -10.0
    assert behind.interval99 == pytest.approx(2.5758 * 0.3, rel=1e-4)
    (alike,) = mean_break_aways([away(14.0), away(14.0)])
    assert alike.interval99 == pytest.approx(2.5758 * 0.1, rel=1e-4)


def test_points_at_rest_are_as_doubtful_as_the_repeats_scatter() -> None:
    rests = rest_points([away(14.0), away(-10.0), away(15.0), away(-10.6)])
    assert [np.copysign(1.0, p.speed) for p in rests] == [1, 1, -1, -1]
    assert [p.speed for p in rests] == [0.0] * 4
    pooled = np.sqrt((2 * 0.5**2 + 2 * 0.3**2) / 2) * scipy.stats.t.ppf(0.995, 2) / scipy.stats.norm.ppf(0.995)
    assert [p.deviation for p in rests] == pytest.approx([pooled] * 4)
    assert rest_points([away(14.0, 0.2)])[0].deviation == 0.2
    misread = rest_points([away(14.0, 0.2), away(14.1, 0.2), away(14.0, 0.2), replace(away(14.0, 0.2), log=1)])
    assert [p.deviation for p in misread] == pytest.approx([0.2 * np.sqrt(3)] * 3 + [0.2])
    (both,) = rest_points([away(14.0), away(-10.0), away(15.0)], paired=True)
    assert both.torque == 12.0
    assert np.copysign(1.0, both.speed) == 1.0


@pytest.mark.parametrize("asymmetric", [False, True])
def test_a_curve_at_rest_has_a_value_in_each_direction(asymmetric: bool) -> None:
    form = Form("any", True, asymmetric)
    p = np.array([9.0, 25.0, 14.1, 0.1, *([7.0, 20.0, 10.6, 0.2] if asymmetric else [0.5])])
    f, J = form.values(p, Conditions.of(np.array([0.0, -0.0])))
    assert f == pytest.approx([14.1, -10.6] if asymmetric else [14.6, -13.6])
    for k in range(p.size):
        ahead, behind = (
            form.values(p + s * np.eye(p.size)[k], Conditions.of(np.array([0.0, -0.0])))[0] for s in (1e-6, -1e-6)
        )
        assert J[:, k] == pytest.approx((ahead - behind) / 2e-6, abs=1e-6)


TUSTIN = Form("tustin", stribeck=True)
TRUE = np.array([9.0, 25.0, 14.1, 0.1, 0.4])


def windows(p: Array, speeds: Array, seed: int, form: Form = TUSTIN, sigma: float = 0.05) -> list[Point]:
    v = np.r_[speeds, -speeds]
    tau = form.values(p, Conditions.of(v))[0] + np.random.default_rng(seed).normal(0.0, sigma, v.size)
    return [Point(x, y, sigma, 0.0, 0.3, 0) for x, y in zip(v.tolist(), tau.tolist(), strict=True)]


def rests(p: Array, seed: int, form: Form = TUSTIN, sigma: float = 0.1) -> tuple[Point, ...]:
    v = np.tile([0.0, -0.0], 3)
    tau = form.values(p, Conditions.of(v))[0] + np.random.default_rng(1000 + seed).normal(0.0, sigma, v.size)
    return rest_points([away(x, sigma) for x in tau.tolist()])


SPEEDS = np.array([0.06, 0.13, 0.25, 0.4, 0.6, 0.9, 1.2])


@pytest.mark.slow
def test_break_aways_narrow_the_interval_of_stiction_and_it_holds() -> None:
    inside, narrower = [], []
    for seed in range(60):
        plain, more = windows(TRUE, SPEEDS, seed), rests(TRUE, seed)
        found = fit([*plain, *more], TUSTIN)
        inside.append(np.abs(found.values - TRUE) <= found.halfwidth)
        narrower.append(found.halfwidth[2] / fit(plain, TUSTIN).halfwidth[2])
    assert np.mean(inside) > 0.97
    assert np.median(narrower) < 0.5


@pytest.mark.parametrize("stiction", [14.1, 6.0])
def test_friction_at_rest_chooses_a_form_that_can_follow_it(stiction: float) -> None:
    """Windows alone show a straight line; break-aways above or below it are followed."""
    p = np.array([9.0, 25.0, stiction, 0.04, 0.0])
    points = windows(p, SPEEDS[2:], 1)
    candidates = forms("auto", 1.0, offset=True)
    assert chosen_fit(points, candidates, "bic")[0].form.stribeck is False
    best, others, _ = chosen_fit([*points, *rests(p, 1)], candidates, "bic")
    assert best.form.stribeck
    assert best.values[2] == pytest.approx(stiction, abs=3 * best.halfwidth[2])
    assert best.bic < min(one.bic for one in others if not one.form.stribeck) - 10


@pytest.mark.parametrize("seed", [0, 4, 7])
def test_a_fall_that_no_window_shows_is_held_at_its_bound(seed: int) -> None:
    p = np.array([9.0, 25.0, 14.1, 0.004, 0.4])
    found = fit([*windows(p, SPEEDS[1:], seed), *rests(p, seed)], TUSTIN)
    assert found.held == ("stribeck",)
    assert found.values[3] == pytest.approx(SPEEDS[1] / 5.0)
    free = [0, 1, 2, 4]
    assert np.all(np.abs(found.values - p)[free] < found.halfwidth[free])
    assert found.halfwidth[3] == 0.0
    assert float(found.curve.torque(0.5)) == pytest.approx(9.0 + 12.5 + 0.4, abs=0.2)


def test_points_at_rest_may_be_warm_and_loaded() -> None:
    one = replace(away(14.1), temperature=31.0, load=2.5)
    (point,) = rest_points([one])
    assert (point.temperature, point.load) == (31.0, 2.5)
