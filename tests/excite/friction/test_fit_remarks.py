"""What is said of friction curves, and friction that grows with the load that a drive carries."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from breakaway_ramps import away
from pinocchio_chains import chain_model
from refused import refusal

from excite.friction.breakaway_torque import mean_break_aways
from excite.friction.constant_speed_windows import FitSettings
from excite.friction.curve_fit import (
    CurveFit,
    alike_remarks,
    chosen_fit,
    fit,
    stiction_remarks,
    table_of,
    temperature_remarks,
    why_no_curve,
)
from excite.friction.friction_equations import Conditions, Form, forms
from excite.friction.friction_fit import Characteristic, characteristics
from excite.friction.points import Point, described_model
from excite.logs.log import Log
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Stribeck
from regressors.robot.friction.curves import Side
from regressors.robot.friction.load_and_temperature import Loaded

FIVE = np.array([0.05, 0.1, 0.2, 0.4, 0.8])
STRIBECK = Form("stribeck", True)


def windows(values: object, speeds: np.ndarray = FIVE, noise: float = 0.1, **more: object) -> list[Point]:
    """Windows in both directions."""
    v = np.r_[speeds, -speeds, speeds, -speeds]
    tau = values(v) + np.random.default_rng(0).normal(0.0, noise, v.size)
    return [Point(x, y, noise, 0.0, 0.3, 0, **more) for x, y in zip(v.tolist(), tau.tolist(), strict=True)]


def curve(v: np.ndarray) -> np.ndarray:
    return STRIBECK.values(np.array([9.0, 20.0, 14.0, 0.15, 0.0]), Conditions.of(v))[0]


def remarks(best: CurveFit, rests: int, settings: FitSettings | None = None) -> list[str]:
    return stiction_remarks(rests, (), best, settings or FitSettings(), "0.05 rad/s", alone=False)


def test_stiction_that_no_break_away_shows_is_extrapolated() -> None:
    best = fit(windows(curve), STRIBECK)
    said = "the curve has no break-away torques: stiction is extrapolated below 0.05 rad/s"
    assert remarks(best, 0) == [said]
    assert said not in remarks(best, 2)
    assert remarks(fit(windows(curve), Form("plain")), 0) == []


def test_forms_that_are_as_likely_are_named() -> None:
    best, others, _ = chosen_fit(windows(curve), forms("auto", None, offset=True), "bic")
    alike = [one.form.name for one in others if 0 < one.bic - best.bic < 2]
    (said,) = alike_remarks([best, replace(others[1], bic=best.bic + 1.9), *others[2:]], FitSettings())
    assert said.endswith("about as well: BIC differs by less than 2")
    assert all(name in said for name in (others[1].form.name, *alike))
    assert alike_remarks([best, *(replace(one, bic=best.bic + 2.1) for one in others[1:])], FitSettings()) == []


def test_one_cause_is_told_first() -> None:
    for values, speeds, message in (
        (curve, np.array([0.3]), "4 windows, all at one speed, 0.3 rad/s, .*make runs at more speeds"),
        (np.zeros_like, FIVE, "^20 windows, no friction above the noise: the mean torque against the motion is"),
        (lambda v: -curve(v), FIVE, "^20 windows, the mean torque is along the motion, -.* have the same sign"),
        (lambda v: np.sign(v) * 4.0 * np.abs(v) ** 2, FIVE, "no curve can be fitted: stribeck"),
    ):
        made = windows(values, speeds)
        best, _, failed = chosen_fit(made, forms("stribeck", None, offset=True), "bic")
        assert best is None
        said = why_no_curve(made, failed, "Nm", "rad/s")
        assert re.search(message, said)
        assert ("more speeds" in said) == (speeds.size == 1)


def test_a_table_over_temperature_is_not_that_of_one() -> None:
    """Windows of one log are told ten times better, and are not what the mean of a warm and a cold one is."""
    cold, warm = Point(0.1, 12.0, 0.01, 0.0, 0.3, 0, 20.0), Point(0.1, 8.0, 0.1, 0.0, 0.3, 1, 45.0)
    behind = Point(-0.1, -9.0, 0.1, 0.0, 0.3, 1, 45.0)
    assert table_of([cold, warm, behind]).friction.tolist() == [-9.0, 10.0]
    alike = table_of([cold, replace(warm, temperature=21.0), behind])
    assert alike.friction[1] == pytest.approx(12.0, abs=0.05)


@pytest.mark.parametrize("asymmetric", [False, True])
def test_means_of_break_aways_are_at_the_reference_temperature(asymmetric: bool) -> None:
    form = Form("warm", True, asymmetric, 1.0, True, 30.0)
    of = {"coulomb": 9.0, "viscous": 20.0, "stiction": 14.0, "stribeck": 0.1, "coulomb_temperature": -0.1}
    values = np.array([of.get(name.rsplit(".", 1)[-1], 0.0) for name in form.parameters])
    best = CurveFit(form, values, np.zeros((values.size, values.size)), 1.0, 2.6, 0.0, 0.0)
    at = Conditions(np.array([0.0, 0.0, -0.0]), np.array([1.0, 1.0, -1.0]), np.array([-10.0, 15.0, 15.0]), np.zeros(3))
    torque = form.values(values, at)[0]
    temperatures = (30.0 + at.temperature_rise).tolist()
    found = tuple(replace(away(x), temperature=w) for x, w in zip(torque.tolist(), temperatures, strict=True))
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


SPEEDS = np.concatenate([np.linspace(0.05, 0.8, 8), -np.linspace(0.05, 0.8, 8)])
CANDIDATES = tuple(form for load in (False, True) for form in forms("auto", None, offset=True, load=load))
PLAIN = CoulombViscous(12.0, 9.0, 0.4)


def points(curve: FrictionCurve) -> list[Point]:
    """Every speed under loads up to 120 Nm, what is measured written out."""
    rng, noise = np.random.default_rng(0), 0.05
    found = []
    for v in np.repeat(SPEEDS, 6):
        load = rng.uniform(0.0, 120.0)
        torque = float(curve.torque(v))
        if isinstance(curve, Loaded):
            torque += np.sign(v) * (curve.forward if v > 0 else curve.backward) * load
        found.append(Point(v, torque + rng.normal(0.0, noise), noise, 0.0, 0.3, 0, load=load))
    return found


def test_the_form_is_chosen_and_the_share_of_the_load_is_found_where_there_is_one() -> None:
    for curve, name in (
        (PLAIN, "coulomb-viscous"),
        (Stribeck(Side(20.0, 26.0), Side(14.0, 30.0)), "asymmetric coulomb-viscous"),
        (Stribeck(Side(20.0, 26.0, 30.0, 0.15, 2.0), offset=1.0), "stribeck (exponent 2)"),
        (Loaded(PLAIN, 0.06), "coulomb-viscous, linear in load"),
        (Loaded(Stribeck(Side(12.0, 9.0), Side(8.0, 11.0)), 0.05, 0.09), "asymmetric coulomb-viscous, linear in load"),
        (Loaded(Stribeck(Side(12.0, 9.0, 17.0, 0.2)), 0.05), "stribeck (exponent 2), linear in load"),
    ):
        best, others, _ = chosen_fit(points(curve), CANDIDATES, "bic")
        assert best.form.name == name
        assert best.bic == min(other.bic for other in others)
        assert isinstance(best.curve, Loaded) == isinstance(curve, Loaded)
        if isinstance(curve, Loaded):
            np.testing.assert_allclose(best.curve.shares, curve.shares, atol=2e-3)
        np.testing.assert_allclose(best.curve.torque(SPEEDS), curve.torque(SPEEDS), atol=0.15)


def test_a_curve_that_would_fall_on_beyond_the_data_is_none() -> None:
    falling = [replace(p, torque=float(np.sign(p.speed)) * (20.0 - 10.0 * abs(p.speed))) for p in points(PLAIN)]
    assert "reaches its bound" in refusal(fit, falling, forms("stribeck", 2.0, offset=True)[0])


# --- in logs ---------------------------------------------------------------------------------------------------------

ROBOT = built_in("ur10e")
LIFT = "shoulder_lift_joint"
TRUTH = Loaded(CoulombViscous(14.0, 21.0, 0.3), 0.06)


def lifted(curve: FrictionCurve, reach: float = 1.0) -> Log:
    """Shoulder lift at constant speeds about the upright arm; torques by Pinocchio, friction by hand."""
    rate, speeds = 250.0, []
    for v in (0.15, 0.3, 0.6):
        speeds += [v] * round(2 * reach * rate / v) + [-v] * round(2 * reach * rate / v)
    dz = np.array(speeds)
    z = -np.pi / 2 - reach + np.concatenate([[0.0], np.cumsum(dz)[:-1]]) / rate
    time, still = np.arange(z.size) / rate, np.zeros((z.size, 6))
    q, dq = still.copy(), still.copy()
    q[:, 1], dq[:, 1] = z, dz
    model = chain_model(ROBOT)
    data = model.createData()
    tau = np.array([pin.rnea(model, data, *state).copy() for state in zip(q, dq, still, strict=True)])
    carried = np.abs(tau[:, 1])
    share = curve.forward if isinstance(curve, Loaded) else 0.0
    tau[:, 1] += curve.torque(dz) + np.sign(dz) * share * carried
    tau += np.random.default_rng(0).normal(0.0, 0.3, tau.shape)
    return Log("run.csv", "", ROBOT.joint_names, time, q, effort=tau)


def fitted(log: Log, **settings: object) -> Characteristic:
    (one,) = characteristics(ROBOT, [log], FitSettings(**settings), described_model, (LIFT,))
    return one


@pytest.mark.slow
def test_a_log_shows_how_friction_grows_with_gravity() -> None:
    log = lifted(TRUTH)
    one = fitted(log)
    assert one.fit.form.name == "coulomb-viscous, linear in load"
    assert np.all(np.abs(one.fit.values - [14.0, 21.0, 0.06, 0.3]) < 1.3 * one.fit.halfwidth)
    assert any(re.match(r"the drive carries \S+ to \S+ Nm, and friction grows", note) for note in one.notes)
    assert not isinstance(fitted(log, load="none").curve, Loaded)
    assert isinstance(fitted(log, load="linear", model="coulomb-viscous").curve, Loaded)


def test_friction_that_does_not_grow_with_load_is_told() -> None:
    one = fitted(lifted(TRUTH.curve))
    assert not isinstance(one.curve, Loaded)
    assert "which does not change friction by BIC" in " ".join(one.notes)


def test_a_share_that_the_runs_cannot_show_is_refused() -> None:
    for reach, settings, words in (
        (0.08, {"load": "linear"}, "too small a range to fit friction over load; repeat the runs in poses"),
        (1.0, {"load": "linear", "gravity": "symmetric"}, "not known without a model"),
    ):
        assert re.search(words, refusal(fitted, lifted(TRUTH, reach), window=0.2, **settings))
