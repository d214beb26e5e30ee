"""Distances of capsules against Coal, their slopes and enclosures, what is left out, and designs that keep them."""

from __future__ import annotations

import dataclasses
import re
from functools import cache

import casadi as ca
import coal_distances
import numpy as np
import pytest
from coal_distances import clearance, link_poses as placed_links
from hypothesis import given, settings, strategies as st
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.patches import Polygon
from refused import refusal
from slow_dynamics import random_chain

from constraints.certificate import ENCLOSED
from constraints.clearance import Frames, link_poses
from constraints.collision_limits import Clearance, collision_limits
from constraints.diagnosis import ContradictionError
from constraints.geometry import Box, HalfSpace, Obstacle, Part, World
from constraints.nonlinear import NonlinearConstraint
from excite.design.design import Design
from excite.design.formulation import formulate
from excite.design.optimisation import design_trajectory, limits_of
from excite.tasks.task import Task
from excite.views.style import VERMILLION
from excite.views.world_plot import _NEAREST_LINKS, _POSES, _SOME, clearance_figure, workspace_figure
from regressors.errors import InputError, UnknownName
from regressors.models.partial import PartialMotion, of_joints
from regressors.readers.library import built_in
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Robot
from regressors.robot.shapes import Capsule
from regressors.robot.symbolic.kinematics import bodies
from regressors.samples import Samples

SEED = st.integers(0, 2**32 - 1)
TOLERANCE = 0.004


def vector(rng: np.random.Generator, size: float) -> tuple[float, float, float]:
    return tuple(rng.uniform(-size, size, 3).tolist())


def random_world(robot: Robot, seed: int) -> World:
    """Capsules and spheres on the links, and one obstacle of each kind about them."""
    rng = np.random.default_rng(seed)
    parts = []
    for name in ("base", *(link.name for link in robot.links)):
        start = vector(rng, 0.2)
        end = start if rng.random() < 0.3 else vector(rng, 0.4)
        parts.append(Part(name, Capsule(start, end, float(rng.uniform(0.02, 0.1)))))
    normal = rng.normal(size=3)
    level, size = tuple((normal / np.linalg.norm(normal)).tolist()), tuple(rng.uniform(0.1, 0.5, 3).tolist())
    obstacles = (
        Obstacle("plane", HalfSpace(level, -1.0)),
        Obstacle("box", Box(vector(rng, 1.5), size, vector(rng, 3.0))),
        Obstacle("post", Capsule(vector(rng, 1.5), vector(rng, 1.5), 0.1)),
        Obstacle("ball", Capsule(ball := vector(rng, 1.5), ball, 0.15)),
    )
    return World(tuple(parts), obstacles, clearance=0.01, tolerance=TOLERANCE)


def still(q: np.ndarray) -> Samples:
    zero = np.zeros_like(q)
    return Samples(np.arange(float(len(q))), q, zero, zero, zero)


def every_joint(robot: Robot) -> PartialMotion:
    return of_joints(robot, range(robot.n))


def random_case(seed: int) -> tuple[Robot, World, list[NonlinearConstraint], np.ndarray]:
    robot = random_chain("rrpr", np.random.default_rng(seed))
    robot = robot.replace(parents=(0, 1, 1, 0)) if seed % 2 else robot
    world = random_world(robot, seed)
    try:
        limits = collision_limits(robot, world, every_joint(robot))
    except InputError:  # an obstacle about the base
        return random_case(seed + 1)
    return robot, world, limits, np.random.default_rng(seed).uniform(-2, 2, (4, robot.n))


