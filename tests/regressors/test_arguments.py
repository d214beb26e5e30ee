"""The border of the API: arguments, numbers, texts of others in messages, failures of numerical libraries."""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import casadi as ca
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg
from hypothesis import given, strategies as st
from typing_extensions import TypeAliasType

import excite
from regressors.arguments import checked, fit, rule_of
from regressors.errors import (
    LONGEST,
    LONGEST_LINE,
    ExciteError,
    InputError,
    NumericalError,
    UnknownName,
    cut,
    listed_names,
    one_line,
    percent,
    printable,
    shortened,
)
from regressors.numerical import numerical_work
from regressors.quantities import QUANTITIES, Quantity, check, fault, number_of, shown, whole_number_of
from regressors.samples import Array


class Named(Protocol):
    name: str

    def run(self) -> None: ...


class Runner:
    name = "r"

    def run(self) -> None:
        raise AssertionError("is not called")


VECTOR = np.array([1.0, 2.0])
S = typing.TypeVar("S", bound=np.generic)
NAMED = TypeAliasType("NAMED", np.ndarray[tuple[int, ...], np.dtype[S]], type_params=(S,))  # as in NumPy 2.5
LET_IN: list[tuple[Any, Any, Any]] = [
    (float, np.float32(0.5), 0.5),
    (bool, np.bool_(True), True),
    (str | Path, Path("x"), Path("x")),
    (Literal["short", "long"], "long", "long"),
    (tuple[float, ...], 2.0, (2.0,)),
    (tuple[float, ...], [1, 2.5], (1, 2.5)),
    (tuple[float, float] | None, [1, 2], (1, 2)),
    (Sequence[float], VECTOR, (1.0, 2.0)),
    (Mapping[str, float], {"x": 1}, {"x": 1}),
    (Callable[[str], None], print, print),
    (Array, [[1, 2]], np.array([[1.0, 2.0]])),
    (NAMED[np.float64] | None, [[1, 2]], np.array([[1.0, 2.0]])),
]
REFUSED: list[tuple[Any, Any, str]] = [
    (float, True, "a number"),
    (float, 10**400, "a number"),
    (int, 1.0, "a whole number"),
    (bool, 1, "True or False"),
    (str, b"x", "text"),
    (str | Path, "a\0b", "text or a path that a file can have"),
    (str | None, 1, "text or None"),
    (Literal["short", "long"], 1, "'short' or 'long'"),
    (tuple[float, ...], "12", "a number, or a list of numbers"),
    (tuple[float, float], [1.0], r"\(a number, a number\)"),
    (Sequence[str], "torque", "a list of names"),
    (Mapping[str, float], {1: 1.0}, "a mapping, each a number"),
    (Callable[[str], None], "print", "a function"),
    (Array, np.array([1j]), "an array of real numbers"),
    (Array, [[1.0], [1.0, 2.0]], "an array of real numbers"),
    (Named, VECTOR, "a Named"),
]


@pytest.mark.parametrize(("hint", "value", "taken"), LET_IN, ids=str)
def test_what_an_annotation_lets_in(hint: Any, value: Any, taken: Any) -> None:
    got = rule_of(hint)[0](value)
    assert np.array_equal(got, taken)
    assert type(got) is type(taken)


@pytest.mark.parametrize(("hint", "value", "expected"), REFUSED, ids=str)
def test_what_an_annotation_refuses(hint: Any, value: Any, expected: str) -> None:
    with pytest.raises(InputError, match=f"^what: expected {expected}, given "):
        fit("what", value, rule_of(hint))


def test_a_protocol_is_what_has_its_members() -> None:
    runner = Runner()
    assert rule_of(Named)[0](runner) is runner


def test_functions_and_classes_name_the_argument() -> None:
    @checked
    def scaled(x: float, /, *, by: tuple[float, ...] = (1.0,), **more: Any) -> tuple[float, ...]:
        return tuple(x * factor for factor in by)

    @checked
    @dataclass(frozen=True)
    class Point:
        x: float
        label: str = ""

    assert scaled(2.0, by=[3, 4], other=1j) == (6.0, 8.0)
    assert Point(1) == Point(1.0)
    with pytest.raises(InputError, match=r"^by: expected"):
        scaled(2.0, by=["3"])
    with pytest.raises(InputError, match=r"^x: expected a number, given '2'"):
        scaled("2")
    with pytest.raises(InputError, match=r"^label: expected text, given 1"):
        Point(1.0, 1)
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'x'"):
        Point()


