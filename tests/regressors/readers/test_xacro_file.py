"""The reader of xacro: against the URDF that it stands for, where packages are found, and broken files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from regressors.errors import InputError
from regressors.readers.library import load_robot, read_xacro
from regressors.readers.urdf import parse_urdf

pytest.importorskip("xacro", reason="xacro is not installed (pip install xacro)")

NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
PART = f"""
<robot {NAMESPACE}>
  <xacro:macro name="part" params="k parent mass">
    <link name="l${{k}}">
      <inertial><mass value="${{mass}}"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    </link>
    <joint name="j${{k}}" type="revolute">
      <parent link="${{parent}}"/><child link="l${{k}}"/><origin xyz="0 0 0.3" rpy="${{pi / 2}} 0 0"/>
      <limit lower="-1" upper="1" effort="2" velocity="$(arg speed)"/>
    </joint>
  </xacro:macro>
</robot>
"""
ARM = f"""
<robot name="arm" {NAMESPACE}>
  <xacro:arg name="speed" default="3"/>
  <xacro:include filename="$(find some_arm)/urdf/part.xacro"/>
  <link name="base"/>
  <xacro:part k="1" parent="base" mass="2"/>
  <xacro:part k="2" parent="l1" mass="${{2 * 0.25}}"/>
</robot>
"""
EXPANDED = '<robot name="arm"><link name="base"/>' + "".join(
    f"""
    <link name="l{k}">
      <inertial><mass value="{mass}"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    </link>
    <joint name="j{k}" type="revolute">
      <parent link="{parent}"/><child link="l{k}"/><origin xyz="0 0 0.3" rpy="{np.pi / 2!r} 0 0"/>
      <limit lower="-1" upper="1" effort="2" velocity="3"/>
    </joint>"""
    for k, parent, mass in ((1, "base", 2), (2, "l1", 0.5))
) + "</robot>"  # fmt: skip


def package(root: Path, text: str = ARM, name: str = "arm.urdf.xacro") -> str:
    """A package some_arm with a file that describes an arm."""
    folder = root / "some_arm" / "urdf"
    folder.mkdir(parents=True)
    (folder / "part.xacro").write_text(PART, encoding="utf-8")
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


@pytest.mark.parametrize("name", ["arm.urdf.xacro", "arm.xacro", "arm.urdf", "arm.xml"])
def test_robot_is_that_of_the_expanded_text(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    robot = load_robot(package(tmp_path, name=name), tip="l2", xacro=not name.endswith(".xacro"))
    assert robot.sha256() == parse_urdf(EXPANDED).sha256()
    assert robot.source == f"URDF {name}"
    assert capfd.readouterr() == ("", "")


def test_arguments(tmp_path: Path) -> None:
    assert read_xacro(package(tmp_path), arguments={"speed": "4"}).limits.velocity.tolist() == [4, 4]


@pytest.mark.parametrize(
    ("how", "inside"),
    [
        *(("packages", inside) for inside in ("", "some_arm", "ros/some_arm")),
        *(("ROS_PACKAGE_PATH", inside) for inside in ("", "some_arm", "ros/some_arm")),
        ("AMENT_PREFIX_PATH", "prefix/share/some_arm"),
    ],
)
def test_packages_are_found(how: str, inside: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = tmp_path / "workspace" / inside
    package(place.parent if inside else place)
    (tmp_path / "arm.xacro").write_text(ARM, encoding="utf-8")
    root = {"": place, "some_arm": place, "ros/some_arm": place.parents[1]}.get(inside, tmp_path / "workspace/prefix")
    if how != "packages":
        monkeypatch.setenv(how, f"/nowhere:{root}")
    robot = read_xacro(tmp_path / "arm.xacro", packages=[root] if how == "packages" else [])
    assert robot.joint_names == ("j1", "j2")


BROKEN = {
    "missing package": (ARM.replace("some_arm", "other_arm"), "a.xacro: no folder of the package 'other_arm', neither"),
    "missing include": (ARM.replace("part.xacro", "parts.xacro"), "a.xacro: xacro does not expand it: No such file or"),
    "missing argument": (
        ARM.replace('<xacro:arg name="speed" default="3"/>', ""),
        "a.xacro: the argument speed has no value; expand the file with one, and give the URDF: "
        "xacro a.xacro speed:=VALUE > a.urdf",
    ),
    "unknown macro": (ARM.replace('<xacro:part k="1"', '<xacro:link k="1"'), "xacro does not expand it: unknown macro"),
    "missing parameter": (ARM.replace('mass="2"', ""), "xacro does not expand it: Undefined parameters [mass]"),
    "unknown name": (ARM.replace("2 * 0.25", "2 * m"), "xacro does not expand it: name 'm' is not defined"),
    "breaks off": (ARM.replace("</robot>", ""), "xacro does not expand it: no element found: line"),
    "no URDF": (ARM.replace('parent="l1"', 'parent="l7"'), "a.xacro, expanded, line "),
    "empty": ("", "a.xacro: xacro does not expand it: no element found"),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_files_are_refused_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as raised:
        load_robot(package(tmp_path, text, "a.xacro"))
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_missing_xacro_is_told_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "xacro.py").write_text("raise ImportError", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(InputError, match=r"not installed; pip install 'excite-trajectories\[xacro\]'"):
        load_robot(package(tmp_path))