@pytest.mark.slow
@given(SEED)
@settings(max_examples=6, deadline=None)
def test_distances_are_those_of_coal_and_never_more(seed: int) -> None:
    robot, world, limits, q = random_case(seed)
    exact = {"plane", "ball"}
    for limit in limits:
        shown = limit.shown(limit.values(still(q)))
        for label in dict.fromkeys(limit.labels):
            least = shown[:, [k for k, other in enumerate(limit.labels) if other == label]].min(axis=1)
            for pose, ours in zip(q, least, strict=True):
                theirs = clearance(robot, world, label, pose)
                if theirs < 1e-3:
                    assert ours < 1e-3 + 1e-6
                    continue
                slack = 0.0 if label.split(" to ")[1] in exact else TOLERANCE
                assert theirs - slack - 1e-6 < ours < theirs + 1e-6, label


@pytest.mark.slow
@given(SEED)
@settings(max_examples=2, deadline=None)
def test_slopes_are_those_of_the_values_and_rates_are_enclosed(seed: int) -> None:
    robot, _, limits, q = random_case(seed)
    rng = np.random.default_rng(seed)
    dq, step = rng.uniform(-1, 1, q.shape), 1e-6
    for limit in limits:
        ahead, behind = ([limit.values(still(q + way * e)) for e in np.eye(robot.n)] for way in (step, -step))
        numeric = np.moveaxis(np.subtract(ahead, behind) / (2 * step), 0, -1)
        slopes = limit.slopes(still(q))
        np.testing.assert_allclose(slopes[:, :, : robot.n], numeric, atol=1e-4, rtol=1e-4)
        assert not np.any(slopes[:, :, robot.n :])
        wide, zero = 0.05, np.zeros_like(q).T
        low, high = limit.rate([(q - wide).T, dq.T, zero, zero], [(q + wide).T, dq.T, zero, zero])
        inside = q + rng.uniform(-wide, wide, q.shape)
        rate = np.einsum("nki,ni->nk", limit.slopes(still(inside))[:, :, : robot.n], dq)
        assert np.all(rate >= low.T - 1e-12)
        assert np.all(rate <= high.T + 1e-12)


@given(st.floats(0.01, 0.3), st.floats(0.0, 1.0), st.floats(1e-4, 0.05), SEED)
@settings(max_examples=60, deadline=None)
def test_spheres_cover_a_capsule(radius: float, length: float, tolerance: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    capsule = Capsule((0.1, 0.2, 0.3), (0.1, 0.2, 0.3 + length), radius)
    centres, wide = capsule.covering(tolerance)
    assert radius <= wide <= radius + tolerance + 1e-12
    direction = rng.normal(size=(50, 3))
    surface = radius * direction / np.linalg.norm(direction, axis=1)[:, None]
    points = surface + np.array(capsule.start) + rng.uniform(0, 1, (50, 1)) * [0, 0, length]
    nearest = np.linalg.norm(points[:, None] - centres, axis=2).min(axis=1)
    assert np.all(nearest <= wide + 1e-9)


IIWA = built_in("iiwa7")
ARM = (
    Part("base", Capsule((0.0, 0.0, 0.06), (0.0, 0.0, 0.09), 0.11)),
    Part("link_2", Capsule((0.0, 0.0, 0.0), (0.0, -0.14, 0.0), 0.08)),
    Part("link_4", Capsule((0.0, 0.0, 0.0), (0.0, 0.14, 0.0), 0.08)),
    Part("link_6", Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.09)),
    Part("link_7", Capsule((0.0, 0.0, -0.024), (0.0, 0.0, -0.024), 0.06)),
)
TABLE = Obstacle("table", HalfSpace((0.0, 0.0, 1.0), 0.0))
POST = Obstacle("post", Capsule((0.45, 0.0, 0.0), (0.45, 0.0, 0.8), 0.04))


def labels(limits: list[NonlinearConstraint]) -> set[str]:
    return {label for limit in limits for label in limit.labels}


