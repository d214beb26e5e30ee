"""Torques along a task motion: their predicted error against sampled parameters, and the criterion that adds them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import excite
from excite.design.task_motion_file import read_precision_target
from excite.information.half_widths import torque_precision
from excite.information.target import target_of
from excite.tasks.robot_of_task import robot_and_task
from regressors.errors import InputError

ONE = excite.Search(starts=1, executor="serial")


@pytest.fixture(scope="module")
def torques() -> excite.TaskTorques:
    rng, t = np.random.default_rng(3), np.linspace(0.0, 2.0 * np.pi, 301)
    wave = [np.column_stack([0.2 * np.sin(k * t + phase) for k in (1, 2, 3)]) for phase in rng.uniform(0, 6, 3)]
    return excite.TaskTorques(0.01, excite.TaskMotion("waves", ("q1", "q2", "q3"), *wave))


@pytest.fixture(scope="module")
def design(torques: excite.TaskTorques) -> excite.Design:
    target = excite.PrecisionTarget(None, parameters={"X2": 0.3}, torques=torques)
    return excite.design_trajectory(
        "irp6", precision=target, noise=(1.0, 2.0, 3.0), criterion="trace", scale="precision", search=ONE
    )


def test_the_error_of_torques_is_that_of_sampled_parameters(design: excite.Design) -> None:
    run = design.run_information
    beta = run.half @ np.random.default_rng(0).normal(size=(run.half.shape[1], 4000))
    sampled = np.sqrt(np.sum((run.torques.rows @ beta) ** 2, axis=1).mean(axis=1))
    assert run.deviation[13:] == pytest.approx(sampled, rel=0.03)
    assert run.names[13:] == run.torques.names


def test_the_criterion_adds_what_is_asked(design: excite.Design) -> None:
    run = design.run_information
    value = next(start.value for start in design.starts if start.index == design.best_start)
    asked = float(np.sum((run.deviation / run.allowed) ** 2))
    assert asked == pytest.approx(value**2 / (run.rows / 3), rel=1e-3)


def test_a_share_is_of_the_torque_along_the_motion(torques: excite.TaskTorques) -> None:
    target, motion = target_of(*robot_and_task("irp6")), torques.motion
    double = replace(torques, share=0.02)
    states = (part[:, ::-1] for part in (motion.q, motion.dq, motion.ddq))
    reordered = replace(torques, motion=excite.TaskMotion("waves", motion.joints[::-1], *states))
    allowed = torque_precision(torques, target).allowed
    assert torque_precision(double, target).allowed == pytest.approx(2.0 * allowed)
    assert torque_precision(reordered, target).allowed == pytest.approx(allowed)
    assert np.all(allowed > 0.01)


def test_a_design_states_the_motion_itself(design: excite.Design, tmp_path: Path) -> None:
    design.save(tmp_path / "d")
    loaded = excite.load_design(tmp_path / "d")
    assert loaded.task.objective.precision == design.task.objective.precision


def test_a_file_names_a_motion(design: excite.Design, tmp_path: Path) -> None:
    design.save(tmp_path / "d")
    (tmp_path / "p.yaml").write_text("share: null\ntorques: {motion: d, share: 0.05}\n")
    torques = excite.PrecisionTarget(**read_precision_target(tmp_path / "p.yaml")).torques
    assert (torques.share, torques.motion.joints) == (0.05, ("q1", "q2", "q3"))
    (tmp_path / "p.yaml").write_text("torques: {motion: d}\n")
    with pytest.raises(InputError, match="share"):
        read_precision_target(tmp_path / "p.yaml")
    (tmp_path / "bad.csv").write_text("time,a\n0,1\n")
    (tmp_path / "p.yaml").write_text("torques: {motion: bad.csv, share: 0.1}\n")
    with pytest.raises(InputError, match=r"NAME\.position"):
        read_precision_target(tmp_path / "p.yaml")


def test_motions_that_do_not_fit() -> None:
    two = excite.TaskMotion("two", ("q1", "q2"), *(np.zeros((2, 2)),) * 3)
    with pytest.raises(InputError, match="above zero"):
        excite.TaskTorques(0.0, two)
    with pytest.raises(InputError, match="TaskMotion"):
        excite.TaskTorques(0.1, "two.csv")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="q3"):
        torque_precision(excite.TaskTorques(0.1, two), target_of(*robot_and_task("irp6")))
