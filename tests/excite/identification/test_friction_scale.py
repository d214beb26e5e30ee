"""Known friction times one fitted factor for each drive."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from played import EXACT, TASK, curves, described, found, noisy, played, three_joints

from excite.identification.allowances import friction_columns
from excite.identification.estimator import Context
from excite.identification.known_friction import without_friction
from excite.identification.result_json import load_result, result_content
from excite.logs.log import Log
from excite.tasks.friction_file import friction_of, friction_text
from regressors.errors import InputError
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Scaled, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.robot.friction.uncertainty import multiplied

RECIPE = replace(EXACT, sign_width=0.0, friction_scale=True)
FACTORS = {"z1": 0.8, "z3": 1.25}
STATED = FrictionCurves({name: multiplied(curves()[name], 1 / factor) for name, factor in FACTORS.items()})


@pytest.fixture(scope="module")
def log() -> Log:
    return played(three_joints(), 3)


def test_planted_factors_come_back_with_the_parameters(log: Log, tmp_path: Path) -> None:
    result = found(TASK, log, recipe=RECIPE, friction=STATED)
    assert result.friction_scale is not None
    assert result.friction_scale.factors == pytest.approx(FACTORS, rel=1e-9)
    assert result.estimate.names[7:] == ("F2c", "F2v")
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-8)
    result.save(tmp_path)
    stored = load_result(tmp_path)
    assert stored.friction is not None
    np.testing.assert_allclose(stored.friction.curve("z1").torque([0.1, -0.5]), curves()["z1"].torque([0.1, -0.5]))
    assert result_content(stored)["friction_scale"]["z3"]["factor"] == pytest.approx(1.25)
    assert result_content(found(TASK, log, friction=STATED))["friction_scale"] is None


def test_curves_of_the_task_are_scaled_too(log: Log) -> None:
    named, own = (
        found(TASK.changed(**given), log, recipe=RECIPE, **more)
        for given, more in (({}, {"friction": STATED}), ({"friction_curves": STATED}, {}))
    )
    np.testing.assert_array_equal(named.estimate.values, own.estimate.values)


def test_columns_are_what_is_subtracted(log: Log) -> None:
    plain = found(TASK, log, recipe=replace(RECIPE, friction_scale=False))
    (part,) = plain.prepared
    names, columns = friction_columns(Context(plain.target, (part,), plain.recipe), STATED)
    less = without_friction(part, plain.target, STATED, plain.recipe)
    assert names == ("z1", "z3")
    np.testing.assert_allclose(columns.sum(axis=1), (part.measured - less.measured).ravel(), atol=1e-12)


@pytest.mark.slow
def test_intervals_allow_for_the_factors(log: Log) -> None:
    """They are those of factors and parameters estimated at once."""
    hits, factors = [], []
    for seed in range(100):
        result = found(TASK, noisy(log, 1.0, 0.0, seed), recipe=RECIPE, friction=STATED)
        scale = result.friction_scale
        hits.append(np.abs(result.estimate.values - described(result)) <= result.estimate.half_width)
        factors.append(np.abs(scale.factor - list(FACTORS.values())) <= scale.half_width)
    assert np.mean(hits) > 0.97
    assert np.mean(factors) > 0.96


def test_nothing_to_scale_is_refused(log: Log) -> None:
    with pytest.raises(InputError, match="`friction_scale` is for known friction"):
        found(TASK, log, recipe=RECIPE)
    with pytest.raises(InputError, match="no moving drive has one"):
        found(TASK, log, recipe=RECIPE, friction=FrictionCurves({"z4": CoulombViscous(1.0)}))


@pytest.mark.parametrize(
    "curve",
    [
        CoulombViscous(2.0, 3.0, 0.1),
        Stribeck(Side(2.0, 3.0, 4.0, 0.1, 1.0), Side(1.0, 2.0, 3.0), offset=0.2),
        TableFriction([0.1, 1.0], [3.0, 5.0]),
        Scaled(CoulombViscous(2.0, 3.0), 1.5),
        Warm(CoulombViscous(2.0, 3.0), 30.0, Slope(-0.01, 0.02), Slope(0.03), range=(20.0, 40.0)),
        Loaded(CoulombViscous(2.0, 3.0), 0.1, 0.2),
    ],
    ids=lambda curve: type(curve).__name__,
)
def test_multiplied_curves_are_of_their_kind(curve: FrictionCurve) -> None:
    v, one = np.array([-2.0, -0.1, 0.1, 0.7]), multiplied(curve, 1.3)
    np.testing.assert_allclose(one.torque(v), 1.3 * curve.torque(v), rtol=1e-12)
    np.testing.assert_allclose(one.torque_at(v, 45.0), 1.3 * curve.torque_at(v, 45.0), rtol=1e-12)
    kept = friction_of(friction_text(FrictionCurves({"z1": one})), "text").curve("z1")
    assert kept is not None
    np.testing.assert_allclose(kept.torque(v), one.torque(v), rtol=1e-12)
    if isinstance(curve, Loaded):
        assert one.shares == pytest.approx((0.13, 0.26))
