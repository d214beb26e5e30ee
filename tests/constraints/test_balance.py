"""Balance: the ground's wrench against Pinocchio, its cone against forces at the feet, and MuJoCo as the plant."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from commands import Here, content_of
from pinocchio_chains import ground_wrenches
from public_arms import TREES
from refused import refusal
from scipy.optimize import linprog
from slow_dynamics import ROBOTS
from written_files import text_file

import excite
from constraints.balance import Balance, balance_of, read_support
from excite.design.stated_limits import kept_text
from regressors.errors import InputError
from regressors.models.base import random_states
from regressors.models.nominal import stated_deviations
from regressors.models.partial import of_joints
from regressors.readers.library import load_robot
from regressors.robot.inertia import parameter_names, rotation_from_rpy
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

FEET = ((0.2, 0.2, -0.5), (-0.3, 0.2, -0.5), (-0.3, -0.2, -0.5), (0.2, -0.2, -0.5))
UNEVEN = ((0.2, 0.3, -0.5), (-0.3, 0.2, -0.5), (-0.3, -0.1, -0.5), (0.2, -0.2, -0.5))
STAND: dict[str, Any] = {"stand_mass": 40.0, "stand_centre": (0.05, 0.02, -0.3)}


def wrenches(robot: Robot, states: Samples, balance: Balance) -> Array:
    """Force and moment of the ground, in the middle of the feet's height, on the robot and its stand, shape (N, 6)."""
    below, weight = np.array([0.0, 0.0, FEET[0][2]]), -balance.stand_mass * robot.gravity
    stand = np.concatenate([weight, np.cross(balance.stand_centre - below, weight)])
    return ground_wrenches(robot, states, origin=below) + stand


def values(robot: Robot, balance: Balance, states: Samples, label: str = "") -> Array:
    """Functions of the limit whose labels begin so, shape (N, k)."""
    (limit,) = balance.imposed(robot, of_joints(robot, range(robot.n)))
    return limit.values(states)[:, [each.startswith(label) for each in limit.labels]]


def moments_about_edges(w: Array, polygon: Any, margin: float = 0.0) -> Array:
    """Distance of the zero-moment point from each edge, less a margin, times the force of the ground, shape (N, k)."""
    point, feet = np.column_stack([-w[:, 4], w[:, 3]]) / w[:, 2:3], np.array(polygon)[:, :2]
    along = np.roll(feet, -1, axis=0) - feet
    (ex, ey), (x, y) = along.T / np.linalg.norm(along, axis=1), np.moveaxis(point[:, None] - feet, -1, 0)
    return w[:, 2:3] * (ex * y - ey * x - margin)


def by_edge(robot: Robot, balance: Balance, states: Samples) -> Array:
    edges = ("1-2", "2-3", "3-4", "4-1")
    return np.hstack([values(robot, balance, states, f"tipping over edge {edge}") for edge in edges])


@pytest.mark.parametrize("name", ["go2", "panda", "irp6"])
def test_moments_about_edges_are_those_of_the_zero_moment_point(name: str) -> None:
    robot = load_robot(TREES[0].path, tip=TREES[0].tips) if name == "go2" else ROBOTS[name]()
    balance, states = Balance(UNEVEN, **STAND, margin=0.03), random_states(robot, 20, seed=2)
    expected = moments_about_edges(wrenches(robot, states, balance), UNEVEN, 0.03)
    np.testing.assert_allclose(by_edge(robot, balance, states), expected, atol=1e-9 * np.abs(expected).max())


def held_by_feet(w: Array, mu: float, sides: int) -> bool:
    """Whether forces of feet within pyramids of friction add up to a wrench, by a linear programme."""
    angles = (np.arange(sides) + 0.5) * 2 * np.pi / sides
    forces = np.column_stack([mu * np.cos(angles), mu * np.sin(angles), np.ones(sides)])
    feet = np.array(FEET) - [0.0, 0.0, FEET[0][2]]
    rays = np.vstack([np.hstack([forces, np.cross(foot, forces)]) for foot in feet])
    return bool(linprog(np.zeros(len(rays)), A_eq=rays.T, b_eq=w, method="highs").status == 0)


