"""The URDF reader against Pinocchio on public robots, against a slow oracle on random chains, and on broken files."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st
from public_arms import ARMS, SOME_TREES, THETA_FROM_PINOCCHIO, Arm, Reference, reference, robot_file
from refused import refusal
from reloaded import words

from regressors.errors import InputError, UnknownName
from regressors.readers.urdf import parse_urdf, read_urdf
from regressors.robot.closures import MimicJoint
from regressors.robot.robot import Robot


def link_poses(robot: Robot, q: np.ndarray) -> dict[str, np.ndarray]:
    """Pose of each link's frame relative to the base."""
    poses = [np.eye(4)]
    for joint, parent, position in zip(robot.joints, robot.parents, q, strict=True):
        poses.append(poses[parent] @ joint.motion(position))
    return dict(zip([link.name for link in robot.links], poses[1:], strict=True))


# --- public robots against Pinocchio ---------------------------------------------------------------------------------


@pytest.mark.parametrize("arm", [*ARMS, *SOME_TREES], ids=str)
def test_kinematics_inertias_limits_and_gravity_equal_pinocchio(arm: Arm) -> None:
    expected, robot = reference(arm), read_urdf(arm.path, base=arm.base, tip=arm.tip, snap_angles=False)
    model = expected.model
    assert set(robot.joint_names) == set(expected.joints)
    assert robot.joint_names == expected.joints or not robot.is_chain
    for q in np.random.default_rng(1).uniform(-2, 2, (3, robot.n)):
        placements = expected.link_poses(dict(zip(robot.joint_names, q, strict=True)))
        for name, T in link_poses(robot, q).items():
            np.testing.assert_allclose(T, placements[name], atol=1e-12, err_msg=name)
    np.testing.assert_allclose(robot.gravity, expected.base_pose()[:3, :3].T @ model.gravity.linear, atol=1e-12)
    assert not np.any(np.isfinite([robot.limits.acceleration, robot.limits.jerk]))
    for k, (name, link) in enumerate(zip(robot.joint_names, robot.links, strict=True)):
        theta = np.zeros(10) if link.theta is None else link.theta
        np.testing.assert_allclose(theta, expected.theta(name), rtol=1e-12, atol=1e-12, err_msg=link.name)
        joint = expected.joint(name)
        stated = {"velocity": model.velocityLimit[joint.idx_v], "torque": model.effortLimit[joint.idx_v]}
        for limit, value in stated.items():
            assert getattr(robot.limits, limit)[k] == (value or np.inf), (name, limit)
        span = (robot.limits.lower[k], robot.limits.upper[k])
        pinocchio = (model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q])
        unlimited = joint.nq == 2 or pinocchio == (0.0, 0.0)  # bounds that are not stated are zeros there
        assert span == ((-np.inf, np.inf) if unlimited else pinocchio), name


DEFAULTS = {
    "tiago": ("tiago.urdf", ("head_2_link", "arm_7_link"), "hand_thumb_joint"),
    "pr2": ("pr2.urdf", ("head_tilt_link", "laser_tilt_mount_link", "r_wrist_roll_link", "l_wrist_roll_link"), "r_gri"),
    "baxter": ("baxter.urdf", ("head", "right_wrist", "left_wrist"), "l_gripper_l_finger_joint"),
    "alex": ("alex_psyonic_hands.urdf", ("Head", "LeftWristRollLink", "RightWristRollLink"), "Left_index_q1"),
    "go2": ("go2.urdf", ("FL_calf", "FR_calf", "RL_calf", "RR_calf"), ""),
    "allegro": ("allegro_left_hand.urdf", ("link_11.0", "link_7.0", "link_3.0", "link_15.0"), ""),
    "iris": ("iris.urdf", tuple(f"iris__rotor_{k}" for k in range(4)), ""),
}  # fmt: skip


