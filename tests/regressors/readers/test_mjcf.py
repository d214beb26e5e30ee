"""The reader of MJCF against the URDF of the same arms, Pinocchio and MuJoCo's inverse dynamics; broken files."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from public_arms import ARMS, Arm, reference, robot_file
from refused import refusal
from reloaded import chain_xml, inverse_dynamics
from written_files import text_file

from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.readers.library import load_robot
from regressors.readers.mjcf import read_mjcf
from regressors.readers.urdf import read_urdf
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot
from regressors.samples import Samples

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install mujoco)")
pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed (pip install pin)")

CHOSEN = ("panda-hand", "kinova", "tiago-torso-arm", "ur5-gripper", "g1-thumb")
SOME_ARMS = [arm for arm in ARMS if arm.id in CHOSEN]


def written(folder: Path, text: str, name: str = "arm.xml") -> str:
    return str(text_file(folder / name, text))


def motion(robot: Robot) -> Samples:
    """Random states that no joint passes slowly, where MuJoCo's dry friction would be softer than Coulomb's."""
    rng = np.random.default_rng(3)
    q, dq, ddq = rng.uniform(-1, 1, (3, 12, robot.n))
    return Samples(np.arange(12.0), q, dq + np.sign(dq), ddq, np.zeros_like(q))


def torques(robot: Robot, samples: Samples) -> np.ndarray:
    """The model's rows times what the description states, shape (N, n)."""
    model, known = DifferentialModel(robot), standard_values(robot)
    definition, names = model.definition()
    theta = definition @ [known.get(name, 0.0) for name in names]
    return (model.assemble(samples) @ theta).reshape(samples.q.shape)


def free_of_contacts(path: str) -> object:
    """MuJoCo's model without contacts and stops, and with dry friction as hard as MuJoCo has it."""
    model = mujoco.MjModel.from_xml_path(path)
    model.dof_solimp[:, :2] = 0.9999
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT)
    return model


def assert_equal(actual: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))


# --- public arms -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arm", SOME_ARMS, ids=str)
def test_regressor_and_torques_equal_those_of_the_urdf_of_pinocchio_and_of_mujoco(arm: Arm, tmp_path: Path) -> None:
    expected, path = reference(arm), written(tmp_path, chain_xml(reference(arm)))
    robot = load_robot(path, snap_angles=False)
    of_urdf = read_urdf(arm.path, base=arm.base, tip=arm.tip, snap_angles=False)
    samples, inertial = motion(robot), Terms.inertial_only()
    W = DifferentialModel(robot, inertial).assemble(samples)
    assert_equal(W, DifferentialModel(of_urdf, inertial).assemble(samples))
    tau = torques(robot, samples)
    assert_equal(tau, inverse_dynamics(free_of_contacts(path), robot.joint_names, samples.q, samples.dq, samples.ddq))
    data = expected.model.createData()
    q = [expected.configuration(dict(zip(robot.joint_names, q, strict=True))) for q in samples.q]
    rnea = [pin.rnea(expected.model, data, *state) for state in zip(q, samples.dq, samples.ddq, strict=True)]
    assert_equal(tau, np.array(rnea))


@pytest.mark.parametrize("file", ["ur_description/urdf/ur10_robot.urdf", "xarm_description/urdf/xarm7.urdf"])
def test_what_mujoco_makes_of_a_urdf_is_read_as_mujoco_moves_it(file: str, tmp_path: Path) -> None:
    path = robot_file(file)
    urdf = path.read_text(encoding="utf-8").replace("<visual", "<!--v").replace("</visual>", "v-->")
    urdf = urdf.replace("<collision", "<!--c").replace("</collision>", "c-->")  # meshes are not found from here
    saved = str(tmp_path / "saved.xml")
    mujoco.mj_saveLastXML(saved, mujoco.MjModel.from_xml_string(urdf))
    robot, of_urdf = load_robot(saved, snap_angles=False), read_urdf(path, snap_angles=False)
    samples = motion(robot)
    assert robot.joint_names == of_urdf.joint_names
    np.testing.assert_allclose(robot.limits.torque, of_urdf.limits.torque, rtol=1e-5)  # it saves six digits
    np.testing.assert_allclose(robot.limits.upper, of_urdf.limits.upper, rtol=1e-5)
    expected = inverse_dynamics(free_of_contacts(saved), robot.joint_names, samples.q, samples.dq, samples.ddq)
    assert_equal(torques(robot, samples), expected)


