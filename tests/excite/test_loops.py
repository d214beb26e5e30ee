"""Linkages from their description to the verdict, with MuJoCo as the plant."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy
from commands import Here
from designed import PLANAR
from identified import relative
from linkages import FOUR_BAR, PARALLELOGRAM, STEP, followed, linkage, played, robot_of_text
from mechanisms import LEGS, delta, played as mechanism_played, quadruped
from written_files import text_file

import excite
from excite.design.design import Design
from excite.export.models.robot_yaml import robot_text
from excite.identification.identification import Identification
from excite.identification.servos import identify_servos
from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.base import random_states
from regressors.models.partial import of_loops
from regressors.readers.description import parse_description
from regressors.readers.library import load_robot
from regressors.readers.urdf import parse_urdf
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array

MODELS = ("energy", "differential")
NOISE = 0.05  # of the torques, which reach 3 to 6 Nm
CRANKS = {"four-bar": (FOUR_BAR, "", 0.2, 2.2), "parallelogram": (PARALLELOGRAM, 'range="-0.8 1.8"', 0.5, 1.1)}


@cache
def robot_of(name: str, friction: float = 0.0) -> Robot:
    lengths, limits, *_ = CRANKS[name]
    return robot_of_text(name, linkage(name, lengths, limits=limits, friction=friction))


@cache
def log_of(name: str, seed: int, noise: float = NOISE, friction: float = 0.0) -> dict[str, Array]:
    lengths, limits, middle, swing = CRANKS[name]
    text = linkage(name, lengths, limits=limits, friction=friction)
    return played(lengths, text, noise, seed, middle=middle, swing=swing)


def identified(name: str, seed: int, model: str, **options: object) -> Identification:
    """By least squares with given settings, which nothing chooses."""
    friction = float(options.pop("damping", 0.0))  # type: ignore[arg-type]
    task = Task(robot_of(name, friction), model=model, **options)
    return excite.identify(task, log_of(name, seed, NOISE, friction), choose=False)


def within(result: Identification) -> list[bool]:
    """Whether each 99 % interval holds the parameter of the description, which MuJoCo played."""
    low, high = result.estimate.interval.T
    return ((low <= result.reference.values) & (result.reference.values <= high)).tolist()


def true_torques(name: str, seed: int, coefficients: Array, model: str = "differential") -> float:
    """Relative error of predicted torques along another motion, whose torques have no noise."""
    log = log_of(name, seed, 0.0)
    task = Task(robot_of(name), model=model)
    result = excite.identify(task, log, choose=False)
    target, part = result.target_of_instants, result.prepared[0]
    predicted = target.model.instants(part.samples)[:, target.base.index] @ coefficients
    return relative(predicted, part.measured[:, 0])


@pytest.mark.parametrize("name", CRANKS)
def test_the_projected_model_with_true_parameters_has_the_torques_of_the_drive(name: str) -> None:
    result = identified(name, 1, "differential")
    assert true_torques(name, 7, result.reference.values) < 5e-3
    assert true_torques(name, 7, 1.1 * result.reference.values) > 0.05


def test_constrained_motion_shows_fewer_parameters_than_the_tree() -> None:
    bases = {}
    for name in CRANKS:
        robot = robot_of(name)
        bases[name] = [target_of(robot, Task(robot, model=model)).base for model in MODELS]
        opened = robot.replace(closures=(), passive=())
        tree = target_of(opened, Task(opened, model="energy")).base
        energy, projected = bases[name]
        assert energy.names == projected.names
        np.testing.assert_allclose(energy.D, projected.D, atol=1e-6)
        assert energy.rank < tree.rank
        assert min(energy.gap, projected.gap) > 1e6
    # the coupler of a parallelogram does not turn, so that it moves as a point on the crank; F1c and F1v with it
    assert [bases[name][0].rank for name in CRANKS] == [10, 5]


OPTIONS = {"velocity": (5.0,), "acceleration": (40.0,), "period": 4.0}


@cache
def designed(name: str, model: str, seed: int) -> Design:
    search = excite.Search(starts=2, seed=seed, executor="serial")
    return excite.design_trajectory(robot_of(name), model=model, search=search, **OPTIONS)


@pytest.mark.parametrize(("name", "model"), [("four-bar", "differential"), ("parallelogram", "energy")])
def test_a_linkage_is_identified_from_its_own_design_and_confirmed_by_another(name: str, model: str) -> None:
    design, other = (designed(name, model, seed) for seed in (0, 1))
    simulation = excite.simulate(design, noise=NOISE, seed=1)
    assert simulation.energy_residual < 1e-8
    assert simulation.truth["m1c1x"] > 0
    assert not np.any(simulation.log.effort[:, 1:])
    result = excite.identify(Task(robot_of(name), model=model), simulation, design=design, choose=False)
    assert all(within(result))
    assert result.condition_number == pytest.approx(design.condition_number, rel=0.02)
    assert excite.verify(result, excite.simulate(other, noise=NOISE, seed=2)).verdict.holds


def test_friction_of_a_drive_takes_work_in_a_simulation_and_is_identified() -> None:
    friction = FrictionCurves({"q1": CoulombViscous(coulomb=0.3, viscous=0.1)})
    design = designed("four-bar", "differential", 0)
    simulation = excite.simulate(design, friction=friction, noise=NOISE)
    assert simulation.record.loss > 1.0
    assert simulation.energy_residual < 1e-3 * simulation.record.loss
    result = excite.identify(robot_of("four-bar"), simulation, design=design, choose=False)
    found = dict(zip(result.names, zip(result.coefficients, result.estimate.half_width, strict=True), strict=True))
    for name, true in (("F1c", 0.3), ("F1v", 0.1)):
        value, half_width = found[name]
        assert abs(value - true) < half_width < 0.1


def test_mujoco_plays_a_design_and_its_parameters_are_found() -> None:
    design = designed("four-bar", "differential", 0)
    time = np.arange(round(design.trajectory.duration / STEP) + 1) * STEP
    crank = design.trajectory.independent.samples(np.minimum(time, design.trajectory.duration))
    wanted = (crank.q[:, 0], crank.dq[:, 0], crank.ddq[:, 0])
    log = followed(FOUR_BAR, linkage("four-bar", FOUR_BAR), NOISE, np.random.default_rng(3), *wanted)
    of_robot = {column: values for column, values in log.items() if not column.endswith("closure")}
    planned = excite.simulate(design, rate=500.0).log
    assert relative(planned.effort[100:-1, 0], log["q1.effort"][100:-1]) < 0.1  # its controller lags
    result = excite.identify(robot_of("four-bar"), of_robot, choose=False)
    assert np.mean(within(result)) >= 0.9
    assert true_torques("four-bar", 7, result.coefficients) < 0.01
    assert excite.verify(result, excite.simulate(designed("four-bar", "differential", 1), noise=NOISE)).verdict.holds


def test_drives_of_a_quadruped_that_bear_against_each_other_are_simulated_with_the_least_torques() -> None:
    loops, rng = of_loops(mechanism("quadruped")).loops, np.random.default_rng(0)
    states = loops.states(random_states(mechanism("quadruped"), 20))
    every = rng.normal(size=states.q.shape)
    torques = loops.drive_torques(states.q, every)
    assert not np.any(torques[:, :6])
    motion = of_loops(mechanism("quadruped"))
    np.testing.assert_allclose(motion.torques(states.q, torques), motion.torques(states.q, every), atol=1e-8)
    again = loops.drive_torques(states.q, torques)
    np.testing.assert_allclose(again, torques, atol=1e-8)  # nothing is left that does no work


def test_a_four_bar_is_identified_by_the_energy_of_its_motion_of_which_the_crank_alone_says_the_same() -> None:
    whole, log = identified("four-bar", 1, "energy"), log_of("four-bar", 1)
    assert whole.equations == (("work", "J"),)
    assert all(within(whole))
    assert true_torques("four-bar", 7, whole.coefficients) < 0.01
    crank = {column: values for column, values in log.items() if column.startswith(("time", "q1"))}
    alone = excite.identify(Task(robot_of("four-bar"), model="energy"), crank, choose=False)
    np.testing.assert_allclose(alone.coefficients, whole.coefficients, atol=1e-5)
    assert "q2, q3: not in the log, solved from q1" in alone.prepared[0].notes


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", CRANKS)
def test_the_truth_is_as_near_as_the_covariance_says_over_seeds(name: str, model: str) -> None:
    """Sum of ``d' C^-1 d`` over the seeds, chi-square distributed: parameters of one log err together."""
    results, distances = [identified(name, seed, model) for seed in range(10)], []
    for result in results:
        error = result.estimate.values - result.reference.values
        distances.append(error @ np.linalg.solve(result.estimate.covariance, error))
    assert np.sum(distances) < scipy.special.chdtri(10 * len(results[0].names), 1e-3)
    assert np.mean([within(result) for result in results]) >= 0.9
    errors = [true_torques(name, 77, result.coefficients) for result in results]
    assert np.median(errors) < 0.01


