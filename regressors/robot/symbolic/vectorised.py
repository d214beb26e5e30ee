"""CasADi expressions evaluated for many instants at once.

The instructions of a CasADi function run as machine code (`regressors.robot.symbolic.machine_code`). Where LLVM is
missing, they run on NumPy arrays that hold one number per instant, which is as fast as CasADi's own machine or
faster. Both round alike, bit for bit: a search is steered by its last digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cached_property
from importlib import import_module

import casadi as ca
import numpy as np

from regressors.errors import NumericalError
from regressors.robot.symbolic.machine_code import MachineCode, NotCompiledError
from regressors.samples import Array, Index, Samples

_CHUNK = 4096
SparseRow = tuple[Index, Array]  # columns of a row, and its entries in them at every sample, (k,) and (k, N)


def _of_c(function: Callable[..., float], counterpart: np.ufunc) -> Callable[..., object]:
    """A function of the C library for arrays, as machine code calls it: NumPy's own rounds in another manner.

    What Python's `math` raises an error for, such as an overflow, is NumPy's.
    """
    each = np.frompyfunc(function, counterpart.nin, 1)

    def values(*arguments: Array) -> Array:
        *inputs, out = arguments
        try:
            out[...] = each(*inputs)
        except (OverflowError, ValueError):
            counterpart(*inputs, out)
        return out

    return values


_FUNCTIONS = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_POW: _of_c(math.pow, np.power),
    ca.OP_FMIN: lambda a, b, out: np.minimum(a, b, out=out),  # by name: NumPy takes two positional ones only
    ca.OP_FMAX: lambda a, b, out: np.maximum(a, b, out=out),
    ca.OP_NEG: np.negative,
    ca.OP_SQ: np.square,
    ca.OP_SIN: _of_c(math.sin, np.sin),
    ca.OP_COS: _of_c(math.cos, np.cos),
    ca.OP_SQRT: np.sqrt,
    ca.OP_TANH: _of_c(math.tanh, np.tanh),
    ca.OP_EXP: _of_c(math.exp, np.exp),
    ca.OP_SIGN: np.sign,
    ca.OP_FABS: np.fabs,
    ca.OP_INV: np.reciprocal,
}


def _check(function: ca.Function) -> None:
    """Refuse an instruction that has no NumPy counterpart (`ValueError`) and infinite constants (`NumericalError`)."""
    known = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_TWICE, *_FUNCTIONS}
    kinds = [function.instruction_id(k) for k in range(function.n_instructions())]
    for op in set(kinds) - known:
        raise ValueError(f"CasADi instruction {op} has no NumPy counterpart here")
    if not all(np.isfinite(function.instruction_constant(k)) for k, op in enumerate(kinds) if op == ca.OP_CONST):
        raise NumericalError("a constant of the model is not finite; check the lengths, masses and limits of the robot")


def _source(function: ca.Function) -> str:
    """Python text of a function's instructions, one line each, every result written into its own buffer."""
    lines = [f"def run(inputs, out, b, f):\n    ({','.join(f'x{i}' for i in range(function.n_in()))},) = inputs"]
    lines += [f"    f{op} = f[{op}]" for op in _FUNCTIONS]
    for k in range(function.n_instructions()):
        op, o, i = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_INPUT:
            lines.append(f"    w{o[0]} = x{i[0]}[{i[1]}]")
        elif op == ca.OP_OUTPUT:
            lines.append(f"    out[{o[1]}] = w{i[0]}")
        elif op == ca.OP_CONST:
            lines.append(f"    w{o[0]} = {function.instruction_constant(k)!r}")
        else:
            name, operands = (ca.OP_ADD, [*i, *i]) if op == ca.OP_TWICE else (op, i)
            lines.append(f"    w{o[0]} = f{name}({''.join(f'w{k}, ' for k in operands)}b[{o[0]}])")
    return "\n".join(lines)


def _program(function: ca.Function) -> Callable[[Sequence[Array]], Array]:
    """Values, shape (numbers of the result, instants), from the inputs at as many instants."""
    _check(function)
    try:
        return MachineCode(function)
    except NotCompiledError:
        return _array_program(function)


