"""``excite robots``: the list, one robot's joints, limits and base parameters, and the same as JSON."""

import json
import re
from pathlib import Path

import pytest
from commands import Here, run
from public_arms import ARMS

from regressors.readers.library import built_in, built_in_names
from regressors.robot.archive import robot_from_description


def shown(here: Here, *arguments: str) -> str:
    ended = here.run("robots", *arguments)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert list(here.cwd.glob("*.json")) == []
    return ended.stdout


def rows(text: str) -> list[list[str]]:
    """Cells of all tables; lines that continue a cell are joined to it."""
    found: list[list[str]] = []
    for line in text.splitlines():
        if line.startswith("│"):
            cells = [cell.strip() for cell in line.strip("│").split("│")]
            if cells[0] or not found:
                found.append(cells)
            else:
                found[-1] = [f"{old} {more}".strip() for old, more in zip(found[-1], cells, strict=True)]
    return found


def test_list_names_every_robot_with_its_joints_and_source(here: Here) -> None:
    table = rows(shown(here))
    assert table == [[name, str(built_in(name).n), built_in(name).source] for name in built_in_names()]
    listed = json.loads(shown(here, "--json"))
    assert [(one["name"], one["joints"], one["source"]) for one in listed] == [
        (name, list(built_in(name).joint_names), built_in(name).source) for name in built_in_names()
    ]


def test_irp6(here: Here) -> None:
    text = shown(here, "irp6")
    assert text.startswith("irp6: 5 joint(s); IRp-6 after [KD96], with geometry and limits of WUT's MRROC++")
    assert built_in("irp6").sha256()[:16] in text
    table = rows(text)
    assert ["3", "q3", "revolute", "forearm", "10.7"] in table
    assert ["joint q2", "[-0.6981, 0.6981] rad", "-", "-", "-"] in table
    assert ["drive z3", "[-0.6981, 0.4363] rad", "1.137 rad/s", "1.89 rad/s^2", "-"] in table
    assert "base parameters of q1, q2, q3: 13 of 13 columns" in text
    stands_for = {row[0]: row[1:] for row in table if len(row) == 3}
    assert list(stands_for) == [*(f"X{k}" for k in range(1, 8)), "F1c", "F2c", "F3c", "F1v", "F2v", "F3v"]
    assert stands_for["X7"] == ["m2c2x + l2 m3", "kg m"]
    assert stands_for["F2v"] == ["F2v", "Nm s/rad"]


def test_options_choose_the_parameters(here: Here) -> None:
    text = shown(here, "irp6", "--joints", "1,3", "--no-friction")
    assert "base parameters of q1, q3: " in text
    assert "F1c" not in text
    wide = shown(here, "irp6", "--joints", "1,2,3,4,5")
    assert "base parameters of q1, q2, q3, q4, q5: " in wide
    assert "F5v" in wide
    assert "Ia" not in shown(here, "irp6", "--joints", "1,2,3,4,5", "--no-rotor", "--no-friction")


def test_panda(here: Here) -> None:
    text = shown(here, "panda", "--no-friction")
    assert re.search(r"base parameters of panda_joint1, .*, panda_joint7: 43 of 70 columns \(singular value gap ", text)
    table = rows(text)
    joint = ["joint panda_joint1", "[-2.897, 2.897] rad", "2.175 rad/s", "15 rad/s^2", "7500 rad/s^3"]
    assert joint in table
    assert ["I1zz", "I1zz + I2yy", "kg m^2"] in table


def test_json_is_the_robot_itself(here: Here) -> None:
    found = json.loads(shown(here, "irp6", "--json"))
    assert (found["name"], found["moving_joints"]) == ("irp6", ["q1", "q2", "q3"])
    assert robot_from_description(found["description"]).sha256() == found["sha256"] == built_in("irp6").sha256()
    base = found["base"]
    assert (base["rank"], base["gap"]) == (13, None)
    assert len(base["columns"]) == len(base["expressions"]) == len(base["units"]) == 13
    panda = json.loads(shown(here, "panda", "--json"))
    assert panda["base"]["gap"] > 1e6


