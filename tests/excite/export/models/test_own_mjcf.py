"""A copy of the user's MJCF: only the parameters change."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from identified import predicted, relative, result_of
from reloaded import by_mujoco

import excite
from excite.export.models.nearest_bodies import states_of
from excite.identification.prediction import instantaneous_target

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


REFUSED = (
    (lambda text: text.replace('name="bend"', 'name="elbow"'), "it has no joint bend"),
    (lambda text: text.replace('pos="0.3 0 0"', 'pos="0.4 0 0"'), "joint 'bend' sits elsewhere"),
    (lambda text: text.replace("<default>", '<compiler inertiafromgeom="true"/><default>', 1), "inertiafromgeom"),
    (lambda text: "<robot/>", "is no MJCF"),
)


@pytest.mark.parametrize(("change", "says"), REFUSED)
def test_what_cannot_be_copied_is_refused(change, says: str, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    result = result_of(excite.load_robot(str(ARM)), tmp_path)
    path = tmp_path / "other.xml"
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
    path = tmp_path / "arm.xml"
    path.write_text(text[:begin] + '<include file="bodies.xml"/>' + text[end:])
    result = result_of(excite.load_robot(str(path)), tmp_path)
    with pytest.raises(excite.InputError, match="not in the file itself"):
        excite.export_model(result, "mjcf", tmp_path / "new.xml", robot_file=path)


def test_mujoco_is_named_where_it_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = result_of(excite.load_robot(str(ARM)), tmp_path)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(excite.InputError, match=r"excite-trajectories\[mujoco\]"):
        excite.export_model(result, "mjcf", tmp_path / "new.xml", robot_file=ARM)
    excite.export_model(result, "mjcf", tmp_path / "new.xml")  # a new one needs no MuJoCo
