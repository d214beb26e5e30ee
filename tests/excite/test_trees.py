"""A two-armed torso from its description to the verdict, with Pinocchio and Coal beside it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from coal_distances import clearance, link_poses
from identified import predicted, relative
from pinocchio_chains import joint_torques
from written_files import saved

import excite
from constraints.geometry import Part, World
from excite.design.design import Design
from excite.design.formulation import formulate
from excite.design.initial_guesses import random_motion
from excite.information.prior import prior_of
from excite.tasks.task import Task
from regressors.models.base import base_parameters
from regressors.models.differential import DifferentialModel
from regressors.robot.columns import Terms
from regressors.robot.inertia import from_centre_of_mass
from regressors.robot.robot import Drive, Joint, Limits, Link, Robot, Transmission
from regressors.robot.shapes import Capsule
from regressors.samples import Samples

LENGTH, APART, RADIUS, CLEARANCE = 0.3, 0.25, 0.04, 0.02
SIDES = ("left", "right")


def two_arms() -> Robot:
    """A waist about z, and two arms of two joints on it whose reaches overlap."""
    joints, links, parents = [Joint("waist", "revolute", np.eye(3), np.array([0.0, 0.0, 0.2]))], [], [0]
    bodies = [from_centre_of_mass(6.0, [0.02, 0.01, 0.1], np.diag([0.2, 0.15, 0.1]))]
    for sign, side in zip((1.0, -1.0), SIDES, strict=True):
        shoulder = np.array([0.0, sign * APART, 0.3])
        up = np.array([0.0, 1.0, 0.0])
        joints.append(Joint(f"{side}_shoulder", "revolute", np.eye(3), shoulder))
        joints.append(Joint(f"{side}_elbow", "revolute", np.eye(3), np.array([LENGTH, 0.0, 0.0]), up))
        parents += [1, len(joints) - 1]
        bodies.append(from_centre_of_mass(2.0, [0.14, 0.01, 0.02], np.diag([0.01, 0.03, 0.03])))
        bodies.append(from_centre_of_mass(1.0, [0.12, 0.0, 0.01], np.diag([0.004, 0.012, 0.012])))
    names = ("torso", *(f"{side}_{part}" for side in SIDES for part in ("upper", "fore")))
    links = [Link(name, theta) for name, theta in zip(names, bodies, strict=True)]
    full = np.full(5, np.inf)
    limits = Limits(np.full(5, -1.4), np.full(5, 1.4), np.full(5, 3.0), np.full(5, 10.0), full, np.full(5, 60.0))
    drives = tuple(Drive(joint.name, coulomb=0.4, viscous=0.3) for joint in joints)
    arm = Capsule((0.0, 0.0, 0.0), (LENGTH, 0.0, 0.0), RADIUS)
    shapes = (Part("torso", Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.2), 0.1)), *(Part(name, arm) for name in names[1:]))
    transmission = Transmission(np.eye(5), drives, Limits.none(5))
    return Robot("torso", tuple(joints), tuple(links), limits, transmission, shapes=shapes, parents=tuple(parents))


SERIAL = excite.Search(starts=1, seed=0, executor="serial")


@cache
def design(*, apart: bool = True) -> Design:
    task = Task(two_arms(), rotor=False, period=8.0, harmonics=4, self_collision=apart, floor=0.0, search=SERIAL)
    return excite.design_trajectory(task)


def dense(made: Design) -> Samples:
    return made.trajectory.samples(np.linspace(0.0, made.trajectory.duration, 400))


def nearest(made: Design) -> float:
    """Of the two arms [m], by Coal."""
    robot = two_arms()
    world = World(robot.shapes, (), CLEARANCE)
    pairs = [f"left_{one} to right_{other}" for one in ("upper", "fore") for other in ("upper", "fore")]
    return min(clearance(robot, world, pair, q) for q in dense(made).q for pair in pairs)


def test_two_arms_keep_apart() -> None:
    made = design()
    assert made.feasible
    pairs = {label for label in (use.label for use in made.limits) if label.startswith("right_")}
    assert {"right_fore to left_fore", "right_upper to left_fore"} <= pairs
    assert nearest(made) >= 0.0
    assert nearest(design(apart=False)) < 0.0


def test_balance_is_not_checked_where_nobody_says_what_they_stand_on() -> None:
    assert [each.reason for each in design().unchecked if each.limit == "balance"] == ["no support polygon is given"]


def test_they_keep_above_the_floor() -> None:
    robot, made = two_arms(), design()
    lowest = [
        (pose.rotation @ np.array(end) + pose.translation)[2] - part.capsule.radius
        for poses in (link_poses(robot, q) for q in dense(made).q)
        for pose, part in ((poses[part.link], part) for part in robot.shapes[1:])
        for end in (part.capsule.start, part.capsule.end)
    ]
    assert min(lowest) >= 0.0
    assert any("floor" in use.label for use in made.limits)


def test_information_is_that_of_the_whole_regressor() -> None:
    formulation = formulate(two_arms(), Task(two_arms(), friction=False, period=8.0, harmonics=4, search=SERIAL))
    information, target = formulation.problem.information, formulation.target
    x = random_motion(formulation.problem, np.random.default_rng(0))
    at = information.evaluate(x)
    samples = information.trajectory(x).samples(np.linspace(0.0, 8.0, at.motion[0].shape[1], endpoint=False))
    W = target.model.assemble(samples)[:, target.base.index]
    np.testing.assert_allclose(at.M, W.T @ W / samples.time.size, atol=1e-9 * np.abs(at.M).max())


MJCF = """<mujoco><compiler angle="radian"/><option timestep="0.0005" integrator="RK4"/><worldbody>
<body name="pedestal"><site name="plate"/><body name="torso" pos="0 0 0.2">
<joint name="waist" axis="0 0 1" damping="0.3"/>
<inertial pos="0.02 0.01 0.1" mass="6" diaginertia="0.2 0.15 0.1"/>{}{}</body></body></worldbody>
<sensor><force site="plate"/><torque site="plate"/></sensor></mujoco>"""
ARM = """<body name="{0}_upper" pos="0 {1} 0.3"><joint name="{0}_shoulder" axis="0 0 1" damping="0.3"/>
<inertial pos="0.14 0.01 0.02" mass="2" diaginertia="0.01 0.03 0.03"/>
<body name="{0}_fore" pos="0.3 0 0"><joint name="{0}_elbow" axis="0 1 0" damping="0.3"/>
<inertial pos="0.12 0 0.01" mass="1" diaginertia="0.004 0.012 0.012"/></body></body>"""


def recorded(motion: Samples, noise: float, seed: int) -> np.ndarray:
    """What MuJoCo's own two arms do under computed torques along a motion: rows of a log at 1 kHz, the wrench last."""
    arms = (ARM.format(side, sign * APART) for sign, side in zip((1, -1), SIDES, strict=True))
    model = mujoco.MjModel.from_xml_string(MJCF.format(*arms))
    data, M, rows = mujoco.MjData(model), np.zeros((5, 5)), []
    assert [model.joint(k).name for k in range(5)] == list(two_arms().joint_names)
    data.qpos[:], data.qvel[:] = motion.q[0], motion.dq[0]
    for k, (q, dq, ddq) in enumerate(zip(motion.q, motion.dq, motion.ddq, strict=True)):
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, M)
        wanted = ddq + 400.0 * (q - data.qpos) + 40.0 * (dq - data.qvel)
        dry = 0.4 * np.tanh(data.qvel / 0.002)
        tau = M @ wanted + data.qfrc_bias + 0.3 * data.qvel + dry
        data.qfrc_applied[:] = tau - dry
        if k % 2 == 0:
            mujoco.mj_forward(model, data)
            rows.append([data.time, *np.column_stack([data.qpos, data.qvel, tau]).ravel(), *data.sensordata])
        mujoco.mj_step(model, data)
    rows = np.array(rows)
    rows[:, 3:-6:3] += noise * np.random.default_rng(seed).normal(size=(len(rows), 5))
    return rows


