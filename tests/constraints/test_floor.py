"""The surface that a robot is mounted on: where it is, who stands on it, and what keeps away from it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from coal_distances import clearance, link_poses
from public_arms import ARMS
from refused import refusal
from slow_dynamics import random_chain
from written_files import saved, text_file

import excite
from constraints.clearance import (
    CLEARANCE,
    assumed_radius,
    mounting_surface,
    moving_heights,
    skeleton,
    upwards,
    why_not_mounted,
)
from constraints.collision_limits import Clearance, SelfCollisions
from constraints.enclosure import enclose
from constraints.geometry import HalfSpace, Obstacle, Part, World
from constraints.shapes import carried_links, lowest_point
from constraints.world_file import UrdfShapes, world_of
from excite.design.design_json import load_design
from excite.design.formulation import formulate
from excite.design.initial_guesses import random_motion
from excite.design.stated_limits import StatedWorld, stated_world
from excite.design.task_file import task_content, task_from_options
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import Task
from excite.trajectories.family import Trajectory
from regressors.errors import InputError
from regressors.models.partial import of_joints
from regressors.readers.library import built_in
from regressors.robot.robot import Robot
from regressors.robot.shapes import Capsule

CUP = World(
    (Part("wrist_3_link", Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.1), 0.05)),),
    (Obstacle("table", HalfSpace((0.0, 0.0, 1.0), -0.3)),),
)


def stated(task: Task) -> StatedWorld:
    return stated_world(installed_robot(task), task)


def surface(task: Task) -> Obstacle | None:
    """The surface that a task's robot is mounted on, where it is checked."""
    world = stated(task).world
    return None if world is None else next(iter(world.obstacles), None)


def plane(task: Task) -> tuple[tuple[float, ...], float]:
    """Normal and height of the surface."""
    obstacle = surface(task)
    return tuple(float(round(x, 12)) + 0.0 for x in obstacle.shape.normal), obstacle.shape.offset


def reason(task: Task) -> str:
    """Why the surface is not checked."""
    names = ("floor", "wall", "ceiling")
    return next(each.reason for each in stated(task).unchecked if each.limit in names)


STANDING = {  # chain, height of the lowest point of its base as the meshes, boxes or feet in the file have it [m]
    "panda-hand": 0.0, "ur10": 0.0, "z1": 0.0, "so101": -0.0024, "tiago-torso-arm": 0.0, "baxter-left": -1.0428,
    "go2-leg": -0.449,
}  # fmt: skip
NOT_STANDING = {
    "talos-left-arm-alone": "arm_left_7_link is 0.72 m below the base",
    "alexander-leg": "RIGHT_ANKLE_Y_LINK is 0.89 m below the base",
}


def of_public(name: str, **options: object) -> Task:
    arm = next(arm for arm in ARMS if arm.id == name)
    return Task(str(arm.path), base_link=arm.base, tip=arm.tip, **options)


def some(rows: dict[str, object]) -> list[object]:
    """Rows as parameters; reading the meshes of large robots takes seconds."""
    small = ("panda-hand", "ur10", "xarm7", "z1", "kinova", "alexander-leg")
    return [pytest.param(*row, id=row[0], marks=[pytest.mark.slow] * (row[0] not in small)) for row in rows.items()]


@pytest.mark.parametrize(("name", "height"), some(STANDING))
def test_an_arm_stands_on_the_lowest_point_of_its_base(name: str, height: float) -> None:
    normal, offset = plane(of_public(name, self_collision=False))
    assert normal == (0.0, 0.0, 1.0)
    assert offset == pytest.approx(height, abs=1e-3)


@pytest.mark.parametrize(("name", "why"), some(NOT_STANDING))
def test_what_hangs_below_its_base_does_not_stand_there(name: str, why: str) -> None:
    reasons = {each.limit: each.reason for each in stated(of_public(name, self_collision=False)).unchecked}
    assert why in reasons["floor"]
    assert "`floor` states its height" in reasons["floor"]
    assert surface(of_public(name, self_collision=False, floor=-1.5)) is not None


