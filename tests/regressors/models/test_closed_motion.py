"""Torques of the drives of linkages beside MuJoCo's constrained forward dynamics, state by state."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest
from linkages import FOUR_BAR, linkage, robot_of_text

from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.nominal import standard_values
from regressors.models.partial import of_loops
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot
from regressors.samples import Samples

_WORLD = """<mujoco model="linkage"><compiler angle="radian"/><option timestep="0.0002"/>
<default><equality solref="0.0004 1" solimp="0.999999 0.999999 0.001"/></default><worldbody>{}</worldbody>
<equality><connect body1="b" body2="d" anchor="{}"/></equality><actuator>{}</actuator></mujoco>"""
_BODY = '<body name="{}" pos="{}" euler="{}">{}<inertial pos="{}" mass="{}" diaginertia="0.003 0.008 0.007"/>{}</body>'


def hinges(*named: tuple[str, str], reach: float = 0.0) -> str:
    limits = f'range="{-reach} {reach}"' if reach else ""
    return "".join(f'<joint name="{name}" axis="{axis}" {limits}/>' for name, axis in named)


def five_bar() -> str:
    """Two driven cranks and two rods between them: two joints move on their own."""
    plane = "0 -1 0"
    left = _BODY.format("b", "0.2 0 0", "0 1.3 0", hinges(("q2", plane)), "0.15 0 0.01", 0.7, "")
    right = _BODY.format("d", "0.2 0 0", "0 -1.3 0", hinges(("q4", plane)), "0.15 0 0.02", 0.6, "")
    one = _BODY.format("a", "0 0 0", "0 -2.1 0", hinges(("q1", plane), reach=0.4), "0.1 0 0.01", 1.0, left)
    other = _BODY.format("c", "0.25 0 0", "0 -1.0 0", hinges(("q3", plane), reach=0.4), "0.1 0 0", 1.2, right)
    return _WORLD.format(one + other, "0.3 0 0", '<motor joint="q1"/><motor joint="q3"/>')


def spatial() -> str:
    """A crank and a rocker about skew axes, with a coupler between them on a universal joint and a ball."""
    coupler = _BODY.format("b", "0.15 0 0", "0 0.2 0.4", hinges(("q2", "0 0 1"), ("q3", "0 1 0")), "0.2 0 0", 0.8, "")
    crank = _BODY.format("a", "0 0 0", "0 0 0.8", hinges(("q1", "0 0 1"), reach=0.4), "0.08 0.01 0", 1.1, coupler)
    rocker = _BODY.format("d", "0.5 0.1 -0.2", "0.3 -0.9 0", hinges(("q4", "0 1 0")), "0.1 0 0.03", 0.9, "")
    return _WORLD.format(crank + rocker, "0.4 0 0", '<motor joint="q1"/>')


def belted() -> str:
    """Three driven joints; one between them follows by a belt, and one beside them by a rod."""
    wrist = _BODY.format("d", "0.2 0 0", "0.4 0 0", hinges(("q4", "0 0 1"), reach=0.4), "0.05 0.02 0.01", 0.4, "")
    level = _BODY.format("c", "0.3 0 0", "0 0.2 0", hinges(("q3", "0 1 0")), "0.1 0 0.02", 0.6, wrist)
    fore = _BODY.format("b", "0 0 0.2", "0 0 0", hinges(("q2", "0 1 0"), reach=0.4), "0.15 0.01 0", 0.9, level)
    rod = _BODY.format("e", "0.1 0.2 0", "0 0 0.3", hinges(("q5", "1 0 0")), "0.1 0 0.03", 0.5, "")
    turret = _BODY.format("a", "0 0 0", "0 0 0", hinges(("q1", "0 0 1"), reach=0.4), "0.02 0 0.1", 2.0, fore + rod)
    belt = '<joint joint1="q3" joint2="q2" polycoef="0.1 -1.5 0 0 0"/>'
    bar = '<joint joint1="q5" joint2="q4" polycoef="0 2 0 0 0"/>'
    text = _WORLD.format(turret, "", "".join(f'<motor joint="q{k}"/>' for k in (1, 2, 4)))
    return re.sub("<connect .*?/>", belt + bar, text)


LINKAGES = {"four-bar": linkage("linkage", FOUR_BAR), "five-bar": five_bar(), "spatial": spatial(), "belted": belted()}
FREE = {"four-bar": ("q1",), "five-bar": ("q1", "q3"), "spatial": ("q1",), "belted": ("q1", "q2", "q4")}


def off_the_centre(model: mujoco.MjModel, robot: Robot, states: Samples, seed: int) -> tuple[Samples, np.ndarray]:
    """Accelerations under random torques of the drives, and these torques at all joints."""
    data, rng, ddq = mujoco.MjData(model), np.random.default_rng(seed), []
    acting = [robot.joint_names.index(model.joint(int(k)).name) for k in model.actuator_trnid[:, 0]]
    torques = np.zeros(states.q.shape)
    torques[:, acting] = rng.uniform(-5.0, 5.0, (states.time.size, len(acting)))
    for q, dq, tau in zip(states.q, states.dq, torques, strict=True):
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, dq, tau[acting]
        mujoco.mj_forward(model, data)
        ddq.append(data.qacc.copy())
    return Samples(states.time, states.q, states.dq, np.array(ddq), states.dddq), torques


@pytest.mark.parametrize("name", LINKAGES)
def test_torques_are_those_that_accelerate_mujoco(name: str) -> None:
    robot = robot_of_text("linkage", LINKAGES[name])
    plant, motion = mujoco.MjModel.from_xml_string(LINKAGES[name]), of_loops(robot)
    assert motion.labels == FREE[name]
    states, torques = off_the_centre(plant, robot, random_states(robot, 40, seed=3), seed=0)
    moved = motion.states(states)
    scale = np.abs(states.ddq).max()
    np.testing.assert_allclose(moved.ddq, states.ddq, atol=2e-3 * scale)  # MuJoCo's constraints are soft
    model = DifferentialModel(robot, Terms(coulomb=False, viscous=False)).restricted(motion)
    known = standard_values(robot)
    predicted = model.instants(moved) @ np.array([known[column.name] for column in model.columns])
    measured = model.right_side(moved, torques)
    np.testing.assert_allclose(predicted, measured, atol=5e-3 * np.abs(measured).max())


@pytest.mark.parametrize("name", LINKAGES)
def test_power_of_the_projected_torques_is_the_rate_of_the_energy(name: str) -> None:
    """``dq_i' N' Y theta = d/dt h theta`` for every parameter that moves, and so both show the same."""
    robot = robot_of_text("linkage", LINKAGES[name])
    motion, terms = of_loops(robot), Terms(coulomb=False, viscous=False)
    energy, torques = EnergyModel(robot, terms), DifferentialModel(robot, terms).restricted(motion)
    states = random_states(robot, 30, seed=1)
    free = [robot.joint_names.index(label) for label in motion.labels]
    rows = torques.instants(states).reshape(30, len(free), -1)
    power = np.einsum("nk,nkp->np", states.dq[:, free], rows)
    np.testing.assert_allclose(energy.instants(states), power, atol=1e-9 * np.abs(power).max())
    assert base_parameters(energy, rounding=0.0).names == base_parameters(torques, rounding=0.0).names