def test_neighbours_and_ignored_pairs_and_what_never_moves_are_left_out() -> None:
    world = World(ARM, (TABLE, POST), ignored=(("link_6", "post"), ("link_4", "base")))
    found = labels(collision_limits(IIWA, world, every_joint(IIWA)))
    assert {"link_7 to table", "link_7 to post", "link_4 to link_2", "link_6 to base"} <= found
    assert not found & {"link_7 to link_6", "link_6 to post", "link_4 to base", "link_6 to link_4", "base to table"}
    still = labels(collision_limits(IIWA, world, of_joints(IIWA, [5])))
    assert all(label.startswith(("link_6", "link_7")) for label in still)
    assert "link_7 to table" in still


def test_self_collision_can_be_left_out() -> None:
    found = labels(collision_limits(IIWA, World(ARM, (TABLE,), self_collision=False), every_joint(IIWA)))
    assert found == {f"{link} to table" for link in ("link_2", "link_4", "link_6", "link_7")}


@pytest.mark.parametrize(("radius", "is_checked"), [(0.15, False), (0.0305, False), (0.0285, True)])
def test_links_that_always_touch_are_noted_and_left_out(radius: float, is_checked: bool) -> None:
    """Those too that no pose brings farther than 3 mm beyond the clearance, here of a radius above 0.029 m."""
    fat = (*ARM, Part("link_5", Capsule((0.0, 0.0, -0.2), (0.0, 0.0, 0.0), radius)))
    limits = collision_limits(IIWA, World(fat), every_joint(IIWA))
    assert ("link_7 to link_5" in labels(limits)) is is_checked
    why = "their capsules are closer than allowed, or nearly so, in all of 2000 random poses; several of them"
    found = [(name, each[: len(why)]) for limit in limits for name, each in limit.unchecked.items()]
    assert found == [("link_7 to link_5", why)] * (not is_checked)


def test_limits_of_a_partial_motion_are_those_of_the_whole_robot() -> None:
    whole = collision_limits(IIWA, World(ARM, (TABLE, POST)), every_joint(IIWA))
    motion = of_joints(IIWA, [1, 3])
    s = np.random.default_rng(2).uniform(-1, 1, (20, 2))
    q = s @ motion.matrix.T + motion.offset
    for limit in whole:
        part = Clearance(IIWA, motion, limit.pairs, limit.world)
        np.testing.assert_allclose(part.values(still(s)), limit.values(still(q)), rtol=1e-12)
        slopes = limit.slopes(still(q))[:, :, : IIWA.n] @ motion.matrix
        np.testing.assert_allclose(part.slopes(still(s))[:, :, :2], slopes, atol=1e-12)


def test_shapes_inside_another_one_of_their_body_make_no_functions() -> None:
    """A finger inside the capsule about the hand, and one beyond it; each of two that are the same counts once."""
    hand = Part("link_7", Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.2), 0.08))
    inside, beyond = (Part("link_7", Capsule((0.0, 0.05, 0.1), (0.0, 0.05, z), 0.02)) for z in (0.2, 0.3))

    def functions(*parts: Part) -> list[tuple[str, ...]]:
        world = World((*ARM[:-1], *parts), (TABLE, POST))
        return [limit.labels for limit in collision_limits(IIWA, world, every_joint(IIWA))]

    alone = functions(hand)
    assert functions(hand, inside) == functions(inside, hand, hand) == alone
    assert len(functions(hand, beyond)[-1]) > len(alone[-1])


SMALL = {"joints": ("2", "4"), "friction": False, "rotor": False, "period": 4.0, "harmonics": 3}
TASK = Task("iiwa7", **SMALL, acceleration=(10.0,), starts=1, executor="serial")
ROOM = World(ARM, (TABLE, POST, Obstacle("shelf", Box((-0.6, 0.0, 0.9), (0.4, 0.6, 0.05)))), clearance=0.02)


@cache
def designed(world: World | None) -> Design:
    return design_trajectory(TASK.changed(world=world).changed(robot=IIWA))


