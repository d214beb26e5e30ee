"""Parameters that a motion shows in theory only, and angles that were rounded."""

from __future__ import annotations

import dataclasses
import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from written_files import saved

import excite
from excite.cli.summary import print_view
from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.information.matrix import MotionMeasures
from excite.information.nearly_unidentifiable import (
    NearlyUnidentifiable,
    hardly_excited_note,
    nearly_unidentifiable,
    rounded_angles,
    slow_motion_note,
)
from excite.information.prior import standard_sizes
from excite.information.target import FACTOR, IdentificationTarget, target_of
from excite.tasks.task import Task
from excite.views.design_view import design_view
from regressors.models.base import random_states
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.robot.gears import ConstantRatio
from regressors.robot.robot import Drive, Joint, Limits, Link, Robot, Transmission

TILT = 3.7e-6  # pi / 2 - 1.5708 [rad]
THETA = np.array([4.0, 0.4, 0.1, 0.2, 0.3, 0.01, 0.02, 0.25, 0.01, 0.2])


def arm(*, base: float = 0.0, elbow: float = np.pi / 2, drives: tuple[Drive, ...] = ()) -> Robot:
    """Two joints; the first axis leans against gravity by `base`, the second against the first by `elbow` [rad]."""
    placed = (("shoulder", base, 0.0), ("elbow", elbow, 0.3))
    joints = tuple(Joint.from_mdh(name, "revolute", alpha=alpha, a=a) for name, alpha, a in placed)
    two = np.full(2, 2.0)
    limits = Limits(-two, two, two, 3 * two, np.full(2, np.inf), np.full(2, np.inf))
    transmission = Transmission(np.eye(2), drives, Limits.none(2)) if drives else None
    return Robot("arm", joints, (Link("upper", THETA), Link("fore", 0.5 * THETA)), limits, transmission)


def found(robot: Robot, noise: float = 1.0, **options: object) -> dict[str, NearlyUnidentifiable]:
    """Of independent states, 500 of them."""
    target = target_of(robot, Task(robot, friction=False, nearly_unidentifiable="keep", **options))
    states = random_states(target.robot, 500, seed=3)
    return {p.name: p for p in nearly_unidentifiable(target, states, np.full(2, noise))}


@cache
def designed() -> Design:
    kept = {"friction": False, "nearly_unidentifiable": "keep"}
    task = Task(arm(base=TILT), **kept, period=4.0, harmonics=3, starts=1, executor="serial")
    return design_trajectory(task)


def test_an_axis_that_leans_against_gravity_by_rounding_shows_a_moment_in_theory_only() -> None:
    hardly = found(arm(base=TILT))
    assert set(hardly) == {"m1c1x", "m1c1y"}
    first = hardly["m1c1x"]
    assert (first.what, first.together) == ("first moment of link upper", ())
    assert first.effect == pytest.approx(9.81 * TILT * first.size, rel=1e-3)  # Nm, the noise is 1 Nm
    assert first.size == pytest.approx(np.hypot(np.linalg.norm(THETA[1:4]), 0.3 * 2.0))  # m1c1x + a m2
    target = target_of(arm(base=TILT), Task(arm(base=TILT), friction=False, nearly_unidentifiable="keep"))
    measures = MotionMeasures.of(target, random_states(target.robot, 500, seed=3), np.ones(2))
    predicted = {p.name: p for p in measures.predicted}
    assert first.deviation == pytest.approx(predicted["m1c1x"].standard_deviation, rel=1e-6)
    assert first.factor > FACTOR
    assert not found(arm(base=TILT), noise=1e-5)  # which makes the moments visible


@pytest.mark.parametrize("robot", [arm(), arm(base=0.1), arm(elbow=0.0), arm(elbow=1.2)])
def test_axes_that_are_meant_as_they_are_leave_nothing_to_say(robot: Robot) -> None:
    assert not found(robot)
    assert not rounded_angles(robot)


def test_a_rotor_behind_an_elbow_that_is_nearly_at_a_right_angle_moves_together_with_its_link() -> None:
    drives = (Drive("d1"), Drive("d2", ConstantRatio(50.0), rotor_inertia=1e-4))
    hardly = found(arm(elbow=np.pi / 2 + TILT, drives=drives))
    names = {name for p in hardly.values() for name in (p.name, *p.together)}
    assert len(names) == 2
    assert "I2zz" in names
    assert any(p.what == "rotor inertia of drive d2" for p in hardly.values())
    assert all(p.together for p in hardly.values())


def test_the_angles_that_were_rounded_are_named() -> None:
    (gravity,) = rounded_angles(arm(base=TILT))
    assert gravity == "the axis of joint shoulder is 3.7e-06 rad from parallel to gravity"
    (elbow,) = rounded_angles(arm(elbow=1.5708))
    assert elbow == "the axis of joint elbow is 3.7e-06 rad from a right angle to that of joint shoulder"