# --- what each part of a model becomes -------------------------------------------------------------------------------


def turned_arm(turn: str, axis: str = "0 0 1") -> str:
    body = (
        f'<body name="a" {turn}><joint name="j" axis="{axis}"/><geom type="box" size=".1 .2 .3" pos=".1 .2 .3"/></body>'
    )
    return f'<mujoco><compiler angle="radian" eulerseq="XYZ"/><worldbody>{body}</worldbody></mujoco>'


@pytest.mark.parametrize(
    ("turn", "taken"),
    [
        ('quat="0.707105 -0.707108 0 0"', "-1.570801 for -pi/2"),  # of -1.5708
        ('euler="0 0 0.785"', "0.785 for pi/4"),
        ('euler="3.14 1.57 1.57"', "axes that are 0.0011 rad off right angles"),
        ('quat="0.500003 0.499998 0.5 0.500001"', "axes that are 7.2e-06 rad off right angles"),
    ],
)
def test_turns_that_are_off_right_angles_by_rounding_are_right_angles(turn: str, taken: str, tmp_path: Path) -> None:
    path = written(tmp_path, turned_arm(turn))
    robot, raw = load_robot(path), load_robot(path, snap_angles=False)
    (note,) = [note for note in robot.notes if note.kind == "snapped"]
    assert note.where == "link 'a'"
    assert taken in note.what
    assert not [note for note in raw.notes if note.kind == "snapped"]
    rotation = robot.joints[0].rotation
    np.testing.assert_allclose(rotation, raw.joints[0].rotation, atol=3e-3)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    if "pi/4" not in taken:
        assert set(np.abs(rotation).ravel()) == {0.0, 1.0}


@pytest.mark.parametrize("turn", ['euler="1.5718 0 0"', 'euler="0.3 0.2 0.1"', ""])
def test_other_turns_stay_as_they_are(turn: str, tmp_path: Path) -> None:
    path = written(tmp_path, turned_arm(turn))
    robot, raw = load_robot(path), load_robot(path, snap_angles=False)
    np.testing.assert_allclose(robot.joints[0].rotation, raw.joints[0].rotation, rtol=0, atol=1e-15)
    assert not [note for note in robot.notes if note.kind == "snapped"]
    if "1.5718" in turn:
        assert any("close to a right angle" in note.what for note in robot.notes)


def test_noise_of_rounding_leaves_axes(tmp_path: Path) -> None:
    path = written(tmp_path, turned_arm("", "0 1 3.67e-06"))
    assert load_robot(path).joints[0].axis.tolist() == [0.0, 1.0, 0.0]
    assert load_robot(path, snap_angles=False).joints[0].axis[2] == pytest.approx(3.67e-6)


