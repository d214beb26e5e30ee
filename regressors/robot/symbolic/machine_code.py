"""CasADi expressions as machine code for many instants at once, by LLVM.

The instructions of a CasADi function become one loop over the instants, four at a time, without branches. It is
compiled without LLVM's optimiser: CasADi has eliminated common subexpressions already, and what is left takes longer
to optimise than a search saves by it. Some 10 microseconds an instruction, then some thirty times less a call than
NumPy's.
"""

from __future__ import annotations

import ctypes
import struct
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from regressors.samples import Array

LANES = 4  # instants in one pass of the loop; one, where each needs the result of the one before it
_TYPES = {1: ("double", "i1", "f64"), LANES: (f"<{LANES} x double>", f"<{LANES} x i1>", f"v{LANES}f64")}
_INTRINSIC = {ca.OP_SQRT: "llvm.sqrt", ca.OP_FABS: "llvm.fabs"}
_INSTRUCTIONS = {  # of one or two numbers of all instants of a pass
    ca.OP_ADD: "fadd %V {0}, {1}",
    ca.OP_SUB: "fsub %V {0}, {1}",
    ca.OP_MUL: "fmul %V {0}, {1}",
    ca.OP_DIV: "fdiv %V {0}, {1}",
    ca.OP_TWICE: "fadd %V {0}, {0}",
    ca.OP_SQ: "fmul %V {0}, {0}",
    ca.OP_NEG: "fneg %V {0}",
    ca.OP_INV: "fdiv %V {one}, {0}",
    **{op: f"call %V @{name}.{{kind}}(%V {{0}})" for op, name in _INTRINSIC.items()},
}
_BY_INSTANT = {  # functions of the C library
    ca.OP_SIN: ("sin", 1),
    ca.OP_COS: ("cos", 1),
    ca.OP_TANH: ("tanh", 1),
    ca.OP_EXP: ("exp", 1),
    ca.OP_POW: ("pow", 2),
}
_SMALLER = {ca.OP_FMIN: "ult", ca.OP_FMAX: "ugt"}
_WHERE = {  # a comparison, and the value where it holds, else zero
    ca.OP_LT: ("olt", "{1}", "{one}"),
    ca.OP_NOT: ("oeq", "zeroinitializer", "{one}"),
    ca.OP_IF_ELSE_ZERO: ("une", "zeroinitializer", "{1}"),
}


class NotCompiledError(Exception):
    """LLVM is not installed or cannot compile this; the reason is its text."""


class MachineCode:
    """A CasADi function of column vectors, with one result, for many instants at once, or for one after the other."""

    def __init__(self, function: ca.Function, state: int = 0) -> None:
        self._rows = [function.numel_in(k) for k in range(function.n_in())]
        self._size = function.numel_out(0)
        self._inputs = np.zeros((sum(self._rows), 0))
        self._engine, self._run = _compiled(_text(function, state))

    def __call__(self, inputs: Sequence[Array]) -> Array:
        """Values, shape (numbers of the result, instants), of inputs of shape (numbers of the input, instants)."""
        instants = inputs[0].shape[1]
        padded = -(-instants // LANES) * LANES
        if self._inputs.shape[1] != padded:
            self._inputs = np.zeros((sum(self._rows), padded))
        np.concatenate(inputs, out=self._inputs[:, :instants])
        out = np.empty((self._size, padded))
        if instants:  # the loop runs once before it looks at their number
            self._run(self._inputs.ctypes.data, None, out.ctypes.data, padded)
        return out if padded == instants else out[:, :instants].copy()

    def in_turn(self, state: Array, inputs: Array) -> Array:
        """Results one after the other, shape (numbers, steps): the first numbers of each are the next one's state."""
        # state (n,); inputs (m, steps)
        steps = inputs.shape[1] + 1  # one more: the last result of a row lies where the state of the next row began
        given, results = np.zeros((len(inputs), steps)), np.empty(self._size * steps + 1)
        given[:, :-1], results[: steps * state.size : steps] = inputs, state
        self._run(given.ctypes.data, results.ctypes.data, results[1:].ctypes.data, steps)
        return results[1:].reshape(-1, steps)[:, :-1]


@cache
def _target() -> Any:
    """LLVM's binding, and the kind of processor that it compiles for."""
    try:
        import llvmlite.binding as llvm

        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)  # on POSIX what this process has
        for name, _ in _BY_INSTANT.values():  # by address: a name that LLVM does not find would end the process
            llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
        return llvm, llvm.Target.from_default_triple()
    except (ImportError, AttributeError, OSError, RuntimeError) as error:
        raise NotCompiledError(str(error)) from error


def _compiled(text: str) -> tuple[Any, Any]:
    """The engine, which owns the code, and the function."""
    llvm, target = _target()
    try:
        machine = target.create_target_machine(  # of its own: the engine owns and ends it
            cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=0
        )
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(text), machine)
        engine.finalize_object()
    except RuntimeError as error:
        raise NotCompiledError(str(error)) from error
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3, ctypes.c_int64)
    return engine, kind(engine.get_function_address("run"))


