"""Enclosures: no value of a box is outside, smaller boxes give smaller enclosures, and rounding never hides a value."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal, getcontext
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from regressors.robot.symbolic.intervals import OverBoxes, interval_function
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)
FINITE = st.floats(-1e150, 1e150, allow_nan=False)
BOXES, POINTS = 40, 30
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459")

ONE: dict[str, tuple[Callable[[ca.SX], ca.SX], Callable[[Array], Array]]] = {
    "negative": (lambda x: -x, np.negative),
    "square": (lambda x: x * x, np.square),
    "twice": (lambda x: x + x, lambda x: 2 * x),
    "sine": (ca.sin, np.sin),
    "cosine": (ca.cos, np.cos),
    "tanh": (ca.tanh, np.tanh),
    "sign": (ca.sign, np.sign),
    "magnitude": (ca.fabs, np.abs),
    "root": (lambda x: ca.sqrt(ca.fabs(x)), lambda x: np.sqrt(np.abs(x))),
    "inverse": (lambda x: 1 / x, lambda x: 1 / x),
}
TWO: dict[str, tuple[Callable[[ca.SX, ca.SX], ca.SX], Callable[[Array, Array], Array]]] = {
    "sum": (lambda x, y: x + y, np.add),
    "difference": (lambda x, y: x - y, np.subtract),
    "product": (lambda x, y: x * y, np.multiply),
    "quotient": (lambda x, y: x / y, np.divide),
    "smaller": (ca.fmin, np.minimum),
    "larger": (ca.fmax, np.maximum),
}


def function(count: int, expression: Callable[..., ca.SX]) -> OverBoxes:
    symbols = [ca.SX.sym(f"x{k}") for k in range(count)]
    return interval_function([ca.vertcat(*symbols)], ca.vertcat(expression(*symbols)))


def boxes(seed: int, inputs: int) -> tuple[Array, Array, Array]:
    """Ends of random boxes of very different places and widths, and points inside, ends included."""
    rng = np.random.default_rng(seed)
    place = rng.normal(size=(inputs, BOXES)) * 10.0 ** rng.uniform(-3, 3, BOXES)
    width = rng.exponential(size=(inputs, BOXES)) * 10.0 ** rng.uniform(-6, 2, BOXES)
    share = np.concatenate([rng.random((POINTS, inputs, BOXES)), rng.integers(0, 2, (POINTS, inputs, BOXES))])
    points = np.clip(place + share * width, place, place + width)
    return place, place + width, points


def single(f: OverBoxes, low: float, high: float) -> tuple[float, float]:
    bounds = f([np.array([[low]])], [np.array([[high]])])
    return float(bounds[0][0, 0]), float(bounds[1][0, 0])


@pytest.mark.parametrize("name", [*ONE, *TWO])
@settings(max_examples=8)
@given(SEED)
def test_every_operation_encloses_its_values(name: str, seed: int) -> None:
    """True values of points within each box lie within; ends of monotone ones are no wider than rounding asks for."""
    expression, value = {**ONE, **TWO}[name]
    inputs = 1 if name in ONE else 2
    low, high, points = boxes(seed, inputs)
    below, above = function(inputs, expression)([low], [high])
    values = value(*np.moveaxis(points, 1, 0))
    assert np.all((below <= values) & (values <= above))
    if name in ("negative", "sum", "difference", "tanh", "product"):  # reached at corners of the box
        sides = ([np.where(bits >> k & 1, high[k], low[k]) for k in range(inputs)] for bits in range(4))
        corners = np.array([value(*side) for side in sides])
        np.testing.assert_allclose(below[0], corners.min(axis=0), rtol=1e-14)
        np.testing.assert_allclose(above[0], corners.max(axis=0), rtol=1e-14)


@settings(max_examples=15)
@given(SEED)
def test_a_box_inside_another_has_an_enclosure_inside(seed: int) -> None:
    """Of every operation, and of an expression that uses them all."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    everything = [f(x) for f, _ in ONE.values()] + [f(x, y) for f, _ in TWO.values()]
    everything.append(ca.sin(x * y) / (2 + ca.cos(x)) + ca.tanh(x - y) * ca.fmin(x, y * y) - ca.sqrt(1 + x * x))
    f = interval_function([ca.vertcat(x, y)], ca.vertcat(*everything))
    low, high, points = boxes(seed, 2)
    outer = f([low], [high])
    inner = f([np.minimum(points[0], points[1])], [np.maximum(points[0], points[1])])
    assert np.all(outer[0] <= inner[0])
    assert np.all(inner[1] <= outer[1])


