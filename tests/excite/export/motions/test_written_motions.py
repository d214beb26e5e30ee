"""What is written is what was certified: files read back as others do, interpolated, and judged at 20 kHz."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from designed import panda, planar, ur10e
from robot_programs import krl_program, rapid_moves, ur_program
from scipy.interpolate import BPoly, CubicSpline, PPoly

import excite
from excite.design.design import Design
from excite.export.motions.sampled_design import sampled_design
from excite.registry import TRAJECTORIES
from excite.trajectories.transfer import SCurve
from regressors.samples import Array

ALLOWED = 1e-6
Columns = tuple[Array, Array, Array, Array]
FAMILIES = [name for name in TRAJECTORIES if name != "custom"]


def read_goal(path: Path) -> Columns:
    """Points of a goal for ROS 2, by PyYAML: times [s], positions, velocities, accelerations."""
    points = yaml.load(path.read_text(), Loader=yaml.CSafeLoader)["trajectory"]["points"]
    time = [point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points]
    q, dq, ddq = (np.array([point[name] for point in points]) for name in ("positions", "velocities", "accelerations"))
    return np.array(time), q, dq, ddq


def read_trajectory(path: Path) -> Columns:
    """Columns of trajectory.csv, by Python's own reader."""
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    joints = [name.removesuffix(".position") for name in rows[0] if name.endswith(".position")]
    time = np.array([float(row["time"]) for row in rows])
    columns = [
        np.array([[float(row[f"{joint}.{what}"]) for joint in joints] for row in rows])
        for what in ("position", "velocity", "acceleration")
    ]
    return time, columns[0], columns[1], columns[2]


def hermite(columns: Columns, given: int) -> PPoly:
    """SciPy's Hermite interpolation of positions and so many derivatives."""
    time, *motion = columns
    curve = BPoly.from_derivatives(time, np.stack(motion[: given + 1], axis=1))
    return PPoly.from_bernstein_basis(curve)


def largest_use(curve: PPoly, design: Design) -> float:
    """Largest fraction used of a bound of velocity, acceleration or jerk, at 20 kHz and at both ends of every piece."""
    limits = design.task.limits.applied(design.robot).limits
    worst = 0.0
    for order, bound in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk)):
        c, h = curve.derivative(order).c, np.diff(curve.x)
        local = h[:, None] * np.linspace(0.0, 1.0, int(np.ceil(20_000 * h.max())) + 1)
        values = np.zeros((*local.shape, c.shape[2]))
        for row in c:
            values = values * local[:, :, None] + row[:, None]
        worst = max(worst, float((np.abs(values) / bound).max()))
    return worst


def differences(time: Array, q: Array, design: Design) -> float:
    """The same by differences of equal steps, with rest before and after."""
    limits, h = design.task.limits.applied(design.robot).limits, (time[-1] - time[0]) / (time.size - 1)
    rest = np.concatenate([np.repeat(q[:1], 3, axis=0), q, np.repeat(q[-1:], 3, axis=0)])
    rates = [np.diff(rest, n=order, axis=0) / h**order for order in (1, 2, 3)]
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    return max(float((np.abs(rate) / bound).max()) for rate, bound in zip(rates, bounds, strict=True))


def goal_of(design: Design, folder: Path, **options: float) -> Columns:
    path = folder / "goal.yaml"
    excite.export_motion(design, "ros2-yaml", path, replace=True, **options)  # type: ignore[arg-type]
    return read_goal(path)


def stated(design: Design) -> dict[str, bool]:
    """Whether the design's file says that each curve through trajectory.csv keeps the limits."""
    content = json.loads((design.folder / "design.json").read_text())
    return {each["curve"]: each["holds"] for each in content["played"]["between_samples"]}


def check_trajectory(design: Design) -> None:
    """What the file says of trajectory.csv is what an independent reader finds."""
    columns = read_trajectory(design.folder / "trajectory.csv")
    uses = {
        "lines": differences(*columns[:2], design),
        "cubics": largest_use(hermite(columns, 1), design),
        "quintics": largest_use(hermite(columns, 2), design),
    }
    assert {curve: use <= 1.0 + ALLOWED for curve, use in uses.items()} == stated(design), uses


@pytest.mark.parametrize("rate", [None, 137.0, pytest.param(1000.0, marks=pytest.mark.slow)])
def test_what_ros_interpolates_keeps_the_limits(rate: float | None, tmp_path: Path) -> None:
    design = planar("fourier")
    goal = goal_of(design, tmp_path, **({} if rate is None else {"rate": rate}))
    assert largest_use(hermite(goal, 2), design) <= 1.0 + ALLOWED
    check_trajectory(design)


