"""Plans of friction measurements: constant speed, limits, poses in which gravity cancels, order, files, bad input."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from commands import Here, files_below
from pinocchio_chains import drive_torques, gravity_along, joint_torques
from written_files import saved

from constraints.linear import LinearConstraint
from excite.cli.summary import print_verdict, print_view
from excite.design.friction_runs.friction_plan import CoordinatePlan, FrictionPlan, load_friction_plan
from excite.design.friction_runs.plan_friction import plan_friction
from excite.design.friction_runs.runs import Pace, pace_of
from excite.design.friction_runs.schedule import Schedule
from excite.simulation.simulation_files import read_motion
from excite.tasks.limit_choice import LimitChoice
from excite.views.friction_views import friction_plan_view
from regressors.errors import InputError
from regressors.models.partial import PartialMotion
from regressors.readers.library import built_in
from regressors.readers.urdf import parse_urdf
from regressors.robot.robot import Joint, Limits, Link, Robot
from regressors.samples import Array

SHORT = Schedule(percent=(5.0, 50.0, 100.0), longest=3.0, warm_up=5.0, breakaways=1, creeping=1.0, rate=200.0)
QUICK = "--speeds 5,100 --shortest 0.3 --longest 2 --warm-up 1 --breakaways 1 --creeping 1 --rate 50"
PAPER = [5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100]
GRAVITY = {
    "irp6": ["none", "cancels", "subtracted"], "panda": 3 * ["cancels"], "ur10e": ["none", "cancels", "cancels"],
}  # fmt: skip
HALVES = {"irp6": ("z1", "z2", "z3"), "panda": ("2", "4", "6"), "ur10e": ("1", "2", "5")}
planned = partial(plan_friction, limits=LimitChoice(self_collision=False))  # with distances: test_plan_world.py


def test_a_coordinate_is_as_fast_as_the_nearer_of_both_bounds_of_what_it_moves() -> None:
    motion = PartialMotion(("z",), ("rad",), np.array([[1.0], [-2.0]]), np.zeros(2))
    bounds = {1: ([-1.0, -3.0], [2.0, 5.0]), 2: ([-9.0, -9.0], [9.0, 8.0]), 3: ([-50.0, -90.0], [60.0, 90.0])}
    limits = [
        LinearConstraint(derivative, np.eye(2), np.zeros(2), *map(np.array, each), ("a", "b"), ("", ""))
        for derivative, each in bounds.items()
    ]
    assert pace_of(motion, limits) == Pace(1.0, 4.0, 45.0, ())


@cache
def plan_of(name: str) -> FrictionPlan:
    return planned(built_in(name), SHORT, drives=HALVES[name])


def by(plan: FrictionPlan, label: str) -> CoordinatePlan:
    return next(c for c in plan.coordinates if c.label == label)


@pytest.mark.slow
@pytest.mark.parametrize("name", HALVES)
def test_speed_is_constant_in_windows_and_symmetric_about_the_pose(name: str) -> None:
    for c in plan_of(name).coordinates:
        samples, segments = c.samples()
        onto = np.linalg.pinv(c.line[:, None])[0]
        moved = (samples.q - c.place.pose) @ onto
        for window in c.windows:
            inside = (samples.time >= window.start) & (samples.time <= window.end)
            assert np.count_nonzero(inside) > 50
            assert {segments[k] for k in np.flatnonzero(inside)} == {window.segment}
            np.testing.assert_allclose(samples.dq[inside] @ onto, window.speed, rtol=1e-12)
            assert abs(window.speed) == pytest.approx(c.pace.velocity * window.percent / 100, rel=1e-9)
            np.testing.assert_allclose(samples.ddq[inside], 0.0, atol=1e-9)
            increments = np.diff(moved[inside]) / np.diff(samples.time[inside])
            np.testing.assert_allclose(increments, window.speed, rtol=1e-9)
            assert SHORT.shortest * (1 - 1e-9) <= window.end - window.start <= SHORT.longest * (1 + 1e-6)
            assert window.first + window.last == pytest.approx(2 * c.centre, abs=1e-9)
            middle = np.interp(0.5 * (window.start + window.end), samples.time, moved)
            assert middle == pytest.approx(0.0, abs=1e-9)
        for there, back in zip(c.windows[::2], c.windows[1::2], strict=True):
            assert (there.percent, there.speed) == (back.percent, pytest.approx(-back.speed))
            assert there.end - there.start == pytest.approx(back.end - back.start)
            assert (there.first, there.last) == (pytest.approx(back.last), pytest.approx(back.first))


@pytest.mark.slow
@pytest.mark.parametrize("name", HALVES)
def test_limits_hold_at_every_sample_and_certificates_bound_them(name: str) -> None:
    plan = plan_of(name)
    robot, t = plan.robot, plan.robot.transmission
    sets = [("joint", robot.joint_names, np.eye(robot.n), np.zeros(robot.n), robot.limits)]
    if t is not None:
        sets.append(("drive", [d.name for d in t.drives], t.coupling, t.offset, t.limits))
    for c in plan.coordinates:
        samples, _ = c.samples()
        certified = {use.label: use for use in c.limits}
        assert certified
        assert all(use.holds for use in c.limits)
        seen = 0
        for kind, names, matrix, offset, limits in sets:
            for order, quantity in enumerate(("position", "velocity", "acceleration", "jerk")):
                motion = (samples.q, samples.dq, samples.ddq, samples.dddq)[order]
                values = motion @ matrix.T + (offset if order == 0 else 0.0)
                upper = limits.upper if order == 0 else getattr(limits, quantity)
                lower = limits.lower if order == 0 else -upper
                assert np.all(values <= upper + 1e-9 * np.abs(upper))
                assert np.all(values >= lower - 1e-9 * np.abs(lower))
                for k, label in enumerate(names):
                    use = certified.get(f"{kind} {label} {quantity}")
                    assert (use is None) == bool(np.isinf(upper[k]))
                    if use is not None:
                        seen += 1
                        assert use.margin <= min(upper[k] - values[:, k].max(), values[:, k].min() - lower[k]) + 1e-9
        assert seen == sum(not use.label.endswith("torque") for use in c.limits)


@pytest.mark.parametrize("name", ["irp6", "panda"])
@pytest.mark.slow
def test_torques_as_pinocchio_sees_them_are_within_what_is_certified(name: str) -> None:
    plan = plan_of(name)
    t, limits, kind = plan.robot.transmission, plan.robot.limits, "joint"
    names = plan.robot.joint_names
    if t is not None:
        names, limits, kind = [d.name for d in t.drives], t.limits, "drive"
    for c in plan.coordinates:
        samples, _ = c.samples()
        tau = joint_torques(plan.robot, samples) if t is None else drive_torques(plan.robot, samples)
        if t is not None:
            tau += [d.coulomb for d in t.drives] * np.sign(samples.dq @ t.coupling.T)
        left = {use.label: use.margin for use in c.limits if use.method == "enclosed"}
        assert set(left) == {f"{kind} {name} torque" for name in names}
        assert c.torques_unchecked == ""
        for k, (label, most) in enumerate(zip(names, limits.torque, strict=True)):
            room = most - np.abs(tau[:, k]).max()
            assert left[f"{kind} {label} torque"] <= room + 1e-9 * most
            if label == c.label:
                assert left[f"{kind} {label} torque"] >= room - 0.05 * most


def test_torques_that_are_not_there_are_said_to_be_broken() -> None:
    robot = built_in("irp6")
    limits = robot.transmission.limits
    weak = robot.replace(transmission=replace(robot.transmission, limits=replace(limits, torque=limits.torque * 0.35)))
    plan = planned(weak, SHORT, drives=("2",))
    assert [use.label for use in plan.coordinates[0].broken] == ["drive z2 torque"]
    cure = "where the weight alone exceeds it, give another `pose`"
    assert any(cure in remark for remark in friction_plan_view(plan).remarks)
    (unknown,) = planned(built_in("iiwa7"), SHORT, joints=("1",)).coordinates
    assert "need the inertias of all links" in unknown.torques_unchecked


@pytest.mark.parametrize("name", HALVES)
def test_gravity_as_pinocchio_sees_it(name: str) -> None:
    """Of the poses in which gravity does not turn a UR10e's shoulder, the one with the arm above it is taken."""
    robot, coordinates = plan_of(name).robot, plan_of(name).coordinates
    assert [c.place.gravity for c in coordinates] == GRAVITY[name]
    for c in coordinates:

        def along(s: Array, c: CoordinatePlan = c) -> Array:
            return gravity_along(robot, c.place.pose + s[:, None] * c.line, c.line)

        s = np.linspace(0.0, c.place.half, 40)
        ahead, behind = along(s), along(-s)
        if c.place.gravity == "none":
            np.testing.assert_allclose([ahead, behind], 0.0, atol=1e-9)
        elif c.place.gravity == "cancels":
            assert np.abs(ahead).max() > 0.01
            np.testing.assert_allclose(ahead, -behind, atol=1e-6 * np.abs(ahead).max())
        else:
            assert np.abs(ahead + behind).max() > 1e-3 * np.abs(ahead).max()
        for window in c.windows[:2]:
            points = np.linspace(window.first, window.last, 4001) - c.centre
            mean = np.trapezoid(along(points)) / 4000
            assert window.gravity == pytest.approx(mean, abs=1e-4 * max(1.0, c.largest_gravity))
        if c.label == "shoulder_lift_joint":
            assert c.place.pose[1] == pytest.approx(-np.pi / 2, abs=0.1)
            before, after = along(np.array([-0.1, 0.1]))
            assert before > 0.0 > after
    if name == "irp6":
        np.testing.assert_allclose(coordinates[1].place.pose, 0.0, atol=1e-9)  # the arm stands upright


