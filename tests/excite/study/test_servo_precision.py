"""Runs after which servos are known as precisely as asked for: what is promised, what is counted, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from servo_arm import JOINTS, small_arm, true_servos
from written_files import saved

import excite
from excite.design.design import Design
from excite.identification.servo_result import MotionFit, ServoResult
from excite.study import servo_precision
from excite.study.servo_precision import rehearsed, usual_servos
from excite.tasks.precision_target import PrecisionTarget
from regressors.errors import ExciteError
from regressors.models.servo_response import QUANTITIES, SYMBOLS
from regressors.readers.library import built_in

OPTIONS: dict[str, Any] = {"model": "servo", "period": 5.0, "harmonics": 6, "starts": 1, "seed": 0}


def known() -> ServoResult:
    fits = tuple(MotionFit(name, "rad", 5e-4, 0.1, 0.05, 0.03, 1e-3, 1.0) for name in JOINTS)
    return replace(true_servos(), fits=fits)


def designed(**options: Any) -> Design:
    return excite.design_trajectory(small_arm(), **{**OPTIONS, **options})


def stand_in(monkeypatch: pytest.MonkeyPatch, identify: Any) -> None:
    """Servos that follow at once, and an identification whose intervals are known."""
    monkeypatch.setattr(servo_precision, "followed", lambda servos, command, *_: command)
    monkeypatch.setattr(servo_precision, "identify_servos", identify)


def identified(half: float, **infinite: tuple[int, ...]) -> Any:
    """Stands for an identification: intervals of a share of the values for the first log, as its length says after."""

    def identify(robot: Any, log: Any) -> ServoResult:
        values = known().values
        width = half * np.abs(values) * math.sqrt(60.0 / log.duration)
        ratios = width / values[:, :1]
        for symbol, joints in infinite.items():
            width[list(joints), SYMBOLS.index(symbol)] = np.inf
        return ServoResult(robot, values, width, (), (), 0, ratio_half_width=ratios)

    return identify


def test_runs_are_doubled_until_the_intervals_are_narrow_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch, identified(0.1))
    design = rehearsed(designed(servos=known(), stops=False), PrecisionTarget(0.11))
    found, search = design.precision, design.precision_search
    assert found is not None
    least = 60.0 * (1.7 * 0.1 / 0.11) ** 2  # seconds of motion
    assert found.robot_seconds == 5.0 * found.runs == 240.0
    assert least / 2 < 120.0 < least < found.robot_seconds
    assert found.met
    assert found.worst.use == pytest.approx(math.sqrt(least / found.robot_seconds), rel=0.01)
    assert search is not None
    assert [runs for runs, _ in search.trials[0].course] == [6, 12, 24, 48]
    wider = rehearsed(designed(servos=known(), stops=False), PrecisionTarget(0.04)).precision
    assert wider is not None
    assert not wider.met
    assert wider.runs == found.runs


def test_ratios_count_where_no_mass_shows_the_scale_and_limits_that_are_not_reached_do_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    no_scale = dict.fromkeys(("K", "D", "J", "Fc", "Fs", "L"), (2,))
    stand_in(monkeypatch, identified(0.1, **{**no_scale, "L": (1, 2)}))
    design = rehearsed(designed(servos=known(), stops=False), PrecisionTarget(0.2))
    assert design.precision is not None
    asked = {p.name: p for p in design.precision.parameters if p.allowed is not None}
    assert {"stiffness lift", "torque limit lift", "stiffness elbow", "delay roll"} <= set(asked)
    assert not {"torque limit elbow", "stiffness roll", "damping roll"} & set(asked)
    ratio = asked["damping over stiffness roll"]
    values = known().values[2]
    assert ratio.allowed == pytest.approx(0.2 * values[SYMBOLS.index("D")] / values[0])
    assert ratio.unit == "s"
    assert any(note.startswith("roll: too little load by known masses") for note in design.notes)
    assert any(note.startswith("elbow: the torque limit is not reached") for note in design.notes)


def test_what_is_named_counts_even_where_it_is_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch, identified(0.1, K=(2,)))
    design = rehearsed(designed(servos=known(), stops=False), PrecisionTarget(None, parameters={"K": 0.2}))
    found = design.precision
    assert found is not None
    assert not found.met
    assert [p.name for p in found.too_wide] == ["stiffness roll"]
    assert found.robot_seconds <= 600.0


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "groups": ({"precision": {"groups": {"friction": 0.1}}}, "no groups"),
    "a level": ({"precision": {"share": 0.1, "level": 0.9}}, "level"),
    "no such quantity": ({"precision": {"parameters": {"X5": 0.1}}}, "quantity of a servo"),
}


@pytest.mark.parametrize(("options", "message"), BAD.values(), ids=BAD)
def test_what_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ExciteError, match=message):
        excite.design_for_precision(small_arm(), **OPTIONS, **options)


def test_usual_servos_have_the_stated_torque_and_speed() -> None:
    robot = built_in("so101")
    values = dict(zip(SYMBOLS, usual_servos(robot).T, strict=True))
    np.testing.assert_allclose(values["L"], robot.limits.torque)
    np.testing.assert_allclose(values["L"] / values["D"], robot.limits.velocity)
    for quantity in QUANTITIES:
        assert (values[quantity.symbol] >= quantity.least).all()
    unlimited = robot.replace(limits=replace(robot.limits, torque=np.full(robot.n, np.inf)))
    assert np.isfinite(usual_servos(unlimited)).all()


@pytest.mark.slow
def test_a_rehearsal_keeps_its_promise_and_is_read_again(tmp_path: Path) -> None:
    target = PrecisionTarget(None, parameters={"K": 0.2, "D": 0.2})
    design = excite.design_for_precision(small_arm(), target, servos=known(), joints=("lift", "elbow"), **OPTIONS)
    found = design.precision
    assert found is not None
    assert found.met
    loaded = excite.load_design(saved(tmp_path, design))
    assert loaded.precision == found
    assert loaded.precision_search.trials[0].runs >= found.runs
