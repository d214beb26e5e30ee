"""Kernels that evaluate a model's regressor and its reverse derivative: what making each takes, and what calling it.

All run the same instructions, those of the CasADi expression: CasADi's own machine (what this project falls back on),
LLVM (what it uses), numba, and JAX. Each is measured in a process of its own with one thread. Numba is not a
dependency; install it into a folder, and have that on PYTHONPATH.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
import record
from measure import script
from problems import FREE_SPACE, PROBLEMS

from excite.design.formulation import formulate
from excite.tasks.task import Task
from regressors.readers.library import load_robot
from regressors.robot.symbolic import vectorised
from regressors.robot.symbolic.machine_code import MachineCode
from regressors.samples import Array

Kernel = Callable[[Sequence[Array]], Array]
ROBOTS = {"irp6": "IRp-6, 3 axes, with friction", "P1": "Panda, 7 axes"}
KERNELS = ("casadi", "llvm", "numba", "jax")
COLUMNS = {"irp6": 13, "P1": 43}
INSTANTS, CALLS = 100, 300
SEARCH = 12 * 250  # calls of either function in a search of 12 starts
_ONE = {"neg": "-{0}", "sq": "{0} * {0}", "twice": "{0} + {0}", "inv": "1.0 / {0}"}
_TWO = {"add": "{0} + {1}", "sub": "{0} - {1}", "mul": "{0} * {1}", "div": "{0} / {1}", "pow": "{0} ** {1}"}
_CALLED = {"sin": "sin", "cos": "cos", "sqrt": "sqrt", "tanh": "tanh", "exp": "exp", "fabs": "abs"}


def functions(robot: str) -> tuple[ca.Function, ca.Function]:
    """The regressor's entries, and the gradient of their weighted sum, as the search evaluates them."""
    arm = PROBLEMS[robot].robot() if robot in PROBLEMS else load_robot(robot)
    task = Task(robot, friction=False, rotor=False, **FREE_SPACE) if robot in PROBLEMS else Task(robot, **FREE_SPACE)
    function = formulate(arm, task).problem.information._function
    made: list[ca.Function] = []
    kept, vectorised._program = vectorised._program, lambda of: made.append(of) or (lambda inputs: np.zeros((1, 1)))
    try:
        inputs = [np.zeros((n, 1)) for n in function._sizes]
        function.pullback(inputs, np.zeros((len(function.row), 1)))
    finally:
        vectorised._program = kept
    return function._function, made[0]


def python_lines(function: ca.Function) -> list[str]:
    """One assignment for each instruction, on numbers ``x[row]``; outputs are ``y<row>``."""
    names = {getattr(ca, f"OP_{name.upper()}"): text for name, text in (_ONE | _TWO).items()}
    names |= {getattr(ca, f"OP_{name.upper()}"): text + "({0})" for name, text in _CALLED.items()}
    names |= {ca.OP_FMIN: "minimum({0}, {1})", ca.OP_FMAX: "maximum({0}, {1})", ca.OP_SIGN: "sign({0})"}
    first = np.cumsum([0, *(function.numel_in(k) for k in range(function.n_in()))]).tolist()
    lines = []
    for k in range(function.n_instructions()):
        op, to, of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_INPUT:
            lines.append(f"w{to[0]} = x[{first[of[0]] + of[1]}]")
        elif op == ca.OP_OUTPUT:
            lines.append(f"y{to[1]} = w{of[0]}")
        elif op == ca.OP_CONST:
            lines.append(f"w{to[0]} = {function.instruction_constant(k)!r}")
        else:
            lines.append(f"w{to[0]} = {names[op].format(*(f'w{i}' for i in of))}")
    return lines


def with_casadi(function: ca.Function) -> Kernel:
    """CasADi's own machine: the fallback of this project."""
    return partial(vectorised._by_casadi, function)


def with_llvm(function: ca.Function) -> Kernel:
    """What this project uses where llvmlite is installed."""
    return MachineCode(function)


def with_numba(function: ca.Function) -> Kernel:
    """A loop over the instants, compiled by numba."""
    import math

    sys.modules["coverage"] = None  # type: ignore[assignment]  # numba takes the folder beside this file for the package
    import numba

    lines = [line.replace("x[", "inputs[").replace("]", ", t]") for line in python_lines(function)]
    lines = [f"out[{line[1:].split()[0]}, t] = {line.split()[2]}" if line[0] == "y" else line for line in lines]
    text = "def run(inputs, out):\n    for t in range(inputs.shape[1]):\n        " + "\n        ".join(lines)
    scope: dict[str, Any] = {name: getattr(math, name) for name in ("sin", "cos", "sqrt", "tanh", "exp")}
    scope |= {"minimum": min, "maximum": max, "sign": np.sign, "abs": abs}
    exec(text, scope)
    run = numba.njit(scope["run"])
    rows = function.numel_out(0)

    def call(inputs: Sequence[Array]) -> Array:
        stacked = np.concatenate(inputs)
        out = np.empty((rows, stacked.shape[1]))
        run(stacked, out)
        return out

    return call


