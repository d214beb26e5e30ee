"""What happened while a log was recorded makes no equations, is said, and does not spoil the estimate."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, LOAD, TASK, described, found, irp6, noisy, periodic, played, three_joints
from recordings import held, late, real_log, some_rows, struck, without_rows

from excite.identification.identification import Identification
from excite.identification.large_residual import with_external_forces
from excite.identification.preparation import spans_in_mean
from excite.identification.recipe import Recipe
from excite.identification.result_json import save_result
from excite.information.target import target_of
from excite.logs.event import CLOCK, FORCE, HELD, IMPACT, MISSING, Saturation, Spans, saturation_of, within
from excite.logs.log import Log
from excite.tasks.robot_of_task import robot_and_task
from excite.tasks.task import Task
from excite.verification.verify import verify
from regressors.errors import InputError

TARGET = target_of(irp6(), TASK)
PLAIN = Recipe(sign_width=0.01)
RATE = 1000.0


def clean(seed: int = 1, seconds: float = 6.0) -> Log:
    return noisy(played(three_joints(seed), 3, RATE, seconds, source=f"LOG{seed}"), 0.3, 1e-6, seed)


@pytest.fixture(scope="module")
def whole() -> Identification:
    """Of the clean log, which has no events."""
    result = found(TASK, clean(), recipe=PLAIN)
    (part,) = result.prepared
    assert (part.events, part.left_out, part.left_out_share) == ((), (), 0.0)
    return result


def blow(log: Log) -> Log:
    return struck(log, 2.51, 0.6, 0, 300.0)


SPOILT = {
    "held": (lambda log: held(log, some_rows(log, 0.03)), {HELD}),
    "late stamps and held": (lambda log: late(held(log, some_rows(log, 0.03))), {HELD, CLOCK}),
    "lost rows": (lambda log: without_rows(log, some_rows(log, 0.03)), {MISSING}),
    "a gap": (lambda log: without_rows(log, np.arange(2000, 2150)), {MISSING}),
    "a blow": (blow, {IMPACT}),
}


@pytest.mark.parametrize(("spoil", "kinds"), SPOILT.values(), ids=SPOILT.keys())
def test_spoilt_logs_are_as_good_as_the_clean_one(spoil, kinds, whole) -> None:
    result = found(TASK, spoil(clean()), recipe=PLAIN)
    (part,) = result.prepared
    assert {event.kind for event in part.events} == kinds
    # without equations in what is left out
    assert not np.any(within(result.observations.time, part.left_out))
    assert 0 < part.left_out_share < 0.15
    share = 1 - len(result.observations.y) / (3 * part.samples.time.size)
    assert part.left_out_share == pytest.approx(share, abs=1e-12)
    residual = result.observations.y - result.observations.W @ result.estimate.coefficients
    assert np.linalg.norm(residual) / np.linalg.norm(result.observations.y) < 1.2 * whole.training_error
    for kind in kinds - {CLOCK}:
        word = {HELD: "repeat the row before", MISSING: "between rows", IMPACT: "about 1 impact"}[kind]
        assert any(note.startswith("left out:") and word in note for note in part.notes)


def test_events_are_written(tmp_path) -> None:
    rows = np.arange(1000, 1004)
    result = found(TASK, held(clean(), rows), recipe=PLAIN)
    save_result(result, tmp_path)
    (log,) = json.loads((tmp_path / "result.json").read_text())["logs"]
    (event,) = log["events"]
    assert (event["kind"], event["rows"], event["left_out"]) == ("held rows", [1001, 1004], True)
    assert event["seconds"] == pytest.approx(5e-3, abs=1e-4)
    assert log["left_out_share"] == pytest.approx(4 / result.prepared[0].samples.time.size)


def test_a_blow_is_used_where_all_rows_are_asked_for() -> None:
    (part,) = found(TASK, blow(clean()), recipe=replace(PLAIN, rows="all")).prepared
    assert part.left_out == ()
    (note,) = (note for note in part.notes if "impact" in note)
    assert note.startswith("used, since all rows were asked for:")


def test_rows_are_chosen_before_they_are_checked() -> None:
    log = clean()
    q = log.q.copy()
    q[4000:, 1] += 0.5
    reset = replace(log, q=q)
    with pytest.raises(InputError, match=r"joint q2 jumps by 0.5 rad in row 4001.*`rows='1:4000'`"):
        found(TASK, reset, recipe=PLAIN)
    result = found(TASK, reset, recipe=replace(PLAIN, rows="1:4000"))
    assert result.prepared[0].log.count == 4000
    kept = held(clean(), np.arange(100, 104)).without("garbage", np.arange(log.count) < 50)
    (part,) = found(TASK, kept, recipe=replace(PLAIN, rows="81:3000")).prepared  # of what was recorded
    np.testing.assert_array_equal(part.log.row_numbers[[0, -1]], [81, 3000])
    assert part.log.count == 2920 - 4


def test_the_relative_error_of_a_verification_counts_rows_about_a_blow(whole) -> None:
    judged = verify(whole, blow(clean(2)))
    assert np.any(within(judged.time, judged.log.left_out))
    assert any("about 1 impact" in remark for remark in judged.verdict.remarks)
    assert 0 < judged.event_free_error < judged.relative_error
    assert any("without these rows predictions miss" in remark for remark in judged.verdict.remarks)


AUTO = replace(EXACT, rows="auto")
SPANS = ((0.5, 0.7), (1.0, 1.2))


def saturated(log: Log, spans: Spans = SPANS, cut: float = 100.0) -> Log:
    """The log, its second torque known to be at a limit in some spans, where the recorded one is not what acted."""
    effort = log.effort.copy()
    lost = within(log.time, spans)
    effort[lost, 1] = cut
    return replace(log, effort=effort, saturated=(saturation_of("joint q2", cut, "Nm", log.time, lost),))


def test_rows_at_a_limit_do_not_reach_the_estimate_unless_they_are_asked_for() -> None:
    """Several logs each lose their own rows."""
    clean, log = played(three_joints(2), 3, source="CLEAN"), saturated(played(three_joints(), 3))
    lost = np.count_nonzero(within(log.time, SPANS))
    assert lost == 82
    result = found(TASK, clean, log, recipe=AUTO)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-6, atol=1e-6)
    rows = [np.count_nonzero(result.observations.log == k) // 3 for k in (0, 1)]
    assert rows == [clean.count, log.count - lost]
    assert not np.any(within(result.observations.time[result.observations.log == 1], SPANS))
    said = f"{lost} rows (0.41 s) in which the torque of joint q2"
    assert f"left out: {said} was at its limit" in result.prepared[1].notes
    assert result.training_error < 1e-6
    asked = found(TASK, log, recipe=EXACT)
    assert len(asked.observations.y) == 3 * log.count
    assert asked.training_error > 0.1
    (note,) = (note for note in asked.prepared[0].notes if "limit" in note)
    assert note.startswith(f"used, since they were asked for: {said}")


def test_a_log_mostly_at_its_limits_is_refused() -> None:
    log = saturated(played(three_joints(), 3), ((0.1, 0.8), (1.0, 1.5)))
    with pytest.raises(InputError, match=r"LOG: in 242 of its 400 exciting rows .* limit.*`torque_margin`.*rows='all'"):
        found(TASK, log, recipe=AUTO)


def test_windows_that_meet_such_rows_are_left_out() -> None:
    log = saturated(played(three_joints(), 3))
    result = found(Task("irp6", model="energy", window="short"), log, recipe=AUTO)
    end = result.observations.time
    assert not np.any(within(end, SPANS, end - 0.0049))
    assert np.any(within(end, SPANS, end - 0.0101))


def test_a_wrench_is_what_it_is_whatever_the_torques_were() -> None:
    clean = played(periodic(np.eye(5), 1), 5, load=LOAD)
    log = replace(clean, saturated=(Saturation("joint q2", 1.0, "Nm", 9, SPANS),))
    result = found(Task("irp6", model="load"), log, recipe=AUTO)
    assert len(result.observations.y) == 6 * clean.count


def test_the_mean_of_periods_lacks_the_phases_of_every_period() -> None:
    clean = played(three_joints(), 3, seconds=6.0)
    log = saturated(clean, ((0.5, 0.6), (3.9, 4.1)))  # the second one from the end of one period into the next
    result = found(TASK, log, recipe=replace(AUTO, average=True, period=2.0))
    assert not np.any(within(result.observations.time, ((0.4999, 0.6001), (1.8999, 2.0), (0.0, 0.1001))))
    mean = played(three_joints(), 3)
    assert np.all(within(mean.time, spans_in_mean(((0.3, 2.8),), mean)))  # longer than a period
    assert len(result.observations.y) == 3 * (400 - 21 - 20 - 21)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-6, atol=1e-6)


def test_verification_says_what_it_leaves_out() -> None:
    result = found(TASK, played(three_joints(), 3), recipe=EXACT)
    log = saturated(played(three_joints(2), 3, seconds=4.0, source="OTHER"))
    judged = verify(replace(result, recipe=replace(EXACT, rows="auto")), log)
    assert judged.time.size == log.count - 82
    assert judged.relative_error < 1e-2
    assert any(remark.startswith("left out: 82 rows") for remark in judged.verdict.remarks)


def pushed(log: Log, size: float, begin: float = 2.5, length: float = 0.4) -> Log:
    """Pushed by something for a while, held in place by the controller."""
    share = np.clip((log.time - begin) / length, 0.0, 1.0)
    force = size * np.sin(np.pi * share)[:, None] * np.array([1.0, 2.0, 0.7])
    return replace(log, effort=log.effort + force, sha256=f"{log.sha256} pushed {size}")


def test_rows_in_which_something_else_pushes_are_left_out() -> None:
    plain, hit = clean(), pushed(clean(), 20.0)
    assert with_external_forces(irp6(), TARGET, plain, PLAIN) is plain
    result = found(TASK, with_external_forces(irp6(), TARGET, hit, PLAIN), recipe=PLAIN)
    (event,) = result.prepared[0].events
    assert (event.kind, event.left_out) == (FORCE, True)
    assert 2.2 < event.begin < 2.5 < 2.9 < event.end < 3.2
    assert any("whose torques no parameters explain" in note for note in result.prepared[0].notes)
    error = np.abs(result.estimate.values - described(result))
    spoilt = np.abs(found(TASK, hit, recipe=PLAIN).estimate.values - described(result))
    assert np.all(error < result.estimate.half_width)
    assert np.median(spoilt / error) > 2
    assert with_external_forces(irp6(), TARGET, hit, replace(PLAIN, rows="all")) is hit


@pytest.mark.parametrize("name", ["ur-20_02_05-20sec_8harm", pytest.param("ur-20_01_31-load", marks=pytest.mark.slow)])
def test_nothing_pushes_a_real_robot_that_moves_freely(name: str) -> None:
    robot, task = robot_and_task("ur10e")
    log = real_log(name)
    assert with_external_forces(robot, target_of(robot, task), log, Recipe()) is log
