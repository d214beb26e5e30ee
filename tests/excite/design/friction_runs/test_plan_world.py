"""Friction plans among obstacles: distances of all runs against Coal, poses chosen, strokes bounded, what is told."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from coal_distances import clearance
from commands import Here
from slow_dynamics import random_chain

from constraints.geometry import Box, HalfSpace, Obstacle, Part, World
from constraints.world_file import world_of
from excite.design.friction_runs.friction_plan import CoordinatePlan, FrictionPlan
from excite.design.friction_runs.plan_friction import plan_friction
from excite.design.friction_runs.pose import CollisionChecks
from excite.design.friction_runs.runs import Pace, Runs
from excite.design.friction_runs.schedule import Schedule
from excite.tasks.limit_choice import LimitChoice
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in
from regressors.robot.shapes import Capsule
from regressors.samples import Array

SHORT = Schedule(percent=(5.0, 50.0, 100.0), warm_up=5.0, breakaways=1, creeping=1.0, rate=100.0)
PARTS = (
    Part("column", Capsule((0.0, 0.0, -0.45), (0.0, 0.0, 0.0), 0.15)),
    Part("arm", Capsule((0.05, 0.0, 0.0), (0.455, 0.0, 0.0), 0.07)),
    Part("forearm", Capsule((-0.2, 0.0, 0.0), (0.67, 0.0, 0.0), 0.06)),
    Part("wrist_turn", Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.1), 0.05)),
)
CRATE = Obstacle("crate", Box((0.7, 0.0, 0.75), (0.3, 0.3, 0.3)))
POST = Obstacle("post", Capsule((0.3, 0.8, 0.0), (0.3, 0.8, 1.5), 0.05))
WITHOUT = LimitChoice(floor="none", self_collision=False)
FLOOR = Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), -0.05))


def cell(*obstacles: Obstacle) -> World:
    return World(PARTS, obstacles, clearance=0.02, ignored=(("wrist_turn", "forearm"),))


@cache
def among_all() -> FrictionPlan:
    return plan_friction(built_in("irp6"), SHORT, drives=("1", "3"), world=cell(CRATE, POST, FLOOR))


def passed(c: CoordinatePlan, count: int) -> Array:
    """Poses from end to end of all that a coordinate's samples pass."""
    q = c.samples()[0].q
    s = (q - c.place.pose) @ np.linalg.pinv(c.line[:, None])[0]
    return c.place.pose + np.linspace(s.min(), s.max(), count)[:, None] * c.line


@pytest.mark.slow
def test_every_run_keeps_the_distances_that_coal_measures() -> None:
    plan = among_all()
    world = plan.world
    assert plan.holds
    for c in plan.coordinates:
        assert c.distances
        for d in c.distances:
            nearest = min(clearance(plan.robot, world, d.use.label, q) for q in passed(c, 25))
            assert nearest >= world.clearance
            assert d.use.extreme <= nearest + 1e-6
            if nearest < 0.1:
                assert d.use.extreme >= nearest - world.tolerance - 5e-3
            there = c.place.pose + (d.at - c.centre) * c.line
            here = clearance(plan.robot, world, d.use.label, there)
            assert here == pytest.approx(d.use.extreme, abs=world.tolerance + 2e-3)
            moved = c.runs.values(np.array([d.use.time]))[0][0, 0]
            assert moved == pytest.approx(d.at - c.centre, abs=1e-9)


@pytest.mark.slow
def test_another_pose_is_looked_for_where_the_best_one_is_not_free() -> None:
    robot, schedule = built_in("irp6"), Schedule(percent=(5.0, 100.0), warm_up=0.0, breakaways=0, rate=100.0)
    in_the_way = Obstacle("crate", Box((0.75, 0.0, 1.25), (0.2, 0.3, 0.2)))
    (alone,) = plan_friction(robot, schedule, drives=("2",), limits=WITHOUT).coordinates
    (about,) = plan_friction(robot, schedule, drives=("2",), world=cell(in_the_way)).coordinates
    assert (alone.place.gravity, about.place.gravity) == ("cancels", "cancels")
    assert alone.distances is None
    assert np.abs(about.place.pose - alone.place.pose).max() > 0.1
    assert about.place.pose[1] == pytest.approx(0.0, abs=1e-6)  # the arm stands upright still
    assert not about.too_near
    assert about.distances
    kept = plan_friction(robot, schedule, drives=("2",), pose=alone.place.pose, world=cell(in_the_way)).coordinates[0]
    assert kept.too_near or kept.stroke < about.stroke