HAND_WRITTEN = """
<mujoco model="hand-written">
  <compiler angle="degree"/>
  <option gravity="0 1 -9.7"/>
  <default>
    <joint damping="0.5" armature="0.02" frictionloss="0.3"/>
    <default class="wrist">
      <joint damping="0.1" axis="0 1 0" range="-90 90" actuatorfrcrange="-8 9"/>
    </default>
    <motor gear="50" ctrlrange="-2 3"/>
  </default>
  <worldbody>
    <body name="stand" pos="0.1 0.2 0.3" euler="10 20 30">
      <geom type="box" size=".1 .1 .1"/>
      <body name="turret" pos="0 0 0.2" euler="0 0 15">
        <joint name="pan" axis="0 0.1 1" pos="0.01 0.02 0.03" ref="20" range="-170 170"/>
        <geom type="cylinder" size="0.05 0.1" mass="3" pos="0.02 0 0"/>
        <body name="boom" pos="0.05 0 0.1">
          <joint name="lift" axis="0 1 0" pos="0 0.03 -0.02"/>
          <joint name="reach" type="slide" axis="1 0 0.2" pos="1 2 3" range="-0.1 0.4" ref="0.05" damping="20"/>
          <inertial pos="0.2 0.01 0.02" mass="2" fullinertia="0.02 0.05 0.06 0.001 0.002 -0.003"/>
          <body name="plate" pos="0.1 0.1 0" quat="0.5 0.5 0.5 0.5">
            <geom type="sphere" size="0.04" mass="0.4"/>
            <body name="flap" pos="0 0 0.1">
              <joint name="flap" pos="0 0.05 0"/>
              <geom type="box" size=".1 .02 .03" mass="0.3"/>
            </body>
            <body name="tassel" pos="0 0.1 0.1">
              <joint name="swing" type="ball" pos="0 0 0.02" armature="0" damping="0"/>
              <geom type="box" size=".1 .02 .03" mass="0.2"/>
            </body>
          </body>
          <body name="hand" pos="0.4 0 0" euler="0 30 0" childclass="wrist">
            <joint name="tilt" pos="0 0 0.05" ref="-15"/>
            <geom type="capsule" fromto="0 0 0 0.1 0.05 0.2" size="0.03" mass="0.9"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="pan"/>
    <motor joint="lift" forcerange="-1.5 1" armature="0.0001" damping="0.00002"/>
    <position joint="tilt" kp="10" forcerange="-3 3"/>
    <motor joint="tilt" gear="-2" ctrllimited="false"/>
  </actuator>
</mujoco>
"""


@pytest.mark.parametrize("base", [None, "stand", "turret"])
def test_hand_written_model_moves_as_in_mujoco(base: str | None, tmp_path: Path) -> None:
    path = written(tmp_path, HAND_WRITTEN)
    robot = read_mjcf(path, base=base, tip="hand")
    assert robot.joint_names == ("pan", "lift", "reach", "tilt")[1 if base == "turret" else 0 :]
    samples = motion(robot)
    expected = inverse_dynamics(free_of_contacts(path), robot.joint_names, samples.q, samples.dq, samples.ddq)
    assert_equal(torques(robot, samples), expected)


def test_hand_written_model(tmp_path: Path) -> None:
    robot = read_mjcf(written(tmp_path, HAND_WRITTEN, "tower.xml"), tip="hand")
    assert (robot.name, robot.source) == ("hand-written", "MJCF tower.xml")
    assert [joint.kind for joint in robot.joints] == ["revolute", "revolute", "prismatic", "revolute"]
    assert [link.name for link in robot.links] == ["turret", "boom/lift", "boom", "hand"]
    np.testing.assert_allclose(robot.limits.upper, [np.deg2rad(170.0), np.inf, 0.4, np.pi / 2])
    np.testing.assert_allclose(robot.limits.lower, [-np.deg2rad(170.0), -np.inf, -0.1, -np.pi / 2])
    assert robot.limits.torque.tolist() == [100, 50, np.inf, 8]
    assert not np.any(np.isfinite([robot.limits.velocity, robot.limits.acceleration, robot.limits.jerk]))
    drives = [(drive.ratio.value, drive.rotor_inertia, drive.viscous, drive.coulomb)
              for drive in robot.transmission.drives]  # fmt: skip
    expected = [(1, 0.02, 0.5, 0.3), (1, 0.02 + 0.25, 0.5 + 0.05, 0.3), (1, 0.02, 20, 0.3), (1, 0.02, 0.1, 0.3)]
    np.testing.assert_allclose(drives, expected, rtol=1e-12)


def arm(inside: str = "", *, joint: str = 'name="j"', after: str = "", option: str = "") -> str:
    """One moving body a, what is inside it, and what follows the world."""
    body = f'<body name="a"><joint {joint}/><geom size="0.1" mass="1"/>{inside}</body>'
    return f"<mujoco>{option}<worldbody>{body}</worldbody>{after}</mujoco>"


def further(name: str, joint: str, inside: str = "") -> str:
    return f'<body name="{name}" pos="0 0 1"><joint {joint}/><geom size="0.1" mass="1"/>{inside}</body>'


