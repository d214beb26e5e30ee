"""The robot description: what it refuses, its plain form, and the hash that identifies it."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regressors.errors import InputError, UnknownName
from regressors.readers.description import parse_description
from regressors.readers.library import built_in, built_in_names
from regressors.robot.gears import BallScrew, ConstantRatio
from regressors.robot.robot import Aggregates, Drive, Joint, Limits, Link, Robot, Structure, Transmission

INF, NAN = np.inf, np.nan
THETA = [2.0, 0.1, 0.0, 0.0, 0.1, 0.0, 0.0, 0.2, 0.0, 0.2]
TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def joint(name: str = "a", kind: Any = "revolute", **changes: Any) -> Joint:
    return Joint(**{"name": name, "kind": kind, "rotation": np.eye(3), "translation": np.zeros(3), **changes})


def limits(n: int = 2, **changes: Any) -> Limits:
    fields = {
        "lower": [-1.0] * n,
        "upper": [1.0] * n,
        **{name: [INF] * n for name in ("velocity", "acceleration", "jerk", "torque")},
    }
    return Limits(**{**fields, **changes})


def transmission(**changes: Any) -> Transmission:
    drives = (Drive("y", ConstantRatio(50.0), 1e-4, 2.0, 3.0), Drive("z", BallScrew(0.005, 0.08, -0.03, 0.05)))
    return Transmission(
        **{"coupling": [[1.0, 0.0], [0.5, 1.0]], "drives": drives, "limits": limits(), "offset": [0.0, 0.1], **changes}
    )


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
    (lambda: robot(limits=limits(3)), "robot 'two': 2 joints, but 2 links and 3 limits"),
    (lambda: robot(joints=(joint("a"), joint("a"))), "robot 'two': two joints share a name: a, a"),
    (lambda: robot(gravity=[0.0, 9.81]), "gravity: expected shape (3,), given (2,)"),
    (
        lambda: robot(gravity=[0.0, 0.0, NAN]),
        "robot 'two': gravity must hold three finite numbers, given [0.0, 0.0, nan]",
    ),
    (lambda: robot(transmission=transmission(coupling=np.eye(2)[:, :1])), "the coupling must have 2 columns, one per"),
    (lambda: robot(limits=limits(lower=[-1.0, 1.0])), "joint b: lower position limit 1 must be below the upper one 1"),
    (lambda: robot(limits=limits(lower=[2.0, -1.0])), "joint a: lower position limit 2 must be below the upper one 1"),
    (lambda: robot(limits=limits(lower=[-INF, -1.0])), "joint a: position limits must be two or none, given -inf and"),
    (lambda: robot(limits=limits(velocity=[0.0, 1.0])), "joint a: velocity limit must be greater than zero, given 0"),
    (lambda: robot(limits=limits(acceleration=[1.0, -1.0])), "joint b: acceleration limit must be greater than zero,"),
    (lambda: robot(limits=limits(jerk=[1.0, 0.0])), "joint b: jerk limit must be greater than zero, given 0"),
    (lambda: robot(limits=limits(torque=[-INF, 1.0])), "joint a: torque limit must be greater than zero, given -inf"),
    (lambda: robot(transmission=transmission(limits=limits(velocity=[1.0, 0.0]))), "drive z: velocity limit must be g"),
    (lambda: limits(upper=[1.0, NAN]), "limit upper: NaN at number 2 is not a number"),
    (lambda: limits(velocity=[NAN, 1.0]), "limit velocity: NaN at number 1 is not a number"),
    (lambda: limits(velocity=[1.0]), "limit velocity: expected shape (2,), given (1,)"),
    (lambda: joint(kind="floating"), "joint 'a': kind must be revolute or prismatic, given 'floating'"),
    (lambda: joint(rotation=np.eye(2)), "joint 'a', rotation: expected shape (3, 3), given (2, 2)"),
    (lambda: joint(rotation=2 * np.eye(3)), "joint 'a': rotation is not a rotation matrix"),
    (lambda: joint(rotation=np.diag([1.0, 1.0, -1.0])), "joint 'a': rotation is not a rotation matrix"),
    (lambda: joint(rotation=np.full((3, 3), NAN)), "joint 'a': rotation is not a rotation matrix"),
    (lambda: joint(axis=[0.0, 0.0, 2.0]), "joint 'a': axis must have length 1, given 2"),
    (lambda: joint(axis=[0.0, 0.0, 0.0]), "joint 'a': axis must have length 1, given 0"),
    (lambda: joint(translation=[0.0, 0.0, INF]), "joint 'a': translation must be finite, given [0.0, 0.0, inf]"),
    (lambda: Link("l", [1.0] * 9), "link 'l', inertial parameters: expected shape (10,), given (9,)"),
    (lambda: Link("l", [NAN] * 10), "link 'l': inertial parameters must be finite"),
    (lambda: transmission(coupling=np.eye(3)), "2 drives need as many coupling rows and limits, given a coupling of s"),
    (lambda: transmission(limits=limits(1)), "2 drives need as many coupling rows and limits"),
    (lambda: transmission(coupling=[1.0, 2.0]), "given a coupling of shape (2,)"),
    (lambda: transmission(coupling=[[1.0, NAN], [0.0, 1.0]]), "transmission: the coupling matrix must hold finite num"),
    (lambda: transmission(offset=[1.0]), "transmission, offset: expected shape (2,), given (1,)"),
    (lambda: ConstantRatio(0.0), "gear ratio must be a finite number other than zero, given 0.0"),
    (lambda: ConstantRatio(NAN), "gear ratio must be a finite number other than zero, given nan"),
    (lambda: BallScrew(0.0, 0.08, 0.01, 0.01), "ball screw: pitch must be greater than zero, given 0"),
    (lambda: BallScrew(0.005, 0.01, 0.03, 0.04), "ball screw: no triangle has squared length 0.01 +- 0.05 m^2"),
)


@pytest.mark.parametrize(("make", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_refuses_and_says_why(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError) as refused:
        make()
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_robots_that_the_cases_start_from_are_accepted() -> None:
    assert robot().n == 2
    assert robot(limits=limits(lower=[-INF, -1.0], upper=[INF, 1.0])).limits.lower[0] == -INF


def test_joints_by_name_and_by_number() -> None:
    made = robot(joints=(joint("2"), joint("b")))
    assert [made.joint_index(name) for name in ("2", "b", "1")] == [0, 1, 0]  # a name goes before a number
    for name in ("0", "3", "-1", "c", "", "\N{SUPERSCRIPT TWO}", "\N{ARABIC-INDIC DIGIT TWO}x"):
        with pytest.raises(UnknownName) as refused:
            made.joint_index(name)
        assert str(refused.value) == f"no joint named {name!r}; available: 1 (2), 2 (b)"
    with pytest.raises(UnknownName, match=r"no joint named '9{50,}\.\.\.9999'; available: 1 \(2\), 2 \(b\)"):
        made.joint_index("9" * 5000)


def test_arrays_cannot_be_written_nor_share_memory_with_what_was_given() -> None:
    lower = np.array([-1.0, -1.0])
    made = robot(limits=limits(lower=lower))
    lower[0] = 5.0
    assert made.limits.lower[0] == -1.0
    assert made.transmission is not None
    for array in (made.limits.lower, made.gravity, made.joints[0].rotation, made.transmission.coupling):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    assert made.links[0].theta is not None
    with pytest.raises(ValueError, match="read-only"):
        made.links[0].theta[0] = 1.0
    with pytest.raises(TypeError):
        made.constants["l1"] = 1.0  # type: ignore[index]


def test_replace_checks_again() -> None:
    assert robot().replace(name="other").name == "other"
    with pytest.raises(InputError, match="greater than zero"):
        robot().replace(limits=limits(velocity=[0.0, 1.0]))


# Plain form and hash


def plain_types(content: object) -> bool:
    if isinstance(content, dict):
        return all(isinstance(key, str) and plain_types(item) for key, item in content.items())
    if isinstance(content, list):
        return all(map(plain_types, content))
    return content is None or type(content) in (str, int, float, bool)


@pytest.mark.parametrize("made", [robot(), *map(built_in, built_in_names())], ids=lambda made: made.name)
def test_description_is_plain_and_survives_json(made: Robot) -> None:
    description = made.description()
    assert plain_types(description)
    text = json.dumps(description, allow_nan=False)
    assert json.loads(text) == description
    assert made.description() == description


def test_hash_is_sha256_and_stable() -> None:
    assert robot().sha256() == robot().sha256()
    assert len(robot().sha256()) == 64
    assert int(robot().sha256(), 16) >= 0
    # Files hold this hash: another value means that designs of before can no longer be read.
    assert (
        Robot("one", (joint("a"),), (Link("l"),), Limits.none(1)).sha256()
        == "784726262dade9f70f304253d93f52449344c360f1d9b6660cc085e0464bb392"
    )


def test_hash_does_not_depend_on_where_and_how_the_robot_is_written() -> None:
    text = (
        "name: one\nconstants: {l: 0.5, n: 3}\njoints:\n"
        "  - {name: a, mdh: {d: 1.0, a: 0.5}, limits: {velocity: 180 deg/s}}\n"
    )
    other = (
        "# the same robot\njoints:\n- limits:\n    velocity: 3.141592653589793\n  mdh: {a: 5.0e-1, d: 1}\n  name: 'a'\n"
        "constants: {n: 3.0, l: 0.50}\nname: one\nsource: somewhere else\n"
    )
    a, b = parse_description(text, "a.yaml"), parse_description(other, "b.yaml")
    assert a.source != b.source
    assert a.sha256() == b.sha256()
    assert robot(source="elsewhere").sha256() == robot().sha256()
    structure = robot().structure
    again = Structure(frozenset(sorted(structure.zero, reverse=True)), structure.equal, structure.aggregates)
    assert robot(structure=again).sha256() == robot().sha256()


def _structure(**changes: Any) -> Structure:
    base = robot().structure
    fields = {"zero": base.zero, "equal": base.equal, "aggregates": base.aggregates}
    return Structure(**{**fields, **changes})


def _drive(**changes: Any) -> Transmission:
    first, second = transmission().drives
    fields = {name: getattr(first, name) for name in ("name", "ratio", "rotor_inertia", "coulomb", "viscous", "rests")}
    return transmission(drives=(Drive(**{**fields, **changes}), second))


CHANGED: dict[str, Callable[[], Robot]] = {
    "name": lambda: robot(name="three"),
    "joint name": lambda: robot(joints=(joint("c"), robot().joints[1])),
    "joint kind": lambda: robot(joints=(joint("a", "prismatic"), robot().joints[1])),
    "rotation": lambda: robot(joints=(joint("a", rotation=TURNED), robot().joints[1])),
    "translation": lambda: robot(joints=(joint("a", translation=[0.0, 0.0, 1e-12]), robot().joints[1])),
    "axis": lambda: robot(joints=(joint("a", axis=[0.0, 1.0, 0.0]), robot().joints[1])),
    "order of joints": lambda: robot(joints=robot().joints[::-1]),
    "link name": lambda: robot(links=(Link("lc", THETA), Link("lb"))),
    "link number": lambda: robot(links=(Link("la", THETA, 3), Link("lb"))),
    "theta": lambda: robot(links=(Link("la", [np.nextafter(2.0, 3.0), *THETA[1:]]), Link("lb"))),
    "unknown theta": lambda: robot(links=(Link("la"), Link("lb"))),
    "zero theta": lambda: robot(links=(Link("la", THETA), Link("lb", [0.0] * 10))),
    "lower": lambda: robot(limits=limits(lower=[-1.1, -1.0])),
    "upper": lambda: robot(limits=limits(upper=[1.0, 1.1])),
    **{
        name: (lambda name=name: robot(limits=limits(**{name: [5.0, INF]})))  # type: ignore[misc]
        for name in ("velocity", "acceleration", "jerk", "torque")
    },
    "no transmission": lambda: robot(transmission=None),
    "coupling": lambda: robot(transmission=transmission(coupling=np.eye(2))),
    "offset": lambda: robot(transmission=transmission(offset=[0.0, 0.2])),
    "drive limits": lambda: robot(transmission=transmission(limits=limits(velocity=[1.0, 1.0]))),
    "drive name": lambda: robot(transmission=_drive(name="w")),
    "drive ratio": lambda: robot(transmission=_drive(ratio=ConstantRatio(51.0))),
    "drive gear": lambda: robot(transmission=_drive(ratio=BallScrew(0.005, 0.08, -0.03, 0.05))),
    "rotor": lambda: robot(transmission=_drive(rotor_inertia=2e-4)),
    "no rotor": lambda: robot(transmission=_drive(rotor_inertia=None)),
    "coulomb": lambda: robot(transmission=_drive(coulomb=None)),
    "viscous": lambda: robot(transmission=_drive(viscous=0.0)),
    "rests": lambda: robot(transmission=_drive(rests=True)),
    "gravity": lambda: robot(gravity=[0.0, 0.0, -9.80665]),
    "zero": lambda: robot(structure=_structure(zero=frozenset({"m1c1y"}))),
    "equal": lambda: robot(structure=_structure(equal=())),
    "aggregate": lambda: robot(structure=_structure(aggregates=(Aggregates(("a", "b"), {"X1": {"I1zz": 1.0}}),))),
    "aggregate joints": lambda: robot(
        structure=_structure(aggregates=(Aggregates(("a",), {"X1": {"I1zz": 1.0, "m2": 0.25}}),))
    ),
    "constant": lambda: robot(constants={"l1": 0.6}),
    "constant name": lambda: robot(constants={"l2": 0.5}),
}


def test_hash_changes_with_everything() -> None:
    hashes = {name: make().sha256() for name, make in CHANGED.items()}
    hashes["as it was"] = robot().sha256()
    assert len(set(hashes.values())) == len(hashes)


@given(st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_hash_is_equal_just_where_the_numbers_are(a: float, b: float) -> None:
    first, second = (robot(limits=limits(velocity=[x, 1.0])).sha256() for x in (a, b))
    assert (first == second) == (a == b)
