"""What the reader of URDF notices: misspelt words, missing ranges, grippers, bodies that cannot be."""

from __future__ import annotations

import pickle
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from public_arms import ARMS, Arm
from refused import refusal

from regressors.errors import InputError, UnknownName
from regressors.models.base import base_parameters
from regressors.models.differential import DifferentialModel
from regressors.readers.description import refuse_missing_ranges
from regressors.readers.health import Body, inertia_findings
from regressors.readers.library import built_in, built_in_names
from regressors.readers.urdf import parse_urdf, read_urdf
from regressors.robot.inertia import from_centre_of_mass
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Robot

LIMIT = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'


def document(body: str) -> str:
    return f'<robot name="sample">\n{body}\n</robot>'


def links(*names: str) -> str:
    return "".join(f'<link name="{name}"/>' for name in names)


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = LIMIT) -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def chain(inside: str = LIMIT, kind: str = "revolute") -> str:
    return document(links("a", "b") + joint("j", "a", "b", kind, inside))


def body(name: str, mass: float, moments: tuple[float, ...] = (0.1, 0.1, 0.1), xyz: str = "0 0 0") -> str:
    inertia = '<inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="{}"/>'.format(*moments)
    return f'<link name="{name}"><inertial><origin xyz="{xyz}"/><mass value="{mass}"/>{inertia}</inertial></link>'


def told(robot: Robot, *kinds: str) -> list[str]:
    return [str(note) for note in robot.notes if note.kind in kinds]


# --- words -----------------------------------------------------------------------------------------------------------

MISSPELT = {
    "limits": (chain('<limits lower="-1" upper="1"/>'), "line 2: joint 'j': <joint> has no <limits>; did you mean <li"),
    "inertia": (document(body("a", 1).replace("inertia ", "inerita ")), "<inertial> has no <inerita>; did you mean <"),
    "efort": (chain('<limit lower="-1" upper="1" efort="3"/>'), "<limit> has no 'efort'; did you mean 'effort'?"),
    "joints": (document(links("a") + "<joints/>"), "line 2: <joints>: <robot> has no <joints>; did you mean <joint>?"),
}


@pytest.mark.parametrize(("text", "message"), MISSPELT.values(), ids=MISSPELT)
def test_misspelt_words_that_matter_are_refused(text: str, message: str) -> None:
    told = refusal(parse_urdf, text)
    assert message in told
    assert told.endswith("Correct it, or remove it")


NOT_READ = {
    "prefixed": ("<x:note/>", "joint 'j': not known in <joint>, and not read: <x:note>"),
    "prefixed but known": ('<u:limit lower="-9"/>', "joint 'j': not known in <joint>, and not read: <u:limit> (it wou"),
    "beside the right one": ("<limits/>", "joint 'j': not known in <joint>, and not read: <limits>"),
    "not needed": ("<calibraton/>", "not known in <joint>, and not read: <calibraton> (did you mean 'calibration'?)"),
    "attributes": ('<dynamics damping="1" K="3" mu="2"/>', "not known in <dynamics>, and not read: 'K', 'mu'"),
}


@pytest.mark.parametrize(("inside", "message"), NOT_READ.values(), ids=NOT_READ)
def test_other_unknown_words_are_told(inside: str, message: str) -> None:
    (found,) = [note for note in told(parse_urdf(chain(LIMIT + inside)), "found") if "not read" in note]
    assert message in found


def test_known_words_are_not_told() -> None:
    extra = '<material name="m"/><gazebo/><transmission name="t"/><ros2_control name="r" type="system"/>'
    text = chain(LIMIT + "<calibration/><safety_controller/>").replace("</robot>", f"{extra}</robot>")
    text = text.replace("<robot ", '<robot xmlns:xacro="http://ros.org/wiki/xacro" version="1.0" ')
    assert [note.what for note in parse_urdf(text).notes] == ["1 moving joint(s): j", *MISSING_BODY]


MISSING_BODY = ["no <inertial>: its parameters are unknown"]


