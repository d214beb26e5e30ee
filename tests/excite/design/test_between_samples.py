"""What the summary and design.json say of the limits between the samples of trajectory.csv."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import Here
from designed import panda, planar

from constraints.interpolation import Curve
from excite.design.design import Design, between_samples_text
from excite.trajectories.sequence import MotionSequence, Piece


def sampled_at(design: Design, rate: float) -> Design:
    """A design without approach and return whose file has another rate."""
    output = replace(design.task.output, rate=rate, home=None)
    piece = next(piece for piece in design.sequence.pieces if piece.segment == "excite")
    changed = replace(design, task=replace(design.task, output=output))
    steps = round(piece.motion.duration * rate)
    changed.__dict__["sequence"] = MotionSequence((Piece("excite", piece.motion, steps),))
    return changed


def within(design: Design, share: float) -> Design:
    """A design whose acceleration limits its exciting motion uses to a share."""
    piece = next(piece for piece in design.sequence.pieces if piece.segment == "excite")
    largest = np.abs(piece.motion.samples(np.linspace(0.0, piece.motion.duration, 20_001)).ddq).max(axis=0)
    limits = replace(design.task.limits, acceleration=tuple(np.maximum(largest, 1e-3) / share), jerk=None)
    return replace(design, task=replace(design.task, limits=limits))


def test_a_design_of_today_keeps_them() -> None:
    for design in (planar("fourier"), panda()):
        certified = design.between_samples
        assert [each.curve for each in certified] == list(Curve)
        assert between_samples_text(design, certified) == (
            "trajectory.csv, between its samples: limits kept by lines, cubics and quintics"
        )


def test_a_rate_that_is_enough_is_named_and_is() -> None:
    design = sampled_at(within(planar("fourier", rate=10.0), 1.0), 10.0)
    text = between_samples_text(design, design.between_samples)
    passed = re.search(r"quintics pass joint j\d acceleration by ([\d.e-]+) %; `rate` (\d+) keeps quintics", text)
    assert passed is not None, text
    assert 1e-4 < float(passed[1]) < 1.0
    for rate, broken in ((10.0, True), (float(passed[2]), False)):
        faster = sampled_at(within(planar("fourier", rate=10.0), 1.0), rate)
        (quintics,) = (each for each in faster.between_samples if each.curve is Curve.QUINTICS)
        assert bool(quintics.broken) == broken


def test_where_cubics_pass_a_limit_quintics_are_advised() -> None:
    design = sampled_at(within(planar("fourier", rate=10.0), 1.0), 100.0)
    text = between_samples_text(design, design.between_samples)
    assert re.search(r"kept by lines and quintics; cubics pass joint j\d acceleration by 0\.\d+ %; inter", text), text


@pytest.mark.parametrize("arguments", [(), ("--verbose",)])
def test_the_terminal_and_the_file_say_so(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    here = Here(tmp_path, monkeypatch, capfd)
    given = ("--trajectory", "fourier", "--starts", "1", "--executor", "serial", "--figures", "none", "--period", "4")
    said = here.run("design", "irp6", *given, "--out", "a", *arguments).stdout
    assert "trajectory.csv, between its samples: limits kept by lines" in said
    content = json.loads((tmp_path / "a" / "design.json").read_text())["played"]["between_samples"]
    assert [each["curve"] for each in content] == ["lines", "cubics", "quintics"]
    assert all(each["holds"] == (each["use"] <= 1.0 + 1e-6) for each in content)
