"""One set of parameters for two mirrored arms: how well it is known, and whether the arms are equal, with Pinocchio."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from identified import relative
from mirrored_arms import ALONE, BOTH, arms, log_of, motion
from pinocchio_chains import joint_torques
from written_files import saved

import excite
from excite.identification.identification import Identification
from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.load import BaseWrenchModel
from regressors.robot.robot import Robot


@cache
def identified(heavier: float = 1.0, seed: int = 0, **options: object) -> Identification:
    """Of the described arms, from a log of two that move alike, and of which the right forearm may be heavier."""
    log, options = log_of(arms(heavier), motion(BOTH), seed), {"symmetric": True, **options}
    return excite.identify(arms(), log, choose=False, **options)


def off(file: Path, robot: Robot) -> float:
    """How far the torques of a written robot are off those of another, by Pinocchio."""
    return relative(joint_torques(excite.load_robot(str(file)), motion()), joint_torques(robot, motion()))


def test_as_well_known_as_by_twice_the_time() -> None:
    tied, apart = identified(), identified(symmetric=False)
    assert 2 * len(tied.names) == len(apart.names)
    own = [apart.names.index(name) for name in tied.names]
    np.testing.assert_allclose(np.median(tied.estimate.deviation / apart.estimate.deviation[own]), 0.5**0.5, rtol=0.1)
    results = [identified(seed=seed) for seed in range(4)]
    errors = np.array([r.estimate.values - r.reference.values for r in results])  # of friction nothing is described
    inside = np.abs(errors) <= [r.estimate.half_width for r in results]
    assert inside[np.isfinite(errors)].mean() >= 0.95


@pytest.mark.parametrize("estimator", ["weighted", "physical"])
def test_equal_arms_are_found_equal_and_are_a_whole_robot(estimator: str, tmp_path: Path) -> None:
    result = identified(estimator=estimator)
    assert not result.doubts
    assert result.symmetry.compared == len(result.names)
    loaded = excite.load_result(saved(tmp_path / "result", result))
    assert loaded.symmetry == result.symmetry
    check = excite.verify(loaded, log_of(arms(), motion(), 1))
    assert check.holds
    assert any(answer.startswith("left and right: equal within") for answer in check.verdict.answers)
    excite.export_model(loaded, "urdf", tmp_path / "arms.urdf")
    assert off(tmp_path / "arms.urdf", arms()) < 0.01


def test_arms_that_differ_are_named() -> None:
    result = identified(heavier=1.1)
    assert result.symmetry.probability < 1e-6
    at_elbow = next(one for one in result.symmetry.differences if one.parameter == "m5c5x")  # 0.1 kg more, at 0.3 m
    assert at_elbow.body == "right_upper"
    assert abs(at_elbow.value - 0.03) < at_elbow.half_width
    assert [doubt.cure for doubt in result.doubts] == ["identify without `symmetric`"]
    assert not excite.verify(result, log_of(arms(1.1), motion(), 1)).holds
    assert not identified(heavier=1.1, symmetric=False).doubts  # nor does what a tree carries stop an identification


def test_of_an_arm_that_rests_gravity_alone_is_compared() -> None:
    result = excite.identify(arms(), log_of(arms(), motion(ALONE), 0), symmetric=True, choose=False)
    assert ", in 3 of 23 comparisons): left_shoulder" in result.symmetry.text


@pytest.mark.slow
def test_equal_arms_are_seldom_found_to_differ() -> None:
    chances = [identified(seed=seed).symmetry.probability for seed in range(40)]
    assert np.mean(np.array(chances) < 0.01) <= 0.05
    assert 0.35 < np.mean(chances) < 0.65


def test_a_design_for_the_tied_parameters_is_shorter() -> None:
    search = excite.Search(starts=1, executor="serial")
    task = Task(arms(), acceleration=(20.0,), period=5.0, harmonics=3, search=search)
    tied, apart = (excite.design_trajectory(task, symmetric=one) for one in (True, False))
    assert 2 * tied.base.rank == apart.base.rank
    assert tied.condition_number < apart.condition_number
    log = log_of(arms(), tied.trajectory.samples(np.arange(0.0, 5.0, 0.005)), 0)
    assert excite.identify(arms(), log, design=tied, choose=False).symmetry.probability > 0.01


def test_each_limb_keeps_its_own_described_masses_in_limits() -> None:
    target = target_of(arms(2.0), Task(arms(2.0), symmetric=True))
    assert target.model.robot.structure.mirrored and not target.robot.structure.mirrored  # noqa: PT018


def test_what_has_no_sides_is_refused() -> None:
    with pytest.raises(InputError, match="which the load model does not"):
        target_of(arms(), Task(arms(), model="load", sensor="left_fore", symmetric=True))
    with pytest.raises(InputError, match="no body carries two limbs"):
        target_of(irp6 := excite.load_robot("irp6"), Task(irp6, symmetric=True))


def test_the_wrench_below_the_torso_tells_both_sides_too(tmp_path: Path) -> None:
    robot, moves = arms(1.2), motion()
    model, noise = BaseWrenchModel(robot), np.random.default_rng(0).normal(size=(moves.time.size, 6))
    wrench = (model.instants(moves) @ np.concatenate([link.theta for link in robot.links])).reshape(-1, 6) + 0.1 * noise
    log = excite.Log.from_arrays(moves.time, moves.q, dq=moves.dq, joints=robot.joint_names, wrench=wrench)
    given = {"model": "base-wrench", "choose": False}
    tied, apart = (excite.identify(arms(), log, symmetric=one, **given) for one in (True, False))
    assert tied.symmetry.differences[0].body.startswith("right")
    excite.export_model(apart, "urdf", tmp_path / "arms.urdf")
    assert off(tmp_path / "arms.urdf", robot) < 0.01