def test_a_stroke_ends_where_something_comes_too_near() -> None:
    world = cell(CRATE)
    plan, of_limits = (
        plan_friction(built_in("irp6"), SHORT, drives=("3",), pose=np.zeros(5), **given)
        for given in ({"world": world}, {"limits": LimitChoice(world=world)})
    )
    assert of_limits.coordinates[0].distances == plan.coordinates[0].distances
    (c,) = plan.coordinates
    assert plan.holds
    assert c.place.obstacle == c.place.below == "forearm to crate"
    assert c.stroke == pytest.approx(c.place.half)
    assert "beyond it, forearm to crate is too near" in c.left_out[0].reason
    line, end = c.line, c.place.pose + c.place.low * c.line
    there = clearance(plan.robot, world, "forearm to crate", end)
    assert world.clearance <= there <= world.clearance + world.tolerance + 1e-3
    assert clearance(plan.robot, world, "forearm to crate", end - 0.02 * line) < world.clearance


def test_a_given_pose_in_which_something_is_too_near_is_kept_and_told() -> None:
    pose = np.array([0.0, -0.3, -0.3, 0.0, 0.0])
    plan = plan_friction(built_in("irp6"), SHORT, drives=("1",), pose=pose, world=cell(CRATE, POST))
    (c,) = plan.coordinates
    assert not plan.holds
    assert not c.broken
    np.testing.assert_array_equal(c.place.pose, pose)
    labels = [d.use.label for d in c.too_near]
    assert "forearm to crate" in labels
    margins = [d.use.margin for d in c.too_near]
    assert margins == sorted(margins)
    assert margins[-1] < 0.0


@pytest.mark.parametrize("seed", range(4))
def test_free_stretches_are_those_of_dense_distances(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain("rrr", rng)
    ball = tuple(float(x) for x in rng.uniform(0.4, 1.0, 3))
    parts = tuple(Part(link.name, Capsule((0.0, 0.0, 0.0), (0.3, 0.1, 0.0), 0.05)) for link in robot.links)
    world = World(parts, (Obstacle("ball", Capsule(ball, ball, 0.3)),), self_collision=False)
    around = CollisionChecks(robot, world)
    pose, line = rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)
    found = around.free(pose, line, -2.0, 2.0)
    s = np.linspace(-2.0, 2.0, 161)
    inside = np.array([any(part.low <= x <= part.high for part in found) for x in s])
    labels = [f"{link.name} to ball" for link in robot.links]
    apart = np.array([min(clearance(robot, world, label, pose + x * line) for label in labels) for x in s])
    assert np.all(apart[inside] >= world.clearance)
    assert np.all(apart[~inside] <= world.clearance + world.tolerance + 5e-3)
    likely = around.likely(pose, line, -2.0, 2.0)
    assert [part.low for part in likely] == pytest.approx([part.low for part in found], abs=4.0 / 256)
    for part in found:
        assert bool(part.below) == (part.low > -2.0)
        assert bool(part.above) == (part.high < 2.0)


def test_what_is_thinner_than_any_sampling_is_found() -> None:
    """A wire right across the path, of which no pose looked at shows anything."""
    part = Part("forearm", Capsule((0.6, 0.0, 0.0), (0.6, 0.0, 0.0), 1e-4))
    wire = Obstacle("wire", Capsule((0.6, 0.0215, 0.5), (0.6, 0.0215, 1.5), 1e-4))
    around = CollisionChecks(built_in("irp6"), World((part,), (wire,), clearance=1e-4, tolerance=1e-4))
    line = np.eye(5)[0]
    assert len(around.likely(np.zeros(5), line, -1.0, 1.0)) == 1
    stretches = around.free(np.zeros(5), line, -1.0, 1.0)
    assert [(part.below, part.above) for part in stretches] == [("", "forearm to wire"), ("forearm to wire", "")]


def test_a_position_is_timed_where_it_is_passed_first() -> None:
    runs = Runs(Pace(1.0, 2.0, 20.0, ()), 100.0)
    for end in (0.5, -0.7, 0.7):
        runs.wait(0.3)
        runs.go("there", end, 1.0)
    for position in (0.2, 0.5, -0.3, -0.7, 0.65, 0.0):
        time = runs.first_at(position)
        assert runs.values(np.array([time]))[0][0, 0] == pytest.approx(position, abs=1e-9)
        before = np.linspace(0.0, time, 400)[:-1]
        passing = runs.values(before)[0][0]
        assert not np.any((passing[:-1] - position) * (passing[1:] - position) < -1e-18)