def nearest(design: Design, label: str) -> float:
    """By Coal, at two hundred instants."""
    samples = design.trajectory.samples(np.linspace(0.0, TASK.trajectory.period, 201))
    q = np.zeros((201, IIWA.n))
    q[:, [1, 3]] = samples.q
    return min(clearance(IIWA, ROOM, label, pose) for pose in q)


@pytest.mark.slow
def test_a_design_keeps_apart_what_would_collide_without_the_limits() -> None:
    free, design = designed(None), designed(ROOM)
    uses = [use for use in design.limits if " to " in use.label]
    assert design.feasible
    assert len({use.label for use in uses}) == len(uses), "one per pair of bodies"
    collided = 0
    for use in uses:
        there = nearest(design, use.label)
        assert use.method == ENCLOSED
        assert use.bound == pytest.approx(0.02)
        assert 0.02 <= use.extreme < there + 1e-9
        if there < 0.2:
            assert there < use.extreme + ROOM.tolerance + 0.005
        collided += nearest(free, use.label) < 0
    assert collided >= 2


@pytest.mark.slow
def test_a_motion_that_collides_is_certified_as_one_that_does() -> None:
    free = designed(None)
    made = formulate(IIWA, TASK.changed(world=ROOM))
    broken = {use.label for use in limits_of(made, free.trajectory) if not use.holds}
    truly = {label for limit in made.nonlinear for label in limit.labels if nearest(free, label) < 0.02}
    assert truly
    assert truly <= broken


# --- bad input -------------------------------------------------------------------------------------------------------


SHOULDER = (Part("link_1", Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1)),)
LAMP = Obstacle("lamp", Capsule((0.15, 0.0, 0.34), (0.15, 0.0, 0.34), 0.06))
CRATE = Obstacle("crate", Box((0.0, 0.0, 0.1), (1.0, 1.0, 1.0)))
FLOOR = Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), 0.002))


@pytest.mark.parametrize(
    ("world", "error", "message"),
    [
        (World((Part("arm", ARM[0].capsule),)), UnknownName, "no link of robot 'iiwa7' named 'arm'; available: base,"),
        (World(ARM, (CRATE,)), InputError, "'crate' contains the robot's base, whose origin is 0.4 m inside it"),
        (World(ARM, (FLOOR,)), InputError, "'floor' contains the robot's base, whose origin is 0.002 m inside it"),
        (World(SHOULDER, (LAMP,)), InputError, "link_1 to lamp: they are -0.01 m apart, and no motion of A1, A2, A3, "),
    ],
)
def test_worlds_that_do_not_fit_the_robot_are_refused(world: World, error: type[InputError], message: str) -> None:
    with pytest.raises(error, match=re.escape(message)):
        collision_limits(IIWA, world, every_joint(IIWA))


def test_a_world_without_room_is_explained() -> None:
    places = (("west wall", 1.0), ("east wall", -1.0))
    walls = tuple(Obstacle(name, HalfSpace((x, 0.0, 0.0), -0.07)) for name, x in places)
    with pytest.raises(ContradictionError, match=r"smallest relaxation .* to (west|east) wall beyond 0.01 m by 0.0"):
        formulate(IIWA, TASK.changed(joints=None, harmonics=5, period=10.0, world=World(ARM, walls)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0), "radius must be greater than zero, given 0"),
        (lambda: HalfSpace((0.0, 0.0, 2.0), 0.0), "normal must have length 1, given 2"),
        (lambda: Box((0.0, 0.0, 0.0), (1.0, 0.0, 1.0)), "size must be greater than zero, given 1, 0, 1"),
        (lambda: World(()), "robot: no capsule is given"),
        (lambda: World(ARM, tolerance=-1.0), "tolerance must be greater than zero, given -1"),
        (lambda: World(ARM, (TABLE, TABLE)), "objects: 'table' is the name of two bodies"),
        (lambda: World(ARM, ignored=(("link_2", "lamp"),)), "no link with a shape, or object, named 'lamp'"),
    ],
)
def test_shapes_that_cannot_be_are_refused(make: object, message: str) -> None:
    assert message in refusal(make)


