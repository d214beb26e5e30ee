"""Break-away torques: which count, with creep before them, as means, and as points of the curve at rest."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.stats
from breakaway_ramps import RAMP, RATE, REST, away, planned, ramps, recorded, without
from played import irp6

from excite.design.friction_runs.schedule import Ramp
from excite.friction.breakaway_tests import breakaway_notes, broken_loose, plausible_break_aways
from excite.friction.breakaway_torque import break_aways, mean_break_aways, rest_points
from excite.friction.constant_speed_windows import FitSettings
from excite.friction.curve_fit import chosen_fit, fit
from excite.friction.data_set import sources_of
from excite.friction.friction_equations import Conditions, Form, forms
from excite.friction.friction_fit import characteristics
from excite.friction.plan_match import PlanMatch, Source, match_ramps
from excite.friction.points import Point, described_model, drive_log
from excite.logs.log import Log
from regressors.errors import InputError
from regressors.samples import Array

PAPER = [(14.1, 9.0), (18.0, 28.75), (14.1, 14.1)]  # the second one rises from rest, as the paper's own numbers do


@pytest.mark.parametrize(("stiction", "coulomb"), PAPER)
@pytest.mark.parametrize(("distance", "within"), [(1e-5, 0.03), (1e-4, 0.05)])
def test_a_torque_that_rises_by_itself(stiction: float, coulomb: float, distance: float, within: float) -> None:
    """Creep moves the drive by several counts before it breaks loose, and its torque rises on while it sets off."""
    log = recorded(*ramps(stiction, coulomb, distance, controlled=False), noise=0.5)
    assert log.effort[:, 0].max() > 1.07 * stiction  # what the largest torque would say
    for controlled in (False, None):
        found = break_aways(drive_log(log, irp6()), "z1", None, controlled=controlled)
        assert [one.direction for one in found] == [1, -1]
        for one in found:
            assert one.direction * one.torque == pytest.approx(stiction, rel=within)
            assert one.direction * one.rate == pytest.approx(RATE, rel=0.05)
            assert 0.05 < one.deviation < 0.5


@pytest.mark.parametrize(("stiction", "coulomb"), PAPER)
def test_a_torque_that_a_controller_raises(stiction: float, coulomb: float) -> None:
    log = recorded(*ramps(stiction, coulomb, 1e-5, controlled=True), noise=0.1)
    for controlled in (True, None):
        found = break_aways(drive_log(log, irp6()), "z1", None, controlled=controlled)
        assert [one.direction for one in found] == [1, -1]
        assert [one.direction * one.torque for one in found] == pytest.approx([stiction] * 2, rel=0.03)


def test_noise_does_not_make_torque_ramps_of_a_plan_those_of_a_controller() -> None:
    """Of a log by itself a few in a hundred are taken for one, and read where the torque is largest."""
    plan, settings = planned("z1", 1.0), FitSettings(gravity="none")
    by_itself, by_plan = [], []
    for seed in range(24):
        part = drive_log(recorded(*ramps(14.1, 9.0, 1e-5, controlled=False), noise=1.0, seed=seed), irp6())
        by_itself += [abs(one.torque) for one in break_aways(part, "z1", None)]
        by_plan += [abs(one.torque) for one in broken_loose("z1", [Source(part, None)], settings, plan)]
    assert max(by_itself) > 14.7
    assert by_plan == pytest.approx([14.1] * 48, abs=0.45)


def test_ramps_alone_are_not_enough_nor_a_log_that_ends_before_the_first_window_of_its_plan() -> None:
    for controlled, begin, message in (
        (False, 1.0, "z1: the logs contain break-away tests, but no runs at constant speed"),
        (True, 51.0, r"z1: ramps.csv ends after 7.798 s, before the first window .* begins 51 s"),
    ):
        log = recorded(*ramps(14.1, 9.0, 1e-5, controlled=controlled), noise=0.1)
        with pytest.raises(InputError, match=message):
            characteristics(irp6(), [log], FitSettings(), described_model, None, {"z1": planned("z1", begin)})


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


TWICE = "2 ramps that end in motion not counted: torque less than 0.5 times the friction"
ALONE = "without a plan, a break-away torque counts only if another one in the same direction repeats it"


@pytest.mark.parametrize(
    ("settings", "share", "rests", "message"),
    [
        ({}, 1.0, 4, "4 break-away torques are points of the curve at speed zero"),
        ({"stiction": "report"}, 1.0, 0, "break-away torques are not in the curve: `stiction='report'`"),
        ({"model": "coulomb-viscous"}, 1.0, 0, "break-away torques are not in the curve: `model='coulomb-viscous'`"),
        ({"model": "table"}, 1.0, 0, "break-away torques are not in the curve: `model='table'` has no stiction"),
        ({"gravity": "symmetric"}, 1.0, 2, "2 pairs of break-away torques are points of the curve at speed zero"),
        (None, 1.0, 0, ALONE),
        (None, 0.3, 0, TWICE),
    ],
)
def test_what_becomes_of_break_aways_is_said(settings: dict | None, share: float, rests: int, message: str) -> None:
    """Without a plan one ramp or a small one (settings None) is no point of the curve."""
    t, z, tau = ramps(14.1, 9.0, 1e-5, controlled=False)
    twice = (np.r_[t, t], np.r_[z, z[-1] + z], np.r_[tau, tau])
    log = with_runs(t, z, share * tau) if settings is None else with_runs(*twice)
    (one,) = characteristics(irp6(), [log], FitSettings(**(settings or {})), described_model, ("z1",))
    assert any(note.startswith(message) for note in one.notes)
    assert len(one.rests) == rests
    counts = [mean.count for mean in mean_break_aways(one.stiction)]
    assert counts == ([2, 2] if settings is not None else [1, 1] if share == 1.0 else [])
    extrapolated = any(note.startswith("the curve has no break-away torques: stiction is extrap") for note in one.notes)
    assert extrapolated or settings is not None


def test_gravity_about_a_balanced_pose_is_taken_off() -> None:
    t, z, tau = ramps(14.1, 9.0, 1e-5, controlled=True)
    measured = drive_log(recorded(t, z, tau - 60.0 * (z - 0.01), noise=0.1), irp6())
    plain, level = (
        [one.torque for one in break_aways(measured, "z1", balance, controlled=True)]
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
    assert (behind.torque, behind.interval99) == (-10.0, pytest.approx(2.5758 * 0.3, rel=1e-4))
    (alike,) = mean_break_aways([away(14.0), away(14.0)])
    assert alike.interval99 == pytest.approx(2.5758 * 0.1, rel=1e-4)


def test_points_at_rest_are_as_doubtful_as_the_repeats_scatter() -> None:
    rests = rest_points([away(14.0), away(-10.0), away(15.0), away(-10.6)])
    assert [(p.speed, np.copysign(1.0, p.speed)) for p in rests] == [(0.0, 1), (0.0, 1), (0.0, -1), (0.0, -1)]
    pooled = np.sqrt((2 * 0.5**2 + 2 * 0.3**2) / 2) * scipy.stats.t.ppf(0.995, 2) / scipy.stats.norm.ppf(0.995)
    assert [p.deviation for p in rests] == pytest.approx([pooled] * 4)
    assert rest_points([away(14.0, 0.2)])[0].deviation == 0.2
    misread = rest_points([away(14.0, 0.2), away(14.1, 0.2), away(14.0, 0.2), replace(away(14.0, 0.2), log=1)])
    assert [p.deviation for p in misread] == pytest.approx([0.2 * np.sqrt(3)] * 3 + [0.2])
    (both,) = rest_points([away(14.0), away(-10.0), away(15.0)], paired=True)
    assert (both.torque, np.copysign(1.0, both.speed)) == (12.0, 1.0)
    (point,) = rest_points([replace(away(14.1), temperature=31.0, load=2.5)])
    assert (point.temperature, point.load) == (31.0, 2.5)


@pytest.mark.parametrize("asymmetric", [False, True])
def test_a_curve_at_rest_has_a_value_in_each_direction(asymmetric: bool) -> None:
    form, at = Form("any", True, asymmetric), Conditions.of(np.array([0.0, -0.0]))
    p = np.array([9.0, 25.0, 14.1, 0.1, *([7.0, 20.0, 10.6, 0.2] if asymmetric else [0.5])])
    assert form.values(p, at)[0] == pytest.approx([14.1, -10.6] if asymmetric else [14.6, -13.6])


TUSTIN = Form("tustin", stribeck=True)
TRUE = np.array([9.0, 25.0, 14.1, 0.1, 0.4])


def windows(p: Array, speeds: Array, seed: int) -> list[Point]:
    v = np.r_[speeds, -speeds]
    tau = TUSTIN.values(p, Conditions.of(v))[0] + np.random.default_rng(seed).normal(0.0, 0.05, v.size)
    return [Point(x, y, 0.05, 0.0, 0.3, 0) for x, y in zip(v.tolist(), tau.tolist(), strict=True)]


def rests(p: Array, seed: int) -> tuple[Point, ...]:
    v = np.tile([0.0, -0.0], 3)
    tau = TUSTIN.values(p, Conditions.of(v))[0] + np.random.default_rng(1000 + seed).normal(0.0, 0.1, v.size)
    return rest_points([away(x) for x in tau.tolist()])


SPEEDS = np.array([0.06, 0.13, 0.25, 0.4, 0.6, 0.9, 1.2])


@pytest.mark.slow
def test_break_aways_narrow_the_interval_of_stiction_and_it_holds() -> None:
    inside, narrower = [], []
    for seed in range(40):
        plain, more = windows(TRUE, SPEEDS, seed), rests(TRUE, seed)
        found = fit([*plain, *more], TUSTIN)
        inside.append(np.abs(found.values - TRUE) <= found.halfwidth)
        if seed < 10:
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


SPANS = [(REST, REST + RAMP), (2 * REST + RAMP, 2 * (REST + RAMP))]
RAMPS = tuple(Ramp("", 1, *span, rate) for span, rate in zip(SPANS, (RATE, -RATE), strict=True))
NONE = FitSettings(gravity="none")


PLAN = {drive: planned(drive, ramps=RAMPS) for drive in ("z4", "z1", "z5")}


@cache
def ramp_log() -> Log:
    """Ramps of z1; what it does as it sets off shakes z4, which is held in the same pose."""
    log = recorded(*ramps(14.1, 9.0, 1e-5, controlled=False), noise=0.3)
    q, effort = log.q.copy(), log.effort.copy()
    q[:, 3] = 0.2 * np.roll(log.q[:, 0], 10)
    effort[:, 3] += 0.3 * log.effort[:, 0]
    return replace(log, q=q, effort=effort)


def test_ramps_of_a_plan_are_those_of_one_drive() -> None:
    log = ramp_log()
    late = replace(log, time=log.time + 3.0, q=log.q, effort=log.effort).rows(slice(200, None))
    for one, seconds in ((log, 0.0), (late, -0.4)):
        name, spans = match_ramps(drive_log(one, irp6()), PLAN)
        assert name == "z1"
        assert spans[0][0] == pytest.approx(SPANS[0][0] + seconds, abs=0.02)
    found = sources_of([drive_log(log, irp6())], NONE, None, PLAN)
    assert list(found) == ["z1"]
    loose = broken_loose("z1", found["z1"], NONE, PLAN["z1"])
    assert [one.direction for one in loose] == [1, -1]
    said = breakaway_notes("z1", loose, found["z1"], PLAN["z1"])
    assert said == ["2 of 2 torque ramps ended in a break-away"]
    assert match_ramps(drive_log(replace(log, q=log.q + 0.3), irp6()), PLAN) is None


def test_ramps_that_do_not_break_it_away_are_said_to_be_too_small() -> None:
    log = ramp_log()
    tau = sum(np.where((log.time >= r.start) & (log.time <= r.end), r.rate * (log.time - r.start), 0.0) for r in RAMPS)
    effort = log.effort.copy()
    effort[:, 0] = tau + np.random.default_rng(1).normal(0.0, 0.3, tau.size)
    still = replace(log, q=0.0 * log.q, effort=effort)
    found = sources_of([drive_log(still, irp6())], NONE, None, PLAN)
    assert list(found) == ["z1"]
    rests = broken_loose("z1", found["z1"], NONE, PLAN["z1"])
    (said,) = breakaway_notes("z1", rests, found["z1"], PLAN["z1"], "Nm")
    assert said.startswith("0 of 2 torque ramps ended")
    assert "2 did not break it away, up to 23.5 Nm (give `plan_friction` a larger `torque_ramp`)" in said
    effort[:] = 0.0
    with pytest.raises(InputError, match="does not contain the motion of plan"):
        sources_of([drive_log(replace(still, effort=effort), irp6())], NONE, None, PLAN)


def slow_starts(log: Log) -> list[str]:
    """What is said of z1's slow starts, at 2 mrad/s, in a log that plays the plan from its first row."""
    runs = replace(planned("z1", creep=2e-3), creeps=tuple((a, b - 0.3) for a, b in SPANS))
    source = Source(drive_log(log, irp6()), None, None, PlanMatch(0.0, runs.windows, 0.0, 0, 0.0))
    return breakaway_notes("z1", broken_loose("z1", [source], NONE, runs), [source], runs)


