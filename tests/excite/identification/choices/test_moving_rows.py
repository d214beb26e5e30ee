"""Settings chosen by rows of moving drives, where friction near standstill misleads the choice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import irp6, noisy, played, three_joints

from excite.identification.identification import Identification
from excite.identification.identify import identify
from excite.logs.log import Log

C = irp6().transmission.coupling[:3, :3]
SETTINGS = ("cutoff", "delay", "standstill")


@pytest.fixture(scope="module")
def log() -> Log:
    return noisy(played(three_joints(), 3, seconds=6.0), 1.0, 0.0, 1)


def chosen(result: Identification) -> dict[str, object]:
    return {choice.name: choice.value for choice in result.choices}


def test_every_row_is_used_where_friction_has_its_sign(log: Log) -> None:
    assert chosen(identify("irp6", log, choose=SETTINGS)).get("rows", "all") == "all"


def test_rows_of_moving_drives_choose_where_friction_does_what_it_likes_at_others(log: Log) -> None:
    """Near standstill the friction of each drive is off by up to its own size, for a while at a time."""
    assert log.dq is not None
    assert log.effort is not None
    rng = np.random.default_rng(1)
    slow = np.abs(log.dq @ C.T) < 0.03
    held = np.repeat(rng.uniform(-1, 1, (len(slow) // 10 + 1, 3)), 10, axis=0)[: len(slow)]
    sticking = replace(log, effort=log.effort + (40.0 * slow * held) @ C, sha256="sticking")
    result = identify("irp6", sticking, choose=SETTINGS)
    values = chosen(result)
    assert values["rows"] == "of moving drives"
    assert result.recipe.delay == 0.0
    assert result.recipe.standstill
    assert result.reference is not None
    assert np.all(np.abs(result.estimate.values - result.reference.values) <= result.estimate.half_width)
    assert any("rows of moving drives" in choice.reason for choice in result.choices)