# --- ways from home --------------------------------------------------------------------------------------------------


def test_a_home_that_collides_is_refused_once_per_pair() -> None:
    task = TASK.changed(world=ROOM, home=(0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    told = refusal(formulate, IIWA, task, begins="home: ")
    assert "link_7 to table is -0.0953644 m, 0.115 m outside" in told
    assert told.count("link_4 to post") == 1


# --- frames ----------------------------------------------------------------------------------------------------------


def test_poses_of_links_and_branches_relative_to_each_other() -> None:
    """``T_a^-1 T_b`` of the whole chain's recursion, for bodies beside the chain too."""
    robot = built_in("irp6-full")
    robot = robot.replace(branches=tuple(dataclasses.replace(branch, offset=0.2) for branch in robot.branches))
    q = ca.SX.sym("q", robot.n)
    frames, zero = Frames(robot, q), ca.SX(robot.n, 1)
    moved = {body.name: m for body, m in zip(robot.bodies, bodies(robot, q, zero, zero), strict=True)}
    at = np.random.default_rng(4).uniform(-1, 1, robot.n)
    for name in moved:
        for other in frames.path(name):
            assert frames.common(other, name) == other
            expected = [moved[name].rotation, moved[name].origin]
            if other != "base":
                R = moved[other].rotation
                expected = [R.T @ expected[0], R.T @ (expected[1] - moved[other].origin)]
            function = ca.Function("f", [q], [*frames.pose(name, other), *expected])
            R, p, R_expected, p_expected = (np.array(part) for part in function(at))
            np.testing.assert_allclose(R, R_expected, atol=1e-12)
            np.testing.assert_allclose(p, p_expected, atol=1e-12)


# --- figures ---------------------------------------------------------------------------------------------------------


def test_figures_show_the_nearest_pairs_on_one_scale_with_the_nearest_the_lowest() -> None:
    design = designed(ROOM)
    *panels, overview = [ax for ax in clearance_figure(design).axes if ax.lines]
    uses = sorted((use for use in design.limits if " to " in use.label), key=lambda use: use.extreme)
    assert [ax.get_title("left") for ax in panels] == [use.label for use in uses[: len(panels)]]
    assert overview.get_title("left") == f"nearest: {uses[0].label}"
    for ax, use in zip(panels, uses, strict=False):
        drawn = ax.lines[0].get_ydata()
        assert np.min(drawn) >= 1e3 * use.extreme - 1e-6
        above = len(panels) - 1 if use is uses[0] else uses.index(use) - 1  # the nearest is drawn last, on top
        np.testing.assert_array_equal(overview.lines[above].get_ydata(), drawn)
    assert len({ax.get_ylim() for ax in (*panels, overview)}) == 1
    assert {ax.get_yscale() for ax in (*panels, overview)} == {"symlog"}
    to_panel = panels[0].transData + panels[0].transAxes.inverted()
    lowest = [20.0, *(ax.lines[0].get_ydata().min() for ax in panels)]
    heights = to_panel.transform([(0.0, y) for y in lowest])[:, 1]
    assert np.array_equal(np.argsort(heights[1:]), np.argsort(lowest[1:]))
    assert 0.1 < heights[0] < 0.5, "the clearance is neither hidden nor all of the panel"


def outlines(ax: Axes, colour: object) -> list[np.ndarray]:
    edge = to_rgba(colour)
    return [np.asarray(p.get_xy()) for p in ax.patches if isinstance(p, Polygon) and p.get_edgecolor() == edge]


@pytest.mark.parametrize("far", [0.0, 0.9])
def test_workspace_shows_every_object_and_pose_as_a_whole(far: float) -> None:
    shelf = Obstacle("shelf", Box((-0.6 - far, 0.2 + far, 0.9), (0.4, 0.6, 0.05), (0.1, 0.2, 0.3)))
    ball = Obstacle("ball $b$", Capsule((0.9 + far, 0.9, 0.2), (0.9 + far, 0.9, 0.2), 0.15))
    world = World(ARM, (TABLE, shelf, ball, Obstacle("wall", HalfSpace((0.0, -1.0, 0.0), -0.8 - far))), clearance=0.02)
    design = designed(ROOM)
    design = dataclasses.replace(design, task=design.task.changed(world=world))
    figure = workspace_figure(design)
    poses = _POSES + 1
    for ax, view in zip(figure.axes, ((0, 1), (0, 2), (1, 2)), strict=True):
        (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
        shown = [*outlines(ax, _SOME["edgecolor"]), *outlines(ax, _NEAREST_LINKS["edgecolor"])]
        shown.append(ax.lines[0].get_xydata())
        assert len(shown) == poses * len(ARM) + 1
        solid = outlines(ax, VERMILLION)
        planes = [xy for xy in solid if np.ptp(xy) > 5]
        shown += [xy for xy in solid if np.ptp(xy) <= 5]
        for xy in shown:
            assert x0 <= xy[:, 0].min() <= xy[:, 0].max() <= x1
            assert y0 <= xy[:, 1].min() <= xy[:, 1].max() <= y1
        assert len(solid) - len(planes) == 2
        assert len(planes) == {(0, 1): 1, (0, 2): 1, (1, 2): 2}[view]
        for xy in planes:  # their edges are in view
            assert np.any((x0 < xy[:, 0]) & (xy[:, 0] < x1)) or np.any((y0 < xy[:, 1]) & (xy[:, 1] < y1))
        links = outlines(ax, _SOME["edgecolor"])
        assert np.ptp([xy.mean(axis=0) for xy in links[len(ARM) - 1 :: len(ARM)]], axis=0).max() > 0.1


def test_what_would_dwarf_the_robot_is_named_and_the_view_stays() -> None:
    design = designed(ROOM)
    slab = Obstacle("hall", Box((0.0, 0.0, -1.5), (40.0, 40.0, 1.0)))
    tilted = Obstacle("ramp", HalfSpace((0.6, 0.48, 0.64), -3.0))
    worlds = (World(ARM, obstacles) for obstacles in ((TABLE,), (TABLE, slab, tilted)))
    figures = [workspace_figure(dataclasses.replace(design, task=design.task.changed(world=each))) for each in worlds]
    assert [ax.get_xlim() for ax in figures[0].axes] == [ax.get_xlim() for ax in figures[1].axes]
    text = " ".join(legend.get_title().get_text().replace("\n", " ") for legend in figures[1].legends)
    assert "too large or too far off to be shown as a whole: hall" in text
    assert "not drawn, as planes that no view shows edge-on: ramp" in text


def test_poses_of_links_are_those_of_pinocchio() -> None:
    q = np.random.default_rng(3).uniform(-2, 2, (3, IIWA.n))
    ours = link_poses(IIWA, q)
    for k, pose in enumerate(q):
        for name, theirs in coal_distances.link_poses(IIWA, pose).items():
            np.testing.assert_allclose(ours[name][k], theirs.homogeneous, atol=1e-12)


def test_held_joints_take_the_capsules_of_their_links_along() -> None:
    robot = built_in("panda")
    rest = np.array([0.3, -0.5, 0.7, -1.9, 0.4, 1.8, -0.6])
    moving = [1, 3]
    held = with_locked_joints(robot, moving, rest)
    ends = []
    for each, q in ((robot, rest), (held, rest[moving])):
        poses = placed_links(each, q)
        capsules = [(poses[shape.link], shape.capsule) for shape in each.shapes]
        ends.append([T.act(np.array(end)) for T, capsule in capsules for end in (capsule.start, capsule.end)])
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-12)
