"""Friction fitted over a plan's windows: where they are in a log, with gaps, and gravity that cancels over them."""

from __future__ import annotations

import re
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from breakaway_ramps import ramps, recorded, without
from friction_runs import CURVE, LINE, RATE, fitted, log, runs, unknown
from played import irp6, torques
from refused import refusal

from excite.friction.breakaway_tests import gravity_about
from excite.friction.breakaway_torque import break_aways
from excite.friction.constant_speed_windows import FitSettings, WindowSearch, constant_windows, position_noise
from excite.friction.friction_fit import characteristics
from excite.friction.plan_match import PlannedWindow, Source, _stretch, match_plan, windows_of_plan
from excite.friction.points import described_model, drive_log, points_of
from excite.logs.log import Log
from regressors.errors import InputError
from regressors.samples import Samples


def as_recorded(log: Log, before: float = 0.0, cut: float = 0.0, rate: float = RATE, start: float = 0.0) -> Log:
    """The log as another recorder has it: it rests before, begins late, samples at another rate, counts other time."""
    t = np.arange(cut - before, log.time[-1], 1 / rate)
    q, effort = (np.column_stack([np.interp(t, log.time, column) for column in x.T]) for x in (log.q, log.effort))
    return Log(log.source, "", log.joints, t - t[0] + start, q, effort=effort)


@pytest.mark.parametrize(("before", "rate", "start"), [(0.0, RATE, 1e4), (3.217, RATE, 0.0), (3.217, 187.0, 1e4)])
def test_a_plan_is_found_in_a_log(before: float, rate: float, start: float) -> None:
    found = match_plan(drive_log(as_recorded(log(), before, rate=rate, start=start), irp6()), runs())
    assert found.holds
    assert found.astray < 1e-3
    assert (found.seconds, found.missing) == (pytest.approx(before, abs=2e-4), 0)
    assert [w.speed for w in found.windows] == pytest.approx([w.speed for w in runs().windows])


def test_a_log_that_begins_late_has_the_windows_that_are_left() -> None:
    late = runs().windows[1].start + 0.1
    found = match_plan(drive_log(as_recorded(log(), cut=late), irp6()), runs())
    assert found.seconds == pytest.approx(-late, abs=1e-3)
    assert (len(found.windows), found.missing) == (4, 2)


def test_a_way_to_the_first_pose_is_no_hindrance() -> None:
    part, t = log(), np.arange(0.0, 5.0, 1 / RATE)
    way = np.outer(0.5 * (1.0 - t / 5.0), LINE["z2"])
    effort = np.vstack([np.zeros_like(way), part.effort])
    longer = replace(part, time=np.r_[t, 5.0 + part.time], q=np.vstack([way, part.q]), effort=effort)
    assert match_plan(drive_log(longer, irp6()), runs()).seconds == pytest.approx(5.0, abs=1e-3)


def test_coordinates_of_a_drive_that_turns_the_other_way_round() -> None:
    """A plan in a joint that turns against its drive: ways change their sign."""
    direction = {name: -x for name, x in runs().direction.items()}
    turned = tuple(PlannedWindow(w.start, w.end, -w.first, -w.last) for w in runs().windows)
    found = match_plan(drive_log(log(), irp6()), replace(runs(), direction=direction, windows=turned))
    assert found.windows == match_plan(drive_log(log(), irp6()), runs()).windows


def test_whole_windows_are_symmetric_about_the_pose() -> None:
    part = drive_log(as_recorded(log(), 1.0), irp6())
    k = part.names.index("z2")
    where = match_plan(part, runs())
    none = np.zeros((part.log.count, 0))
    search = WindowSearch(0.3, 0.03, 0.01)
    found = windows_of_plan(part.log.time, part.z[:, k], none, where.windows, where.middle, search)
    assert (len(found.windows), found.changing) == (6, 0)
    for window, planned in zip(found.windows, where.windows, strict=True):
        ends = part.z[[window.start, window.stop - 1], k]
        assert abs(ends.sum()) <= 1.01 * abs(window.speed) / RATE
        assert abs(np.diff(ends)[0]) >= 0.97 * abs(planned.last - planned.first)
        assert window.speed == pytest.approx(planned.speed, rel=1e-3)