def lift(gravity: Array) -> Robot:
    """One sliding joint of 3 kg along z, half a metre long."""
    limits = Limits(*([value] for value in (0.0, 0.5, 0.4, 2.0, 40.0, 100.0)))
    joint = Joint("lift", "prismatic", np.eye(3), np.zeros(3))
    return Robot("lift", (joint,), (Link("carriage", np.r_[3.0, np.zeros(9)]),), limits, gravity=gravity)


def test_a_sliding_joint_has_its_weight_everywhere() -> None:
    (up,) = planned(lift(np.array([0.0, 0.0, -9.81])), SHORT, limits=LimitChoice(floor="none")).coordinates
    assert (up.place.gravity, up.unit, up.centre) == ("subtracted", "m", pytest.approx(0.25))
    assert [window.gravity for window in up.windows] == pytest.approx([3 * 9.81] * len(up.windows))
    (level,) = planned(lift(np.array([9.81, 0.0, 0.0])), SHORT).coordinates
    assert level.place.gravity == "none"
    assert not level.broken


def test_windows_may_be_as_long_as_the_range_allows(tmp_path: Path) -> None:
    schedule = replace(SHORT, percent=(20.0, 100.0), longest=float("inf"))
    plan = planned(built_in("irp6"), schedule, drives=("2",))
    (c,) = plan.coordinates
    for window in c.windows:  # the range of 2 x 0.69813 less its reserve, less both ramps
        ramps = 2 * c.pace.ramp(abs(window.speed))
        assert abs(window.last - window.first) == pytest.approx(2 * 0.98 * 0.69813 - ramps, abs=1e-9)
    assert load_friction_plan(saved(tmp_path, plan)).schedule.longest == float("inf")