def evaluation() -> str:
    """How this process evaluates expressions: compiled, by which version, or interpreted, and why."""
    x = ca.SX.sym("x")
    try:
        MachineCode(ca.Function("probe", [x], [x * x]))
    except NotCompiledError as error:
        return f"expressions interpreted by NumPy {np.__version__}: llvmlite is missing or does not work ({error})"
    return f"expressions compiled by llvmlite {import_module('llvmlite').__version__}"


def interpreted_note() -> tuple[str, ...]:
    """What the user should know where expressions are not compiled; empty where they are."""
    said = evaluation()
    return () if "compiled" in said else (f"{said}; the numbers are the same, but take longer",)


def _array_program(function: ca.Function) -> Callable[[Sequence[Array]], Array]:
    """Instructions on NumPy arrays, with the buffers for one number of instants."""
    scope: dict[str, Callable[..., None]] = {}
    exec(compile(_source(function), f"<vectorised {function.name()}>", "exec"), scope)
    buffers: list[Array] = []

    def program(inputs: Sequence[Array]) -> Array:
        instants = inputs[0].shape[1]
        if not buffers or buffers[0].size != instants:
            buffers[:] = np.empty((function.sz_w(), instants))
        out = np.empty((function.numel_out(0), instants))
        with np.errstate(all="ignore"):
            scope["run"](inputs, out, buffers, _FUNCTIONS)
        return out

    return program


_TO_COMPILE = 3000  # steps that take longer than the translation


def in_turn(step: ca.Function, count: int) -> Callable[[Array, Array], Array]:
    """Results of a step that is taken about `count` times, of a first state (n,) and inputs (m, k steps), as columns.

    The step has a state and an input (m, k); the first numbers of its result are the next state.
    """
    (size, _), (_, width) = step.size_in(0), step.size_in(1)
    if count > _TO_COMPILE:
        with suppress(NotCompiledError):
            code = MachineCode(step.expand(), lanes=1)
            return lambda state, inputs: code.in_turn(state, inputs.T.reshape(-1, width * len(inputs)).T)
    x, r = ca.MX.sym("x", size), ca.MX.sym("r", *step.size_in(1))
    result = step(x, r)
    chained = ca.Function("chained", [x, r], [result[:size], result])
    return lambda state, inputs: np.array(chained.mapaccum(inputs.shape[1] // width)(state, inputs)[1])


_FEW, _AT_ONCE = 10_000, 64  # instants that take CasADi's machine less time than the translation; those of one call


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
        _check(self._function)
        self._reverse: Callable[[Sequence[Array]], Array] | None = None
        self._seldom = 0  # instants that were asked of `seldom`

    @property
    def instructions(self) -> int:
        """Number of them, for one instant."""
        return int(self._function.n_instructions())

    @cached_property
    def _forward(self) -> Callable[[Sequence[Array]], Array]:
        return _program(self._function)

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
        instants = inputs[0].shape[1]
        self._seldom += instants
        if self._seldom > _FEW or not instants * len(self.row):
            return self(*inputs)
        more = -instants % _AT_ONCE
        given = [np.ascontiguousarray(np.pad(x, ((0, 0), (0, more))).T) for x in inputs]
        values = np.empty((instants + more, len(self.row)))
        buffers, evaluate = self._function.map(_AT_ONCE).buffer()  # CasADi keeps the map
        for first in range(0, instants, _AT_ONCE):
            for k, x in enumerate(given):
                buffers.set_arg(k, x[first : first + _AT_ONCE].data)
            buffers.set_res(0, values[first : first + _AT_ONCE].data)
            evaluate()
        return np.ascontiguousarray(values[:instants].T)

    def pullback(self, inputs: Sequence[Array], seeds: Array) -> tuple[Array, ...]:
        """Gradient of ``sum(seeds * values)`` with respect to the inputs, by one reverse sweep."""
        # inputs (n_k, instants); seeds (nnz, instants)
        if self._reverse is None:
            seed = ca.SX.sym("seed", len(self.row))
            gradient = ca.cse(ca.gradient(ca.dot(self._values, seed), ca.vertcat(*self._inputs)))
            self._reverse = _program(ca.Function("reverse", [*self._inputs, seed], [ca.densify(gradient)]))
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
