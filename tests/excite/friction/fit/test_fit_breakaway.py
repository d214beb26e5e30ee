"""Which break-aways count: whose torque ramps a log contains, readings that cannot be friction, and what is said."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from breakaway_ramps import RAMP, RATE, REST, away, planned, ramps, recorded, without
from played import irp6

from excite.friction.fit.breakaway_tests import (
    breakaway_notes,
    broken_loose,
    plausible_break_aways,
    repeated_break_aways,
)
from excite.friction.fit.breakaway_torque import break_aways
from excite.friction.fit.data_set import sources_of
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.friction_fit import characteristics
from excite.friction.fit.plan_match import PlanMatch, Source, match_ramps
from excite.friction.fit.points import Point, described_model, drive_log
from excite.friction.plan.schedule import Ramp
from excite.logs.log import Log
from regressors.errors import InputError

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
    assert [one.direction for one in broken_loose("z1", found["z1"], NONE, PLAN["z1"])] == [1, -1]
    assert breakaway_notes("z1", broken_loose("z1", found["z1"], NONE, PLAN["z1"]), found["z1"], PLAN["z1"]) == [
        "2 of 2 torque ramps ended in a break-away"
    ]
    elsewhere = replace(log, q=log.q + 0.3)
    assert match_ramps(drive_log(elsewhere, irp6()), PLAN) is None


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
    source = Source(0, drive_log(log, irp6()), None, None, PlanMatch(0.0, runs.windows, 0.0, 0, 0.0))
    return breakaway_notes("z1", broken_loose("z1", [source], NONE, runs), [source], runs)


def test_why_slow_starts_show_nothing() -> None:
    log = recorded(*ramps(14.1, 9.0, 1e-5, controlled=True), noise=0.1)
    assert slow_starts(log) == ["2 of 2 break-away tests at creeping speed ended in a break-away"]
    stuck = replace(log, q=0.0 * log.q)
    (said,) = slow_starts(stuck)
    assert "; 2 hardly moved the drive" in said
    assert "a longer `creeping`" in said
    jumps = replace(log, effort=np.where(np.abs(np.gradient(log.q, axis=0)) > 1e-6, 14.1, 0.0))
    (said,) = slow_starts(jumps)
    assert said.startswith("0 of 2")
    assert "; 2 moved it, but its torque rose too quickly" in said
    (said,) = slow_starts(without(log, SPANS[1][0] + 0.2, SPANS[1][0] + 2.4))
    assert said == (
        "1 of 2 break-away tests at creeping speed ended in a break-away; 1 missing from the log, or with a gap"
    )
    (said,) = slow_starts(log.rows(slice(0, 2000)))
    assert "1 missing from the log" in said


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
    assert broken_loose("z1", [Source(0, part, None)], NONE, None) == ()
    assert len(break_aways(drive_log(log, irp6()), "z1", None, alone=True)) == 2
    shaken = replace(log, q=log.q @ np.diag([1.0, 1.0, 1.0, 10.0, 1.0]))  # z4 moves twice as far, as the ramp ends
    assert break_aways(drive_log(shaken, irp6()), "z1", None, alone=True) == ()


def test_one_alone_may_be_anything() -> None:
    found = [away(14.0), away(14.2), away(-10.0)]
    assert list(repeated_break_aways(found)) == found[:2]


def test_a_log_that_ends_before_the_first_window_of_its_plan() -> None:
    log = recorded(*ramps(14.1, 9.0, 1e-5, controlled=True), noise=0.1)
    with pytest.raises(InputError, match=r"z1: ramps.csv ends after 7.798 s, before the first window .* begins 51 s"):
        characteristics(irp6(), [log], FitSettings(), described_model, None, {"z1": planned("z1")})
