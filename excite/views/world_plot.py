"""The robot among obstacles: distances of the nearest pairs over time, and the path of the tool from three sides."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.ticker import FuncFormatter, NullLocator, SymmetricalLogLocator

from constraints.certificate import LimitUse
from constraints.clearance import link_poses
from constraints.collision_limits import Clearance
from constraints.geometry import Box, HalfSpace, Obstacle, Shape
from constraints.linear import linear_limits
from excite.design.design import Design
from excite.trajectories.sequence import whole_pose
from excite.views.motion_plot import motion_functions, shade
from excite.views.panels import Panel, alike, head, legend_below, panels, value_axis
from excite.views.style import (
    BLUE,
    DARK,
    FORBIDDEN,
    GREY,
    LABEL,
    NOTE,
    VERMILLION,
    broken,
    column_width,
    columns_that_fit,
    low,
    plain,
    significant,
    typeset,
)
from regressors.robot.shapes import Capsule
from regressors.samples import Array

_COLUMNS, _ROWS = 3, 4
_LEAST = 1.7  # width of a panel with its numbers [in]
_MILLIMETRES = 1e3
_LINEAR = 0.6  # height of the linear part, in decades
_OTHERS: dict[str, Any] = {"color": GREY, "linewidth": 0.7, "linestyle": (0, (4, 1.5))}
_NEAREST: dict[str, Any] = {"color": BLUE, "linewidth": 1.6}


def clearance_figure(design: Design) -> Figure:
    """Draw the nearest pair of bodies above all others, and a panel per pair, for the twelve nearest pairs."""
    uses, distances = _uses(design), _distances(design)
    nearest = sorted(uses, key=lambda use: use.extreme)[: _COLUMNS * _ROWS]
    panel = Panel(widths=(3.4,), height=1.5, left=0.65, between=0.62, least=_LEAST)
    too_near = sum(not use.holds for use in uses)
    part = f", the nearest {len(nearest)} of {len(uses)} pairs" if len(nearest) < len(uses) else ""
    verdict = f"{too_near} BROKEN" if too_near else "all keep the clearance"
    title = f"{design.robot.name}: distances{part}; {verdict}"
    figure, flat, (overview,) = alike(len(nearest), _COLUMNS, panel, title, "time [s]", whole=1)
    time, scale = design.samples.time, _scale(nearest, distances)
    for use in nearest[1:]:
        overview.plot(time, _MILLIMETRES * distances[use.label], **_OTHERS)
    if nearest:
        _draw(overview, time, distances[nearest[0].label], nearest[0], scale)
        head(overview, f"nearest: {nearest[0].label}", _note(nearest[0]), _colour(nearest[0]))
    for ax, use in zip(flat, nearest, strict=True):
        _draw(ax, time, distances[use.label], use, scale)
        head(ax, use.label, _note(use), _colour(use))
    legend_below(figure, _legend(len(nearest) > 1))
    return figure


def _uses(design: Design) -> list[LimitUse]:
    labels = {label for limit in design.nonlinear if isinstance(limit, Clearance) for label in limit.labels}
    return [use for use in design.limits if use.label in labels]


def _distances(design: Design) -> dict[str, Array]:
    """Smallest of each label's functions at every instant [m]."""
    distances: dict[str, Array] = {}
    for limit in (each for each in design.nonlinear if isinstance(each, Clearance)):
        shown = limit.shown(limit.values(design.samples))
        for label in dict.fromkeys(limit.labels):
            distances[label] = shown[:, [other == label for other in limit.labels]].min(axis=1)
    return distances


def _scale(uses: Sequence[LimitUse], distances: Mapping[str, Array]) -> tuple[float, float, float]:
    """Bottom and top of all panels, and between them the clearance, up to which their scale is linear [mm]."""
    linear = max((_MILLIMETRES * use.bound for use in uses), default=1.0)
    values = np.concatenate([[linear], *(_MILLIMETRES * distances[use.label] for use in uses)])
    lowest = min([0.0, float(values.min()), *(_MILLIMETRES * use.extreme for use in uses)])
    return 1.1 * lowest, linear, max(1.3 * float(values.max()), 3.0 * linear)


def _draw(ax: Axes, time: Array, distance: Array, use: LimitUse, scale: tuple[float, float, float]) -> None:
    bottom, linear, top = scale
    bound, extreme = _MILLIMETRES * use.bound, _MILLIMETRES * use.extreme
    ax.plot(time, _MILLIMETRES * distance, **_NEAREST)
    ax.axhspan(bottom, bound, color=FORBIDDEN, linewidth=0, zorder=0.5)
    ax.axhline(bound, color=VERMILLION, linewidth=1.0, zorder=1.5)
    ax.plot([use.time], [extreme], "o", color=_colour(use), markersize=4.5, clip_on=False, zorder=3)
    ax.set_xlim(time[0], time[-1])
    ax.set_yscale("symlog", linthresh=linear, linscale=_LINEAR)
    ax.set_ylim(bottom, top)
    ax.yaxis.set_major_locator(SymmetricalLogLocator(base=10.0, linthresh=linear, subs=[1.0, 3.0]))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: typeset(f"{value:.4g}")))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.set_ylabel("distance [mm]", fontsize=NOTE, color=DARK)


