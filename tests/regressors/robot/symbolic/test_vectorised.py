"""CasADi expressions for many instants, against CasADi's own machine, one instant at a time."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from regressors.robot.symbolic import machine_code, vectorised
from regressors.robot.symbolic.vectorised import VectorisedFunction

SEED = st.integers(0, 2**32 - 1)
SIZES = (3, 2)

# Every supported operation, with arguments kept where it is defined; the first group is smooth everywhere.
SMOOTH: dict[str, Callable[[ca.SX, ca.SX], ca.SX]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / (1 + b * b),
    "invert": lambda a, b: 1 / (2 + a * a),
    "negate": lambda a, b: -a,
    "square": lambda a, b: a**2,
    "twice": lambda a, b: 2 * a,
    "root": lambda a, b: ca.sqrt(1 + a * a),
    "sine": lambda a, b: ca.sin(a),
    "cosine": lambda a, b: ca.cos(a),
    "tanh": lambda a, b: ca.tanh(a),
    "constant": lambda a, b: 0.1234567890123456789 + 0 * a,
}
KINKED = {**SMOOTH, "sign": lambda a, b: ca.sign(a), "fabs": lambda a, b: ca.fabs(a)}
VALUES_ONLY = {"smaller": lambda a, b: ca.fmin(a, b), "larger": lambda a, b: ca.fmax(a, b)}
POWER = {"power": lambda a, b: (1 + a * a) ** b, "exponential": lambda a, b: ca.exp(a)}


@pytest.fixture(scope="module", autouse=True, params=["machine code", "interpreted"])
def machine(request: pytest.FixtureRequest) -> Iterator[str]:
    """Every test with LLVM, and with CasADi's own machine in its place."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "interpreted":
            patch.setattr(vectorised, "MachineCode", refused)
        yield request.param


def refused(_: ca.Function) -> None:
    raise machine_code.NotCompiledError("left out by a test")


def symbols() -> list[ca.SX]:
    return [ca.SX.sym(name, size) for name, size in zip("xy", SIZES, strict=True)]


def random_expression(x: list[ca.SX], operations: dict[str, Callable], rng: np.random.Generator) -> ca.SX:
    """A 3 x 4 matrix of which about a third is empty, each entry grown from the symbols by random operations."""
    grown = list(ca.vertsplit(ca.vertcat(*x)))
    kinds = list(operations.values())
    for _ in range(25):
        a, b = (grown[k] for k in rng.integers(0, len(grown), 2))
        grown.append(kinds[rng.integers(len(kinds))](a, b))
        grown[-1] = ca.tanh(grown[-1] / 4) * 4  # keep numbers in the range where differences mean something
    matrix = ca.SX(3, 4)
    for place in np.ndindex(3, 4):
        if rng.random() < 0.7:
            matrix[place] = grown[rng.integers(len(SIZES), len(grown))]
    return matrix


def random_inputs(rng: np.random.Generator, instants: int) -> list[np.ndarray]:
    return [rng.uniform(-1.5, 1.5, (size, instants)) for size in SIZES]


def one_by_one(x: list[ca.SX], expression: ca.SX, inputs: list[np.ndarray]) -> np.ndarray:
    """Dense values by CasADi, shape (rows, columns, instants)."""
    function = ca.Function("oracle", x, [ca.densify(expression)])
    return np.stack([np.array(function(*instant)) for instant in zip(*(v.T for v in inputs), strict=True)], axis=-1)


def dense(function: VectorisedFunction, values: np.ndarray) -> np.ndarray:
    full = np.zeros((*function.shape, values.shape[1]))
    full[function.row, function.column] = values
    return full


def random_case(seed: int, instants: int) -> tuple[Any, ...]:
    """Symbols, an expression of them, inputs, its function, and the generator that they came from."""
    rng, x = np.random.default_rng(seed), symbols()
    expression = random_expression(x, KINKED, rng)
    return x, expression, random_inputs(rng, instants), VectorisedFunction(x, expression), rng


@given(seed=SEED, instants=st.integers(1, 7))
@settings(max_examples=40)
def test_values_equal_casadis(seed: int, instants: int) -> None:
    x, expression, inputs, function, _ = random_case(seed, instants)
    expected = one_by_one(x, expression, inputs)
    for values in (function(*inputs), function.seldom(*inputs)):
        np.testing.assert_allclose(dense(function, values), expected, rtol=1e-12, atol=1e-13)


