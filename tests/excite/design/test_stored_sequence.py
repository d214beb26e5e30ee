"""The sequence of a design: stored as it is, and its limits between the samples of trajectory.csv."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from commands import Here
from designed import panda, planar
from written_files import saved

import excite
from constraints.interpolation import Curve
from excite.design.design import Design, between_samples_text
from excite.simulation.simulation_files import read_motion
from excite.trajectories.sequence import APPROACH, EXCITE, RETURN, MotionSequence, Piece

HOME = (0.3, 0.1, -0.1, 0.2, 0.0)
VIA = ((0.5, 0.2, 0.0, 0.0, 0.1), (0.1, 0.0, 0.0, 0.0, 0.0))
OUTPUTS = {
    "alone": excite.Output(rate=50.0),
    "home": excite.Output(rate=50.0, home=HOME, settle=0.24),
    "via, no rest": excite.Output(rate=50.0, home=HOME, via=VIA, settle=0.0),
}
LIMITS = excite.LimitChoice(velocity=(1.0,) * 5, acceleration=(4.0,) * 5, torque_margin=None)


@cache
def designed(name: str) -> excite.Design:
    trajectory, search = excite.TrajectoryChoice(harmonics=2, period=4.0), excite.Search(starts=1, executor="serial")
    return excite.design_trajectory("irp6", trajectory=trajectory, limits=LIMITS, output=OUTPUTS[name], search=search)


@pytest.mark.slow
@pytest.mark.parametrize("name", OUTPUTS)
def test_stored_and_made_sequences_are_the_same(name: str, tmp_path: Path) -> None:
    design = designed(name)
    stored = excite.load_design(saved(tmp_path, design))
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
    assert not np.any([read.dq[time >= end], read.ddq[time >= end]])
    written = read_motion(tmp_path / "trajectory.csv", design.robot.joint_names).given
    assert np.abs(stored.sequence.at(written.time)[0].q - written.q).max() < 1e-12
    assert (stored.coefficients_sha256, stored.broken) == (design.coefficients_sha256, design.broken)
    assert design.file_sha256 is None
    assert stored.file_sha256 is not None


def test_positions_are_the_integral_of_velocities() -> None:
    sequence = designed("via, no rest").sequence
    samples, _ = sequence.at(time := np.linspace(0.0, sequence.duration, 40001))
    middle = 0.5 * (samples.dq[1:] + samples.dq[:-1])
    assert np.abs(samples.q[0] + time[1] * np.cumsum(middle, axis=0) - samples.q[1:]).max() < 1e-7


def sampled_at(rate: float) -> Design:
    """A design that uses its acceleration limits in full, without approach and return, whose file has another rate."""
    design = planar("fourier", rate=10.0)
    motion = next(piece.motion for piece in design.sequence.pieces if piece.segment == EXCITE)
    largest = np.abs(motion.samples(np.linspace(0.0, motion.duration, 20_001)).ddq).max(axis=0)
    limits = replace(design.task.limits, acceleration=tuple(np.maximum(largest, 1e-3)), jerk=None)
    output = replace(design.task.output, rate=rate, home=None)
    changed = replace(design, task=replace(design.task, limits=limits, output=output))
    changed.__dict__["sequence"] = MotionSequence((Piece(EXCITE, motion, round(motion.duration * rate)),))
    return changed


def test_a_design_of_today_keeps_them() -> None:
    for design in (planar("fourier"), panda()):
        certified = design.between_samples
        assert [each.curve for each in certified] == list(Curve)
        assert between_samples_text(design, certified) == (
            "trajectory.csv, between its samples: limits kept by lines, cubics and quintics"
        )


def test_a_rate_that_is_enough_is_named_and_is() -> None:
    design = sampled_at(10.0)
    text = between_samples_text(design, design.between_samples)
    passed = re.search(r"quintics pass joint j\d acceleration by ([\d.e-]+) %; `rate` (\d+) keeps quintics", text)
    assert passed is not None, text
    assert 1e-4 < float(passed[1]) < 1.0
    for rate, broken in ((10.0, True), (float(passed[2]), False)):
        (quintics,) = (each for each in sampled_at(rate).between_samples if each.curve is Curve.QUINTICS)
        assert bool(quintics.broken) == broken


def test_where_cubics_pass_a_limit_quintics_are_advised() -> None:
    design = sampled_at(100.0)
    text = between_samples_text(design, design.between_samples)
    assert re.search(r"kept by lines and quintics; cubics pass joint j\d acceleration by 0\.\d+ %; inter", text), text


def test_the_terminal_and_the_file_say_so(here: Here) -> None:
    given = ("--trajectory", "fourier", "--starts", "1", "--executor", "serial", "--figures", "none", "--period", "4")
    said = here.run("design", "irp6", *given, "--out", "a").stdout
    assert "trajectory.csv, between its samples: limits kept by lines" in said
    content = json.loads((here.cwd / "a" / "design.json").read_text())["played"]["between_samples"]
    assert [each["curve"] for each in content] == ["lines", "cubics", "quintics"]
    assert all(each["holds"] == (each["use"] <= 1.0 + 1e-6) for each in content)
