"""CasADi expressions enclosed over boxes: bounds that hold for every point of a box, many boxes at once.

The instructions of a CasADi function run here on pairs of NumPy arrays, lower and upper ends, one box per lane
[Moore 1966]. Ends are moved outwards by a little more than rounding after each instruction, so that what is proven with
them is proven.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Interval = tuple[Array, Array]
_OUTWARDS = 4e-16


def _wider(low: Array, high: Array) -> Interval:
    return low - _OUTWARDS * np.abs(low), high + _OUTWARDS * np.abs(high)


def _add(a: Interval, b: Interval) -> Interval:
    return a[0] + b[0], a[1] + b[1]


def _sub(a: Interval, b: Interval) -> Interval:
    return a[0] - b[1], a[1] - b[0]


def _mul(a: Interval, b: Interval) -> Interval:
    products = [x * y for x in a for y in b]
    return np.minimum.reduce(products), np.maximum.reduce(products)


def _inv(a: Interval) -> Interval:
    crosses = (a[0] <= 0) & (a[1] >= 0)
    with np.errstate(divide="ignore"):
        low, high = 1.0 / a[1], 1.0 / a[0]
    return np.where(crosses, -np.inf, low), np.where(crosses, np.inf, high)


def _div(a: Interval, b: Interval) -> Interval:
    return _mul(a, _inv(b))


def _square(a: Interval) -> Interval:
    low, high = a[0] ** 2, a[1] ** 2
    crosses = (a[0] < 0) & (a[1] > 0)
    return np.where(crosses, 0.0, np.minimum(low, high)), np.maximum(low, high)


def _absolute(a: Interval) -> Interval:
    low, high = np.abs(a[0]), np.abs(a[1])
    crosses = (a[0] < 0) & (a[1] > 0)
    return np.where(crosses, 0.0, np.minimum(low, high)), np.maximum(low, high)


def _rising(function: Callable[[Array], Array]) -> Callable[[Interval], Interval]:
    return lambda a: (function(a[0]), function(a[1]))


def _cosine(a: Interval) -> Interval:
    """Extremes at the ends, and at the multiples of pi inside."""
    low, high = np.cos(a[0]), np.cos(a[1])
    first = np.ceil(a[0] / np.pi)
    last = np.floor(a[1] / np.pi)
    inside = last - first
    even = np.mod(first, 2) == 0
    top = (inside >= 1) | ((inside >= 0) & even)
    bottom = (inside >= 1) | ((inside >= 0) & ~even)
    return np.where(bottom, -1.0, np.minimum(low, high)), np.where(top, 1.0, np.maximum(low, high))


def _sine(a: Interval) -> Interval:
    return _cosine((a[0] - np.pi / 2 - 1e-15 * np.abs(a[0]), a[1] - np.pi / 2 + 1e-15 * np.abs(a[1])))


_UNARY: dict[int, Callable[[Interval], Interval]] = {
    ca.OP_NEG: lambda a: (-a[1], -a[0]),
    ca.OP_SQ: _square,
    ca.OP_TWICE: lambda a: (2 * a[0], 2 * a[1]),
    ca.OP_SIN: _sine,
    ca.OP_COS: _cosine,
    ca.OP_SQRT: _rising(lambda x: np.sqrt(np.maximum(x, 0.0))),
    ca.OP_TANH: _rising(np.tanh),
    ca.OP_SIGN: _rising(np.sign),
    ca.OP_FABS: _absolute,
    ca.OP_INV: _inv,
}
_BINARY: dict[int, Callable[[Interval, Interval], Interval]] = {
    ca.OP_ADD: _add,
    ca.OP_SUB: _sub,
    ca.OP_MUL: _mul,
    ca.OP_DIV: _div,
    ca.OP_FMIN: lambda a, b: (np.minimum(a[0], b[0]), np.minimum(a[1], b[1])),
    ca.OP_FMAX: lambda a, b: (np.maximum(a[0], b[0]), np.maximum(a[1], b[1])),
}


class IntervalFunction:
    """Enclosure of a vector expression over boxes.

    Parameters
    ----------
    inputs : sequence of SX, shape (n_k, 1) each
        Free symbols.
    expression : SX, shape (r, 1)
    """

    def __init__(self, inputs: Sequence[ca.SX], expression: ca.SX) -> None:
        self._function = ca.Function("enclosed", list(inputs), [ca.densify(ca.cse(expression))])

    def __call__(self, low: Sequence[Array], high: Sequence[Array]) -> Interval:
        """Bounds of every component on every box.

        Parameters
        ----------
        low, high : sequence of ndarray, shape (n_k, boxes)
            Lower and upper ends of the inputs.

        Returns
        -------
        low, high : ndarray, shape (r, boxes)
        """
        f, boxes = self._function, low[0].shape[1]
        work: list[Interval] = [(np.zeros(boxes), np.zeros(boxes))] * f.sz_w()
        out_low, out_high = np.zeros((f.numel_out(0), boxes)), np.zeros((f.numel_out(0), boxes))
        with np.errstate(invalid="ignore", over="ignore"):
            for k in range(f.n_instructions()):
                op, o, i = f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)
                if op == ca.OP_INPUT:
                    work[o[0]] = (low[i[0]][i[1]], high[i[0]][i[1]])
                elif op == ca.OP_OUTPUT:
                    out_low[o[1]], out_high[o[1]] = work[i[0]]
                elif op == ca.OP_CONST:
                    value = np.full(boxes, f.instruction_constant(k))
                    work[o[0]] = (value, value)
                elif op in _UNARY:
                    work[o[0]] = _wider(*_UNARY[op](work[i[0]]))
                elif op in _BINARY:
                    work[o[0]] = _wider(*_BINARY[op](work[i[0]], work[i[1]]))
                else:
                    raise ValueError(f"CasADi instruction {op} has no enclosure here")
        return out_low, out_high
