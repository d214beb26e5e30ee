"""Uncertain friction curves: their laws, their files, and those of fits."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import scipy.stats
from friction_curves import CURVES, KNOWN, TUSTIN, uncertain
from hypothesis import given, settings, strategies as st

from excite.friction.curve_fit import curve_uncertainty, fit
from excite.friction.friction_equations import Form
from excite.friction.points import Point
from excite.tasks.friction_file import friction_content, friction_of, friction_of_content, friction_text
from regressors.errors import UnknownName
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Scaled, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.robot.friction.uncertainty import CurveUncertainty, changed, curve_parameters
from regressors.samples import Array

ALIKE = Stribeck(Side(14.0, 26.0, 16.8, 0.05, 1.0))


# --- curves ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CURVES)
def test_every_parameter_that_is_named_changes_its_curve(name: str) -> None:
    curve = CURVES[name]
    v, direction = np.linspace(-0.5, 0.5, 40), np.sign(np.linspace(-0.5, 0.5, 40))
    for parameter in curve_parameters(curve):
        moved = changed(curve, {parameter: 0.01})
        assert type(moved) is type(curve)
        same = np.array_equal(moved.torque_at(v, 35.0, direction), curve.torque_at(v, 35.0, direction))
        assert same == parameter.startswith("load"), parameter
        back = changed(moved, {parameter: -0.01})
        np.testing.assert_allclose(back.torque_at(v, 35.0), curve.torque_at(v, 35.0), rtol=1e-12)


def test_a_parameter_without_a_side_is_that_of_both() -> None:
    assert changed(ALIKE, {"coulomb": 1.0}) == Stribeck(Side(15.0, 26.0, 16.8, 0.05, 1.0))
    assert changed(ALIKE, {"coulomb": 1.0, "backward.coulomb": -2.0, "offset": 0.5}) == Stribeck(
        Side(15.0, 26.0, 16.8, 0.05, 1.0), Side(13.0, 26.0, 16.8, 0.05, 1.0), 0.5
    )
    warm = Warm(ALIKE, 30.0, Slope(-0.1, 0.2), range=(20.0, 40.0))
    assert changed(warm, {"temperature.coulomb": 0.5}) == Warm(ALIKE, 30.0, Slope(0.4, 0.2), range=(20.0, 40.0))
    assert changed(Loaded(warm, 0.1), {"load": 0.1, "load.forward": 0.1}).shares == pytest.approx((0.3, 0.2))


NONE = ((TableFriction([0.1], [1.0]), "coulomb"), (Scaled(TUSTIN, 2.0), "forward.coulomb"), (TUSTIN, "load"))


@pytest.mark.parametrize(("curve", "parameter"), [*NONE, (CoulombViscous(1.0), "forward.coulomb")])
def test_parameters_that_a_curve_does_not_have(curve: FrictionCurve, parameter: str) -> None:
    with pytest.raises(UnknownName, match=f"parameter of the friction curve named '{parameter}'"):
        changed(curve, {parameter: 0.1})
    with pytest.raises(UnknownName, match=f"parameter of the friction curve named '{parameter}'"):
        FrictionCurves({"z1": curve}, {"z1": CurveUncertainty((parameter,), np.eye(1))})


def test_uncertainty_belongs_to_a_curve() -> None:
    with pytest.raises(UnknownName, match="friction curve named 'z2'; available: z1"):
        FrictionCurves({"z1": CoulombViscous(1.0)}, {"z2": KNOWN["z1"]})


SIDED = Warm(CoulombViscous(13.0, 9.0), 30.0, Slope(-0.1, 0.2), Slope(-0.3))  # of its own in each direction when warm
SIDES = uncertain(("coulomb", "temperature.backward.coulomb"), 4)
WITH_SIDED = FrictionCurves({**CURVES, "z4": SIDED}, {**KNOWN, "z4": SIDES})


@pytest.mark.parametrize("temperature", [None, 36.5])
@pytest.mark.parametrize("name", WITH_SIDED.curves)
def test_at_a_temperature_torques_are_as_uncertain_as_at_that_temperature_of_the_whole(
    name: str, temperature: float | None
) -> None:
    """Variances of the torque at some velocities by finite differences, of the curve and of that at a temperature."""
    held = WITH_SIDED.at({name: temperature})
    v = np.array([-0.3, -0.04, 0.02, 0.2])

    def torque(curve: FrictionCurve) -> Array:
        return curve.torque(v) if temperature is None else curve.torque_at(v, temperature)

    found = []
    for curve, known in ((of.curve(name), of.uncertainty[name]) for of in (WITH_SIDED, held)):
        ends = [[torque(changed(curve, {p: h})) for h in (1e-5, -1e-5)] for p in known.parameters]
        J = np.column_stack([ahead - behind for ahead, behind in ends])
        found.append(J / 2e-5 @ known.covariance @ J.T / 2e-5)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-5, atol=1e-12)


def test_curves_of_some_drives_keep_their_uncertainty_and_scaled_ones_do_not() -> None:
    whole = FrictionCurves(CURVES, KNOWN)
    assert dict(whole.of(("z3", "z9")).uncertainty) == {"z3": KNOWN["z3"]}
    assert not whole.scaled({"z1": 2.0}).uncertainty


# --- files -----------------------------------------------------------------------------------------------------------


def assert_alike(one: FrictionCurves, other: FrictionCurves) -> None:
    assert dict(one.curves) == dict(other.curves)
    assert list(one.uncertainty) == list(other.uncertainty)
    for name, known in one.uncertainty.items():
        assert known.parameters == other.uncertainty[name].parameters
        np.testing.assert_array_equal(known.covariance, other.uncertainty[name].covariance)


@given(st.integers(0, 10_000), st.floats(1e-9, 1e3))
@settings(max_examples=15, deadline=None)
def test_files_keep_every_number(seed: int, size: float) -> None:
    whole = FrictionCurves(CURVES, {name: uncertain(x.parameters, seed, size) for name, x in KNOWN.items()})
    assert_alike(friction_of(friction_text(whole), "again"), whole)
    assert_alike(friction_of_content(json.loads(json.dumps(friction_content(whole)))), whole)


# --- fits ------------------------------------------------------------------------------------------------------------


def measured(form: Form, curve: FrictionCurve, seed: int = 0) -> list[Point]:
    """Points of a curve at several temperatures, under several loads, with noise."""
    rng = np.random.default_rng(seed)
    speeds = (-0.6, -0.2, -0.08, -0.04, 0.05, 0.1, 0.3, 0.7)
    shares, found = curve.shares if isinstance(curve, Loaded) else (0.0, 0.0), []
    for v, T, load in product(speeds, (25.0, 36.0), (0.0, 9.0)):
        torque = float(curve.torque(v) if form.temperature is None else curve.torque_at(v, T))
        torque += (shares[0] if v > 0 else -shares[1]) * load + 0.05 * rng.normal()
        found.append(Point(v, torque, 0.05, 0.0, 0.3, 0, T, load))
    return found


@pytest.mark.parametrize("stribeck", [False, True])
@pytest.mark.parametrize("asymmetric", [False, True])
@pytest.mark.parametrize("more", [False, True])
def test_a_files_uncertainty_is_the_band_of_its_fit(stribeck: bool, asymmetric: bool, more: bool) -> None:
    """The variance of the torque by the file's parameters is that by the equation's own derivatives."""
    form = Form("form", stribeck, asymmetric, 1.0, not asymmetric, 30.0 if more else None, more)
    base: FrictionCurve = (TUSTIN if asymmetric else ALIKE) if stribeck else CoulombViscous(14.0, 26.0, 0.3)
    curve = Loaded(Warm(base, 30.0, Slope(-0.1, 0.2)), 0.05) if more else base
    one = fit(measured(form, curve), form)
    known = curve_uncertainty(one)
    drawn = FrictionCurves({"z1": one.curve}, {"z1": known})
    v, rise, load = np.array([-0.5, -0.03, 0.02, 0.06, 0.4]), 4.0 if more else 0.0, 7.0 if more else 0.0

    def torque(changes: dict[str, float]) -> Array:
        moved = changed(drawn.curve("z1"), changes)
        shares = moved.shares if isinstance(moved, Loaded) else (0.0, 0.0)
        return moved.torque_at(v, 30.0 + rise) + np.where(v > 0, shares[0], -shares[1]) * load

    steps = 1e-4 * known.deviation
    each = zip(known.parameters, steps, strict=True)
    J = np.column_stack([(torque({p: h}) - torque({p: -h})) / (2 * h) for p, h in each])
    half = 2.5758293 * np.sqrt(np.einsum("ij,jk,ik->i", J, known.covariance, J))
    np.testing.assert_allclose(half, one.band(v, rise, load)[1], rtol=1e-4)


def test_what_is_held_has_no_deviation_and_students_t_widens() -> None:
    one = fit(measured(Form("form"), CoulombViscous(9.0, 8.0)), Form("form"))
    wide = 2 * scipy.stats.norm.ppf(0.995)
    held = curve_uncertainty(replace(one, covariance=np.diag([0.04, 0.0, 0.01]), quantile=wide))
    np.testing.assert_allclose(held.deviation, [0.4, 0.0, 0.2])