@pytest.mark.slow
def test_friction_of_passive_joints_is_found_where_it_is_asked_for() -> None:
    plain = identified("four-bar", 1, "energy", damping=0.05)
    asked = identified("four-bar", 1, "energy", damping=0.05, friction=("q1", "q2", "q3"))
    assert {"F2v", "F3v"}.isdisjoint(plain.names)
    found = dict(zip(asked.names, zip(asked.estimate.values, within(asked), strict=True), strict=True))
    assert found["F2v"][1]
    assert found["F2v"][0] == pytest.approx(0.05, abs=0.02)
    assert all(within(asked))
    # without these columns the drive's friction takes the losses up, and the residual is no noise any longer
    assert dict(zip(plain.names, plain.coefficients, strict=True))["F1v"] > 0.03
    assert plain.training_error > 1.2 * asked.training_error
    wide, usual = (dict(zip(one.names, one.estimate.half_width, strict=True)) for one in (plain, asked))
    assert wide["m1c1x"] > 3.0 * usual["m1c1x"]


# ---------------------------------------------------------------- a delta, and a quadruped on its feet


@cache
def mechanism(name: str) -> Robot:
    return robot_of_text(name, delta() if name == "delta" else quadruped())


def test_a_body_that_moves_freely_and_stands_on_its_feet_has_six_joints_without_drives() -> None:
    robot = mechanism("quadruped")
    assert robot.joint_names[6:] == LEGS
    assert robot.passive == robot.joint_names[:6]
    assert [joint.kind for joint in robot.joints[:6]] == 3 * ["prismatic"] + 3 * ["revolute"]
    np.testing.assert_allclose([joint.axis for joint in robot.joints[:6]], np.eye(3)[[0, 1, 2, 2, 1, 0]])
    assert "m5c5x" in robot.structure.zero  # of a link between two joints of the trunk
    assert "m6c6x" not in robot.structure.zero
    assert [closure.bodies[1] for closure in robot.closures] == 4 * ["base"]
    moved = robot.links[5].theta
    assert moved[0] == 6.9


