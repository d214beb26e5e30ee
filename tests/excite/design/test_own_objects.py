"""Objects of a user's own in the search: what is no part is refused by name; designs with them are copied and sent."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from designed import short

import excite
from constraints.geometry import HalfSpace, Obstacle, Part, World
from excite.tasks.criteria import ConditionNumber, Trace
from regressors.models.base import random_states
from regressors.robot.shapes import Capsule


class Right(Trace):
    """A built-in criterion under another name."""


class Negative(ConditionNumber):
    """Leads away from the minimum."""

    def smooth(self, M: Any, sharpness: float) -> tuple[float, Any]:
        value, G = super().smooth(M, sharpness)
        return value, -G


class Halved(Right):
    """A factor forgotten."""

    def smooth(self, M: Any, sharpness: float) -> tuple[float, Any]:
        value, G = super().smooth(M, sharpness)
        return value, G / 2


class Flat(Right):
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


def test_a_right_gradient_is_searched_with() -> None:
    assert excite.design_trajectory("irp6", period=4, criterion=Right(), search=SEARCH).feasible


WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "a lambda as criterion": (lambda: excite.design_trajectory("irp6", criterion=lambda M: 1.0), "criterion: expected"),  # type: ignore[arg-type]
    "a lambda as constraint": (
        lambda: excite.design_trajectory("irp6", constraints=[lambda q: q]),  # type: ignore[list-item]
        "constraints: expected a list, each a Limit or text",
    ),
    "a limit not in a list": (
        lambda: excite.design_trajectory("irp6", constraints=excite.TorqueLimit(0.1)),  # type: ignore[arg-type]
        "constraints: expected a list",
    ),
    "a lambda as model": (lambda: excite.Task("irp6", model=lambda robot: robot), "model: expected a RegressorModel"),
    "a design to verify": (lambda: excite.verify(short(), "x.csv"), "result: expected a result of `identify`"),  # type: ignore[arg-type]
    "an array of drives": (lambda: excite.Task("irp6", friction=np.array([1.0, 2.0])), "friction: expected all, none"),
    "an array without axes": (lambda: excite.Task("irp6", gravity=np.array(2.0)), "gravity: expected three numbers"),
    "no friction curves": (lambda: excite.Task("irp6", friction_curves=True), "friction_curves: expected curves"),
    "an own solver that is none": (lambda: excite.Search(solver=object()), "solver: expected a Solver"),  # type: ignore[arg-type]
    "an executor that is none": (lambda: excite.Search(executor=object()), "executor: expected a function"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_part_is_refused_by_name(case: str) -> None:
    call, message = WRONG[case]
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