def test_what_is_missing_at_one_end_is_cut_off_at_the_other() -> None:
    way = np.linspace(-1.0, 0.6, 161)
    a, b = _stretch(np.abs(way), 90, 0.8)
    assert (way[a], way[b - 1]) == pytest.approx((-0.6, 0.6))
    assert _stretch(np.abs(way), 90, 0.5) == (50, 151)


def test_windows_that_begin_unsteadily_lose_as_much_at_their_end() -> None:
    part = drive_log(log(), irp6())
    t, z = part.log.time, part.z[:, 1].copy()
    planned = runs().windows
    for w in planned:
        rows = (t >= w.start) & (t <= w.end)
        z[rows] += 0.02 * w.speed * np.exp(-(t[rows] - w.start) / 0.05)
    found = windows_of_plan(t, z, np.zeros((t.size, 0)), planned, 0.0, WindowSearch(0.3, 0.02, 0.01))
    assert found.changing == 0
    ends = [(z[w.start], z[w.stop - 1]) for w in found.windows]
    shares = [abs(b - a) / abs(p.last - p.first) for (a, b), p in zip(ends, planned, strict=True)]
    assert 0.58 < min(shares) < 0.95
    assert all(abs(a + b) <= 2 * abs(w.speed) / RATE for (a, b), w in zip(ends, found.windows, strict=True))


def test_a_stop_in_the_midst_costs_its_window_only() -> None:
    w = runs().windows[2]
    stopped = log()
    rows = (stopped.time > 0.5 * (w.start + w.end)) & (stopped.time < w.end)
    q = stopped.q.copy()
    q[rows] = q[np.flatnonzero(rows)[0]]
    one = fitted(replace(stopped, q=q))
    assert len(one.points) == 5
    assert any("left out: 1 whose speed is not constant" in note for note in one.notes)


@pytest.mark.parametrize("gravity", ["auto", "none"])
def test_gravity_that_cancels_over_whole_windows_needs_no_model(gravity: str) -> None:
    one = fitted(log(), robot=unknown(), gravity=gravity)
    assert one.gravity == "none"
    assert np.all(np.abs(one.fit.values - [CURVE.coulomb, CURVE.viscous, CURVE.offset]) < 2 * one.fit.halfwidth)
    assert one.fit.halfwidth.max() < 0.5
    known = fitted(log(), gravity="none")
    assert known.fit.values == pytest.approx(one.fit.values)
    assert fitted(log()).gravity == "model"


def test_gravity_near_the_pose_is_seen_in_the_windows() -> None:
    robot, line = irp6(), np.array(LINE["z2"])
    part = drive_log(log(), robot)
    balance = gravity_about("z2", [Source(part, None, None, match_plan(part, runs()))])
    still = np.outer([-0.3, 0.3], line)
    below, above = torques(robot, Samples(np.arange(2.0), still, *[0 * still] * 3), 0) @ line
    assert balance(np.array([0.0, 1.0])) == pytest.approx([0.0, (above - below) / 0.6], rel=0.05, abs=1e-6)


def test_odd_gravity_is_no_noise_of_a_mean() -> None:
    part = drive_log(log(), irp6())
    where = match_plan(part, runs())
    none = np.zeros((part.log.count, 0))
    search = WindowSearch(0.3, 0.03, 0.01)
    found = windows_of_plan(part.log.time, part.z[:, 1], none, where.windows, 0.0, search).windows
    model = points_of(part, "z2", found, described_model(irp6()))
    folded = points_of(part, "z2", found, None, folded=True)
    assert [p.deviation for p in folded] == pytest.approx([p.deviation for p in model], rel=0.5)


def test_what_a_plan_cannot_be_fitted_to() -> None:
    for made, planned, settings, message in (
        (log, runs(), {"gravity": "none", "window": 0.3}, "cancels over the whole windows of plan: leave out `window`"),
        (log, runs(gravity="subtracted"), {"robot": unknown()}, "does not state .*give `parameters`"),
        (log, runs(gravity="subtracted"), {"robot": unknown(), "gravity": "none"}, "not known without a model"),
        (lambda: log("z1"), runs(), {}, "run.csv does not contain the motion of plan: no window .* is in the 32 s"),
        (lambda: log().rows(slice(0, 60)), runs(), {}, "no window of constant speed of the plan is in the 0.236 s"),
        (lambda: log().of(("q1",)), runs(), {}, "it has none of the drives z2, but z1"),
    ):
        assert re.search(message, refusal(fitted, made(), planned, **settings))


