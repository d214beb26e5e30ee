"""Servos identified from commands and positions alone: what MuJoCo was told, what is refused, and the file."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refused import refusal
from servo_arm import JOINTS, URDF, identified_servos, plant, played, servo_log, small_arm, true_servos, truth
from written_files import assert_alike

import excite
from excite.identification.servo_result import MotionFit, ServoResult, load_servos, motion_fits
from excite.identification.servo_windows import servo_motion, windows_in
from excite.identification.servos import identify_servos
from excite.logs.log import Log, LogReference
from regressors.models.servo_response import QUANTITIES, RATIOS, SYMBOLS
from regressors.readers.library import built_in

LOADED, ROLL = slice(0, 2), 2


@pytest.mark.slow
def test_servos_of_loaded_joints_are_what_mujoco_was_told() -> None:
    result, told = identified_servos(), truth()
    for symbol in ("K", "D", "J", "Fc"):
        np.testing.assert_allclose(result.of(symbol)[LOADED], getattr(told, symbol)[LOADED], rtol=0.1, err_msg=symbol)
    np.testing.assert_allclose(result.of("d"), told.d, atol=3e-3)
    np.testing.assert_allclose(result.of("b"), -told.b, atol=2e-3)  # the drive adds it to what the encoder measures
    assert not result.doubts
    for fit in result.fits:
        assert fit.position_error < fit.step < fit.delayed_error / 3
    # and a torque limit that no motion reaches is not claimed
    assert np.isinf(result.half_width[:, SYMBOLS.index("L")]).all()
    assert all(not each["torque limit"]["half_width"] < np.inf for each in result.stated.values())


@pytest.mark.slow
def test_a_joint_that_no_mass_loads_shows_only_ratios_and_is_said_to() -> None:
    result, told = identified_servos(), truth()
    scales = np.array([q.scales for q in QUANTITIES])
    assert np.isinf(result.half_width[ROLL, scales]).all()
    assert not result.known[ROLL, scales].any()
    assert np.isfinite(result.half_width[LOADED, : SYMBOLS.index("L")]).all()
    assert [note for note in result.notes if note.startswith("roll: ") and "only the ratios are shown" in note]
    assert not any(name in note for note in result.notes for name in JOINTS[:ROLL])
    (ratios, half), symbols = result.ratios, [SYMBOLS[k] for k in RATIOS]
    for symbol in ("D", "J", "Fc"):
        ratio, width = (each[ROLL, symbols.index(symbol)] for each in (ratios, half))
        true_ratio = getattr(told, symbol)[ROLL] / told.K[ROLL]
        assert ratio == pytest.approx(true_ratio, rel=0.15), symbol
        assert abs(ratio - true_ratio) <= width, symbol
    assert result.known_ratios[ROLL, symbols.index("D")]


@pytest.mark.slow
def test_a_known_mass_in_hand_shows_the_scale_of_a_joint_that_nothing_loads(tmp_path: Path) -> None:
    held, told = (0.2, 0.02, 0.1, 0.0), truth()
    (tmp_path / "small.urdf").write_text(URDF, encoding="utf-8")
    payload = excite.Installation(payload=held)
    result = identify_servos(str(tmp_path / "small.urdf"), servo_log(0, held=held), installation=payload)
    for symbol in ("K", "D"):
        assert result.of(symbol)[ROLL] == pytest.approx(getattr(told, symbol)[ROLL], rel=0.1), symbol
    assert result.known[ROLL, [SYMBOLS.index(symbol) for symbol in ("K", "D", "Fc")]].all()
    assert not any("only the ratios are shown" in note for note in result.notes)


@pytest.mark.slow
def test_torque_limits_that_few_rows_reach_are_found() -> None:
    reached = (1.8, 0.8, 4.0)
    result = identify_servos(small_arm(), servo_log(0, limits=reached))
    np.testing.assert_allclose(result.of("L")[LOADED], reached[:ROLL], rtol=0.05)
    np.testing.assert_allclose(result.of("K")[LOADED], truth().K[LOADED], rtol=0.02)
    for symbol in ("K", "D", "J", "Fc"):
        half = result.half_width[LOADED, SYMBOLS.index(symbol)]
        assert (np.abs(result.of(symbol) - getattr(truth(), symbol))[LOADED] <= half).all(), symbol


@pytest.mark.slow
def test_a_log_in_which_the_arm_mostly_rests_is_fitted_where_it_moves() -> None:
    rng, told = np.random.default_rng(1), truth()
    log = played(plant().resting(rng, 3, 120.0, np.zeros(3), (6.0, 10.0)), "rests")
    moves = np.diff(log.q, axis=0, prepend=log.q[:1]) != 0
    assert moves.mean() < 0.15
    log = replace(log, q=log.q + 0.004 * moves * np.sin(7.0 * log.time)[:, None])  # what no servo does, of moving ones
    result = identify_servos(small_arm(), log)
    for symbol in ("K", "D"):
        np.testing.assert_allclose(result.of(symbol)[LOADED], getattr(told, symbol)[LOADED], rtol=0.05, err_msg=symbol)


@pytest.mark.slow
def test_identified_again_it_is_the_same_whatever_the_order_of_columns() -> None:
    log, result = servo_log(0), identified_servos()
    turned = replace(log, joints=log.joints[::-1], q=log.q[:, ::-1], command=log.command[:, ::-1])
    np.testing.assert_array_equal(identify_servos(small_arm(), turned).values, result.values)


# --- what is refused -------------------------------------------------------------------------------------------------


def short_log(rows: int = 1500, joints: tuple[str, ...] = JOINTS) -> Log:
    q = np.zeros((rows, len(joints)))
    return Log("LOG", "", joints, np.arange(rows) / 50, q, command=q)


def test_logs_that_show_no_servo_and_coupled_drives_are_refused() -> None:
    for log, words in (
        (replace(short_log(), command=None), r"LOG has no commanded positions, .* columns NAME\.command"),
        (short_log(500), r"LOG: 4 windows of 2 s without a gap are too few for the 10 unknowns of each servo; give"),
        (short_log(4), "4 rows without a gap are too few; a servo needs 7 or more"),
        (short_log(joints=("lift", "elbow", "wrist")), r"LOG.*roll"),
        ([short_log(), short_log()], "has the same content as LOG; give each log once"),
    ):
        assert re.search(words, refusal(identify_servos, small_arm(), log))
    irp6 = built_in("irp6")
    assert "irp6" in refusal(identify_servos, irp6, short_log(joints=irp6.joint_names))


def test_windows_keep_clear_of_gaps() -> None:
    log = short_log(3000)
    late = replace(log, time=log.time + 0.5 * (np.arange(3000) >= 1234))
    places = windows_in([servo_motion(late, small_arm())])
    first, last = places.first - places.lead - places.settle, places.first + places.count - 1
    assert not ((first < 1234) & (last >= 1234)).any()
    assert len(places.first) > 20


# --- errors beside those of the command, and the file ----------------------------------------------------------------


def test_the_command_with_the_best_delay_is_what_a_servo_is_measured_by() -> None:
    time = np.arange(400) / 50
    command = np.column_stack([np.sin(3 * time), 0 * time])
    q = np.column_stack([np.sin(3 * np.maximum(time - 0.1, 0.0)), 0 * time])
    log = Log("LOG", "", ("a", "b"), time, q, command=command)
    path = q + np.array([0.01, 0.0])
    path[:50] = np.nan
    moving, still = motion_fits([(log, path)], ("rad", "m"))
    assert (moving.joint, moving.unit, still.unit) == ("a", "rad", "m")
    assert moving.position_error == pytest.approx(0.01)
    assert 0.08 < moving.delay <= 0.1  # a command holds until the next one
    assert moving.delayed_error == pytest.approx(0.0, abs=1e-12)
    assert moving.command_error == pytest.approx(np.sqrt(np.mean((command[50:, 0] - q[50:, 0]) ** 2)))
    assert moving.moves
    assert not moving.better
    assert not still.moves


def test_a_file_holds_the_same_record_bit_for_bit(tmp_path: Path) -> None:
    half = np.random.default_rng(0).uniform(0.0, 1.0, (3, len(QUANTITIES)))
    half[1, 2:5] = np.inf
    fit = MotionFit("lift", "rad", 1 / 3, 0.1, 0.07, 0.065, 2 * np.pi / 4096, 1.1)
    logs = (LogReference("log.csv", "ab" * 32, ("3 rows with NaN",)),)
    told: dict[str, Any] = {"fits": (fit,), "logs": logs, "windows": 28, "notes": ("a note",), "doubts": ("one",)}
    given: dict[str, Any] = {"half_width": half, "ratio_half_width": 0.01 * half, "provenance": {"seed": 0}, **told}
    result = replace(true_servos(), values=true_servos().values / 3, **given)
    (path,) = result.save(tmp_path / "servos")
    assert path.name == "servos.json"
    for loaded in (load_servos(tmp_path / "servos"), load_servos(path), excite.load(path)):
        assert isinstance(loaded, ServoResult)
        assert_alike(loaded, result)
    stated = json.loads(path.read_text(encoding="utf-8"))["servos"]
    assert stated["lift"]["stiffness"]["value"] == 5.0
    assert stated["elbow"]["delay"] == {"value": 0.022 / 3, "half_width": half[1, 7], "unit": "s", "symbol": "d"}
    of_damping = {"value": result.values[1, 1] / result.values[1, 0], "half_width": 0.01 * half[1, 1], "unit": "s"}
    assert stated["elbow"]["damping"]["over_stiffness"] == of_damping
    assert "servos" in refusal(result.save, tmp_path / "servos")
    result.save(tmp_path / "servos", replace=True)


def test_servos_of_the_first_schema_are_read_without_their_limits_of_torque(tmp_path: Path) -> None:
    (path,) = true_servos().save(tmp_path / "servos")
    text = path.read_text(encoding="utf-8")
    assert '"excite.servos/2"' in text
    (older := tmp_path / "servos.json").write_text(text.replace("excite.servos/2", "excite.servos/1"), encoding="utf-8")
    old = load_servos(older)
    assert np.isinf(old.torque_limit).all()
    assert np.isinf(old.speed_limit).all()
    np.testing.assert_array_equal(old.values[:, :-1], true_servos().values[:, :-1])
    assert "identify again where a servo reaches its limit" in old.notes[-1]
