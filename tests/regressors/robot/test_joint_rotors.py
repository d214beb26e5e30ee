"""Rotor inertias of robots whose description says nothing of their drives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.models.base import random_states
from regressors.models.differential import DifferentialModel
from regressors.readers.library import load_robot
from regressors.robot.columns import Terms
from regressors.robot.locked_joints import with_joint_rotors

INERTIA = Terms(coulomb=False, viscous=False)


def test_a_rotor_at_a_joint_resists_its_own_acceleration_only() -> None:
    robot = load_robot("ur10e")
    model = DifferentialModel(with_joint_rotors(robot), INERTIA)
    states = random_states(robot, 5, seed=3)
    Y = model.instants(states).reshape(5, 6, -1)
    rotors = [k for k, column in enumerate(model.columns) if column.group == "rotor"]
    assert [model.names[k] for k in rotors] == [f"Ia{k}" for k in range(1, 7)]
    for instant, ddq in zip(Y, states.ddq, strict=True):
        np.testing.assert_allclose(instant[:, rotors], np.diag(ddq), rtol=1e-14)


def test_what_is_known_of_drives_stays() -> None:
    robot = load_robot("irp6")
    assert with_joint_rotors(robot).sha256() == robot.sha256()


def test_the_description_says_that_the_inertia_is_unknown() -> None:
    transmission = with_joint_rotors(load_robot("ur10e")).transmission
    assert transmission is not None
    assert all(d.rotor_inertia is not None and math.isnan(d.rotor_inertia) for d in transmission.drives)


@pytest.mark.parametrize(("wanted", "rank"), [(False, 36 + 18), (True, 40 + 18)])
def test_ur10e_has_the_58_columns_of_the_published_identification(wanted: bool, rank: int) -> None:
    task = Task("ur10e", offset=True, joint_rotors=wanted)
    assert target_of(load_robot("ur10e"), task).base.rank == rank
