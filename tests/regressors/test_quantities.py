"""What numbers may be: every quantity holds its ends and nothing beyond, and texts are read as plain numbers only."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regressors.errors import InputError
from regressors.quantities import QUANTITIES, Quantity, check, fault, number_of, shown, whole_number_of


def test_quantities_hold_their_ends_and_nothing_beyond() -> None:
    for name, quantity in QUANTITIES.items():
        one = int if quantity.whole else float
        assert quantity.least < quantity.most, name
        assert fault(name, one(quantity.least)) is None
        assert fault(name, one(quantity.most)) is None
        ends = (one(quantity.least - abs(quantity.least) - 1), one(2 * abs(quantity.most) + 1))
        for beyond in (*ends, math.nan, -math.inf, 10**400, True):
            assert fault(name, beyond) is not None, (name, beyond)
        assert (fault(name, math.inf) is None) == quantity.infinite, name
        assert (fault(name, 0) is None) == (quantity.zero or quantity.least <= 0), name


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("period", 1e308, "`period` must be a number from 0.001 to 100000 s, given 1e+308"),
        ("starts", 2.0, "`starts` must be a whole number from 1 to 10000000, given 2"),
        ("starts", 10**30, "given 1000000000000000000000000000000"),
        ("starts", 10**5000, "given a whole number of about 5001 digits"),
        ("velocity", (1.0, np.array([2.0, -1.0])), "`velocity` must be a number from 1e-09 to 1000000 rad/s or m/s, g"),
        ("carried", {"m1": math.nan}, "`carried` must be a number from -1e+12 to 1e+12, given nan"),
        ("sign_width", 1e-20, "`sign_width` must be 0 or a number from 1e-12 to 1000000 rad/s or m/s, given 1e-20"),
        ("noise", ["1"], None),
    ],
    ids=range(8),
)
def test_what_is_out_of_range_is_named(name: str, value: object, message: str | None) -> None:
    if message is None:
        check(name, value)  # text is another check's affair
        return
    with pytest.raises(InputError) as refused:
        check(name, value)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    "text", ["1_0", "0x10", "1:30", "true", "\u0661", "", " ", "--1", "1e", ".", "1,5", "9" * 5000 + "x"]
)
def test_other_texts_are_no_numbers(text: str) -> None:
    for read in (number_of, whole_number_of):
        with pytest.raises(ValueError, match=r"expected a (whole )?number, given"):
            read(text)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_plain_numbers_are_read_exactly(number: float) -> None:
    assert number_of(repr(number)) == number


@given(st.one_of(st.text(), st.integers(), st.floats(), st.none(), st.binary()))
def test_what_is_shown_is_short_and_printable(value: object) -> None:
    text = shown(value)
    assert len(text) <= 60
    assert text.isprintable()


def test_ranges_are_said_in_words() -> None:
    both = Quantity("m", 1e-3, 5.0, zero=True, infinite=True)
    assert both.range == "0 or inf or a number from 0.001 to 5 m"
