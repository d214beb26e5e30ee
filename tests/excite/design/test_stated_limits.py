"""Limits that a description states hold by default; what is not checked, and what is suspicious, is said."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from public_arms import robot_file
from written_files import saved

import excite
from constraints.certificate import LimitUse
from constraints.clearance import assumed_radius, skeleton
from constraints.diagnosis import ContradictionError
from excite.design.design_json import load_design
from excite.design.formulation import formulate
from excite.design.stated_limits import Unchecked, checked_text, kept_headline, kept_text, stated_world
from excite.design.task_checks import suspecting, unidentifiable
from excite.design.task_file import task_content, task_from_options
from excite.errors import NoFeasibleMotionError
from excite.export.models.robot_yaml import robot_text
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.stored_files import StoredRobot
from excite.views.comparison_view import verdicts as compared
from excite.views.design_view import design_view
from excite.views.motion_plot import motion_figure
from excite.views.page_text import page_text
from excite.views.player_log import Appearance
from excite.views.sections import section_of
from regressors.errors import Finding, InputError
from regressors.readers.description import parse_description
from regressors.readers.library import built_in, built_in_names
from regressors.robot.archive import robot_from_description
from regressors.robot.robot import Joint, Limits, Robot

SHORT = {"harmonics": 3, "period": 5.0, "rate": 50.0, "starts": 2, "executor": "serial"}
UR = {"velocity": (1.5,), "acceleration": (8.0,), "joints": ("1", "2", "3"), "floor": "none", **SHORT}


LINK = """<link name="{}"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><mesh filename="{}"/></geometry></collision></link>
<joint name="j{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" velocity="1" effort="50"/></joint>
"""
LINKS = "".join(LINK.format(c, "MESH", c, p, c) for p, c in ("ob", "bc", "cd"))


def weak(torque: float) -> Robot:
    """A UR10e whose shoulder has little torque."""
    robot = built_in("ur10e")
    torques = robot.limits.torque.copy()
    torques[1] = torque
    return robot.replace(limits=dataclasses.replace(robot.limits, torque=torques))


def unchecked(design: excite.Design) -> dict[str, str]:
    return {each.limit: each.reason for each in design.unchecked}


def shoulder(design: excite.Design) -> float:
    """Largest torque of the second joint over the motion, by simulation of the described bodies."""
    return float(np.abs(excite.simulate(design, rate=200.0).log.effort[:, 1]).max())


@pytest.mark.slow
def test_a_motion_that_breaks_them_is_solved_again_with_them() -> None:
    free = excite.design_trajectory(excite.Task(weak(95.0), torque_margin="none", **UR))
    kept = excite.design_trajectory(excite.Task(weak(95.0), **UR))
    assert shoulder(free) == 95.0  # the drive has no more
    assert shoulder(kept) <= 0.9 * 95.0 + 1e-6
    assert unchecked(free)["torque"] == "left out on request"
    assert "torque" not in unchecked(kept)
    assert any("stay 10 % below their limits" in note for note in kept.notes)
    assert kept.feasible
    assert kept.condition_number < 1.5 * free.condition_number  # it may be less: both are local minima


def test_what_cannot_be_checked_is_said() -> None:
    robot = built_in("ur10e")
    unlimited = dataclasses.replace(robot.limits, torque=np.full(6, np.inf))
    alike = tuple(dataclasses.replace(link, theta=robot.links[0].theta) for link in robot.links)
    for given, reason in (
        (built_in("iiwa7"), "no mass is stated"),
        (robot.replace(limits=unlimited), "no limit is stated"),
        (robot.replace(links=alike), "mass and inertia equal those of other links"),
    ):
        bare = given.replace(shapes=())
        made = formulate(bare, excite.Task(bare, **{**UR, "joints": ("1", "2")}))
        reasons = {each.limit: each.reason for each in made.unchecked}
        assert reason in reasons["torque"]
        assert reasons["obstacles"] == "no world file is given"
        assert made.stated == ()
        text = "limits kept; collisions NOT checked (floor, self-collision); not checked:"
        assert kept_text(made.unchecked).startswith(text)
        with pytest.raises(InputError):
            formulate(bare.replace(limits=Limits.none(bare.n)), excite.Task(bare, torque_margin=0.1, **UR))


def test_shapes_that_are_missing_are_named() -> None:
    robot = weak(95.0).replace(shapes=())
    for given, reason in (
        (robot, "the robot is given as an object; give its URDF in its place"),
        (StoredRobot("arm.urdf", robot), "the robot is that of a stored design"),
    ):
        reasons = {each.limit: each.reason for each in stated_world(robot, excite.Task(given)).unchecked}
        assert reasons["self-collision"].startswith(f"the description has no shapes, and {reason}")


@pytest.mark.parametrize("name", built_in_names())
def test_built_in_robots_have_shapes(name: str) -> None:
    robot = built_in(name)
    stated = stated_world(robot, excite.Task(name))
    assert stated.world.parts == robot.shapes
    assert "self-collision" not in [each.limit for each in stated.unchecked]
    assert robot.replace(shapes=()).sha256() == robot.sha256()
    again = robot_from_description(json.loads(json.dumps(robot.description())))
    assert again.shapes == robot.shapes == parse_description(robot_text(robot), name).shapes


def test_limits_that_a_motion_keeps_leave_it_as_it_is() -> None:
    options = {"starts": 2, "harmonics": 3, "executor": "serial"}
    ways = ({"self_collision": False, "floor": "none", "torque_margin": "none"}, {})
    free, kept = (excite.design_trajectory(excite.Task("irp6", **way, **options)) for way in ways)
    np.testing.assert_array_equal(free.trajectory.x, kept.trajectory.x)
    assert "self-collision" not in unchecked(kept)
    assert {"distance", "torque"} <= {use.quantity for use in kept.limits}
    assert not {"distance", "torque"} & {use.quantity for use in free.limits}


def test_what_is_said_of_limits_that_were_kept_and_not_checked() -> None:
    quantities = ["wrench", "distance", "torque", "position", "distance", "tool", "jerk", "position"]
    assert checked_text(quantities) == "position (2), jerk (1), torque (1), tool (1), distance (2), wrench (1)"
    assert checked_text(()) == ""
    assert kept_text(()) == "every limit is kept"
    assert kept_text((), ("torque",)) == "every limit is kept; checked: torque (1)"
    jerk = Unchecked("jerk", "no limit is stated")
    text = "every limit that was checked is kept; not checked: jerk (no limit is stated)"
    assert kept_text((jerk, Unchecked("obstacles", "why"))) == f"{text}, obstacles (why)"
    assert kept_text((jerk,), ("tool",)) == f"{text}; checked: tool (1)"
    for left_out, named in (
        ((), None),
        (("obstacles", "jerk"), None),
        (("self-collision", "obstacles"), "self-collision"),
        (("self-collision", "floor"), "self-collision, floor"),
        (("ceiling",), "ceiling"),
    ):
        text = f"limits kept; collisions NOT checked ({named})" if named else "plain"
        assert kept_headline(left_out, "plain") == text
        if named:
            assert kept_text([Unchecked(each, "why") for each in left_out]).startswith(f"{text}; not checked: ")


def test_torques_that_no_pose_allows_are_named_with_what_is_missing() -> None:
    heavy = excite.Installation(payload=(900.0, 0.0, 0.0, 0.3)).applied(built_in("ur10e"))
    task = excite.Task(heavy, position=((-0.5, 0.5),) * 6, **UR)
    message = r"shoulder_lift_joint torque beyond .* by .* Nm.*`torque_margin='none'`"
    with pytest.raises(ContradictionError, match=message):
        formulate(heavy, task)


def test_the_choice_round_trips_through_a_task_file_and_older_files_leave_them_out() -> None:
    for margin in ("auto", "none", None, 0.2):
        task = excite.Task("ur10e", torque_margin=margin)
        content = json.loads(json.dumps(task_content(task)))
        assert content["torque_margin"] == ("none" if margin is None else margin)
        assert task_from_options(content).limits == task.limits
    for margin in ("often", True, -0.1, 1.0):
        with pytest.raises(InputError, match="margin"):
            formulate(built_in("ur10e"), excite.Task("ur10e", torque_margin=margin, **UR))
    content = {**task_content(excite.Task("ur10e")), "torque_margin": None}
    assert task_from_options(content, stored=True).limits.torque_margin is None
    del content["torque_margin"]
    assert task_from_options(content, stored=True).limits.torque_margin is None
    assert task_from_options({**content, "solver": "ipopt"}, stored=True).search.solver == "sqp"  # of an older file
    assert task_from_options(content).limits.torque_margin == "auto"


@pytest.mark.slow
def test_contact_of_a_urdf_with_itself_is_avoided_where_the_motion_has_it(tmp_path: Path) -> None:
    path = str(robot_file("z1_description/urdf/z1.urdf"))
    options = {"velocity": (2.0,), "acceleration": (8.0,), "joints": ("2", "3"), **SHORT}
    free = excite.design_trajectory(excite.Task(path, self_collision=False, **options))
    kept = excite.design_trajectory(excite.Task(path, **options))
    assert unchecked(free)["self-collision"] == "left out on request"
    assert "self-collision" not in unchecked(kept)
    distances = [use for use in kept.limits if use.unit == "m"]
    assert distances
    assert all(use.extreme >= 0.001 - 1e-9 for use in distances)
    assert load_design(saved(tmp_path, kept)).task.limits.self_collision
    assert [each.limit for each in load_design(tmp_path).unchecked] == [e.limit for e in kept.unchecked]


@pytest.mark.slow
def test_every_view_of_a_design_without_a_check_of_collisions_says_so(tmp_path: Path) -> None:
    options = {"joints": ("1", "2"), "starts": 1, "harmonics": 2, "executor": "serial"}
    safe = excite.design_trajectory(excite.Task("irp6", **options))
    bold = excite.design_trajectory(excite.Task("irp6", self_collision=False, **options))
    title = "limits kept; collisions NOT checked (self-collision)"
    for design, caution in ((safe, False), (bold, True)):
        summary = design_view(design)
        assert summary.caution is caution
        assert (title in summary.verdict.replace("Limits", "limits")) is caution
        assert ("within all" in summary.verdict) is not caution
        assert (title in " ".join(motion_figure(design).get_suptitle().split())) is caution
        design.save(tmp_path / design.robot.name / str(caution))
        section = section_of(excite.load_design(tmp_path / design.robot.name / str(caution)), "s", Appearance())
        assert section.view.caution is caution
        assert section.view.verdict.startswith("Limits kept; collisions NOT") is caution
        page = page_text([section])
        assert ("<strong>Caution</strong>" in page, "<strong>Holds</strong>" in page) == (caution, not caution)
    judged = excite.compare([safe, bold])
    assert [title in text for text in compared(judged)] == [False, True]


def test_meshes_that_cannot_be_read_are_capsules_and_the_others_stay(tmp_path: Path) -> None:
    text = f'<robot name="arm"><link name="o"/>\n{LINKS}</robot>\n'.replace("MESH", "there.obj")
    corners = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.05, 0.05) for z in (0.0, 0.5)])
    (tmp_path / "there.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 2 3 4\nf 5 6 7 8\n")
    whole, part = tmp_path / "whole.urdf", tmp_path / "part.urdf"
    whole.write_text(text)
    part.write_text(text.replace('"there.obj"', '"gone.dae"', 1))
    made = {}
    for path in (whole, part):
        task = excite.Task(str(path), velocity=(1.0,), acceleration=(3.0,))
        made[path.stem] = stated_world(installed_robot(task), task)
    worlds = {name: each.world for name, each in made.items()}
    kept = [each for each in worlds["part"].parts if each.link != "b"]
    assert kept == [each for each in worlds["whole"].parts if each.link != "b"]
    robot = installed_robot(excite.Task(str(part)))
    capsules = list(skeleton(robot, assumed_radius(robot), ["b"]))
    assert [each for each in worlds["part"].parts if each.link == "b"] == capsules
    assert "self-collision" not in [each.limit for each in made["part"].unchecked]
    assert made["whole"].notes == tuple(note for note in made["part"].notes if "assumed" not in note)
    assert any(re.match(r"shape of b assumed: a capsule of radius .*gone\.dae", note) for note in made["part"].notes)


def test_no_limit_is_to_be_widened_that_is_used_at_90_percent_or_less() -> None:
    def use(part: float) -> LimitUse:
        return LimitUse("joint j2 velocity", "rad/s", 2 * part, 1.0, 2.0, 2 - 2 * part, part)

    for part in (0.0, 0.5, 0.9):
        message = unidentifiable((use(part), use(part / 2)))
        assert "widen" not in message
        assert f"joint j2 velocity, is used at {100 * part:.0f} %" in message
        assert "`harmonics`" in message
    message = unidentifiable((use(0.3), use(0.99)))
    assert "that of joint j2 velocity, 99 % of 2 rad/s: widen it if the robot allows more" in message
    assert "limits are not the cause; give" in unidentifiable(())


FINDINGS = (
    Finding("snapped", "joint j1", "took 3.14 for pi"),
    Finding("suspicious", "joint j1", "close to a right angle"),
    Finding("suspicious", "joints j2, j3", "an effort limit of 1 Nm"),
)


@pytest.mark.parametrize("kind", [ContradictionError, NoFeasibleMotionError])
@pytest.mark.parametrize(
    ("message", "first"),
    [
        ("joint j3 torque", "joints j2, j3: an effort limit of 1 Nm (and 1 more, see the notes); joint j3 torque"),
        ("no motion", "joint j1: close to a right angle (and 1 more, see the notes); no motion"),
    ],
)
def test_what_is_suspicious_comes_first(kind: type[Exception], message: str, first: str) -> None:
    robot = built_in("ur10e").replace(notes=FINDINGS)
    with pytest.raises(kind) as caught, suspecting(robot):
        raise kind(message)
    assert str(caught.value) == f"look at the description first: {first}"


def test_an_angle_as_if_rounded_is_suspicious_and_other_errors_stay_as_they_are() -> None:
    robot = built_in("ur10e")
    rounded = Joint.from_mdh(robot.joints[1].name, "revolute", alpha=1.57, a=0.0)
    leaning = robot.replace(joints=(robot.joints[0], rounded, *robot.joints[2:]))
    with pytest.raises(NoFeasibleMotionError) as caught, suspecting(leaning):
        raise NoFeasibleMotionError("no motion")
    assert "0.0008 rad from a right angle to that of joint" in str(caught.value)
    assert str(caught.value).endswith("; state angles exactly; no motion")
    for error in (NoFeasibleMotionError("no motion"), InputError("bad")):
        with pytest.raises(type(error)) as caught, suspecting(robot):
            raise error
        assert caught.value is error


def test_masses_in_grams_are_named_first_by_a_design(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(
        '<robot name="r"><link name="a"/><link name="b"><inertial><origin xyz="0.5 0 0"/><mass value="2000"/>'
        '<inertia ixx="20" iyy="30" izz="20" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>'
        '<limit lower="-0.5" upper="0.5" velocity="2" effort="50"/></joint></robot>'
    )
    with pytest.raises(
        (ContradictionError, NoFeasibleMotionError), match=r"^look at the description first: joint.* grams"
    ):
        excite.design_trajectory(excite.Task(str(file), acceleration=5.0, starts=1, executor="serial"))
