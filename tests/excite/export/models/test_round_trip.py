"""Exported models, loaded by Pinocchio and MuJoCo and read back, are the identified ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from commands import Here
from identified import predicted, relative, result_of, true_standard
from pinocchio_chains import chain_model
from public_arms import ARMS, TREES, Arm
from reloaded import by_mujoco, by_pinocchio

import excite
from excite.export.models.exported_model import model_of_result
from excite.export.models.nearest_bodies import states_of
from excite.export.models.robot_yaml import robot_text, write_robot
from excite.identification.identification import Identification
from excite.identification.prediction import instantaneous_target
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.readers.description import parse_description
from regressors.readers.library import built_in, built_in_names, load_robot
from regressors.readers.urdf import read_urdf
from regressors.robot.locked_joints import with_joint_rotors, with_locked_joints
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

COUNT = 2_000
RIGID, FRICTION = 1e-9, 1e-6
SLOW = pytest.mark.slow
CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("irp6", {}),
    ("panda", {}),
    ("panda", {"joint_rotors": True}),
    ("ur10e", {}),
    ("ur10e", {"joints": ("2", "3", "5")}),
    ("iiwa7", {}),
)
REST = tuple(CASES[k] for k in (1, 2, 3, 5))
# fixed joints, mimic joints, continuous joints, prismatic joints, mass on the root link, links without inertia
QUICK = ("ur3", "tiago-head", "two-dofs")
ALL = tuple(arm.id for arm in ARMS)
NOT_POSSIBLE = (  # their descriptions state inertias that no body has: the nearest possible ones are written
    "panda-hand", "pr2-torso-right", "pr2-laser", "baxter-left", "icub-left-arm", "icub-leg", "alex-mimic-hand",
    "alexander-leg", "hextilt-arm", "double-pendulum", "hyq-leg",
)  # fmt: skip


def case(name: str, options: dict[str, Any], folder: Path) -> tuple[Identification, IdentificationTarget, Samples]:
    result = result_of(excite.load_robot(name), folder, **options)
    target = instantaneous_target(result.robot, result.task, result.recipe)
    return result, target, states_of(target, COUNT)


def bodies_alone(result: Identification, target: IdentificationTarget, samples: Samples) -> Array:
    """Torques of the bodies without rotors, by Pinocchio's recursion over our description."""
    robot = model_of_result(result).robot
    model = chain_model(robot)
    data = model.createData()
    moving = [robot.joint_index(name) for name in target.robot.joint_names]
    full = np.zeros((3, samples.time.size, robot.n))
    full[:, :, moving] = samples.q, samples.dq, samples.ddq
    return np.array([pin.rnea(model, data, *state).copy() for state in full.swapaxes(0, 1)])[:, moving]


def test_mujoco_reads_the_limits_of_the_joints(tmp_path: Path) -> None:
    result, _, _ = case("panda", {}, tmp_path)
    excite.export_model(result, "mjcf", tmp_path / "robot.xml")
    model, limits = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml")), result.robot.limits
    for k, name in enumerate(result.robot.joint_names):
        number, torque = model.joint(name).id, limits.torque[k]
        np.testing.assert_allclose(model.jnt_range[number], [limits.lower[k], limits.upper[k]], rtol=1e-12)
        np.testing.assert_allclose(model.jnt_actfrcrange[number], [-torque, torque], rtol=1e-12)


@pytest.mark.parametrize(("name", "options"), [CASES[0], CASES[4], *(pytest.param(*c, marks=SLOW) for c in REST)])
def test_mujoco_has_the_torques_of_the_result(name: str, options: dict[str, Any], tmp_path: Path) -> None:
    result, target, samples = case(name, options, tmp_path)
    excite.export_model(result, "mjcf", tmp_path / "robot.xml")
    rigid, friction = predicted(result, samples)
    found = by_mujoco(tmp_path / "robot.xml", target.robot.joint_names, samples, friction=True)
    outside = found.outside
    assert outside.sum() > COUNT / 50
    assert relative(found.rigid, rigid) < RIGID
    assert relative(found.friction[outside], friction[outside]) < FRICTION


