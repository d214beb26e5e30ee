"""A delay between streams of different rates is estimated by identification."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_logs import Motion, write_plotjuggler
from value_fuzzer import ROBOT

import excite

DELAY = 0.012  # s


@pytest.mark.slow
def test_delay_of_a_slower_stream_of_efforts_is_estimated(tmp_path: Path) -> None:
    (tmp_path / "two.yaml").write_text(ROBOT, encoding="utf-8")
    robot = excite.load_robot(str(tmp_path / "two.yaml"))
    design = excite.design_trajectory(
        robot,
        trajectory=excite.TrajectoryChoice(harmonics=3, period=4.0),
        search=excite.Search(starts=1, executor="serial"),
    )
    log = excite.simulate(design, rate=1000.0, torque_noise=(0.05,), seed=0).log
    assert log.effort is not None
    assert log.dq is not None
    tau = np.column_stack([np.interp(log.time - DELAY, log.time, each) for each in log.effort.T])
    recorded = Motion(log.time, log.q, log.dq, tau)
    path = write_plotjuggler(tmp_path / "run", recorded, robot.joint_names, every=4)  # efforts at 250 Hz
    result = excite.identify(robot, path, choose=("delay",))
    assert result.recipe.delay is not None
    assert abs(result.recipe.delay - DELAY) < 1e-3