def test_long_plans_say_what_shorter_windows_would_make_of_them(capfd: pytest.CaptureFixture[str]) -> None:
    robot, schedule = built_in("irp6"), Schedule(rate=50.0, longest=float("inf"))
    plan = planned(robot, schedule, drives=("1", "2"))
    assert plan.duration == pytest.approx(sum(c.samples()[0].time[-1] for c in plan.coordinates))
    shorter = planned(robot, replace(schedule, longest=1.5), drives=("1", "2"), pose=np.zeros(5)).duration
    assert plan.lasting(1.5) == pytest.approx(shorter)
    assert plan.duration > 2 * shorter
    print_verdict(friction_plan_view(plan))
    print_view(friction_plan_view(plan))
    told = " ".join(capfd.readouterr().out.split())
    assert f"friction of z1, z2 in 44 windows of constant speed; it lasts {plan.duration / 60:.1f} min" in told
    assert f"windows are as long as the range allows; --longest 1.5 shortens the plan to {shorter / 60:.1f} min" in told


def test_the_other_drives_hold_their_coordinates_and_a_joint_may_turn_several() -> None:
    robot, c = built_in("irp6"), by(plan_of("irp6"), "z2")
    z = c.samples()[0].q @ robot.transmission.coupling.T
    assert np.ptp(z[:, 1]) > 1.0
    np.testing.assert_allclose(np.delete(z, 1, axis=1), 0.0, atol=1e-12)
    assert c.turns == ("z2",)
    (alone,) = planned(robot, replace(SHORT, stroke=0.5), joints=("q3",)).coordinates
    assert alone.turns == ("z3", "z4")
    q = alone.samples()[0].q
    assert np.ptp(np.delete(q, 2, axis=1), axis=0).max() == 0.0
    assert np.abs(q[:, 2] - alone.place.pose[2]).max() == pytest.approx(alone.stroke) == 0.5  # as bounded


