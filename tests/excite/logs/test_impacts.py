"""Blows are found, and reversals, friction, corners of the motion, noise and coarse encoders are not taken for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recordings import real_log, recorded, rounded, struck

from excite.logs.excitation import exciting_rows
from excite.logs.impacts import impacts, velocity_jumps
from excite.logs.signals.resampling import resample


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
    found = impacts(log)
    assert [hit.joint for hit in found] == [1, 0]
    np.testing.assert_allclose([hit.time for hit in found], [1.7, 4.1], atol=0.03)
    np.testing.assert_allclose([hit.jump for hit in found], jump, rtol=0.5)


def test_the_jump_of_a_bent_line_is_exact():
    i = np.arange(-50, 51)
    q = (0.3 + 0.02 * i + 1e-3 * i**2 + 1e-5 * i**3 + 0.07 * np.maximum(i, 0) + 2e-3 * np.maximum(i, 0) ** 2)[:, None]
    assert velocity_jumps(q, 20)[50, 0] == pytest.approx(0.07, rel=1e-9)


@pytest.mark.parametrize(
    "name",
    ["ur-20_02_12-40sec_12harm", "ur-20_02_12-50sec_12harm", "ur-20_02_10-30sec_12harm", "ur-20_01_17-ptp_10_points"],
)
def test_recorded_motions_have_none(name):
    log = real_log(name)
    assert impacts(resample(log.rows(exciting_rows(log)[0])).log) == []


def test_the_stop_in_a_recorded_log_is_found():
    log = real_log("ur-20_01_22-joint_2")
    (hit,) = impacts(resample(log.rows(exciting_rows(log)[0])).log)
    assert hit.time == pytest.approx(1256.68, abs=0.08)
    assert log.joints[hit.joint] == "shoulder_lift_joint"