def test_a_thing_that_is_fastened_to_the_world_is_no_foot() -> None:
    thing = '<body name="box" pos="1 0 1"><freejoint/><geom size="0.1" mass="1"/></body></worldbody>'
    fastened = '<equality><weld body1="box" body2="world"/>'
    text = linkage("beside", FOUR_BAR).replace("</worldbody>", thing).replace("<equality>", fastened)
    robot = robot_of_text("beside", text)
    assert robot.joint_names == ("q1", "q2", "q3")
    assert len(robot.closures) == 1


def test_white_noise_of_more_drives_than_move_on_their_own_is_white_in_the_equations() -> None:
    motion = of_loops(mechanism("quadruped"))
    assert motion.loops.redundant
    q = motion.loops.states(random_states(mechanism("quadruped"), 3)).q
    rows = np.array([[motion.torques(one[None], np.eye(18)[[k]])[0] for k in motion.loops.driven] for one in q])
    np.testing.assert_allclose(np.swapaxes(rows, 1, 2) @ rows, np.broadcast_to(np.eye(6), (3, 6, 6)), atol=1e-9)


@pytest.mark.parametrize("name", ["delta", "quadruped"])
def test_true_parameters_have_the_torques_of_all_drives_but_for_what_the_closures_bear(name: str) -> None:
    robot = mechanism(name)
    log, _ = mechanism_played(name, 0.0, 7, period=2.0)
    result = excite.identify(Task(robot, friction=False), log, choose=False)
    target, part = result.target_of_instants, result.prepared[0]
    predicted = target.model.instants(part.samples)[:, target.base.index] @ result.reference.values
    projected = of_loops(robot).torques(part.samples.q, part.measured).ravel()
    assert relative(predicted, projected) < 4e-3
    if of_loops(robot).loops.redundant:  # what the drives bear against each other turns with the legs
        standing = part.measured @ of_loops(robot).matrix
        assert relative(predicted, standing.ravel()) > 0.02