def test_jerks_that_jump_between_samples_are_stated_and_exported_with_samples_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in files of earlier versions, whose approach changes its jerk between samples."""

    def stretched(law: SCurve, period: float) -> SCurve:
        return law.stretched(np.ceil(law.duration / period) * period)

    monkeypatch.setattr(SCurve, "on_grid", stretched)
    design = planar("fourier", seed=1)
    check_trajectory(design)
    assert stated(design) == {"lines": True, "cubics": False, "quintics": False}
    quintics = hermite(read_trajectory(design.folder / "trajectory.csv"), 2)
    assert largest_use(quintics, design) > 1.05
    assert largest_use(hermite(goal_of(design, tmp_path), 2), design) <= 1.0 + ALLOWED


@pytest.mark.parametrize("rate", [100.0, 333.0])
def test_instants_are_rounded_before_the_formula_is_evaluated(rate: float, tmp_path: Path) -> None:
    time, *columns = goal_of(panda(), tmp_path, rate=rate)
    expected = panda().sequence.at(time)[0]
    for values, exact in zip(columns, (expected.q, expected.dq, expected.ddq), strict=True):
        np.testing.assert_allclose(values[1:-1], exact[1:-1], rtol=0.0, atol=1e-10)


PROGRAMS: dict[str, tuple[str, Callable[[str], list[list[float]]]]] = {
    "krl": (".src", lambda text: krl_program(text).points),
    "rapid": (".mod", lambda text: [move.axes for move in rapid_moves(text)]),
    "urscript": (".script", lambda text: [q for q, _ in ur_program(text).steps()]),
    "rsi": (".csv", lambda text: _rows(text, slice(1, 7))),
    "egm": (".csv", lambda text: _rows(text, slice(1, 7))),
}


def _rows(text: str, columns: slice) -> list[list[float]]:
    lines = [line for line in text.splitlines() if not line.startswith("#")][1:]
    return np.loadtxt(io.StringIO("\n".join(lines)), delimiter=",")[:, columns].tolist()


@pytest.mark.parametrize("form", PROGRAMS)
def test_rows_of_controllers_keep_the_limits_by_differences_and_splines(form: str, tmp_path: Path) -> None:
    suffix, read = PROGRAMS[form]
    path = tmp_path / f"motion{suffix}"
    written = excite.export_motion(ur10e(), form, path)
    q = np.array(read(path.read_bytes().decode()))
    q = q if form == "urscript" else np.radians(q)
    time = np.arange(len(q)) / written.facts["rate"]
    assert differences(time, q, ur10e()) <= 1.0 + ALLOWED
    spline = PPoly.construct_fast(*(lambda s: (s.c, s.x))(CubicSpline(time, q, bc_type="clamped")))
    keeps = largest_use(spline, ur10e()) <= 1.0 + ALLOWED
    assert written.holds
    assert keeps or form in ("rsi", "egm", "urscript")  # by the documentation they take rows as they are


@pytest.mark.slow
def test_a_controller_that_is_not_documented_ends_with_the_amount(tmp_path: Path) -> None:
    design = ur10e()
    limits = excite.LimitChoice(torque_margin=None, acceleration=(0.9 * np.abs(_acceleration(design)).max(),) * 6)
    assert excite.export_motion(design, "krl", tmp_path / "a.src").facts["limits_kept"]
    with pytest.raises(excite.errors.BrokenLimitError):  # the formula itself
        excite.export_motion(_with(design, limits), "krl", tmp_path / "b.src")
    peak = float(np.abs(_acceleration(design)).max()) * (1 + 1e-7)  # of samples: the motion's own is a little higher
    exact = excite.LimitChoice(torque_margin=None, acceleration=(peak,) * 6)
    written = excite.export_motion(_with(design, exact), "krl", tmp_path / "c.src", rate=25.0)
    assert not written.holds
    assert any("cubics pass" in note and "acceleration by" in note for note in written.notes)
    arrays = excite.export_motion(_with(design, exact), "npz", tmp_path / "c.npz", rate=25.0)
    assert arrays.holds  # no controller plays it
    assert not arrays.facts["limits_kept"]


def _acceleration(design: Design) -> Array:
    fine = sampled_design(design, 20_000.0, most=10**7).samples.ddq
    return np.asarray(fine)


def _with(design: Design, limits: excite.LimitChoice) -> Design:
    from dataclasses import replace

    return replace(design, task=replace(design.task, limits=limits))


@pytest.mark.slow
@pytest.mark.parametrize("jerk", [100.0, 15.0])
@pytest.mark.parametrize("family", FAMILIES)
def test_designs_of_every_family_keep_their_limits_as_written(family: str, jerk: float, tmp_path: Path) -> None:
    design = planar(family, seed=FAMILIES.index(family), jerk=jerk)
    assert "approach" in json.loads((design.folder / "design.json").read_text())["played"]
    assert largest_use(hermite(goal_of(design, tmp_path), 2), design) <= 1.0 + ALLOWED
    check_trajectory(design)
    assert all(stated(design).values()) or family == "waypoints"  # whose jerk jumps at free times
    arrays = np.load(excite.export_motion(design, "npz", tmp_path / "a.npz").files[0])
    assert differences(arrays["time"], arrays["q"], design) <= 1.0 + ALLOWED