def test_what_does_not_slide_is_held_by_forces_of_the_feet() -> None:
    """Exactly for the pyramids, hence never beyond cones; yaw alone breaks it too."""
    robot = load_robot(TREES[0].path, tip=TREES[0].tips)
    balance, states = Balance(FEET, **STAND, margin=0.0, friction_coefficient=0.15), random_states(robot, 150, seed=3)
    holds = values(robot, balance, states).min(axis=1) >= 0
    w = wrenches(robot, states, balance)
    assert 20 < np.sum(holds) < 130
    assert [held_by_feet(each, 0.15, 4) for each in w] == holds.tolist()
    assert all(held_by_feet(each, 0.15, 64) for each in w[holds])
    pushed = np.hypot(w[:, 0], w[:, 1]) > 0.15 * w[:, 2]
    assert np.any((values(robot, balance, states, "tipping").min(axis=1) >= 0) & ~pushed & ~holds)


def test_uncertain_inertias_are_those_of_the_worst_robot() -> None:
    """Each parameter off on its own gives one term, and the stand's mass too: moments are linear in them."""
    robot, share = ROBOTS["irp6"](), 0.2
    states, balance = random_states(robot, 5, seed=1), Balance(FEET, **STAND, margin=0.0)

    def moments(robot: Robot, balance: Balance = balance) -> Array:
        return moments_about_edges(wrenches(robot, states, balance), FEET)

    nominal = moments(robot)
    worst = nominal - np.abs(moments(robot, replace(balance, stand_mass=40.0 * (1 + share))) - nominal)
    deviations = stated_deviations(robot, share)
    for place, link in enumerate(robot.links):
        for k, name in enumerate(parameter_names(place + 1)):
            off = replace(link, theta=link.theta + deviations.get(name, 0.0) * np.eye(10)[k])
            links = (*robot.links[:place], off, *robot.links[place + 1 :])
            worst -= np.abs(moments(robot.replace(links=links)) - nominal)
    found = by_edge(robot, replace(balance, uncertainty=share), states)
    np.testing.assert_allclose(found, worst, atol=1e-9 * np.abs(worst).max())


def test_a_ground_that_slopes_is_the_level_one_turned() -> None:
    """The same robot and ground in other axes have the same moments."""
    robot, states = ROBOTS["panda"](), random_states(ROBOTS["panda"](), 5, seed=4)
    R = rotation_from_rpy((0.3, -0.2, 1.0))
    first, *others = robot.joints
    turned = replace(first, rotation=R @ first.rotation, translation=R @ first.translation)
    other = robot.replace(joints=(turned, *others), gravity=R @ robot.gravity)
    feet = [tuple(R @ foot) for foot in FEET]
    there = Balance(feet, 40.0, tuple(R @ STAND["stand_centre"]), friction_coefficient=0.5)
    here = np.sort(values(robot, Balance(FEET, **STAND, friction_coefficient=0.5), states), axis=1)
    np.testing.assert_allclose(np.sort(values(other, there, states), axis=1), here, atol=1e-6)


# --- designs, and MuJoCo as the plant --------------------------------------------------------------------------------

ARM = """<mujoco><compiler angle="radian"/><option timestep="0.0005" cone="elliptic" impratio="100"
noslip_iterations="20"/><worldbody><geom type="plane" size="5 5 1" pos="0 0 -0.05" friction="{mu} 0 0" condim="3"/>
<body name="stand">{joint}<inertial mass="6" pos="0 0 0" diaginertia="0.05 0.05 0.1"/>
<geom type="box" size="0.2 0.15 0.05" mass="0" friction="{mu} 0 0" condim="3"/>
<body name="turret" pos="0 0 0.3"><joint name="yaw" axis="0 0 1" range="-3 3"/>
<inertial mass="1" pos="0 0 0" diaginertia="0.01 0.01 0.01"/>
<body name="arm"><joint name="pitch" axis="0 1 0" range="-1.5 1.5"/>
<inertial mass="2" pos="0 0 0.5" diaginertia="0.05 0.05 0.01"/></body></body></body></worldbody></mujoco>"""
BOX = [[0.2, 0.15, -0.05], [-0.2, 0.15, -0.05], [-0.2, -0.15, -0.05], [0.2, -0.15, -0.05]]
SLIPPERY = 0.2
FAST: dict[str, Any] = {"velocity": (4.0,), "acceleration": (25.0,), "floor": "none", "torque_margin": "none"}
FAST |= {"friction": False, "period": 3.0, "harmonics": 4, "starts": 2, "executor": "serial"}


def designed(folder: Path, *limits: Balance) -> excite.Design:
    (folder / "arm.xml").write_text(ARM.format(joint="", mu=1), encoding="utf-8")
    return excite.design_trajectory(str(folder / "arm.xml"), **FAST, constraints=limits)