@pytest.mark.parametrize(
    ("name", "options"), [CASES[4], *(pytest.param(*c, marks=SLOW) for c in REST if "joint_rotors" not in c[1])]
)
def test_pinocchio_has_the_torques_of_the_result(name: str, options: dict[str, Any], tmp_path: Path) -> None:
    result, target, samples = case(name, options, tmp_path)
    excite.export_model(result, "urdf", tmp_path / "robot.urdf")
    rigid, friction = predicted(result, samples)
    found = by_pinocchio(tmp_path / "robot.urdf", target.robot.joint_names, samples)
    assert relative(found.rigid, rigid) < RIGID
    assert relative(found.friction, friction) < FRICTION


def test_a_urdf_of_coupled_drives_has_the_bodies(tmp_path: Path) -> None:
    result, target, samples = case("irp6", {}, tmp_path)
    notes = excite.export_model(result, "urdf", tmp_path / "robot.urdf").notes
    found = by_pinocchio(tmp_path / "robot.urdf", target.robot.joint_names, samples)
    assert relative(found.rigid, bodies_alone(result, target, samples)) < RIGID
    assert any("rotor inertias (z1, z2, z5)" in note for note in notes)
    assert any("move several joints" in note and "z3" in note for note in notes)


def exported_copy(arm: Arm, folder: Path, count: int) -> tuple[float, float]:
    """Relative errors of the rigid torques and of friction, of a copy of a public robot's own file."""
    robot = excite.load_robot(str(arm.path), arm.base, arm.tip, snap_angles=False)
    result = result_of(robot, folder, nearly_unidentifiable="keep")  # what angles as printed make of parameters too
    target = instantaneous_target(robot, result.task, result.recipe)
    excite.export_model(result, "urdf", folder / "copy.urdf", robot_file=arm.path)
    samples = states_of(target, count)
    rigid, friction = predicted(result, samples)
    found = by_pinocchio(folder / "copy.urdf", robot.joint_names, samples)
    return relative(found.rigid, rigid), relative(found.friction, friction)


@pytest.mark.parametrize("name", QUICK)
def test_a_copy_of_the_users_urdf_has_the_torques_of_the_result(name: str, tmp_path: Path) -> None:
    rigid, friction = exported_copy(ARMS[ALL.index(name)], tmp_path, COUNT)
    assert rigid < RIGID
    assert friction < FRICTION


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in ALL if name not in QUICK])
def test_copies_of_all_public_urdfs_have_the_torques_of_the_result(name: str, tmp_path: Path) -> None:
    rigid, friction = exported_copy(ARMS[ALL.index(name)], tmp_path, COUNT)
    assert rigid < (1e-4 if name in NOT_POSSIBLE else RIGID)
    assert friction < FRICTION


def test_the_robot_yaml_is_the_identified_robot(tmp_path: Path) -> None:
    result = result_of(excite.load_robot("irp6"), tmp_path)
    excite.export_model(result, "yaml", tmp_path / "robot.yaml")
    read, written = excite.load_robot(str(tmp_path / "robot.yaml")), model_of_result(result).robot
    for mine, theirs in zip(read.links, written.links, strict=True):
        np.testing.assert_array_equal(mine.theta, theirs.theta)
    target = instantaneous_target(read, result.task, result.recipe)
    again, samples = result_of(read, tmp_path, true_standard(target)), states_of(target, 100)
    for mine, theirs in zip(predicted(again, samples), predicted(result, samples), strict=True):
        assert relative(mine, theirs) < RIGID


GO2, BAXTER, SOLO12, *_ = (arm for arm in TREES if arm.id in ("go2", "baxter", "solo12"))


@pytest.mark.parametrize("arm", [GO2, pytest.param(BAXTER, marks=SLOW), pytest.param(SOLO12, marks=SLOW)], ids=str)
def test_a_tree_is_written_as_one(arm: Arm, tmp_path: Path) -> None:
    """New files and a copy of the user's; Baxter's inertias are no bodies', so the nearest are written."""
    close = 1e-4 if arm is BAXTER else RIGID
    rigid, friction = exported_copy(arm, tmp_path, 200)
    assert (rigid < close, friction < FRICTION) == (True, True)
    robot = excite.load_robot(str(arm.path), arm.base, arm.tip)
    result = result_of(robot, tmp_path)
    samples = states_of(instantaneous_target(robot, result.task, result.recipe), 200)
    expected, _ = predicted(result, samples)
    excite.export_model(result, "mjcf", tmp_path / "robot.xml")
    excite.export_model(result, "urdf", tmp_path / "robot.urdf")
    found = by_mujoco(tmp_path / "robot.xml", robot.joint_names, samples, friction=True)
    assert relative(found.rigid, expected) < close
    assert relative(by_pinocchio(tmp_path / "robot.urdf", robot.joint_names, samples).rigid, expected) < close
    assert_read_back(robot)


