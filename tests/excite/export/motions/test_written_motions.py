"""What is written is what was certified: read back as others do, interpolated, judged at 20 kHz, refused beyond."""

from __future__ import annotations

import csv
import io
import itertools
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from designed import irp6, panda, planar, ur10e
from robot_programs import krl_program, rapid_moves, ur_program
from scipy.interpolate import BPoly, CubicSpline, PPoly

import excite
from excite.design.design import Design
from excite.export.motions.export_motion import export_motion
from excite.export.motions.industrial import ACCELERATION, JERK, VELOCITY, check_rates, fr3_velocities
from excite.export.motions.motion_format import Interpolation, certify, deviation
from excite.export.motions.ros2 import Ros2Yaml
from excite.export.motions.sampled_design import SampledDesign, breaks_of, sampled_design
from excite.registry import TRAJECTORIES
from excite.trajectories import Fourier, Trajectory
from excite.trajectories.bspline import BSpline
from excite.trajectories.family import Family
from excite.trajectories.transfer import SCurve
from excite.trajectories.waypoints import Waypoints
from regressors.samples import Array

ALLOWED = 1e-6
Columns = tuple[Array, Array, Array, Array]
FAMILIES = [name for name in TRAJECTORIES if name != "custom"]


def goal_of(design: Design, folder: Path, **options: float) -> Columns:
    """Points of a goal for ROS 2, by PyYAML: times [s], positions, velocities, accelerations."""
    path = folder / "goal.yaml"
    excite.export_motion(design, "ros2-yaml", path, replace=True, **options)
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
    channels = ("position", "velocity", "acceleration")
    return time, *(np.array([[float(row[f"{joint}.{of}"]) for joint in joints] for row in rows]) for of in channels)


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


def stated(design: Design) -> dict[str, bool]:
    """Whether the design's file says that each curve through trajectory.csv keeps the limits."""
    content = json.loads((design.folder / "design.json").read_text())
    return {each["curve"]: each["holds"] for each in content["played"]["between_samples"]}


def check_trajectory(design: Design) -> None:
    """What the file says of trajectory.csv is what an independent reader finds."""
    columns = read_trajectory(design.folder / "trajectory.csv")
    hermites = {name: largest_use(hermite(columns, given), design) for name, given in (("cubics", 1), ("quintics", 2))}
    uses = {"lines": differences(*columns[:2], design), **hermites}
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
    assert (stated(design)["lines"], stated(design)["quintics"]) == (True, False)
    quintics = hermite(read_trajectory(design.folder / "trajectory.csv"), 2)
    assert largest_use(quintics, design) > 1.05
    assert largest_use(hermite(goal_of(design, tmp_path), 2), design) <= 1.0 + ALLOWED


def test_instants_are_rounded_before_the_formula_is_evaluated(tmp_path: Path) -> None:
    time, *columns = goal_of(panda(), tmp_path, rate=333.0)
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
    return replace(design, task=replace(design.task, limits=limits))


@pytest.mark.slow
@pytest.mark.parametrize(("family", "jerk"), [*zip(FAMILIES, itertools.cycle([100.0, 15.0]), strict=False)])
def test_designs_of_every_family_keep_their_limits_as_written(family: str, jerk: float, tmp_path: Path) -> None:
    design = planar(family, seed=FAMILIES.index(family), jerk=jerk)
    assert "approach" in json.loads((design.folder / "design.json").read_text())["played"]
    assert largest_use(hermite(goal_of(design, tmp_path), 2), design) <= 1.0 + ALLOWED
    check_trajectory(design)
    assert all(stated(design).values()) or family == "waypoints"  # whose jerk jumps at free times
    arrays = np.load(excite.export_motion(design, "npz", tmp_path / "a.npz").files[0])
    assert differences(arrays["time"], arrays["q"], design) <= 1.0 + ALLOWED