FINGERS = further("left", 'name="l" type="slide"') + further("right", 'name="r" type="slide"')


def test_plain_joint(tmp_path: Path) -> None:
    robot = read_mjcf(written(tmp_path, arm(), "plain.xml"))
    assert (robot.name, robot.source, robot.transmission) == ("plain", "MJCF plain.xml", None)
    assert robot.gravity.tolist() == [0, 0, -9.81]
    weightless = arm(option='<option><flag gravity="disable"/></option>')
    assert read_mjcf(written(tmp_path, weightless)).gravity.tolist() == [0, 0, 0]
    springs = arm(further("b", 'name="k" damping="1"'), joint='name="j" stiffness="4"')
    assert read_mjcf(written(tmp_path, springs)).source == "MJCF arm.xml, without the springs of j"
    lying = arm().replace("</worldbody>", '<body name="box"><freejoint/><geom size="1"/></body></worldbody>')
    assert read_mjcf(written(tmp_path, lying)).joint_names == ("j",)
    limits = robot.limits
    assert not np.any(np.isfinite([limits.lower, limits.upper, limits.velocity, limits.torque]))


TORQUES = {
    "of the joint": (' actuatorfrcrange="-3 2"', "", 2),
    "force": ("", '<motor joint="j" gear="-10" forcerange="-4 5"/>', 40),
    "control with a gain": ("", '<general joint="j" gainprm="-3" ctrlrange="-4 5"/>', 12),
    "control of a position": ("", '<position joint="j" ctrlrange="-4 5"/>', np.inf),
    "two actuators": ("", '<motor joint="j" ctrlrange="-4 5"/><motor joint="j" forcerange="-1 1" gear="2"/>', 6),
    "one of two unlimited": ("", '<motor joint="j" ctrlrange="-4 5"/><motor joint="j"/>', np.inf),
    "the smaller one": (' actuatorfrcrange="-3 3"', '<motor joint="j" ctrlrange="-4 5"/>', 3),
    "one side": ("", '<motor joint="j" ctrlrange="0 5"/>', np.inf),
}


@pytest.mark.parametrize(("joint", "actuators", "limit"), TORQUES.values(), ids=TORQUES)
def test_torque_limit(joint: str, actuators: str, limit: float, tmp_path: Path) -> None:
    text = arm(joint=f'name="j"{joint}', after=f"<actuator>{actuators}</actuator>")
    assert read_mjcf(written(tmp_path, text)).limits.torque.tolist() == [limit]


def test_held_joint_is_fixed_where_it_is_held(tmp_path: Path) -> None:
    held = '<equality><joint joint1="k" polycoef="0.5"/></equality>'
    body = '<body name="b" pos="0 0 1" {}<geom pos="0.2 0 0" size="0.1" mass="1"/></body>'
    fixed = arm(body.format('euler="0 0 0.5">'), option='<compiler angle="radian"/>')
    turning = arm(
        body.format('><joint name="k" axis="0 0 1" ref="0.1"/>'), after=held, option='<compiler angle="radian"/>'
    )
    robots = [read_mjcf(written(tmp_path, text)) for text in (fixed, turning)]
    assert [robot.n for robot in robots] == [1, 1]
    np.testing.assert_allclose(robots[1].links[0].theta, robots[0].links[0].theta, atol=1e-14)


def test_follower_off_the_chain_rests_where_its_leader_puts_it(tmp_path: Path) -> None:
    inside = further("left", 'name="l" type="slide"') + further("right", 'name="r" type="slide" axis="1 0 0"')
    coupled = '<equality><joint joint1="r" joint2="l" polycoef="0.3 2 0 0 0"/></equality>'
    robot = read_mjcf(written(tmp_path, arm(inside, after=coupled)), tip="a")
    np.testing.assert_allclose(robot.links[0].theta[:4], [3, 0.3, 0, 2], atol=1e-14)


# --- broken files ----------------------------------------------------------------------------------------------------

