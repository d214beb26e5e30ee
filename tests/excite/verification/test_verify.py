"""Whether a result is believed: good ones, wrong ones of many kinds, and the reasons that are given."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from identified import with_estimate
from played import FRICTION, LOAD, curves, found, noisy, periodic, played, three_joints
from recordings import real_log
from refused import refusal
from written_files import saved, text_file

from excite.identification.identification import Identification
from excite.identification.identify import identify
from excite.identification.large_residual import Doubt
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.identification.result_json import load_result
from excite.logs.log import Log
from excite.simulation.replay import Outcome, Replay
from excite.storage.records import json_of
from excite.tasks.further_settings import Tolerances
from excite.tasks.task import Task
from excite.verification.simulated_motion import failure, most_windows, motion_errors
from excite.verification.verdict import CorrectedError, TorqueError, Verdict, at_standstill, torque_errors, verdict
from excite.verification.verification import Verification
from excite.verification.verify import verify
from regressors.readers.library import built_in
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array, Samples

TASK = Task("irp6")


def stored(result: Identification, folder: Path) -> Identification:
    """The result as its file tells it."""
    return load_result(saved(folder, result, replace=True))


@pytest.fixture(scope="module")
def training() -> Log:
    return noisy(played(three_joints(), 3, seconds=4.0), 0.3, 1e-5, 1)


@pytest.fixture(scope="module")
def other() -> Log:
    """Another motion of the same robot."""
    return noisy(played(three_joints(4), 3, source="OTHER"), 0.3, 1e-5, 2)


@pytest.fixture(scope="module")
def result(training: Log, tmp_path_factory: pytest.TempPathFactory) -> Identification:
    return stored(found(TASK, training, recipe=Recipe()), tmp_path_factory.mktemp("result"))


# ---------------------------------------------------------------- results that hold


def test_a_good_result_is_believed(result: Identification, other: Log) -> None:
    v = verify(result, other)
    assert (v.verdict.holds, v.verdict.against) == (True, ())
    assert v.relative_error < 0.05
    assert all(error.relative < 0.05 for error in v.motions)
    inside = np.isin(other.time, v.time)
    np.testing.assert_array_equal(v.measured, other.effort[inside])


@pytest.mark.parametrize("window", ["short", "long"])
def test_a_result_of_energies_is_judged_by_torques(window: str, tmp_path: Path, other: Log) -> None:
    log = played(three_joints(), 3, 1000.0)
    energies = stored(found(Task("irp6", model="energy", window=window), log), tmp_path)
    v = verify(energies, other, signals="butterworth")
    assert v.equations == (("q1", "Nm"), ("q2", "Nm"), ("q3", "Nm"))
    assert v.verdict.holds
    assert v.motions is not None


def test_a_result_of_wrench_integrals_is_judged_by_the_wrench(tmp_path: Path) -> None:
    task = Task("irp6", model="load-integral", window_length=0.01)
    integrals = stored(found(task, played(periodic(np.eye(5), 3), 5, 500.0, load=LOAD)), tmp_path)
    v = verify(integrals, played(periodic(np.eye(5), 6), 5, 100.0, 6.0, load=LOAD, source="OTHER"))
    assert [unit for _, unit in v.equations] == ["N"] * 3 + ["Nm"] * 3
    assert v.verdict.holds
    assert (v.replay, v.motions) == (None, None)
    assert v.relative_error < 1e-6


def test_friction_that_was_subtracted_is_added_again(tmp_path: Path, other: Log) -> None:
    identified = found(TASK, played(three_joints(), 3), friction=FrictionCurves(curves()))
    loaded = stored(replace(identified, friction_file=text_file(tmp_path / "friction.yaml", FRICTION)), tmp_path)
    v = verify(tmp_path, other, signals="butterworth")  # by its folder
    assert v.relative_error == verify(loaded, other, signals="butterworth").relative_error
    assert v.verdict.holds
    assert v.relative_error < 0.1
    assert v.training_error < 1e-9


def test_how_a_motion_was_averaged_and_filtered_belongs_to_its_log(tmp_path: Path, training: Log, other: Log) -> None:
    recipe = Recipe(rows="all", signals="fourier", period=2.0, harmonics=3, average=True)
    averaged = stored(found(TASK, training, recipe=recipe), tmp_path)
    assert averaged.recipe.average
    assert "OTHER: no period" in refusal(verify, averaged, other)
    assert verify(averaged, other, signals="butterworth").verdict.holds


def test_a_partial_result_is_judged_on_its_own_torque(tmp_path: Path) -> None:
    along = np.array([[0.0, 1.0, -1.0, 0.0, 0.0]])
    partial = stored(found(Task("irp6", drives=("2",)), played(periodic(along, 2), 3)), tmp_path)
    v = verify(partial, played(periodic(along, 5), 3, source="OTHER"), signals="butterworth")
    assert len(v.equations) == 1
    assert v.verdict.holds


# ---------------------------------------------------------------- results that do not


def wrong(result: Identification, **factors: float) -> Identification:
    scale = np.array([factors.get(name, factors.get("every", 1.0)) for name in result.names])
    return with_estimate(result, fit=scale * result.coefficients)


def against(v: Verification, *parts: str) -> None:
    assert not v.verdict.holds
    text = v.verdict.text
    assert text.startswith("Do not rely on the result: ")
    for part in parts:
        assert part in text


def test_a_gain_that_is_off_is_seen_as_tolerances_decide(result: Identification, other: Log) -> None:
    said = ("predictions miss 20", "times that on the logs of", "does not generalise")
    against(verify(wrong(result, every=1.2), other), *said)
    v = verify(wrong(result, every=1.2), other, tolerances=Tolerances(torque=0.5, motion=9.0))
    assert v.verdict.holds
    assert any("this log is noisier, or its motion is of another kind" in remark for remark in v.verdict.remarks)
    impossible = verify(wrong(result, X4=-1.0), other, tolerances=Tolerances(torque=0.9))  # torques hardly tell
    assert any("(the mass matrix of the estimate is not positive" in remark for remark in impossible.verdict.remarks)
    assert impossible.motions is None


def test_swapped_joints_are_seen(training: Log, other: Log, tmp_path: Path) -> None:
    swapped = replace(training, effort=training.effort[:, [2, 1, 0]])
    v = verify(stored(found(TASK, swapped, recipe=Recipe()), tmp_path), other)
    against(v, "the torque columns of q1 and q3 are exchanged", "without noise, torques in motion miss q")


@pytest.mark.slow
def test_a_recorded_arm_is_believed_until_it_carries_something(tmp_path: Path) -> None:
    robot, task = built_in("ur10e"), Task("ur10e", joint_rotors=True, offset=True)
    training = real_log("ur-20_02_05-20sec_8harm")
    arm = stored(estimate_parameters(robot, task, [training], Recipe()), tmp_path)
    bare = verify(arm, real_log("ur-20_01_31-unload"))
    assert bare.verdict.holds
    assert bare.relative_error < 0.07
    against(verify(arm, real_log("ur-20_01_31-load")), "predictions miss 2")


def test_what_a_result_does_not_know_does_not_contradict_it(other: Log, tmp_path: Path) -> None:
    """The third drive holds still where identified; what is wrong beside it stays wrong."""
    motion = three_joints(3)
    tied = replace(motion, amplitude=motion.amplitude.copy(), phase=motion.phase.copy())
    tied.amplitude[2], tied.phase[2] = -tied.amplitude[1], tied.phase[1]
    log, recipe = noisy(played(tied, 3, seconds=4.0), 0.3, 1e-6, 1), Recipe(estimator="weighted")
    known = identify(TASK, log, recipe=recipe, choose=False)
    assert {"F3c", "F3v"} <= set(known.estimate.unseen)
    judged = verify(stored(known, tmp_path), other)
    against(judged, "the torques of q1, q2, q3 are not known well enough: within the 99 % intervals of")
    assert (judged.verdict.contradicted, judged.verdict.unknown) == ((), ("q1", "q2", "q3"))
    stronger = verify(known, replace(other, effort=other.effort * [1.3, 1.0, 1.0])).verdict
    assert (stronger.contradicted, stronger.unknown) == (("q1",), ("q2", "q3"))


# ---------------------------------------------------------------- what is refused


def test_what_cannot_be_verified(result: Identification, training: Log, other: Log) -> None:
    renamed = with_estimate(result, names=("Q", *result.names[1:]))
    for given, log, horizon, message in (
        (
            result,
            replace(training, joints=("a", "b", "c")),
            0.5,
            r"^LOG is a log that the result was identified from: .* `training_too`$",
        ),
        (renamed, other, 0.5, r"its model has the parameters X1, X2, .*, but the result has Q, X2, "),
        (result, replace(other, effort=None), 0.5, "OTHER has no effort"),
        *(
            (result, other, x, f"`horizon` must be .* 1e-06 to 100000 s, given {x:g}")
            for x in (0.0, -1.0, np.nan, np.inf)
        ),
    ):
        assert re.search(message, refusal(verify, given, log, horizon=horizon))
    v = verify(result, training, training_too=True)
    assert v.training_error == pytest.approx(v.relative_error, rel=1e-9)


# ---------------------------------------------------------------- errors of torques


def test_parts_of_the_error_are_what_was_planted() -> None:
    time = np.arange(4000) / 500.0
    moves = time < 4.0
    speed = np.where(moves, 1.0, 0.0)[:, None] * np.ones((1, 4))
    noise = np.random.default_rng(0).normal(size=4000)
    errors = np.column_stack([noise, 1.0 - moves, 1.0 * moves, np.sin(2 * np.pi * time)])  # at standstill, in motion
    measured = 10.0 * np.cos(time)[:, None] + errors
    still, names = at_standstill(speed), tuple((f"q{k}", "Nm") for k in range(4))
    found = torque_errors(time, measured, measured - errors, still, names)
    assert found[0].noise > 0.9
    assert found[1].standstill > 0.95
    assert found[2].systematic > 0.95
    assert found[3].standstill == pytest.approx(0.5, abs=0.05)
    assert [error.limited_by for error in found[:3]] == [
        "noise of the measurement",
        "static friction at standstill",
        "the model (friction, gains, flexibility)",
    ]
    for j, error in enumerate(found):
        assert error.noise + error.standstill + error.systematic == pytest.approx(1.0)
        assert error.error == pytest.approx(np.sqrt(np.mean(errors[:, j] ** 2)))
        assert error.worst == np.abs(errors[:, j]).max()
        assert error.worst_time == time[np.abs(errors[:, j]).argmax()]
    zero = np.zeros((100, 1))
    (nothing,) = torque_errors(time[:100], zero, zero + 1.0, still[:100, :1], (("q", "Nm"),))
    (perfect,) = torque_errors(time[:100], zero + 1.0, zero + 1.0, at_standstill(zero * np.nan), (("fx", "N"),))
    assert (nothing.relative, perfect.error, perfect.relative, perfect.standstill) == (np.inf, 0.0, 0.0, 0.0)


# ---------------------------------------------------------------- errors of motion


def replay_of(time: Array, q: Array, starts: tuple[int, ...] = (0,), outcome: Outcome = Outcome.DONE) -> Replay:
    stops, failed_at = (*starts[1:], time.size), None if outcome is Outcome.DONE else 0.25
    return Replay(outcome, time, q, np.zeros_like(q), starts, stops, failed_at, 0.01)


def test_motion_errors_are_relative_to_the_way_within_a_horizon() -> None:
    time = np.arange(100) / 100.0
    q = np.column_stack([time, np.zeros(100)])
    off = np.zeros_like(q)
    off[30] = [0.1, 0.0]
    samples = Samples(time, q, q, q, q)
    first, resting = motion_errors(replay_of(time, q + off, (0, 50)), samples, {"q1": "rad", "slide": "m"})
    assert (first.travel, first.error) == (pytest.approx(0.49), pytest.approx(0.01))
    assert first.relative == pytest.approx(0.01 / 0.49)
    assert (first.worst, first.worst_time, first.unit) == (pytest.approx(0.1), 0.3, "rad")
    assert (resting.travel, resting.relative, resting.unit) == (0.0, np.inf, "m")
    assert failure(replay_of(time, q)) is None
    assert failure(replay_of(time, q, outcome=Outcome.RAN_AWAY)) == "the motion diverges (at 0.250 s)"


# ---------------------------------------------------------------- the verdict


def error_of(name: str, relative: float, least: float, standstill: float = 0.0) -> tuple[TorqueError, CorrectedError]:
    """A tenth of the raw squared error is fast."""
    error = TorqueError(name, "Nm", 10.0, 10.0 * relative, relative, 1.0, 2.0, 0.1, standstill, 0.9 - standstill)
    return error, CorrectedError(0.0, error.error, relative, least)


SURE, NOISY = error_of("q1", 0.05, 0.04), error_of("q2", 0.5, 0.09)
STICKY = error_of("q3", 0.4, 0.39, 0.87)  # sqrt(0.03 / 0.9) of it in motion
POOR = error_of("q4", 0.21, 0.2)
TRAINED = "times that on the logs of the identification (0.1 %): "
CASES = (  # errors, over all equations, of training, doubts; confirmed, contradicted, undecided, reasons, remarks
    ([SURE], 0.05, 0.04, (), "q1", "", "", (), ()),
    ([SURE], 0.05, None, (), "q1", "", "", (), ()),
    ([SURE], 0.11, 0.1, (), "q1", "", "", ("predictions miss 11 % of what was measured, more than 10 %",), ()),
    ([SURE], np.nan, None, (), "q1", "", "", ("miss an unknown share of what was measured, more than 10 %",), ()),
    ([SURE], 0.05, None, ("it is made of glass",), "q1", "", "", ("it is made of glass",), ()),
    ([SURE, POOR], 0.05, None, (), "q1", "q4", "", ("without noise, torques in motion miss q4 21 %",), ()),
    ([SURE, NOISY], 0.05, None, (), "q1", "", "q2", (), ()),
    ([NOISY], 0.05, None, (), "", "", "q2", ("cannot judge it: noise is as large as the torques of q2",), ()),
    ([STICKY], 0.05, None, (), "q3", "", "", (), ("q3 is predicted within 40 % only, most of it from static",)),
    ([STICKY], 0.4, 0.04, (), "q3", "", "", (), ("q3 is predicted within 40 % only",)),
    ([SURE], 0.04, 0.001, (), "q1", "", "", (), (f"is 40 {TRAINED}this log is",)),
    ([SURE], 0.06, 0.001, (), "q1", "", "", (f"is 60 {TRAINED}the result does not generalise",), ()),
)  # fmt: skip


def test_a_log_of_fewer_rows_is_low_passed_lower(training: Log) -> None:
    result = found(TASK, training, recipe=Recipe(cutoff=30.0))
    judged = verify(result, played(three_joints(4), 3, 50.0, 4.0, source="SLOW")).verdict
    assert judged.holds
    assert "low-passed at 17.5 Hz, since this log has fewer rows" in judged.remarks[-1]


def test_rows_of_slow_drives_that_were_left_out_are_not_judged(training: Log, other: Log) -> None:
    results = (found(TASK, training, recipe=Recipe(standstill=v)) for v in (0.0, 1.0))
    every, fast = (verify(result, other, tolerances=Tolerances(torque=1e-4)) for result in results)
    assert max(t.standstill for t in every.torques) < 0.2 < min(t.standstill for t in fast.torques)
    assert [" in motion" in v.verdict.answers[0] for v in (every, fast)] == [False, True]


def test_a_verdict_has_its_reasons() -> None:
    for pairs, total, known, doubts, confirmed, contradicted, undecided, reasons, remarks in CASES:
        whole = CorrectedError(0.0, np.nan, total, total)
        errors, alone = zip(*pairs, strict=True)
        v = verdict(errors, alone, total, whole, known, (), doubts, Tolerances())
        assert v.holds is (not reasons)
        assert [" ".join(part) for part in (v.confirmed, v.contradicted, v.undecided)] == [
            confirmed, contradicted, undecided,
        ]  # fmt: skip
        assert (len(v.against), len(v.remarks)) == (len(reasons), len(remarks))
        for given, expected in zip((*v.against, *v.remarks), (*reasons, *remarks), strict=True):
            assert expected in given


def test_the_text_of_a_verdict_holds_only_for_what_is_confirmed() -> None:
    some = Verdict(confirmed=("q1", "q2"), undecided=("q3",))
    assert some.text.startswith("The result predicts q1, q2 of this log: you can rely on it there for motions of this")
    assert "cannot judge q3" in some.text
    poor = Verdict(against=("torques differ",), confirmed=("q1",), contradicted=("q2",))
    assert poor.text == "Do not rely on the result: torques differ. Predictions of q1 hold."


def test_what_an_identification_doubts_counts(result: Identification, other: Log) -> None:
    doubt = Doubt("the bodies are made of glass", "nobody knows why", "look again")
    v = verify(replace(result, kept=replace(result.kept, doubts=(doubt,))), other)
    against(v, "the bodies are made of glass: nobody knows why")
    assert v.verdict.confirmed == ("q1", "q2", "q3")
    assert "bodies: no possible robot has these parameters: the bodies are made of glass" in v.verdict.answers


# ---------------------------------------------------------------- long logs


def test_how_many_windows_are_simulated() -> None:
    durations = (60.0, 60.0 + 1e-12, 60.001, 600.0, 600.0, 600.0, 600.0)
    horizons = (0.5, 0.5, 0.5, 0.5, 0.1, 2.0, 50.0)
    assert list(map(most_windows, durations, horizons)) == [None, None, 60, 60, 60, 15, 10]


def test_a_long_log_is_simulated_in_windows_all_over_it(result, monkeypatch) -> None:
    """A motion that repeats itself every 2 s, which is four windows."""
    log = noisy(played(three_joints(4), 3, 100.0, 80.0, source="LONG"), 0.3, 1e-5, 2)
    some = verify(result, log)
    monkeypatch.setattr("excite.verification.verify.most_windows", lambda duration, horizon: None)
    every = verify(result, log)
    starts, of = np.array(some.replay.starts), len(every.replay.starts)
    assert (len(starts), some.replay.left_out, every.replay.left_out) == (60, of - 60, 0)
    assert np.histogram(some.replay.time[starts], 10, (0.0, 80.0))[0].min() >= 5
    said = f"simulated motion: 60 of {of} windows of 0.5 s, spread evenly over the log; torques are predicted in all of"
    assert any(remark.startswith(said) for remark in some.verdict.remarks)
    assert not [remark for remark in every.verdict.remarks if remark.startswith("simulated motion: ")]
    assert json_of(some)["windows"] == {"simulated": 60, "of": of}
    assert (some.verdict.holds, some.torques, some.corrected) == (every.verdict.holds, every.torques, every.corrected)
    np.testing.assert_array_equal(some.predicted, every.predicted)
    np.testing.assert_array_equal(np.isfinite(every.replay.q), True)
    for one, other in zip(some.motions, every.motions, strict=True):
        assert one.error == pytest.approx(other.error, rel=0.1)
        assert one.travel == pytest.approx(other.travel, rel=0.03)
        assert 0.7 * other.worst < one.worst <= other.worst
