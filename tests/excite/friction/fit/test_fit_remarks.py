"""What is said of friction curves: where they are extrapolated, which others are as likely, why there is none."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from excite.friction.fit.breakaway_torque import BreakAway, mean_break_aways
from excite.friction.fit.curve_fit import CurveFit, NoCurve, chosen_fit, fit, table_of
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.friction_equations import Conditions, Form, forms
from excite.friction.fit.friction_fit import Characteristic
from excite.friction.fit.points import Point
from excite.friction.fit.remarks import alike_remarks, stiction_remarks, temperature_remarks, why_no_curve

SPEEDS = np.array([0.05, 0.1, 0.2, 0.4, 0.8])
STRIBECK = Form("stribeck", True)


def points(values: object, speeds: np.ndarray = SPEEDS, noise: float = 0.1, **more: object) -> list[Point]:
    """Windows in both directions."""
    v = np.r_[speeds, -speeds, speeds, -speeds]
    tau = values(v) + np.random.default_rng(0).normal(0.0, noise, v.size)
    return [Point(x, y, noise, 0.0, 0.3, 0, **more) for x, y in zip(v.tolist(), tau.tolist(), strict=True)]


def curve(v: np.ndarray) -> np.ndarray:
    return STRIBECK.values(np.array([9.0, 20.0, 14.0, 0.15, 0.0]), Conditions.of(v))[0]


def remarks(best: CurveFit, rests: int, settings: FitSettings | None = None) -> list[str]:
    return stiction_remarks(rests, (), best, settings or FitSettings(), points(curve), "rad/s", alone=False)


def test_stiction_that_no_break_away_shows_is_extrapolated() -> None:
    best = fit(points(curve), STRIBECK)
    said = "the curve has no break-away torques: stiction is extrapolated below 0.05 rad/s"
    assert remarks(best, 0) == [said]
    assert said not in remarks(best, 2)
    assert remarks(fit(points(curve), Form("plain")), 0) == []


def test_forms_that_are_as_likely_are_named() -> None:
    best, others, _ = chosen_fit(points(curve), forms("auto", None, offset=True), "bic")
    values = [one.bic - best.bic for one in others]
    alike = [one.form.name for one, x in zip(others, values, strict=True) if 0 < x < 2]
    (said,) = alike_remarks([best, replace(others[1], bic=best.bic + 1.9), *others[2:]], FitSettings()) or [""]
    assert others[1].form.name in said
    assert said.endswith("about as well: BIC differs by less than 2")
    assert all(name in said for name in alike)
    assert alike_remarks([best, *(replace(one, bic=best.bic + 2.1) for one in others[1:])], FitSettings()) == []


@pytest.mark.parametrize(
    ("values", "speeds", "message"),
    [
        (curve, np.array([0.3]), "4 windows, all at one speed, 0.3 rad/s, .*make runs at more speeds"),
        (np.zeros_like, SPEEDS, "^20 windows, no friction above the noise: the mean torque against the motion is"),
        (lambda v: -curve(v), SPEEDS, "^20 windows, the mean torque is along the motion, -.* have the same sign"),
        (lambda v: np.sign(v) * 4.0 * np.abs(v) ** 2, SPEEDS, "no curve can be fitted: stribeck"),
    ],
)
def test_one_cause_is_told_first(values: object, speeds: np.ndarray, message: str) -> None:
    made = points(values, speeds)
    with pytest.raises(NoCurve) as error:
        chosen_fit(made, forms("stribeck", None, offset=True), "bic")
    said = why_no_curve(made, error.value.failed, "Nm", "rad/s")
    assert re.search(message, said)
    assert ("more speeds" in said) == (speeds.size == 1)


def test_a_table_over_temperature_is_not_that_of_one() -> None:
    """Windows of one log are told ten times better, and are not what the mean of a warm and a cold one is."""
    cold, warm = Point(0.1, 12.0, 0.01, 0.0, 0.3, 0, 20.0), Point(0.1, 8.0, 0.1, 0.0, 0.3, 1, 45.0)
    behind = Point(-0.1, -9.0, 0.1, 0.0, 0.3, 1, 45.0)
    assert table_of([cold, warm, behind]).friction.tolist() == [-9.0, 10.0]
    alike = table_of([cold, replace(warm, temperature=21.0), behind])
    assert alike.friction[1] == pytest.approx(12.0, abs=0.05)


def away(torque: float, temperature: float) -> BreakAway:
    return BreakAway(1 if torque > 0 else -1, torque, 0.1, 1.0, 5.0, 0, temperature)


@pytest.mark.parametrize("asymmetric", [False, True])
def test_means_of_break_aways_are_at_the_reference_temperature(asymmetric: bool) -> None:
    form = Form("warm", True, asymmetric, 1.0, True, 30.0)
    of = {"coulomb": 9.0, "viscous": 20.0, "stiction": 14.0, "stribeck": 0.1, "coulomb_temperature": -0.1}
    values = np.array([of.get(name.rsplit(".", 1)[-1], 0.0) for name in form.parameters])
    best = CurveFit(form, values, np.zeros((values.size, values.size)), 1.0, 2.6, 0.0, 0.0)
    at = Conditions(np.array([0.0, 0.0, -0.0]), np.array([1.0, 1.0, -1.0]), np.array([-10.0, 15.0, 15.0]), np.zeros(3))
    torque = form.values(values, at)[0]
    found = tuple(away(x, 30.0 + w) for x, w in zip(torque.tolist(), at.temperature_rise.tolist(), strict=True))
    one = Characteristic("z1", "Nm", "none", (), (), best, (best,), {}, found, ())
    ahead, behind = mean_break_aways(one.break_aways)
    assert (ahead.torque, behind.torque) == pytest.approx((14.0, -14.0))
    assert one.stiction[0].torque == pytest.approx(15.0)
    said = temperature_remarks("20 to 45 deg C", 30.0, best, FitSettings(), found)
    assert said[0].endswith("mean break-away torques are converted to it")
    plain = replace(best, form=replace(form, temperature=None))
    assert replace(one, fit=plain).break_aways == found
    said = temperature_remarks("20 to 45 deg C", 30.0, plain, FitSettings(), found)
    assert said[1] == "mean break-away torques are from 20 to 45 deg C"
