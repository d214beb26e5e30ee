"""Servos verified on a motion of MuJoCo: the truth holds, half the stiffness does not, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refused import refusal
from servo_arm import JOINTS, servo_log, true_servos
from written_files import assert_alike

import excite
from excite.identification.servo_result import ServoResult
from excite.logs.log import Log, LogReference
from excite.verification.verify_servos import ServoVerification, verify_servos
from regressors.errors import InputError
from regressors.models.servo_response import SYMBOLS


def other() -> Log:
    """A motion that no servo was identified from."""
    return servo_log(1, 12.0)


def with_changed(result: ServoResult, symbol: str, factor: float) -> ServoResult:
    values = result.values.copy()
    values[:, SYMBOLS.index(symbol)] *= factor
    return replace(result, values=values)


def test_true_servos_predict_a_motion_within_the_step_of_the_encoder_and_a_file_holds_all_of_it(tmp_path: Path) -> None:
    verification = verify_servos(true_servos(), other())
    assert verification.holds
    assert verification.confirmed == JOINTS
    assert "lift, elbow, roll predict this motion" in verification.verdict
    for fit in verification.fits:
        assert fit.position_error < fit.step
    assert np.abs(verification.predicted - verification.measured).max() < 10 * verification.fits[0].step
    (path,) = (each for each in verification.save(tmp_path) if each.suffix == ".json")
    assert path.name == "verification-log-1.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    assert content["position_error"] == {fit.joint: fit.position_error for fit in verification.fits}
    assert content["holds"] is True
    stored = verification.stored()
    path = next(each for each in stored.save(tmp_path, name="mine") if each.suffix == ".json")
    loaded = excite.load(path)
    assert isinstance(loaded, ServoVerification)
    assert_alike(loaded, stored)
    assert loaded.verdict == verification.verdict


def test_with_half_the_stiffness_the_command_alone_predicts_better() -> None:
    verification = verify_servos(with_changed(true_servos(), "K", 0.5), other())
    assert not verification.holds
    assert set(verification.contradicted) >= {"elbow", "roll"}
    assert verification.verdict.startswith("Do not rely on the servo of ")
    values = true_servos().values.copy()
    values[2] = with_changed(true_servos(), "K", 0.5).values[2]
    of_one = verify_servos(replace(true_servos(), values=values), other())
    assert (of_one.confirmed, of_one.contradicted) == (JOINTS[:2], JOINTS[2:])
    assert not of_one.holds  # one servo that is wrong is enough


@pytest.mark.slow
def test_a_change_of_any_quantity_that_the_motion_shows_makes_it_worse() -> None:
    best = verify_servos(true_servos(), other()).fits
    for symbol, factor in (("K", 1.2), ("D", 0.8), ("J", 3.0), ("Fc", 2.0), ("d", 0.5), ("L", 0.2)):
        changed = verify_servos(with_changed(true_servos(), symbol, factor), other()).fits
        assert changed[0].position_error > 1.2 * best[0].position_error, symbol


def test_a_joint_that_rests_is_not_judged_and_alone_shows_nothing() -> None:
    log = other()
    verification = verify_servos(true_servos(), replace(log, q=0 * log.q, command=0 * log.q))
    assert verification.undecided == JOINTS
    assert not verification.holds
    assert verification.verdict == "Nothing is shown: no joint moves enough in this log"


def test_a_log_that_servos_were_identified_from_is_refused_unless_allowed() -> None:
    log = other()
    trained = replace(true_servos(), logs=(LogReference(log.source, log.identity, ()),))
    with pytest.raises(InputError, match=r"log-1 is a log that the servos were identified from: .*`training_too`"):
        verify_servos(trained, log)
    assert verify_servos(trained, log, training_too=True).holds
    assert "has no commanded positions" in refusal(verify_servos, trained, replace(log, command=None))


def test_after_a_gap_the_simulation_starts_again_as_measured() -> None:
    log = other()
    kept = np.flatnonzero((log.time < 5.0) | (log.time >= 6.0))
    verification = verify_servos(true_servos(), log.rows(kept))
    again = int(np.flatnonzero(verification.time >= 6.0)[0])
    np.testing.assert_array_equal(verification.predicted[[0, again]], verification.measured[[0, again]])