def test_why_slow_starts_show_nothing() -> None:
    log = recorded(*ramps(14.1, 9.0, 1e-5, controlled=True), noise=0.1)
    of, ended = "of 2 break-away tests at creeping speed", "ended in a break-away"
    jump = np.where(np.abs(np.gradient(log.q, axis=0)) > 1e-6, 14.1, 0.0)
    for played, words in (
        (log, (f"2 {of} {ended}",)),
        (replace(log, q=0.0 * log.q), ("; 2 hardly moved the drive", "a longer `creeping`")),
        (replace(log, effort=jump), ("0 of 2", "; 2 moved it, but its torque rose too quickly")),
        (
            without(log, SPANS[1][0] + 0.2, SPANS[1][0] + 2.4),
            (f"1 {of} {ended}; 1 missing from the log, or with a gap",),
        ),
        (log.rows(slice(0, 2000)), ("1 missing from the log",)),
    ):
        (said,) = slow_starts(played)
        assert all(part in said for part in words)


def point(speed: float, torque: float) -> Point:
    return Point(speed, torque, 0.1, 0.0, 0.3, 0)


def test_readings_that_cannot_be_friction_are_not_counted() -> None:
    points = [point(0.1, 10.0), point(1.0, 28.0), point(-0.1, -6.0)]
    wrong = replace(away(-5.0), direction=1)
    good = [away(14.0), away(5.0), away(-17.0)]
    kept, said = plausible_break_aways([*good, wrong, away(3.0), away(-20.0), away(-2.0)], points, "Nm")
    assert list(kept) == good
    assert said == [
        "1 ramp that ends in motion not counted: torque against the motion that follows it (-5 Nm)",
        "2 ramps that end in motion not counted: torque less than 0.5 times the friction of the slowest "
        "windows (3, -2 Nm)",
        "1 ramp that ends in motion not counted: torque more than 3 times the friction of the slowest windows (-20 Nm)",
    ]
    assert plausible_break_aways([away(99.0), wrong], [])[0] == (away(99.0),)
    assert plausible_break_aways([away(10.0)], [point(1.0, 28.0), point(0.5, 19.0)])[0] == (away(10.0),)


def test_without_a_plan_ramps_count_while_all_others_rest() -> None:
    log = ramp_log()
    moving = log.q.copy()
    moving[:, 4] = 0.1 * np.sin(log.time)
    part = drive_log(replace(log, q=moving), irp6())
    assert len(break_aways(part, "z1", None)) == 2
    assert break_aways(part, "z1", None, alone=True) == ()
    assert broken_loose("z1", [Source(part, None)], NONE, None) == ()
    assert len(break_aways(drive_log(log, irp6()), "z1", None, alone=True)) == 2
    shaken = replace(log, q=log.q @ np.diag([1.0, 1.0, 1.0, 10.0, 1.0]))  # z4 moves twice as far, as the ramp ends
    assert break_aways(drive_log(shaken, irp6()), "z1", None, alone=True) == ()