@given(FINITE, FINITE)
def test_rounding_goes_outwards(a: float, b: float) -> None:
    """Exact rational results of single numbers, tiny and huge ones too, lie strictly within, or on infinite ends."""
    x, y = Fraction(a), Fraction(b)
    cases = {"sum": x + y, "difference": x - y, "product": x * y, "square": x * x, "twice": 2 * x}
    cases |= {"quotient": x / y} if b != 0 else {}
    for name, exact in cases.items():
        inputs = 1 if name in ONE else 2
        point = [np.array([[a], [b]])[:inputs]]
        low, high = (float(end[0, 0]) for end in function(inputs, {**ONE, **TWO}[name][0])(point, point))
        assert low < exact < high, name
        finite = np.isfinite(high - low)
        assert not finite or Fraction(high) - Fraction(low) <= abs(exact) / 10**14 + Fraction(1e-299), name


def exact_sine(x: float, shift: Decimal = Decimal(0)) -> Decimal:
    """sin(x + shift) to 40 digits by its series, angles reduced with 62 digits of pi."""
    getcontext().prec = 60
    angle = (Decimal(x) + shift) % (2 * PI)
    total = term = angle
    for k in range(1, 60):
        term *= -angle * angle / (2 * k * (2 * k + 1))
        total += term
    return total


@given(st.floats(-1e6, 1e6) | st.floats(-1e-3, 1e-3) | st.integers(-(10**5), 10**5).map(lambda k: k * np.pi / 2))
def test_waves_of_single_numbers_enclose_the_exact_value(x: float) -> None:
    """Also beside their zeros, where a shift by half of pi would lose every digit."""
    for wave, shift in ((ca.sin, Decimal(0)), (ca.cos, PI / 2)):
        low, high = single(function(1, wave), x, x)
        exact = exact_sine(x, shift)
        assert Decimal(low) <= exact <= Decimal(high)
        assert high - low <= 4e-15


@given(st.floats(-1e5, 1e5), st.floats(0.0, 12.0), st.sampled_from(["sine", "cosine"]))
def test_waves_over_many_periods(low: float, width: float, name: str) -> None:
    """The enclosure is that of a dense sampling, for boxes from nothing to two periods, far from zero too."""
    expression, value = ONE[name]
    below, above = single(function(1, expression), low, low + width)
    values = value(np.linspace(low, low + width, 4001))
    assert below <= values.min()
    assert values.max() <= above
    spacing = width / 4000
    assert values.min() - below <= spacing**2 / 8 + 1e-9
    assert above - values.max() <= spacing**2 / 8 + 1e-9


@pytest.mark.parametrize("turns", [0, 1, -3, 1000, -(10**8)])
def test_crests_on_the_edge_of_a_box_are_inside(turns: int) -> None:
    """A box that ends at the float nearest to a crest, on either side of it."""
    for name, crest in (("cosine", 2 * turns * np.pi), ("sine", (2 * turns + 0.5) * np.pi)):
        f = function(1, ONE[name][0])
        for low, high in ((crest - 0.1, crest), (crest, crest + 0.1)):
            assert single(f, low, high)[1] >= 1.0
            assert single(f, low, high)[0] == pytest.approx(np.cos(0.1), abs=1e-6)
        assert single(f, crest - 1e-4, crest + 1e-4)[1] >= 1.0