def quintic(motion: SampledDesign) -> BPoly:
    """SciPy's own Hermite quintic through the samples."""
    samples = motion.samples
    return BPoly.from_derivatives(samples.time, np.stack([samples.q, samples.dq, samples.ddq], axis=1))


def test_samples_at_the_breaks_make_approach_and_return_exact() -> None:
    design = panda()
    fine = np.linspace(0.0, design.sequence.duration, 5001)
    exact = design.sequence.at(fine)[0].ddq
    motions = [sampled_design(design, 30.0, breaks=breaks) for breaks in (False, True)]
    errors = [np.abs(quintic(motion).derivative(2)(fine) - exact).max() for motion in motions]
    assert errors[1] < 1e-2 * errors[0]
    motion = motions[1]
    inner = breaks_of(design.sequence)
    inner = inner[(inner > 0) & (inner < design.sequence.duration - 1e-9)]
    assert all(np.abs(motion.time - at).min() < 1e-12 for at in inner)
    assert np.diff(motion.time).min() > 0.1 / 30.0


def test_a_rate_too_low_is_refused_and_none_given_is_raised(tmp_path: Path) -> None:
    class Slow(Ros2Yaml):
        default_rate = 3.0

    with pytest.raises(excite.errors.BrokenLimitError, match=r"raise `rate`"):
        export_motion(panda(), "ros2-yaml", tmp_path / "a.yaml", rate=3.0)
    assert not list(tmp_path.iterdir())
    written = export_motion(panda(), Slow(), tmp_path / "a.yaml")
    assert written.facts["rate"] > 3.0
    assert "would break a limit" in written.notes[0]


def test_differences_of_lines_are_written_out() -> None:
    motion = sampled_design(panda(), 250.0)
    uses = {use.label: use for use in certify(motion, Interpolation.LINEAR)[0].uses}
    q, h = motion.samples.q[:, 5], 1.0 / 250.0
    jumps = [(q[k + 1] - q[k]) / h for k in range(len(q) - 1)]
    turns = [(b - a) / h for a, b in zip([0.0, *jumps], [*jumps, 0.0], strict=True)]
    name = f"joint {motion.joints[5]}"
    assert abs(uses[f"{name} velocity"].extreme) == pytest.approx(max(map(abs, jumps)))
    assert abs(uses[f"{name} acceleration"].extreme) == pytest.approx(max(map(abs, turns)))


def test_a_design_that_broke_a_limit_is_refused(tmp_path: Path) -> None:
    design = irp6()
    broken = replace(design, task=design.task.changed(torque_margin=0.8))  # a reserve that it was not designed for
    with pytest.raises(excite.errors.BrokenLimitError, match="does not keep its limits"):
        export_motion(broken, "npz", tmp_path / "a.npz")
    assert not list(tmp_path.iterdir())


def bumps(order: int, size: float) -> np.ndarray:
    """Positions whose difference of an order reaches a size, and those of other orders stay small."""
    if order == 3:
        rate = size * np.array([1.0, -1.0, -1.0, 1.0])
    else:
        half = size * np.sin(np.pi * np.arange(2000 if order == 1 else 100) / (1999 if order == 1 else 99)) ** 2
        rate = half if order == 1 else np.concatenate([half, -half])
    rate = np.concatenate([np.zeros(10), rate, np.zeros(10)])
    for _ in range(order):
        rate = 1e-3 * np.cumsum(rate)
    return np.asarray(rate)


FRANKA = [(1, VELOCITY, "velocity"), (2, ACCELERATION, "acceleration"), (3, JERK, "jerk")]


@pytest.mark.parametrize(("order", "bound", "word"), FRANKA)
def test_libfranka_s_limits_count_differences(order: int, bound: np.ndarray, word: str) -> None:
    robot = panda().robot
    pose = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.8])

    def checked(part: float) -> None:
        change = bumps(order, part * bound[3])
        check_rates(robot, pose + np.outer(change, np.eye(7)[3]))

    checked(0.999)
    refused = rf"libfranka refuses the motion: the {word} of panda_joint4"
    with pytest.raises(excite.errors.BrokenLimitError, match=refused):
        checked(1.001)