def test_bodies_of_which_nothing_is_known_have_the_size_of_the_others() -> None:
    robot = arm()
    bare = robot.replace(links=(robot.links[0], Link("fore")))
    sizes = standard_sizes(DifferentialModel(bare))
    assert [sizes[name] for name in ("m2", "m2c2x", "I2yy")] == pytest.approx([4.0, 4.0 * 0.3, 4.0 * 0.09])
    assert sizes["m1c1x"] == pytest.approx(np.linalg.norm(THETA[1:4]))


def test_a_design_says_first_of_all_what_it_hardly_shows(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    design = designed()
    assert {p.name for p in design.nearly_unidentifiable} == {"m1c1x", "m1c1y"}
    note = design.notes[0]
    assert note.startswith(f"2 of {design.base.rank} parameters are nearly unidentifiable: for noise of 1 Nm (assumed)")
    assert "3.7e-06 rad from parallel to gravity" in note
    stored = json.loads(design.save(tmp_path / "design")[0].read_text())
    listed = stored["predicted"]["nearly_unidentifiable"]
    assert [entry["name"] for entry in listed] == [p.name for p in design.nearly_unidentifiable]
    print_view(design_view(design), [tmp_path / "design" / "design.json"])
    shown = capsys.readouterr().out
    assert 0 < shown.index("nearly unidentifiable") < shown.index("condition number")
    assert shown.count("nearly unidentifiable") == 1


def test_a_design_that_shows_everything_says_nothing_of_it() -> None:
    design = design_trajectory(designed().task.changed(noise=1e-5))
    assert not design.nearly_unidentifiable
    assert not any("nearly" in note for note in design.notes)


# --- joints that are hardly excited ----------------------------------------------------------------------------------

SCARA = Path(__file__).resolve().parents[2] / "arms" / "scara.urdf"


def hardly_excited(
    robot: Robot, noise: tuple[float, ...] | None = None, speed: float = 1.0, **options: object
) -> str | None:
    target = target_of(robot, Task(robot, **options))
    states = random_states(target.robot, 200, seed=0)
    slower = dataclasses.replace(states, dq=speed * states.dq, ddq=speed**2 * states.ddq)
    return hardly_excited_note(target, slower, noise)


def test_the_roll_of_a_scara_is_named_and_what_helps_ends_it() -> None:
    robot = excite.load_robot(str(SCARA))
    note = hardly_excited(robot, speed=0.1) or ""
    assert re.search(r"roll \(they cause [\de.-]+ Nm, a tenth of its torque limit is 0.8 Nm\)", note)
    assert all(word in note for word in ("`payload`", "`mount`", "faster", "longer"))
    heavy = robot.replace(links=(*robot.links[:3], Link("flange", 50 * robot.links[3].theta)))
    tilted = robot.replace(gravity=[9.81, 0.0, 0.0])
    helped = hardly_excited(robot), hardly_excited(heavy, speed=0.1), hardly_excited(tilted, speed=0.1)
    assert not any("roll (" in (note or "") for note in helped)


@pytest.mark.parametrize(("share", "named"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("hides", ["friction", "noise", "limit"])
def test_two_per_cent_of_what_hides_a_torque(hides: str, share: float, named: bool) -> None:
    """The second joint's torque against the oracle of simulated inverse dynamics: rows times the true parameters."""
    plain = arm()
    model = DifferentialModel(plain)
    definition, names = model.definition()
    known = {**dict.fromkeys(names, 0.0), **standard_values(plain)}
    torque = model.instants(random_states(plain, 200, seed=0)) @ definition @ [known[name] for name in names]
    size = float(np.sqrt(np.mean(torque.reshape(-1, 2)[:, 1] ** 2))) / 0.02 / share
    robot, noise = plain, None
    if hides == "noise":
        noise = (1e-3, size)
    elif hides == "friction":
        robot = arm(drives=(Drive("d1", coulomb=1e-3), Drive("d2", coulomb=size)))
    else:
        robot = plain.replace(limits=dataclasses.replace(plain.limits, torque=np.array([np.inf, 10 * size])))
    note = hardly_excited(robot, noise)
    assert (note is not None and "behind elbow (" in note) == named
    assert hardly_excited(robot.replace(links=(Link("upper"), Link("fore"))), (1e9,)) is None  # of unknown masses


@pytest.mark.slow
def test_a_design_names_the_joint_in_its_notes() -> None:
    design = design_trajectory(Task(str(SCARA), starts=1, executor="serial", period=4.0, harmonics=3))
    assert sum("hide the masses behind roll (" in note for note in design.notes) == 1


# --- left out --------------------------------------------------------------------------------------------------------


def bases(robot: Robot, **options: object) -> tuple[IdentificationTarget, IdentificationTarget]:
    """With them and without."""
    task = Task(robot, friction=False, nearly_unidentifiable="keep", **options)
    return target_of(robot, task), target_of(robot, task.changed(nearly_unidentifiable="drop"))


@pytest.mark.parametrize("model", ["differential", "energy"])
def test_what_is_hardly_seen_can_be_left_out(model: str) -> None:
    whole, visible = bases(arm(base=TILT), model=model)
    assert set(whole.base.names) - set(visible.base.names) == {"m1c1x", "m1c1y"}
    if model == "differential":  # with so little noise everything is seen
        assert len({each.base.names for each in bases(arm(base=TILT), noise=1e-6)}) == 1
    exact, _ = bases(arm(), model=model)
    assert visible.base.names == exact.base.names
    assert visible.base.expressions == exact.base.expressions
    assert visible.base.gap > 1e3  # the second one; the first is behind the parameters left out
    values = visible.base.singular_values
    assert values[whole.base.rank - 1] > 1e6 * values[whole.base.rank]
    assert {T.shape for T in visible.transforms.values()} == {(visible.base.rank,) * 2}
    assert all(np.linalg.cond(T) < 1e3 for T in visible.transforms.values())


# --- left out by default: what rounding alone shows ------------------------------------------------------------------


def small_and_fast(robot: Robot) -> Robot:
    """The robot with speed limits that differ a hundred thousand times."""
    limits = robot.limits
    return robot.replace(limits=Limits(limits.lower, limits.upper, np.array([0.01, 1e3]), *[np.full(2, np.inf)] * 3))


GEARED = (Drive("d1"), Drive("d2", ConstantRatio(50.0), rotor_inertia=1e-4))


ROUNDED = (
    (arm(base=TILT), arm(), ("m1c1x", "m1c1y")),
    (arm(base=TILT), arm(base=-TILT), ("m1c1x", "m1c1y")),
    (small_and_fast(arm(base=TILT)), small_and_fast(arm()), ("m1c1x", "m1c1y")),
    (arm(elbow=np.pi / 2 + TILT, drives=GEARED), arm(drives=GEARED), ("Iar2",)),
)


@pytest.mark.parametrize("model", ["differential", "energy"])
@pytest.mark.parametrize("noise", [None, 1e-6])
def test_what_only_rounding_shows_is_left_out(noise: float | None, model: str) -> None:
    options = {"friction": False, "model": model, "noise": noise}
    for rounded, exact, left_out in ROUNDED:
        found, meant = (target_of(robot, Task(robot, **options)) for robot in (rounded, exact))
        assert found.base.by_rounding == left_out
        assert found.base.names == meant.base.names
        assert found.base.expressions == meant.base.expressions
        np.testing.assert_allclose(found.base.D, meant.base.D, atol=1e-6)
        W = found.model.instants(random_states(found.robot, 200, seed=4))
        assert np.abs(W - W[:, found.base.index] @ found.base.D).max() < 1e-3 * np.abs(W).max()
        assert {T.shape for T in found.transforms.values()} == {(meant.base.rank,) * 2}


LEANING = [arm(), arm(base=1e-3), arm(elbow=1.5), small_and_fast(arm(base=1e-3))]


@pytest.mark.parametrize("robot", [*LEANING, *map(excite.load_robot, excite.built_in_names())], ids=lambda r: r.name)
def test_a_lean_of_a_thousandth_is_no_rounding_and_built_in_robots_keep_all_their_parameters(robot: Robot) -> None:
    tasks = (Task(robot, nearly_unidentifiable=choice) for choice in ("drop-rounding", "keep"))
    found, kept = (target_of(robot, task).base for task in tasks)
    assert found.by_rounding == ()
    assert found.names == kept.names
    np.testing.assert_array_equal(found.D, kept.D)


def test_a_design_says_what_rounding_it_left_out_and_its_identification_does_the_same(tmp_path: Path) -> None:
    robot = arm(base=TILT)
    design = design_trajectory(designed().task.changed(nearly_unidentifiable="drop-rounding"))
    assert "m1c1x, m1c1y, which exist by rounding only (the axis of joint shoulder is 3.7e-06 rad" in design.notes[0]
    assert design.condition_number < 1e-2 * designed().condition_number
    run = excite.simulate(design, noise=0.01, seed=1)
    found = excite.identify(robot, run, design=design)
    assert found.estimate.names == design.base.names
    again = excite.load_result(saved(tmp_path / "result", found))
    assert target_of(again.robot, again.task).base.names == design.base.names
    assert any("exist by rounding only" in note for note in found.estimate.notes)
    kept = excite.identify(robot, run, design=designed())
    assert kept.estimate.names == designed().base.names


# --- motions that are slower than they need to be ---------------------------------------------------------------------


def slow_motion(**used: float) -> str | None:
    """Of an arm without gravity and friction, whose torques grow with the square of the speed."""
    target = target_of(arm().replace(gravity=np.zeros(3)), Task(arm(), friction=False))
    return slow_motion_note(target, random_states(target.robot, 200, seed=0), used, 10.0)


def test_a_slow_motion_says_what_its_path_would_tell_in_less_time() -> None:
    note = slow_motion(velocity=0.2, torque=0.01)
    assert note is not None
    assert "at most 20 % of the velocity limits" in note
    assert "its path in 2 s instead of 10 s would make the predicted deviations 0.04 times" in note  # 1 / 5^2
    assert slow_motion(velocity=0.2, acceleration=0.1) is not None
    assert slow_motion(velocity=0.2, acceleration=0.5) is None
    assert slow_motion(velocity=0.6) is None
    assert slow_motion(acceleration=0.1) is None  # nothing is known of the speed
