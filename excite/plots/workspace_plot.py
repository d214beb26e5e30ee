"""Path of the tool, poses along the motion, and obstacles, seen along each axis of the base."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from constraints.collision.clearance import link_poses
from constraints.collision.collision_limits import Clearance
from constraints.collision.geometry import Box, Capsule, HalfSpace, Obstacle, Shape
from excite.design.design import Design
from excite.plots.panels import Panel, legend_below, panels, value_axis
from excite.plots.style import (
    BLUE,
    DARK,
    FORBIDDEN,
    LABEL,
    NOTE,
    VERMILLION,
    broken,
    column_width,
    columns_that_fit,
    low,
    plain,
    significant,
)
from excite.trajectories.sequence import whole_pose
from regressors.samples import Array

_VIEWS = ((0, 1), (0, 2), (1, 2))
_AXES = "xyz"
_ROUND = 24  # corners of a circle
_POSES = 6
_MARGIN = 0.05  # of the view
_HUGE = 3.0  # bodies and planes that would make the view so many times larger are cut
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_LETTERS = 150  # of a line of notes
_SIDE = 3.6  # of a view on a screen [in]
_SOME: dict[str, Any] = {"facecolor": "none", "edgecolor": "#ABABAB", "linewidth": 0.6}
_NEAREST: dict[str, Any] = {"facecolor": "none", "edgecolor": DARK, "linewidth": 1.2}
_PATH: dict[str, Any] = {"color": BLUE, "linewidth": 1.4}
_SOLID: dict[str, Any] = {"facecolor": FORBIDDEN, "edgecolor": VERMILLION, "linewidth": 0.8}


def workspace_figure(design: Design) -> Figure:
    """Draw the path of the tool, the robot's capsules in several poses, and the obstacles, in three projections."""
    worlds = [world for world in (design.task.limits.known_world, design.shape) if world is not None]
    parts, obstacles = worlds[0].parts, [each for world in worlds for each in world.obstacles]
    robot = design.task.limits.applied(design.robot)
    samples = design.samples
    poses = link_poses(robot, whole_pose(robot, design.moving.joint_names, samples.q))
    last = poses[robot.links[-1].name]
    path = last[:, :3, :3] @ np.array(design.task.limits.tool_point) + last[:, :3, 3]
    nearest = _nearest_time(design)
    shown = [*np.linspace(0, len(path) - 1, _POSES + 1).round().astype(int)[:-1].tolist()]
    shown += [] if nearest is None else [int(np.argmin(np.abs(samples.time - nearest)))]
    links = [[_moved(part.capsule, poses[part.link][k]) for part in parts if part.link in poses] for k in shown]
    view = _View.of(path, [capsule for pose in links for capsule in pose], obstacles)
    notes = broken(textwrap.fill("; ".join(view.notes), _LETTERS), column_width())
    height = min(_SIDE, column_width() / columns_that_fit(3, Panel.least) / low(1.0))
    panel = Panel(widths=(_SIDE,) * 3, height=height, below=0.95 + 0.16 * len(notes.splitlines()))
    figure, axes = panels(1, panel, f"{design.robot.name}: tool and obstacles")
    for ax, plane in zip(axes[0], _VIEWS, strict=True):
        for obstacle in obstacles:
            _draw_obstacle(ax, obstacle.shape, plane, 10 * view.half)
        for k, pose in enumerate(links):
            style = _SOME if k < _POSES else _NEAREST
            for capsule in pose:
                ax.add_patch(Polygon(_outline(capsule, plane), **style))
        ax.plot(path[:, plane[0]], path[:, plane[1]], **_PATH)
        view.apply(ax, plane)
    legend_below(figure, _legend(nearest), title=plain(notes), title_fontsize=NOTE)
    return figure


def _nearest_time(design: Design) -> float | None:
    """When two bodies come nearest to each other [s]."""
    labels = {label for limit in design.nonlinear if isinstance(limit, Clearance) for label in limit.labels}
    uses = [use for use in design.limits if use.label in labels]
    return min(uses, key=lambda use: use.extreme).time if uses else None


