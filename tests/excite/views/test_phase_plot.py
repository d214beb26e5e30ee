"""Phase plots: the motion within its limits, one panel per coordinate."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.task import Task
from excite.views.phase_plot import phase_figure


@pytest.fixture(scope="module")
def design() -> Design:
    return design_trajectory(Task("irp6", starts=1, harmonics=3, executor="serial"))


@pytest.fixture(scope="module")
def figure(design: Design) -> Figure:
    return phase_figure(design)


def test_one_panel_per_coordinate_with_units(figure: Figure) -> None:
    """Drive z1 is joint q1, and z4 turns along with z3 while joint 4 rests."""
    names = [ax.get_title(loc="left") for ax in figure.axes]
    assert names == ["q1", "q2", "q3", "drives z3, z4: q2 + q3"]
    for ax in figure.axes:
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("position [rad]", "velocity [rad/s]")


def test_curves_are_the_motion_of_joints_and_drives(design: Design, figure: Figure) -> None:
    samples = design.trajectory.samples(np.linspace(0.0, 10.0, 2001))
    rows = ([1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1])
    for ax, row in zip(figure.axes, rows, strict=True):
        curve = ax.lines[-2].get_xydata()
        np.testing.assert_allclose(curve, np.column_stack([samples.q @ row, samples.dq @ row]), atol=1e-12)
        start = ax.lines[-1].get_xydata()
        np.testing.assert_allclose(start, [[(samples.q @ row)[0], 0.0]], atol=1e-12)


def test_bounds_are_those_of_joints_and_drives_the_tighter_ones(figure: Figure) -> None:
    lines = [
        sorted({round(float(x), 5) for line in ax.lines[:-2] for x in line.get_xydata().ravel()}) for ax in figure.axes
    ]
    assert {-2.96706, 2.96706, -1.266, 1.266} <= set(lines[0])
    assert {-0.69813, 0.43633, -1.137, 1.137} <= set(lines[3])
    for ax in figure.axes:
        curve = ax.lines[-2].get_xydata()
        assert np.all(curve[:, 0] >= ax.get_xlim()[0])
        assert np.all(curve[:, 1] <= ax.get_ylim()[1])


@pytest.mark.slow
def test_a_bound_far_away_does_not_flatten_the_motion() -> None:
    limits = LimitChoice(velocity=(50.0,), acceleration=(1.0,))
    design = design_trajectory(
        Task("ur10e", joints=("1", "2"), starts=1, harmonics=3, executor="serial", limits=limits)
    )
    for ax in phase_figure(design).axes:
        speed = np.abs(ax.lines[-2].get_xydata()[:, 1]).max()
        assert ax.get_ylim()[1] < 2 * speed