@pytest.mark.parametrize(("name", "tips", "held"), DEFAULTS.values(), ids=DEFAULTS)
def test_all_limbs_of_a_tree_move_but_neither_grippers_nor_wheels(name: str, tips: tuple[str, ...], held: str) -> None:
    (path,) = robot_file().rglob(name)
    robot = read_urdf(path)
    assert tuple(link.name for link in robot.tips) == tips
    assert not [joint for joint in robot.joint_names if re.search("wheel|caster|finger|thumb", joint)]
    notes = [str(note) for note in robot.notes if note.kind == "assumed"]
    assert any("stands still, as on a stand" in note for note in notes)
    assert any("held at zero and left out" in note and held in note for note in notes) == bool(held)
    assert read_urdf(path, tip=tips).sha256() == robot.sha256()


def test_every_public_file_is_read_or_refused_in_one_line() -> None:
    outcomes = {}
    for path in sorted(robot_file().rglob("*.urdf")):
        try:
            outcomes[path.name] = f"{read_urdf(path).n} joints"
        except InputError as error:
            outcomes[path.name] = str(error).removeprefix(path.name)
    assert len(outcomes) >= 60
    reasons = "no moving joint|at least one <link>"
    acceptable = rf"\d+ joints|(: |, line \d+: ).*({reasons}).*"
    assert [text for text in outcomes.values() if not re.fullmatch(acceptable, text)] == []
    assert outcomes["xarm7.urdf"] == "7 joints"
    assert outcomes["panda.urdf"] == "7 joints"
    assert outcomes["alex_nub_hands.urdf"] == "17 joints"


# --- what each part of a document becomes ----------------------------------------------------------------------------


def document(body: str, name: str = "sample") -> str:
    return f'<?xml version="1.0"?>\n<robot name="{name}">\n{body}\n</robot>\n'


def links(*names: str) -> str:
    return "\n".join(f'<link name="{name}"/>' for name in names)


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = "") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def body(name: str, mass: float, xyz: str = "0 0 0") -> str:
    inertia = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    return f'<link name="{name}"><inertial><origin xyz="{xyz}"/><mass value="{mass}"/>{inertia}</inertial></link>'


def chain(inside: str = "", kind: str = "revolute") -> str:
    """One joint j from a to b."""
    return document(links("a", "b") + joint("j", "a", "b", kind, inside))


LIMITS = {
    "all": ("revolute", 'lower="-1" upper="2" velocity="3" effort="4"', (-1, 2, 3, 4)),
    "continuous": ("continuous", 'lower="-1" upper="2" velocity="3" effort="4"', (-np.inf, np.inf, 3, 4)),
    "zero is not stated": ("revolute", 'lower="-1" upper="2" velocity="0" effort="0.0"', (-1, 2, np.inf, np.inf)),
    "one side": ("revolute", 'upper="2"', (0, 2, np.inf, np.inf)),
    "no position": ("revolute", 'velocity="3"', (-np.inf, np.inf, 3, np.inf)),
    "exporter's zeros": ("revolute", 'lower="0" upper="0" velocity="1"', (-np.inf, np.inf, 1, np.inf)),
    "infinite": ("revolute", 'lower="-inf" upper="inf" velocity="inf"', (-np.inf, np.inf, np.inf, np.inf)),
}


@pytest.mark.parametrize(("kind", "limit", "expected"), LIMITS.values(), ids=LIMITS)
def test_limits(kind: str, limit: str, expected: tuple[float, ...]) -> None:
    bounds = parse_urdf(chain(f"<limit {limit}/>", kind)).limits
    assert (bounds.lower[0], bounds.upper[0], bounds.velocity[0], bounds.torque[0]) == expected


def test_axis_is_normalised_and_poses_are_tidy() -> None:
    half = repr(np.pi / 2)
    inside = f'<origin xyz="1 0 1e-14" rpy="{half} 0 {half}"/><axis xyz="0 0 -2"/>'
    made = parse_urdf(chain(inside)).joints[0]
    assert made.axis.tolist() == [0, 0, -1]
    assert set(made.rotation.ravel()) == {0.0, 1.0}
    assert made.translation.tolist() == [1, 0, 0]
    assert not np.any(np.signbit(made.rotation))


def test_friction_becomes_drives() -> None:
    rubbing = joint("j", "a", "b", inside='<dynamics damping="0.5" friction="2"/>')
    text = document(links("a", "b", "c") + rubbing + joint("k", "b", "c"))
    transmission = parse_urdf(text).transmission
    assert transmission.coupling.tolist() == np.eye(2).tolist()
    assert [(d.name, d.viscous, d.coulomb) for d in transmission.drives] == [("j", 0.5, 2.0), ("k", None, None)]
    assert parse_urdf(chain('<dynamics damping="0"/>')).transmission is None


