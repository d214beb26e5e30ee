"""Rows of a log that excite, blows in it, and torques at their limits."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import log_of, real_log, recorded, rounded, sines, struck, write_sidecar
from refused import refusal

from excite.logs.event import Saturation, measured_saturation, spans_of, within
from excite.logs.excitation import exciting_rows
from excite.logs.impacts import impacts, velocity_jumps
from excite.logs.log import Log
from excite.logs.log_reading import read_sidecar, saturated_torques, sidecar_path
from excite.logs.signals.method import resample
from excite.storage.codec import content_of
from regressors.readers.library import built_in
from regressors.samples import Array

RATE = 100.0


def quintic(seconds, start, end):
    s = np.arange(round(seconds * RATE)) / (seconds * RATE)
    return start + (end - start) * s**3 * (10 - 15 * s + 6 * s**2)


def rest(seconds, at):
    return np.full(round(seconds * RATE), at)


def excitation(seconds, at):
    t = np.arange(round(seconds * RATE)) / RATE
    return at + 0.4 * np.sin(2 * np.pi * t / seconds) * np.sin(2 * np.pi * 0.7 * t)


def recording(*parts, noise=1e-5, seed=0):
    q = np.concatenate(parts)
    q = np.column_stack([q, -0.6 * q]) + noise * np.random.default_rng(seed).normal(size=(q.size, 2))
    return log_of(1000.0 + np.arange(q.shape[0]) / RATE, np.round(q, 6))


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-4])
def test_idling_approach_and_return_are_left_out(noise):
    parts = [rest(3, 0), quintic(2, 0, 0.5), rest(1, 0.5), excitation(20, 0.5), rest(1, 0.5), quintic(2, 0.5, 0)]
    rows, said = exciting_rows(recording(*parts, rest(2, 0), noise=noise))
    assert (rows.start, rows.stop) == pytest.approx((600, 2600), abs=20)
    assert f"rows {rows.start + 1} to {rows.stop} of 3100 are used" in said
    assert f"left out before them: {rows.start} rows" in said
    assert f"left out after them: {3100 - rows.stop} rows" in said


AT = rest(1, 0.5)
MOVES = [rest(2, 0), quintic(2, 0, 1), rest(1, 1), quintic(2, 1, 2), rest(1, 2), quintic(2, 2, 0), rest(2, 0)]
STRETCHES = {
    "throughout": ([excitation(20, 0.5)[40:-40]], 0, 1920, 0),
    "two excitations": ([AT, excitation(10, 0.5), rest(2, 0.5), excitation(10, 0.5), AT], 100, 2300, 15),
    "from point to point": (MOVES, 200, 1000, 20),
    "a slow approach": ([rest(2, 0), quintic(8, 0, 0.5), AT, excitation(20, 0.5), AT], 1100, 3100, 20),
    "a short trial before": ([excitation(2, 0.5), rest(2, 0.5), excitation(20, 0.5)], 400, 2400, 15),
}


@pytest.mark.parametrize("case", STRETCHES)
def test_the_stretch_of_motion(case):
    parts, start, stop, within = STRETCHES[case]
    rows, said = exciting_rows(recording(*parts))
    assert (rows.start, rows.stop) == pytest.approx((start, stop), abs=within)
    assert within or "left out" not in said


def test_units_and_the_origin_of_time_do_not_matter():
    log = recording(rest(3, 0), quintic(2, 0, 0.5), rest(1, 0.5), excitation(20, 0.5), rest(2, 0.5))
    one, other = exciting_rows(log)[0], exciting_rows(log_of(log.time - log.time[0], 3.0 * log.q + 1.0))[0]
    assert (other.start, other.stop) == pytest.approx((one.start, one.stop), abs=1)  # time rounds differently


def test_no_motion_is_refused():
    for seconds in (5, 0.05):
        assert "LOG: no joint moves" in refusal(exciting_rows, recording(rest(seconds, 0.2)))


@pytest.mark.parametrize(
    ("name", "start", "stop"),
    [
        ("ur-20_02_10-30sec_12harm", 635, 3510),
        ("ur-20_02_05-20sec_8harm", 320, 2310),
        ("ur-20_01_31-unload", 348, 2474),
        ("ur-20_01_31-load", 494, 2619),
    ],
)
def test_rows_of_recorded_logs_are_those_that_people_chose(name, start, stop):
    """The first two are published (the second end with half a second of rest); the others show a move, then a pause."""
    rows, said = exciting_rows(real_log(name))
    assert rows.start == pytest.approx(start, abs=15)
    assert rows.stop == pytest.approx(stop, abs=40)
    assert "with motion of 0." in said


def corners():
    """Constant accelerations that change at once, as of point-to-point motions."""
    log = recorded()
    acceleration = np.resize(np.repeat([3.0, 0.0, -3.0, 0.0], 300), log.count)
    speed = np.cumsum(acceleration) * 1e-3
    q = np.cumsum(speed) * 1e-3
    return replace(log, q=np.column_stack([q, 0.5 * q, -q]), effort=4.0 * np.tile(acceleration[:, None], 3))


CLEAN = {
    "as it is": recorded(),
    "noisy": recorded(noise=3e-4),
    "coarse": replace(recorded(), q=rounded(recorded().q, 1e-3)),
    "250 Hz": recorded(rate=250.0),
    "100 Hz": recorded(rate=100.0, seconds=20.0),
    "corners": corners(),
    "no torques": replace(recorded(), effort=None),
    "short": recorded(seconds=0.5),
}


@pytest.mark.parametrize("log", CLEAN.values(), ids=CLEAN.keys())
def test_clean_logs_have_none(log):
    assert impacts(log) == []


@pytest.mark.parametrize("rate", [250.0, 1000.0])
@pytest.mark.parametrize(("jump", "spike"), [(0.5, 25.0), (-0.5, 25.0), (1.0, 0.0)])
def test_blows_are_found(rate, jump, spike):
    log = struck(struck(recorded(rate=rate), 1.7, jump, 1, spike), 4.1, jump, 0, spike)
    times, joints, jumps = zip(*impacts(log), strict=True)
    assert joints == (1, 0)
    np.testing.assert_allclose(times, [1.7, 4.1], atol=0.03)
    np.testing.assert_allclose(jumps, jump, rtol=0.5)


def test_the_jump_of_a_bent_line_is_exact():
    i = np.arange(-50, 51)
    q = (0.3 + 0.02 * i + 1e-3 * i**2 + 1e-5 * i**3 + 0.07 * np.maximum(i, 0) + 2e-3 * np.maximum(i, 0) ** 2)[:, None]
    assert velocity_jumps(q, 20)[50, 0] == pytest.approx(0.07, rel=1e-9)


@pytest.mark.parametrize("name", ["ur-20_02_12-50sec_12harm", "ur-20_02_10-30sec_12harm", "ur-20_01_17-ptp_10_points"])
def test_recorded_motions_have_none(name):
    log = real_log(name)
    assert impacts(resample(log.rows(exciting_rows(log)[0])).log) == []


def test_the_stop_in_a_recorded_log_is_found():
    log = real_log("ur-20_01_22-joint_2")
    ((time, joint, _),) = impacts(resample(log.rows(exciting_rows(log)[0])).log)
    assert time == pytest.approx(1256.68, abs=0.08)
    assert log.joints[joint] == "shoulder_lift_joint"


PANDA = built_in("panda")
SAMPLES = 200.0
TORQUE = float(PANDA.limits.torque[1])
SPANS = ((0.5, 0.75), (1.0, 1.0))


def pressed(tau: Array) -> Log:
    """The arm moves; its second torque is given in parts of its limit."""
    time = np.arange(tau.size) / SAMPLES
    q, dq, ddq = (np.tile(x, 3)[:, :7] * 0.5 for x in sines(time, joints=3))
    effort = 0.1 * np.sin(q) + ddq
    effort[:, 1] = TORQUE * tau
    return log_of(time, q, dq, effort, PANDA.joint_names)


def swing(size: float) -> Array:
    return size * np.sin(2 * np.pi * np.arange(1600) / 400)


@pytest.mark.parametrize("bound", [1.0, 0.9995, 1.2], ids=["at the limit", "just below", "above"])
def test_a_torque_that_is_cut_off_at_its_limit_is_found(bound: float) -> None:
    tau = np.clip(swing(1.5), -bound, bound)
    (found,) = measured_saturation(pressed(tau), PANDA)
    assert (found.label, found.unit, found.limit) == ("joint panda_joint2", "Nm", TORQUE)
    assert found.rows == np.count_nonzero(np.abs(tau) == bound)
    assert len(found.spans) == 8
    np.testing.assert_array_equal(within(np.arange(1600) / SAMPLES, found.spans), np.abs(tau) == bound)


OTHERS = {
    "held below": np.clip(swing(1.5), -0.99, 0.99),
    "held far below": np.clip(swing(0.3), -0.2, 0.2),
    "a peak below": swing(0.999),
    "a peak at it": swing(1.0),
    "beyond it": swing(1.5),
    "rounded": np.round(swing(1.0), 2),
    "noise": swing(0.9) + 0.05 * np.random.default_rng(0).normal(size=1600),
}


def test_other_torques_are_let_alone() -> None:
    assert [name for name, tau in OTHERS.items() if measured_saturation(pressed(tau), PANDA)] == []
    assert measured_saturation(replace(pressed(np.clip(swing(1.5), -1, 1)), effort=None), PANDA) == ()


def test_spans_of_several_torques_are_joined_where_they_meet() -> None:
    one = Saturation("a", 1.0, "Nm", 3, ((0.0, 1.0), (4.0, 5.0)))
    two = Saturation("b", 1.0, "Nm", 3, ((0.5, 2.0), (5.0, 6.0), (8.0, 8.0)))
    assert spans_of([one, two]) == ((0.0, 2.0), (4.0, 6.0), (8.0, 8.0))
    time = np.array([0.0, 2.0, 2.1, 3.9, 7.0, 8.0])
    assert within(time, spans_of([one, two])).tolist() == [True, True, False, False, False, True]
    assert within(time, ((2.05, 2.05),), begin=time - 1.0).tolist() == [False, False, True, False, False, False]


def beside(folder: Path, **more: object) -> dict[str, object]:
    path = folder / "log.csv"
    write_sidecar(path, PANDA)
    content = json.loads(sidecar_path(path).read_text())
    sidecar_path(path).write_text(json.dumps({**content, **more}))
    return read_sidecar(path)


def test_the_file_beside_a_log_says_when(tmp_path: Path) -> None:
    said = Saturation("drive z2", 3.5, "Nm", 52, SPANS)
    content = beside(tmp_path, saturated=[content_of(said)[0]])
    assert saturated_torques(content, "log.json") == (said,)
    assert saturated_torques(beside(tmp_path), "log.json") == ()


GOOD = content_of(Saturation("joint a", 1.0, "Nm", 1, SPANS))[0]


def test_what_is_not_understood_is_refused(tmp_path: Path) -> None:
    spans = ({"spans": wrong} for wrong in ([[0.1]], [[0.1, "end"]], 3))
    wrong = ({"torque": 2}, {"limit": "much"}, {"rows": None}, *spans)
    for saturated in ({"joint a": 1}, [3], [{}], *([{**GOOD, **change}] for change in wrong)):
        assert "log.json: saturated should list objects" in refusal(beside, tmp_path, saturated=saturated)