# --- ranges ----------------------------------------------------------------------------------------------------------

WITHOUT_RANGE = {
    "no limit": ("revolute", "", "no position limits are stated"),
    "zeros": ("revolute", '<limit lower="0" upper="0"/>', "<limit> says lower=0 and upper=0, which leaves no room"),
    "one zero": ("revolute", '<limit upper="0"/>', "no position limits are stated"),
}


@pytest.mark.parametrize(("kind", "inside", "message"), WITHOUT_RANGE.values(), ids=WITHOUT_RANGE)
def test_joints_without_a_range_must_not_move(kind: str, inside: str, message: str) -> None:
    robot = parse_urdf(chain(inside, kind), name_of_source="arm.urdf")
    remedy = r'; write <limit lower=".*/> into the file, or type="continuous" .*, or give `position`'
    assert re.search(f"URDF arm.urdf, joint 'j': {message}{remedy}", refusal(refuse_missing_ranges, robot, [True]))
    refuse_missing_ranges(robot, [False])
    refuse_missing_ranges(robot.replace(limits=replace(robot.limits, lower=[-1.0], upper=[1.0])), [True])


@pytest.mark.parametrize(
    ("kind", "inside"), [("revolute", LIMIT), ("continuous", ""), ("revolute", '<limit lower="-inf" upper="inf"/>')]
)
def test_joints_whose_range_is_stated_may_move(kind: str, inside: str) -> None:
    refuse_missing_ranges(parse_urdf(chain(inside, kind)), [True])


def test_all_joints_without_a_range_are_named_at_once() -> None:
    text = document(links("a", "b", "c") + joint("j", "a", "b", inside="") + joint("k", "b", "c", inside=""))
    with pytest.raises(InputError, match=r"joint 'j': no position limits are stated \(the same for k\)"):
        refuse_missing_ranges(parse_urdf(text), [True, True])


def test_what_limits_leave_open_is_told() -> None:
    one_side = parse_urdf(chain('<limit upper="2" velocity="1" effort="1"/>'))
    assert told(one_side, "assumed") == ["joint 'j': lower=0, which <limit> does not state; write lower into the file"]
    degrees = parse_urdf(chain('<limit lower="-180" upper="180" velocity="1" effort="1"/>'))
    inside = ["joint 'j': turns from -180 to 180 rad; limits are in radians, not in degrees"]
    assert told(degrees, "suspicious") == inside
    missing = [note.what for note in parse_urdf(chain('<limit lower="-1" upper="1"/>')).notes if note.kind == "missing"]
    assert missing == ["no velocity limit", "no effort limit, so torques are not limited", *MISSING_BODY]


def test_a_joint_without_transmission_is_told() -> None:
    text = document(links("a", "b", "c") + joint("j", "a", "b") + joint("k", "b", "c"))
    driven = text.replace("</robot>", '<transmission name="t"><joint name="j"/></transmission></robot>')
    assert told(parse_urdf(text), "suspicious") == []
    assert told(parse_urdf(driven), "suspicious") == [
        "joint k: no transmission, though others have one, so it may be passive; leave a passive joint out of `joints`"
    ]


# --- ends of the chain -----------------------------------------------------------------------------------------------


def serial(*names: str) -> str:
    """Joints in a row, each with a link of the name ``<joint>_link``."""
    above = ["base", *(f"{name}_link" for name in names)]
    return links(*above) + "".join(joint(name, a, f"{name}_link") for name, a in zip(names, above, strict=False))


