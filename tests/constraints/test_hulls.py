"""Ranges of joints that keep links apart: by closed form, and by the distances of meshes as coal has them."""

from __future__ import annotations

import math
import re
from itertools import combinations
from pathlib import Path

import coal
import numpy as np
import pytest
from click.testing import CliRunner
from public_arms import ARMS

import excite
from constraints.clearance import link_poses
from constraints.collision_limits import Collisions
from constraints.geometry import Part, RangesApart, World
from constraints.hulls import ranges_apart, touching_pairs
from constraints.shapes import carried_links, urdf_solids
from constraints.world_file import UrdfShapes, read_world
from excite.cli.main import cli
from excite.design.stated_limits import stated_world
from excite.views.view import view_of
from regressors.errors import InputError
from regressors.models.partial import of_joints
from regressors.readers.urdf import read_urdf
from regressors.robot.robot import Robot, finite_ranges
from regressors.robot.shapes import Capsule
from regressors.samples import Array, Samples

LENGTH, HALF, FLOOR = 1.0, 0.1 / 2, -0.3  # of a bar that turns about its own axis, above a block
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
SHORT = excite.Schedule(percent=(10.0, 50.0), warm_up=0.0, breakaways=0, rate=100.0)
LIMIT = '<limit lower="{0}" upper="{1}" velocity="1" effort="9"/>'
BAR = f"""<robot name="bar">
<link name="base">
  <collision><origin xyz="1 0 {FLOOR - 0.5}"/><geometry><box size="6 6 1"/></geometry></collision>
</link>
<link name="a">{INERTIAL}</link>
<link name="b">{INERTIAL}
  <collision><origin xyz="{LENGTH / 2} 0 0"/><geometry><box size="{LENGTH} 0.1 0.1"/></geometry></collision>
</link>
<joint name="dip" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>{LIMIT.format(-1.5, 1.5)}
</joint>
<joint name="roll" type="revolute"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>{LIMIT.format(-3, 3)}</joint>
</robot>
"""


@pytest.fixture
def bar(tmp_path: Path) -> str:
    (tmp_path / "bar.urdf").write_text(BAR)
    return str(tmp_path / "bar.urdf")


def world_of_bar(bar: str) -> World:
    (Path(bar).parent / "world.yaml").write_text("robot: urdf\nclearance: 0.02\n")
    return read_world(Path(bar).parent / "world.yaml", bar)


def test_a_bar_that_rolls_may_dip_until_its_edges_touch(bar: str) -> None:
    """``L sin(q) + rho cos(q) = h - clearance``, rho half the diagonal of the bar's section."""
    (apart,) = world_of_bar(bar).apart
    ((_, low, high), roll), rho, room = apart.within, HALF * math.sqrt(2.0), -FLOOR - 0.02
    q = math.asin(room / math.hypot(LENGTH, rho)) - math.atan2(rho, LENGTH)
    assert (apart.links, low, roll) == (("base", "b"), -1.5, ("roll", -3.0, 3.0))
    assert q - math.radians(2.2) < high < q


@pytest.mark.parametrize(("share", "kept"), [(0.3, False), (0.6, True)])  # the range is 0.57 of the joint's
def test_a_range_is_narrowed_where_capsules_touch_in_most_poses(share: float, kept: bool, bar: str) -> None:
    robot = excite.load_robot(bar)
    solids = urdf_solids(Path(bar), carried_links(Path(bar), robot, None), {"base", "b"})
    assert bool(ranges_apart(robot, {("base", "b"): share}, solids, 0.02)) == kept


def test_capsules_touch_in_so_many_poses(bar: str) -> None:
    balls = [Part(link, Capsule(at, at, 0.05)) for link, at in (("base", (0, 0, -1.0)), ("b", (1, 0, 0)))]
    found = touching_pairs(excite.load_robot(bar), balls, 0.9)  # from |(cos, 0, 1 - sin)| = 1 on, at 30 degrees
    assert found == {("base", "b"): pytest.approx((1.5 - math.radians(30.0)) / 3.0, abs=0.1)}
    assert touching_pairs(excite.load_robot(bar), balls, 0.4) == {}


def test_the_joint_is_limited_instead_of_the_distance(bar: str) -> None:
    robot, world = excite.load_robot(bar), world_of_bar(bar)
    (limit,) = Collisions(world).imposed(robot, of_joints(robot, [0, 1]))
    (_, _, high), _ = world.apart[0].within
    np.testing.assert_allclose(limit.values(Samples.at_rest(np.array([[0.1, 0.2], [1.0, 0.0]]))), [[0.1], [1.0]])
    assert (limit.labels, limit.units, limit.upper) == (("b to base, by dip",), ("rad",), (high,))
    assert re.match(r"b to base: kept apart by dip, which stays between -1.5 and 0\.\d+ rad; their", limit.notes[0])
    narrow = excite.LimitChoice(position=((-0.1, 0.1), (-3.0, 3.0))).applied(robot)  # which sees to it itself
    assert not Collisions(world).imposed(narrow, of_joints(robot, [0, 1]))