def test_annotations_of_public_names_can_be_evaluated() -> None:
    for thing in (getattr(excite, name) for name in excite.__all__):
        assert isinstance(typing.get_type_hints(thing), dict)
        if isinstance(thing, type):
            assert isinstance(typing.get_type_hints(thing.__init__), dict)


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


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("q1", "q1"),
        ("\x1b[31mred", r"\x1b[31mred"),
        ("a\x9bb", r"a\x9bb"),
        ("\u202eabc", r"\u202eabc"),
        ("caf\xe9 \u03bc", "caf\xe9 \u03bc"),
        ("\udcff", r"\udcff"),
    ],
)
def test_what_a_terminal_would_obey_is_shown(text: str, shown: str) -> None:
    assert printable(text) == shown


@given(st.text(max_size=3000))
def test_nothing_is_long_or_obeyed(text: str) -> None:
    for said, most in ((cut(text), LONGEST), (shortened(text), LONGEST), (one_line(text), LONGEST_LINE)):
        assert len(said) <= most
        assert said.isprintable()


def test_both_ends_of_a_long_text_are_kept() -> None:
    assert cut("a" + 5000 * "b" + "c").startswith("abb")
    assert cut("a" + 5000 * "b" + "c").endswith("...bbbbc")
    assert one_line("what " + 400 * "is wrong " + "and the remedy").endswith(" and the remedy")


def test_a_number_that_python_refuses_to_print() -> None:
    assert shortened(10**5000) == "a very long number"


def test_shares_are_numbers_whatever_their_size() -> None:
    shares = (0.0, 0.12345, 1.0, 9.99, 10.0, 10.1, math.inf, math.nan, -0.5)
    texts = ["0 %", "12 %", "100 %", "1000 %", "1000 %", "> 1000 %", "> 1000 %", "an unknown share", "-50 %"]
    assert [percent(share) for share in shares] == texts
    assert percent(0.12345, 3) == "12.3 %"


def test_of_many_names_the_last_are_counted() -> None:
    assert listed_names(str(k) for k in range(60_000)).endswith("29 and 59970 more")
    error = str(UnknownName("joint", 5000 * "x", (f"{k}\x1b" for k in range(60_000))))
    assert len(error) < 400
    assert error.isprintable()


def of_casadi() -> None:
    ca.inv(ca.DM([[0.0, 0.0], [0.0, 0.0]]) * ca.DM.nan(2, 2))
    x = ca.SX.sym("x")
    ca.rootfinder("f", "newton", {"x": x, "g": x * x + 1})(0.0)


def of_arpack() -> None:
    scipy.sparse.linalg.eigsh(np.diag(np.arange(1.0, 50.0)), k=2, maxiter=1, tol=1e-30)


FAILURES: dict[str, Callable[[], object]] = {
    "singular": lambda: np.linalg.inv(np.zeros((2, 2))),
    "nan in linear algebra": lambda: scipy.linalg.svd(np.full((2, 2), np.nan)),
    "overflow": lambda: np.array([1e308]) * 10,
    "overflow of Python": lambda: 10.0**400,
    "nan to a whole number": lambda: int(float("nan")),
    "no convergence": of_arpack,
    "casadi": of_casadi,
}


@pytest.mark.parametrize("what", FAILURES)
def test_a_numerical_failure_names_its_likely_cause(what: str) -> None:
    message = r"^the work failed numerically \(.+\); check `period`$"
    with pytest.raises(NumericalError, match=message) as failed, numerical_work("the work", "check `period`"):
        FAILURES[what]()
    assert isinstance(failed.value, ExciteError)
    assert failed.value.__cause__ is not None
    assert "\n" not in str(failed.value)


@pytest.mark.parametrize("error", [InputError("wrong"), KeyError("x"), ValueError("no such"), RuntimeError("a bug")])
def test_other_errors_pass(error: Exception) -> None:
    with pytest.raises(type(error)) as passed, numerical_work("the work", "check it"):
        raise error
    assert passed.value is error


def test_an_inner_seam_speaks() -> None:
    @numerical_work("the outer work", "check it")
    def outer() -> None:
        with numerical_work("the inner work", "check it"):
            np.linalg.inv(np.zeros((2, 2)))

    for _ in range(2):  # a decorated function can be called again
        with pytest.raises(NumericalError, match="the inner work failed"):
            outer()


def test_what_is_harmless_says_so_itself() -> None:
    with numerical_work("the work", "check it"), np.errstate(divide="ignore"):
        assert np.isinf(np.array([1.0]) / 0.0).all()
