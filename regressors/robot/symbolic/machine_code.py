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

LANES = 4  # instants in one pass of the loop
_V = f"<{LANES} x double>"
_ZERO, _ONE = (f"<{', '.join([f'double {x}'] * LANES)}>" for x in ("0.0", "1.0"))
_INTRINSIC = {ca.OP_SQRT: "llvm.sqrt", ca.OP_FABS: "llvm.fabs"}
_INSTRUCTIONS = {  # of one or two vectors
    ca.OP_ADD: f"fadd {_V} {{0}}, {{1}}",
    ca.OP_SUB: f"fsub {_V} {{0}}, {{1}}",
    ca.OP_MUL: f"fmul {_V} {{0}}, {{1}}",
    ca.OP_DIV: f"fdiv {_V} {{0}}, {{1}}",
    ca.OP_TWICE: f"fadd {_V} {{0}}, {{0}}",
    ca.OP_SQ: f"fmul {_V} {{0}}, {{0}}",
    ca.OP_NEG: f"fneg {_V} {{0}}",
    ca.OP_INV: f"fdiv {_V} {_ONE}, {{0}}",
    **{op: f"call {_V} @{name}.v{LANES}f64({_V} {{0}})" for op, name in _INTRINSIC.items()},
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
    ca.OP_LT: ("olt", "{1}", _ONE),
    ca.OP_NOT: ("oeq", _ZERO, _ONE),
    ca.OP_IF_ELSE_ZERO: ("une", _ZERO, "{1}"),
}


class NotCompiledError(Exception):
    """LLVM is not installed or cannot compile this; the reason is its text."""


class MachineCode:
    """A CasADi function of column vectors, with one result, for many instants at once, or for one after the other."""

    def __init__(self, function: ca.Function, lanes: int = LANES) -> None:
        self._rows = [function.numel_in(k) for k in range(function.n_in())]
        self._size = function.numel_out(0)
        self._inputs = np.zeros((sum(self._rows), 0))
        self._engine, self._run = _compiled(_text(function, lanes))

    def __call__(self, inputs: Sequence[Array]) -> Array:
        """Values, shape (numbers of the result, instants), of inputs of shape (numbers of the input, instants)."""
        instants = inputs[0].shape[1]
        padded = -(-instants // LANES) * LANES
        if self._inputs.shape[1] != padded:
            self._inputs = np.zeros((sum(self._rows), padded))
        np.concatenate(inputs, out=self._inputs[:, :instants])
        out = np.empty((self._size, padded))
        if instants:  # the loop runs once before it looks at their number
            self._run(self._inputs.ctypes.data, out.ctypes.data, padded)
        return out if padded == instants else out[:, :instants].copy()

    def in_turn(self, state: Array, inputs: Array) -> Array:
        """Results one after the other, shape (numbers, steps): the first numbers of each are the next one's state.

        All lanes hold the same, so that functions of the C library need one.
        """
        # state (n,); inputs (m, steps)
        given, result = np.zeros((sum(self._rows), LANES)), np.empty((self._size, LANES))
        results, size = np.empty((inputs.shape[1], self._size)), state.size
        addresses = given.ctypes.data, result.ctypes.data
        result[:size] = state[:, None]
        for step, here in zip(inputs.T, results, strict=True):
            given[:size], given[size:] = result[:size], step[:, None]
            self._run(*addresses, LANES)
            here[:] = result[:, 0]
        return results.T


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
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)
    return engine, kind(engine.get_function_address("run"))


def _text(function: ca.Function, lanes: int) -> str:
    """LLVM's language for ``run(inputs, result, instants)``, whose arrays are a row per number."""
    body = "\n".join(_lines(function, lanes))
    of_c = (f"declare double @{name}({', '.join(['double'] * count)})" for name, count in _BY_INSTANT.values())
    intrinsic = (f"declare {_V} @{name}.v{LANES}f64({_V})" for name in _INTRINSIC.values())
    return f"""{chr(10).join((*of_c, *intrinsic))}
define void @run(ptr noalias %in, ptr noalias %out, i64 %instants) {{
entry:
  br label %pass
pass:
  %at = phi i64 [ 0, %entry ], [ %next, %pass ]
{body}
  %next = add i64 %at, {LANES}
  %more = icmp slt i64 %next, %instants
  br i1 %more, label %pass, label %end
end:
  ret void
}}
"""