def test_mass_of_the_base_is_ignored_and_that_of_branches_is_merged() -> None:
    bodies = [body("a", 50), body("on_base", 7), body("b", 1), body("sensor", 2, "0 0 1"), body("finger", 4)]
    text = document(
        "".join([*bodies, body("floating", 8), links("c")])
        + joint("base_side", "a", "on_base")
        + joint("j", "a", "b")
        + joint("glue", "b", "sensor", "fixed", '<origin xyz="0 0 3"/>')
        + joint("f", "sensor", "finger", "prismatic", '<origin xyz="0 1 0"/><mimic joint="gone" offset="0.5"/>')
        + joint("loose", "b", "floating", "floating", '<origin xyz="0 1 0"/>')
        + joint("k", "b", "c")
    )
    merged, last = parse_urdf(text, tip="c").links
    np.testing.assert_allclose(merged.theta[:4], [15, 4 * 0.5, 4 * 1 + 8 * 1, 2 * 4 + 4 * 3])
    assert last.theta is None


def test_an_inertia_is_turned_from_its_own_axes() -> None:
    """As Pinocchio turns it; the public robots' inertias have the axes of their links, or nearly."""
    inertial = '<inertial><origin xyz="0.1 0.2 -0.3" rpy="0.4 -0.5 0.9"/><mass value="2"/>'
    tensor = '<inertia ixx="0.3" iyy="0.5" izz="0.6" ixy="0.02" ixz="-0.03" iyz="0.05"/></inertial>'
    text = document(links("a") + f'<link name="b">{inertial}{tensor}</link>' + joint("j", "a", "b", "continuous"))
    theirs = pin.buildModelFromXML(text).inertias[1].toDynamicParameters()[THETA_FROM_PINOCCHIO]
    np.testing.assert_allclose(parse_urdf(text).links[0].theta, theirs, atol=1e-12)


def test_a_row_of_mimic_joints_rests_where_the_first_at_zero_puts_it() -> None:
    text = document(
        links("a", "b", "c", "d")
        + body("e", 1)
        + joint("j", "a", "b")
        + joint("p", "b", "c", "prismatic")
        + joint("q", "c", "d", "prismatic", '<mimic joint="p" multiplier="3" offset="0.5"/>')
        + joint("r", "d", "e", "prismatic", '<mimic joint="q" multiplier="2" offset="0.25"/>')
    )
    theta = parse_urdf(text, tip="b").links[0].theta
    assert theta[1] == pytest.approx(0.5 + 2 * 0.5 + 0.25)


def test_gravity_is_in_the_axes_of_the_base() -> None:
    mount = joint("mount", "world", "a", "fixed", f'<origin rpy="{np.pi / 2!r} 0 0"/>')
    text = document(links("world", "a", "b") + mount + joint("j", "a", "b"))
    assert parse_urdf(text, base="a").gravity.tolist() == [0, -9.81, 0]
    assert parse_urdf(text).gravity.tolist() == [0, 0, -9.81]


def test_only_tip_ignores_fixed_branches() -> None:
    branch = links("a", "b", "c", "tool", "box") + joint("j", "a", "b") + joint("k", "b", "c")
    fixed = joint("t", "c", "tool", "fixed") + joint("x", "a", "box", "fixed")
    assert parse_urdf(document(branch + fixed)).joint_names == ("j", "k")
    assert parse_urdf(document(branch + fixed), tip="tool").joint_names == ("j", "k")


def test_elements_of_transmissions_and_encodings_do_not_disturb(tmp_path: Path) -> None:
    extra = '<transmission name="t"><joint name="j"/></transmission><gazebo><link name="b"/></gazebo>'
    path = tmp_path / "arm.urdf"
    path.write_bytes(chain().replace('version="1.0"', 'version="1.0" encoding="utf-16"').encode("utf-16"))
    assert read_urdf(path).source == "URDF arm.urdf"
    assert read_urdf(path).sha256() == parse_urdf(chain().replace("</robot>", extra + "</robot>")).sha256()