def _colour(use: LimitUse) -> str:
    return DARK if use.holds else VERMILLION


def _note(use: LimitUse) -> str:
    extreme = f"{_MILLIMETRES * use.extreme:.1f} mm"
    return f"{extreme} or more" if use.holds else f"{extreme}, BROKEN"


def _legend(others: bool) -> list[Artist]:
    return [
        Line2D([], [], **_NEAREST, label="distance"),
        *([Line2D([], [], **_OTHERS, label="of the other pairs below")] if others else []),
        Patch(color=FORBIDDEN, label="closer than the clearance"),
        Line2D([], [], color=DARK, marker="o", markersize=4.5, linestyle="", label="no instant is below (proven)"),
    ]


_VIEWS = ((0, 1), (0, 2), (1, 2))
_AXES = "xyz"
# directions in which an outline is farthest, and corners of a circle
_AROUND, _ROUND = np.exp(2j * np.pi * np.arange(3600) / 3600).view(float).reshape(-1, 2), 24
_POSES = 6
_MARGIN = 0.05  # of the view
_HUGE = 3.0  # bodies and planes that would make the view so many times larger are cut
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_LETTERS = 150  # of a line of notes
_SIDE = 3.6  # of a view on a screen [in]
_SOME: dict[str, Any] = {"facecolor": "none", "edgecolor": "#ABABAB", "linewidth": 0.6}
_NEAREST_LINKS: dict[str, Any] = {"facecolor": "none", "edgecolor": DARK, "linewidth": 1.2}
_PATH: dict[str, Any] = {"color": BLUE, "linewidth": 1.4}
_SOLID: dict[str, Any] = {"facecolor": FORBIDDEN, "edgecolor": VERMILLION, "linewidth": 0.8}


def workspace_figure(design: Design) -> Figure:
    """Draw the path of the tool, the robot's capsules in several poses, and the obstacles, in three projections."""
    worlds = [world for world in (design.task.limits.known_world, design.shape) if world is not None]
    parts, obstacles = worlds[0].parts, [each for world in worlds for each in world.obstacles]
    robot = design.task.limits.applied(design.robot)
    samples = design.samples
    poses = link_poses(robot, whole_pose(robot, design.moving.joint_names, samples.q))
    lasts = [poses[link.name] for link in robot.tips]
    paths = [last[:, :3, :3] @ np.array(design.task.limits.tool_point) + last[:, :3, 3] for last in lasts]
    nearest = min(_uses(design), key=lambda use: use.extreme, default=None)
    shown = np.linspace(0, len(samples.time) - 1, _POSES + 1).round().astype(int)[:-1].tolist()
    shown += [] if nearest is None else [int(np.argmin(np.abs(samples.time - nearest.time)))]
    links = [[part.capsule.moved(poses[part.link][k]) for part in parts if part.link in poses] for k in shown]
    middle, half, said = _seen(np.vstack(paths), [capsule for pose in links for capsule in pose], obstacles)
    notes = broken(textwrap.fill("; ".join(said), _LETTERS), column_width())
    height = min(_SIDE, column_width() / columns_that_fit(3, Panel.least) / low(1.0))
    panel = Panel(widths=(_SIDE,) * 3, height=height, below=0.95 + 0.16 * len(notes.splitlines()))
    figure, axes = panels(1, panel, f"{design.robot.name}: tool and obstacles")
    for ax, plane in zip(axes[0], _VIEWS, strict=True):
        for obstacle in obstacles:
            _draw_obstacle(ax, obstacle.shape, plane, 10 * half)
        for k, pose in enumerate(links):
            style = _SOME if k < _POSES else _NEAREST_LINKS
            for capsule in pose:
                ax.add_artist(Polygon(_outline(capsule, plane), **style))
        for path in paths:
            ax.plot(path[:, plane[0]], path[:, plane[1]], **_PATH)
        x0, y0 = middle[list(plane)]
        ax.set_aspect("equal", adjustable="box")
        ax.set_xlim(x0 - half, x0 + half)
        ax.set_ylim(y0 - half, y0 + half)
        ax.set_xlabel(f"{_AXES[plane[0]]} [m]", fontsize=LABEL, color=DARK)
        value_axis(ax, f"{_AXES[plane[1]]} [m]")
    legend_below(figure, _legend_of_views(len(paths), nearest), title=plain(notes), title_fontsize=NOTE)
    return figure


