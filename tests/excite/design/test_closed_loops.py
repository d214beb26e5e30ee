"""Designs of robots with closed loops: gradients, limits between instants, and what files and exports hold."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from linkages import FOUR_BAR, PARALLELOGRAM, START, joint_angles, linkage, robot_of_text
from mechanisms import delta
from written_files import saved

import excite
from excite.design.design import Design
from excite.design.formulation import formulate
from excite.design.initial_guesses import random_motion, shrunk
from excite.design.problem import Problem
from excite.tasks.task import Task
from excite.trajectories.closed import ClosedTrajectory
from regressors.errors import InputError
from regressors.models.differential import DifferentialModel
from regressors.readers.library import load_robot
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

LIMITED = 'ctrlrange="-3 3" forcerange="-3 3"'
TEXTS = {
    "four-bar": linkage("four-bar", FOUR_BAR).replace('<motor joint="q1"', f'<motor joint="q1" {LIMITED}'),
    "parallelogram": linkage("parallelogram", PARALLELOGRAM, limits='range="-0.8 1.8"'),
    "delta": delta().replace('<motor joint="q1"', f'<motor joint="q1" {LIMITED}'),
}
OPTIONS = {"velocity": (3.0,), "acceleration": (20.0,), "period": 4.0}


@cache
def robot_of(name: str) -> Robot:
    return robot_of_text(name, TEXTS[name])


@cache
def problem_of(name: str, family: str, model: str) -> tuple[Problem, Array]:
    """A problem, and a motion within its limits."""
    task = Task(robot_of(name), model=model, trajectory=family, torque_margin=0.1, **OPTIONS)
    problem = formulate(robot_of(name), task).problem
    return problem, shrunk(problem, random_motion(problem, np.random.default_rng(1)))


@cache
def design_of(name: str, model: str = "differential") -> Design:
    search = excite.Search(starts=1, executor="serial")
    return excite.design_trajectory(robot_of(name), model=model, search=search, **OPTIONS)


def dense(design: Design, count: int = 20_001) -> Samples:
    return design.trajectory.samples(np.linspace(0.0, design.trajectory.duration, count))


@pytest.mark.parametrize("model", ["differential", "energy"])
@pytest.mark.parametrize("family", ["fourier", "bspline"])
@pytest.mark.parametrize("name", ["four-bar", "delta"])
def test_gradients_along_closed_motions_are_those_of_differences(name: str, family: str, model: str) -> None:
    problem, x = problem_of(name, family, model)
    rng, h = np.random.default_rng(2), 1e-5
    direction = rng.normal(size=x.shape) / np.sqrt(x.size)
    information = problem.information
    at = information.evaluate(x)
    G = rng.normal(size=at.M.shape)
    (slope,) = information.gradients([at], [G + G.T])
    ahead, behind = (information.evaluate(x + step * direction).M for step in (h, -h))
    expected = np.sum((G + G.T) * (ahead - behind)) / (2 * h)
    assert np.sum(slope * direction) == pytest.approx(expected, rel=1e-5, abs=1e-6 * np.abs(at.M).max())
    instants = np.arange(0, 512, 37)
    for limit in problem.limits.together:
        function, place = (x.ravel() for x in np.indices((len(limit.lower), instants.size)))
        found = limit.tangent(x, instants)(function, place) @ direction.ravel()
        change = (limit.values(x + h * direction) - limit.values(x - h * direction))[:, instants] / (2 * h)
        np.testing.assert_allclose(found, change.ravel(), atol=1e-5 * max(1.0, np.abs(change).max()))


@pytest.mark.parametrize("name", ["four-bar", "parallelogram", pytest.param("delta", marks=pytest.mark.slow)])
def test_limits_of_every_joint_hold_between_the_instants_of_the_search(name: str) -> None:
    design = design_of(name)
    assert design.feasible
    samples, robot, uses = dense(design), robot_of(name), {use.label: use for use in design.limits}
    for what, values, most in (("velocity", samples.dq, 3.0), ("acceleration", samples.ddq, 20.0)):
        assert np.abs(values).max() <= most
        for joint, reached in zip(robot.joint_names, np.abs(values).max(axis=0), strict=True):
            stated = abs(uses[f"joint {joint} {what}"].extreme)
            assert reached <= stated + 1e-9
            assert stated <= reached + 0.02 * most
    assert np.all(np.abs(samples.dddq).max(axis=0) <= design.trajectory.jerk)
    assert max(use.use for use in design.limits) > 0.97
    regular = next(use for use in design.limits if use.quantity == "loops")
    assert regular.holds
    free = {f"joint {joint} velocity" for joint in design.target.motion.labels}
    assert all((use.method == "exact") == (use.label in free) for use in design.limits if use.quantity == "velocity")


def test_torques_of_the_drive_stay_within_their_limit() -> None:
    design = design_of("four-bar")
    (use,) = (use for use in design.limits if use.quantity == "torque")
    log = excite.simulate(design, rate=1000.0).log
    reached = np.abs(log.effort[:, 0]).max()
    assert reached <= abs(use.extreme) <= 2.7
    assert abs(use.extreme) < reached + 0.02 * 2.7


def test_the_condition_number_is_that_of_the_projected_equations_along_the_closed_form() -> None:
    design, robot = design_of("four-bar"), robot_of("four-bar")
    model = design.target.model
    samples = design.trajectory.samples(model.times(4.0, design.task.output.rate))
    q = joint_angles(FOUR_BAR, samples.q[:, 0])
    np.testing.assert_allclose(samples.q, q, atol=1e-9)
    step = design.trajectory.duration / 4000
    time = np.arange(4001) * step
    angles = joint_angles(FOUR_BAR, design.trajectory.samples(time).q[:, 0])
    along = design.trajectory.samples(time[2:-2])
    velocity = (angles[:-4] - 8 * angles[1:-3] + 8 * angles[3:-1] - angles[4:]) / (12 * step)
    bent = (-angles[:-4] + 16 * angles[1:-3] - 30 * angles[2:-2] + 16 * angles[3:-1] - angles[4:]) / (12 * step**2)
    np.testing.assert_allclose(along.dq, velocity, atol=1e-6)
    np.testing.assert_allclose(along.ddq, bent, atol=1e-4)
    # N' Y by slow means: N by differences of the closed form
    h, q1, tree = 1e-5, samples.q[:, 0], DifferentialModel(robot.replace(closures=(), passive=()), Terms())
    N = (joint_angles(FOUR_BAR, q1 + h) - joint_angles(FOUR_BAR, q1 - h)) / (2 * h)
    projected = np.einsum("tj,tjp->tp", N, tree.instants(samples).reshape(len(q1), 3, -1))
    names = [column.name for column in tree.columns]
    W = projected[:, [names.index(name) for name in design.target.base.names]]
    assert np.linalg.cond(W) == pytest.approx(design.condition_number, rel=1e-6)


def test_a_crank_that_cannot_turn_all_round_stays_where_the_loop_closes() -> None:
    rocker = robot_of_text("rocker", linkage("rocker", (0.3, 0.2, 0.25, 0.4)))
    search = excite.Search(starts=1, executor="serial")
    design = excite.design_trajectory(rocker, search=search, floor="none", **OPTIONS)
    reach = np.arccos((0.3**2 + 0.4**2 - 0.45**2) / (2 * 0.3 * 0.4)) - START  # where coupler and rocker lie in line
    assert dense(design).q[:, 0].max() < reach
    assert design.feasible


def test_a_motion_through_a_singular_configuration_is_not_certified() -> None:
    motion = design_of("parallelogram").trajectory
    assert isinstance(motion, ClosedTrajectory)
    assert motion.proven[0].holds
    folding = replace(motion, x=motion.family.drawn(motion.x, np.array([0.5]), 4.0))
    (use,) = folding.proven
    assert not use.holds
    assert use.extreme == 0.0
    assert not np.any(np.isfinite(folding.jerk))


def test_a_stored_design_is_the_same_motion_of_all_joints(tmp_path: Path) -> None:
    design = design_of("four-bar", "energy")
    again = excite.load_design(saved(tmp_path / "design", design))
    assert isinstance(again.trajectory, ClosedTrajectory)
    assert again.series["joints"] == ["q1"]
    np.testing.assert_allclose(dense(again, 50).q, dense(design, 50).q, atol=1e-12)
    assert again.condition_number == design.condition_number
    for found, use in zip(again.limits, design.limits, strict=True):
        assert (found.label, found.method) == (use.label, use.method)
        assert found.extreme == pytest.approx(use.extreme, rel=1e-9)
    assert not again.believed
    head = (tmp_path / "design" / "trajectory.csv").read_text().splitlines()[0].split(",")
    assert [name for name in head if name.endswith("position")] == [f"q{k}.position" for k in (1, 2, 3)]
    search = excite.Search(starts=1, executor="serial", begin=tmp_path / "design")
    nearby = excite.design_trajectory(robot_of("four-bar"), model="energy", search=search, **OPTIONS)
    assert nearby.condition_number < 1.05 * design.condition_number


@pytest.mark.slow
def test_starts_in_other_processes_give_the_same_motion() -> None:
    searches = [excite.Search(starts=2, executor=executor, workers=2) for executor in ("serial", "process")]
    designs = [excite.design_trajectory(robot_of("four-bar"), search=search, **OPTIONS) for search in searches]
    assert designs[0].condition_number == designs[1].condition_number


def test_what_another_process_builds_from_is_pickled_without_what_was_compiled() -> None:
    formulation = formulate(robot_of("four-bar"), Task(robot_of("four-bar"), **OPTIONS))
    problem = formulation.problem
    x = random_motion(problem, np.random.default_rng(0))
    again = pickle.loads(pickle.dumps(formulation.blueprint)).problem()
    assert again.point(x, 2.0).value == problem.point(x, 2.0).value


def test_a_controller_is_told_the_joints_of_the_drives(tmp_path: Path) -> None:
    design = design_of("parallelogram")
    excite.export_motion(design, "npz", tmp_path / "motion.npz", rate=50.0)
    written_file = np.load(tmp_path / "motion.npz")
    assert written_file["joint_names"].tolist() == ["q1"]
    np.testing.assert_allclose(written_file["q"], design.trajectory.sampled(50.0).q[:, :1], atol=1e-12)


REFUSED: tuple[tuple[dict[str, object], str], ...] = (
    ({"home": (0.0, 0.0, 0.0)}, "an approach from `home` on straight lines of all joints does not support"),
    ({"model": "base-wrench"}, "a design for the base-wrench model does not support closed loops"),
    ({"drives": ("q1",)}, "`drives` cannot be chosen"),
    ({"joints": ("q1",)}, "cannot be locked one by one"),
    ({"velocity": None, "acceleration": None}, "no velocity or acceleration limit bounds joint q1"),
)


def test_what_cannot_be_designed_is_refused_in_a_sentence() -> None:
    robot = robot_of("four-bar")
    for options, message in REFUSED:
        with pytest.raises(InputError, match=message):
            excite.design_trajectory(robot, **{**OPTIONS, **options})
    with pytest.raises(InputError, match=r"no drive moves q[12], nor do the loops"):
        excite.design_trajectory(robot.replace(passive=("q1", "q2", "q3")), **OPTIONS)


def test_a_search_counts_what_it_takes_to_solve_loops() -> None:
    problems = [problem_of(name, "fourier", "differential")[0] for name in ("four-bar", "delta")]
    assert [problem.information.following for problem in problems] == [2, 9]
    plain = formulate(load_robot("irp6"), Task("irp6")).problem
    assert plain.information.following == 0
    assert problems[0].seconds > 3.0 * plain.seconds