# --- broken documents ------------------------------------------------------------------------------------------------

BOMB = """<?xml version="1.0"?>
<!DOCTYPE bomb [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>
<robot name="&b;"/>"""
TWO = links("a", "b")
THREE = links("a", "b", "c")
INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
FORK, LOOSE = THREE + joint("j", "a", "b") + joint("k", "a", "c"), THREE + joint("j", "a", "b", "floating")
IMMENSE = body("b", 1e308, "9e99 0 0")
MIMIC = '<mimic joint="j"/>'
TWO_TIPS = links("a", "w", "l", "r") + joint("j", "a", "w") + joint("k", "w", "l") + joint("m", "w", "r")

BROKEN = {
    "entity bomb": (BOMB, "arm.urdf, line 2: a DOCTYPE or ENTITY declaration is refused"),
    "empty": ("", "arm.urdf, line 1: not well-formed XML: no element found"),
    "malformed": (document("<link name='a'>\n<link/>\n<oops>"), "arm.urdf, line 6: not well-formed XML: mismatched ta"),
    "unknown encoding": ('<?xml version="1.0" encoding="latin-99"?><robot name="r"/>', None),
    "other root": ("<sdf/>", "line 1: <sdf>: an SDF model, which is not read here; give the URDF"),
    "MuJoCo": ("<mujoco><worldbody/></mujoco>", "line 1: <mujoco>: a MuJoCo model (MJCF), not a URDF"),
    "xacro": (document('<xacro:arm name="left"/>'), "rename the file to arm.urdf.xacro, or give `xacro=True`"),
    "xacro expression": (document(links("${prefix}a")), "line 3: link '${prefix}a': an expression of xacro: the text"),
    "too many elements": (document("<a/>" * 200_001), "arm.urdf: it has about 100002 elements, more than the 100000 t"),
    "no link": (document(""), "expected at least one <link>"),
    "two links of one name": (document(links("a", "a")), "line 4: link 'a': two links share this name"),
    "two joints of one name": (document(THREE + 2 * joint("j", "a", "b")), "joint 'j': two joints share this name"),
    "line break in a name": (chain().replace('"j"', '"j&#10;k"'), r"joint 'j\nk': <joint> name: expected printable ch"),
    "unknown type": (chain(kind="spherical"), "no joint type named 'spherical'; available: revolute, continuous,"),
    "parent without link": (chain().replace('parent link="a"', "parent"), "<parent> needs the attribute 'link'"),
    "unknown parent": (document(TWO + joint("j", "z", "b")), "joint 'j': <parent>: no link named 'z'; available: a, b"),
    "two roots": (document(THREE + joint("j", "a", "b")), "expected one root link, given 2 that are the child of no j"),
    "closed loop": (document(FORK + joint("m", "b", "c")), "joint 'm': link 'c' is already the child of joint 'k'"),
    "loop": (document(TWO + joint("j", "a", "b") + joint("k", "b", "a")), "a loop of joints through links: a, b"),
    "NaN": (chain('<origin xyz="0 nan 0"/>'), "joint 'j': <origin> xyz: expected 3 finite numbers, given '0 nan 0'"),
    "NaN limit": (chain('<limit effort="nan"/>'), "joint 'j': <limit> effort: expected a finite number, given 'nan'"),
    "two origins": (chain("<origin/><origin/>"), "joint 'j': expected one <origin>, given 2"),
    "zero axis": (chain('<axis xyz="0 0 0"/>'), "joint 'j': <axis> xyz: expected a direction, given '0 0 0'"),
    "negative friction": (chain('<dynamics friction="-1"/>'), "joint 'j': <dynamics>: expected zero or more"),
    "no mass": (document(f'<link name="a"><inertial>{INERTIA}</inertial></link>'), "link 'a': <mass> is missing"),
    "immense mass": (document(links("a") + IMMENSE + joint("j", "a", "b")), "link 'b': inertial parameters must be fi"),
    "no moving joint": (document(links("a")), "arm.urdf: no moving joint below link 'a'"),
    "floating on the chain": (chain(kind="floating"), "joint 'j' on the chain is floating, expected revolute"),
    "floating before the arm": (document(LOOSE + joint("k", "b", "c")), "or fixed; what works is `base_link='b'`"),
    "quaternion": (chain('<origin quat_xyzw="0 0 0 1"/>'), "<origin> quat_xyzw: rotations are read from 'rpy' only"),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_documents_are_refused_in_one_line(text: str, message: str | None) -> None:
    told = refusal(parse_urdf, text if message else text.encode(), name_of_source="arm.urdf", begins="arm.urdf")
    assert (message or "arm.urdf: cannot decode the text: unknown encoding") in told


CHOICES = {
    "unknown tip": ({"tip": "z"}, UnknownName, "no link in arm.urdf named 'z'; available: a, w, l, r"),
    "tip above base": ({"base": "l", "tip": "w"}, InputError, "link 'w' does not hang below link 'l'"),
    "tip is the root": ({"base": "l", "tip": "a"}, InputError, "another base or tip: it is the other way round"),
    "base is a leaf": ({"base": "r"}, InputError, "no moving joint below link 'r'"),
}


@pytest.mark.parametrize(("choice", "error", "message"), CHOICES.values(), ids=CHOICES)
def test_chains_that_are_not_there(choice: dict[str, str], error: type[InputError], message: str) -> None:
    with pytest.raises(error, match=re.escape(message)):
        parse_urdf(document(TWO_TIPS), name_of_source="arm.urdf", **choice)


def test_a_mimic_joint_moves_with_the_one_that_it_follows_and_rests_with_it() -> None:
    names = [f"l{k}" for k in range(6)]
    inside = {3: '<mimic joint="j2" multiplier="-2" offset="0.5"/>'}
    row = "".join(joint(f"j{k}", f"l{k - 1}", f"l{k}", inside=inside.get(k, "")) for k in range(1, 6))
    text = document(links(*names) + row)
    robot = parse_urdf(text)
    assert robot.joint_names == ("j1", "j2", "j3", "j4", "j5")
    assert (robot.closures, robot.passive) == ((MimicJoint(("j3", "j2"), -2.0, 0.5),), ("j3",))
    assert parse_urdf(text, base="l3").joint_names == ("j4", "j5")
    assert parse_urdf(text, tip="l1").closures == ()
    assert refusal(parse_urdf, text, base="l2").endswith(
        "joint 'j3' on the chain mimics joint 'j2', which stands still; what works is `base_link='l3'`"
    )


def test_a_mimic_joint_beside_the_chain_moves_too() -> None:
    text = document(THREE + joint("j", "a", "b") + joint("k", "a", "c", inside=MIMIC))
    for tip in ("b", None):  # by default the limb that moves by itself, such as one finger of a gripper
        robot = parse_urdf(text, tip=tip)
        assert (robot.joint_names, robot.parents, robot.passive) == (("j", "k"), (0, 0), ("k",))


def test_mimic_joints_must_not_follow_from_above_the_base_nor_each_other() -> None:
    above = document(THREE + joint("j", "a", "b", inside='<mimic joint="k"/>') + joint("k", "b", "c"))
    told = refusal(parse_urdf, above, base="b", tip="c")
    assert "joint 'j' off the chain mimics joint 'k' on the chain" in told
    k, m = joint("k", "a", "c", inside='<mimic joint="m"/>'), joint("m", "c", "d", inside='<mimic joint="k"/>')
    told = refusal(parse_urdf, document(THREE + links("d") + joint("j", "a", "b") + k + m), tip="b")
    assert "mimics itself by way of k, m" in told


def test_thousands_of_links_are_read() -> None:
    names = [f"l{k}" for k in range(3000)]
    pairs = itertools.pairwise(names)
    text = document(links(*names) + "".join(joint(f"j{b}", a, b, "fixed") for a, b in pairs) + body("end", 1))
    text = text.replace("</robot>", joint("end", names[-1], "end") + "</robot>")
    assert parse_urdf(text).joint_names == ("end",)


# --- laws ------------------------------------------------------------------------------------------------------------

lengths = st.floats(-2, 2, allow_subnormal=False)
angles = st.floats(-3, 3, allow_subnormal=False)
triples = st.tuples(lengths, lengths, lengths)
turns = st.tuples(angles, angles, angles)
axes = triples.filter(lambda axis: np.linalg.norm(axis) > 0.1)
masses = st.floats(0, 5, allow_subnormal=False)
bodies = st.fixed_dictionaries({"mass": masses, "xyz": triples, "rpy": turns, "root": st.tuples(triples, triples)})
steps = st.fixed_dictionaries(
    {
        "kind": st.sampled_from(["revolute", "continuous", "prismatic", "fixed"]),
        "xyz": triples,
        "rpy": turns,
        "axis": axes,
        "body": st.none() | bodies,
        "q": st.floats(-3, 3),
    }
)


def tensor(root: tuple[tuple[float, ...], ...]) -> np.ndarray:
    """An inertia tensor about the centre of mass, of point masses in pairs."""
    points = np.array(root)
    return sum(float(p @ p) * np.eye(3) - np.outer(p, p) for p in points)


LIMIT = '<limit lower="-9" upper="9" velocity="1" effort="1"/>'


def origin_of(placed: dict) -> str:
    return f'<origin xyz="{words(placed["xyz"])}" rpy="{words(placed["rpy"])}"/>'


def urdf_of(chain_steps: list[dict]) -> str:
    """The chain as a document, from its end to its start."""
    parts = [body("l0", 99)]
    for k, step in enumerate(chain_steps, 1):
        inertial = ""
        if step["body"]:
            t, pairs = tensor(step["body"]["root"]), [(r, c) for r in range(3) for c in range(r, 3)]
            entries = " ".join(f'i{"xyz"[r]}{"xyz"[c]}="{float(t[r, c])!r}"' for r, c in pairs)
            mass = f'<mass value="{step["body"]["mass"]!r}"/>'
            inertial = f"<inertial>{origin_of(step['body'])}{mass}<inertia {entries}/></inertial>"
        origin = f'{origin_of(step)}<axis xyz="{words(step["axis"])}"/>{LIMIT}'
        parts += [f'<link name="l{k}">{inertial}</link>', joint(f"j{k}", f"l{k - 1}", f"l{k}", step["kind"], origin)]
    return document("\n".join(reversed(parts)))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(steps, min_size=1, max_size=7).filter(lambda found: any(s["kind"] != "fixed" for s in found)))