@pytest.mark.slow
def test_what_they_weigh_in_mujoco_is_found_and_believed(tmp_path: Path) -> None:
    made, robot = design(), two_arms()
    motion = made.trajectory.samples(np.arange(0.0, made.trajectory.duration, 0.0005))
    head = ["time", *(f"{name}.{what}" for name in robot.joint_names for what in ("position", "velocity", "effort"))]
    for name, seed in (("run.csv", 1), ("other.csv", 2)):
        rows = recorded(motion, 0.02, seed)[:, :-6]
        np.savetxt(tmp_path / name, rows, delimiter=",", header=",".join(head), comments="")
    result = excite.identify(robot, tmp_path / "run.csv", design=made)
    assert excite.verify(result, tmp_path / "other.csv").holds
    rigid, friction = predicted(result, samples := dense(made))
    assert relative(rigid, joint_torques(robot, samples)) < 0.01
    moves = np.abs(samples.dq) > 0.1
    assert relative(friction[moves], (0.3 * samples.dq + 0.4 * np.sign(samples.dq))[moves]) < 0.01
    excite.write_report(saved(tmp_path / "result", result), tmp_path / "page.html")
    excite.export_model(tmp_path / "result", "urdf", tmp_path / "torso.urdf")
    assert excite.load_robot(tmp_path / "torso.urdf").parents == robot.parents


@pytest.mark.slow
def test_the_wrench_below_the_base_tells_the_bodies_without_torques() -> None:
    robot = two_arms()
    task = Task(robot, model="base-wrench", period=8.0, harmonics=4, floor=0.0, search=SERIAL)
    made = excite.design_trajectory(task)
    motion = made.trajectory.samples(np.arange(0.0, 8.0, 0.0005))
    rows = recorded(motion, 0.0, 0)
    base = made.base
    truth = dict(zip(base.names, prior_of(made.target.model, base, None).base_values(np.eye(base.rank)), strict=True))
    rigid = DifferentialModel(robot, Terms(rotor=False, coulomb=False, viscous=False))
    of_torques, samples = base_parameters(rigid), dense(made)
    Y, torques = rigid.instants(samples)[:, of_torques.index], joint_torques(robot, samples).ravel()
    inside, bias = [], np.array([0.5, -0.7, 0.0, 0.3, 0.2, -0.4])
    for seed in range(3):
        log, other = (_plate(robot, rows, bias, np.random.default_rng([seed, k])) for k in (0, 1))
        result = excite.identify(robot, log, design=made)
        estimate = result.estimate
        off = np.abs(estimate.values - [truth[name] for name in estimate.names])
        inside.append(off <= estimate.half_width)
        values = dict(zip(estimate.names, estimate.values, strict=True))
        assert relative(Y @ [values[name] for name in of_torques.names], torques) < 0.01
        assert excite.verify(result, other).holds
        np.testing.assert_allclose(result.recipe.bias, bias, atol=0.1)
    assert np.mean(inside) >= 0.95  # of 90 intervals of 99 %


def _plate(robot: Robot, rows: np.ndarray, bias: np.ndarray, rng: np.random.Generator) -> excite.Log:
    noise = rng.normal(size=(len(rows), 6)) * np.repeat([1.0, 0.2], 3)
    joints, wrench = robot.joint_names, rows[:, -6:] + bias + noise
    return excite.Log.from_arrays(rows[:, 0], rows[:, 1:-6:3], dq=rows[:, 2:-6:3], joints=joints, wrench=wrench)