def played(design: excite.Design, mu: float) -> tuple[float, float]:
    """Largest tilt and turn of a free stand while the arm on it plays a design, both in degrees."""
    fixed, free = (mujoco.MjModel.from_xml_string(ARM.format(joint=j, mu=mu)) for j in ("", "<freejoint/>"))
    torques, plant, tilt, turn = mujoco.MjData(fixed), mujoco.MjData(free), 0.0, 0.0
    samples = design.trajectory.samples(np.arange(0.0, design.trajectory.duration, free.opt.timestep))
    plant.qpos[3], plant.qpos[7:] = 1.0, samples.q[0]
    for q, dq, ddq in zip(samples.q, samples.dq, samples.ddq, strict=True):
        torques.qpos[:], torques.qvel[:], torques.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(fixed, torques)
        plant.qfrc_applied[6:] = torques.qfrc_inverse + 2000 * (q - plant.qpos[7:]) + 60 * (dq - plant.qvel[6:])
        mujoco.mj_step(free, plant)
        R = plant.body("stand").xmat.reshape(3, 3)
        tilt = max(tilt, np.degrees(np.arccos(np.clip(R[2, 2], -1.0, 1.0))))
        turn = max(turn, abs(np.degrees(np.arctan2(R[1, 0], R[0, 0]))))
    return tilt, turn


def test_a_stand_tips_without_the_limit_only(tmp_path: Path) -> None:
    """Its certificate is over continuous time, and the motion uses almost all of the limit."""
    assert played(designed(tmp_path), 1.0)[0] > 20.0
    kept = designed(tmp_path, Balance(BOX, 6.0, margin=0.005))
    assert kept.feasible
    assert played(kept, 1.0)[0] < 0.2
    uses = [use for use in kept.limits if use.quantity == "balance"]
    assert [(use.label[:7], use.method) for use in uses] == 4 * [("tipping", "enclosed")]
    assert max(use.use for use in uses) > 0.95


def test_a_stand_turns_where_friction_is_not_stated(tmp_path: Path) -> None:
    assert played(designed(tmp_path, Balance(BOX, 6.0)), SLIPPERY)[1] > 5.0
    kept = designed(tmp_path, Balance(BOX, 6.0, friction_coefficient=SLIPPERY))
    assert kept.feasible
    assert max(played(kept, SLIPPERY)) < 0.2


def test_a_support_file_is_a_limit_of_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(joint="", mu=1), encoding="utf-8")
    text = f"polygon: {BOX}\nstand: {{mass: 6, centre: [0, 0, 0.01]}}\nmargin: 0.01\nfriction: 0.4\n"
    (tmp_path / "stand.yaml").write_text(text, encoding="utf-8")
    options = ("--velocity-limit", "4", "--acceleration-limit", "25", "--floor", "none", "--starts", "1")
    here = Here(tmp_path, monkeypatch, capfd)
    folder = here.designed("arm.xml", *options, "--no-friction", "--support", "stand.yaml")
    (tmp_path / "stand.yaml").unlink()
    known = Balance(BOX, 6.0, (0.0, 0.0, 0.01), 0.01, 0.4)
    assert content_of(folder)["task"]["support"] == known.to_dict()
    stored = excite.load_design(folder)
    assert stored.task.limits.support == balance_of(known.to_dict()) == known
    assert "balance (5)" in kept_text((), [use.quantity for use in stored.limits])
    assert replace(stored.task.limits, torque_uncertainty=0.1).imposed()[-1] == replace(known, uncertainty=0.1)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"polygon": FEET[:2]}, "three points or more"),
        ({"polygon": [(*point[:2], np.nan) for point in FEET]}, "each of finite x, y, z"),
        ({"polygon": [(k, k, 0.0) for k in range(4)]}, "in one plane, not all on a line"),
        ({"polygon": [*FEET, (0.0, 0.0, 0.0)]}, "in one plane, not all on a line"),
        ({"polygon": [(0.0, y, z) for _, y, z in (*FEET, (0, 0, 1))]}, "gravity .* is along its plane"),
        ({"margin": 0.25}, "0.25 m leave no room in a support polygon whose middle is 0.2 m from an edge"),
    ],
)
def test_supports_that_cannot_be_are_refused(given: dict[str, Any], message: str) -> None:
    robot = ROBOTS["panda"]()
    with pytest.raises(InputError, match=message):
        Balance(**{"polygon": FEET, **given}).imposed(robot, of_joints(robot, range(7)))


def test_mistakes_of_a_support_file_have_their_line(tmp_path: Path) -> None:
    path = text_file(tmp_path / "stand.yaml", "polygon: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nstand: {weight: 6}\n")
    assert re.search(r"stand.yaml: .*line 2", refusal(read_support, path))
    assert "expected what `read_support` returns" in refusal(excite.Task("panda", support="stand.yaml").limits.imposed)
