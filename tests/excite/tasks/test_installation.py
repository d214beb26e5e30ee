"""Robots as mounted and as equipped, against Pinocchio's gravity torques and against a body added by hand."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import run
from public_arms import robots_folder
from refused import refusal
from written_files import text_file

import excite
from excite.tasks.installation import Installation
from excite.tasks.payload import payload_parameters
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.models.partial import of_joints
from regressors.readers.library import built_in
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot
from regressors.samples import Samples

G = 9.81


def torques(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Torques that hold poses, shape (N, n)."""
    model = DifferentialModel(robot, Terms(rotor=False, coulomb=False, viscous=False, offset=False))
    zero = np.zeros_like(q)
    samples = Samples(np.arange(len(q)) * 0.1, q, zero, zero, zero)
    known = standard_values(robot)
    return np.asarray(model.instants(samples) @ [known.get(name, 0.0) for name in model.names]).reshape(q.shape)


def potential(robot: Robot, q: np.ndarray) -> float:
    """Potential energy of the links' masses, by their poses alone."""
    R, p, energy = np.eye(3), np.zeros(3), 0.0
    for joint, link, angle in zip(robot.joints, robot.links, q, strict=True):
        T = joint.motion(angle)
        p, R = p + R @ T[:3, 3], R @ T[:3, :3]
        energy -= float(robot.gravity @ (link.theta[0] * p + R @ link.theta[1:4]))
    return energy


def test_mount_turns_gravity_into_the_axes_of_the_base() -> None:
    for mount, gravity in (
        ("floor", (0.0, 0.0, -G)),
        ("wall", (G, 0.0, 0.0)),
        ("ceiling", (0.0, 0.0, G)),
        ((0.0, 0.0, 1.0), (0.0, 0.0, -G)),
        ((0.3, 0.0, 0.0), (0.0, -G * np.sin(0.3), -G * np.cos(0.3))),
    ):
        np.testing.assert_allclose(Installation(mount=mount).applied(built_in("ur10e")).gravity, gravity, atol=1e-12)


def test_gravity_and_payload_act_as_the_slope_of_potential_energy() -> None:
    rng = np.random.default_rng(3)
    payload = (4.0, 0.02, -0.03, 0.15)
    robot = Installation(mount=(0.4, -0.7, 0.2), payload=payload).applied(built_in("ur10e"))
    q, h = rng.uniform(-2, 2, (5, 6)), 1e-6
    slopes = [[(potential(robot, x + h * e) - potential(robot, x - h * e)) / (2 * h) for e in np.eye(6)] for x in q]
    np.testing.assert_allclose(torques(robot, q), slopes, atol=2e-6)
    bare = Installation(mount=(0.4, -0.7, 0.2)).applied(built_in("ur10e"))
    assert potential(robot, q[0]) != pytest.approx(potential(bare, q[0]))


def test_products_of_inertia_of_a_payload_are_in_their_places() -> None:
    m, c = 2.0, np.array([0.1, -0.2, 0.3])
    theta = payload_parameters((m, *c, 0.05, 0.001, 0.002, 0.06, 0.003, 0.07))
    about_centre = np.array([[0.05, 0.001, 0.002], [0.001, 0.06, 0.003], [0.002, 0.003, 0.07]])
    about_origin = about_centre + m * (c @ c * np.eye(3) - np.outer(c, c))  # Steiner
    np.testing.assert_allclose(theta, [m, *(m * c), *about_origin[np.triu_indices(3)]], rtol=1e-14)


def test_a_payload_from_a_file_is_that_of_its_keys(tmp_path: Path) -> None:
    file = text_file(tmp_path / "load.yaml", "m: 2.0\nmcx: 0.2\nIxx: 0.01\nIyy: 0.04\nIzz: 0.04\n")
    expected = Installation(payload=(2.0, 0.1, 0.0, 0.0, 0.01, 0.0, 0.0, 0.02, 0.0, 0.02)).applied(built_in("ur10e"))
    found = Installation(payload=str(file)).applied(built_in("ur10e"))
    np.testing.assert_allclose(found.links[-1].theta, expected.links[-1].theta, rtol=1e-12)
    assert "cannot read load file" in refusal(Installation, payload="missing.yaml")
    # of an unknown link nothing becomes known
    assert Installation(payload=(1.0, 0.0, 0.0, 0.0)).applied(built_in("iiwa7")).links[-1].theta is None