def test_drives_that_no_log_shows() -> None:
    both = {"z1": runs("z1"), "z2": runs()}
    settings = FitSettings(model="coulomb-viscous")
    with pytest.raises(InputError, match="no log contains the runs of z1 in plan; they contain those of z2"):
        characteristics(irp6(), [log()], settings, described_model, ("z1",), both)
    found = characteristics(irp6(), [log(), log("z1")], settings, described_model, None, both)
    assert [one.drive for one in found] == ["z2", "z1"]
    assert [{p.log for p in one.points} for one in found] == [{0}, {1}]


def test_what_is_said_of_several_drives_is_said_once() -> None:
    still = replace(log(), q=np.zeros_like(log().q))
    with pytest.raises(InputError, match=r"^z1, z2, z3, z4, z5: 0 windows of 0\.3 s"):
        characteristics(irp6(), [still], FitSettings(), described_model)


def test_a_plan_whose_speeds_were_not_kept() -> None:
    shaken = log()
    wave = np.outer(0.004 * np.sin(40 * shaken.time), LINE["z2"])
    with pytest.raises(InputError, match=r"z2: 0 of the plan's windows.*play the runs of z2 in plan again"):
        fitted(replace(shaken, q=shaken.q + wave))


def test_a_gap_in_motion_is_no_noise() -> None:
    t = np.arange(0.0, 10.0, 1e-3)
    z = (0.5 * np.sin(t) + np.random.default_rng(0).normal(0.0, 1e-5, t.size))[:, None]
    kept = (t < 6.0) | (t > 6.03)
    assert float(position_noise(t, z)[0]) == pytest.approx(1e-5, rel=0.05)
    assert float(position_noise(t[kept], z[kept])[0]) == pytest.approx(1e-5, rel=0.05)


def test_a_gap_costs_no_break_away_but_those_beside_it() -> None:
    t, z, tau = ramps(14.1, 9.0, 1e-4, controlled=False)
    later = t[-1] + np.arange(1, 3000) * (t[1] - t[0])
    way = z[-1] + 0.4 * (1 - np.cos(2 * np.maximum(later - t[-1] - 3.0, 0.0)))
    whole = recorded(np.r_[t, later], np.r_[z, way], np.r_[tau, 0 * later], noise=0.5)
    moving = without(whole, t[-1] + 3.5, t[-1] + 3.54)
    found = [break_aways(drive_log(one, irp6()), "z1", None, controlled=False) for one in (whole, moving)]
    assert [one.direction for one in found[1] if one.time < t[-1]] == [1, -1]
    assert [one.torque for one in found[1]][:2] == pytest.approx([one.torque for one in found[0]][:2], abs=0.1)
    at = found[0][0].time
    beside = break_aways(drive_log(without(whole, at - 0.02, at + 0.03), irp6()), "z1", None, controlled=False)
    assert [one.direction for one in beside if one.time < t[-1]] == [-1]


def test_a_planned_window_with_a_gap_in_it_is_missing() -> None:
    w = runs().windows[2]
    middle = 0.5 * (w.start + w.end)
    one = fitted(without(log(), middle - 0.5, middle + 0.5))
    assert len(one.points) == 5
    assert any("1 of the plan's windows are missing or interrupted by a gap (1)" in note for note in one.notes)
    assert any("left out: 0 whose speed" in note for note in one.notes)
    bridged = fitted(without(log(), middle - 0.005, middle + 0.005))
    assert len(bridged.points) == 6


def test_windows_shorter_than_a_row_take_no_more_than_the_log() -> None:
    time = np.arange(0.0, 10.0, 0.002)
    tracemalloc.start()
    try:
        found = constant_windows(time, 0.3 * time, np.zeros((time.size, 0)), WindowSearch(1e-6, 0.05, 1e-3))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (found.windows, found.changing, found.resting) == ((), 0, 0)
    assert peak < 100 * time.nbytes
