"""Options of model objects in tasks and files: what is built again from them is the same model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import excite
from excite.files.task_file import task_content, task_from_options
from excite.registry import OwnPart
from excite.tasks.options_of_model import options_of_model
from regressors.models.columns import Terms
from regressors.models.load import LoadIntegralModel, Sensor
from regressors.models.model import RegressorModel
from regressors.models.windows import Window
from regressors.readers.library import built_in
from regressors.robot.inertia import rotation_from_rpy

IRP6 = built_in("irp6")
SENSOR = Sensor("2", rotation_from_rpy((0.3, -0.4, 2.0)), np.array([0.1, 0.0, -0.2]), ("fx", "nz"))
MODELS: dict[str, RegressorModel] = {
    "defaults": excite.DifferentialModel(IRP6),
    "terms": excite.DifferentialModel(IRP6, Terms(rotor=False, offset=(1, 3), reflected=False, stribeck=True)),
    "no friction": excite.DifferentialModel(IRP6, Terms.inertial_only()),
    "window": excite.EnergyModel(IRP6, window=Window("short", 0.02)),
    "long windows": LoadIntegralModel(IRP6, SENSOR, Window("long")),
    "sensor": excite.LoadModel(IRP6, SENSOR),
}
UNTOLD: dict[str, RegressorModel] = {
    "two kinds of friction": excite.DifferentialModel(IRP6, Terms(viscous=False)),
    "smooth signs": excite.DifferentialModel(IRP6, sign_width=0.1),
    "steps of windows": excite.EnergyModel(IRP6, window=Window("short", 0.02, 0.01)),
}


def same(found: Any, expected: Any) -> bool:
    if isinstance(expected, Sensor):
        told = (found.link, tuple(found.equations)) == (expected.link, tuple(expected.equations))
        close = np.allclose(found.rotation, expected.rotation, rtol=0, atol=1e-12)
        return bool(told and close and np.allclose(found.translation, expected.translation, rtol=0, atol=0))
    return bool(found == expected)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_the_task_in_a_file_builds_the_same_model(model: RegressorModel) -> None:
    task = excite.Task(IRP6, model=model)
    again = task_from_options(json.loads(json.dumps(task_content(task))))
    built = again.model.built(IRP6)
    assert type(built) is type(model)
    assert built.names == model.names
    for name, value in model.options.items():
        assert same(built.options[name], value), name


@pytest.mark.parametrize("model", UNTOLD.values(), ids=UNTOLD)
def test_what_a_task_cannot_say_is_named_by_its_class(model: RegressorModel) -> None:
    assert options_of_model(model) is None
    stored = task_content(excite.Task(IRP6, model=model))["model"]
    assert stored == f"{type(model).__module__}:{type(model).__name__}"


@pytest.mark.slow
def test_a_loaded_design_has_the_columns_that_it_was_made_for(tmp_path: Path) -> None:
    search = {"starts": 1, "harmonics": 3, "executor": "serial"}
    design = excite.design_trajectory(MODELS["terms"], **search)
    design.save(tmp_path / "told")
    assert excite.load_design(tmp_path / "told").task.model.built(IRP6).names == MODELS["terms"].names
    other = UNTOLD["two kinds of friction"]
    excite.design_trajectory(other, **search).save(tmp_path / "untold")
    assert isinstance(excite.load_design(tmp_path / "untold").task.model.model, OwnPart)
    given = excite.load_design(tmp_path / "untold", model=other)
    assert given.task.model.built(IRP6).names == other.names
