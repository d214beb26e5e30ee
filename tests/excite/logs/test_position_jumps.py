"""Wrong readings are left out, resets refused with their row, and fast motion is neither."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recordings import recorded, struck

from excite.logs.event import SPIKE
from excite.logs.impacts import check_resets, without_spikes
from regressors.errors import InputError
from regressors.readers.library import built_in

PANDA = built_in("panda")
LOG = replace(recorded(), joints=PANDA.joint_names[:3])


def moved(rows, size):
    q = LOG.q.copy()
    q[rows, 1] += size
    return replace(LOG, q=q)


@pytest.mark.parametrize("log", [LOG, struck(LOG, 2.0, 3.0), recorded(), replace(LOG, q=60 * LOG.q)])
def test_motion_is_neither(log):
    assert without_spikes(log, PANDA) is log
    check_resets(log, PANDA)


@pytest.mark.parametrize("rows", [slice(2000, 2001), slice(2000, 2004)])
def test_wrong_readings_are_left_out(rows):
    log = without_spikes(moved(rows, 0.3), PANDA)
    (removed,) = log.removed
    assert removed.kind == SPIKE
    np.testing.assert_array_equal(removed.numbers, np.arange(LOG.count)[rows] + 1)
    check_resets(log, PANDA)


def test_resets_are_refused_with_their_row_and_the_rows_to_use():
    log = moved(slice(2000, None), 0.05)
    assert without_spikes(log, PANDA) is log
    message = r"panda_joint2 jumps by 0.05 rad in row 2001.*`rows='1:2000'`.*`rows='2001:6000'`"
    with pytest.raises(InputError, match=message):
        check_resets(log, PANDA)
    check_resets(log.rows(slice(2000, None)), PANDA)