DIVISIONS = {
    "inside": ((1, 2), (-1, 1), (-np.inf, np.inf)),
    "at the lower end": ((1, 2), (0, 1), (-np.inf, np.inf)),
    "zero by zero": ((0, 0), (0, 0), (-np.inf, np.inf)),
    "above": ((1, 2), (0.5, 4), (0.25, 4)),
    "below": ((1, 2), (-4, -0.5), (-4, -0.25)),
}


@pytest.mark.parametrize("case", DIVISIONS.values(), ids=DIVISIONS.keys())
def test_division_by_a_box_with_zero_is_everything(case: tuple) -> None:
    (a, b), (c, d), expected = case
    f = function(2, TWO["quotient"][0])
    low, high = f([np.array([[a], [c]], dtype=float)], [np.array([[b], [d]], dtype=float)])
    np.testing.assert_allclose([low[0, 0], high[0, 0]], expected, rtol=1e-14)


UNKNOWN: tuple[Callable[[ca.SX, ca.SX], ca.SX], ...] = (
    lambda x, y: (x / y) * 0.0 * x + y,
    lambda x, y: x / y - x / y,
    lambda x, y: ca.fmin(1.0, (x / y) * (x / y) - 1 / y),
    lambda x, y: ca.cos(1 / y) * x,
    lambda x, y: ca.tanh(x / y) + ca.sign(x / y) + ca.sqrt(ca.fabs(x / y)),
)


@pytest.mark.parametrize("expression", UNKNOWN)
def test_what_is_not_known_stays_unknown(expression: Callable[[ca.SX, ca.SX], ca.SX]) -> None:
    """Nothing is decided by a number that is none: zero times infinite, infinite less infinite."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    exact = ca.Function("exact", [x, y], [expression(x, y)])
    low, high = function(2, expression)([np.array([[-1.0], [-0.5]])], [np.array([[1.0], [1.0]])])
    assert not np.isnan([low, high]).any()
    for point in np.random.default_rng(0).uniform([-1, -0.5], [1, 1], (300, 2)):
        assert low[0, 0] <= float(exact(*point)) <= high[0, 0]


def test_a_divisor_with_an_end_that_is_none_may_be_zero() -> None:
    """The lower end of ``x + exp(y)`` is infinite less infinite: a number beyond the largest may have either sign."""
    f = function(2, lambda x, y: 1 / (x + ca.exp(y)))
    low, high = f([np.array([[-np.inf], [800.0]])], [np.array([[1.0], [900.0]])])
    assert (low[0, 0], high[0, 0]) == (-np.inf, np.inf)


def test_many_boxes_are_as_each_alone() -> None:
    """More boxes than are worked on at a time, an expression with constants, and outputs without an input."""
    x = ca.SX.sym("x", 3)
    f = interval_function([x[:2], x[2]], ca.vertcat(ca.sin(x[0]) * x[2] + 2.5, 7.0, x[1], ca.SX(1, 1)))
    rng = np.random.default_rng(3)
    low = rng.normal(size=(3, 9001))
    high = low + rng.random((3, 9001))
    together = f([low[:2], low[2:]], [high[:2], high[2:]])
    assert together[0].shape == (4, 9001)
    for k in (0, 4095, 4096, 9000):
        alone = f([low[:2, [k]], low[2:, [k]]], [high[:2, [k]], high[2:, [k]]])
        np.testing.assert_array_equal([end[:, [k]] for end in together], alone)
    np.testing.assert_allclose(together[0][[1, 3]].T, [[7.0, 0.0]] * 9001, atol=1e-299)


def test_an_instruction_without_an_enclosure_is_refused_at_once() -> None:
    x = ca.SX.sym("x")
    with pytest.raises(ValueError, match=f"instruction {ca.OP_ATAN2} has no enclosure"):
        interval_function([x], ca.atan2(x, 1 + x))
