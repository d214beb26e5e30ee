"""Ways from home to the motion and back: the quickest within the limits, continuous, on the samples of one file."""

from __future__ import annotations

import csv
import dataclasses
import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from commands import Here, content_of, table_of
from hypothesis import example, given, settings, strategies as st
from pinocchio_chains import tool_motion
from recordings import log_of
from ruckig import InputParameter, Ruckig, Synchronization, Trajectory
from written_files import saved

import regressors
from constraints.linear import linear_limits
from excite.design.approach import ApproachAndReturn, approach_and_return
from excite.design.design import Design
from excite.design.design_folder import save_design
from excite.design.design_json import load_design
from excite.design.optimisation import design_trajectory
from excite.design.stated_limits import nonlinear_limits
from excite.identification.preparation import prepare
from excite.identification.recipe import Recipe
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation_files import read_motion
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from excite.trajectories.transfer import Transfer, quickest_transfer, time_optimal
from regressors.errors import InputError
from regressors.readers.description import parse_description
from regressors.readers.library import load_robot
from regressors.robot.archive import robot_from_description
from regressors.robot.robot import Limits, Robot
from regressors.samples import Array, Samples

HOME = (0.6, 0.3, -0.25, 0.4, 0.0)  # joint 4 moves on the ways only
VIA = (0.2, 0.1, -0.3, 0.1, 0.0)
RATE = 100.0
TASK = Task(
    "irp6", starts=1, harmonics=3, rate=RATE, executor="serial", home=HOME, via=(VIA,), settle=0.8, speed=(0.1, 0.3)
)
IRP6 = load_robot("irp6")
MOVING = ("q1", "q2", "q3")


@pytest.fixture(scope="module")
def design() -> Design:
    return design_trajectory(TASK.changed(robot=IRP6))


@pytest.fixture(scope="module")
def folder(design: Design, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("ways"), design)


