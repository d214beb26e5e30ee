"""``excite robots`` and ``excite logs``: what they show of robots and recordings, as text and as JSON."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from commands import Here
from foreign_logs import motion, write_plotjuggler, write_rtde, write_table
from public_arms import ARMS
from value_fuzzer import ROBOT

import excite
from regressors.readers.library import built_in, built_in_names
from regressors.robot.archive import robot_from_description

# ``excite robots``: the list, one robot's joints, limits and base parameters, and the same as JSON.


def shown(here: Here, *arguments: str) -> str:
    ended = here.run("robots", *arguments, status=0, stderr="")
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
    robots = {name: built_in(name) for name in built_in_names()}
    assert table == [[name, str(robot.n), robot.source] for name, robot in robots.items()]
    listed = json.loads(shown(here, "--json"))
    stated = [[one["name"], one["joints"], one["source"]] for one in listed]
    assert stated == [[name, list(robot.joint_names), robot.source] for name, robot in robots.items()]


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
    health = [row for row in rows(shown(here, "hand.urdf")) if len(row) == 4 and row[0] != "j"]
    kinds = ["found", "assumed", "found", "snapped", "missing", "missing", "missing", "suspicious"]
    places = ["link 'a' to 'b'", "joint gripper", "link 'b'", "joint 'j'", "joint 'j'", "joint j", "joint j", "link b"]
    assert ([row[0] for row in health], [row[1] for row in health]) == (kinds, places)
    assert ["took 1.5708 for pi/2", "--no-snap-angles keeps the printed digits"] in [row[2:] for row in health]
    listed = json.loads(shown(here, "hand.urdf", "--json"))["health"]
    assert [entry["kind"] for entry in listed] == [row[0] for row in health]
    assert list(listed[1]) == ["kind", "where", "what", "advice"]
    assert list(listed[1].values()) == health[1]
    assert health[1][2:] == ["moves a gripper: held at zero and left out", "--tip c includes it"]
    exact = json.loads(shown(here, "hand.urdf", "--json", "--no-snap-angles"))
    assert "snapped" not in [entry["kind"] for entry in exact["health"]]
    assert exact["description"]["joints"][0]["rotation"][1][1] == pytest.approx(-3.67e-6, abs=1e-8)
    assert json.loads(shown(here, "irp6", "--json"))["health"] == []


def test_capsules_without_the_meshes_that_are_missing(here: Here) -> None:
    (here.cwd / "hand.urdf").write_text(HAND)
    ended = here.run("robots", "hand.urdf", "--capsules", status=0)
    left_out = r"excite: note: left out: hand.urdf: link 'b', <collision>: cannot read mesh .*b.stl: No such.*\n"
    assert re.fullmatch(left_out, ended.stderr)
    zeros = "[0.000000, 0.000000, 0.000000]"
    assert ended.stdout.splitlines()[2:] == [f'  - {{link: "b", from: {zeros}, to: {zeros}, radius: 0.100001}}']
    (here.cwd / "hand.urdf").write_text(HAND.replace('<sphere radius="0.1"/>', '<mesh filename="a.stl"/>'))
    ended = here.run("robots", "hand.urdf", "--capsules")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "(1 more like it), and no other shape is left; put the meshes there" in ended.stderr


# ``excite logs``: what it shows, the mapping that it writes, and that other commands take it as it stands.


def test_currents_are_asked_for_and_the_mapping_reads_the_log(here: Here) -> None:
    moved = motion(6)
    write_rtde(here.cwd / "run", moved, torque="target_moment")
    ended = here.run("logs", "run", "--robot", "ur10e", "--write-mapping", "map.yaml", status=0)
    assert "Universal Robots RTDE recording" in ended.stdout
    assert "600 rows at 100 Hz over 5.99 s by timestamp, no gaps" in ended.stdout
    assert "Positions [rad] are actual_q_0 ... actual_q_5, of 6 joints" in ended.stdout
    text = (here.cwd / "map.yaml").read_text(encoding="utf-8")
    assert "# QUESTION: What is the gain of each motor current" in text
    mapping, robot = excite.read_mapping(here.cwd / "map.yaml"), excite.load_robot("ur10e")
    log = excite.read_log(here.cwd / "run", mapping=mapping, robot=robot)
    np.testing.assert_array_equal(log.effort, moved.tau / 10.0)  # the gain 1 stands for what was asked


@pytest.mark.slow
def test_identify_and_verify_take_the_mapping_as_it_stands(here: Here) -> None:
    """Of a log in degrees, milliseconds and tabs; the questions that remain are answered rightly by the guess."""
    (here.cwd / "two.yaml").write_text(ROBOT, encoding="utf-8")
    moved = motion(2, rate=200.0, seconds=10.0)
    rows = np.column_stack([1e3 * moved.time, np.rad2deg(moved.q), np.rad2deg(moved.dq), moved.tau]).tolist()
    names = [f"{name}{k}" for name in ("pos", "vel", "torque") for k in (1, 2)]
    write_table(here.cwd / "run.txt", ["t", *names], rows, "\t")
    assert here.run("logs", "run.txt", "--robot", "two.yaml", "--write-mapping", "map.yaml").returncode == 0
    arguments = ("run.txt", "--mapping", "map.yaml")
    ended = here.run("identify", "two.yaml", *arguments, "--choose", "none", "--out", "r")
    assert ended.returncode in (0, 1), ended.stderr
    assert here.run("verify", "r", *arguments, "--training-too", "--out", "v").returncode in (0, 1)
    mapping, robot = excite.read_mapping(here.cwd / "map.yaml"), excite.load_robot(str(here.cwd / "two.yaml"))
    log = excite.read_log(here.cwd / "run.txt", mapping=mapping, joints=None, robot=robot)
    np.testing.assert_allclose(log.q, moved.q, atol=1e-12)


def test_json_holds_the_mapping(here: Here) -> None:
    write_plotjuggler(here.cwd / "p", motion(), ("a", "b", "c"))
    content = json.loads(here.run("logs", "p", "--json").stdout)
    assert content["questions"] == []
    assert [round(one["rate"]) for one in content["streams"]] == [100, 25]
    assert content["mapping"]["position"]["unit"] == ["rad"]
    assert content["mapping"]["joints"] == ["a", "b", "c"]


def test_logs_of_the_house_need_no_mapping(here: Here) -> None:
    (here.cwd / "run.csv").write_text("time,a.position,a.effort\n0,0,0\n0.1,1,2\n0.2,0,1\n0.3,1,1\n", encoding="utf-8")
    shown = here.run("logs", "run.csv").stdout
    assert "as the house format defines" in shown
    assert "no question is left" in shown


REFUSED = {
    "logs absent": "cannot read log absent: No such file or directory",
    "logs empty": "empty is an empty file of no known format",
    "logs words": "words holds no table of numbers",
    "logs run --write-mapping words": "words already there; --force replaces it",
    "logs plain --write-mapping map": "no mapping can be written; Which columns",
}


def test_what_cannot_be_done_ends_in_one_line(here: Here) -> None:
    write_rtde(here.cwd / "run", motion(6))
    (here.cwd / "empty").touch()
    (here.cwd / "words").write_text("no numbers here\nnone at all\n", encoding="utf-8")
    (here.cwd / "plain").write_text("".join(f"{k},{k % 5}\n" for k in range(200)), encoding="utf-8")
    for arguments, said in REFUSED.items():
        assert said in here.refused(*arguments.split())
