"""A robot back from its plain description: the same robot, whichever reader made it, and whatever was asked of it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from public_arms import ARMS, Arm

from regressors.errors import InputError
from regressors.readers.library import built_in, built_in_names, load_robot
from regressors.robot.archive import robot_from_description
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Robot

SOME = ("panda-hand", "ur10", "kinova", "tiago-torso-arm", "baxter-left", "icub-left-arm", "double-pendulum", "go2-leg")
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
        assert again.transmission is not None
        assert again.transmission.drives == robot.transmission.drives or all(
            vars(a) == vars(b) for a, b in zip(again.transmission.drives, robot.transmission.drives, strict=True)
        )


@pytest.mark.parametrize("name", built_in_names())
def test_built_in_robots(name: str) -> None:
    assert_same(built_in(name))


@pytest.mark.parametrize("arm", [arm for arm in ARMS if arm.id in SOME], ids=str)
def test_public_robots(arm: Arm) -> None:
    assert_same(load_robot(str(arm.path), base=arm.base, tip=arm.tip))


def test_some_are_there() -> None:
    assert len([arm for arm in ARMS if arm.id in SOME]) == len(SOME)


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
    "no gravity": (lambda d: d.pop("gravity"), "not a robot description: 'gravity' is missing"),
    "no structure": (lambda d: d["structure"].pop("zero"), "not a robot description: 'zero' is missing"),
    "joints of text": (lambda d: _changed(d, "abc", "joints"), "not a robot description: "),
    "no list": (lambda d: _changed(d, 3, "joints"), "not a robot description: "),
    "another field": (lambda d: _changed(d, 3, "joints", 0, "wheels"), "not a robot description: "),
    "limits of text": (lambda d: _changed(d, ["x"] * 5, "limits", "lower"), "not a robot description: "),
    "limits of nothing": (lambda d: _changed(d, None, "limits"), "not a robot description: "),
    "gear": (lambda d: _changed(d, "Magic", "transmission", "drives", 0, "ratio", "type"), "'Magic' is missing"),
    "crossed limits": (lambda d: _changed(d, [9.0] * 5, "limits", "lower"), "joint q1: lower position limit 9 must be"),
    "count": (lambda d: d["links"].pop(), "robot 'irp6': 5 joints, but 4 links and 5 limits"),
}


@pytest.mark.parametrize(("change", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_descriptions_are_refused_in_one_line(change: Callable[[dict[str, Any]], object], message: str) -> None:
    description = json.loads(json.dumps(built_in("irp6").description()))
    change(description)
    with pytest.raises(InputError) as refused:
        robot_from_description(description)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
