"""The bias of a force/torque sensor: found, subtracted and allowed for, or told not to be found."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from played import LOAD, periodic, played, three_joints
from refused import refusal

from excite.identification.choices.friction_terms import _told_apart
from excite.identification.identification import Identification
from excite.identification.identify import identify
from regressors.errors import InputError

BIAS = np.array([0.3, -0.2, 0.4, 0.02, -0.01, 0.015])
ALL = ("fx", "fy", "fz", "nx", "ny", "nz")


def identified(size: float, **options) -> Identification:
    """Of six seconds of all joints with noise of the wrench, and a bias."""
    log = played(periodic(np.eye(5), 3, size), 5, 250.0, 6.0, load=LOAD)
    noise = np.random.default_rng(2).normal(size=log.wrench.shape) * np.repeat([0.2, 0.01], 3)
    return identify("irp6", replace(log, wrench=log.wrench + noise + BIAS), model="load", cutoff=20.0, **options)


@pytest.mark.parametrize("kept", [ALL, ("fx", "fy", "fz", "ny", "nz")])
def test_it_is_found_and_the_intervals_allow_for_it(kept: tuple[str, ...]) -> None:
    result = identified(0.3, equations=kept)
    found, has = np.array(result.recipe.bias), np.isin(ALL, kept)
    np.testing.assert_allclose(found[has], BIAS[has], atol=0.03)
    np.testing.assert_array_equal(found[~has], 0.0)
    assert np.all(np.abs(result.estimate.values - LOAD) < result.estimate.half_width)
    given = identified(0.3, equations=kept, bias=tuple(found))
    np.testing.assert_allclose(given.estimate.values, result.estimate.values, rtol=1e-9)
    assert np.all(given.estimate.half_width <= result.estimate.half_width)
    ignored = identified(0.3, equations=kept, choose=False)
    assert ignored.recipe.bias is None
    assert np.any(np.abs(ignored.estimate.values - LOAD) > ignored.estimate.half_width)


def test_a_motion_that_hardly_turns_the_load_does_not_show_it() -> None:
    result = identified(0.05)
    assert result.recipe.bias is None
    assert "tare the sensor" in next(choice.reason for choice in result.choices if choice.name == "bias")


def test_it_has_six_components_and_needs_a_wrench() -> None:
    assert "`bias` must be six numbers, three forces" in refusal(identified, 0.3, bias=(1.0, 2.0))
    with pytest.raises(InputError, match="`bias` is for the wrench of a sensor, which it does not have"):
        identify("irp6", played(three_joints(), 3, seconds=4.0), bias=tuple(BIAS))


def test_a_constant_that_is_a_parameter_is_not_told_apart() -> None:
    """Of the last two columns, one that is the first one, and one of which the first explains cos(60 deg)."""
    W = np.array([[1.0, 1.0, 0.5], [0.0, 0.0, np.sqrt(0.75)], [0.0, 0.0, 0.0]])
    total = np.pad(W.T @ W, (0, 1))[None]
    left = _told_apart(SimpleNamespace(total=total), np.ones(1), 2)
    np.testing.assert_allclose(left, [0.0, np.sqrt(0.75)], atol=1e-7)
