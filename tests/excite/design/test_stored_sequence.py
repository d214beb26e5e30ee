"""The sequence of a stored design is that of the design, at any instant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import excite
from excite.simulation.motion_source import read_motion
from excite.trajectories.sequence import APPROACH, EXCITE, RETURN

OUTPUTS = {
    "alone": excite.Output(rate=50.0),
    "home": excite.Output(rate=50.0, home=(0.3, 0.1, -0.1, 0.2, 0.0), settle=0.24),
    "via, no rest": excite.Output(
        rate=50.0,
        home=(0.3, 0.1, -0.1, 0.2, 0.0),
        via=((0.5, 0.2, 0.0, 0.0, 0.1), (0.1, 0.0, 0.0, 0.0, 0.0)),
        settle=0.0,
    ),
}
LIMITS = excite.LimitChoice(
    velocity=(1.0, 1.0, 1.0, 1.0, 1.0), acceleration=(4.0, 4.0, 4.0, 4.0, 4.0), torque_margin=None
)


@pytest.mark.parametrize("name", OUTPUTS)
@pytest.mark.slow
def test_stored_and_made_sequences_are_the_same(name: str, tmp_path: Path) -> None:
    design = excite.design_trajectory(
        "irp6",
        trajectory=excite.TrajectoryChoice(harmonics=2, period=4.0),
        limits=LIMITS,
        output=OUTPUTS[name],
        search=excite.Search(starts=1, executor="serial"),
    )
    design.save(tmp_path)
    stored = excite.load_design(tmp_path)
    spans = stored.sequence.spans()
    assert spans.keys() == design.sequence.spans().keys()
    assert all(spans[name] == pytest.approx(span) for name, span in design.sequence.spans().items())
    end = design.sequence.duration
    time = np.unique(np.concatenate([np.linspace(0.0, end, 777), np.arange(round(end * 50.0) + 1) / 50.0, [end + 1.0]]))
    (made, segments), (read, again) = design.sequence.at(time), stored.sequence.at(time)
    for quantity, allowed in (("q", 1e-12), ("dq", 1e-11), ("ddq", 1e-10)):
        assert np.abs(getattr(made, quantity) - getattr(read, quantity)).max() < allowed
    assert segments == again
    assert set(segments) == ({EXCITE} if name == "alone" else {APPROACH, EXCITE, RETURN})
    assert not read.dq[time >= end].any()
    assert not read.ddq[time >= end].any()
    written = read_motion(tmp_path / "trajectory.csv", design.robot.joint_names).given
    assert np.abs(stored.sequence.at(written.time)[0].q - written.q).max() < 1e-12
    assert (stored.coefficients_sha256, stored.broken) == (design.coefficients_sha256, design.broken)
    assert design.file_sha256 is None
    assert stored.file_sha256 is not None


def test_positions_are_the_integral_of_velocities(tmp_path: Path) -> None:
    design = excite.design_trajectory(
        "irp6",
        trajectory=excite.TrajectoryChoice(harmonics=2, period=4.0),
        limits=LIMITS,
        output=OUTPUTS["via, no rest"],
        search=excite.Search(starts=1, executor="serial"),
    )
    time = np.linspace(0.0, design.sequence.duration, 40001)
    samples, _ = design.sequence.at(time)
    step = time[1]
    middle = 0.5 * (samples.dq[1:] + samples.dq[:-1])
    assert np.abs(samples.q[0] + step * np.cumsum(middle, axis=0) - samples.q[1:]).max() < 1e-7