def rows_of(path: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """Columns of numbers, and the segments."""
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    names = [name for name in rows[0] if name != "segment"]
    return {name: np.array([float(row[name]) for row in rows]) for name in names}, [row["segment"] for row in rows]


def motion_in(columns: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    whats = ("position", "velocity", "acceleration")
    return tuple(np.column_stack([columns[f"{joint}.{what}"] for joint in IRP6.joint_names]) for what in whats)


# --- the law from 0 to 1


def shortest(V: float, A: float, J: float) -> float:
    """Duration of the quickest way over the distance 1 from rest to rest, case by case [s]."""
    ramp = A / J + V / A if V * J >= A**2 else 2 * math.sqrt(V / J)  # from rest to V
    if V * ramp <= 1:
        return ramp + 1 / V
    v = A / 2 * (math.sqrt((A / J) ** 2 + 4 / A) - A / J)  # the speed reached where A binds and V does not
    return 2 * (v / A + A / J) if v >= A**2 / J else (32 / J) ** (1 / 3)


bounds = st.floats(min_value=-3, max_value=3).map(lambda exponent: 10.0**exponent)


@settings(max_examples=60)
@given(bounds | st.just(math.inf), bounds | st.just(math.inf), bounds)
@example(math.inf, math.inf, 4.0)  # jerk alone decides: 32 / 4 = 2^3
def test_law_is_the_quickest_within_its_bounds(V: float, A: float, J: float) -> None:
    law = time_optimal(V, A, J)
    assert law.duration == pytest.approx(shortest(V, A, J), rel=1e-9)
    time = np.linspace(0.0, law.duration, 2001)
    s, ds, dds, ddds = law.values(time)
    for values, bound in ((ds, V), (dds, A), (ddds, J)):
        assert np.abs(values).max() <= bound * (1 + 1e-9)
    assert np.all(np.diff(s) >= -1e-12)
    assert list(law.values(time[[0, -1]])[0]) == [0.0, 1.0]
    assert not np.any(law.values(time[[0, -1]])[1:])
    h = time[1]
    tiny = 1e-9 * J * h  # of rounding
    assert np.abs(np.diff(dds)).max() <= J * h * (1 + 1e-6)
    assert np.abs(np.diff(ds) - h * (dds[1:] + dds[:-1]) / 2).max() <= J * h**2 / 4 + tiny * h
    assert np.abs(np.diff(s) - h * (ds[1:] + ds[:-1]) / 2).max() <= J * h**3 / 12 * (1 + 1e-6) + 1e-13


# --- transfers


def box(velocity: np.ndarray, acceleration: np.ndarray, jerk: np.ndarray) -> Robot:
    """The IRp-6 with limits on its joints only."""
    limits = Limits(np.full(5, -9.0), np.full(5, 9.0), velocity, acceleration, jerk, np.full(5, np.inf))
    return dataclasses.replace(IRP6, limits=limits, transmission=None)


def transfer_of(robot: Robot, *poses: np.ndarray) -> Transfer:
    found = quickest_transfer(poses, linear_limits(robot), robot.joint_names)
    assert found is not None
    return found


def ruckig_duration(start: np.ndarray, end: np.ndarray, limits: Limits) -> float:
    """Of all joints at once, each within its own limits, ending together [s]."""
    asked, found = InputParameter(5), Trajectory(5)
    asked.current_position, asked.target_position = start.tolist(), end.tolist()
    asked.max_velocity, asked.max_acceleration = limits.velocity.tolist(), limits.acceleration.tolist()
    asked.max_jerk = limits.jerk.tolist()
    asked.synchronization = Synchronization.Time
    Ruckig(5).calculate(asked, found)
    return float(found.duration)


@pytest.mark.parametrize("seed", range(10))
def test_as_quick_as_ruckig_with_all_joints_at_once_where_limits_are_alike(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, end = rng.uniform(-2, 2, (2, 5))
    line = np.abs(end - start)
    alike = box(*(rng.uniform(0.3, 3.0) * line for _ in range(3)))
    assert transfer_of(alike, start, end).duration == pytest.approx(ruckig_duration(start, end, alike.limits), rel=1e-7)
    unlike = box(*rng.uniform(0.5, 5.0, (3, 5)))
    straight, free = transfer_of(unlike, start, end).duration, ruckig_duration(start, end, unlike.limits)
    assert free * (1 - 1e-7) <= straight <= 2.5 * free  # a straight line costs something, not much


@pytest.mark.parametrize("seed", range(6))
def test_limits_of_joints_and_drives_hold_and_one_binds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = LimitChoice(jerk=(15.0,)).applied(IRP6)
    found = transfer_of(robot, *rng.uniform(-0.3, 0.3, (3, 5)))
    samples = found.samples(np.linspace(0.0, found.duration, 5001))
    used = np.zeros(2)
    for limit in linear_limits(robot):
        values, exact = limit.values(samples), found.extrema(limit)
        slack = 1e-3 * np.ptp(values, axis=0) + 1e-12
        for highest, sampled, bound in (
            (exact.high, values.max(axis=0), limit.upper),
            (-exact.low, -values.min(axis=0), -limit.lower),
        ):
            assert np.all(highest >= sampled - 1e-12)
            assert np.all(highest <= sampled + slack)
            assert np.all(highest <= bound + 1e-9 * np.abs(bound))
        for leg, begins in enumerate((0.0, found.ends[0]) if limit.derivative > 0 else ()):
            here = (samples.time >= begins) & (samples.time <= begins + found.legs[leg].law.duration)
            used[leg] = max(used[leg], np.max(np.abs(values[here]) / limit.upper))
    assert np.all(used > 0.999)  # on every leg some limit is reached


def test_poses_are_passed_exactly_and_at_rest() -> None:
    poses = [np.array(HOME), np.array(VIA), np.zeros(5)]
    found = transfer_of(IRP6, *poses)
    at = found.samples(np.array([0.0, found.ends[0], found.duration, found.duration + 1.0]))
    assert np.array_equal(at.q, [poses[0], poses[1], poses[2], poses[2]])
    assert not np.any([at.dq, at.ddq])
    assert not np.any(np.signbit(at.dq))
    first = found.samples(np.linspace(0.0, found.ends[0], 50)).q - poses[0]
    line = poses[1] - poses[0]
    assert np.allclose(first - np.outer(first @ line, line) / (line @ line), 0.0, atol=1e-13)  # a straight line
    # a pose twice needs no leg
    assert len(transfer_of(IRP6, poses[0], poses[0], poses[2]).legs) == 1
    assert quickest_transfer([poses[2], poses[2]], linear_limits(IRP6), IRP6.joint_names) is None


@given(st.tuples(*[st.floats(-2.0, 2.0)] * 3), st.floats(-3.0, -0.5), st.booleans())
@settings(max_examples=200, deadline=None)
def test_phases_of_whole_periods_keep_the_bounds(
    exponents: tuple[float, float, float], step: float, free: bool
) -> None:
    V, A, J = (10.0**x for x in exponents)
    period, law = 10.0**step, time_optimal(np.inf if free else V, A, J)
    found = law.on_grid(period)
    assert np.abs(found.breaks / period - np.round(found.breaks / period)).max() < 1e-9
    assert 0.0 <= found.duration - law.duration < 4 * period + 1e-4 * law.duration
    s = found.values(np.unique(np.concatenate([found.breaks, np.linspace(0.0, found.duration, 501)])))
    assert np.all(np.diff(s[0]) > -1e-12)
    assert found.values(np.array([found.duration * (1 - 1e-9)]))[0, 0] == pytest.approx(1.0, abs=1e-6)
    for order, bound in ((1, np.inf if free else V), (2, A), (3, J)):
        assert np.abs(s[order]).max() <= bound * (1.0 - 0.9e-5)


def test_unknown_limits_are_assumed_and_told() -> None:
    none = np.full(5, np.inf)
    robot = box(np.array([1.0, 2.0, 2.0, 2.0, 2.0]), none, none)
    found = transfer_of(robot, np.zeros(5), np.array([1.0, 0.0, 0.5, 0.0, 0.0]))
    assert found.assumed == {"acceleration": ("q1", "q3"), "jerk": ("q1", "q3")}
    fastest = np.abs(found.samples(np.linspace(0.0, found.duration, 4001)).ddq[:, 0]).max()
    assert fastest == pytest.approx(1.0 / 0.5, rel=1e-3)
    assert found.jerk[0] == pytest.approx(2.0 / 0.1, rel=1e-9)
    assert found.duration == pytest.approx(shortest(1.0, 2.0, 20.0), rel=1e-9)
    with pytest.raises(InputError, match="no velocity or acceleration limit bounds joint q2, which moves on the app"):
        transfer_of(box(np.array([1.0, np.inf, 1.0, 1.0, 1.0]), none, none), np.zeros(5), np.full(5, 0.1))


# --- the whole motion


def test_segments_follow_one_another_from_home_and_back_and_begin_on_samples(design: Design, folder: Path) -> None:
    (columns, segments), content = rows_of(folder / "trajectory.csv"), content_of(folder)["played"]
    assert [name for name, _ in itertools.groupby(segments)] == ["approach", "excite", "return"]
    time, here = columns["time"], [k for k, segment in enumerate(segments) if segment == "excite"]
    assert np.allclose(time, np.arange(time.size) / RATE, rtol=1e-14, atol=0.0)
    spans = {part["name"]: part for part in content["segments"]}
    assert (spans["approach"]["start"], spans["return"]["end"]) == pytest.approx((0.0, time[-1]), abs=1e-9)
    assert [spans["excite"][end] for end in ("start", "end")] == pytest.approx(time[[here[0], here[-1]]], abs=1e-9)
    assert spans["excite"]["end"] - spans["excite"]["start"] == pytest.approx(TASK.trajectory.period)
    assert content["duration"] == pytest.approx(time[-1])
    # the exciting rows are those of the motion alone, and between them and the ways it rests
    q, dq, ddq = motion_in(columns)
    for whole, alone in ((q, design.samples.q), (dq, design.samples.dq), (ddq, design.samples.ddq)):
        assert np.array_equal(whole[here][:, :3], alone)
        assert not np.any(whole[here][:, 3:])
    assert not np.any([dq[here[0] - 80 : here[0] + 1], dq[here[-1] : here[-1] + 81]])
    assert np.all(np.any(dq[[here[0] - 82, here[-1] + 82]], axis=1))
    for name in ("trajectory.csv", "trajectory-0.1.csv", "trajectory-0.3.csv"):
        q, *rates = motion_in(rows_of(folder / name)[0])
        assert np.array_equal(q[[0, -1]], [HOME, HOME])
        assert not np.any([rate[[0, -1]] for rate in rates])


def test_a_design_from_home_is_not_played_without_its_approach(folder: Path, tmp_path: Path) -> None:
    content = content_of(folder)
    del content["played"]
    (tmp_path / "design.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match="not a complete design: 'played' is missing"):
        load_design(tmp_path)


def test_position_velocity_and_acceleration_are_continuous(design: Design, folder: Path) -> None:
    h = 1 / RATE
    q, dq, ddq = motion_in(rows_of(folder / "trajectory.csv")[0])
    transfers = design.approach_and_return.transfers.values()
    J = max(np.abs(design.samples.dddq).max(), *(transfer.jerk.max() for transfer in transfers)) * 1.01
    assert np.abs(np.diff(ddq, axis=0)).max() <= J * h
    assert np.abs(np.diff(dq, axis=0) - h * (ddq[1:] + ddq[:-1]) / 2).max() <= J * h**2 / 4
    assert np.abs(np.diff(q, axis=0) - h * (dq[1:] + dq[:-1]) / 2).max() <= J * h**3 / 12
    for before, after in itertools.pairwise(design.sequence.pieces):
        end = before.motion.samples(np.array([before.motion.duration]))
        start = after.motion.samples(np.zeros(1))
        assert np.allclose(end.q, start.q, rtol=0.0, atol=1e-12)
        assert not np.any([end.dq, end.ddq, start.dq, start.ddq])


def test_certificates_of_the_ways(design: Design, folder: Path) -> None:
    content = content_of(folder)
    assert design.feasible
    robot = TASK.limits.applied(IRP6)
    for segment, transfer in design.approach_and_return.transfers.items():
        uses = {use["label"]: use for use in content["played"][segment]["limits"]}
        assert all(use["holds"] for use in uses.values())
        for limit in linear_limits(robot):
            for k, label in enumerate(limit.labels):
                use = uses.pop(label)
                value = limit.values(transfer.samples(np.array([use["time"]])))[0, k]
                if limit.derivative < 2:  # the others may jump there
                    assert value == pytest.approx(use["extreme"], abs=1e-9)
        others = {label for label, use in uses.items() if use["quantity"] != "distance"}
        assert others == {f"drive z{k} torque" for k in range(1, 6)}
        poses = [content["played"][segment]["legs"][0]["start"]]
        poses += [leg["end"] for leg in content["played"][segment]["legs"]]
        assert tuple(poses[0 if segment == "approach" else -1]) == HOME
        assert tuple(poses[1]) == VIA
    given = design.approach_and_return
    worse = dataclasses.replace(given.limits["return"][0], margin=-1.0)
    transfers = dataclasses.replace(given, limits={**given.limits, "return": (worse,)})
    assert not dataclasses.replace(design, approach_and_return=transfers).feasible


@pytest.mark.parametrize(("name", "wanted"), [("trajectory-0.1.csv", 0.1), ("trajectory-0.3.csv", 0.3)])
def test_rehearsals_are_the_same_path_slower(name: str, wanted: float, design: Design, folder: Path) -> None:
    columns, segments = rows_of(folder / name)
    told = {part["file"]: part for part in content_of(folder)["played"]["rehearsals"]}[name]
    full = rows_of(folder / "trajectory.csv")[0]["time"]
    time = columns["time"]
    assert wanted * (1 - 1 / full.size) < told["speed"] <= wanted
    assert time[-1] == pytest.approx(full[-1] / told["speed"], rel=1e-12)
    assert time[-1] == pytest.approx(told["duration"], rel=1e-12)
    assert np.allclose(np.diff(time), 1 / RATE, rtol=1e-9)
    assert [segment for segment, _ in itertools.groupby(segments)] == ["approach", "excite", "return"]
    q, dq, ddq = motion_in(columns)
    v = told["speed"]
    inside = [k for k, segment in enumerate(segments) if segment == "excite"]
    start = next(part["start"] for part in content_of(folder)["played"]["segments"] if part["name"] == "excite")
    same = design.trajectory.samples(np.clip(time[inside] * v - start, 0.0, TASK.trajectory.period))
    assert np.allclose(q[inside][:, :3], same.q, rtol=0.0, atol=1e-9)
    assert np.allclose(dq[inside][:, :3], v * same.dq, rtol=0.0, atol=1e-9)
    assert np.allclose(ddq[inside][:, :3], v**2 * same.ddq, rtol=0.0, atol=1e-9)
    h, J = 1 / RATE, v**3 * 100.0
    assert np.abs(np.diff(dq, axis=0) - h * (ddq[1:] + ddq[:-1]) / 2).max() <= J * h**2 / 4
    assert np.abs(np.diff(q, axis=0) - h * (dq[1:] + dq[:-1]) / 2).max() <= J * h**3 / 12


# --- home where it changes nothing, or little


def ways_between(robot: Robot, task: Task, ends: Array) -> ApproachAndReturn | None:
    """Ways of a motion of the first three joints."""
    return approach_and_return(robot, task, MOVING, ends, nonlinear_limits(robot, robot.joint_names, task))


def ways_from(design: Design, **changes: object) -> ApproachAndReturn:
    ends = design.samples.q[[0, -1]]
    found = ways_between(IRP6, TASK.changed(**changes), ends)
    assert found is not None
    return found


def test_at_home_already_or_without_a_home_there_is_no_way(design: Design, tmp_path: Path) -> None:
    home = (*design.samples.q[0].tolist(), 0.0, 0.0)
    transfers = ways_from(design, home=home, via=())
    assert transfers.notes == ("the motion starts and ends at home: no approach and no return are needed",)
    there = dataclasses.replace(design, approach_and_return=transfers, task=TASK.changed(home=home, via=(), speed=()))
    save_design(there, tmp_path / "there")
    columns, segments = rows_of(tmp_path / "there" / "trajectory.csv")
    assert segments == ["excite"] * design.samples.time.size
    assert np.array_equal(columns["time"], design.samples.time)
    alone = dataclasses.replace(design, approach_and_return=None, task=TASK.changed(home=None, via=(), speed=()))
    save_design(alone, tmp_path / "alone")
    assert "segment" not in table_of(tmp_path / "alone" / "trajectory.csv")[0]
    told = content_of(tmp_path / "alone")["played"]
    assert set(told) == {"rate", "duration", "segments", "rehearsals", "between_samples"}


def test_notes_say_what_was_assumed(design: Design) -> None:
    (note,) = [note for note in design.notes if "jerk" in note]
    assert note == (
        "no jerk limit is known for q1, q2, q3, q4: approach and return reach the acceleration limit in 0.1 s or "
        "later; give one with `jerk`"
    )


# --- limits of torques and of the tool


def test_ways_are_as_slow_as_the_tool_needs_and_judged_where_that_does_not_help(design: Design) -> None:
    task = TASK.changed(via=(), tool_speed=5.0)
    (limit,) = nonlinear_limits(IRP6, IRP6.joint_names, task)
    ends = design.samples.q[[0, -1]]
    transfers = ways_between(IRP6, task, ends)
    approach = transfers.transfers["approach"]
    fastest = limit.shown(limit.values(approach.samples(np.linspace(0.0, approach.duration, 2001)))).max()
    (use,) = [use for use in transfers.limits["approach"] if "tool" in use.label]
    assert use.holds
    assert fastest <= use.extreme <= 1.02 * fastest
    slower = ways_between(IRP6, task.changed(tool_speed=0.4), ends)
    assert slower.transfers["approach"].duration == pytest.approx(approach.duration * fastest / 0.4, rel=0.03)
    assert dataclasses.replace(design, approach_and_return=slower).feasible
    (place,), _ = tool_motion(IRP6, np.zeros(3), Samples(np.zeros(1), np.array([HOME]), *np.zeros((3, 1, 5))))
    box = ((None, None), (None, None), (place[2] - 0.01, None))
    broken = ways_between(IRP6, task.changed(tool_speed=None, tool_box=box), ends)
    assert broken.transfers["approach"].duration == approach.duration
    assert not dataclasses.replace(design, approach_and_return=broken).feasible


# --- a log of the whole file


def test_a_joint_that_only_the_ways_move_is_held_while_the_log_excites(design: Design) -> None:
    whole = dataclasses.replace(design, approach_and_return=ways_from(design, via=(), settle=1.0))
    samples, segments = whole.sequence.sampled()
    effort = np.random.default_rng(0).normal(size=samples.q.shape)
    log = log_of(samples.time, samples.q, effort=effort, joints=IRP6.joint_names)
    assert np.ptp(log.q[:, 3]) == pytest.approx(0.4)
    found = prepare(log, IRP6, design.target, Recipe())
    assert abs(found.log.count - segments.count("excite")) <= 0.4 * RATE
    with pytest.raises(InputError, match=r"joint q4 moves by 0\.4 rad, but the model holds it"):
        prepare(log, IRP6, design.target, Recipe(rows="all"))


def test_simulation_follows_the_file_from_home(design: Design, tmp_path: Path) -> None:
    task = TASK.changed(home=(*HOME[:3], 0.0, 0.0), via=(), speed=())
    transfers = ways_between(IRP6, task, design.samples.q[[0, -1]])
    save_design(dataclasses.replace(design, task=task, approach_and_return=transfers), tmp_path)
    stored = load_design(tmp_path)
    motion = read_motion(tmp_path / "trajectory.csv", stored.moving.joint_names)
    run = simulate_motion(stored.robot, stored.task, motion, SimulationSettings(rate=200.0))
    assert run.log.q[0] == pytest.approx(HOME[:3], abs=1e-6)
    assert np.abs(run.tracking_error).max() < 1e-3
    assert run.log.time[-1] == pytest.approx(content_of(tmp_path)["played"]["duration"])


# --- what cannot be


BAD = (
    ({"home": (0.0, 0.0)}, "home needs 5 numbers, one for each of the joints q1, q2, q3, q4, q5; given 2"),
    ({"via": ((0.0,) * 6,)}, "via 1 needs 5 numbers, .*; given 6"),
    ({"home": (0.0, 0.8, 0.0, 0.0, 0.0)}, r"home: joint q2 position is 0\.8 rad, 0\.102 rad outside .*; drive z3 pos"),
    ({"via": (VIA, (0.0, -0.5, -0.5, 0.0, 0.0))}, r"via 2: drive z3 position is -1 rad, 0\.302 rad outside \["),
    ({"via": (), "tool_box": (*[(None, None)] * 2, (9.0, None))}, r"home: tool z is .* m, .* m outside \[9, inf\]"),
    ({"home": "robot"}, "home: the description of robot 'irp6' has no home pose; give a pose"),
    ({"home": "here"}, "home must be a pose, or 'robot' for that of its file; given 'here'"),
    ({"home": None}, "`via` gives poses between home and the motion, but there is no home; give `home`"),
    ({"home": (0.0, 0.0, 0.0, 0.0, math.nan)}, "`home` must be a number"),
    ({"speed": (0.1, 0.0)}, "`speed` must be a number from 1e-06 to 1, given 0"),
    ({"speed": (1.5,)}, r"`speed` must be a number from 1e-06 to 1, given 1\.5"),
    ({"speed": (1e-4,)}, r"at speed 0\.0001 are 1e\+07 samples; expected 1000000 or fewer"),
    ({"settle": -1.0}, r"`settle` must be 0 or a number from 1e-06 to 100000 s, given -1"),
)


def test_bad_input_is_named(folder: Path) -> None:
    for changes, message in BAD:
        with pytest.raises(InputError, match=message):
            ways_between(IRP6, TASK.changed(**changes), np.zeros((2, 3)))
    for home, message in (
        ("home: [0, 0]", "home.*: expected as many numbers as joints, 5, given 2"),
        ("home: [0, 0, 0, 0, .inf]", "home"),
        ("home: [0, 0, 0, 0, x]", "home"),
    ):
        with pytest.raises(InputError, match=message):
            described(home)
    with pytest.raises(InputError, match=r"q4 moves, but the design holds it.*`approach_and_return=False` leaves"):
        read_motion(folder / "trajectory.csv", MOVING)


# --- home in the robot's file


def described(*home: str) -> Robot:
    text = (Path(regressors.__file__).parent / "robots" / "irp6.yaml").read_text(encoding="utf-8")
    return parse_description("\n".join([text, *home]), "arm.yaml")


def test_home_of_the_robots_file(design: Design) -> None:
    robot = described("home: [0.6, 0.3, -0.25, 0.4, 0 deg]")
    assert robot.home.tolist() == list(HOME)
    again = robot_from_description(json.loads(json.dumps(robot.description())))
    assert again.sha256() == robot.sha256() != described().sha256()
    assert "home" not in described().description()  # and so the hash stays what it was
    assert moving_robot(robot, TASK).home is None
    ends = design.samples.q[[0, -1]]
    stated, typed = (ways_between(robot, TASK.changed(home=home), ends) for home in ("robot", HOME))
    assert stated.to_dict() == typed.to_dict()


# --- the command


@pytest.mark.slow
def test_command_with_home_in_a_task_file(here: Here) -> None:
    (here.cwd / "task.yaml").write_text(
        "starts: 1\nharmonics: 3\nexecutor: serial\nspeed: 0.5\nhome: [0.5, 0, 0, 0.2, 0]\nvia: [[0.1, 0, 0, 0, 0]]\n",
        encoding="utf-8",
    )
    (here.cwd / "out").mkdir()
    (here.cwd / "out" / "trajectory-mine.csv").write_text("one of the user's own\n", encoding="utf-8")
    ended = here.run("design", "irp6", "--task", "task.yaml", "--settle", "0.5", "--out", "out", status=0)
    tables = {path.name for path in (here.cwd / "out").glob("*.csv")}
    assert tables == {"trajectory.csv", "trajectory-0.5.csv", "trajectory-mine.csv"}
    content = content_of(here.cwd / "out")
    assert content["task"]["home"] == [0.5, 0.0, 0.0, 0.2, 0.0]
    assert content["task"]["via"] == [[0.1, 0.0, 0.0, 0.0, 0.0]]
    way = content["played"]["approach"]
    times = f"{way['duration']:g} s ({way['shortest']:.4g} s at the quickest)"
    assert f"approach from home: {times}, within all limits" in " ".join(ended.stdout.split())
    assert f"trajectory.csv lasts {content['played']['duration']:g} s" in ended.stdout
    assert load_design(here.cwd / "out").task.output.via == ((0.1, 0.0, 0.0, 0.0, 0.0),)
    refused = here.run("simulate", "out", "--rate", "100", "--out", "log.csv", status=2)
    assert "--no-approach-and-return leaves out the approach" in refused.stderr
    here.run("simulate", "out", "--rate", "100", "--no-approach-and-return", "--out", "log.csv", status=0)
    assert json.loads((here.cwd / "log.json").read_text(encoding="utf-8"))["trajectory"] is None
