"""Known friction subtracted as given, or scaled: by what predicts left-out torques."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner
from played import curves, described, noisy, played, three_joints

import excite
from excite.cli.main import cli
from excite.identification.choices.left_out import Choice
from excite.identification.identification import Identification
from excite.logs.log import Log
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.uncertainty import multiplied

SLOW = pytest.mark.slow
CHOOSE = ("cutoff", "friction_scale")


@cache
def log() -> Log:
    return noisy(played(three_joints(), 3, 200.0, 8.0), 0.2, 1e-6, 1)


def stated(**factors: float) -> FrictionCurves:
    """The curves of the robot, some times a factor."""
    return FrictionCurves({name: multiplied(curve, factors.get(name, 1.0)) for name, curve in curves().items()})


def found(friction: FrictionCurves, **options: object) -> Identification:
    return excite.identify("irp6", log(), friction_curves=friction, **{"choose": CHOOSE, **options})


def choice_of(result: Identification) -> Choice:
    (choice,) = [choice for choice in result.choices if choice.name == "friction_scale"]
    return choice


def test_curves_that_are_right_are_subtracted_as_given() -> None:
    result = found(stated())
    assert choice_of(result).value is result.recipe.friction_scale is False
    assert result.friction_scale is None
    assert "subtracted as given" in choice_of(result).reason


@pytest.mark.parametrize("factor", [pytest.param(0.5, marks=SLOW), 1.25, pytest.param(2.0, marks=SLOW)])
def test_curves_of_another_day_are_scaled(factor: float) -> None:
    result = found(stated(z1=factor, z3=factor))
    assert choice_of(result).value is result.recipe.friction_scale is True
    assert [candidate.value for candidate in choice_of(result).candidates] == [False, True]
    assert result.friction_scale is not None
    expected = {"z1": 1 / factor, "z2": 1.0, "z3": 1 / factor}
    assert result.friction_scale.factors == pytest.approx(expected, rel=0.01)
    right = found(stated())
    np.testing.assert_allclose(result.coefficients, right.coefficients, atol=0.01 * np.abs(right.coefficients).max())


@pytest.mark.parametrize("scale", [False, True])
def test_what_is_given_is_kept(scale: bool) -> None:
    result = found(stated(z1=1.25), friction_scale=scale)
    assert not [choice for choice in result.choices if choice.name == "friction_scale"]
    assert (result.friction_scale is not None) == scale


def test_without_curves_there_is_nothing_to_scale() -> None:
    result = excite.identify("irp6", log(), choose=CHOOSE)
    assert [choice.name for choice in result.choices] == ["cutoff", "presliding"]


def test_right_curves_of_some_joints_are_not_scaled() -> None:
    result = excite.identify(
        "irp6", log().of(["q1", "q2", "q3"]), joints=("1", "2", "3"), friction_curves=stated(), choose=CHOOSE
    )
    assert result.friction_scale is None


def test_curves_of_drives_at_rest_are_no_reason_to_scale() -> None:
    result = found(stated(z4=2.0, z5=2.0))
    assert result.recipe.friction_scale is False
    np.testing.assert_array_equal(result.coefficients, found(stated()).coefficients)


def test_curves_of_drives_at_rest_are_not_scaled() -> None:
    result = found(stated(z1=1.25, z4=2.0))
    assert result.friction_scale is not None
    assert set(result.friction_scale.factors) == {"z1", "z2", "z3"}


def test_curves_a_little_wrong_are_scaled_where_that_brings_the_parameters_nearer() -> None:
    wrong = stated(z1=1.02, z3=1.02)
    chosen, kept = found(wrong), found(wrong, friction_scale=False)
    assert chosen.recipe.friction_scale is True
    off, off_as_given = (np.abs(result.coefficients / described(result) - 1).max() for result in (chosen, kept))
    assert off < 0.2 * off_as_given


def test_the_command_has_both_options() -> None:
    text = CliRunner().invoke(cli, ["identify", "--help-all"]).output
    assert "--scale-friction / --no-scale-friction" in text
