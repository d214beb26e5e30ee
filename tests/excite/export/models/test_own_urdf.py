"""A copy of the user's URDF: only the parameters change, and what is not the robot's file is refused."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from identified import predicted, relative, result_of
from public_arms import ARMS, Arm
from reloaded import by_pinocchio

import excite
from excite.export.models.exported_model import model_of_result
from excite.export.models.nearest_bodies import states_of
from excite.identification.identification import Identification
from excite.identification.prediction import instantaneous_target
from regressors.readers.urdf_tree import parse_tree
from regressors.robot.inertia import pseudo_inertia

OWN = """<?xml version="1.0"?>
<!-- mine - it's "quoted" -->
<robot   name='own'  xmlns:xacro="http://ros.org/wiki/xacro">
  <link name="base"><inertial><mass value="3.5"/><origin xyz="0 0 0"/>
     <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="arm">
\t<inertial>  <!-- of the maker -->
      <mass   value = '2.0' />
      <origin rpy="0.3 0 0.1" xyz="0.1 0.02 0"/>
      <inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual><geometry><mesh filename="package://a/b > c.stl"/></geometry></visual>
  </link>
  <link name="plate"/>
  <link name="tool"><inertial><mass value="0.3"/><inertia ixx=".001" ixy="0" ixz="0" iyy=".001" iyz="0" izz=".001"/>
  </inertial></link>
  <link name='fore'></link>
  <joint name="base_arm" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit effort="50" velocity="2"/></joint>
  <joint name="weld" type="fixed"><parent link="fore"/><child link="plate"/><origin xyz="0 0 0.1"/></joint>
  <joint name="screw" type="fixed"><parent link="plate"/><child link="tool"/><origin rpy="0 0.4 0"/></joint>
  <joint name="arm_fore" type="revolute">
    <origin xyz="0.4 0 0" rpy="0 0 0.7"/>
    <parent link="arm"/>
    <child link="fore"/>
    <axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="20" velocity="3"/>
    <dynamics friction="0.2"
              damping="0.1"/>
  </joint>
