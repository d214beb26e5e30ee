"""Logs that are spoilt: the fault is named with its remedy, and no fault of a sound log."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy
from played import EXACT, TASK, curves, found, irp6, noisy, periodic, played, three_joints, torques

from excite.identification.fault_search import GAIN, FaultSearch
from excite.identification.identify import identify
from excite.identification.log_faults import NO_FAULT, Fault, gains_fault, zero_fault
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.identification.spoilt_log import SPOILT, named
from excite.logs.log import Log
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in
from regressors.robot.friction.load_and_temperature import drives_with_friction
from regressors.robot.inertia import from_centre_of_mass
from regressors.robot.robot import Robot
from regressors.samples import Array


def sound(seed: int = 3) -> Log:
    return noisy(played(three_joints(seed), 3, seconds=4.0), 1.0, 1e-6, seed)


def effort(change: Callable[[Array], Array]) -> Log:
    log = sound()
    return replace(log, effort=change(log.effort.copy()), sha256="spoilt")


def positions(change: Callable[[Array], Array]) -> Log:
    log = sound()
    return replace(log, q=change(log.q.copy()), dq=None, sha256="spoilt")


def times(*factors: float) -> Log:
    return effort(lambda y: y * np.array(factors))


def late(y: Array) -> Array:
    return np.vstack([np.repeat(y[:1], 4, axis=0), y[:-4]])


def later_half(y: Array) -> Array:
    return np.vstack([y[: len(y) // 2], late(y)[len(y) // 2 :]])


def numbers(pattern: str, text: str) -> list[float]:
    return [float(x) for x in re.search(pattern, text).groups()]


CASES = {
    "torque columns exchanged": (
        effort(lambda y: y[:, [0, 2, 1]]),
        "the torque columns of q2 and q3 are exchanged",
        "the columns that now stand for q1, q3, q2, in this order",
    ),
    "torque columns shifted": (effort(lambda y: np.roll(y, 1, axis=1)), "the torque columns are shifted", "by one"),
    "torque sign": (times(1, -1, 1), "the torques of q2 have the opposite sign", "`sign: [1, -1, 1]`"),
    "torque unit": (times(1, 1e3, 1), "the torques of q2 are in mNm, not in Nm", "`unit: [Nm, mNm, Nm]`"),
    "a torque constant": (
        times(1, 0.85, 1),
        "the torques of q2 are 0.85 times what the other joints say of it, or the torques of q3 are 1.2 times",
        "`gain: [1, 1.17, 1]`",
    ),
    "unit where friction explains": (
        times(1e-3, 1, 1),
        "the torques of q1 are in kNm, not in Nm",
        "`unit: [kNm, Nm, Nm]`",
    ),
    "torques cut off in most rows": (
        effort(lambda y: np.clip(y, -10.0, (10.0, 20.0, np.inf))),
        "the torques of q1, q2, q3 are cut off at 10, 20, -10 in",
        "record them over their whole range",
    ),
    "currents": (
        times(0.3, 0.05, 0.15),
        "the torques of q2, q3 are 0.05, 0.15 times what the described robot would need, as currents or drive units",
        "use `gain: [1, 20, 6.6",
    ),
    "position sign": (
        positions(lambda q: q * np.array([1, -1, 1])),
        "the positions of q2 have the opposite sign",
        "`sign: [1, -1, 1]` for the positions",
    ),
    "all torques late": (effort(late), "all torques are 20 ms later than the positions", "`delay=0.02`"),
    "one channel late": (
        effort(lambda y: np.column_stack([y[:, 0], late(y)[:, 1], y[:, 2]])),
        "the torques of q2 are 20 ms later than those of the other joints",
        "use `delay=(",
    ),
    "all late from some time on": (effort(later_half), "s on all torques are 20 ms later than before", "`rows='1:39"),
    "magnitudes": (effort(np.abs), "never negative", "record torques with their signs"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_fault_is_named_with_what_mends_it(case: str) -> None:
    log, what, cure = CASES[case]
    (doubt,) = found(TASK, log, recipe=EXACT).doubts
    assert what in doubt.what
    assert cure in doubt.cure


@pytest.mark.parametrize("gravity", [(9.81, 0.0, 0.0), (5.0, 5.0, -6.8), (1.0, 4.0, -8.9)])
def test_a_base_that_is_mounted_otherwise_is_named_with_its_gravity(gravity: tuple[float, float, float]) -> None:
    (doubt,) = estimate_parameters(irp6().replace(gravity=np.array(gravity)), TASK, (sound(),), EXACT).doubts
    stated = numbers(r"gravity=([-.\d]+),([-.\d]+),([-.\d]+)`", doubt.cure)
    np.testing.assert_allclose(stated, irp6().gravity, atol=0.3)


def test_a_ceiling_is_named_beside_the_zero_that_looks_like_it() -> None:
    log = noisy(played(three_joints(3), 3, seconds=4.0), 0.1, 1e-6, 3)
    (doubt,) = estimate_parameters(irp6().replace(gravity=np.array([0.0, 0.0, 9.81])), TASK, (log,), EXACT).doubts
    (zero,) = numbers(r"the zero of q2 is off by (.+) degrees, or the base is tilted by 1", doubt.what)
    assert abs(zero) == pytest.approx(180.0, abs=3.0)
    stated = numbers(r"gravity=([-.\d]+),([-.\d]+),([-.\d]+)`", doubt.cure)
    np.testing.assert_allclose(stated, irp6().gravity, atol=0.3)


def test_a_base_that_moved_is_named_with_its_time_and_gravity() -> None:
    log, gravity = sound(), np.array([2.0, -1.5, -9.48])
    motion = three_joints(3).samples(log.time)
    change = torques(irp6().replace(gravity=gravity), motion, 5) - torques(irp6(), motion, 5)
    moved = replace(log, effort=log.effort + (log.time > 2.5)[:, None] * change[:, :3], sha256="moved")
    (doubt,) = found(TASK, moved, recipe=EXACT).doubts
    at, *stated = numbers(r"from (.+) s on the base is tilted .* gravity is \((.+),(.+),(.+)\)", doubt.what)
    assert at == pytest.approx(2.5, abs=0.05)
    np.testing.assert_allclose(stated, gravity, atol=0.3)


def test_friction_that_falls_is_named_with_its_share() -> None:
    log = sound()
    motion = three_joints(3).samples(log.time)
    rows = {name: row[:3] for name, row in drives_with_friction(irp6()) if name in curves()}
    friction = sum(curves()[name].torque(motion.dq[:, :3] @ row)[:, None] * row for name, row in rows.items())
    warm = replace(log, effort=log.effort - 0.4 * (log.time / log.time[-1])[:, None] * friction, sha256="warm")
    (doubt,) = found(TASK, warm, recipe=EXACT).doubts
    falls = numbers(r"the friction of q1, q2, q3 falls by (\d+), (\d+), (\d+) % over the log", doubt.what)
    np.testing.assert_allclose(falls, 40.0, atol=5.0)


def test_a_clock_that_jumps_is_named_and_a_real_gap_is_not() -> None:
    log, after = sound(), np.arange(sound().count) >= 300
    jumped = replace(log, time=log.time + 0.3 * after, sha256="jumped")
    (doubt,) = found(TASK, jumped, recipe=Recipe(rows="all")).doubts
    assert "the clock jumps by 0.3 s after row 300" in doubt.what
    assert "`rows='1:300'`" in doubt.cure
    gap = log.rows(np.flatnonzero((log.time < 1.5) | (log.time > 1.8)))
    assert not any("clock" in doubt.what for doubt in found(TASK, gap, recipe=Recipe(rows="all")).doubts)


def ur10e_log(masses: tuple[float, ...] = (1.0,) * 6, noise: float = 0.02) -> Log:
    """Torques of the described bodies times factors."""
    robot = built_in("ur10e")
    links = (replace(link, theta=factor * link.theta) for link, factor in zip(robot.links, masses, strict=True))
    return log_of(robot.replace(links=tuple(links)), noise)


def log_of(robot: Robot, noise: float) -> Log:
    """Torques of a robot in motion."""
    motion = periodic(np.eye(robot.n), 3, 0.6).samples(np.arange(800) / 200)
    model, known = DifferentialModel(robot), standard_values(robot)
    theta = [known.get(column.name, 0.0) for column in model.columns]
    y = (model.instants(motion) @ theta).reshape(motion.q.shape)
    y += noise * np.sqrt(np.mean(y**2, axis=0)) * np.random.default_rng(0).normal(size=y.shape)
    return Log("LOG", "other", robot.joint_names, motion.time, motion.q, effort=y)


@pytest.mark.parametrize(("memory", "angles"), [(0.0, (3.0, 35.0)), (0.9, (8.0, 20.0))])  # of the noise, row to row
def test_a_zero_is_named_with_its_angle_in_white_and_in_other_noise(memory: float, angles: tuple[float, ...]) -> None:
    log = ur10e_log(noise=0.0)
    noise = np.random.default_rng(0).normal(size=log.effort.shape) * np.sqrt(np.mean(log.effort**2, axis=0))
    noise = scipy.signal.lfilter([np.sqrt(1 - memory**2)], [1, -memory], noise, axis=0)
    log = replace(log, effort=log.effort + 0.02 * noise)
    for angle in angles:
        off = replace(log, q=log.q + np.deg2rad(angle) * (np.arange(6) == 2), sha256=f"{angle}")
        (doubt,) = estimate_parameters(built_in("ur10e"), Task("ur10e"), (off,), EXACT).doubts
        (named_angle,) = numbers("the zero of elbow_joint is off by (.+) degrees$", doubt.what)
        assert named_angle == pytest.approx(angle, abs=1.0)
    assert estimate_parameters(built_in("ur10e"), Task("ur10e"), (log,), EXACT).doubts == ()


@pytest.mark.parametrize(("elbow", "both"), [(0.05, True), (0.2, False)])
def test_zeros_of_parallel_joints_that_explain_the_same_are_both_named(elbow: float, both: bool) -> None:
    fits = [
        replace(zero_fault(("a", "b", "c"), j, 0.1), errors=0.03 * np.exp([0.0, 0.0, more]), shown=1.0)
        for j, more in ((1, 0.0), (2, elbow))
    ]
    doubt = named(replace(NO_FAULT, errors=0.03 * np.exp([0.0, 0.0, 1.0])), fits, np.full(3, 0.01))
    assert ("the zero of b is off by -5.73 degrees, or the zero of c" in str(doubt)) == both


@pytest.mark.parametrize(("shown", "is_named"), [(0.2, False), (0.3, True)])
def test_a_zero_must_explain_more_where_more_than_white_noise_is_left(shown: float, is_named: bool) -> None:
    zero = replace(zero_fault(("a", "b"), 1, 0.1), errors=np.array([0.03, 0.03]), shown=shown)
    none = replace(NO_FAULT, errors=0.03 * np.exp([0.0, shown]))
    assert (named(none, [zero], np.full(2, 0.01)) is not None) == is_named
    assert named(none, [zero], np.full(2, 0.03)) is not None


def test_zeros_explain_a_zero_that_is_off_and_no_masses_that_are() -> None:
    log = ur10e_log((1.08, 0.86, 0.72, 0.71, 1.19, 1.25), noise=0.003)
    off = replace(log, q=log.q + np.deg2rad([0.0, 0.0, 3.0, 0.0, 0.0, 0.0]), sha256="off")
    for one, explained in ((log, False), (off, True)):
        result = estimate_parameters(built_in("ur10e"), Task("ur10e"), (one,), EXACT)
        search = FaultSearch.of(result.target, result.prepared, result.friction)
        assert (search.gain_of_zeros > 0.08) is explained


GAINS = {
    "none": (5, 1.0, None),
    "of a joint before others": (3, 0.85, "the torques of wrist_1_joint are 0.85 times what the other joints say of"),
    "small, of the last joint": (5, 0.85, None),
    "too large for masses": (5, 0.2, "the torques of wrist_3_joint are 0.19 times what the other joints say of it"),
    "large, of the last joint": (5, 0.6, "the torques of wrist_3_joint are 0.58 times what the described masses make"),
}


@pytest.mark.parametrize("case", GAINS)
def test_a_gain_of_one_joint_is_named_where_masses_do_not_explain_it(case: str) -> None:
    j, gain, what = GAINS[case]
    log = ur10e_log((0.79, 0.86, 1.19, 1.05, 0.79, 0.96), noise=0.003)
    off = replace(log, effort=log.effort * np.where(np.arange(6) == j, gain, 1.0), sha256=case)
    doubts = estimate_parameters(built_in("ur10e"), Task("ur10e"), (off,), EXACT).doubts
    assert len(doubts) == (what is not None)
    assert all(what in doubt.what for doubt in doubts)


@pytest.mark.parametrize(
    ("angle", "off_axis", "is_named"), [(15.0, 0.08, False), (90.0, 0.08, True), (120.0, 0.012, False)]
)
def test_a_last_body_described_a_little_otherwise_is_no_zero(angle: float, off_axis: float, is_named: bool) -> None:
    robot = built_in("ur10e")

    def with_tool(angle: float) -> Robot:
        centre = [off_axis * np.cos(np.deg2rad(angle)), off_axis * np.sin(np.deg2rad(angle)), 0.08]
        theta = from_centre_of_mass(2.0, centre, 0.01 * np.eye(3))
        return robot.replace(links=(*robot.links[:-1], replace(robot.links[-1], theta=theta)))

    doubts = estimate_parameters(with_tool(0.0), Task("ur10e"), (log_of(with_tool(angle), 0.02),), EXACT).doubts
    assert ["the zero of wrist_3_joint is off by" in doubt.what for doubt in doubts] == [True] * is_named


def test_another_robot_of_the_family_is_named_with_its_lengths() -> None:
    robot, log = built_in("ur10e"), ur10e_log()
    factors = (1.0, 1.0, 0.7, 0.65, 0.8, 0.9)
    joints = tuple(replace(j, translation=f * j.translation) for j, f in zip(robot.joints, factors, strict=True))
    (doubt,) = estimate_parameters(robot.replace(joints=joints, shapes=()), Task("ur10e"), (log,), EXACT).doubts
    lengths = numbers(r"the lengths up to elbow_joint, wrist_1_joint are (.+), (.+) times", doubt.what)
    np.testing.assert_allclose(lengths, [1 / 0.7, 1 / 0.65], rtol=0.05)


@pytest.mark.parametrize(("size", "is_named"), [(1.0, False), (0.1, True)])
def test_a_fault_of_all_joints_that_leaves_most_of_their_error_is_none(size: float, is_named: bool) -> None:
    before = np.array([0.220, 0.140, 0.130, 0.191, 0.394, 0.539])  # of a sound log of three seconds of motion
    after = np.array([0.115, 0.132, 0.137, 0.197, 0.305, 0.543])
    moved = Fault("moved base", (), "the base is tilted", "fix the base", errors=size * after)
    doubt = named(replace(NO_FAULT, errors=size * before), [moved], np.full(6, 0.02 * size))
    assert (doubt is not None) == is_named


@pytest.mark.parametrize(("last", "is_named"), [(0.045, False), (0.3, True)])
def test_a_zero_that_leaves_most_of_the_error_is_none(last: float, is_named: bool) -> None:
    sound = replace(NO_FAULT, errors=np.array([0.03] * 6 + [last]))
    zero = replace(zero_fault(tuple("abcdefg"), 6, -1.7), errors=np.array([0.03] * 6 + [0.028]))
    assert sound.size - zero.size > GAIN
    assert (named(sound, [zero], np.full(7, 0.02)) is not None) == is_named


def test_a_refusal_says_which_fault_explains_it_and_else_stays_as_it_is() -> None:
    off = positions(lambda q: q + np.array([0.0, np.pi / 2, 0.0]))
    with pytest.raises(InputError, match=r"far beyond the limits .*; the log is spoilt: the zero of q2 is off by [89]"):
        identify(irp6(), off, recipe=EXACT, choose=False)
    with pytest.raises(InputError, match="samples per second; check that time is in seconds") as error:
        identify(irp6(), replace(off, time=1e4 * off.time), recipe=EXACT, choose=False)
    assert SPOILT not in str(error.value)
    long = replace(sound(), time=sound().time + 1.5 * (sound().time > 2.0))
    with pytest.raises(InputError, match=r"gaps of .*; the log is spoilt: the clock jumps by 1.5 s after row 40"):
        identify(irp6(), long, recipe=EXACT, choose=False)


def test_factors_that_a_log_does_not_show_or_that_masses_may_explain_are_not_stated() -> None:
    names, shown = ("a", "b", "c"), np.array([True, True, False])
    assert "`gain: [2, 4, 1]`" in gains_fault(names, np.array([2.0, 4.0, 30.0]), shown, known=True).cure
    assert "that of c does not show" in gains_fault(names, np.array([2.0, 4.0, 30.0]), shown, known=True).cure
    assert gains_fault(names, np.array([2.0, 2.1, 30.0]), shown, known=True) is NO_FAULT
    assert gains_fault(names, np.array([1.3, 0.75, 1e-3]), np.ones(3, dtype=bool), known=True) is NO_FAULT
    assert gains_fault(names, np.array([5.0, 5.1, 5.0]), np.ones(3, dtype=bool), known=True).kind == "gains"


@pytest.mark.parametrize("seed", range(3))
def test_a_sound_log_is_not_accused(seed: int) -> None:
    result = found(TASK, sound(seed), recipe=EXACT)
    assert result.doubts == ()
    search = FaultSearch.of(result.target, result.prepared, result.friction)
    none = search.plain.fit(NO_FAULT)
    fits = [*search.fits(), *search.late_joints(none), search.with_lengths()]
    assert named(none, fits, search.noise) is None
    assert none.size - min(fit.size for fit in fits) < GAIN / 2
