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

Interval = tuple[Array, Array]
OverBoxes = Callable[[Sequence[Array], Sequence[Array]], Interval]
_OUTWARDS = 1e-15  # relative: a few times the rounding error of an instruction
_LEAST = 1e-300  # absolute, against underflow


def _wider(low: Array, high: Array) -> Interval:
    """Ends moved outwards; an end that is NaN becomes infinite."""
    return (
        np.fmax(low - (_OUTWARDS * np.abs(low) + _LEAST), -np.inf),
        np.fmin(high + (_OUTWARDS * np.abs(high) + _LEAST), np.inf),
    )


def _mul(a: Interval, b: Interval) -> Interval:
    p, q, r, s = (x * y for x in a for y in b)
    return np.minimum(np.minimum(p, q), np.minimum(r, s)), np.maximum(np.maximum(p, q), np.maximum(r, s))


def _inv(a: Interval) -> Interval:
    """Reciprocal; unbounded where the divisor may be zero."""
    crosses = (a[0] <= 0) & (a[1] >= 0)
    return np.where(crosses, -np.inf, 1.0 / a[1]), np.where(crosses, np.inf, 1.0 / a[0])


def _even(function: Callable[[Array], Array]) -> Callable[[Interval], Interval]:
    """Enclosure of a function that falls to zero at zero and rises from there."""

    def enclosure(a: Interval) -> Interval:
        low, high = function(a[0]), function(a[1])
        crosses = (a[0] < 0) & (a[1] > 0)
        return np.where(crosses, 0.0, np.minimum(low, high)), np.maximum(low, high)

    return enclosure


def _rising(function: Callable[[Array], Array]) -> Callable[[Interval], Interval]:
    return lambda a: (function(a[0]), function(a[1]))


def _wave(function: Callable[[Array], Array], crest: float) -> Callable[[Interval], Interval]:
    """Enclosure of a cosine with crests at ``(crest + 2 k) pi``, from its ends and the crests and troughs inside."""

    def enclosure(a: Interval) -> Interval:
        low, high = function(a[0]), function(a[1])
        turns = [end / np.pi - crest for end in a]
        slack = [_OUTWARDS * (np.abs(turn) + 1.0) for turn in turns]  # one extremum too many only widens the bounds
        first, last = np.ceil(turns[0] - slack[0]), np.floor(turns[1] + slack[1])
        both, single = last - first >= 1, last == first
        even = np.mod(first, 2) == 0
        top, bottom = both | (single & even), both | (single & ~even)
        return np.where(bottom, -1.0, np.minimum(low, high)), np.where(top, 1.0, np.maximum(low, high))

    return enclosure


_UNARY: dict[int, Callable[[Interval], Interval]] = {
    ca.OP_NEG: lambda a: (-a[1], -a[0]),
    ca.OP_SQ: _even(np.square),
    ca.OP_TWICE: lambda a: (2 * a[0], 2 * a[1]),
    ca.OP_SIN: _wave(np.sin, 0.5),
    ca.OP_COS: _wave(np.cos, 0.0),
    ca.OP_SQRT: _rising(lambda x: np.sqrt(np.maximum(x, 0.0))),
    ca.OP_TANH: _rising(np.tanh),
    ca.OP_EXP: _rising(np.exp),
    ca.OP_SIGN: _rising(np.sign),
    ca.OP_FABS: _even(np.abs),
    ca.OP_INV: _inv,
}
_BINARY: dict[int, Callable[[Interval, Interval], Interval]] = {
    ca.OP_ADD: lambda a, b: (a[0] + b[0], a[1] + b[1]),
    ca.OP_SUB: lambda a, b: (a[0] - b[1], a[1] - b[0]),
    ca.OP_MUL: _mul,
    ca.OP_DIV: lambda a, b: _mul(a, _inv(b)),
    ca.OP_FMIN: lambda a, b: (np.minimum(a[0], b[0]), np.minimum(a[1], b[1])),
    ca.OP_FMAX: lambda a, b: (np.maximum(a[0], b[0]), np.maximum(a[1], b[1])),
}


_KNOWN = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, *_UNARY, *_BINARY}
_CHUNK = 4096


def interval_function(inputs: Sequence[ca.SX], expression: ca.SX) -> OverBoxes:
    """Enclosure of a vector expression: from lower and upper ends of boxes, bounds of every component on every box."""
    # inputs (n_k, 1); expression (r, 1); ends (n_k, boxes); bounds (r, boxes)
    f = ca.Function("enclosed", list(inputs), [ca.densify(ca.cse(expression))])
    operations = [f.instruction_id(k) for k in range(f.n_instructions())]
    if unknown := set(operations) - _KNOWN:
        raise ValueError(f"CasADi instruction {min(unknown)} has no enclosure here")

    def bounds(low: Sequence[Array], high: Sequence[Array]) -> Interval:
        boxes = low[0].shape[1]
        out = np.zeros((2, f.numel_out(0), boxes))
        for start in range(0, boxes, _CHUNK):
            part = slice(start, start + _CHUNK)
            with np.errstate(all="ignore"):
                _run(f, operations, [x[:, part] for x in low], [x[:, part] for x in high], out[:, :, part])
        return out[0], out[1]

    return bounds


def _run(f: ca.Function, operations: list[int], low: Sequence[Array], high: Sequence[Array], out: Array) -> None:
    work: list[Interval] = [(low[0][0], low[0][0])] * f.sz_w()
    for k, op in enumerate(operations):
        o, i = f.instruction_output(k), f.instruction_input(k)
        if op == ca.OP_INPUT:
            work[o[0]] = (low[i[0]][i[1]], high[i[0]][i[1]])
        elif op == ca.OP_OUTPUT:
            out[:, o[1]] = work[i[0]]
        elif op == ca.OP_CONST:
            value = np.full(out.shape[2], f.instruction_constant(k))
            work[o[0]] = (value, value)
        elif op in _UNARY:
            work[o[0]] = _wider(*_UNARY[op](work[i[0]]))
        else:
            work[o[0]] = _wider(*_BINARY[op](work[i[0]], work[i[1]]))
