"""Copies of the user's URDF and MJCF: only the parameters change, and all other bytes stay."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from identified import predicted, relative, result_of
from public_arms import ARMS, Arm
from reloaded import by_mujoco, by_pinocchio
from written_files import text_file

import excite
from excite.export.models.exported_model import model_of_result
from excite.export.models.nearest_bodies import states_of
from excite.export.models.xml_copy import XmlDocument, comment
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
    ("", "not well-formed XML"),
    ("<!DOCTYPE robot><robot/>", "DOCTYPE"),
    ("<sdf></sdf>", "robot"),
    (b"\xff\xfe" + OWN.encode("utf-16-le"), "UTF-16"),
)


def test_a_file_of_another_robot_is_refused(tmp_path: Path) -> None:
    result, other = result_for(OWN, tmp_path)[0], tmp_path / "other.urdf"
    for text, says in REFUSED:
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
    actuator = '<actuator name="m"><mechanicalReduction>1</mechanicalReduction></actuator>'
    transmission = f'<transmission name="t"><joint name="arm_fore"/>{actuator}</transmission>\n</robot>'
    path = text_file(tmp_path / "own.urdf", OWN.replace("</robot>", transmission))
    result = result_of(excite.load_robot(str(path), snap_angles=False), tmp_path, joint_rotors=True)
    excite.export_model(result, "drake", tmp_path / "new.urdf", robot_file=path)
    root = ET.parse(tmp_path / "new.urdf").getroot()
    armature = model_of_result(result)
    found = {}
    for element in root.findall("transmission"):
        tags = (f"actuator/{{https://drake.mit.edu}}{tag}" for tag in ("rotor_inertia", "gear_ratio"))
        inertia, ratio = (float(element.find(tag).get("value")) for tag in tags)
        found[element.find("joint").get("name")] = ratio**2 * inertia
    assert found == {"base_arm": armature.armature(0), "arm_fore": armature.armature(1)}
    assert root.find("transmission/actuator/mechanicalReduction").text == "1"


def test_held_joints_rest_where_they_were_held(tmp_path: Path) -> None:
    """Joint 2 cannot be at zero: it was held at its nearest limit."""
    text = OWN.replace('lower="-2" upper="2"', 'lower="0.5" upper="2"').replace("<link name='fore'></link>", FORE)
    path = text_file(tmp_path / "own.urdf", text)
    result = result_of(excite.load_robot(str(path), snap_angles=False), tmp_path, joints=("1",))
    target = instantaneous_target(result.robot, result.task, result.recipe)
    samples = states_of(target, 50)
    rigid, friction = predicted(result, samples)
    for own in (path, None):
        excite.export_model(result, "urdf", tmp_path / "new.urdf", robot_file=own, replace=True)
        found = by_pinocchio(tmp_path / "new.urdf", ("base_arm",), samples, {"arm_fore": 0.5})
        assert relative(found.rigid, rigid) < 1e-12
        assert relative(found.friction, friction) < 1e-12


ARM = Path(__file__).resolve().parents[3] / "arms" / "arm.xml"
JOINT = re.compile(rb' (?:armature|damping|frictionloss)="[^"]*"')
INERTIAL = re.compile(rb"\s*<inertial[^>]*/>|<!--\r?\n  identified parameters.*?-->\r?\n", re.DOTALL)
TOOL = '<body name="tool" pos="0.05 0 0" euler="0 30 0"><geom type="box" size=".02 .03 .04" mass="{}"/></body>\n'
CHANGES = {
    "as it is": lambda text: text,
    "with an anchor": lambda text: text.replace('name="bend"', 'name="bend" pos="0.02 0.01 -0.03"'),
    "with a tool": lambda text: text.replace("          </body>", TOOL.format("0.1") + "          </body>", 1),
    "without inertia": lambda text: text.replace(
        '<inertial pos="0.04 0.01 0.02" mass="0.7" diaginertia="0.001 0.0012 0.0011"/>',
        '<geom type="sphere" size="0.05" mass="0.7"/>',
    ),
    "with a rotated inertia": lambda text: text.replace(
        'diaginertia="0.02 0.02 0.015"', 'diaginertia="0.02 0.02 0.015" euler="10 20 30"'
    ),
    "with lines of Windows": lambda text: text.replace("\n", "\r\n"),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
def test_the_copy_has_the_torques_of_the_result_and_all_else_of_the_file(change: str, tmp_path: Path) -> None:
    path, new = tmp_path / "arm.xml", tmp_path / "new.xml"
    path.write_bytes(CHANGES[change](ARM.read_text()).encode())
    result = result_of(excite.load_robot(str(path)), tmp_path)
    excite.export_model(result, "mjcf", new, robot_file=path)
    target = instantaneous_target(result.robot, result.task, result.recipe)
    samples = states_of(target, 300)
    rigid, friction = predicted(result, samples)
    found = by_mujoco(new, result.robot.joint_names, samples, friction=True)
    assert relative(by_mujoco(new, result.robot.joint_names, samples).rigid, rigid) < 1e-9
    assert found.outside.any()
    assert relative(found.friction[found.outside], friction[found.outside]) < 1e-6
    strip = [INERTIAL.sub(b"", JOINT.sub(b"", file.read_bytes())) for file in (path, new)]
    assert strip[0] == strip[1]


REFUSED_MJCF = (
    (lambda text: text.replace('name="bend"', 'name="elbow"'), "it has no joint bend"),
    (lambda text: text.replace('pos="0.3 0 0"', 'pos="0.4 0 0"'), "joint 'bend' sits elsewhere"),
    (lambda text: text.replace("<default>", '<compiler inertiafromgeom="true"/><default>', 1), "inertiafromgeom"),
    (lambda text: "<robot/>", "is no MJCF"),
)


def test_what_cannot_be_copied_is_refused(tmp_path: Path) -> None:
    result, path = result_of(excite.load_robot(str(ARM)), tmp_path), tmp_path / "other.xml"
    for change, says in REFUSED_MJCF:
        text = change(ARM.read_text())
        if "inertiafromgeom" in text:
            text = re.sub(r"(<inertial)", r'<geom type="sphere" size="0.05"/>\1', text)
        path.write_text(text)
        with pytest.raises(excite.InputError, match=re.escape(says)):
            excite.export_model(result, "mjcf", tmp_path / "new.xml", robot_file=path)
        assert not (tmp_path / "new.xml").exists()


def test_bodies_in_other_files_are_named(tmp_path: Path) -> None:
    text = ARM.read_text()
    begin, end = text.index("<worldbody>"), text.index("</worldbody>") + len("</worldbody>")
    (tmp_path / "bodies.xml").write_text(f"<mujocoinclude>{text[begin:end]}</mujocoinclude>")
    path = text_file(tmp_path / "arm.xml", text[:begin] + '<include file="bodies.xml"/>' + text[end:])
    result = result_of(excite.load_robot(str(path)), tmp_path)
    with pytest.raises(excite.InputError, match="not in the file itself"):
        excite.export_model(result, "mjcf", tmp_path / "new.xml", robot_file=path)


def test_mujoco_is_named_where_it_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = result_of(excite.load_robot(str(ARM)), tmp_path)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(excite.InputError, match=r"excite-trajectories\[mujoco\]"):
        excite.export_model(result, "mjcf", tmp_path / "new.xml", robot_file=ARM)
    excite.export_model(result, "mjcf", tmp_path / "new.xml")  # a new one needs no MuJoCo


TEXT = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Cn")), max_size=12)
SPACE = st.text(" \t\n", min_size=1, max_size=3)


@given(st.lists(TEXT, min_size=2, max_size=2), TEXT, st.lists(SPACE, min_size=4, max_size=4), st.booleans())
@settings(deadline=None, max_examples=100)
def test_an_attribute_is_set_and_nothing_else(old: list[str], new: str, space: list[str], bom: bool) -> None:
    before = f"<?xml version='1.0'?><!--{'x'}--><a>{space[0]}<b{space[1]}p={quoteattr(old[0])}{space[2]}q{space[3]}="
    after = f"{quoteattr(old[1])}/>é</a>"
    content = (("\ufeff" if bom else "") + before + after).encode()
    document = XmlDocument(content, "text")
    (element,) = document.root.below("b")
    document.set(element, {"q": new})
    edited = document.edited()
    assert edited.startswith(("\ufeff" if bom else "").encode() + before.encode())
    assert edited.endswith("/>é</a>".encode())
    read = ET.fromstring(edited).find("b")
    assert read.get("q") == ET.fromstring(f"<b q={quoteattr(new)}/>").get("q")
    assert read.get("p") == ET.fromstring(f"<b q={quoteattr(old[0])}/>").get("q")


CASES = (
    ("<a/>", "<a>\n  <n/>\n</a>"),
    ("<a></a>", "<a>\n  <n/>\n</a>"),
    ("<a>\n</a>", "<a>\n  <n/>\n</a>"),
    ("<a>\n\t<b/>\n</a>", "<a>\n\t<b/>\n\t<n/>\n</a>"),
    ("<a><b/></a>", "<a><b/>\n<n/></a>"),
    ("<a>\r\n <b></b><!-- c -->\r\n</a>", "<a>\r\n <b></b>\r\n <n/><!-- c -->\r\n</a>"),
)


def test_an_element_is_inserted_as_its_siblings_are() -> None:
    for before, after in CASES:
        document = XmlDocument(before.encode(), "text")
        document.insert_in(document.root, "<n/>")
        assert document.edited().decode() == after
        assert ET.fromstring(after).find("n") is not None


def test_several_edits_do_not_disturb_each_other() -> None:
    document = XmlDocument(b"<a x='1'><b y='2'/><b/></a>", "text")
    first, second = document.root.below("b")
    document.set(document.root, {"x": "10", "w": "3"})
    document.set(first, {"y": "2"})  # as it is
    document.insert_in(second, "<c/>")
    document.insert_before(document.root, "<!-- n -->")
    document.replace_tag(first, "<d/>")
    assert document.edited() == b"<!-- n -->\n<a x='10' w=\"3\"><d/><b>\n  <c/>\n</b></a>"


@given(st.lists(TEXT))
def test_comments_hold_any_line(lines: list[str]) -> None:
    ET.fromstring(f"{comment([*lines, '--', '---->', '-'])}<a/>")
