"""CasADi expressions enclosed over boxes: bounds that hold for every point of a box, many boxes at once.

The instructions of a CasADi function run here on pairs of NumPy arrays, lower and upper ends, one box each [Moore
1966]. Ends are moved outwards by a little more than rounding after each instruction, so that the bounds hold
rigorously.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from regressors.samples import Array

Interval = Array  # (2, boxes), lower and upper ends
OverBoxes = Callable[[Sequence[Array], Sequence[Array]], tuple[Array, Array]]
_OUTWARDS = 1e-15  # relative: a few times the rounding error of an instruction
_LEAST = 1e-300  # absolute, against underflow
_UNBOUNDED = np.array([[-np.inf], [np.inf]])


def _wider(ends: Interval) -> Interval:
    """Ends moved outwards, in place; an end that is NaN stays so, which means infinite."""
    slack = np.abs(ends)
    slack *= _OUTWARDS
    slack += _LEAST
    ends[0] -= slack[0]
    ends[1] += slack[1]
    return ends


def _mul(a: Interval, b: Interval) -> Interval:
    products, ends = (a[:, None] * b).reshape(4, -1), np.empty_like(a)
    np.minimum.reduce(products, out=ends[0])
    np.maximum.reduce(products, out=ends[1])
    return ends


def _inv(a: Interval) -> Interval:
    """Reciprocal; unbounded where the divisor may be zero."""
    return np.where((a[0] > 0) | (a[1] < 0), 1.0 / a[::-1], _UNBOUNDED)


def _even(function: Callable[[Array], Array]) -> Callable[[Interval], Interval]:
    """Enclosure of a function that falls to zero at zero and rises from there."""

    def enclosure(a: Interval) -> Interval:
        low, high = function(a)
        crosses = (a[0] < 0) & (a[1] > 0)
        return np.stack([np.where(crosses, 0.0, np.minimum(low, high)), np.maximum(low, high)])

    return enclosure


def _wave(function: Callable[[Array], Array], crest: float) -> Callable[[Interval], Interval]:
    """Enclosure of a cosine with crests at ``(crest + 2 k) pi``, from its ends and the crests and troughs inside."""

    def enclosure(a: Interval) -> Interval:
        low, high = function(a)
        turns = a / np.pi - crest
        slack = _OUTWARDS * (np.abs(turns) + 1.0)  # one extremum too many only widens the bounds
        first, last = np.ceil(turns[0] - slack[0]), np.floor(turns[1] + slack[1])
        both, single = last - first >= 1, last == first
        even = np.mod(first, 2) == 0
        top, bottom = both | (single & even), both | (single & ~even)
        return np.stack([np.where(bottom, -1.0, np.minimum(low, high)), np.where(top, 1.0, np.maximum(low, high))])

    return enclosure


_UNARY: dict[int, Callable[[Interval], Interval]] = {
    ca.OP_NEG: lambda a: -a[::-1],
    ca.OP_SQ: _even(np.square),
    ca.OP_TWICE: lambda a: 2 * a,
    ca.OP_SIN: _wave(np.sin, 0.5),
    ca.OP_COS: _wave(np.cos, 0.0),
    ca.OP_SQRT: lambda a: np.sqrt(np.maximum(a, 0.0)),
    ca.OP_TANH: np.tanh,
    ca.OP_EXP: np.exp,
    ca.OP_SIGN: np.sign,
    ca.OP_FABS: _even(np.abs),
    ca.OP_INV: _inv,
}
_BINARY: dict[int, Callable[[Interval, Interval], Interval]] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: lambda a, b: a - b[::-1],
    ca.OP_MUL: _mul,
    ca.OP_DIV: lambda a, b: _mul(a, _inv(b)),
    ca.OP_FMIN: np.minimum,
    ca.OP_FMAX: np.maximum,
}


Step = tuple[int, list[int], list[int]]  # operation, and the numbers of its result and of what it takes
_KNOWN = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, *_UNARY, *_BINARY}
_CHUNK = 4096


def interval_function(inputs: Sequence[ca.SX], expression: ca.SX) -> OverBoxes:
    """Enclosure of a vector expression: from lower and upper ends of boxes, bounds of every component on every box."""
    # inputs (n_k, 1); expression (r, 1); ends (n_k, boxes); bounds (r, boxes)
    f = ca.Function("enclosed", list(inputs), [ca.densify(ca.cse(expression))])
    numbers = range(f.n_instructions())
    steps = [(f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)) for k in numbers]
    if unknown := {op for op, *_ in steps} - _KNOWN:
        raise ValueError(f"CasADi instruction {min(unknown)} has no enclosure here")
    constants = [f.instruction_constant(k) if steps[k][0] == ca.OP_CONST else 0.0 for k in numbers]

    def bounds(low: Sequence[Array], high: Sequence[Array]) -> tuple[Array, Array]:
        boxes = low[0].shape[1]
        out = np.zeros((2, f.numel_out(0), boxes))
        given = [np.stack(ends, axis=1) for ends in zip(low, high, strict=True)]  # each (n_k, 2, boxes)
        for start in range(0, boxes, _CHUNK):
            part = slice(start, start + _CHUNK)
            with np.errstate(all="ignore"):
                _run(steps, constants, [x[:, :, part] for x in given], out[:, :, part])
        return np.fmax(out[0], -np.inf), np.fmin(out[1], np.inf)  # of what is not known, nothing

    return bounds


def _run(steps: list[Step], constants: list[float], given: list[Array], out: Array) -> None:
    work: dict[int, Interval] = {}
    for (op, o, i), constant in zip(steps, constants, strict=True):
        if op == ca.OP_INPUT:
            work[o[0]] = given[i[0]][i[1]]
        elif op == ca.OP_OUTPUT:
            out[:, o[1]] = work[i[0]]
        elif op == ca.OP_CONST:
            work[o[0]] = np.full((2, out.shape[2]), constant)
        elif op in _UNARY:
            work[o[0]] = _wider(_UNARY[op](work[i[0]]))
        else:
            work[o[0]] = _wider(_BINARY[op](work[i[0]], work[i[1]]))
