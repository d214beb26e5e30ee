"""What a precision target allows each base parameter."""

import numpy as np
import pytest

from excite.information.half_widths import ABOUT_ZERO, allowed_half_widths, group_of, precision_scales
from excite.information.prior import base_sizes, prior_of
from excite.information.target import IdentificationTarget, target_of
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.robot_of_task import robot_and_task
from regressors.errors import InputError, UnknownName


@pytest.fixture(scope="module")
def irp6() -> IdentificationTarget:
    return target_of(*robot_and_task("irp6"))


@pytest.fixture(scope="module")
def ur10e() -> IdentificationTarget:
    return target_of(*robot_and_task("ur10e"))


def _values(target: IdentificationTarget) -> np.ndarray:
    return np.abs(prior_of(target.model, target.base, None).base_values(np.eye(target.base.rank)))


def test_a_share_of_every_described_value(irp6: IdentificationTarget) -> None:
    assert np.allclose(allowed_half_widths(PrecisionTarget(0.05), irp6), 0.05 * _values(irp6))


def test_names_go_before_kinds_and_kinds_before_groups(irp6: IdentificationTarget) -> None:
    precision = PrecisionTarget(0.1, parameters={"F1c": 0.01}, groups={"friction": 0.2, "coulomb": 0.05})
    share = dict(zip(irp6.base.names, allowed_half_widths(precision, irp6) / _values(irp6), strict=True))
    assert share == pytest.approx(
        dict.fromkeys(irp6.base.names, 0.1) | {"F1c": 0.01, "F2c": 0.05, "F3c": 0.05}
        | {f"F{k}v": 0.2 for k in (1, 2, 3)}
    )  # fmt: skip


def test_nothing_is_asked_of_the_others(irp6: IdentificationTarget) -> None:
    allowed = allowed_half_widths(PrecisionTarget(None, groups={"gravity": 0.1}), irp6)
    assert {name for name, a in zip(irp6.base.names, allowed, strict=True) if np.isfinite(a)} == {"X6", "X7"}


def test_about_zero_the_size_stands_for_the_value(ur10e: IdentificationTarget) -> None:
    scale, value, size = precision_scales(PrecisionTarget(), ur10e), _values(ur10e), base_sizes(ur10e.model, ur10e.base)
    zero, described = value < ABOUT_ZERO * size, np.isfinite(size)
    assert np.sum(zero & described) > 5
    assert np.array_equal(scale[zero & described], size[zero & described])
    assert np.array_equal(scale[~zero & described], value[~zero & described])


def test_friction_that_is_not_described_is_not_asked_for_unless_scaled(ur10e: IdentificationTarget) -> None:
    names = ur10e.base.names
    assert np.isinf(allowed_half_widths(PrecisionTarget(), ur10e)[names.index("F2c")])
    scaled = allowed_half_widths(PrecisionTarget(0.1, scales={"F2c": 10.0}), ur10e)
    assert scaled[names.index("F2c")] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"share": 0.0}, "above zero"),
        ({"share": True}, "number"),
        ({"share": float("inf")}, "above zero"),
        ({"share": None}, "nothing is asked"),
        ({"level": 1.0}, "between 0 and 1"),
        ({"scales": {"X1": -1.0}}, "above zero"),
        ({"groups": {"frictions": 0.1}}, "no group"),
    ],
)
def test_targets_that_mean_nothing(given: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        PrecisionTarget(**given)


def test_unknown_parameters_and_values(irp6: IdentificationTarget, ur10e: IdentificationTarget) -> None:
    with pytest.raises(UnknownName, match="X1"):
        allowed_half_widths(PrecisionTarget(parameters={"X99": 0.1}), irp6)
    with pytest.raises(InputError, match="scales"):
        allowed_half_widths(PrecisionTarget(parameters={"F2c": 0.1}), ur10e)
    with pytest.raises(InputError, match="asks nothing"):
        allowed_half_widths(PrecisionTarget(None, groups={"friction": 0.1}), ur10e)


@pytest.mark.parametrize(
    ("column", "group"),
    [
        (("mass", "kg"), "gravity"),
        (("first moment", "kg m"), "gravity"),
        (("combination", "kg m"), "gravity"),
        (("combination", "kg m^2"), "inertia"),
        (("rotor", "kg m^2"), "inertia"),
        (("stribeck", "Nm"), "friction"),
        (("springs", "Nm/rad"), None),
    ],
)
def test_groups(column: tuple[str, str], group: str | None) -> None:
    assert group_of(*column) == group
