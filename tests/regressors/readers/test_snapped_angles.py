"""Angles that are multiples of right angles up to their printed digits, and those that are not."""

from __future__ import annotations

import itertools
import math
from decimal import ROUND_DOWN, ROUND_HALF_UP, Decimal

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from regressors.readers.angles import cosine_and_sine, in_words, multiple_of, nearly
from regressors.readers.urdf import parse_urdf
from regressors.robot.inertia import rotation_from_rpy

PI = Decimal("3.1415926535897932384626433832795028841971")
COUNTS = [count for count in range(-24, 25) if count % 3 == 0 or count % 2 == 0]  # of pi/12: of pi/4 and pi/6

TAKEN = {
    "1.5708": "pi/2", "1.57079": "pi/2", "1.5707": "pi/2", "1.570800": "pi/2", "-1.57079632679": "-pi/2",
    "1.570796325": "pi/2",  # half of 3.14159265
    "1.57079637": "pi/2",  # single precision
    "15.708e-1": "pi/2", "3.1415": "pi", "3.1416": "pi", "-3.14159": "-pi",
    "3.14158": "pi",  # twice 1.57079
    "4.7124": "3 pi/2", "6.2832": "2 pi", "0.7854": "pi/4", "1.57": "pi/2", "-1.571": "-pi/2", "3.14": "pi",
    "3.142": "pi", "4.71": "3 pi/2", "0.785": "pi/4", "0.524": "pi/6", "2.0944": "2 pi/3", "-0.5235988": "-pi/6",
    "4.64506e-08": "0", "2.7629E-18": "0", "0": "0",
}  # fmt: skip
LEFT = [
    "1.5721", "1.572", "1.58", "3.15", "3.1", "1.5709", "1.57081", "3.1414", "0.786", "0.79", "0.52", "0.262", "1e-6",
    "1.5708123", "1.5706", "100.53096", "1e300", "-2.5",
]  # fmt: skip


def test_rounded_multiples_are_taken_for_the_multiples() -> None:
    counts = {text: multiple_of(text) for text in TAKEN}
    assert {text: None if count is None else in_words(count) for text, count in counts.items()} == TAKEN


def test_other_angles_are_left() -> None:
    assert [text for text in LEFT if multiple_of(text) is not None] == []


@given(st.sampled_from(COUNTS), st.integers(3, 25), st.sampled_from([ROUND_DOWN, ROUND_HALF_UP]))
@settings(derandomize=True)
def test_every_multiple_is_found_in_its_printed_digits(count: int, digits: int, how: str) -> None:
    printed = (count * PI / 12).quantize(Decimal(1).scaleb(-digits), rounding=how)
    assert multiple_of(str(printed)) == count


@given(st.floats(-7, 7), st.integers(0, 17), st.sampled_from("fe"))
@settings(max_examples=200, derandomize=True)
def test_no_angle_changes_by_more_than_its_digits_leave_open(angle: float, digits: int, form: str) -> None:
    text = f"{angle:.{digits}{form}}"
    count = multiple_of(text)
    if count is not None:
        last = Decimal(text).normalize().as_tuple().exponent
        assert abs(float(text) - count * math.pi / 12) <= max(3 * 10.0**last if last <= -5 else 10.0**last, 2e-7)


@given(st.integers(5, 17), st.integers(2, 200), st.sampled_from(COUNTS), st.sampled_from([-1, 1]))
@settings(max_examples=200, derandomize=True)
def test_angles_some_units_of_their_last_digit_off_are_left(digits: int, units: int, count: int, sign: int) -> None:
    """Three times a rounded right angle is two units off at most."""
    unit = Decimal(1).scaleb(-digits)
    off = (count * PI / 12).quantize(unit) + sign * (units + 2) * unit
    if abs(off - count * PI / 12) > Decimal("2e-7") and off.normalize() == off and off % (10 * unit):
        assert multiple_of(str(off)) is None


