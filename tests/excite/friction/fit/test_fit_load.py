"""Friction that grows with load is found from windows in which the drive carries more and less."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_chains import chain_model

from excite.friction.fit.curve_fit import chosen_fit, fit
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.friction_equations import forms
from excite.friction.fit.friction_fit import Characteristic, characteristics
from excite.friction.fit.points import Point, described_model
from excite.logs.log import Log
from regressors.errors import InputError
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Stribeck
from regressors.robot.friction.curves import Side
from regressors.robot.friction.load_and_temperature import Loaded

SPEEDS = np.concatenate([np.linspace(0.05, 0.8, 8), -np.linspace(0.05, 0.8, 8)])
CANDIDATES = tuple(form for load in (False, True) for form in forms("auto", None, offset=True, load=load))
PLAIN = CoulombViscous(12.0, 9.0, 0.4)


def points(curve: FrictionCurve, seed: int = 0, noise: float = 0.05) -> list[Point]:
    """Every speed under loads up to 120 Nm, what is measured written out."""
    rng = np.random.default_rng(seed)
    found = []
    for v in np.repeat(SPEEDS, 6):
        load = rng.uniform(0.0, 120.0)
        torque = float(curve.torque(v))
        if isinstance(curve, Loaded):
            torque += np.sign(v) * (curve.forward if v > 0 else curve.backward) * load
        found.append(Point(v, torque + rng.normal(0.0, noise), noise, 0.0, 0.3, 0, load=load))
    return found


@pytest.mark.parametrize(
    ("curve", "name"),
    [
        (PLAIN, "coulomb-viscous"),
        (Loaded(PLAIN, 0.06), "coulomb-viscous, linear in load"),
        (
            Loaded(Stribeck(Side(12.0, 9.0), Side(8.0, 11.0)), 0.05, 0.09),
            "asymmetric coulomb-viscous, linear in load",
        ),
        (Loaded(Stribeck(Side(12.0, 9.0, 17.0, 0.2)), 0.05), "stribeck (exponent 2), linear in load"),
    ],
)
def test_the_share_of_the_load_is_found_where_there_is_one(curve: FrictionCurve, name: str) -> None:
    best, others, _ = chosen_fit(points(curve), CANDIDATES, "bic")
    assert best.form.name == name
    assert best.bic == min(other.bic for other in others)
    assert isinstance(best.curve, Loaded) == isinstance(curve, Loaded)
    if isinstance(curve, Loaded):
        np.testing.assert_allclose(best.curve.shares, curve.shares, atol=2e-3)
    np.testing.assert_allclose(best.curve.torque(SPEEDS), curve.torque(SPEEDS), atol=0.15)


def test_a_curve_that_would_fall_on_beyond_the_data_is_none() -> None:
    falling = [replace(p, torque=float(np.sign(p.speed)) * (20.0 - 10.0 * abs(p.speed))) for p in points(PLAIN)]
    with pytest.raises(InputError, match="reaches its bound"):
        fit(falling, forms("stribeck", 2.0, offset=True)[0])


# --- in logs ---------------------------------------------------------------------------------------------------------

ROBOT = built_in("ur10e")
LIFT = "shoulder_lift_joint"
TRUTH = Loaded(CoulombViscous(14.0, 21.0, 0.3), 0.06)


def run(curve: FrictionCurve, reach: float = 1.0) -> Log:
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
    log = run(TRUTH)
    one = fitted(log)
    assert one.fit.form.name == "coulomb-viscous, linear in load"
    assert np.all(np.abs(one.fit.values - [14.0, 21.0, 0.06, 0.3]) < 1.3 * one.fit.halfwidth)
    assert any(re.match(r"the drive carries \S+ to \S+ Nm, and friction grows", note) for note in one.notes)
    assert not isinstance(fitted(log, load="none").curve, Loaded)
    assert isinstance(fitted(log, load="linear", model="coulomb-viscous").curve, Loaded)


def test_friction_that_does_not_grow_with_load_is_told() -> None:
    one = fitted(run(TRUTH.curve))
    assert not isinstance(one.curve, Loaded)
    assert "which does not change friction by BIC" in " ".join(one.notes)


@pytest.mark.parametrize(
    ("reach", "settings", "words"),
    [
        (0.08, {"load": "linear"}, "too small a range to fit friction over load; repeat the runs in poses"),
        (1.0, {"load": "linear", "gravity": "symmetric"}, "not known without a model"),
    ],
)
def test_a_share_that_the_runs_cannot_show_is_refused(reach: float, settings: dict[str, str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        fitted(run(TRUTH, reach), window=0.2, **settings)