GRIPPERS = {
    "by name": (serial("j1", "j2", "gripper"), ("j1", "j2")),
    "by its link": (serial("j1", "tool").replace("tool_link", "moving_jaw"), ("j1",)),
    "hand": (serial("j1", "hand"), ("j1",)),
    "mimic": (serial("j1") + links("c") + joint("j2", "j1_link", "c", inside=LIMIT + '<mimic joint="x"/>'), ("j1",)),
    "body on a numbered joint": (serial("j1", "joint6").replace("joint6_link", "gripperStator"), ("j1", "joint6")),
    "hand behind a wrist": (serial("j1", "wrist").replace("wrist_link", "hand"), ("j1", "wrist")),
    "wrist of a hand": (serial("j1", "hand_wrist"), ("j1", "hand_wrist")),
    "finger alone": (serial("finger_base", "finger_tip"), ("finger_base", "finger_tip")),
    "in between": (serial("gripper_mount", "j2"), ("gripper_mount", "j2")),
}


@pytest.mark.parametrize(("text", "moving"), GRIPPERS.values(), ids=GRIPPERS)
def test_joints_of_a_gripper_are_held(text: str, moving: tuple[str, ...]) -> None:
    assert parse_urdf(document(text)).joint_names == moving


def test_a_held_gripper_is_told_and_its_mass_merged() -> None:
    text = document(serial("j1", "gripper").replace('<link name="gripper_link"/>', body("gripper_link", 3)))
    robot = parse_urdf(text)
    (note,) = told(robot, "assumed")
    assert note.endswith("moves a gripper: held at zero and left out; `tip='gripper_link'` includes it")
    assert robot.links[-1].theta[0] == 3
    assert parse_urdf(text, tip="gripper_link").joint_names == ("j1", "gripper")
    before, _, after = text.rpartition('lower="-1"')
    assert told(parse_urdf(f'{before}lower="0.5"{after}'), "suspicious") == [
        "joint gripper: held where its limits do not allow it"
    ]


def fingers(arm: int, *lengths: int) -> str:
    text = serial(*(f"j{k}" for k in range(1, arm + 1)))
    for f, length in enumerate(lengths):
        above = f"j{arm}_link"
        for k in range(length):
            text += links(f"f{f}{k}") + joint(f"p{f}{k}", above, f"f{f}{k}", "prismatic")
            above = f"f{f}{k}"
    return document(text)


def test_the_chain_ends_where_fingers_part() -> None:
    robot = parse_urdf(fingers(4, 1, 3))
    assert robot.joint_names == ("j1", "j2", "j3", "j4")
    (note,) = told(robot, "assumed")
    assert note.startswith("link 'j4_link': the chain ends here, where fingers part; p00, p10 are held at zero")
    assert parse_urdf(fingers(4, 1, 3), tip="f11").n == 6


@pytest.mark.parametrize("text", [fingers(2, 1, 1), fingers(3, 3, 1)], ids=["few joints before", "limbs"])
def test_limbs_are_no_fingers(text: str) -> None:
    robot = parse_urdf(text)
    assert len(robot.tips) == 2
    assert robot.n == len(re.findall("<joint", text))


def test_unknown_links_are_asked_for() -> None:
    with pytest.raises(UnknownName, match=r"named 'j2_lnik'; did you mean 'j2_link' or 'j1_link'\? available: base"):
        parse_urdf(document(serial("j1", "j2")), tip="j2_lnik")


# --- bodies ----------------------------------------------------------------------------------------------------------

BODIES = {
    "negative mass": ((-1, (1, 1, 1)), "its mass is not positive"),
    "grams": ((2e5, (1e3, 1e3, 1e3)), "its mass is above 100000 kg, so it may be in grams"),
    "point": ((1, (0, 0, 0)), "its inertia is zero, as of a point"),
    "negative inertia": ((1, (-0.01, 0.01, 0.01)), "its inertia is not positive definite about the centre of mass"),
    "triangle": ((1, (0.01, 0.01, 0.03)), "its inertia violates the triangle inequality: no body has it"),
    "too large": ((1, (2, 2, 2)), "its inertia is too large for its mass: it would be larger than the arm"),
    "sound": ((1, (0.01, 0.01, 0.01)), None),
    "rounded plate": ((1, (0.001234, 0.001234, 0.002469)), None),
}


