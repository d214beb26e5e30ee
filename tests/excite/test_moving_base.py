"""Robots on a moving base from their logs to the verdict, with MuJoCo as the plant."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Here
from moving_bases import mapping, played
from public_arms import robot_file
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

import excite
from excite.identification.estimators.least_squares import weighted
from excite.identification.identification import Identification
from excite.identification.observations import Observations
from excite.identification.prediction import with_measured_side
from excite.information.prior import prior_of
from excite.logs.base_motion import measured_equations
from excite.logs.log import Log
from excite.logs.mapping import LogMapping
from excite.tasks.installation import Installation
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.differential import DifferentialModel
from regressors.readers.library import load_robot
from regressors.robot.columns import Terms
from regressors.robot.locked_joints import with_joint_rotors
from regressors.robot.moving_base import BASE_JOINTS
from regressors.robot.robot import Robot
from regressors.samples import Array

GIVEN: dict[str, Any] = {"choose": False, "friction": False, "rotor": False, "cutoff": 12.0}

_ARM = "hextilt_description/urdf/hextilt_flying_arm_5.urdf"


def file_of(name: str) -> Path:
    return robot_file({"arm": _ARM, "go2": "go2_description/urdf/go2.urdf"}[name])


@cache
def log_of(seed: int, hung: bool = True, noise: float = 0.2) -> dict[str, Array]:
    return played(file_of("arm"), hung=hung, seed=seed, seconds=6.0, noise=noise)


@cache
def robot() -> Robot:
    return load_robot(file_of("arm"))


def off(result: Identification) -> Array:
    """Deviation from the described parameters, in half-widths of the intervals."""
    target, base = result.target, result.target.base
    truth = prior_of(target.model, base, None).base_values(np.eye(base.rank))
    return np.abs(result.coefficients - truth) / result.estimate.half_width


def test_a_drone_with_an_arm_is_identified_from_eleven_equations_and_judged(tmp_path: Path) -> None:
    log, other = log_of(0), log_of(1)
    result = excite.identify(str(file_of("arm")), log, mapping=mapping(log), **GIVEN)
    assert [name for name, _ in result.target.model.row_labels] == [*BASE_JOINTS, *robot().joint_names]
    assert result.names[:4] == ("m6", "m6c6x", "m6c6y", "m6c6z")
    assert abs(result.coefficients[0] / 1.686413 - 1) < 1e-3
    assert np.mean(off(result) < 1.0) > 0.9
    result.save(tmp_path / "r")
    judged = excite.verify(tmp_path / "r", other, mapping=mapping(other))
    assert judged.verdict.holds
    assert judged.corrected_total.relative < 0.01


@pytest.mark.slow
def test_where_no_wrench_is_measured_the_equations_of_the_joints_hold_whatever_acts_on_the_base() -> None:
    for hung in (True, False):
        log = log_of(0, hung)
        result = excite.identify(robot(), log, mapping=mapping(log, wrench=False), **GIVEN)
        assert [name for name, _ in result.target.model.row_labels] == list(robot().joint_names)
        assert "m6" not in result.names
        assert result.training_error < 0.03
        other = log_of(1)
        assert excite.verify(result, other, mapping=mapping(other)).corrected_total.relative < 0.05


def test_without_torques_the_wrench_on_the_base_shows_the_bodies() -> None:
    log = log_of(0)
    result = excite.identify(robot(), log, mapping=mapping(log, torques=False), **GIVEN)
    assert [name for name, _ in result.target.model.row_labels] == list(BASE_JOINTS)
    assert abs(result.coefficients[0] / 1.686413 - 1) < 1e-3
    for given in ({"wrench": False}, {"free": True}):
        with pytest.raises(InputError, match="windows hold the work of all that acts on the robot, and no wrench"):
            excite.identify(robot(), log, mapping=mapping(log, **given), model="energy", choose=False)
    with pytest.raises(InputError, match="neither torques of the joints nor a wrench on the base"):
        excite.identify(robot(), log, mapping=mapping(log, wrench=False, torques=False))


def test_a_log_is_judged_by_the_equations_whose_efforts_it_has() -> None:
    log, other = log_of(0), log_of(1)
    result = excite.identify(robot(), log, mapping=mapping(log), **GIVEN)
    judged = excite.verify(result, other, mapping=mapping(other, wrench=False))
    assert tuple(error.name for error in judged.torques) == robot().joint_names
    assert judged.corrected_total.relative < 0.01
    of_wrench = excite.identify(robot(), log, mapping=mapping(log, torques=False), **GIVEN)
    with pytest.raises(InputError, match=r"no efforts of base_x, .*; give `wrench:` in `base:`"):
        excite.verify(of_wrench, other, mapping=mapping(other, wrench=False))


@pytest.mark.slow
def test_a_quadruped_that_falls_shows_its_base_by_equations_without_a_measured_side() -> None:
    log, other = (played(file_of("go2"), hung=False, seed=seed, seconds=8.0) for seed in (0, 1))
    result = excite.identify(str(file_of("go2")), log, mapping=mapping(log, free=True))
    inside = off(result)[[not name.startswith("F") for name in result.names]] < 1.0
    assert np.mean(inside) > 0.97
    assert abs(result.coefficients[result.names.index("m13")] / 16.085 - 1) < 0.02
    assert result.training_error < 0.03  # over the equations of the joints, which have another side
    assert "the equations of the base are used, since nothing touches the robot" in result.estimate.notes
    assert any(note.startswith("both sides of the equations are low-passed at") for note in result.estimate.notes)
    assert not any("stands still" in note for note in result.estimate.notes)
    judged = excite.verify(result, other, mapping=mapping(other, free=True))
    assert judged.verdict.holds
    assert judged.corrected_total.relative < 0.005


@pytest.mark.slow
def test_equations_of_a_base_that_hardly_moves_are_left_out() -> None:
    log = log_of(1, hung=False, noise=1.0)
    result = excite.identify(robot(), log, mapping=mapping(log, free=True), friction=False, rotor=False)
    assert [name for name, _ in result.target.model.row_labels] == list(robot().joint_names)
    assert np.mean(off(result) < 1.0) > 0.95
    assert any(note.startswith("the equations of the base are left out") for note in result.estimate.notes)


def test_equations_without_a_measured_side_do_not_shrink_parameters() -> None:
    rng = np.random.default_rng(0)
    truth, joint = np.array([1.0, -2.0, 0.5]), np.arange(4000) % 2 == 0
    W = rng.normal(size=(4000, 3))
    W[joint, 2] = 0.0
    W[joint] *= 0.01
    W[~joint, 0] = 2.0 * W[~joint, 1] - 0.5 * W[~joint, 2]  # 0 = W truth
    y = np.where(joint, W @ truth + 1e-4 * rng.normal(size=4000), 0.0)
    W[~joint] += 0.05 * rng.normal(size=(2000, 3))
    names, equations, one = ("a", "b", "c"), (("joint", "Nm"), ("base", "N")), np.zeros(4000, dtype=int)
    time = np.arange(4000.0) // 2
    rows = Observations(W, y, names, ("1",) * 3, np.where(joint, 0, 1), equations, one, ("log",), time)
    np.testing.assert_allclose(weighted(rows).values, truth, rtol=0.02)
    free = with_measured_side((("base_x", "N"), ("joint", "Nm"), ("dead", "Nm")), np.array([0.0, 1.0, 0.0]))
    assert free.tolist() == [False, True, True]
    assert with_measured_side((("base_x", "N"), ("base_y", "N")), np.array([0.0, 1.0])).all()


@pytest.mark.slow
def test_models_tasks_and_names_of_a_robot_stand_on_the_base_of_the_log() -> None:
    log = log_of(0)
    given = {**GIVEN, "mapping": mapping(log)}
    names = excite.identify(robot(), log, **given).names
    assert excite.identify(Task(robot()), log, **given).names == names
    assert excite.identify(Task(str(file_of("arm"))), log, **given).names == names
    model = DifferentialModel(robot(), Terms.inertial_only())
    assert excite.identify(model, log, mapping=mapping(log), choose=False, cutoff=12.0).names == names
    some = excite.identify(robot(), log_of(0), joints=robot().joint_names, **given)
    assert some.names == names


def base_log(log: dict[str, Array], **given: bool) -> Log:
    return Log.from_frame(log, mapping(log, **given), robot=Installation(moving_base=True).applied(robot()))


def of(log: dict[str, Array], head: str, axes: str = "xyz") -> Array:
    return np.column_stack([log[f"{head}{axis}"] for axis in axes])


def test_an_imu_gives_accelerations_that_the_pose_does_not() -> None:
    noisy, exact = log_of(0, noise=1.0), base_log(log_of(0, noise=0.0), imu=False)
    misses = []
    for imu in (False, True):
        q = base_log(noisy, imu=imu).q[:, :6]
        again = [np.gradient(np.gradient(x, exact.time, axis=0), exact.time, axis=0) for x in (q, exact.q[:, :6])]
        misses.append(np.std((again[0] - again[1])[50:-50], axis=0))
        np.testing.assert_allclose(q[50:-50], exact.q[50:-50, :6], atol=5e-3)
    assert np.all(misses[1] < 0.05 * misses[0])


def test_frames_of_pose_imu_and_wrench_are_placed_in_that_of_the_base() -> None:
    log, turned, place = log_of(0, noise=0.0), Rotation.from_euler("ZYX", [0.4, -0.7, 0.3]), np.array([0.1, -0.2, 0.3])
    expected = base_log(log)
    R = Rotation.from_quat(of(log, "q", "xyzw"))
    moved = dict(log)
    moved |= zip(("px", "py", "pz"), (of(log, "p") + R.apply(place)).T, strict=True)
    moved |= zip(("qx", "qy", "qz", "qw"), (R * turned).as_quat().T, strict=True)
    for head in "gafn":
        moved |= zip((f"{head}{axis}" for axis in "xyz"), turned.inv().apply(of(log, head)).T, strict=True)
    content = mapping(log).model_dump(exclude_unset=True)
    rpy = turned.as_euler("ZYX")[::-1].tolist()
    content["base"]["position"]["xyz"] = place.tolist()
    for name in ("quaternion", "angular_velocity", "specific_force", "wrench"):
        content["base"][name]["rpy"] = rpy
    moving = Installation(moving_base=True).applied(robot())
    found = Log.from_frame(moved, LogMapping.model_validate(content), robot=moving)
    np.testing.assert_allclose(found.q, expected.q, atol=1e-9)
    np.testing.assert_allclose(found.effort, expected.effort, atol=1e-9)


def test_the_power_of_the_wrench_is_that_of_its_joints() -> None:
    log = log_of(0, noise=0.0)
    found = base_log(log, imu=False)
    dq = np.gradient(found.q[:, :6], found.time, axis=0)
    R = Rotation.from_quat(of(log, "q", "xyzw"))
    F, N, omega = (of(log, head) for head in "fng")
    v = R.inv().apply(dq[:, :3]) + np.cross(omega, [0.05, 0.02, 0.1])
    power = np.sum(F * v + N * omega, axis=1)
    np.testing.assert_allclose(np.sum(found.effort[:, :6] * dq, axis=1)[5:-5], power[5:-5], atol=5e-3)


def test_motors_are_converted_on_a_moving_base_too() -> None:
    log = log_of(0, noise=0.0)
    content = mapping(log).model_dump(exclude_unset=True)
    content["position"] |= {"side": "motor", "ratio": [2.0]}
    geared = with_joint_rotors(robot())
    doubled = {name: 2.0 * x if name.endswith(".position") else x for name, x in log.items()}
    moving = Installation(moving_base=True).applied(geared)
    found = Log.from_frame(doubled, LogMapping.model_validate(content), robot=moving)
    np.testing.assert_allclose(found.q, base_log(log).q, atol=1e-12)


def changed(log: dict[str, Array], **columns: Array | float) -> dict[str, Array]:
    return {**log, **{name: np.broadcast_to(value, log["t"].shape) for name, value in columns.items()}}


def test_bases_that_cannot_be_are_refused_in_words() -> None:
    log = log_of(0)
    steep = dict(zip(("qx", "qy", "qz", "qw"), Rotation.from_euler("ZYX", [0, 1.5, 0]).as_quat(), strict=True))
    cases = (
        (changed(log, **steep), "the base pitches by 86 degrees at .* s, where yaw and roll are about nearly the same"),
        (changed(log, qw=3.0), "the quaternion of the base at .* s has the length 3.*, expected 1; check its columns"),
        (changed(log, **dict.fromkeys(("fx", "fy", "fz", "nx", "ny", "nz"), 0.0)), "the wrench on the base is zero; "),
    )
    for given, expected in cases:
        with pytest.raises(InputError, match=expected):
            base_log(given)
    with pytest.raises(InputError, match="here the base stands still; moving bases are for identify and verify"):
        Log.from_frame(log, mapping(log), robot=robot())
    with pytest.raises(InputError, match="a design does not support a moving base; put the base on a stand"):
        excite.design_trajectory(Task(str(file_of("arm")), moving_base=True))
    with pytest.raises(InputError, match="`mount` is for a base that stands still"):
        Installation(moving_base=True, mount="wall")
    assert measured_equations(None, robot(), ["a"]) == ["a"]


@pytest.mark.parametrize(
    ("base", "expected"),
    [
        ({"quaternion": None}, "needs one of rpy and quaternion"),
        ({"free": True}, "free says that nothing touches the robot; leave out one of free and wrench"),
        ({"rpy": {"columns": [1, 2, 3], "unit": ["rad"]}}, "needs one of rpy and quaternion"),
        ({"position": {"columns": [1, 2, 3], "unit": ["rad"]}}, "position needs 3 columns, in one of m, mm"),
        ({"wrench": {"columns": [1, 2, 3], "unit": ["N"]}}, "wrench needs 6 columns, in one of N, kN"),
        ({"quaternion": {"columns": [1, 2, 3, 4], "file": "x.csv"}}, "give file and time of all channels"),
    ],
)
def test_mappings_of_a_base_say_what_they_lack(base: dict[str, Any], expected: str) -> None:
    content = mapping(log_of(0)).model_dump(exclude_unset=True)
    content["base"] |= base
    with pytest.raises(ValueError, match=expected):
        LogMapping.model_validate(content)


@pytest.mark.slow
def test_a_hung_quadruped_from_files_to_the_page(here: Here) -> None:
    logs = [played(file_of("go2"), hung=True, seed=seed) for seed in (0, 1)]
    for seed, log in enumerate(logs):
        table = np.column_stack(list(log.values()))
        np.savetxt(here.cwd / f"{seed}.csv", table, delimiter=",", header=",".join(log), comments="")
    YAML(typ="safe").dump(mapping(logs[0]).model_dump(exclude_unset=True), here.cwd / "m.yaml")
    commands = (
        (f"identify {file_of('go2')} 0.csv --mapping m.yaml --out r", "Base parameters of go2_description"),
        ("verify r 1.csv --mapping m.yaml", "The result predicts this log"),
        ("report r --out page.html", "Page written"),
        ("export r --format mjcf --out r.xml", "written"),
        ("export r --format urdf --out r.urdf", "written"),
    )
    for command, expected in commands:
        assert expected in here.run(*command.split(), status=0).stdout
    refused = here.run("export", "r", "--format", "yaml", "--out", "r.yaml")
    assert "robot YAML cannot hold robot 'go2_description', whose base moves; choose mjcf" in refused.stderr