def test_a_drive_that_follows_others_is_in_the_log_too() -> None:
    log, _ = mechanism_played("quadruped", 0.0, 7, period=0.5)
    absent = {name: values for name, values in log.items() if not name.startswith("fl2")}
    with pytest.raises(InputError, match="no position of fl2; give those of fl1, fl2, fl3, fr1, "):
        excite.identify(mechanism("quadruped"), absent, choose=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["delta", "quadruped"])
def test_mechanisms_are_identified_confirmed_by_another_log_and_written_into_their_file(
    name: str, tmp_path: Path
) -> None:
    log, other = (mechanism_played(name, NOISE, seed)[0] for seed in (1, 2))
    result = excite.identify(mechanism(name), log, choose=False)
    assert np.mean(within(result)) >= 0.95
    judged = excite.verify(result, other)
    assert judged.verdict.holds
    assert set(judged.verdict.confirmed) == set(of_loops(mechanism(name)).labels)
    own = text_file(tmp_path / f"{name}.xml", delta() if name == "delta" else quadruped())
    result.save(tmp_path / "result")
    excite.export_model(tmp_path / "result", "mjcf", tmp_path / "new.xml", robot_file=own)
    again = excite.identify(load_robot(tmp_path / "new.xml"), other, choose=False)
    assert again.names == result.names
    target = again.target_of_instants
    W = target.model.instants(again.prepared[0].samples)[:, target.base.index]
    assert relative(W @ np.nan_to_num(again.reference.values), W @ np.nan_to_num(result.coefficients)) < 0.02


_ALONE = 'lower="-2.5" upper="2.5" velocity="3" effort="60"/>'
_FOLLOWS = 'lower="-0.9" upper="0.9" velocity="3" effort="60"/><mimic joint="j1" multiplier="-1.25" offset="0.1"/>'


def test_a_joint_that_mimics_another_is_designed_for_identified_and_written_back(tmp_path: Path) -> None:
    robot = parse_urdf(PLANAR.replace(_ALONE, _FOLLOWS))
    search = excite.Search(starts=2, executor="serial")
    searches = (replace(search, seed=seed) for seed in (0, 1))
    design, other = (excite.design_trajectory(robot, search=s, acceleration=(5.0,), period=4.0) for s in searches)
    q = design.samples.q
    np.testing.assert_allclose(q[:, 1], 0.1 - 1.25 * q[:, 0], atol=1e-12)
    assert np.abs(q[:, 1]).max() <= 0.9 < np.abs(1.25 * q[:, 0]).max() + 0.2  # its range binds, not that of j1
    simulation = excite.simulate(design, noise=NOISE, seed=1)
    result = excite.identify(robot, simulation, design=design, choose=False)
    assert all(within(result))
    assert excite.verify(result, excite.simulate(other, noise=NOISE, seed=2)).verdict.holds
    result.save(tmp_path / "result")
    excite.export_model(tmp_path / "result", "urdf", tmp_path / "new.urdf")
    again = load_robot(tmp_path / "new.urdf")
    assert (again.closures, again.passive) == (robot.closures, robot.passive)
    with pytest.raises(InputError, match="loops, and it has the joint j2 that follows j1; read a part"):
        excite.plan_friction(robot)
    assert parse_description(robot_text(robot), "planar.yaml").sha256() == robot.sha256()