def test_cosines_are_exact_where_they_can_be() -> None:
    for count in COUNTS:
        values = np.array(cosine_and_sine(count))
        np.testing.assert_allclose(values, [math.cos(count * math.pi / 12), math.sin(count * math.pi / 12)], atol=1e-15)
        if count % 6 == 0:
            assert set(np.abs(values)) == {0.0, 1.0}, count


def test_angles_that_look_meant_otherwise_are_told() -> None:
    assert [nearly(text) for text in ("1.572", "3.15", "1.56", "-3.143")] == ["pi/2", "pi", "pi/2", "-pi"]
    assert [nearly(text) for text in ("1.5721", "0.0", "0.01", "1.6", "3.1")] == [None] * 5


def arm(rpy: str, axis: str = "0 0 1") -> str:
    inside = f'<parent link="a"/><child link="b"/><origin rpy="{rpy}"/><axis xyz="{axis}"/>'
    return f'<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">{inside}</joint></robot>'


def test_rotations_by_right_angles_are_exact() -> None:
    for angles in itertools.product(["0", "1.5708", "-3.14159", "4.71238898038"], repeat=3):
        text = arm(" ".join(angles))
        rotation = parse_urdf(text).joints[0].rotation
        assert set(np.abs(rotation).ravel()) == {0.0, 1.0}, angles
        np.testing.assert_allclose(rotation, parse_urdf(text, snap_angles=False).joints[0].rotation, atol=3e-5)


printed = st.builds(
    lambda angle, digits: f"{angle:.{digits}f}",
    st.one_of(st.floats(-7, 7), st.sampled_from([count * math.pi / 12 for count in COUNTS])),
    st.integers(1, 17),
)


@given(st.tuples(printed, printed, printed))
@settings(max_examples=80, derandomize=True, deadline=None)
def test_rotations_are_those_of_the_printed_or_the_meant_angles(rpy: tuple[str, str, str]) -> None:
    counts = [multiple_of(text) for text in rpy]
    meant = [float(t) if count is None else count * math.pi / 12 for t, count in zip(rpy, counts, strict=True)]
    robots = [parse_urdf(arm(" ".join(rpy)), snap_angles=snap) for snap in (True, False)]
    for robot, angles in zip(robots, (meant, [float(text) for text in rpy]), strict=True):
        np.testing.assert_allclose(robot.joints[0].rotation, rotation_from_rpy(angles), atol=2e-12)
    off = [abs(float(text) - angle) > 1e-8 for text, angle in zip(rpy, meant, strict=True)]
    assert any(note.kind == "snapped" for note in robots[0].notes) == any(off)


def test_the_change_is_told_and_can_be_turned_off() -> None:
    taken, exact = parse_urdf(arm("1.5708 0 -3.14159")), parse_urdf(arm("1.5708 0 -3.14159"), snap_angles=False)
    told = [(n.where, n.what) for n in taken.notes if n.kind == "snapped"]
    assert told == [("joint 'j'", "took 1.5708 for pi/2, -3.14159 for -pi")]
    assert not [note for note in exact.notes if note.kind == "snapped"]
    assert np.count_nonzero(exact.joints[0].rotation) > 3
    assert taken.sha256() != exact.sha256()


def test_angles_that_may_be_meant_otherwise_are_told() -> None:
    notes = [str(note) for note in parse_urdf(arm("1.572 0 90")).notes if note.kind == "suspicious"]
    assert notes == [
        "joint 'j': close to a right angle, but read as printed: 1.572 (if pi/2 is meant, write 1.5707963267948966); "
        "an angle that is off by its rounding shows parameters that are none",
        "joint 'j': angles of more than a full turn: 90; rpy is in radians, not in degrees",
    ]


def test_noise_of_single_precision_leaves_axes() -> None:
    assert parse_urdf(arm("0 0 0", "0 -4.37114e-08 1")).joints[0].axis.tolist() == [0, 0, 1]
    raw = parse_urdf(arm("0 0 0", "0 -4.37114e-08 1"), snap_angles=False)
    assert raw.joints[0].axis[1] == pytest.approx(-4.37114e-08)
    assert parse_urdf(arm("0 0 0", "0 -0.00019 1")).joints[0].axis[1] != 0.0
