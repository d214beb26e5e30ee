"""Robot YAML of robots of any origin reads back as the same robot, to the last bit."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import Here
from public_arms import ARMS, Arm

from excite.export.models.robot_yaml import robot_text, write_robot
from regressors.errors import InputError
from regressors.readers.description import parse_description
from regressors.readers.library import built_in, built_in_names, load_robot
from regressors.readers.urdf import read_urdf
from regressors.robot.locked_joints import with_joint_rotors, with_locked_joints
from regressors.robot.robot import Robot

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


@pytest.mark.parametrize(
    "robot",
    [with_locked_joints(built_in("irp6"), [1, 2]), with_joint_rotors(built_in("panda"))],
    ids=["locked joints", "unknown rotors"],
)
def test_what_robot_yaml_cannot_say_is_refused(robot: Robot) -> None:
    with pytest.raises(InputError):
        robot_text(robot)


def test_written_file_and_what_is_in_the_way(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    write_robot(built_in("irp6"), path)
    assert load_robot(str(path)).sha256() == built_in("irp6").sha256()
    with pytest.raises(InputError, match="is there already; `replace` replaces it"):
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