def test_locked_drives_belong_to_the_robot_of_a_task() -> None:
    robot = installed_robot(Task("irp6", locked_drives=("4", "z5"), payload=(2.0, 0.0, 0.0, 0.1)))
    assert (robot.joint_names, [body.name for body in robot.branches]) == (("q1", "q2", "q3"), ["wrist_bend"])
    bare = installed_robot(Task("irp6", locked_drives=("4", "z5")))
    assert robot.branches[0].link.theta[0] == bare.branches[0].link.theta[0] + 2.0
    torque = excite.TorqueLimit().imposed(bare, of_joints(bare, range(3)))[0]
    assert torque.labels == ("drive z1 torque", "drive z2 torque", "drive z3 torque")
    for options in ({"model": "load"}, {"tool_speed": 1.0}):
        with pytest.raises(InputError, match="`locked_drives` is for models and limits of joint torques"):
            Task("irp6", locked_drives=("4", "5"), **options)


def test_installations_that_cannot_be_are_refused() -> None:
    for options, message in (
        ({"gravity": (0, 0, -1), "mount": "wall"}, "`gravity` and `mount` both set the direction of gravity"),
        ({"gravity": (0, 0)}, r"gravity: expected three numbers, given \(0, 0\)"),
        ({"gravity": (0, 0, float("nan"))}, "`gravity` must be a number from -10000 to 10000 m/s.2, given nan"),
        ({"mount": "roof"}, "mount: expected floor, wall, ceiling, or roll, pitch and yaw, given 'roof'"),
        ({"mount": True}, "mount: expected floor"),
        ({"payload": (1.0,)}, "payload needs a mass and its centre x, y, z"),
        ({"payload": (0.0, 0, 0, 0)}, "no body has a mass of 0 kg and an inertia of zero"),
        ({"payload": (-1.0, 0, 0, 0)}, "no body has a mass of -1 kg"),
        ({"payload": (1.0, 0, 0, 0, 0.1, 0, 0, 0.1, 0, 0.3)}, "none exceeds the sum of the others"),
    ):
        assert re.search(message, refusal(Installation, **options))


DESIGNS = (excite.design_trajectory, excite.design_for_precision, excite.next_motion, excite.plan_campaign)


@pytest.mark.parametrize("design", DESIGNS)
def test_options_in_python_install_the_robot_and_choose_its_ends(design: Callable[..., Any]) -> None:
    """What says otherwise names joints that are no longer there, or an installation that a robot object has by hand."""
    asked = {} if design is excite.plan_campaign or design is excite.design_trajectory else {"precision": 0.1}
    assert "give Installation(...).applied(robot)" in refusal(design, built_in("ur10e"), mount="wall", **asked)
    go2 = str(robots_folder() / "go2_description/urdf/go2.urdf")
    with pytest.raises(UnknownName, match=r"no joint named 'FR_hip_joint'; .*, 3 \(FL_calf_joint\)$"):
        design(go2, tip="FL_calf", joints=("FR_hip_joint",), **asked)


def test_a_design_is_of_the_robot_as_it_is_mounted() -> None:
    options = {"joints": ("1",), "harmonics": 3, "rate": 20.0, "starts": 1, "executor": "serial"}
    made = excite.design_trajectory("irp6", gravity=(0.0, 0.0, 0.0), **options)
    np.testing.assert_array_equal(made.robot.gravity, np.zeros(3))


@pytest.mark.slow
def test_an_installed_robot_goes_from_design_to_result(tmp_path: Path) -> None:
    options = ("--velocity-limit", "1", "--acceleration-limit", "5", "--joints", "1,2")
    short = ("--harmonics", "3", "--period", "5", "--starts", "1", "--executor", "serial", "--rate", "50")
    installed = ("--mount", "0.5,0.2,0", "--payload", "3,0,0,0.1")
    made = run("design", "ur10e", *options, *short, *installed, "--out", "d", cwd=tmp_path, status=0)
    assert "the payload of 3 kg is a part of the last link" in made.stderr
    assert run("simulate", "d", "--rate", "200", "--out", "log.csv", cwd=tmp_path).returncode == 0
    for given in (("--design", "d"), installed):
        out = f"r{len(given)}"
        chosen = given if given[0] == "--design" else (*given, "--joints", "1,2")
        run("identify", "ur10e", "log.csv", *chosen, "--out", out, cwd=tmp_path, status=0)
        result = excite.load_result(tmp_path / out)
        np.testing.assert_array_equal(result.robot.gravity, excite.load_design(tmp_path / "d").robot.gravity)
        assert result.training_error < 0.01
