"""Motions that break a limit are not played, by coefficients and by samples, against extrema on a dense grid."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.errors import BrokenLimitError
from excite.simulation.simulate import motion_source, simulate
from excite.tasks.reference import MotionSource, SampledMotion, broken_limits, check_played
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.samples import Samples

LAX = Task("irp6", torque_margin="none")


@cache
def design(robot: str = "irp6") -> Design:
    return design_trajectory(Task(robot, period=4.0, harmonics=3, starts=1, executor="serial"))


def source(scale: float = 1.0, robot: str = "irp6") -> MotionSource:
    """The motion of a design, its deviation from its first pose multiplied."""
    given = motion_source(design(robot))
    assert isinstance(given.motion, Trajectory)
    n = design(robot).moving.n
    first = given.motion.samples(np.zeros(1)).q[0]
    return replace(given, motion=given.motion.carried(scale * np.eye(n), (1.0 - scale) * first))


def in_samples(given: MotionSource, rate: float = 100.0) -> MotionSource:
    return replace(given, motion=SampledMotion(given.motion.sampled(rate)))


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["irp6", "panda", "ur10e"])
def test_what_is_designed_is_played(robot: str) -> None:
    assert broken_limits(source(robot=robot)) == ()
    assert broken_limits(in_samples(source(robot=robot))) == ()


@pytest.mark.parametrize("sampled", [False, True])
def test_a_larger_motion_breaks_what_a_dense_grid_says(sampled: bool) -> None:
    given = source(2.4)
    dense = given.motion.samples(np.linspace(0.0, given.motion.duration, 40_001))
    limits = design().moving.transmission.limits
    C = design().moving.transmission.coupling
    expected = {}
    for what, rate in (("velocity", dense.dq), ("acceleration", dense.ddq)):
        largest = np.abs(rate @ C.T).max(axis=0)
        names = [f"drive {drive.name} {what}" for drive in design().moving.transmission.drives]
        beyond = np.flatnonzero(largest > 1.01 * getattr(limits, what))
        expected |= {names[k]: float(largest[k]) for k in beyond}
    assert expected
    broken = {use.label: abs(use.extreme) for use in broken_limits(in_samples(given) if sampled else given)}
    assert expected.items() <= {name: pytest.approx(value, rel=2e-3) for name, value in broken.items()}.items()


def test_the_message_names_the_limit_when_and_by_how_much() -> None:
    broken = broken_limits(source(2.4))
    use = max(broken, key=lambda use: use.use)
    text = f"{use.label} is {use.extreme:.6g} {use.unit} at {use.time:.4g} s, beyond {use.bound:.6g} {use.unit} "
    text += f"({100 * use.use:.6g} % of what is allowed); {len(broken) - 1} more"
    with pytest.raises(BrokenLimitError, match=re.escape(text)):
        simulate(source(2.4), rate=200.0)
    assert simulate(source(2.4), rate=200.0, beyond_limits=True).log.count > 0


def test_torques_count_where_the_task_keeps_to_their_limits() -> None:
    heavy = replace(source().robot.links[-1], theta=400.0 * np.array([1, 0, 0.1, 0, 0.1, 0, 0, 0.1, 0, 0.1]))
    loaded = replace(source(), robot=source().robot.replace(links=(*source().robot.links[:-1], heavy)))
    assert all(use.label.endswith("torque") for use in broken_limits(loaded))
    assert broken_limits(loaded)
    assert broken_limits(replace(loaded, task=loaded.task.changed(torque_margin="none"))) == ()


def test_a_peak_of_position_between_two_samples_is_found() -> None:
    """At rest in the same pose in every sample; an acceleration in one leads far out on both sides of it."""
    given = source()
    pose = given.motion.samples(np.zeros(1)).q[0]
    time = np.array([0.0, 20.0, 40.0])
    q, push = np.tile(pose, (3, 1)), np.zeros((3, pose.size))
    push[1] = 0.3  # rad/s^2, less than any limit
    motion = SampledMotion(Samples(time, q, np.zeros_like(q), push, np.full_like(q, np.nan)))
    broken = {use.label.split()[-1] for use in broken_limits(replace(given, motion=motion, task=LAX))}
    assert broken == {"position"}


def test_a_stored_design_with_larger_coefficients_is_refused_by_its_limits(tmp_path: Path) -> None:
    """As an older version wrote it, without hashes."""
    design().save(tmp_path / "design")
    file = tmp_path / "design" / "design.json"
    content = json.loads(file.read_text(encoding="utf-8"))
    for part in ("cosine", "sine"):
        content["trajectory"][part] = (2.4 * np.array(content["trajectory"][part])).tolist()
    del content["sha256"]
    file.with_name("manifest.json").unlink()
    file.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(BrokenLimitError, match="% of what is allowed"):
        check_played(motion_source(file.parent))