def with_jax(function: ca.Function) -> Kernel:
    """The same instructions on JAX arrays of all instants, compiled by XLA."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)  # a process of its own
    rows = function.numel_out(0)
    ends = ", ".join(f"y{k} + 0.0 * x[0]" for k in range(rows))
    text = "def run(x):\n    " + "\n    ".join([*python_lines(function), f"return stack([{ends}])"])
    scope: dict[str, Any] = {name: getattr(jnp, name) for name in (*_CALLED.values(), "minimum", "maximum", "sign")}
    scope["stack"] = jnp.stack
    exec(text, scope)
    run = jax.jit(scope["run"])
    return lambda inputs: np.asarray(run(np.concatenate(inputs)))


def cost(call: Callable[[], object], calls: int = CALLS) -> float:
    """Processor time of a call [s]: the median of five series."""
    series = []
    for _ in range(5):
        began = time.process_time()
        for _ in range(calls // 5):
            call()
        series.append((time.process_time() - began) / (calls // 5))
    return statistics.median(series)


def measured(robot: str, kernel: str) -> dict[str, float] | None:
    """Making and calling one kernel; None where its package is missing."""
    making = {name: globals()[f"with_{name}"] for name in KERNELS}[kernel]
    both, rng = functions(robot), np.random.default_rng(0)
    found = {"instructions": sum(function.n_instructions() for function in both), "make": 0.0, "call": 0.0}
    for function in both:
        inputs = [rng.normal(size=(function.numel_in(k), INSTANTS)) for k in range(function.n_in())]
        exact = with_casadi(function)(inputs)
        began = time.process_time()
        try:
            made = making(function)
        except ImportError:
            return None
        values = made(inputs)
        found["make"] += time.process_time() - began
        np.testing.assert_allclose(values, exact, rtol=1e-9, atol=1e-9 * np.abs(exact).max())
        found["call"] += cost(lambda made=made, inputs=inputs: made(inputs))
    return found


def lockstep(robot: str) -> dict[str, float]:
    """What three motions take in one call of each step of an evaluation, as part of what they take one by one."""
    forward, reverse = functions(robot)
    rng, found = np.random.default_rng(0), {}
    for name, function in (("values", forward), ("derivative", reverse)):
        made = MachineCode(function)
        inputs = [rng.normal(size=(function.numel_in(k), 3 * INSTANTS)) for k in range(function.n_in())]
        one = [np.ascontiguousarray(x[:, :INSTANTS]) for x in inputs]
        found[name] = (
            cost(lambda made=made, inputs=inputs: made(inputs)) / cost(lambda made=made, one=one: made(one)) / 3
        )
    M = rng.normal(size=(3, COLUMNS[robot], COLUMNS[robot]))
    M = M @ M.transpose(0, 2, 1)
    found["eigenvalues"] = cost(lambda: np.linalg.eigh(M)) / cost(lambda: np.linalg.eigh(M[0])) / 3
    return found


LIMITATIONS = (
    f"{INSTANTS} instants, the number in a search with 5 harmonics; a call is one of the values and one of the "
    "derivative together; processor time of one thread; making includes the import of its package and the first call",
    f"a search: making, and {SEARCH} calls, about those of 12 starts",
    "numba and JAX translate the same instructions one by one; this project's JAX models, which are written for JAX, "
    "compile faster and are for batches",
    "numba keeps its results between processes only for functions in files, and is measured without that",
    "the last columns: three motions in one call, as part of three calls",
)


def main() -> None:
    """Every kernel on both robots."""
    before, results, rows = record.load(), {}, []
    for robot, title in ROBOTS.items():
        for kernel in KERNELS:
            result = script("kernels.py", {"robot": robot, "kernel": kernel}, 1).result
            results[f"{robot}, {kernel}"] = result
            if result is None:
                rows.append([title, kernel, "-", "not installed", "", ""])
                continue
            search = result["make"] + SEARCH * result["call"]
            made = [f"{result['instructions']:.0f}", f"{result['make']:.2f}", f"{1e6 * result['call']:.0f}"]
            rows.append([title, kernel, *made, f"**{search:.2f}**"])
    head = ["arm", "kernel", "instructions", "made in CPU s", "call, CPU us", "a search, CPU s"]
    shared = {robot: script("kernels.py", {"robot": robot, "kernel": "lockstep"}, 1).result for robot in ROBOTS}
    parts = [[ROBOTS[robot], *(f"{part:.2f}" for part in found.values())] for robot, found in shared.items()]
    text = record.table(head, rows) + "\n\n"
    text += record.table(["arm; three motions at once", *next(iter(shared.values()))], parts)
    record.save("kernels", before, {"kernels": results, "lockstep": shared}, text, LIMITATIONS)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        asked = json.loads(sys.argv[1])
        one = asked["kernel"]
        print(json.dumps(lockstep(asked["robot"]) if one == "lockstep" else measured(asked["robot"], one)))
    else:
        main()