@given(seed=SEED, instants=st.integers(1, 5))
@settings(max_examples=40)
def test_pullback_equals_casadis_jacobian(seed: int, instants: int) -> None:
    x, expression, inputs, function, rng = random_case(seed, instants)
    seeds = rng.normal(size=(len(function.row), instants))
    places = [expression[int(i), int(j)] for i, j in zip(function.row, function.column, strict=True)]
    jacobian = one_by_one(x, ca.jacobian(ca.vertcat(*places), ca.vertcat(*x)), inputs)
    expected = np.einsum("nl,nil->il", seeds, jacobian)
    np.testing.assert_allclose(np.vstack(function.pullback(inputs, seeds)), expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("name", [*KINKED, *POWER, *VALUES_ONLY])
def test_each_operation_alone(name: str) -> None:
    """So that no random expression has to happen upon it."""
    x = symbols()
    expression = ca.SX(({**KINKED, **POWER, **VALUES_ONLY})[name](x[0][0], x[1][0]))
    function = VectorisedFunction(x, expression)
    inputs = random_inputs(np.random.default_rng(1), 6)
    np.testing.assert_allclose(dense(function, function(*inputs)), one_by_one(x, expression, inputs), rtol=1e-14)


def test_different_numbers_of_lanes_in_turn() -> None:
    _, _, inputs, function, rng = random_case(3, 50)
    seeds = rng.normal(size=(len(function.row), 50))
    all_values, all_slopes = function(*inputs), np.vstack(function.pullback(inputs, seeds))
    for instants in (50, 1, 7, 7, 0, 50, 2):
        part = [np.ascontiguousarray(v[:, :instants]) for v in inputs]
        np.testing.assert_allclose(function(*part), all_values[:, :instants], rtol=1e-13)
        slopes = np.vstack(function.pullback(part, seeds[:, :instants]))
        np.testing.assert_allclose(slopes, all_slopes[:, :instants], rtol=1e-12, atol=1e-14)


def test_inputs_are_left_alone_and_results_are_the_callers() -> None:
    _, _, inputs, function, rng = random_case(4, 5)
    before = [v.copy() for v in inputs]
    first = function(*inputs)
    kept = first.copy()
    slopes = function.pullback(inputs, np.ones_like(first))
    kept_slopes = [s.copy() for s in slopes]
    function(*random_inputs(rng, 5))
    function.pullback(random_inputs(rng, 5), np.ones_like(first))
    for found, expected in zip([first, *slopes, *inputs], [kept, *kept_slopes, *before], strict=True):
        np.testing.assert_array_equal(found, expected)


def test_zeros_are_not_stored_and_constants_are() -> None:
    x = symbols()
    matrix = ca.SX(2, 3)
    matrix[0, 2], matrix[1, 0], matrix[1, 1] = 5.0, x[0][1], 0.0
    function = VectorisedFunction(x, matrix)
    assert function.shape == (2, 3)
    assert sorted(zip(function.row.tolist(), function.column.tolist(), strict=True)) == [(0, 2), (1, 0)]
    values = dense(function, function(np.full((3, 4), 7.0), np.zeros((2, 4))))
    np.testing.assert_array_equal(values[:, :, 3], [[0, 0, 5], [7, 0, 0]])
    slopes = np.vstack(function.pullback([np.zeros((3, 4)), np.zeros((2, 4))], np.ones((2, 4))))
    np.testing.assert_array_equal(slopes, np.repeat([[0], [1], [0], [0], [0]], 4, axis=1))


@pytest.mark.parametrize("operation", [ca.atan, ca.sinh, lambda a: ca.erf(a), lambda a: ca.if_else(a > 0, a, 1.0)])
def test_an_instruction_that_machine_code_lacks_is_casadis(operation: Callable[[ca.SX], ca.SX]) -> None:
    x, inputs = symbols(), random_inputs(np.random.default_rng(5), 70)
    expression = ca.SX(operation(x[0][0]))
    function = VectorisedFunction(x, expression)
    np.testing.assert_array_equal(dense(function, function(*inputs)), one_by_one(x, expression, inputs))


def test_a_derivative_that_needs_such_an_instruction_is_too() -> None:
    x, inputs = symbols(), random_inputs(np.random.default_rng(5), 3)
    function = VectorisedFunction(x, POWER["power"](x[0][0], x[1][0]))  # its slope holds a logarithm
    slopes = function.pullback(inputs, np.ones((1, 3)))
    base = 1 + inputs[0][0] ** 2
    np.testing.assert_allclose(slopes[1][0], base ** inputs[1][0] * np.log(base), rtol=1e-13)


def test_where_llvm_is_missing_casadis_machine_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "llvmlite.binding", None)
    machine_code._target.cache_clear()
    x = symbols()
    function = VectorisedFunction(x, ca.SX(x[0][0] * x[1][0]))
    inputs = random_inputs(np.random.default_rng(1), 3)
    np.testing.assert_array_equal(function(*inputs)[0], inputs[0][0] * inputs[1][0])
    with pytest.raises(machine_code.NotCompiledError, match="llvmlite"):
        machine_code._target()
    machine_code._target.cache_clear()


