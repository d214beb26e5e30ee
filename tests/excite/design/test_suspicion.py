"""What is said where no motion within the limits is found: the description first, and no limit that is not used."""

from __future__ import annotations

from pathlib import Path

import pytest

import excite
from constraints.certificate import LimitUse
from constraints.diagnosis import ContradictionError
from excite.design.task_checks import suspecting, unidentifiable
from excite.errors import NoFeasibleMotionError
from regressors.errors import InputError
from regressors.readers.library import built_in
from regressors.robot.finding import Finding
from regressors.robot.robot import Joint


def use(part: float) -> LimitUse:
    return LimitUse("joint j2 velocity", "rad/s", 2 * part, 1.0, 2.0, 2 - 2 * part, part)


@pytest.mark.parametrize("part", [0.0, 0.5, 0.9])
def test_no_limit_is_to_be_widened_that_is_used_at_90_percent_or_less(part: float) -> None:
    message = unidentifiable((use(part), use(part / 2)))
    assert "widen" not in message
    assert f"joint j2 velocity, is used at {100 * part:.0f} %" in message
    assert "`harmonics`" in message


def test_a_limit_in_the_way_is_named() -> None:
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


def test_an_angle_as_if_rounded_is_suspicious() -> None:
    robot = built_in("ur10e")
    first, second = robot.joints[:2]
    rounded = Joint.from_mdh(second.name, "revolute", alpha=1.57, a=0.0)
    with (
        pytest.raises(NoFeasibleMotionError) as caught,
        suspecting(robot.replace(joints=(first, rounded, *robot.joints[2:]))),
    ):
        raise NoFeasibleMotionError("no motion")
    assert "0.0008 rad from a right angle to that of joint" in str(caught.value)
    assert str(caught.value).endswith("; state angles exactly; no motion")


def test_a_description_without_doubts_and_other_errors_stay_as_they_are() -> None:
    for error in (NoFeasibleMotionError("no motion"), InputError("bad")):
        with pytest.raises(type(error)) as caught, suspecting(built_in("ur10e")):
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
