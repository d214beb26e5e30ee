"""The robot description: what it refuses, the hash that identifies it, and the way back from its plain form."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from public_arms import ARMS
from refused import refusal

from regressors.errors import UnknownName
from regressors.readers.library import built_in, built_in_names, load_robot
from regressors.readers.urdf import read_urdf
from regressors.robot.archive import robot_from_description
from regressors.robot.gears import BallScrew, ConstantRatio
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Aggregates, Drive, Joint, Limits, Link, Robot, Structure, Transmission
from regressors.robot.shapes import Capsule, Part

INF, NAN = np.inf, np.nan
THETA = [2.0, 0.1, 0.0, 0.0, 0.1, 0.0, 0.0, 0.2, 0.0, 0.2]
BALL = Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1)
TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def joint(name: str = "a", kind: Any = "revolute", **changes: Any) -> Joint:
    return Joint(**{"name": name, "kind": kind, "rotation": np.eye(3), "translation": np.zeros(3), **changes})


def limits(n: int = 2, **changes: Any) -> Limits:
    none = {name: [INF] * n for name in ("velocity", "acceleration", "jerk", "torque")}
    fields = {"lower": [-1.0] * n, "upper": [1.0] * n, **none}
    return Limits(**{**fields, **changes})


def transmission(**changes: Any) -> Transmission:
    drives = (Drive("y", ConstantRatio(50.0), 1e-4, 2.0, 3.0), Drive("z", BallScrew(0.005, 0.08, -0.03, 0.05)))
    fields = {"coupling": [[1.0, 0.0], [0.5, 1.0]], "drives": drives, "limits": limits(), "offset": [0.0, 0.1]}
    return Transmission(**fields | changes)


def robot(**changes: Any) -> Robot:
    fields = {
        "name": "two",
        "joints": (joint("a"), joint("b", "prismatic", translation=[0.0, 0.0, 0.5])),
        "links": (Link("la", THETA), Link("lb")),
        "limits": limits(),
        "transmission": transmission(),
        "structure": Structure(
            frozenset({"m1c1y", "I1xy"}),
            (("I1yy", "I1zz"),),
            (Aggregates(("a", "b"), {"X1": {"I1zz": 1.0, "m2": 0.25}}),),
        ),
        "constants": {"l1": 0.5},
        "source": "a drawing",
    }
    return Robot(**{**fields, **changes})


REFUSED: tuple[tuple[Callable[[], object], str], ...] = (
    (lambda: robot(joints=(), links=(), limits=limits(0)), "robot 'two' has no moving joint"),
    (lambda: robot(links=(Link("la"),)), "robot 'two': 2 joints, but 1 links and 2 limits"),
    (lambda: robot(joints=(joint("a"), joint("a"))), "robot 'two': two joints share a name: a, a"),
    (
        lambda: robot(shapes=(Part("hand", BALL),)),
        "no link with a shape, of robot 'two', named 'hand'; available: base",
    ),
    (lambda: robot(gravity=[0.0, 0.0, NAN]), "robot 'two': gravity must hold three finite numbers, given [0.0, 0.0, n"),
    (lambda: robot(transmission=transmission(coupling=np.eye(2)[:, :1])), "the coupling must have 2 columns, one per"),
    (lambda: robot(limits=limits(lower=[-1.0, 1.0])), "joint b: lower position limit 1 must be below the upper one 1"),
    (lambda: robot(limits=limits(lower=[-INF, -1.0])), "joint a: position limits must be two or none, given -inf and"),
    (lambda: robot(transmission=transmission(limits=limits(velocity=[1.0, 0.0]))), "drive z: velocity limit must be g"),
    (lambda: limits(upper=[1.0, NAN]), "limit upper: NaN at number 2 is not a number"),
    (lambda: limits(velocity=[1.0]), "limit velocity: expected shape (2,), given (1,)"),
    (lambda: joint(kind="floating"), "joint 'a': kind must be revolute or prismatic, given 'floating'"),
    (lambda: joint(rotation=2 * np.eye(3)), "joint 'a': rotation is not a rotation matrix"),
    (lambda: joint(axis=[0.0, 0.0, 2.0]), "joint 'a': axis must have length 1, given 2"),
    (lambda: joint(translation=[0.0, 0.0, INF]), "joint 'a': translation must be finite, given [0.0, 0.0, inf]"),
    (lambda: Link("l", [NAN] * 10), "link 'l': inertial parameters must be finite"),
    (lambda: transmission(coupling=np.eye(3)), "2 drives need as many coupling rows and limits, given a coupling of s"),
    (lambda: transmission(coupling=[[1.0, NAN], [0.0, 1.0]]), "transmission: the coupling matrix must hold finite num"),
    (lambda: transmission(offset=[1.0]), "transmission, offset: expected shape (2,), given (1,)"),
    (lambda: ConstantRatio(0.0), "gear ratio must be a finite number other than zero, given 0.0"),
    (lambda: BallScrew(0.0, 0.08, 0.01, 0.01), "ball screw: pitch must be greater than zero, given 0"),
    (lambda: BallScrew(0.005, 0.01, 0.03, 0.04), "ball screw: no triangle has squared length 0.01 +- 0.05 m^2"),
)


@pytest.mark.parametrize(("make", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_refuses_and_says_why(make: Callable[[], object], message: str) -> None:
    assert message in refusal(make)


def test_joints_by_name_and_by_number() -> None:
    made = robot(joints=(joint("2"), joint("b")))
    assert [made.joint_index(name) for name in ("2", "b", "1")] == [0, 1, 0]  # a name goes before a number
    for name in ("0", "3", "-1", "c", "", "\N{SUPERSCRIPT TWO}", "\N{ARABIC-INDIC DIGIT TWO}x"):
        assert refusal(made.joint_index, name) == f"no joint named {name!r}; available: 1 (2), 2 (b)"
    with pytest.raises(UnknownName, match=r"no joint named '9{50,}\.\.\.9999'; available: 1 \(2\), 2 \(b\)"):
        made.joint_index("9" * 5000)


def test_arrays_cannot_be_written_nor_share_memory_with_what_was_given() -> None:
    lower = np.array([-1.0, -1.0])
    made = robot(limits=limits(lower=lower))
    lower[0] = 5.0
    assert made.limits.lower[0] == -1.0
    for each in (made, pickle.loads(pickle.dumps(made))):
        assert each.sha256() == made.sha256()
        of_joints, of_drives = (each.joints[0].rotation, each.limits.lower), each.transmission.coupling
        for array in (*of_joints, of_drives, each.gravity, each.links[0].theta):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0
        with pytest.raises(TypeError):
            each.constants["l1"] = 1.0


# Plain form and hash


def test_hash_is_stable() -> None:
    # Files hold this hash: another value means that designs of before can no longer be read.
    found = Robot("one", (joint("a"),), (Link("l"),), Limits.none(1)).sha256()
    assert found == "784726262dade9f70f304253d93f52449344c360f1d9b6660cc085e0464bb392"


def changed() -> Iterator[Robot]:
    """The robot with one thing of each kind changed."""
    first, second = robot().joints
    structure, (drive, screw) = robot().structure, transmission().drives
    yield from (robot(joints=joints) for joints in ((joint("c"), second), (joint("a", "prismatic"), second)))
    for change in ({"rotation": TURNED}, {"translation": [0.0, 0.0, 1e-12]}, {"axis": [0.0, 1.0, 0.0]}):
        yield robot(joints=(joint("a", **change), second))
    theta = [np.nextafter(2.0, 3.0), *THETA[1:]]
    for link in (Link("lc", THETA), Link("la", THETA, 3), Link("la", theta), Link("la")):
        yield robot(links=(link, Link("lb")))
    for name in ("velocity", "acceleration", "jerk", "torque"):
        yield robot(limits=limits(**{name: [5.0, INF]}))
    for change in ({"lower": [-1.1, -1.0]}, {"upper": [1.0, 1.1]}):
        yield robot(limits=limits(**change))
    gear, slow = BallScrew(0.005, 0.08, -0.03, 0.05), limits(velocity=[1.0, 1.0])
    for change in ({"coupling": np.eye(2)}, {"offset": [0.0, 0.2]}, {"limits": slow}):
        yield robot(transmission=transmission(**change))
    gears = ({"ratio": ConstantRatio(51.0)}, {"ratio": gear}, {"rotor_inertia": 2e-4}, {"rotor_inertia": None})
    for change in (*gears, {"name": "w"}, {"rests": True}, {"coulomb": None}, {"viscous": 0.0}):
        yield robot(transmission=transmission(drives=(replace(drive, **change), screw)))
    fewer, other = Aggregates(("a", "b"), {"X1": {"I1zz": 1.0}}), Aggregates(("a",), {"X1": {"I1zz": 1.0, "m2": 0.25}})
    for change in ({"zero": frozenset({"m1c1y"})}, {"equal": ()}, {"aggregates": (fewer,)}, {"aggregates": (other,)}):
        yield robot(structure=replace(structure, **change))
    for change in ({"name": "three"}, {"transmission": None}, {"joints": (second, first)}, {"constants": {"l1": 0.6}}):
        yield robot(**change)
    yield robot(links=(Link("la", THETA), Link("lb", [0.0] * 10)))
    yield robot(gravity=[0.0, 0.0, -9.80665])
    yield robot(constants={"l2": 0.5})


def test_hash_changes_with_everything() -> None:
    hashes = [made.sha256() for made in (robot(), *changed())]
    assert len(hashes) == 38
    assert len(set(hashes)) == len(hashes)


SOME = ("panda-hand", "ur10", "tiago-torso-arm", "icub-left-arm", "double-pendulum")
SCREWS = (
    "name: screws\ngravity: [0.5, 0.0, 3.7]\n"
    "joints: [{name: a, mdh: {}}, {name: b, mdh: {a: 0.5}, limits: {position: [-1, 1], torque: 3}}]\n"
    "drives: [{name: y, ratio: 7, friction: {coulomb: 1}}, "
    "{name: z, ratio: {ball_screw: {pitch: 0.005, square: 0.08, cosine: -0.03, sine: 0.05}}, offset: 5 deg}]\n"
    "coupling: [[1, 0], [0.5, 1]]\n"
    "structure: {zero: [m2c2y], equal: [[I1xx, I1yy]], aggregates: [{joints: [a, b], parameters: {X: {m2: 0.5}}}]}\n"
)


def archived(robot: Robot) -> Robot:
    return robot_from_description(json.loads(json.dumps(robot.description(), allow_nan=False)))


def assert_same(robot: Robot) -> None:
    again = archived(robot)
    assert again.sha256() == robot.sha256()
    assert again.description() == robot.description()
    assert again.source == robot.source
    assert again.structure == robot.structure
    for joint, back in zip(robot.joints, again.joints, strict=True):
        assert np.array_equal(joint.motion(0.3), back.motion(0.3))
        assert np.array_equal(np.signbit(joint.rotation), np.signbit(back.rotation))
    for name in ("lower", "upper", "velocity", "acceleration", "jerk", "torque"):
        assert np.array_equal(getattr(robot.limits, name), getattr(again.limits, name))
    if robot.transmission is not None:
        assert [*map(vars, again.transmission.drives)] == [*map(vars, robot.transmission.drives)]


def test_built_in_and_public_robots() -> None:
    arms = [arm for arm in ARMS if arm.id in SOME]
    assert len(arms) == len(SOME)
    for robot in (*map(built_in, built_in_names()), *(read_urdf(arm.path, base=arm.base, tip=arm.tip) for arm in arms)):
        assert_same(robot)


def test_everything_that_our_own_format_can_say(tmp_path: Path) -> None:
    (tmp_path / "screws.yaml").write_text(SCREWS)
    assert_same(load_robot(str(tmp_path / "screws.yaml")))


@pytest.mark.parametrize("moving", [[0, 1, 2], [0, 2], [3], [1, 4]])
def test_robots_with_resting_joints(moving: list[int]) -> None:
    held = with_locked_joints(built_in("irp6"), moving, np.array([0.0, 0.1, 0.2, 0.3, 0.4]))
    assert held.sha256() != built_in("irp6").sha256()
    assert_same(held)


def _changed(description: dict[str, Any], value: object, *path: str | int) -> None:
    place: Any = description
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value


BROKEN: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "no joints": (lambda d: d.pop("joints"), "not a robot description: 'joints' is missing"),
    "no structure": (lambda d: d["structure"].pop("zero"), "not a robot description: 'zero' is missing"),
    "joints of text": (lambda d: _changed(d, "abc", "joints"), "not a robot description: "),
    "gear": (lambda d: _changed(d, "Magic", "transmission", "drives", 0, "ratio", "type"), "'Magic' is missing"),
    "crossed limits": (lambda d: _changed(d, [9.0] * 5, "limits", "lower"), "joint q1: lower position limit 9 must be"),
    "count": (lambda d: d["links"].pop(), "robot 'irp6': 5 joints, but 4 links and 5 limits"),
}


@pytest.mark.parametrize(("change", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_descriptions_are_refused_in_one_line(change: Callable[[dict[str, Any]], object], message: str) -> None:
    description = json.loads(json.dumps(built_in("irp6").description()))
    change(description)
    assert message in refusal(robot_from_description, description)
