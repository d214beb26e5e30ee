"""Limits that a description states hold by default, and what is not checked is said."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from public_arms import robots_folder

import excite
from constraints.feasibility.diagnosis import ContradictionError
from excite.design.formulation import formulate
from excite.design.stated_limits import shape_of
from excite.design.unchecked import Unchecked, checked_text, kept_text
from excite.files.design_json import load_design
from excite.files.task_file import task_content, task_from_options
from regressors.errors import InputError
from regressors.readers.library import built_in
from regressors.robot.robot import Limits, Robot

SHORT = {"harmonics": 3, "period": 5.0, "rate": 50.0, "starts": 2, "executor": "serial"}
UR = {"velocity": (1.5,), "acceleration": (8.0,), "joints": ("1", "2", "3"), **SHORT}


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
    assert any("keeps 10 % of the torque limits in reserve" in note for note in kept.notes)
    assert kept.feasible
    assert kept.condition_number < 1.5 * free.condition_number  # it may be less: both are local minima


def test_a_motion_that_keeps_them_is_the_same_as_without_them() -> None:
    free, kept = (excite.design_trajectory(excite.Task("ur10e", torque_margin=m, **UR)) for m in ("none", "auto"))
    np.testing.assert_array_equal(free.trajectory.x, kept.trajectory.x)
    assert any("torque" in use.label for use in kept.limits)
    assert not any("torque" in use.label for use in free.limits)


@pytest.mark.parametrize(
    ("robot", "reason"),
    [
        (built_in("iiwa7"), "no mass is stated"),
        (built_in("ur10e").replace(limits=dataclasses.replace(built_in("ur10e").limits, torque=np.full(6, np.inf))),
         "no limit is stated"),
        (built_in("ur10e").replace(links=tuple(dataclasses.replace(link, theta=built_in("ur10e").links[0].theta)
                                               for link in built_in("ur10e").links)),
         "mass and inertia equal those of other links"),
    ],
    ids=["unknown masses", "no limits", "placeholders"],
)  # fmt: skip
def test_what_cannot_be_checked_is_said(robot: Robot, reason: str) -> None:
    made = formulate(robot, excite.Task(robot, **{**UR, "joints": ("1", "2")}))
    reasons = {each.limit: each.reason for each in made.unchecked}
    assert reason in reasons["torque"]
    assert made.stated == ()
    assert "every limit that was checked is kept; not checked:" in kept_text(made.unchecked)
    assert reasons["obstacles"] == "no world file is given"
    with pytest.raises(InputError):
        formulate(robot.replace(limits=Limits.none(robot.n)), excite.Task(robot, torque_margin=0.1, **UR))


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ("irp6", "irp6 is built in"),
        ("arm.xacro", "arm.xacro is not one"),
        (weak(95.0), "the robot is given as an object"),
    ],
    ids=["built in", "xacro", "object"],
)
def test_shapes_that_were_not_looked_for_are_not_denied(given: Robot | str, reason: str) -> None:
    shape = shape_of(excite.Task(given))
    assert isinstance(shape, Unchecked)
    assert shape.reason.startswith(f"shapes are taken from URDF files only, and {reason}")


def test_nothing_to_say_is_said_plainly() -> None:
    assert kept_text(()) == "every limit is kept"
    text = kept_text((Unchecked("jerk", "no limit is stated"), Unchecked("obstacles", "why")))
    assert text == "every limit that was checked is kept; not checked: jerk (no limit is stated), obstacles (why)"


def test_what_was_checked_is_counted_by_kind() -> None:
    quantities = ["wrench", "distance", "torque", "position", "distance", "tool", "jerk", "position"]
    assert checked_text(quantities) == "position (2), jerk (1), torque (1), tool (1), distance (2), wrench (1)"
    assert checked_text(()) == ""
    assert kept_text((), ("torque",)) == "every limit is kept; checked: torque (1)"
    text = kept_text((Unchecked("jerk", "no limit is stated"),), ("tool",))
    end = "not checked: jerk (no limit is stated); checked: tool (1)"
    assert text == f"every limit that was checked is kept; {end}"


def test_the_verdict_says_what_the_designs_limits_are() -> None:
    made = excite.design_trajectory(excite.Task("irp6", starts=1, harmonics=2, executor="serial"))
    assert made.feasible
    assert {use.label.split()[-1] for use in made.limits} == {"position", "velocity", "acceleration", "torque"}
    assert checked_text(use.quantity for use in made.limits) == (
        "position (5), velocity (4), acceleration (4), torque (5)"
    )


def test_torques_that_no_pose_allows_are_named_with_what_is_missing() -> None:
    heavy = excite.Installation(payload=(900.0, 0.0, 0.0, 0.3)).applied(built_in("ur10e"))
    task = excite.Task(heavy, position=((-0.5, 0.5),) * 6, **UR)
    with pytest.raises(
        ContradictionError, match=r"shoulder_lift_joint torque beyond .* by .* Nm.*`torque_margin='none'`"
    ):
        formulate(heavy, task)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["slsqp", "ipopt"])
def test_a_solver_that_cannot_keep_them_is_named_with_the_remedy(solver: str) -> None:
    task = excite.Task(weak(60.0), **{**UR, "starts": 1}, solver=solver)
    with pytest.raises(
        excite.NoFeasibleMotionError,
        match=rf"torque at .*solver {solver} does not take .*`solver='sqp'` keeps it, `torque_margin='none'` leaves",
    ):
        excite.design_trajectory(task)


@pytest.mark.parametrize("margin", ["auto", "none", None, 0.2])
def test_the_choice_round_trips_through_a_task_file(margin: object) -> None:
    task = excite.Task("ur10e", torque_margin=margin)
    content = json.loads(json.dumps(task_content(task)))
    assert content["torque_margin"] == ("none" if margin is None else margin)
    assert task_from_options(content).limits == task.limits


def test_stored_tasks_of_older_files_keep_leaving_them_out() -> None:
    content = task_content(excite.Task("ur10e"))
    content["torque_margin"] = None
    assert task_from_options(content, stored=True).limits.torque_margin is None
    del content["torque_margin"]
    assert task_from_options(content, stored=True).limits.torque_margin is None
    assert task_from_options(content).limits.torque_margin == "auto"


@pytest.mark.parametrize("margin", ["often", True, -0.1, 1.0])
def test_margins_that_cannot_be_are_refused(margin: object) -> None:
    with pytest.raises(InputError, match="margin"):
        formulate(built_in("ur10e"), excite.Task("ur10e", torque_margin=margin, **UR))


def test_a_torque_limit_that_is_given_replaces_the_default() -> None:
    task = excite.Task("ur10e", constraints=(excite.TorqueLimit(margin=0.3),), **UR)
    made = formulate(built_in("ur10e"), task)
    assert made.stated == ()
    np.testing.assert_allclose(made.nonlinear[0].upper[1], 0.7 * 330.0)


@pytest.mark.slow
def test_contact_of_a_urdf_with_itself_is_avoided_where_the_motion_has_it(tmp_path: Path) -> None:
    folder = robots_folder()
    if folder is None:
        pytest.skip("example-robot-data is not installed")
    path = str(folder / "z1_description/urdf/z1.urdf")
    options = {"velocity": (2.0,), "acceleration": (8.0,), "joints": ("2", "3"), **SHORT}
    free = excite.design_trajectory(excite.Task(path, self_collision=False, **options))
    kept = excite.design_trajectory(excite.Task(path, **options))
    assert unchecked(free)["self-collision"] == "left out on request"
    assert "self-collision" not in unchecked(kept)
    distances = [use for use in kept.limits if use.unit == "m"]
    assert distances
    assert all(use.extreme >= 0.001 - 1e-9 for use in distances)
    kept.save(tmp_path)
    assert load_design(tmp_path).task.limits.self_collision
    assert [each["limit"] for each in load_design(tmp_path).content["unchecked"]] == [e.limit for e in kept.unchecked]
