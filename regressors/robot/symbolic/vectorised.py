"""CasADi expressions evaluated for many instants at once.

The instructions of a CasADi function run as machine code (`regressors.robot.symbolic.machine_code`). Where LLVM is
missing, or has no counterpart of one of them, CasADi's own machine runs them, which is much slower. Both round alike,
bit for bit: a search is steered by its last digits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cached_property, partial
from importlib import import_module

import casadi as ca
import numpy as np

from regressors.errors import NumericalError
from regressors.robot.symbolic.machine_code import MachineCode, NotCompiledError
from regressors.samples import Array, Index, Samples

_CHUNK = 4096
SparseRow = tuple[Index, Array]  # columns of a row, and its entries in them at every sample, (k,) and (k, N)


def _check_constants(function: ca.Function) -> None:
    """Refuse infinite constants (`NumericalError`)."""
    constants = (k for k in range(function.n_instructions()) if function.instruction_id(k) == ca.OP_CONST)
    if not all(np.isfinite(function.instruction_constant(k)) for k in constants):
        raise NumericalError("a constant of the model is not finite; check the lengths, masses and limits of the robot")


def program(function: ca.Function) -> Callable[[Sequence[Array]], Array]:
    """Values, shape (numbers of the result, instants), from the columns of a function at as many instants."""
    _check_constants(function)
    try:
        return MachineCode(function)
    except NotCompiledError:
        return partial(_by_casadi, function)


_AT_ONCE = 64  # instants of one call


def _by_casadi(function: ca.Function, inputs: Sequence[Array]) -> Array:
    """The same values by CasADi's own machine."""
    instants = inputs[0].shape[1]
    more = -instants % _AT_ONCE
    given = [np.ascontiguousarray(np.pad(x, ((0, 0), (0, more))).T, dtype=float) for x in inputs]
    values = np.empty((instants + more, function.numel_out(0)))
    buffers, evaluate = function.map(_AT_ONCE).buffer()  # CasADi keeps the map
    for first in range(0, instants if values.size else 0, _AT_ONCE):
        for k, x in enumerate(given):
            buffers.set_arg(k, x[first : first + _AT_ONCE].data)
        buffers.set_res(0, values[first : first + _AT_ONCE].data)
        evaluate()
    return np.ascontiguousarray(values[:instants].T)


def evaluation() -> str:
    """How this process evaluates expressions: compiled, by which version, or interpreted, and why."""
    x = ca.SX.sym("x")
    try:
        MachineCode(ca.Function("probe", [x], [x * x]))
    except NotCompiledError as error:
        return f"expressions interpreted by CasADi {ca.__version__}: llvmlite is missing or does not work ({error})"
    return f"expressions compiled by llvmlite {import_module('llvmlite').__version__}"


def interpreted_note() -> tuple[str, ...]:
    """What the user should know where expressions are not compiled; empty where they are."""
    said = evaluation()
    return () if "compiled" in said else (f"{said}; the numbers are the same, but take longer",)


_TO_COMPILE = 3000  # steps that take longer than the translation