def test_where_no_joint_raises_a_known_shape_a_stated_floor_is_not_checked_either(tmp_path: Path) -> None:
    path = text_file(tmp_path / "post.urdf", URDF.format('<sphere radius="1"/>'))
    for floor in ("auto", -1.5):
        assert "no joint raises or lowers a known shape" in reason(Task(str(path), floor=floor))
        assert surface(Task(str(path), floor=floor, tool_point=(0.3, 0.0, 0.0))) is not None


def test_a_share_of_the_poses_must_be_above_it(tmp_path: Path) -> None:
    """A level boom that can hardly be raised hangs from its post, one that can stands on it."""
    path = tmp_path / "post.urdf"
    parts = (Part("arm", Capsule((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1)),)
    reasons = []
    for lower in (-0.01, -0.1):
        path.write_text(URDF.format('<sphere radius="1"/>').replace('lower="-1"', f'lower="{lower}"'), encoding="utf-8")
        robot = excite.load_robot(str(path))
        heights = moving_heights(robot, parts, mounting_surface("floor", upwards(robot), 0.99))
        reasons.append(why_not_mounted(heights))
    assert reasons == [reasons[0], None]
    assert "% of " in reasons[0]


@pytest.mark.parametrize(
    ("options", "name"),
    [({"mount": "wall"}, "wall"), ({"mount": (0.3, -0.2, 1.0)}, "floor"), ({"gravity": (0.0, 9.81, 0.0)}, "floor")],
)
def test_the_surface_turns_with_the_base(options: dict[str, object], name: str) -> None:
    """Gravity turns in the axes of the base, what the base is screwed to does not."""
    task = Task("ur10e", self_collision=False, **options)
    assert plane(task) == ((0.0, 0.0, 1.0), 0.0)
    assert surface(task).name == name


def test_its_height_can_be_given_and_it_can_be_left_out() -> None:
    assert plane(Task("ur10e", self_collision=False, floor=-0.5)) == ((0.0, 0.0, 1.0), -0.5)
    for floor in ("none", None):
        task = Task("ur10e", self_collision=False, floor=floor)
        assert surface(task) is None
        assert reason(task) == "left out on request"


def test_a_height_that_no_pose_keeps_is_refused_and_what_is_always_below_it_is_told() -> None:
    with pytest.raises(InputError, match=r"`floor`: no pose is above it, wrist_3_link stays 1\.5\d m below"):
        stated(Task("ur10e", self_collision=False, floor=3.0))
    world = stated(task := Task("ur10e", self_collision=False, floor=0.4)).world
    notes = low_limits(installed_robot(task), world).notes
    told = [f"{link} to floor: not checked in full" for link in ("shoulder_link", "upper_arm_link")]
    assert [note.split(",")[0] for note in notes] == told
    assert "0.37 m below it" in notes[0]


def test_left_out_it_is_the_first_of_what_is_not_checked() -> None:
    made = formulate(built_in("irp6"), Task("irp6", floor="none", self_collision=False, harmonics=3))
    assert [each.limit for each in made.unchecked] == ["floor", "self-collision", "jerk", "obstacles"]


def test_a_plane_of_the_world_stands_for_it() -> None:
    assert stated(Task("ur10e", world=CUP)) == StatedWorld()
    wall = dataclasses.replace(CUP, obstacles=(Obstacle("wall", HalfSpace((1.0, 0.0, 0.0), -0.9)),))
    world = stated(Task("ur10e", world=wall)).world
    assert [each.name for each in world.obstacles] == ["floor"]
    assert world.parts == CUP.parts


@pytest.mark.parametrize("value", [True, "below", float("inf"), float("nan"), 1e9])
def test_wrong_heights_are_refused(value: object) -> None:
    assert "floor" in refusal(Task, "ur10e", floor=value)


def low_limits(robot: Robot, world: World) -> Clearance:
    """The one limit of heights above the surface."""
    (limit,) = SelfCollisions(world).imposed(robot, of_joints(robot, range(robot.n)))
    return limit


@pytest.mark.parametrize("seed", range(3))
def test_distances_are_those_of_coal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain("rrpr", rng)
    floor = mounting_surface("floor", rng.normal(size=3), -5.0)
    world = World(skeleton(robot, 0.05), (floor,), self_collision=False)
    limit = low_limits(robot, world)
    for q in rng.uniform(-2, 2, (5, robot.n)):
        values = limit.at_rest(q)
        for label in set(limit.labels):
            own = min(value for each, value in zip(limit.labels, values, strict=True) if each == label)
            moving = [pair for pair in limit.pairs if pair.label == label]
            parts = tuple(Part(pair.link, capsule) for pair in moving for capsule in pair.capsules)
            assert own == pytest.approx(clearance(robot, dataclasses.replace(world, parts=parts), label, q), abs=1e-9)


def test_a_pedestal_and_ends_that_never_leave_it_are_no_limits() -> None:
    """The column turns about the normal, the arm's foot stays at its height: only the arm's far end counts."""
    robot = built_in("irp6")
    column = Part("column", Capsule((0.0, 0.0, -0.7), (0.3, 0.0, 0.0), 0.1))
    parts = (column, Part("arm", Capsule((0.0, 0.0, 0.0), (0.455, 0.0, 0.0), 0.1)))
    world = World(parts, (mounting_surface("floor", upwards(robot), 0.65),), self_collision=False)
    (pair,) = low_limits(robot, world).pairs
    assert pair.link == "arm"
    assert pair.capsules == (Capsule((0.455, 0.0, 0.0), (0.455, 0.0, 0.0), 0.1),)
    assert pair.clearance == CLEARANCE


def test_a_motion_is_certified_between_samples() -> None:
    """No height over a fine grid, by Pinocchio and Coal, is below the certified one, which is not far from it."""
    task = Task("ur10e", self_collision=False, harmonics=3, period=5.0)
    made = formulate(built_in("ur10e"), task)
    x = random_motion(made.problem, np.random.default_rng(0))
    motion = Trajectory(made.problem.family, x)
    (limit,) = [each for each in made.stated if isinstance(each, Clearance)]
    uses = {use.label: use.extreme for use in enclose(limit, motion.samples, 5.0, motion.jerk).uses(limit)}
    assert set(uses) == {f"{link.name} to floor" for link in made.target.robot.links[1:]}
    instants = motion.samples(np.linspace(0.0, 5.0, 801)).q
    for pair in limit.pairs:
        certified, parts = uses[pair.label], tuple(Part(pair.link, capsule) for capsule in pair.capsules)
        world = dataclasses.replace(limit.world, parts=parts, ignored=())
        sampled = min(clearance(made.target.robot, world, pair.label, q) for q in instants)
        assert sampled - 2e-3 < certified <= sampled + 1e-9


@pytest.mark.slow
def test_a_design_of_a_ur10e_stays_above_its_table(tmp_path: Path) -> None:
    design = excite.design_trajectory("ur10e", starts=1, harmonics=3, executor="serial")
    assert design.feasible
    world = design.shape
    poses = design.trajectory.samples(np.linspace(0.0, 10.0, 2001)).q
    for link in design.robot.links[1:]:
        assert min(clearance(design.robot, world, f"{link.name} to floor", q) for q in poses[::4]) >= CLEARANCE
    lowest = min(link_poses(design.robot, q)["wrist_3_link"].translation[2] for q in poses)
    free = excite.design_trajectory("ur10e", starts=1, harmonics=3, executor="serial", floor="none")
    assert min(link_poses(free.robot, q)["wrist_3_link"].translation[2] for q in poses_of(free)) < 0.0 < lowest
    again = load_design(saved(tmp_path / "d", design))
    extremes = ({use.label: use.extreme for use in each.limits} for each in (again, design))
    assert next(extremes) == pytest.approx(next(extremes), abs=1e-9)


def poses_of(design: excite.Design) -> np.ndarray:
    return design.trajectory.samples(np.linspace(0.0, design.trajectory.duration, 2001)).q


def test_limits_that_motions_break_are_imposed_at_once() -> None:
    problem = formulate(built_in("ur10e"), Task("ur10e", self_collision=False)).problem
    at_once = {label for limit in problem.limits.nonlinear for label in limit.function.constraint.labels}
    assert "wrist_3_link to floor" in at_once
    assert not any(label.endswith("torque") for label in at_once)


def test_it_is_stored_and_older_tasks_have_none() -> None:
    world = stated(Task("panda", self_collision=False)).world
    assert world_of(world.to_dict()) == world
    task = Task("ur10e", floor=-0.25)
    content = task_content(task)
    assert content["floor"] == -0.25
    assert task_from_options(content, stored=True).limits.floor == -0.25
    del content["floor"]
    assert task_from_options(content, stored=True).limits.floor == "none"


def test_the_tool_counts() -> None:
    robot = built_in("ur10e")
    world = stated(Task("ur10e", self_collision=False, tool_point=(0.0, 0.0, 0.3))).world
    q = np.array([0.0, -0.2, 0.3, -1.0, 1.5, 0.0])
    own = [part for part in world.parts if part.link == "wrist_3_link" and part.capsule.start == (0.0, 0.0, 0.3)]
    height = clearance(robot, dataclasses.replace(world, parts=tuple(own), ignored=()), "wrist_3_link to floor", q)
    pose = link_poses(robot, q)["wrist_3_link"]
    assert height == pytest.approx((pose.act(np.array([0.0, 0.0, 0.3])))[2], abs=2e-3)


def test_a_skeleton_joins_the_joints() -> None:
    robot = built_in("ur10e")
    parts = skeleton(robot, 0.05)
    assert [part.link for part in parts] == ["base", *(link.name for link in robot.links)]
    poses = link_poses(robot, np.random.default_rng(0).uniform(-3, 3, 6))
    for part, after in zip(parts[:-1], robot.links, strict=True):
        assert poses[part.link].act(np.array(part.capsule.end)) == pytest.approx(poses[after.name].translation)
    assert parts[-1].capsule.length == 0.0
    assert assumed_radius(robot) == pytest.approx(0.05 * sum(part.capsule.length for part in parts))


URDF = """<robot name="post"><link name="foot"><collision><origin xyz="0 0 0.2" rpy="0.4 0 0"/><geometry>{}</geometry>
</collision></link><link name="arm"/><joint name="j" type="revolute"><parent link="foot"/><child link="arm"/>
<origin xyz="0 0 1"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
SHAPES = {
    '<sphere radius="0.3"/>': lambda c, s: -0.3,
    '<box size="0.2 0.4 0.6"/>': lambda c, s: -0.2 * s - 0.3 * c,
    '<cylinder radius="0.1" length="0.6"/>': lambda c, s: -0.1 * s - 0.3 * c,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_the_lowest_point_of_a_shape(shape: str, tmp_path: Path) -> None:
    path = text_file(tmp_path / "post.urdf", URDF.format(shape))
    expected = 0.2 + SHAPES[shape](np.cos(0.4), np.sin(0.4))
    found = lowest_point(path, carried_links(path, excite.load_robot(str(path))), np.array([0.0, 0.0, 1.0]))
    assert found == pytest.approx(expected, abs=1e-12)


def test_a_xacro_has_the_shapes_and_the_floor_of_the_urdf_that_it_expands_to(tmp_path: Path) -> None:
    shape = '<link name="arm"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
    text = URDF.format('<sphere radius="0.3"/>').replace('<link name="arm"/>', shape)
    (tmp_path / "post.urdf").write_text(text, encoding="utf-8")
    text = text.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    text = text.replace('"0.3"', '"${0.6 / 2}"')
    (tmp_path / "post.xacro").write_text(text, encoding="utf-8")
    paths = [str(tmp_path / name) for name in ("post.urdf", "post.xacro")]
    first, second = (stated_world(excite.load_robot(path), excite.Task(path)) for path in paths)
    assert second.world.to_dict() == first.world.to_dict()
    assert len(first.world.parts) == 2
    assert second.unchecked == first.unchecked
    lowest = [UrdfShapes(path).lowest(np.array([0.0, 0.0, 1.0])) for path in paths]
    assert lowest[0] == lowest[1] < 0.0