</robot>
"""
PARTS = re.compile(
    rb"\s*<inertial>.*?</inertial>|\s*<dynamics.*?/>|<!--\r?\n  identified parameters.*?-->\r?\n", re.DOTALL
)


def result_for(text: str | bytes, folder: Path) -> tuple[Identification, Path]:
    path = folder / "own.urdf"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return result_of(excite.load_robot(str(path), snap_angles=False), folder), path


def rest_of(content: bytes) -> bytes:
    """What is no inertia, friction or comment of ours; an empty link is an empty tag."""
    return re.sub(rb"<link name=(.\w+.)>\s*</link>", rb"<link name=\1/>", PARTS.sub(b"", content))


@pytest.mark.parametrize("line", ["\n", "\r\n"])
def test_everything_else_stays_byte_for_byte(line: str, tmp_path: Path) -> None:
    result, path = result_for(OWN.replace("\n", line), tmp_path)
    excite.export_model(result, "urdf", tmp_path / "new.urdf", robot_file=path)
    before, after = path.read_bytes(), (tmp_path / "new.urdf").read_bytes()
    assert rest_of(after) == rest_of(before)
    assert after.count(b"\r\n") == (after.count(b"\n") if line == "\r\n" else 0)
    base = before[before.index(b'<link name="base">') : before.index(b'<link name="arm">')]
    assert base in after  # mass on the root link does not move
    assert b"<!-- of the maker -->" in after
    assert b"package://a/b > c.stl" in after


@pytest.mark.parametrize("text", [OWN, OWN.replace("\n", "\r\n"), "\ufeff" + OWN])
def test_the_copy_has_the_torques_of_the_result(text: str, tmp_path: Path) -> None:
    result, path = result_for(text, tmp_path)
    notes = excite.export_model(result, "urdf", tmp_path / "new.urdf", robot_file=path).notes
    target = instantaneous_target(result.robot, result.task, result.recipe)
    samples = states_of(target, 200)
    (tmp_path / "plain.urdf").write_text((tmp_path / "new.urdf").read_text(encoding="utf-8-sig"))
    found = by_pinocchio(tmp_path / "plain.urdf", result.robot.joint_names, samples)
    for mine, theirs in zip((found.rigid, found.friction), predicted(result, samples), strict=True):
        assert relative(mine, theirs) < 1e-12
    assert any("tool did not move against fore" in note for note in notes)


FORE = (
    '<link name="fore"><inertial><mass value="1"/><inertia ixx=".02" ixy="0" ixz="0" iyy=".02" iyz="0" izz=".02"/>'
    "</inertial></link>"
)


@pytest.mark.parametrize(("mass", "kept"), [("0.03", True), ("3", False)])
def test_every_link_of_a_group_is_a_possible_body(mass: str, kept: bool, tmp_path: Path) -> None:
    """The other links keep what the file says, unless the identified sum is less than they are."""
    text = OWN.replace("<link name='fore'></link>", FORE)
    result, path = result_for(text, tmp_path)
    path.write_text(text.replace('<mass value="0.3"/>', f'<mass value="{mass}"/>'))
    excite.export_model(result, "urdf", tmp_path / "new.urdf", robot_file=path)
    tree = parse_tree((tmp_path / "new.urdf").read_bytes(), "new")
    for name in ("arm", "fore", "tool"):
        assert np.linalg.eigvalsh(pseudo_inertia(tree.links[name]))[0] > 0
    stated = ET.parse(tmp_path / "new.urdf").find("link[@name='tool']/inertial/mass").get("value")
    assert (stated == mass) == kept


REFUSED = (
    (OWN.replace("arm_fore", "elbow"), "it has no joint arm_fore"),
    (OWN.replace('xyz="0.4 0 0"', 'xyz="0.5 0 0"'), "joint 'arm_fore' sits elsewhere"),
    (OWN.replace('type="revolute"', 'type="prismatic"'), "joint 'arm_fore' sits elsewhere"),
    (OWN.replace('xyz="0 1 0"/>', 'xyz="0 0 1"/>', 1), "joint 'base_arm' sits elsewhere"),
    (OWN.replace("</robot>", ""), "not well-formed XML"),
    ("<sdf></sdf>", "robot"),
    (b"\xff\xfe" + OWN.encode("utf-16-le"), "UTF-16"),
)


@pytest.mark.parametrize(("text", "says"), REFUSED)
def test_a_file_of_another_robot_is_refused(text: str | bytes, says: str, tmp_path: Path) -> None:
    result, _ = result_for(OWN, tmp_path)
    other = tmp_path / "other.urdf"
    other.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(excite.InputError, match=re.escape(says)):
        excite.export_model(result, "urdf", tmp_path / "new.urdf", robot_file=other)
    assert not (tmp_path / "new.urdf").exists()


def test_rounded_angles_of_the_file_are_named(tmp_path: Path) -> None:
    arm: Arm = next(arm for arm in ARMS if arm.id == "xarm7")
    result = result_of(excite.load_robot(str(arm.path), arm.base, arm.tip), tmp_path)
    notes = excite.export_model(result, "urdf", tmp_path / "new.urdf", robot_file=arm.path).notes
    assert any("rounded" in note and "right angles" in note for note in notes)
    assert rest_of((tmp_path / "new.urdf").read_bytes()) == rest_of(arm.path.read_bytes())


def test_drakes_elements_go_into_the_transmissions_of_the_file(tmp_path: Path) -> None:
    transmission = (
        '<transmission name="t"><joint name="arm_fore"/><actuator name="m"><mechanicalReduction>1'
        "</mechanicalReduction></actuator></transmission>\n</robot>"
    )
    path = tmp_path / "own.urdf"
    path.write_text(OWN.replace("</robot>", transmission))
    result = result_of(excite.load_robot(str(path), snap_angles=False), tmp_path, joint_rotors=True)
    excite.export_model(result, "drake", tmp_path / "new.urdf", robot_file=path)
    root = ET.parse(tmp_path / "new.urdf").getroot()
    armature = model_of_result(result)
    found = {}
    for element in root.findall("transmission"):
        actuator = element.find("actuator")
        inertia, ratio = (
            float(actuator.find(f"{{https://drake.mit.edu}}{tag}").get("value"))
            for tag in ("rotor_inertia", "gear_ratio")
        )
        found[element.find("joint").get("name")] = ratio**2 * inertia
    assert found == {"base_arm": armature.armature(0), "arm_fore": armature.armature(1)}
    assert root.find("transmission/actuator/mechanicalReduction").text == "1"


def test_held_joints_rest_where_they_were_held(tmp_path: Path) -> None:
    """Joint 2 cannot be at zero: it was held at its nearest limit."""
    text = OWN.replace('lower="-2" upper="2"', 'lower="0.5" upper="2"').replace("<link name='fore'></link>", FORE)
    path = tmp_path / "own.urdf"
    path.write_text(text)
    result = result_of(excite.load_robot(str(path), snap_angles=False), tmp_path, joints=("1",))
    target = instantaneous_target(result.robot, result.task, result.recipe)
    samples = states_of(target, 50)
    rigid, friction = predicted(result, samples)
    for form, own in (("urdf", path), ("urdf", None)):
        excite.export_model(result, form, tmp_path / "new.urdf", robot_file=own, replace=True)
        found = by_pinocchio(tmp_path / "new.urdf", ("base_arm",), samples, {"arm_fore": 0.5})
        assert relative(found.rigid, rigid) < 1e-12
        assert relative(found.friction, friction) < 1e-12