def in_turn(step: ca.Function, count: int) -> Callable[[Array, Array], Array]:
    """Results of a step that is taken about `count` times, of a first state (n,) and inputs (m, k steps), as columns.

    The step has a state and an input (m, k); the first numbers of its result are the next state.
    """
    (size, _), (_, width) = step.size_in(0), step.size_in(1)
    if count > _TO_COMPILE:
        with suppress(NotCompiledError):
            code = MachineCode(step.expand(), size)
            return lambda state, inputs: code.in_turn(state, inputs.T.reshape(-1, width * len(inputs)).T)
    x, r = ca.MX.sym("x", size), ca.MX.sym("r", *step.size_in(1))
    result = step(x, r)
    chained = ca.Function("chained", [x, r], [result[:size], result])
    return lambda state, inputs: np.array(chained.mapaccum(inputs.shape[1] // width)(state, inputs)[1])


_FEW = 5_000  # instants that take CasADi's machine less time than the translation


class VectorisedFunction:
    """The structural nonzeros of a matrix expression, and their reverse derivative, for many instants at once."""

    def __init__(self, inputs: Sequence[ca.SX], expression: ca.SX) -> None:
        expression = ca.sparsify(ca.cse(ca.sparsify(expression)))
        row, column = expression.sparsity().get_triplet()
        self.row: Index = np.asarray(row, dtype=np.intp)
        self.column: Index = np.asarray(column, dtype=np.intp)
        self.shape = expression.shape
        self._inputs = list(inputs)
        self._sizes = [x.numel() for x in inputs]
        self._values = ca.vertcat(*expression.nonzeros())
        self._function = ca.Function("forward", self._inputs, [self._values])
        _check_constants(self._function)
        self._reverse: Callable[[Sequence[Array]], Array] | None = None
        self._seldom = 0  # instants that were asked of `seldom`

    @property
    def instructions(self) -> int:
        """Number of them, for one instant."""
        return int(self._function.n_instructions())

    @cached_property
    def _forward(self) -> Callable[[Sequence[Array]], Array]:
        return program(self._function)

    def __call__(self, *inputs: Array) -> Array:
        """Nonzeros of the matrix at every instant."""  # inputs (n_k, instants)
        return self._forward(inputs)

    def selection(self, nonzeros: Index) -> VectorisedFunction:
        """Some of the nonzeros, in another order, as a column: what only the others need is not computed."""
        # nonzeros (k,)
        return VectorisedFunction(self._inputs, ca.vertcat(*(self._values[int(k)] for k in nonzeros)))

    def seldom(self, *inputs: Array) -> Array:
        """The same nonzeros; the first by CasADi's own machine, which is slower, but needs no translation."""
        # inputs (n_k, instants)
        self._seldom += inputs[0].shape[1] + -inputs[0].shape[1] % _AT_ONCE
        return self(*inputs) if self._seldom > _FEW else _by_casadi(self._function, inputs)

    def pullback(self, inputs: Sequence[Array], seeds: Array) -> tuple[Array, ...]:
        """Gradient of ``sum(seeds * values)`` with respect to the inputs, by one reverse sweep."""
        # inputs (n_k, instants); seeds (nnz, instants)
        if self._reverse is None:
            seed = ca.SX.sym("seed", len(self.row))
            gradient = ca.cse(ca.gradient(ca.dot(self._values, seed), ca.vertcat(*self._inputs)))
            self._reverse = program(ca.Function("reverse", [*self._inputs, seed], [ca.densify(gradient)]))
        stacked = self._reverse((*inputs, seeds))
        return tuple(np.split(stacked, np.cumsum(self._sizes)[:-1]))


def evaluate_samples(function: VectorisedFunction, samples: Samples, columns: Index | None = None) -> Array:
    """Values of a matrix expression at every sample, shape (N, rows, columns); of some columns, or of all."""
    values = np.zeros((samples.time.size, function.shape[0], function.shape[1] if columns is None else columns.size))
    for start in range(0, samples.time.size, _CHUNK):
        chunk = slice(start, start + _CHUNK)
        for row, (place, found) in enumerate(rows_at_samples(function, samples.rows(chunk), columns)):
            values[chunk, row, place] = found.T
    return values


def rows_at_samples(function: VectorisedFunction, samples: Samples, columns: Index | None = None) -> list[SparseRow]:
    """Which of some columns, or of all, each row has entries in by its structure, and these at every sample."""
    place = np.arange(function.shape[1])
    if columns is not None:
        place = np.full(function.shape[1], -1)
        place[columns] = np.arange(columns.size)
    column = place[function.column]
    found = function.seldom(*(np.ascontiguousarray(x.T) for x in (samples.q, samples.dq, samples.ddq)))
    used = (np.flatnonzero((function.row == row) & (column >= 0)) for row in range(function.shape[0]))
    return [(column[k], found[k]) for k in used]
