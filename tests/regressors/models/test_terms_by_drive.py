"""Columns of some drives only are those of the model of all drives."""

from __future__ import annotations

import numpy as np
import pytest
from motions import random_sines

from regressors.models.columns import Terms
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.model import RegressorModel
from regressors.models.windows import Window
from regressors.readers.library import built_in
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Robot

SOME, ALL = Terms(coulomb=(1, 3), viscous=(2,), offset=(2, 3)), Terms(offset=True)
ROBOTS = {"irp6": with_locked_joints(built_in("irp6"), [0, 1, 2]), "panda": built_in("panda")}


def model(kind: str, robot: Robot, terms: Terms) -> RegressorModel:
    if kind == "differential":
        return DifferentialModel(robot, terms)
    return EnergyModel(robot, terms, Window("short", 0.1), sign_width=0.1 if kind == "smooth energy" else 0.0)


@pytest.mark.parametrize("kind", ["differential", "energy", "smooth energy"])
@pytest.mark.parametrize("name", list(ROBOTS))
def test_columns_of_some_drives_are_those_of_all(kind: str, name: str) -> None:
    robot = ROBOTS[name]
    some, every = (model(kind, robot, terms) for terms in (SOME, ALL))
    samples = random_sines(robot.n, np.random.default_rng(2)).samples(np.linspace(0.0, 1.0, 101))
    wanted = [name for name in every.names if not name.startswith("F") or name in ("F1c", "F3c", "F2v", "F2o", "F3o")]
    assert list(some.names) == wanted
    expected = every.assemble(samples)[:, [every.names.index(name) for name in wanted]]
    np.testing.assert_allclose(some.assemble(samples), expected, atol=1e-12)


def test_no_drive_is_no_column() -> None:
    robot = ROBOTS["irp6"]
    names = DifferentialModel(robot, Terms(coulomb=(), viscous=False)).names
    assert names == DifferentialModel(robot, Terms(coulomb=False, viscous=())).names
    assert not any(name.startswith("F") for name in names)