@pytest.mark.parametrize("tree", [False, True])
def test_the_arrays_are_pinocchios(tree: bool, tmp_path: Path) -> None:
    robot = built_in("ur10e")
    robot = robot.replace(parents=(0, 1, 1, 3, 3, 5)) if tree else robot
    result = result_of(robot, tmp_path, joint_rotors=True)
    samples = states_of(instantaneous_target(robot, result.task, result.recipe), COUNT)
    excite.export_model(result, "npz", tmp_path / "robot.npz")
    with np.load(tmp_path / "robot.npz", allow_pickle=False) as file:
        arrays = dict(file)
    model = pin.Model()
    model.gravity.linear = arrays["gravity"]
    for k, name in enumerate(arrays["joint_names"]):
        placement = pin.SE3(arrays["placement_rotation"][k], arrays["placement_translation"][k])
        carrier = int(arrays["parents"][k])
        own = model.addJoint(carrier, pin.JointModelRevoluteUnaligned(arrays["axis"][k]), placement, str(name))
        body = pin.Inertia(float(arrays["mass"][k]), arrays["lever"][k], arrays["inertia"][k])
        np.testing.assert_allclose(body.toDynamicParameters(), arrays["dynamic_parameters"][k], rtol=0, atol=1e-12)
        model.appendBodyToJoint(own, body, pin.SE3.Identity())
    model.armature = arrays["armature"]
    np.testing.assert_allclose(arrays["rotorGearRatio"] ** 2 * arrays["rotorInertia"], arrays["armature"])
    data = model.createData()
    rigid, friction = predicted(result, samples)
    states = list(zip(samples.q, samples.dq, samples.ddq, strict=True))[:500]
    found = np.array([pin.rnea(model, data, *state).copy() for state in states])
    assert relative(found, rigid[:500]) < RIGID
    own = arrays["damping"] * samples.dq + arrays["friction"] * np.sign(samples.dq)
    assert relative(own, friction) < FRICTION


SOME_ARMS = [arm for arm in ARMS if arm.id in ("panda-hand", "kinova", "tiago-torso-arm", "g1-thumb", "two-dofs")]


def assert_read_back(robot: Robot) -> None:
    again = parse_description(robot_text(robot), "written")
    assert (again.description(), again.sha256()) == (robot.description(), robot.sha256())


@pytest.mark.parametrize("name", built_in_names())
def test_built_in_robot(name: str) -> None:
    assert_read_back(built_in(name))


@pytest.mark.parametrize("arm", SOME_ARMS, ids=str)
def test_robot_of_a_urdf(arm: Arm) -> None:
    assert_read_back(read_urdf(arm.path, base=arm.base, tip=arm.tip))


def test_what_robot_yaml_cannot_say_is_refused() -> None:
    for robot in (with_locked_joints(built_in("irp6"), [1, 2]), with_joint_rotors(built_in("panda"))):
        with pytest.raises(InputError):
            robot_text(robot)


def test_written_file_and_what_is_in_the_way(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    write_robot(built_in("irp6"), path)
    assert load_robot(str(path)).sha256() == built_in("irp6").sha256()
    with pytest.raises(InputError, match="already there; `replace` replaces it"):
        write_robot(built_in("panda"), path)
    write_robot(built_in("panda"), path, replace=True)
    assert load_robot(str(path)).sha256() == built_in("panda").sha256()
    with pytest.raises(InputError, match=r"ends in \.yaml or \.yml"):
        write_robot(built_in("panda"), tmp_path / "own.urdf")


def test_command_writes_it(here: Here) -> None:
    ended = here.run("robots", "irp6", "--out", "own.yaml")
    assert (ended.returncode, ended.stdout) == (0, "written: own.yaml\n")
    assert load_robot(str(here.cwd / "own.yaml")).sha256() == built_in("irp6").sha256()
    assert "--force replaces it" in here.run("robots", "irp6", "--out", "own.yaml").stderr
    assert here.run("robots", "irp6", "--out", "own.yaml", "--force").returncode == 0
    assert "name it: excite robots ROBOT --out FILE" in here.run("robots", "--out", "own.yaml").stderr