@pytest.mark.slow
def test_speeds_and_windows_are_those_of_the_paper_and_take_a_quarter_of_an_hour() -> None:
    plan = planned(built_in("irp6"), Schedule(rate=50.0))
    assert len(plan.coordinates) == 5
    assert plan.duration < 15 * 60
    assert all(sorted(c.order) == PAPER for c in plan.coordinates)
    for c, shortest in zip(plan.coordinates, (0.5, 0.3, 0.2, 0.2, 0.2), strict=True):
        assert min(w.end - w.start for w in c.windows) >= shortest
        assert max(w.end - w.start for w in c.windows) <= 2.0
    (shorter,) = planned(built_in("irp6"), Schedule(shortest=0.3, rate=100.0), drives=("3",)).coordinates
    assert sorted(shorter.order) == PAPER[:-1]
    (left_out,) = shorter.left_out
    assert left_out.percent == 100.0
    assert "the shortest window of 0.3 s" in left_out.reason


def test_order_of_the_runs() -> None:
    (c,) = planned(built_in("irp6"), Schedule(rate=100.0), drives=("1",)).coordinates
    assert c.order == [100, 5, 90, 10, 80, 20, 70, 30, 60, 40, 50]
    segments = c.samples()[1]
    turns = [segments[0], *(b for a, b in itertools.pairwise(segments) if a != b)]
    named = [segment for segment in turns if segment not in ("rest", "transfer")]
    assert named[:3] == ["warm-up", "z1 stiction +", "z1 stiction -"]
    assert named[7:11] == ["z1 +100 %", "z1 -100 %", "z1 +5 %", "z1 -5 %"]
    assert len(named) == 1 + 6 + 22
    assert turns[-1] == "rest"
    assert c.windows[0].start > 30.0


def test_breaking_away_starts_from_rest_in_both_directions() -> None:
    c = by(plan_of("irp6"), "z1")
    samples, segments = c.samples()
    assert [part.segment for part in c.breakaways] == ["z1 stiction +", "z1 stiction -"]
    for part, sign in zip(c.breakaways, (1, -1), strict=True):
        rest = (samples.time > part.begin - 0.9) & (samples.time < part.begin)
        assert np.abs(samples.dq[rest]).max() == 0.0
        here = np.array([segment == part.segment for segment in segments])
        speed = samples.dq[here, 0] * sign
        assert speed.min() >= 0.0
        assert speed.max() == pytest.approx(0.001 * 1.266, rel=1e-9)
    assert samples.q[-1] == pytest.approx(c.place.pose)


