"""Ramps of torque in friction plans: slope, size, order, pose, what bounds them, and the files."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from commands import Here, files_below
from pinocchio_chains import gravity_along

from excite.design.friction_runs.friction_plan import FrictionPlan
from excite.design.friction_runs.plan_friction import plan_friction
from excite.design.friction_runs.schedule import Schedule, torque_ramps
from excite.simulation.simulation_files import read_motion
from excite.tasks.limit_choice import LimitChoice
from regressors.errors import InputError
from regressors.readers.library import built_in
from regressors.robot.robot import Robot

SHORT = Schedule(percent=(50.0,), warm_up=0.0, breakaways=2, creeping=0.5, rate=200.0, pause=1.3, ramping=2.5)
planned = partial(plan_friction, limits=LimitChoice(self_collision=False))  # with distances: test_plan_world.py


@cache
def plan() -> FrictionPlan:
    return planned(built_in("irp6"), SHORT, drives=("1", "3"))


def limited(robot: Robot, torque: float) -> Robot:
    """The same with other torque limits of its drives."""
    drives = robot.transmission
    limits = replace(drives.limits, torque=np.full_like(drives.limits.torque, torque))
    return robot.replace(transmission=replace(drives, limits=limits))


def test_torque_rises_in_proportion_to_time_to_the_largest_one_and_is_zero_elsewhere() -> None:
    for c, largest in zip(plan().coordinates, (1.5 * 28.0, 1.5 * 30.0), strict=True):
        samples, torque, segments = c.ramps.samples(c.place.pose)
        inside = np.zeros(torque.size, dtype=bool)
        for ramp in c.ramps.ramps:
            here = (samples.time >= ramp.start - 1e-9) & (samples.time <= ramp.end + 1e-9)
            assert ramp.end - ramp.start == pytest.approx(2.5)
            assert ramp.rate == pytest.approx(ramp.direction * largest / 2.5)
            np.testing.assert_allclose(np.diff(torque[here]), ramp.rate / 200.0, rtol=1e-9)
            assert torque[here][0] == pytest.approx(0.0, abs=1e-12)
            assert torque[here][-1] == pytest.approx(ramp.direction * largest)
            assert {segments[k] for k in np.flatnonzero(here)} == {ramp.segment}
            inside |= here
        np.testing.assert_array_equal(torque[~inside], 0.0)
        assert {segments[k] for k in np.flatnonzero(~inside)} == {"rest"}


def test_directions_alternate_with_rests_between() -> None:
    ramps = plan().coordinates[0].ramps
    assert [ramp.segment for ramp in ramps.ramps] == ["z1 stiction +", "z1 stiction -"] * 2
    assert [ramp.direction for ramp in ramps.ramps] == [1, -1, 1, -1]
    ends = [0.0, *(ramp.end for ramp in ramps.ramps)]
    starts = [*(ramp.start for ramp in ramps.ramps), ramps.duration]
    np.testing.assert_allclose(np.subtract(starts, ends), 1.3, atol=1e-9)
    (hasty,) = planned(built_in("irp6"), replace(SHORT, pause=0.0), drives=("1",)).coordinates
    assert hasty.ramps.ramps[1].start - hasty.ramps.ramps[0].end == pytest.approx(1.0)


def test_torque_is_capped_at_half_of_the_limit_less_gravity() -> None:
    robot, line = built_in("irp6"), np.eye(5)[0]
    for limit, gravity, largest, told in (
        (300.0, 0.0, 42.0, "1.5 times the Coulomb friction"),
        (60.0, 0.0, 30.0, "50 % of the torque limit"),
        (60.0, -45.0, 15.0, "torque limit"),
        (40.0, 0.0, 20.0, "the stated friction of 28 Nm is larger, so the drive may not break away"),
    ):
        ramps, reason = torque_ramps(limited(robot, limit), SHORT, "z1", line, gravity)
        assert (reason, ramps.largest) == ("", pytest.approx(largest))
        assert told in ramps.origin
    none, reason = torque_ramps(limited(robot, 60.0), SHORT, "z1", line, 61.0)
    assert none is None
    assert "gravity of 61 Nm exceeds the torque limit of 60 Nm" in reason
    with pytest.raises(InputError, match=r"z1: a torque ramp to 16 Nm on top of the 45 Nm of gravity exceeds .* 60 Nm"):
        torque_ramps(limited(robot, 60.0), SHORT, "z1", line, 45.0, 16.0)
    ramps, _ = torque_ramps(robot, SHORT, "q1", -line, 0.0)  # a drive that turns against its coordinate
    assert [(ramp.direction, np.sign(ramp.rate)) for ramp in ramps.ramps] == [(1, -1), (-1, 1)] * 2


def test_torques_that_are_given() -> None:
    robot = built_in("ur10e")
    one, two = planned(robot, SHORT, drives=("1", "6"), torque_ramp=(20.0, 0.0)).coordinates
    assert (one.ramps.largest, one.ramps.drive, one.ramps.origin) == (20.0, "shoulder_pan_joint", "given")
    assert (two.ramps, two.no_ramps) == (None, "none were requested")
    both = planned(robot, SHORT, drives=("1", "6"), torque_ramp=(5.0,)).coordinates
    assert [c.ramps.largest for c in both if c.ramps is not None] == [5.0, 5.0]


def test_there_are_none_where_friction_is_not_known_or_several_drives_turn() -> None:
    irp6, never = built_in("irp6"), replace(SHORT, breakaways=0)
    for robot, schedule, options, why in (
        (built_in("ur10e"), SHORT, {"drives": ("1",)}, "states no friction; give `torque_ramp`"),
        (irp6, SHORT, {"joints": ("q3",), "torque_ramp": (10.0,)}, "z3, z4 move together"),
        (irp6, never, {"drives": ("1",)}, ""),
    ):
        (c,) = planned(robot, schedule, **options).coordinates
        assert c.ramps is None
        assert why in c.no_ramps
    (alone,) = planned(irp6, SHORT, joints=("q1",)).coordinates
    assert alone.ramps.drive == "z1"


def test_files_hold_the_ramps(tmp_path: Path) -> None:
    plan().save(tmp_path)
    robot, content = plan().robot, json.loads((tmp_path / "plan.json").read_text())
    for c, written in zip(plan().coordinates, content["trajectories"], strict=True):
        told = written["torque_ramps"]
        assert (told["file"], told["drive"], told["unit"]) == (f"{c.label}.stiction.csv", c.label, "Nm")
        assert (told["largest"], told["gravity"]) == (c.ramps.largest, c.ramps.gravity)
        assert told["gravity"] == pytest.approx(gravity_along(robot, [c.place.pose], c.line)[0], abs=1e-9)
        for ramp, each in zip(c.ramps.ramps, told["ramps"], strict=True):
            assert all(each[key] == getattr(ramp, key) for key in ("start", "end", "rate", "direction"))
        table = np.loadtxt(tmp_path / told["file"], dtype=str, delimiter=",", comments=None)
        header, rows = table[0].tolist(), table[1:]
        assert header[-2:] == [f"{c.label}.effort", "segment"]
        samples, torque, segments = c.ramps.samples(c.place.pose)
        np.testing.assert_array_equal(rows[:, 0].astype(float), samples.time)
        np.testing.assert_array_equal(rows[:, -2].astype(float), torque)
        assert rows[:, -1].tolist() == segments
        np.testing.assert_array_equal(rows[:, 1:-2:3].astype(float), samples.q)
        motion = read_motion(tmp_path / told["file"], robot.joint_names)
        assert motion.duration == pytest.approx(told["duration"]) == pytest.approx(c.ramps.duration)


def test_torques_that_cannot_be() -> None:
    for given, message in (
        ((-1.0,), "`torque_ramp` must be a number from 0 to 1e.09 Nm or N, given -1"),
        ((1.0, 2.0, 3.0), "expected one torque, or one for each of z1, z3; given 3"),
        ((1000.0,), "z1: a torque ramp to 1000 Nm exceeds the limit of 331.8 Nm; give a lower `torque_ramp`"),
    ):
        with pytest.raises(InputError, match=message):
            planned(built_in("irp6"), SHORT, drives=("1", "3"), torque_ramp=given)


def test_the_command_writes_and_clears_them(here: Here) -> None:
    short = ("--drives", "1", "--speeds", "50", "--warm-up", "0", "--breakaways", "1", "--rate", "100", "--out", "p")
    made = here.run("friction", "plan", "irp6", *short, "--ramping", "2", "--torque-ramp", "12", status=0)
    told = " ".join(made.stdout.split())
    assert "over 2 s in NAME.stiction.csv: z1 to 12 Nm (given); the controller adds gravity in the pose" in told
    assert "z1.stiction.csv" in files_below(here.cwd / "p")
    again = here.run("friction", "plan", "irp6", *short, "--torque-ramp", "0", "--force", status=0)
    assert files_below(here.cwd / "p") == {"plan.json", "manifest.json", "runs.png", "z1.csv"}
    assert "no ramps of torque for z1: none were requested" in " ".join(again.stdout.split())