LOOP = '<equality><connect body1="b" body2="world" anchor="0 0 0"/></equality>'
TENDON = (
    '<tendon><fixed name="t"><joint joint="j" coef="1"/><joint joint="k" coef="1"/></fixed></tendon>'
    '<equality><tendon tendon1="t"/></equality>'
)
BROKEN = {
    "not XML": ("<mujoco", {}, "arm.xml, line 1: not well-formed XML"),
    "another root": ("<arm/>", {}, "expected <robot> as the outermost element"),
    "unknown element": ("<mujoco><world/></mujoco>", {}, "MuJoCo does not compile it: XML Error: Schema violation"),
    "missing include": (arm(option='<include file="links.xml"/>'), {}, "arm.xml: MuJoCo does not compile it: XML Erro"),
    "part of a model": ("<mujocoinclude/>", {}, "arm.xml: a part of an MJCF, expected a whole one"),
    "SDF": ('<sdf version="1.8"/>', {}, "arm.xml: SDF is not read, expected URDF, xacro or MJCF"),
    "nothing moves": ("<mujoco/>", {}, "arm.xml: no moving joint below link 'world'"),
    "no such body": (arm(), {"tip": "hand"}, "no link in arm.xml named 'hand'; available: world, a"),
    "free": (arm(further("b", 'name="k"'), joint='name="j" type="free"'), {}, "joint 'j' on the chain is free, expect"),
    "closed loop": (arm(further("b", 'name="k"'), after=LOOP), {}, "the equality <connect> on body 'b' and body 'worl"),
    "tendon": (arm(further("b", 'name="k"'), after=TENDON), {}, "the equality <tendon> on joint 'j' closes a loop"),
    "no room": (arm(joint='name="j" range="0.001 0.001" limited="true"'), {}, "arm.xml: "),
}


@pytest.mark.parametrize(("text", "ends", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_files_are_refused_in_one_line(text: str, ends: dict[str, str], message: str, tmp_path: Path) -> None:
    assert message in refusal(load_robot, written(tmp_path, text), **ends)


def in_a_row(after: str) -> str:
    names = ("upper", "fore", "wrist", "flange")
    body = '<body name="{}" pos="0.3 0 0"><joint name="j{}" axis="0 1 0"/><geom size="0.1" mass="1"/>'
    inside = "".join(body.format(name, k) for k, name in enumerate(names, 1))
    return f"<mujoco><worldbody>{inside}{'</body>' * len(names)}</worldbody><equality>{after}</equality></mujoco>"


LOOPS = {
    "to the world": ('<connect body1="wrist" body2="world" anchor="0 0 0"/>', "<connect>", ["wrist", "flange"]),
    "inside": ('<weld body1="fore" body2="wrist"/>', "<weld>", ["wrist", "flange", "fore", "upper"]),
    "mimic": (
        '<joint joint1="j3" joint2="j2" polycoef="0 1 1 0 0"/>',
        "mimics joint 'j2', by a cur",
        ["upper", "wrist"],
    ),
}


@pytest.mark.parametrize(("after", "seen", "ends"), LOOPS.values(), ids=LOOPS)
def test_loops_are_refused_with_the_options_that_work(after: str, seen: str, ends: list[str], tmp_path: Path) -> None:
    path = written(tmp_path, in_a_row(after))
    message = refusal(load_robot, path)
    assert seen in message
    given = [dict(found) for part in message.split(", or ") if (found := re.findall(r"`(\w+)='(\w+)'`", part))]
    assert given
    assert {name for options in given for name in options.values()} <= set(ends)
    for options in given:
        assert load_robot(path, options.get("base_link"), options.get("tip")).n >= 1


def test_constraints_that_leave_the_chain_alone_are_no_loops(tmp_path: Path) -> None:
    text = arm(FINGERS, after='<equality><connect body1="left" body2="right" anchor="0 0 0"/></equality>')
    assert read_mjcf(written(tmp_path, text), tip="a").n == 1
    switched_off = LOOP.replace("<connect", '<connect active="false"')
    assert read_mjcf(written(tmp_path, arm(further("b", 'name="k"'), after=switched_off))).n == 2


def test_missing_mujoco_is_told_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert "not installed; pip install 'excite-trajectories[mujoco]'" in refusal(read_mjcf, written(tmp_path, arm()))
