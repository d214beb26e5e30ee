"""Path of the tool and obstacles, seen along each axis of the base."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from constraints.collision.geometry import Box, Capsule, HalfSpace, Shape
from excite.design.design import Design
from excite.plots.panels import Panel, legend_below, panels, value_axis
from excite.plots.style import BLUE, DARK, FORBIDDEN, GREY, LABEL, VERMILLION
from excite.trajectories.sequence import whole_pose
from regressors.robot.robot import BASE, Robot
from regressors.samples import Array

_VIEWS = ((0, 1), (0, 2), (1, 2))
_AXES = "xyz"
_ROUND = 48  # corners of a circle
_MARGIN = 0.1  # m
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def workspace_figure(design: Design) -> Figure:
    """Draw the path of the tool, the robot's capsules at the start, and the obstacles, in three projections.

    Parameters
    ----------
    design : Design
        Design of a task with a world.

    Returns
    -------
    Figure
        Planes are drawn only in views that show them edge-on.
    """
    world = design.task.limits.known_world
    assert world is not None
    robot = design.task.limits.applied(design.robot)
    poses = link_poses(robot, whole_pose(robot, design.moving.joint_names, design.samples.q))
    last = poses[robot.links[-1].name]
    path = last[:, :3, :3] @ np.array(design.task.limits.tool_point) + last[:, :3, 3]
    links = [_moved(part.capsule, poses[part.link][0]) for part in world.parts if part.link in poses]
    figure, axes = panels(1, Panel(widths=(3.6,) * 3, height=3.6), f"{design.robot.name}: tool and obstacles")
    middle, half = _cube(path, links)
    for ax, view in zip(axes[0], _VIEWS, strict=True):
        for obstacle in world.obstacles:
            _obstacle(ax, obstacle.shape, view, 10 * half)
        for capsule in links:
            ax.add_patch(Polygon(_outline(capsule, view), facecolor="none", edgecolor=GREY, linewidth=0.8))
        ax.plot(path[:, view[0]], path[:, view[1]], color=BLUE, linewidth=1.0)
        ax.set_aspect("equal", adjustable="box")
        ax.set_xlim(middle[view[0]] - half, middle[view[0]] + half)
        ax.set_ylim(middle[view[1]] - half, middle[view[1]] + half)
        ax.set_xlabel(f"{_AXES[view[0]]} [m]", fontsize=LABEL, color=DARK)
        value_axis(ax, f"{_AXES[view[1]]} [m]")
    legend_below(
        figure,
        [
            Line2D([], [], color=BLUE, linewidth=1.0, label="path of the tool"),
            Line2D([], [], color=GREY, linewidth=0.8, label="links where the motion starts"),
            Patch(facecolor=FORBIDDEN, edgecolor=VERMILLION, label="obstacles"),
        ],
    )
    return figure


def _cube(path: Array, links: list[Capsule]) -> tuple[Array, float]:
    """Centre and half side of the cube that all views show, around the path and the links."""
    ends = [(np.array(end), capsule.radius) for capsule in links for end in (capsule.start, capsule.end)]
    low = np.min([path.min(axis=0), *(end - radius for end, radius in ends)], axis=0)
    high = np.max([path.max(axis=0), *(end + radius for end, radius in ends)], axis=0)
    return (low + high) / 2, float((high - low).max()) / 2 + _MARGIN


def link_poses(robot: Robot, q: Array) -> dict[str, Array]:
    """Pose of the base, of every link and of every branch in the base frame, shape (N, 4, 4) each.

    Parameters
    ----------
    robot : Robot
    q : ndarray, shape (N, n)
        [rad or m]
    """
    poses = {BASE: np.broadcast_to(np.eye(4), (len(q), 4, 4))}
    before = BASE
    for k, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True)):
        poses[link.name] = poses[before] @ np.array([joint.motion(float(angle)) for angle in q[:, k]])
        before = link.name
    for branch in robot.branches:
        s = q @ branch.coupling + branch.offset
        poses[branch.name] = poses[branch.parent] @ np.array([branch.joint.motion(float(angle)) for angle in s])
    return poses


def _moved(capsule: Capsule, pose: Array) -> Capsule:
    start, end = (tuple(float(x) for x in pose[:3, :3] @ point + pose[:3, 3]) for point in (capsule.start, capsule.end))
    return Capsule((start[0], start[1], start[2]), (end[0], end[1], end[2]), capsule.radius)


def _outline(shape: Capsule | Box, view: tuple[int, int]) -> Array:
    """Corners of a shape's projection, in order, shape (N, 2)."""
    if isinstance(shape, Box):
        points = (_CORNERS * shape.size @ shape.rotation.T + shape.centre)[:, view]
    else:
        angle = np.linspace(0.0, 2 * np.pi, _ROUND, endpoint=False)
        circle = shape.radius * np.column_stack([np.cos(angle), np.sin(angle)])
        points = np.vstack([circle + np.array(end)[list(view)] for end in (shape.start, shape.end)])
    return points[_hull(points)]


def _hull(points: Array) -> list[int]:
    """Indices of the corners of the convex hull, counter-clockwise [Andrew 1979]."""
    order = np.lexsort(points.T[::-1]).tolist()
    hull: list[int] = []
    for way in (order, order[::-1]):
        side: list[int] = []
        for k in way:
            while len(side) > 1 and np.linalg.det(points[[side[-1], k]] - points[side[-2]]) <= 0:
                side.pop()
            side.append(k)
        hull += side[:-1]
    return hull


def _obstacle(ax: Axes, shape: Shape, view: tuple[int, int], far: float) -> None:
    if isinstance(shape, HalfSpace):
        normal = np.array(shape.normal)[list(view)]
        if abs(np.linalg.norm(normal) - 1.0) > 1e-9:
            return
        edge, along = shape.offset * normal, far * np.array([-normal[1], normal[0]])
        corners = np.array([edge + along, edge - along, edge - along - far * normal, edge + along - far * normal])
    else:
        corners = _outline(shape, view)
    ax.add_patch(Polygon(corners, facecolor=FORBIDDEN, edgecolor=VERMILLION, linewidth=0.8, zorder=0.5))