def test_straight_lines_from_pose_to_pose_are_judged() -> None:
    robot = built_in("irp6").replace(home=np.array([1.5, 0.0, 0.0, 0.0, 0.0]))
    world = cell(Obstacle("wall", Box((0.5, 0.7, 1.0), (0.6, 0.05, 2.0))))
    plan = plan_friction(robot, SHORT, drives=("5", "4"), pose=np.zeros(5), world=world)
    assert [(p.start, p.end) for p in plan.passages] == [("home", "z5"), ("z5", "z4")]
    assert plan.passages[0].obstacle.endswith("to wall")
    assert plan.passages[1].obstacle == ""


def test_distances_are_stored(tmp_path: Path) -> None:
    plan = among_all()
    plan.save(tmp_path)
    content = json.loads((tmp_path / "plan.json").read_text())
    assert world_of(content["world"]) == plan.world
    for c, written in zip(plan.coordinates, content["trajectories"], strict=True):
        assert [d["label"] for d in written["distances"]] == [d.use.label for d in c.distances]
        assert [d["at"] for d in written["distances"]] == [d.at for d in c.distances]
        assert all(d["holds"] and d["method"] == "enclosed" for d in written["distances"])


def test_worlds_that_do_not_fit() -> None:
    for world, kind, message in (
        (World((Part("elbow", PARTS[1].capsule),)), UnknownName, "no link of robot 'irp6' named 'elbow'"),
        (cell(Obstacle("desk", Box((0.3, 0.0, 0.4), (0.29, 1.0, 0.2)))), InputError, "column to desk: they are 0.00"),
        (
            cell(Obstacle("ceiling", HalfSpace((0.0, 0.0, -1.0), -0.9))),
            InputError,
            "z2: no pose was found .* in the first one that was tried arm to ceiling are too close",
        ),
    ):
        with pytest.raises(kind, match=message):
            plan_friction(built_in("irp6"), SHORT, drives=("2",), world=world)


@pytest.mark.slow
def test_the_command_tells_what_is_too_near(here: Here) -> None:
    tmp_path = here.cwd
    (tmp_path / "world.yaml").write_text(json.dumps(cell(CRATE, POST, FLOOR).to_dict()))
    short = ("--speeds", "5,100", "--warm-up", "0", "--breakaways", "0", "--rate", "50", "--world", "world.yaml")
    found = here.run("friction", "plan", "irp6", "--out", "found", "--drives", "3", *short, status=0)
    told = " ".join(found.stdout.split())
    assert "z3: nearest is" in told
    assert "distances hold in every position that a run passes" in told
    given = here.run("friction", "plan", "irp6", "--out", "given", "--drives", "3", "--pose", "0,-0.3,-0.3,0,0", *short)
    assert given.returncode == 1, given.stderr
    told = " ".join(given.stdout.split())
    assert "z3: forearm to crate are in collision at z3 = -0.6" in told
    assert "0.02 m must be kept" in told
    assert "leave out --pose to let the plan choose one" in told
    assert (tmp_path / "given" / "plan.json").exists()
    alone = {"robot": [{"link": "arm", "from": [0.0, 0.0, 0.0], "radius": 0.1}]}
    (tmp_path / "world.yaml").write_text(json.dumps(alone))
    nothing = here.run("friction", "plan", "irp6", "--out", "nothing", "--drives", "5", "--longest", "1", *short)
    assert nothing.returncode == 0, nothing.stderr
    assert "no two bodies that are known can collide" in " ".join(nothing.stdout.split())
    missing = here.run("friction", "plan", "irp6", "--out", "other", "--world", "nothing.yaml")
    assert (missing.returncode, "cannot read world file nothing.yaml" in missing.stderr) == (2, True)


def test_by_default_the_robot_keeps_clear_of_the_floor_and_of_itself() -> None:
    plan = plan_friction("ur10e", SHORT, drives=("shoulder_lift_joint",))
    (c,) = plan.coordinates
    assert [each.limit for each in plan.unchecked] == ["obstacles"]
    assert any(d.use.label.endswith("to floor") for d in c.distances)
    assert plan.holds
    for d in c.distances:
        nearest = min(clearance(plan.robot, plan.world, d.use.label, q) for q in passed(c, 9))
        assert nearest >= (0.02 if d.use.label.endswith("to floor") else 0.001)
    free = plan_friction("ur10e", SHORT, drives=("shoulder_lift_joint",), limits=WITHOUT)
    assert (free.world, free.coordinates[0].distances) == (None, None)
    assert {each.limit for each in free.unchecked} == {"obstacles", "floor", "self-collision"}
