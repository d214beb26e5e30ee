"""The first argument of a design has no name, so that ``model`` is the option of a task."""

from __future__ import annotations

import pytest

from excite import DifferentialModel, EnergyModel, Search, Task, design_trajectory, load_robot
from regressors.errors import InputError

QUICK = {"search": Search(starts=1, executor="serial"), "harmonics": 3, "period": 4.0}


def test_the_model_of_a_robot_or_a_task_is_an_option() -> None:
    for given in ("irp6", Task("irp6", harmonics=3)):
        assert isinstance(design_trajectory(given, model="energy", **QUICK).target.model, EnergyModel)


def test_the_first_argument_by_its_former_name_warns() -> None:
    model = DifferentialModel(load_robot("irp6"))
    with pytest.warns(DeprecationWarning, match=r"design_trajectory\(model=") as said:
        design = design_trajectory(model=model, **QUICK)
    assert said[0].filename == __file__
    assert design.task.model.model == model


def test_a_model_and_the_name_of_another_one_are_refused() -> None:
    with pytest.raises(InputError, match="a model is given already"):
        design_trajectory(DifferentialModel(load_robot("irp6")), model="energy")
