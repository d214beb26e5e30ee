"""Objects and constraints of a user's own, campaigns of partial motions, and the first argument of both."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Here
from designed import short
from written_files import saved

import excite
from constraints.geometry import HalfSpace, Obstacle, Part, World
from excite.design.campaign import plan_campaign
from excite.design.formulation import formulate
from excite.design.initial_guesses import candidates, shaped_motion
from excite.registry import OwnPart
from excite.tasks.criteria import ConditionNumber, Trace
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.models.base import random_states
from regressors.readers.library import built_in
from regressors.robot.shapes import Capsule


class Negative(ConditionNumber):
    """Leads away from the minimum."""

    def smooth(self, M: Any, sharpness: float) -> tuple[float, Any]:
        value, G = super().smooth(M, sharpness)
        return value, -G


class Halved(Trace):
    """A factor forgotten."""

    def smooth(self, M: Any, sharpness: float) -> tuple[float, Any]:
        value, G = super().smooth(M, sharpness)
        return value, G / 2


class Flat(Trace):
    """A gradient of another shape."""

    def smooth(self, M: Any, sharpness: float) -> tuple[float, Any]:
        value, G = super().smooth(M, sharpness)
        return value, G.ravel()


SEARCH = excite.Search(starts=1, executor="serial")


@pytest.mark.parametrize(
    ("criterion", "message"),
    [
        (Negative(), "gradient that `smooth` returns is not that of its value: .* check its sign"),
        (Halved(), "gradient that `smooth` returns is not that of its value"),
        (Flat(), r"must return a number and a gradient of shape \(13, 13\)"),
    ],
    ids=lambda given: type(given).__name__,
)
def test_a_gradient_that_is_none_is_refused_before_the_search(criterion: excite.Criterion, message: str) -> None:
    with pytest.raises(excite.InputError, match=f"criterion .*{type(criterion).__name__}: .*{message}"):
        excite.design_trajectory("irp6", period=4, criterion=criterion, search=SEARCH)


design = excite.design_trajectory
WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "lambda as criterion": (lambda: design("irp6", criterion=lambda M: 1.0), "criterion: expected"),
    "lambda as limit": (lambda: design("irp6", constraints=[lambda q: q]), "constraints: expected a list, each a Lim"),
    "no list": (lambda: design("irp6", constraints=excite.TorqueLimit(0.1)), "constraints: expected a list"),
    "lambda as model": (lambda: excite.Task("irp6", model=lambda robot: robot), "model: expected a RegressorModel"),
    "a design to verify": (lambda: excite.verify(short(), "x.csv"), "result: expected a result of `identify`"),
    "no friction curves": (lambda: excite.Task("irp6", friction_curves=object()), "friction_curves: expected curves"),
    "an array of drives": (lambda: excite.Task("irp6", friction=np.array([1.0, 2.0])), "friction: expected all, none"),
    "no solver": (lambda: excite.Search(solver=object()), "solver: expected a Solver"),
    "no executor": (lambda: excite.Search(executor=object()), "executor: expected a function"),
}


def test_what_is_no_part_is_refused_by_name() -> None:
    for call, message in WRONG.values():
        with pytest.raises(excite.InputError, match=f"^{message}"):
            call()


def table() -> World:
    """The tool of the robot above a table."""
    parts = (Part(short().robot.links[-1].name, Capsule((0.0,) * 3, (0.05, 0.0, 0.0), 0.02)),)
    return World(parts, (Obstacle("table", HalfSpace((0.0, 0.0, 1.0), -5.0)),))


@pytest.mark.parametrize("world", [False, True], ids=["default limits", "above a table"])
@pytest.mark.parametrize("again", [lambda design: pickle.loads(pickle.dumps(design)), copy.deepcopy])
def test_a_design_is_copied_and_sent_to_other_processes(again: Callable[[Any], Any], world: bool) -> None:
    design = excite.design_trajectory("irp6", period=4, search=SEARCH, world=table()) if world else short()
    other = again(design)
    states = random_states(design.robot, 5)
    assert other.condition_number == design.condition_number
    assert len(other.nonlinear) == len(design.nonlinear) > 0
    for limit, same in zip(design.nonlinear, other.nonlinear, strict=True):
        few = limit.joints
        moving = excite.Samples(states.time, *(getattr(states, x)[:, :few] for x in ("q", "dq", "ddq", "dddq")))
        assert np.array_equal(same.shown(same.values(moving)), limit.shown(limit.values(moving)))


# --- the first argument has no name, so that ``model`` is the option of a task


@pytest.mark.parametrize("call", [excite.design_trajectory, excite.plan_campaign])
def test_the_model_of_a_robot_or_a_task_is_an_option(call: Callable[..., Any]) -> None:
    quick = {"search": SEARCH, "harmonics": 3, "period": 4.0} if call is excite.design_trajectory else {}

    def model_of(made: Any) -> Any:
        return made.model if call is excite.plan_campaign else type(made.target.model)

    for given in ("irp6", excite.Task("irp6", harmonics=3)):
        assert model_of(call(given, model="energy", **quick)) in ("energy", excite.EnergyModel)
    with pytest.raises(excite.InputError, match="a model is given already; give one of them"):
        call(excite.DifferentialModel(excite.load_robot("irp6")), model="energy")


TASK = excite.Task("irp6", harmonics=2, friction=False, starts=1, executor="serial")


def test_a_constraint_by_name_is_found_again(tmp_path: Path) -> None:
    design = excite.design_trajectory(TASK.changed(constraints=("torque",)))
    stored = excite.load_design(saved(tmp_path / "design", design))
    assert stored.task == design.task
    again = excite.design_trajectory(stored.task)
    assert again.trajectory.x.tobytes() == design.trajectory.x.tobytes()
    assert "drive z1 torque" in {use.label for use in again.limits}


def test_numbers_of_an_object_are_not_in_the_file_so_it_is_given_again(tmp_path: Path) -> None:
    limit = excite.TorqueLimit(margin=0.2)
    design = excite.design_trajectory(TASK.changed(constraints=(limit,)))
    design.save(tmp_path / "design")
    place = "constraints.torque:TorqueLimit"
    stored = excite.load_design(tmp_path / "design")
    (named,) = stored.task.limits.constraints
    assert isinstance(named, OwnPart)
    assert named.name == place
    with pytest.raises(InputError, match=r"not built in.*such as constraints=\[TorqueLimit\]"):
        excite.design_trajectory(stored.task)
    assert excite.load_design(tmp_path / "design", constraints=[limit]).task == design.task


def test_a_built_in_limit_that_needs_numbers_says_so(here: Here) -> None:
    for name, missing in (("tool-box", "lower, upper"), ("tool-speed", "speed")):
        said = here.refused("design", "irp6", "--constraint", name, "--out", "out")
        assert f"constraint {name} needs its {missing}: in Python give an object with them" in said


IRP6 = built_in("irp6")


def test_as_many_drives_at_once_as_there_are_or_need_be() -> None:
    task = Task("irp6", model="energy").changed(robot=IRP6)
    found = plan_campaign(task, at_once=2)
    assert (found.rank, len(found.steps)) == (13, 2)
    shown = [name for step in found.steps for name in step.parameters]
    assert sorted(shown) == sorted([*(f"X{k}" for k in range(1, 8)), "F1c", "F2c", "F3c", "F1v", "F2v", "F3v"])
    ranks = dict(found.subsets)
    assert [ranks[drives] for drives in (("z2",), ("z3",), ("z1", "z3"), ("z2", "z3"))] == [4, 4, 8, 8]
    assert len(plan_campaign(task, at_once=3).steps) == 1
    with pytest.raises(InputError, match=r"at most 1 drive.* do not identify all 13 parameters; allow 2 at once"):
        plan_campaign(task, at_once=1)
    with pytest.raises(InputError, match="`at_once` must be from 1 to the 3 drives, given 4"):
        plan_campaign(task, at_once=4)


def test_required_parameter_that_the_motion_does_not_show_is_named_with_a_cure() -> None:
    for options, message in (
        ({"drives": ("2",), "require": ("X5",)}, "X5 is not identifiable from motions of z2; move z1, z3, which ident"),
        ({"require": ("X9",)}, "no parameter named 'X9'"),
        ({"start": ("cosine", "sines")}, "start: expected one initial guess, or 3 for q1, q2, q3"),
        ({"window_length": 20.0}, "a window of 20 s is longer than the motion of 10 s"),
    ):
        with pytest.raises((InputError, UnknownName), match=message):
            formulate(IRP6, Task("irp6", model="energy", **options))
    formulate(IRP6, Task("irp6", model="energy", drives=("1", "3"), require=("X5", "F3c")))


@pytest.mark.parametrize("kinds", [("cosine",), ("quintic", "quintic", "cosine"), ("sines",)])
def test_shaped_motion_is_inside_the_limits_and_uses_them(kinds: tuple[str, ...]) -> None:
    problem = formulate(IRP6, Task("irp6", start=kinds)).problem
    x = shaped_motion(problem, kinds)
    assert -0.1 < problem.violation(x) <= 0.0
    first = candidates(problem, 0, np.random.default_rng(0))
    later = candidates(problem, 1, np.random.default_rng(0))
    np.testing.assert_array_equal(first[0], x)
    assert len(first) == 1
    assert len(later) == 3
    assert all(problem.violation(motion) <= 0.0 for motion in later)