def _legend(nearest: float | None) -> list[Artist]:
    near = [] if nearest is None else [f"where two bodies are nearest, at {significant(nearest, 3)} s"]
    return [
        Line2D([], [], **_PATH, label="path of the tool"),
        Patch(**_SOME, label=f"links at {_POSES} equally spaced instants"),
        *(Patch(**_NEAREST, label=text) for text in near),
        Patch(**_SOLID, label="obstacles"),
    ]


@dataclass(frozen=True)
class _View:
    """The cube that all views show."""

    middle: Array  # (3,) [m]
    half: float  # half of its side [m]
    notes: tuple[str, ...]  # obstacles that it does not show, or not as a whole

    @classmethod
    def of(cls, path: Array, links: Sequence[Capsule], obstacles: Sequence[Obstacle]) -> _View:
        """The smallest cube around the path, the links, and every obstacle that is not far too large for it."""
        corners = np.vstack([path, *(_extent(capsule) for capsule in links)])
        least, most = corners.min(axis=0), corners.max(axis=0)
        largest = _HUGE * float((most - least).max())
        low, high, cut, tilted = least, most, [], []
        for obstacle in obstacles:
            ends = np.array(list(_points_in_view(obstacle.shape, 0.5 * (least + most))))
            if not ends.size:
                tilted.append(obstacle.name)
                continue
            lower, upper = ends.min(axis=0), ends.max(axis=0)
            if float((np.maximum(most, upper) - np.minimum(least, lower)).max()) > largest:
                cut.append(obstacle.name)
            else:
                low, high = np.minimum(low, lower), np.maximum(high, upper)
        notes = [f"too large or too far off to be shown as a whole: {', '.join(cut)}"] if cut else []
        notes += [f"not drawn, as planes that no view shows edge-on: {', '.join(tilted)}"] if tilted else []
        half = (0.5 + _MARGIN) * float((high - low).max())
        return cls(0.5 * (low + high), half, tuple(notes))

    def apply(self, ax: Axes, plane: tuple[int, int]) -> None:
        """Set a panel's ranges and labels."""
        (x0, y0), half = self.middle[list(plane)], self.half
        ax.set_aspect("equal", adjustable="box")
        ax.set_xlim(x0 - half, x0 + half)
        ax.set_ylim(y0 - half, y0 + half)
        ax.set_xlabel(f"{_AXES[plane[0]]} [m]", fontsize=LABEL, color=DARK)
        value_axis(ax, f"{_AXES[plane[1]]} [m]")


def _extent(capsule: Capsule) -> Array:
    """Opposite corners of the box around a capsule, shape (2, 3)."""
    ends = np.array([capsule.start, capsule.end])
    return np.array([ends.min(axis=0) - capsule.radius, ends.max(axis=0) + capsule.radius])


def _points_in_view(shape: Shape, near: Array) -> Iterator[Array]:
    """Points that a view must hold to show a shape: its corners, or a point of a plane that a view shows edge-on."""
    if isinstance(shape, HalfSpace):
        normal = np.array(shape.normal)
        if any(_is_edge_on(normal, view) for view in _VIEWS):
            yield near + (shape.offset - normal @ near) * normal
    elif isinstance(shape, Box):
        yield from _CORNERS * shape.size @ shape.rotation.T + shape.centre
    else:
        yield from _extent(shape)


def _is_edge_on(normal: Array, view: tuple[int, int]) -> bool:
    return abs(float(np.linalg.norm(normal[list(view)])) - 1.0) <= 1e-9


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


def _draw_obstacle(ax: Axes, shape: Shape, view: tuple[int, int], far: float) -> None:
    if isinstance(shape, HalfSpace):
        if not _is_edge_on(np.array(shape.normal), view):
            return
        normal = np.array(shape.normal)[list(view)]
        edge, along = shape.offset * normal, far * np.array([-normal[1], normal[0]])
        corners = np.array([edge + along, edge - along, edge - along - far * normal, edge + along - far * normal])
    else:
        corners = _outline(shape, view)
    ax.add_patch(Polygon(corners, **_SOLID, zorder=0.5))