def _text(function: ca.Function, state: int) -> str:
    """LLVM's language for ``run(inputs, states, results, instants)``, whose arrays are a row per number.

    The first numbers of the input, as many as the state has, are read from the states instead.
    """
    lanes = 1 if state else LANES
    (number, truth, kind), body = _TYPES[lanes], "\n".join(_lines(function, state, lanes))
    of_c = (f"declare double @{name}({', '.join(['double'] * count)})" for name, count in _BY_INSTANT.values())
    intrinsic = (f"declare %V @{name}.{kind}(%V)" for name in _INTRINSIC.values())
    return f"""%V = type {number}
%B = type {truth}
{chr(10).join((*of_c, *intrinsic))}
define void @run(ptr %in, ptr %states, ptr %out, i64 %instants) {{
entry:
  br label %pass
pass:
  %at = phi i64 [ 0, %entry ], [ %next, %pass ]
{body}
  %next = add i64 %at, {lanes}
  %more = icmp slt i64 %next, %instants
  br i1 %more, label %pass, label %end
end:
  ret void
}}
"""


def _lines(function: ca.Function, state: int, lanes: int) -> Iterator[str]:
    """One pass of the loop: the instructions in order, the result of number k in ``%vk``."""
    sizes = [function.numel_in(k) for k in range(function.n_in())]
    first = np.concatenate([[0], np.cumsum(sizes)]).tolist()
    value: dict[int, str] = {}
    for k in range(function.n_instructions()):
        op, to, of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            yield from _address(k, "out", to[1])
            yield f"  store %V {value[of[0]]}, ptr %p{k}, align 8"
            continue
        if op == ca.OP_CONST:
            value[to[0]] = _constant(function.instruction_constant(k), lanes)
            continue
        if op == ca.OP_INPUT:
            row = first[of[0]] + of[1]
            yield from _address(k, *(("states", row) if row < state else ("in", row - state)))
            yield f"  %v{k} = load %V, ptr %p{k}, align 8"
        else:
            yield from _operation(k, op, [value[i] for i in of], lanes)
        value[to[0]] = f"%v{k}"


def _address(k: int, array: str, row: int) -> Iterator[str]:
    """Where a row begins at this pass's instants."""
    yield f"  %r{k} = mul i64 {row}, %instants"
    yield f"  %i{k} = add i64 %r{k}, %at"
    yield f"  %p{k} = getelementptr double, ptr %{array}, i64 %i{k}"


def _operation(k: int, op: int, of: list[str], lanes: int) -> Iterator[str]:
    """Lines whose last one defines the value."""
    known = {"one": _constant(1.0, lanes), "kind": _TYPES[lanes][2]}
    if op in _INSTRUCTIONS:
        yield f"  %v{k} = {_INSTRUCTIONS[op].format(*of, **known)}"
    elif op in _BY_INSTANT:
        yield from _by_instant(k, _BY_INSTANT[op][0], of, lanes)
    elif op in _SMALLER:
        yield from _chosen(k, _SMALLER[op], *of)
    elif op in _WHERE:
        order, other, value = (text.format(*of, **known) for text in _WHERE[op])
        yield f"  %c{k} = fcmp {order} %V {of[0]}, {other}"
        yield f"  %v{k} = select %B %c{k}, %V {value}, %V zeroinitializer"
    elif op == ca.OP_SIGN:
        yield f"  %c{k} = fcmp ogt %V {of[0]}, zeroinitializer"
        yield f"  %d{k} = fcmp olt %V {of[0]}, zeroinitializer"
        yield f"  %s{k} = select %B %d{k}, %V {_constant(-1.0, lanes)}, %V {of[0]}"
        yield f"  %v{k} = select %B %c{k}, %V {known['one']}, %V %s{k}"
    else:
        raise NotCompiledError(f"CasADi instruction {op} has no counterpart here")


def _by_instant(k: int, name: str, of: list[str], lanes: int) -> Iterator[str]:
    """A call for each instant of a pass."""
    if lanes == 1:
        yield f"  %v{k} = call double @{name}({', '.join(f'double {x}' for x in of)})"
        return
    filled = ["undef", *(f"%v{k}.{lane}" for lane in range(1, lanes)), f"%v{k}"]
    for lane in range(lanes):
        for place, vector in enumerate(of):
            yield f"  %e{k}.{lane}.{place} = extractelement %V {vector}, i32 {lane}"
        arguments = ", ".join(f"double %e{k}.{lane}.{place}" for place in range(len(of)))
        yield f"  %f{k}.{lane} = call double @{name}({arguments})"
        yield f"  {filled[lane + 1]} = insertelement %V {filled[lane]}, double %f{k}.{lane}, i32 {lane}"


def _chosen(k: int, order: str, a: str, b: str) -> Iterator[str]:
    """The smaller or larger one; not a number, as NumPy's, where either is."""
    yield f"  %c{k} = fcmp {order} %V {a}, {b}"
    yield f"  %d{k} = fcmp uno %V {b}, {b}"
    yield f"  %s{k} = select %B %c{k}, %V {a}, %V {b}"
    yield f"  %v{k} = select %B %d{k}, %V {b}, %V %s{k}"


def _constant(number: float, lanes: int) -> str:
    bits = f"0x{struct.unpack('>Q', struct.pack('>d', number))[0]:016X}"
    return bits if lanes == 1 else f"<{', '.join([f'double {bits}'] * lanes)}>"