def _lines(function: ca.Function, lanes: int) -> Iterator[str]:
    """One pass of the loop: the instructions in order, the result of number k in ``%vk``."""
    sizes = [function.numel_in(k) for k in range(function.n_in())]
    first = np.concatenate([[0], np.cumsum(sizes)]).tolist()
    value: dict[int, str] = {}
    for k in range(function.n_instructions()):
        op, to, of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            yield from _address(k, "out", to[1])
            yield f"  store {_V} {value[of[0]]}, ptr %p{k}, align 8"
            continue
        if op == ca.OP_CONST:
            value[to[0]] = _constant(function.instruction_constant(k))
            continue
        if op == ca.OP_INPUT:
            yield from _address(k, "in", first[of[0]] + of[1])
            yield f"  %v{k} = load {_V}, ptr %p{k}, align 8"
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
    if op in _INSTRUCTIONS:
        yield f"  %v{k} = {_INSTRUCTIONS[op].format(*of)}"
    elif op in _BY_INSTANT:
        yield from _by_instant(k, _BY_INSTANT[op][0], of, lanes)
    elif op in _SMALLER:
        yield from _chosen(k, _SMALLER[op], *of)
    elif op in _WHERE:
        order, other, value = (text.format(*of) for text in _WHERE[op])
        yield f"  %c{k} = fcmp {order} {_V} {of[0]}, {other}"
        yield f"  %v{k} = select <{LANES} x i1> %c{k}, {_V} {value}, {_V} {_ZERO}"
    elif op == ca.OP_SIGN:
        yield from _sign(k, *of)
    else:
        raise NotCompiledError(f"CasADi instruction {op} has no counterpart here")


def _by_instant(k: int, name: str, of: list[str], lanes: int) -> Iterator[str]:
    """Calls for the first lanes; the last of them is for the lanes behind it too."""
    result = "undef"
    for lane in range(LANES):
        for place, vector in enumerate(of if lane < lanes else ()):
            yield f"  %e{k}.{lane}.{place} = extractelement {_V} {vector}, i32 {lane}"
        if lane < lanes:
            arguments = ", ".join(f"double %e{k}.{lane}.{place}" for place in range(len(of)))
            yield f"  %f{k}.{lane} = call double @{name}({arguments})"
        filled = f"%v{k}.{lane}" if lane < LANES - 1 else f"%v{k}"
        yield f"  {filled} = insertelement {_V} {result}, double %f{k}.{min(lane, lanes - 1)}, i32 {lane}"
        result = filled


def _chosen(k: int, order: str, a: str, b: str) -> Iterator[str]:
    """The smaller or larger one; not a number, as NumPy's, where either is."""
    yield f"  %c{k} = fcmp {order} {_V} {a}, {b}"
    yield f"  %d{k} = fcmp uno {_V} {b}, {b}"
    yield f"  %s{k} = select <{LANES} x i1> %c{k}, {_V} {a}, {_V} {b}"
    yield f"  %v{k} = select <{LANES} x i1> %d{k}, {_V} {b}, {_V} %s{k}"


def _sign(k: int, a: str) -> Iterator[str]:
    yield f"  %c{k} = fcmp ogt {_V} {a}, {_ZERO}"
    yield f"  %d{k} = fcmp olt {_V} {a}, {_ZERO}"
    yield f"  %s{k} = select <{LANES} x i1> %d{k}, {_V} {_constant(-1.0)}, {_V} {a}"
    yield f"  %v{k} = select <{LANES} x i1> %c{k}, {_V} {_ONE}, {_V} %s{k}"


def _constant(number: float) -> str:
    bits = struct.unpack(">Q", struct.pack(">d", number))[0]
    return f"<{', '.join([f'double 0x{bits:016X}'] * LANES)}>"
