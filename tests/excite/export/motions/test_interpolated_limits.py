"""Limits of what a controller interpolates: exact for quintics and lines, refused or sampled faster beyond them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from designed import irp6, panda, ur10e
from scipy.interpolate import BPoly

import excite
from constraints.interpolation import Curve, curve_pieces
from excite.export.motions.export_motion import export_motion
from excite.export.motions.franka import ACCELERATION, JERK, VELOCITY, check_rates, fr3_velocities
from excite.export.motions.motion_format import Interpolation, certify, deviation
from excite.export.motions.ros2 import Ros2Yaml
from excite.export.motions.sampled_design import SampledDesign, breaks_of, sampled_design
from excite.trajectories import Fourier, Trajectory
from excite.trajectories.bspline import BSpline
from excite.trajectories.family import Family
from excite.trajectories.waypoints import Waypoints
from regressors.samples import Samples


def quintic(motion: SampledDesign) -> BPoly:
    """SciPy's own Hermite quintic through the samples."""
    samples = motion.samples
    return BPoly.from_derivatives(samples.time, np.stack([samples.q, samples.dq, samples.ddq], axis=1))


@pytest.mark.slow
def test_quintics_are_those_of_scipy() -> None:
    motion = sampled_design(panda(), 20.0, breaks=True)
    pieces, curve = curve_pieces(motion.samples, Curve.QUINTICS), quintic(motion)
    step, local = np.diff(motion.time), np.random.default_rng(0).uniform(0, 1, motion.time.size - 1)
    at = motion.time[:-1] + local * step
    values = np.array([np.polyval(pieces[:, k], t) for k, t in enumerate(local * step)])
    assert np.abs(values - curve(at)).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "breaks"), [(7.0, False), (20.0, True), (100.0, False)])
def test_extrema_of_quintics_are_those_of_fine_samples(rate: float, breaks: bool) -> None:
    motion = sampled_design(panda(), rate, breaks=breaks)
    uses = {use.label: use for use in certify(motion, Interpolation.QUINTIC).uses}
    fine = np.unique(
        np.concatenate([np.linspace(a, b, 60) for a, b in zip(motion.time[:-1], motion.time[1:], strict=True)])
    )
    for order, quantity in enumerate(("position", "velocity", "acceleration")):
        values = quintic(motion).derivative(order)(fine) if order else quintic(motion)(fine)
        for joint, name in enumerate(motion.joints):
            extreme = uses[f"joint {name} {quantity}"].extreme
            low, high = values[:, joint].min(), values[:, joint].max()
            slack = 1e-9 * max(abs(low), abs(high), 1e-6)
            assert extreme <= low + slack or extreme >= high - slack  # never inside what is reached
            assert min(abs(extreme - low), abs(extreme - high)) <= 2e-3 * (high - low) + slack


def test_samples_at_the_breaks_make_approach_and_return_exact() -> None:
    design = panda()
    fine = np.linspace(0.0, design.sequence.duration, 5001)
    exact = design.sequence.at(fine)[0].ddq
    errors = [
        np.abs(quintic(sampled_design(design, 30.0, breaks=breaks)).derivative(2)(fine) - exact).max()
        for breaks in (False, True)
    ]
    assert errors[1] < 1e-2 * errors[0]
    motion = sampled_design(design, 30.0, breaks=True)
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


def moved(motion: SampledDesign, q: np.ndarray, rate: float) -> SampledDesign:
    time, still = np.arange(len(q)) / rate, np.zeros_like(q)
    return replace(motion, rate=rate, samples=Samples(time, q, still, still, still))


def test_differences_of_lines_are_written_out() -> None:
    motion = sampled_design(panda(), 250.0)
    uses = {use.label: use for use in certify(motion, Interpolation.LINEAR).uses}
    q, h = motion.samples.q[:, 5], 1.0 / 250.0
    jumps = [(q[k + 1] - q[k]) / h for k in range(len(q) - 1)]
    turns = [(b - a) / h for a, b in zip([0.0, *jumps], [*jumps, 0.0], strict=True)]
    name = f"joint {motion.joints[5]}"
    assert abs(uses[f"{name} velocity"].extreme) == pytest.approx(max(map(abs, jumps)))
    assert abs(uses[f"{name} acceleration"].extreme) == pytest.approx(max(map(abs, turns)))


def test_a_step_breaks_the_limits_of_lines() -> None:
    motion = sampled_design(panda(), 1000.0)
    q = motion.samples.q.copy()
    q[500:, 3] += 3e-3
    broken = certify(moved(motion, q, 1000.0), Interpolation.LINEAR).broken
    assert broken[0].label.endswith(("velocity", "acceleration", "jerk"))
    assert {use.label.split()[1] for use in broken} == {"panda_joint4"}


def test_a_design_that_broke_a_limit_is_refused(tmp_path: Path) -> None:
    design = irp6()
    broken = replace(design, task=design.task.changed(torque_margin=0.8))  # a reserve that it was not designed for
    with pytest.raises(excite.errors.BrokenLimitError, match="does not keep its limits"):
        export_motion(broken, "npz", tmp_path / "a.npz")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_faster_motion_than_the_robot_s_is_refused(tmp_path: Path) -> None:
    design = ur10e()
    fast = replace(design, trajectory=replace(design.trajectory, x=1.5 * design.trajectory.x))
    with pytest.raises(excite.errors.BrokenLimitError, match=r"(velocity|position) is"):
        export_motion(fast, "npz", tmp_path / "a.npz")


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


@pytest.mark.parametrize(
    ("order", "bound", "word"), [(1, VELOCITY, "velocity"), (2, ACCELERATION, "acceleration"), (3, JERK, "jerk")]
)
def test_libfranka_s_limits_count_differences(order: int, bound: np.ndarray, word: str) -> None:
    robot = panda().robot
    pose = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.8])

    def checked(part: float) -> None:
        change = bumps(order, part * bound[3])
        q = np.tile(pose, (change.size, 1))
        q[:, 3] += change
        check_rates(robot, q)

    checked(0.999)
    with pytest.raises(
        excite.errors.BrokenLimitError, match=rf"libfranka refuses the motion: the {word} of panda_joint4"
    ):
        checked(1.001)


def test_the_fr3_is_slower_near_its_ends() -> None:
    middle = np.array([[0.0, 0.0, 0.0, -1.5, 0.0, 2.0, 0.0]])
    least, most = fr3_velocities(middle)
    assert most[0] == pytest.approx([2.619, 2.619, 2.619, 2.619, 5.259, 4.179, 5.259], abs=0.5)
    near = middle.copy()
    near[0, 0] = 2.7
    assert fr3_velocities(near)[1][0, 0] == pytest.approx(-0.30 + np.sqrt(12.0 * 0.0501) - 1e-3)
    assert np.array_equal(fr3_velocities(near)[0][0, 1:], least[0, 1:])


FAMILIES = [BSpline(4.0, 8, 4), BSpline(4.0, 8, 6), Waypoints(4.0, 3), Fourier(4.0, 3)]


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.described)
@pytest.mark.parametrize("rate", [20.0, 50.0, 130.0])
def test_quintics_are_the_motion_of_every_family_of_polynomials(family: Family, rate: float) -> None:
    rng = np.random.default_rng(1)
    x = family.resting(np.zeros(3), rng)
    x = x + 0.3 * rng.normal(size=x.shape)
    design = replace(irp6(), trajectory=Trajectory(family, x))
    away = deviation(sampled_design(design, rate, breaks=True), Interpolation.QUINTIC)
    assert away is not None
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