def test_the_fr3_is_slower_near_its_ends() -> None:
    middle = np.array([[0.0, 0.0, 0.0, -1.5, 0.0, 2.0, 0.0]])
    least, most = fr3_velocities(middle)
    assert most[0] == pytest.approx([2.619, 2.619, 2.619, 2.619, 5.259, 4.179, 5.259], abs=0.5)
    near = middle.copy()
    near[0, 0] = 2.7
    assert fr3_velocities(near)[1][0, 0] == pytest.approx(-0.30 + np.sqrt(12.0 * 0.0501) - 1e-3)
    assert np.array_equal(fr3_velocities(near)[0][0, 1:], least[0, 1:])


POLYNOMIALS = [BSpline(4.0, 8, 4), BSpline(4.0, 8, 6), Waypoints(4.0, 3), Fourier(4.0, 3)]


@pytest.mark.parametrize("family", POLYNOMIALS, ids=lambda family: family.described)
@pytest.mark.parametrize("rate", [20.0, 50.0, 130.0])
def test_quintics_are_the_motion_of_every_family_of_polynomials(family: Family, rate: float) -> None:
    rng = np.random.default_rng(1)
    x = family.resting(np.zeros(3), rng)
    x = x + 0.3 * rng.normal(size=x.shape)
    design = replace(irp6(), trajectory=Trajectory(family, x))
    away = deviation(sampled_design(design, rate, breaks=True), Interpolation.QUINTIC)
    assert away < (1e-6 if isinstance(family, Fourier) else 1e-12)


def test_lines_deviate_by_the_acceleration() -> None:
    design = panda()
    errors = [deviation(sampled_design(design, rate), Interpolation.LINEAR) for rate in (250.0, 500.0)]
    assert None not in errors
    largest = np.abs(sampled_design(design, 2000.0).samples.ddq).max()
    assert errors[0] == pytest.approx(largest / 8 / 250.0**2, rel=0.02)
    assert errors[1] == pytest.approx(errors[0] / 4, rel=0.02)
    assert deviation(sampled_design(design, 250.0), Interpolation.NONE) is None


class Turning(Fourier):
    """A series that moves at its ends."""

    def _rest_basis(self) -> np.ndarray:
        return np.eye(2 * self.harmonics + 1)[:, : 2 * self.harmonics - 1]


def test_a_motion_that_does_not_begin_at_rest_is_refused() -> None:
    family = Turning(4.0, 2)
    design = replace(irp6(), trajectory=Trajectory(family, np.array([[0.0, 0.1, 0.1]] * 3)))
    with pytest.raises(excite.InputError, match=r"begins or ends with \w+, and a robot that stands still"):
        sampled_design(design, 100.0)


@pytest.mark.parametrize("rate", [33.0, 100.0, 777.0])
def test_ends_are_exactly_at_rest_at_any_rate(rate: float) -> None:
    for design in (irp6(), panda()):
        samples = sampled_design(design, rate).samples
        assert not samples.dq[[0, -1]].any()
        assert not samples.ddq[[0, -1]].any()
        assert 0.0 <= samples.time[-1] - design.sequence.duration < 1.0 / rate
        np.testing.assert_allclose(samples.q[-1], samples.q[0], rtol=0.0, atol=1e-15)  # rounding of a sum of sines


class Undefined(Fourier):
    """A series whose positions are no numbers in between."""

    def basis(self, time: np.ndarray, derivative: int) -> np.ndarray:
        return np.where(abs(time - 2.0)[:, None] < 0.1, np.nan, super().basis(time, derivative))


def test_numbers_that_are_none_are_refused() -> None:
    design = replace(irp6(), trajectory=Trajectory(Undefined(4.0, 2), np.zeros((3, 3))))
    with pytest.raises(excite.NumericalError, match=r"at 1\.9\d* s is not a finite number"):
        sampled_design(design, 100.0)