def test_random_chains_are_read_back(chain_steps: list[dict]) -> None:
    robot = parse_urdf(urdf_of(chain_steps), snap_angles=False)
    moving = [(k, step) for k, step in enumerate(chain_steps, 1) if step["kind"] != "fixed"]
    assert robot.joint_names == tuple(f"j{k}" for k, _ in moving)
    assert [link.name for link in robot.links] == [f"l{k}" for k, _ in moving]
    expected = Reference(pin.buildModelFromXML(urdf_of(chain_steps)), robot.joint_names, None)
    q = [step["q"] for _, step in moving]
    poses = expected.link_poses(dict(zip(robot.joint_names, q, strict=True)))
    for (name, pose), link in zip(link_poses(robot, np.array(q)).items(), robot.links, strict=True):
        np.testing.assert_allclose(pose, poses[name], atol=1e-9)
        theta = np.zeros(10) if link.theta is None else link.theta
        np.testing.assert_allclose(theta, expected.theta("j" + name[1:]), rtol=1e-9, atol=1e-9)


WHOLE = document(
    body("a", 1)
    + body("b", 2)
    + links("c", "d")
    + joint("j", "a", "b", inside='<origin xyz="1 2 3" rpy="0 1 0"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"/>')
    + joint("k", "b", "c", "prismatic", '<dynamics damping="1" friction="2"/>')
    + joint("g", "c", "d", inside='<mimic joint="x" multiplier="2" offset="0.1"/>')
)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    st.integers(0, len(WHOLE)),
    st.integers(0, 30),
    st.sampled_from(["", " ", "<", '"', "/>", "nan", "1e999", "-", "&#10;", "link", "é"]),
    st.none() | st.sampled_from(["a", "c"]),
)
def test_damaged_documents_are_read_or_refused_in_one_line(start: int, length: int, put: str, tip: str | None) -> None:
    message = ""
    try:
        parse_urdf(WHOLE[:start] + put + WHOLE[start + length :], tip=tip)
    except InputError as error:
        message = str(error)
    assert "\n" not in message