@pytest.mark.parametrize("seed", range(0, 20, 4))
def test_casadi_and_machine_code_round_alike(seed: int, machine: str) -> None:
    if machine == "interpreted":
        pytest.skip("compares both")
    rng, x = np.random.default_rng(seed), symbols()
    expression = random_expression(x, {**SMOOTH, **KINKED, **POWER}, rng)
    inputs = random_inputs(rng, 101)
    compiled = VectorisedFunction(x, expression)(*inputs)
    assert vectorised.evaluation().startswith("expressions compiled by llvmlite ")
    assert vectorised.interpreted_note() == ()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(vectorised, "MachineCode", refused)
        np.testing.assert_array_equal(VectorisedFunction(x, expression)(*inputs), compiled)
        said = vectorised.evaluation()
        assert said.startswith(f"expressions interpreted by CasADi {ca.__version__}: llvmlite is missing")
        assert vectorised.interpreted_note() == (f"{said}; the numbers are the same, but take longer",)


def test_steps_that_follow_each_other_round_alike(machine: str) -> None:
    if machine == "interpreted":
        pytest.skip("compares both")
    s, r = ca.SX.sym("s", 2), ca.SX.sym("r", 1, 2)
    operations = {**KINKED, **VALUES_ONLY, **POWER, "where": lambda a, b: ca.if_else(a < b, a, -b)}
    after = ca.vertcat(ca.cos(s[1] + r[0]), ca.tanh(s[0] * r[1]), *(f(s[0], s[1] + r[0]) for f in operations.values()))
    step, start = ca.Function("step", [s, r], [after]), np.array([0.1, 0.2])
    for steps in (1, 7):
        inputs = np.random.default_rng(steps).normal(size=(1, 2 * steps))
        compiled, interpreted = (vectorised.in_turn(step, count)(start, inputs) for count in (10_000, 1))
        np.testing.assert_array_equal(compiled, interpreted)


NUMPYS = {"add": np.add, "divide": lambda a, b: a / (1 + b * b), "root": lambda a, b: np.sqrt(1 + a * a)}
NUMPYS |= {"sign": lambda a, b: np.sign(a), "fabs": lambda a, b: np.fabs(a), "smaller": np.minimum}
NUMPYS |= {"larger": np.maximum}


def pairs(*values: float) -> list[np.ndarray]:
    """All pairs of some values, one to a lane."""
    return [np.array(part)[None, :] for part in zip(*((a, b) for a in values for b in values), strict=True)]


@pytest.mark.parametrize("name", NUMPYS)
def test_not_a_number_and_infinity_are_numpys(name: str) -> None:
    x = [ca.SX.sym("x"), ca.SX.sym("y")]
    expression = ca.SX({**KINKED, **POWER, **VALUES_ONLY}[name](*x))
    function = ca.Function("plain", x, [expression])
    inputs = pairs(np.nan, np.inf, -np.inf, 0.0, -2.0, 1e308)
    with np.errstate(all="ignore"):
        expected = NUMPYS[name](*inputs)
    np.testing.assert_array_equal(machine_code.MachineCode(function)(inputs), expected)


@pytest.mark.parametrize(
    "choice",
    [lambda a, b: a < b, lambda a, b: ca.logic_not(a), lambda a, b: ca.if_else(a < b, 3 * a, b)],
    ids=["less", "not", "either"],
)
def test_comparisons_of_machine_code_are_casadis(choice: Callable[[ca.SX, ca.SX], ca.SX]) -> None:
    x = [ca.SX.sym("x"), ca.SX.sym("y")]
    function = ca.Function("plain", x, [choice(*x)])
    inputs = pairs(np.inf, -np.inf, 0.0, -0.0, -2.0, 1e308)
    np.testing.assert_array_equal(machine_code.MachineCode(function)(inputs), np.array(function(*inputs)))