def test_robot_yaml_holds_the_loops() -> None:
    robot = robot_of("four-bar")
    assert parse_description(robot_text(robot), "four-bar.yaml").sha256() == robot.sha256()
    (closure,) = robot.closures
    turned = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    welded = robot.replace(closures=(replace(closure, axes=turned),))
    assert parse_description(robot_text(welded), "welded.yaml").closures[0].axes == turned
    text = robot_text(robot).replace("bodies: [coupler, rocker]", "bodies: [coupler, bar]")
    with pytest.raises(InputError, match="no body of robot 'four-bar', in the loop"):
        parse_description(text, "four-bar.yaml")
    with pytest.raises(InputError, match=r"loops.*expected bodies and points, or joints"):
        parse_description(robot_text(robot).replace("bodies: [coupler, rocker]", "joints: [q1, q2]"), "four-bar.yaml")
    with pytest.raises(InputError, match=r"loops.*at least 2 items"):
        parse_description(robot_text(robot).replace("[coupler, rocker]", "[coupler]"), "four-bar.yaml")


LOGS: tuple[tuple[dict[str, Array | None], str], ...] = (
    ({"q1.position": None, "q1.effort": None}, "no position of q1; give those of q1, from which"),
    ({"q2.effort": np.ones(2001)}, "torques of q2 are not zero, but no drive acts"),
    ({"q2.position": np.zeros(2001)}, "joint q2 deviates by .* from a motion of q1 alone"),
)


def test_logs_that_do_not_fit_are_refused() -> None:
    for changed, message in LOGS:
        log = {name: x for name, x in {**log_of("four-bar", 1), **changed}.items() if x is not None}
        with pytest.raises(InputError, match=message):
            excite.identify(Task(robot_of("four-bar"), model="energy"), log, choose=False)


def test_what_does_not_know_loops_says_so() -> None:
    robot, log = robot_of("four-bar"), log_of("four-bar", 1)
    loops = "does not support closed loops, and it has the loop that closes between coupler and rocker; read a "
    with pytest.raises(InputError, match=f"a bound on criteria over all motions {loops}"):
        excite.bound(designed("four-bar", "differential", 0))
    with pytest.raises(InputError, match=f"a campaign of partial motions {loops}"):
        excite.plan_campaign(robot)
    with pytest.raises(InputError, match=f"a plan of runs at constant speed {loops}"):
        excite.plan_friction(robot)
    with pytest.raises(InputError, match=f"the identification of servos {loops}"):
        identify_servos(robot, log)
    with pytest.raises(InputError, match=f"the identification of a payload {loops}"):
        excite.identify_payload(robot, log, without=log_of("four-bar", 2))
    with pytest.raises(InputError, match="joints of a robot with closed loops cannot be locked one by one"):
        excite.identify(Task(robot, joints=("q1",)), log)
    with pytest.raises(InputError, match="cannot be chosen"):
        excite.identify(Task(robot, drives=("q1",)), log)


@pytest.mark.slow
def test_the_whole_way_in_the_shell(here: Here) -> None:
    def done(*words: str) -> str:
        return here.run(*words, status=0).stdout

    text_file(here.cwd / "bar.xml", linkage("bar", FOUR_BAR))
    for name, seed in (("run.csv", 1), ("other.csv", 2)):
        log = log_of("four-bar", seed)
        head = ",".join(log)
        np.savetxt(here.cwd / name, np.column_stack(list(log.values())), delimiter=",", header=head, comments="")
    told = "not free: the loop that closes between coupler and rocker; moved by q1; passive: q2, q3"
    assert told in done("robots", "bar.xml")
    done("identify", "bar.xml", "run.csv", "--model", "energy", "--out", "result", "--figures", "none")
    done("verify", "result", "other.csv", "--figures", "none")
    done("report", "result", "--out", "page.html")
    for file, *words in (("bar.yaml", "yaml"), ("own.xml", "mjcf", "--robot-file", "bar.xml"), ("bar.urdf", "urdf")):
        done("export", "result", "--out", file, "--format", *words)
    found = excite.load_result(here.cwd / "result")
    assert found.robot.closures == robot_of("four-bar").closures
    for file in ("bar.yaml", "own.xml"):
        again = excite.identify(file, here.cwd / "other.csv", model="energy", choose=False)
        np.testing.assert_allclose(again.reference.values, found.coefficients, rtol=1e-4, atol=1e-6)