def test_velocities_are_those_of_the_positions() -> None:
    samples, _ = by(plan_of("irp6"), "z2").samples()
    slope = np.gradient(samples.q, samples.time, axis=0)
    np.testing.assert_allclose(samples.dq, slope, atol=1.89 / 200)
    steps = np.diff(samples.q, axis=0) - np.diff(samples.time)[:, None] * (samples.dq[1:] + samples.dq[:-1]) / 2
    np.testing.assert_allclose(steps, 0.0, atol=2 * 18.9 / 200**3)


def test_unbounded_joints_and_those_of_unknown_inertia() -> None:
    robot = built_in("iiwa7")
    plan = planned(robot, SHORT, joints=("1",))  # about a vertical axis nothing weighs, whatever the inertias
    assert plan.coordinates[0].place.gravity == "none"
    with pytest.raises(InputError, match=r"A2: gravity acts on it and the inertias .* `pose` together with `balanced`"):
        planned(robot, SHORT, joints=("2",))
    with pytest.raises(InputError, match="inertias of links are not known"):
        planned(robot, SHORT, joints=("2",), pose=np.zeros(7))
    (stated,) = planned(robot, SHORT, joints=("2",), pose=np.zeros(7), balanced=True).coordinates
    assert stated.place.gravity == "stated"
    assert np.isnan(stated.largest_gravity)
    assert all(np.isnan(window.gravity) for window in stated.windows)


def test_a_given_pose_is_the_middle_of_every_run() -> None:
    robot, pose = built_in("irp6"), np.array([0.1, 0.0, 0.2, 0.3, 0.0])
    one, two, _ = planned(robot, SHORT, drives=("1", "2", "5"), pose=pose).coordinates
    np.testing.assert_array_equal(one.place.pose, pose)
    assert two.place.gravity == "cancels"
    leaning = np.array([0.1, 0.2, 0.2, 0.3, 0.0])
    (tilted,) = planned(robot, replace(SHORT, percent=(5.0, 50.0)), drives=("2",), pose=leaning).coordinates
    assert tilted.place.gravity == "subtracted"
    assert tilted.windows[0].gravity != pytest.approx(0.0, abs=1.0)


def test_files_hold_what_was_planned(tmp_path: Path) -> None:
    plan = plan_of("irp6")
    files = plan.save(tmp_path)
    motions, ramps = ["z1.csv", "z2.csv", "z3.csv"], ["z1.stiction.csv", "z2.stiction.csv", "z3.stiction.csv"]
    assert [path.name for path in files] == ["plan.json", *motions, *ramps]
    robot, content = load_friction_plan(tmp_path).robot, json.loads((tmp_path / "plan.json").read_text())
    assert robot.sha256() == plan.robot.sha256() == content["robot"]["sha256"]
    assert content["schema"] == "excite.friction-plan/2"
    for c, written in zip(plan.coordinates, content["trajectories"], strict=True):
        assert written["coordinate"] == c.label
        assert list(written["pose"].values()) == c.place.pose.tolist()
        samples, segments = c.samples()
        table = np.loadtxt(tmp_path / written["file"], dtype=str, delimiter=",", comments=None)
        assert (table[0, -1], table[1:, -1].tolist()) == ("segment", segments)
        np.testing.assert_array_equal(table[1:, 0].astype(float), samples.time)
        np.testing.assert_array_equal(table[1:, 1:-1:3].astype(float), samples.q)
        for window in written["windows"]:
            inside = (samples.time >= window["start"]) & (samples.time <= window["end"])
            assert set(table[1:, -1][inside]) == {window["segment"]}
            assert np.sign(window["speed"]) == window["direction"]
        motion = read_motion(tmp_path / written["file"], robot.joint_names)
        assert motion.duration == pytest.approx(written["duration"])
    assert content["trajectories"][0]["windows"][0]["gravity"] == 0.0


WITHOUT_VELOCITY = built_in("ur10e").replace(limits=replace(built_in("ur10e").limits, velocity=np.full(6, np.inf)))


