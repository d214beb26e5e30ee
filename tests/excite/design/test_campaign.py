"""Campaigns of partial motions, required parameters, and the motions that a search may start from."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from excite import DifferentialModel
from excite.design.campaign import plan_campaign
from excite.design.formulation import formulate
from excite.design.initial_guesses import candidates, shaped_motion
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in

IRP6 = built_in("irp6")


def test_fewest_motions_of_two_drives_show_all_thirteen() -> None:
    found = plan_campaign(Task("irp6", model="energy").changed(robot=IRP6), at_once=2)
    assert (found.rank, len(found.steps)) == (13, 2)
    shown = [name for step in found.steps for name in step.parameters]
    assert sorted(shown) == sorted([*(f"X{k}" for k in range(1, 8)), "F1c", "F2c", "F3c", "F1v", "F2v", "F3v"])
    ranks = dict(found.subsets)
    assert [ranks[drives] for drives in (("z2",), ("z3",), ("z1", "z3"), ("z2", "z3"))] == [4, 4, 8, 8]


def test_one_drive_at_a_time_is_not_enough() -> None:
    with pytest.raises(InputError, match=r"at most 1 drive.* do not identify all 13 parameters; allow 2 at once"):
        plan_campaign(Task("irp6", model="energy").changed(robot=IRP6), at_once=1)


def test_all_drives_at_once_are_one_motion() -> None:
    assert len(plan_campaign(Task("irp6", model="energy").changed(robot=IRP6), at_once=3).steps) == 1


def test_more_drives_at_once_than_there_are() -> None:
    with pytest.raises(InputError, match="`at_once` must be from 1 to the 3 drives, given 4"):
        plan_campaign(Task("irp6").changed(robot=IRP6), at_once=4)


def test_required_parameter_that_the_motion_does_not_show_is_named_with_a_cure() -> None:
    with pytest.raises(InputError, match="X5 is not identifiable from motions of z2; move z1, z3, which identifies it"):
        formulate(IRP6, Task("irp6", model="energy", drives=("2",), require=("X5",)))
    with pytest.raises(UnknownName, match="no parameter named 'X9'"):
        formulate(IRP6, Task("irp6", require=("X9",)))
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


def test_number_of_shapes_must_fit() -> None:
    with pytest.raises(InputError, match="start: expected one initial guess, or 3 for q1, q2, q3"):
        formulate(IRP6, Task("irp6", start=("cosine", "sines")))


@pytest.mark.parametrize("model", ["energy", "differential"])
def test_the_model_of_a_robot_is_an_option(model: str) -> None:
    campaign = plan_campaign("irp6", model=model)
    assert (campaign.model, campaign.rank) == (model, 13)


def test_the_first_argument_by_its_former_name_warns() -> None:
    with pytest.warns(DeprecationWarning, match=r"plan_campaign\(model=\.\.\.\) is now plan_campaign") as said:
        campaign = plan_campaign(model="irp6")
    assert (campaign.model, said[0].filename) == ("energy", __file__)


@pytest.mark.parametrize(
    ("given", "options", "message"),
    [
        ((), {}, "`plan_campaign` needs a robot, a model or a task as its first argument"),
        ((DifferentialModel(IRP6),), {"model": "energy"}, "a model is given already; give one of them"),
    ],
)
def test_first_arguments_that_are_refused(given: tuple[Any, ...], options: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        plan_campaign(*given, **options)