def test_friction_runs_keep_to_the_range(bar: str) -> None:
    asked = {"world": world_of_bar(bar), "joints": ("dip",), "limits": excite.LimitChoice(acceleration=(3.0,))}
    plans = [excite.plan_friction(bar, SHORT, pose=np.array([dip, 0.0]), **asked) for dip in (0.0, 0.4)]
    assert plans[0].coordinates[0].place.high == pytest.approx(asked["world"].apart[0].within[0][2], abs=5e-3)
    assert [plan.holds for plan in plans] == [True, False]
    assert any(note.startswith("dip: b to base, by dip are at 0.8") for note in view_of(plans[1]).remarks)


def test_of_a_joint_that_is_held_out_of_its_range_capsules_are_checked(bar: str) -> None:
    robot = excite.load_robot(bar)
    balls = tuple(Part(link, Capsule(at, at, 0.05)) for link, at in (("base", (1, 0, -0.3)), ("b", (1, 0.1, 0))))
    world = World(balls, apart=(RangesApart(("base", "b"), (("dip", 0.1, 0.2), ("roll", -3.0, 3.0))),))
    labels = {}
    for name, joints in (("roll", [1]), ("both", [0, 1])):
        limits = Collisions(world).imposed(robot, of_joints(robot, joints))
        labels[name] = [label for limit in limits for label in limit.labels]
    assert labels == {"roll": ["b to base"], "both": ["b to base, by dip"]}


def test_ranges_are_written_and_read(bar: str) -> None:
    world = world_of_bar(bar)
    printed = CliRunner().invoke(cli, ["robots", bar, "--capsules"], catch_exceptions=False).output
    (Path(bar).parent / "mine.yaml").write_text(printed)
    assert read_world(Path(bar).parent / "mine.yaml").apart == UrdfShapes(bar).ranges_apart(World(world.parts)).apart


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"dip", -1.5', '"dip", 1.4', "apart: the range of dip must begin below its end, given 1.4 to"),
        ('"dip"', '"dap"', "no joint of robot 'bar' named 'dap'; available: dip, roll"),
        ('"base", "b"', '"base", "c"', "no link with a shape named 'c'; available: base, b"),
    ],
)
def test_mistakes_are_named(bar: str, old: str, new: str, message: str) -> None:
    printed = CliRunner().invoke(cli, ["robots", bar, "--capsules"], catch_exceptions=False).output
    assert old in printed
    (Path(bar).parent / "mine.yaml").write_text(printed.replace(old, new))
    with pytest.raises(InputError, match=re.escape(message)):
        read_world(Path(bar).parent / "mine.yaml").check(excite.load_robot(bar))


# --- public arms, against their meshes -------------------------------------------------------------------------------


def mesh(facets: Array, _: float) -> coal.CollisionGeometry:
    """Triangles; of a box, all between its corners."""
    triangles = facets if facets.shape[1] == 3 else np.array(list(combinations(facets[0], 3)))
    made, corners = coal.BVHModelOBBRSS(), triangles.reshape(-1, 3)
    made.beginModel(len(triangles), len(corners))
    made.addVertices(corners)
    made.addTriangles(np.arange(len(corners)).reshape(-1, 3))
    made.endModel()
    return made


def least_distance(robot: Robot, world: World, solids: dict[str, list[tuple[Array, float]]], k: int) -> float:
    """Of the meshes of the k-th pair, in random poses within its ranges and at their ends [m]."""
    rng, apart = np.random.default_rng(k), world.apart[k]
    q = rng.uniform(*finite_ranges(robot), (200, robot.n))
    for name, low, high in apart.within:
        q[:, robot.joint_names.index(name)] = rng.permutation(np.append(rng.uniform(low, high, 160), [low, high] * 20))
    poses = link_poses(robot, q)
    T = np.linalg.inv(poses[apart.links[0]]) @ poses[apart.links[1]]
    pairs = [(mesh(*a), mesh(*b)) for a in solids[apart.links[0]] for b in solids[apart.links[1]]]
    here, there = coal.Transform3s(), [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in T]
    asked = coal.DistanceRequest()
    return min(coal.distance(a, here, b, at, asked, coal.DistanceResult()) for a, b in pairs for at in there)


@pytest.mark.parametrize("name", ["ur3", "ur5-gripper", "ur10", "so101", "talos-left-arm-alone"])
def test_meshes_stay_apart_within_the_ranges(name: str) -> None:
    arm = next(arm for arm in ARMS if arm.id == name)
    robot = read_urdf(arm.path, base=arm.base, tip=arm.tip)
    task = excite.Task(str(arm.path), base_link=arm.base, tip=arm.tip, floor="none")
    world = stated_world(robot, task).world
    assert world.apart
    wanted = {link for apart in world.apart for link in apart.links}
    solids = urdf_solids(arm.path, carried_links(arm.path, robot, arm.base), wanted)
    for k in range(len(world.apart)):
        assert least_distance(robot, world, solids, k) >= world.clearance