def test_what_cannot_be_planned() -> None:
    for changes, message in (
        ({"drives": ("z9",)}, r"no drive named 'z9'; available: 1 \(z1\)"),
        ({"joints": ("1",), "drives": ("1",)}, "give joints or drives, not both"),
        ({"drives": ("1", "z1")}, "duplicate coordinates: z1, z1"),
        ({"pose": np.zeros(3)}, "pose needs 5 numbers, one per joint q1, q2, q3, q4, q5; given 3"),
        ({"pose": np.array([0, 2.0, 0, 0, 0])}, "pose: joint q2 position is 2 rad"),
        ({"balanced": True}, "give `pose` too"),
        ({"drives": ("3",), "percent": (100.0,), "shortest": 0.3}, r"z3: no speed leaves a window: .* `shortest`"),
        ({"drives": ("2",), "pose": np.array([0, 0.698, -0.698, 0, 0])}, "z2: no speed leaves .* a stroke of 0 rad"),
        ({"robot": WITHOUT_VELOCITY}, r"shoulder_pan_joint: no velocity limit bounds it.*`velocity`"),
        ({"percent": (50.0, 50.0)}, "duplicate speeds in `percent`"),
        ({"percent": ()}, "given none"),
        ({"rate": 20.0}, "20 samples per second leave 4 in a window of 0.2 s, .* must be 50 or more"),
        ({"shortest": 3.0, "longest": 2.0}, "longest window 2 s is below the shortest one, 3 s"),
        ({"repeats": 0}, "`repeats` must be 1 or more"),
    ):
        own = {key: value for key, value in changes.items() if hasattr(SHORT, key)}
        others = {key: value for key, value in changes.items() if key not in own}
        with pytest.raises(InputError, match=message):
            planned(others.pop("robot", built_in("irp6")), replace(SHORT, **own), **others)


def test_the_command(here: Here) -> None:
    folder = here.cwd / "runs"
    ended = here.run("friction", "plan", "irp6", "--out", "runs", "--drives", "2,3", "-v", *QUICK.split(), status=0)
    common = {"plan.json", "manifest.json", "runs.png", "z2.csv", "z2.stiction.csv"}
    assert files_below(folder) == {*common, "z3.csv", "z3.stiction.csv"}
    told = " ".join(ended.stdout.split())
    assert "z3: 100 % left out: in a stroke of" in told
    assert "assumed: jerk 18.9" in told
    assert "z3: gravity: no pose in which it cancels has room for the runs" in told
    assert "then 100, 5 % there and back" in told
    again = here.run("friction", "plan", "irp6", "--out", "runs", "--drives", "2", *QUICK.split())
    assert (again.returncode, "already holds a friction plan" in again.stderr) == (2, True)
    given = ("--pose", "0,0,0,0,0", "--drives", "2", "--force", *QUICK.split())
    assert here.run("friction", "plan", "irp6", "--out", "runs", *given).returncode == 0
    assert files_below(folder) == common
    refused = here.refused("friction", "plan", "irp6", "--out", "other", "--speeds", "fast")
    assert "expected numbers separated by commas" in refused
    assert "no drive named '9'" in here.refused("friction", "plan", "irp6", "--out", "other", "--drives", "9")
    assert not (here.cwd / "other").exists()


def test_joints_without_a_range_are_not_moved() -> None:
    """One that is not measured may lack it; limits that are given end what is missing."""
    joint = '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><limit {} velocity="1"/></joint>'
    links = "".join(f'<link name="{name}"/>' for name in "abc")
    joints = joint.format("j", "a", "b", 'lower="-1" upper="1"') + joint.format("k", "b", "c", "")
    robot = parse_urdf(f'<robot name="r">{links}{joints}</robot>')
    limits = replace(robot.limits, acceleration=np.ones(2))
    robot = robot.replace(limits=limits, gravity=np.zeros(3))
    with pytest.raises(InputError, match="joint 'k': no position limits are stated; write <limit "):
        planned(robot, SHORT)
    assert len(planned(robot, SHORT, joints=("j",), pose=np.zeros(2)).coordinates) == 1
    limits = replace(limits, lower=-np.ones(2), upper=np.ones(2))
    assert len(planned(robot.replace(limits=limits), SHORT, pose=np.zeros(2)).coordinates) == 2