@pytest.mark.parametrize(("numbers", "message"), BODIES.values(), ids=BODIES)
def test_bodies_that_cannot_be_are_told(numbers: tuple[float, tuple[float, ...]], message: str | None) -> None:
    text = document(links("a") + body("b", *numbers) + joint("j", "a", "b"))
    notes = [(note.where, note.what) for note in parse_urdf(text).notes if note.kind == "suspicious"]
    assert notes == ([("link b", message)] if message else [])


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(-0.2, 0.2)] * 3), min_size=4, max_size=8),
    st.tuples(*[st.floats(-0.4, 0.4)] * 3),
    st.floats(0.1, 10),
)
def test_no_real_body_is_told_of(points: list[tuple[float, ...]], centre: tuple[float, ...], mass: float) -> None:
    """Any cloud of points around its centre of mass, with a little of a ball so that it is not flat."""
    cloud = np.array(points) - np.mean(points, axis=0)
    spread = cloud.T @ cloud / len(cloud) * mass + 1e-4 * mass * np.eye(3)
    theta = from_centre_of_mass(mass, centre, np.trace(spread) * np.eye(3) - spread)
    assert list(inertia_findings([Body("b", "b", theta)], 1.0)) == []


def test_a_centre_of_mass_outside_is_told() -> None:
    text = document(links("a") + body("b", 1, (0.01, 0.01, 0.01), "0 0 5") + joint("j", "a", "b"))
    notes = [note.what for note in parse_urdf(text).notes if note.kind == "suspicious"]
    assert notes == ["its centre of mass is farther away than the arm reaches"]


def limited(kind: str = "revolute", axis: str = "1 0 0", **limit: float) -> str:
    stated = {"lower": -1, "upper": 1, "velocity": 1, "effort": 30} | limit
    attributes = " ".join(f'{name}="{value}"' for name, value in stated.items())
    inside = f'<axis xyz="{axis}"/><limit {attributes}/>'
    return document(links("a") + body("b", 10.0, xyz="0 0 0.3") + joint("j", "a", "b", kind, inside))


PLACEHOLDERS = {
    "slow": (limited(velocity=0.001), "joint j: a velocity limit of 0.001 rad/s; it may be a placeholder"),
    "narrow": (limited(lower=-0.001, upper=0.001), "joint j: a range of 0.002 rad; it may be a placeholder"),
    "degrees": (limited(lower=-0.035, upper=0.035), "a range of 0.07 rad; it may be a placeholder, or in another unit"),
    "weak": (limited(effort=0.001), "joint j: an effort limit of 0.001 Nm, but what it carries weighs on it with 29 N"),
    "grams": (limited().replace('"10.0"', '"10000.0"'), "but what it carries weighs on it with 2.9e+04 Nm"),
}


@pytest.mark.parametrize(("text", "message"), PLACEHOLDERS.values(), ids=PLACEHOLDERS)
def test_limits_that_leave_hardly_anything_are_told(text: str, message: str) -> None:
    (found,) = told(parse_urdf(text), "suspicious")
    assert message in found


def test_a_velocity_that_no_joint_reaches_is_told_but_not_suspected_where_no_motion_is_found() -> None:
    robot = parse_urdf(limited(velocity=180))
    message = "joint j: a velocity limit of 180 rad/s; it may be a placeholder, or in another unit: give `velocity`"
    assert [note.startswith(message) for note in told(robot, "assumed")] == [True]
    assert told(robot, "suspicious") == []


@pytest.mark.parametrize(
    "text",
    [
        limited(),
        limited("prismatic", velocity=0.01, lower=0, upper=0.02),
        limited(effort=5),
        limited(axis="0 0 1", effort=0.01),  # upright: nothing weighs on it
        limited(effort=0, velocity=0),
    ],
)
def test_limits_that_leave_something_are_not_told(text: str) -> None:
    assert not told(parse_urdf(text), "suspicious")


