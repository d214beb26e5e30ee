"""What happened while a log was recorded is found, makes no equations, is said, and does not spoil the estimate."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from played import TASK, found, noisy, played, three_joints
from recordings import held, late, some_rows, struck, without_rows

from excite.identification.recipe import Recipe
from excite.identification.result_json import save_result
from excite.logs.event import CLOCK, HELD, IMPACT, MISSING
from excite.logs.log import Log
from excite.logs.saturation import within
from excite.verification.verify import verify
from regressors.errors import InputError

PLAIN = Recipe(sign_width=0.01)
RATE = 1000.0


def clean(seed: int = 1, seconds: float = 6.0) -> Log:
    return noisy(played(three_joints(seed), 3, RATE, seconds, source=f"LOG{seed}"), 0.3, 1e-6, seed)


@pytest.fixture(scope="module")
def best() -> float:
    return found(TASK, clean(), recipe=PLAIN).training_error


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
def test_spoilt_logs_are_as_good_as_the_clean_one(spoil, kinds, best) -> None:
    result = found(TASK, spoil(clean()), recipe=PLAIN)
    (part,) = result.prepared
    assert {event.kind for event in part.events} == kinds
    # without equations in what is left out
    assert not np.any(within(result.observations.time, part.left_out))
    assert 0 < part.left_out_share < 0.15
    share = 1 - len(result.observations.y) / (3 * part.samples.time.size)
    assert part.left_out_share == pytest.approx(share, abs=1e-12)
    residual = result.observations.y - result.observations.W @ result.estimate.coefficients
    assert np.linalg.norm(residual) / np.linalg.norm(result.observations.y) < 1.2 * best
    for kind in kinds - {CLOCK}:
        word = {HELD: "repeat the row before", MISSING: "between rows", IMPACT: "about 1 impact"}[kind]
        assert any(note.startswith("left out:") and word in note for note in part.notes)


def test_a_clean_log_has_no_events() -> None:
    (part,) = found(TASK, clean(), recipe=PLAIN).prepared
    assert (part.events, part.left_out, part.left_out_share) == ((), (), 0.0)


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
    other = found(TASK, reset, recipe=replace(PLAIN, rows="4100:6000")).prepared[0].log
    np.testing.assert_array_equal(other.row_numbers[[0, -1]], [4100, 6000])


def test_rows_are_those_of_what_was_recorded() -> None:
    log = held(clean(), np.arange(100, 104))
    kept = log.without("garbage", np.arange(log.count) < 50)
    (part,) = found(TASK, kept, recipe=replace(PLAIN, rows="81:3000")).prepared
    np.testing.assert_array_equal(part.log.row_numbers[[0, -1]], [81, 3000])
    assert part.log.count == 2920 - 4


def test_the_relative_error_of_a_verification_counts_rows_about_a_blow() -> None:
    result = found(TASK, clean(), recipe=PLAIN)
    judged = verify(result, blow(clean(2)))
    assert np.any(within(judged.time, judged.log.left_out))
    assert any("about 1 impact" in remark for remark in judged.verdict.remarks)
    assert 0 < judged.event_free_error < judged.relative_error
    assert any("without these rows predictions differ by" in remark for remark in judged.verdict.remarks)