def test_urdf_and_yaml_files(here: Here) -> None:
    (arm,) = (arm for arm in ARMS if arm.id == "double-pendulum")
    (here.cwd / "arm.urdf").write_bytes(arm.path.read_bytes())
    text = shown(here, "arm.urdf")
    assert text.startswith("2dof_planar: 2 joint(s); URDF arm.urdf")
    assert "no limits are known" in text
    assert ["1", "joint1", "revolute", "link1", "0.267"] in rows(text)
    chosen = json.loads(shown(here, "arm.urdf", "--base", "base_link", "--tip", "link1", "--json"))
    assert chosen["moving_joints"] == ["joint1"]
    (here.cwd / "one.yaml").write_text("name: one [1]\njoints: [{name: 'a[b]', mdh: {alpha: 90 deg}}]\n")
    text = shown(here, "one.yaml")
    assert text.startswith("one [1]: 1 joint(s); one.yaml")
    assert ["1", "a[b]", "revolute", "link1", "unknown"] in rows(text)
    assert ["m1c1x", "m1c1x", "kg m"] in rows(text)


HAND = """<robot name="r">
  <link name="a"/>
  <link name="b">
    <inertial><mass value="-1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><x:note/><geometry><x:note/><sphere radius="0.1"/></geometry></collision>
    <collision><geometry><mesh filename="package://gone/b.stl"/></geometry></collision>
    <x:note/>
  </link>
  <link name="c"/>
  <joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin rpy="1.5708 0 0"/></joint>
  <joint name="gripper" type="revolute"><parent link="b"/><child link="c"/></joint>
</robot>"""


def test_health_of_a_urdf(here: Here) -> None:
    (here.cwd / "hand.urdf").write_text(HAND)
    health = [row for row in rows(shown(here, "hand.urdf")) if len(row) == 4]
    assert [(row[0], row[1]) for row in health] == [
        ("found", "link 'a' to 'b'"),
        ("assumed", "joint gripper"),
        ("found", "link 'b'"),
        ("snapped", "joint 'j'"),
        ("missing", "joint 'j'"),
        ("missing", "joint j"),
        ("missing", "joint j"),
        ("suspicious", "link b"),
    ]
    assert health[1][2:] == ["moves a gripper: held at zero and left out", "--tip c includes it"]
    assert ["took 1.5708 for pi/2", "--no-snap-angles keeps the printed digits"] in [row[2:] for row in health]
    listed = json.loads(shown(here, "hand.urdf", "--json"))["health"]
    assert [entry["kind"] for entry in listed] == [row[0] for row in health]
    assert listed[1] == {
        "kind": "assumed",
        "where": "joint gripper",
        "what": "moves a gripper: held at zero and left out",
        "advice": "--tip c includes it",
    }
    exact = json.loads(shown(here, "hand.urdf", "--json", "--no-snap-angles"))
    assert "snapped" not in [entry["kind"] for entry in exact["health"]]
    assert exact["description"]["joints"][0]["rotation"][1][1] == pytest.approx(-3.67e-6, abs=1e-8)
    assert json.loads(shown(here, "irp6", "--json"))["health"] == []


def test_capsules_without_the_meshes_that_are_missing(here: Here) -> None:
    (here.cwd / "hand.urdf").write_text(HAND)
    ended = here.run("robots", "hand.urdf", "--capsules")
    assert ended.returncode == 0
    assert re.fullmatch(
        r"excite: note: left out: hand.urdf: link 'b', <collision>: cannot read mesh .*b.stl: No such.*\n", ended.stderr
    )
    assert ended.stdout.splitlines()[2:] == [
        '  - {link: "b", from: [0.000000, 0.000000, 0.000000], to: [0.000000, 0.000000, 0.000000], radius: 0.100001}'
    ]
    (here.cwd / "hand.urdf").write_text(HAND.replace('<sphere radius="0.1"/>', '<mesh filename="a.stl"/>'))
    ended = here.run("robots", "hand.urdf", "--capsules")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "(1 more like it), and no other shape is left; put the meshes there" in ended.stderr


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_any_terminal_shows_the_tables(encoding: str, tmp_path: Path) -> None:
    ended = run("robots", "irp6", cwd=tmp_path, PYTHONIOENCODING=encoding)
    assert (ended.returncode, ended.stderr, list(tmp_path.iterdir())) == (0, "", [])
    assert "m2c2x + l2 m3" in ended.stdout