@pytest.mark.parametrize("arm", ARMS[::3], ids=str)
def test_no_limit_of_a_public_robot_is_taken_for_a_placeholder(arm: Arm) -> None:
    notes = told(read_urdf(arm.path, base=arm.base, tip=arm.tip), "suspicious")
    assert not [note for note in notes if "a velocity limit of" in note or "a range of" in note or "an effort" in note]


def test_placeholders_are_told() -> None:
    def arm(*masses: float) -> Robot:
        names = [f"l{k}" for k in range(len(masses))]
        bodies = "".join(body(name, mass, (0.01, 0.01, 0.01)) for name, mass in zip(names, masses, strict=True))
        chained = (joint(f"j{k}", b, a) for k, (a, b) in enumerate(zip(names, ["a", *names], strict=False)))
        return parse_urdf(document(links("a") + bodies + "".join(chained)))

    alike = "links l0, l1, l3: the same 2 kg and the same inertia, so they may be placeholders; "
    assert told(arm(2, 2, 1, 2), "suspicious")[0].startswith(alike)
    assert told(arm(2, 2, 1, 1), "suspicious") == []
    fingers = "".join(body(name, 2, (0.01, 0.01, 0.01)) + joint(name, "b", name, "fixed", "") for name in "xyz")
    assert told(parse_urdf(document(links("a", "b") + joint("j", "a", "b") + fingers)), "suspicious") == []


def test_lengths_in_millimetres_are_told() -> None:
    text = chain(LIMIT + '<origin xyz="0 0 330"/>')
    (note,) = told(parse_urdf(text), "suspicious")
    assert note == "joint j: more than 50 m from the one before; lengths are in metres, not in millimetres"


# --- how notes travel ------------------------------------------------------------------------------------------------


def test_notes_are_no_part_of_the_description() -> None:
    robot = parse_urdf(chain(""))
    bare = robot.replace(notes=())
    assert robot.notes
    assert robot.sha256() == bare.sha256()
    assert robot.description() == bare.description()
    assert "notes" not in robot.description()
    assert pickle.loads(pickle.dumps(robot)).notes == robot.notes
    text = document(links("a", "b", "c") + joint("j", "a", "b") + joint("k", "b", "c", inside=""))
    assert any(note.joint for note in with_locked_joints(parse_urdf(text), [0]).notes)


KNOWN = {
    "irp6": "006a987c29cd168d4a93a589ce6cadc4bc8a2649cb7302588136bdd3a9c0de0e",
    "irp6-full": "13c7a89162beae2ce0357dc6afc7bb7d62a379e5b9075288cbaa7a08a496fcaf",
    "panda": "949d69e006b7d5054727e2c5283a4af377195241c1a79d800f952e8c5280c29d",
    "ur10e": "a8c7c32bc580bc7d246e53b0dee35db117f8810eae054031e21d15facaa91068",
    "iiwa7": "824c8676cbac6279fc797c22583bc1b4bc2ef9e75e74b8cdbcffcb8756c564c6",
    "so101": "b33d5cbdcf24a751bab2f9e775fcfca4f1212175f5e47bc46f18ec3efb9474f2",
}


def test_built_in_robots_keep_their_hashes() -> None:
    hashes = {name: built_in(name).sha256() for name in built_in_names()}
    assert {name: hashes[name] for name in KNOWN} == KNOWN
    assert all(built_in(name).notes == () for name in built_in_names())


@pytest.mark.parametrize(("name", "expected"), [("so101", (48, 50, 5)), ("z1", (57, 57, 6))])
def test_public_arms(name: str, expected: tuple[int, ...]) -> None:
    """Base parameters, with and without right angles, and joints by default."""
    (arm,) = (arm for arm in ARMS if arm.id == name)
    robots = [read_urdf(arm.path, base=arm.base, tip=arm.tip, snap_angles=snap) for snap in (True, False)]
    models = [DifferentialModel(robot.replace(transmission=None)) for robot in robots]
    ranks = [base_parameters(model, rounding=0.0).rank for model in models]
    assert (*ranks, read_urdf(arm.path).n) == expected