def _legend_of_views(tools: int, nearest: LimitUse | None) -> list[Artist]:
    near = [] if nearest is None else [f"where two bodies are nearest, at {significant(nearest.time, 3)} s"]
    return [
        Line2D([], [], **_PATH, label="path of the tool" if tools == 1 else "paths of the last links"),
        Patch(**_SOME, label=f"links at {_POSES} equally spaced instants"),
        *(Patch(**_NEAREST_LINKS, label=text) for text in near),
        Patch(**_SOLID, label="obstacles"),
    ]


def _seen(paths: Array, links: Sequence[Capsule], obstacles: Sequence[Obstacle]) -> tuple[Array, float, list[str]]:
    """Middle and half side of the cube around paths, links and obstacles not far too large [m]; notes on the others."""
    corners = np.vstack([paths, *(_extent(capsule) for capsule in links)])
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
    return 0.5 * (low + high), (0.5 + _MARGIN) * float((high - low).max()), notes


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


def _outline(shape: Capsule | Box, view: tuple[int, int]) -> Array:
    """Corners of a shape's projection, in order, shape (N, 2)."""
    if isinstance(shape, Box):
        points = (_CORNERS * shape.size @ shape.rotation.T + shape.centre)[:, view]
    else:
        circle = shape.radius * _AROUND[:: len(_AROUND) // _ROUND]
        points = np.vstack([circle + np.array(end)[list(view)] for end in (shape.start, shape.end)])
    farthest = (points @ _AROUND.T).argmax(axis=0)
    return np.asarray(points[farthest[farthest != np.roll(farthest, 1)]])


def _draw_obstacle(ax: Axes, shape: Shape, view: tuple[int, int], far: float) -> None:
    if isinstance(shape, HalfSpace):
        if not _is_edge_on(np.array(shape.normal), view):
            return
        normal = np.array(shape.normal)[list(view)]
        edge, along = shape.offset * normal, far * np.array([-normal[1], normal[0]])
        corners = np.array([edge + along, edge - along, edge - along - far * normal, edge + along - far * normal])
    else:
        corners = _outline(shape, view)
    ax.add_artist(Polygon(corners, **_SOLID, zorder=0.5))


_PHASES_IN_A_ROW = 4
_PANEL = Panel((2.35,), 2.4, left=0.65, between=0.6)
_INSTANTS = 2001
_BEYOND = 0.06  # of the range, shown beyond a bound
_WIDER = 3.0  # a bound further out than this many times the motion's range is not in view


def phase_figure(design: Design) -> Figure:
    """Draw velocity over position of every function of the joints that has limits, over one period."""
    functions = motion_functions(design.moving, linear_limits(design.moving), design.limits)
    functions = [each for each in functions if each.bounds[0] or each.bounds[1]]
    samples = design.trajectory.samples(np.linspace(0.0, design.trajectory.duration, _INSTANTS))
    figure, flat, _ = alike(len(functions), _PHASES_IN_A_ROW, _PANEL, f"{design.robot.name}: velocity over position")
    for ax, each in zip(flat, functions, strict=True):
        z, dz = each.values(samples, 0), each.values(samples, 1)
        ax.set_xlim(*_view(z, each.allowed(0)))
        ax.set_ylim(*_view(dz, each.allowed(1)))
        shade(each.allowed(0), ax.get_xlim(), ax.axvspan, ax.axvline)
        shade(each.allowed(1), ax.get_ylim(), ax.axhspan, ax.axhline)
        ax.plot(z, dz, color=BLUE, linewidth=1.0)
        ax.plot(z[0], dz[0], "o", color=DARK, markersize=4)
        head(ax, each.name)
        ax.set_xlabel(typeset(f"position [{each.unit}]"), fontsize=NOTE, color=DARK)
        value_axis(ax, f"velocity [{each.unit}/s]")
    meanings = [
        Line2D([], [], color=BLUE, linewidth=1.2, label="motion"),
        Line2D([], [], color=DARK, marker="o", linestyle="", markersize=4, label="at rest, start and end"),
        Patch(facecolor=FORBIDDEN, edgecolor=VERMILLION, label="beyond a limit"),
    ]
    legend_below(figure, meanings)
    return figure


def _view(values: Array, bounds: tuple[float, float]) -> tuple[float, float]:
    """Range to show: the motion, and its bounds where they are near."""
    low, high = float(values.min()), float(values.max())
    size = max(high - low, 1e-9)
    ends = [low, high, *(b for b in bounds if np.isfinite(b) and low - _WIDER * size < b < high + _WIDER * size)]
    margin = _BEYOND * max(max(ends) - min(ends), 1e-9)
    return min(ends) - margin, max(ends) + margin
