"""How near designs of the IRp-6 come to the best possible: bounds by what they take into account, and the proven one.

.venv/bin/python benchmarks/bound.py
"""

from __future__ import annotations

import resource
import time
from dataclasses import replace

import numpy as np
from record import load, save, table

import excite
from excite.design.formulation import formulate
from excite.optimality.cutting_planes import BOUNDED, LOOKED_AT, CuttingPlanes
from excite.optimality.design_bound import cutting_planes
from excite.optimality.limited_states import MomentConditions

STARTS, ROUNDS = 12, 8


class WithoutConditions(MomentConditions):
    """Limits of states alone."""

    def values(self, S: np.ndarray) -> np.ndarray:
        return super().values(S)[:, :0]

    def cone(self) -> np.ndarray:
        return np.zeros((0, 0))

    def admitted(self, c: np.ndarray) -> np.ndarray:
        return c


def variants(planes: CuttingPlanes) -> dict[str, CuttingPlanes]:
    """The relaxation with less and less of what it knows of motions."""
    free = replace(planes.states, bandwidth=None)
    none = np.zeros(0)
    conditions = planes.conditions
    return {
        "limits of states": replace(planes, conditions=WithoutConditions(free, conditions.counted, none)),
        "and derivatives of mean zero": replace(planes, conditions=MomentConditions(free, conditions.counted, none)),
        "and links of states by the highest harmonic": replace(
            planes, conditions=MomentConditions(planes.states, conditions.counted, none)
        ),
        "and second moments of the harmonics": planes,
    }


def main() -> None:
    before = load()
    search = excite.Search(starts=STARTS, seed=0, executor="serial")
    model = excite.DifferentialModel(excite.load_robot("irp6"))
    design = excite.design_trajectory(model, excite.Fourier(10.0, 5), search=search)
    planes = cutting_planes(formulate(design.robot, design.task), design)
    condition, reached = BOUNDED["condition"], design.condition_number
    rows, content = [], []
    for name, problem in variants(planes).items():
        began = time.process_time()
        value = condition.proven(*problem.run(condition, ROUNDS, np.random.default_rng(0)))
        seconds = time.process_time() - began
        rows.append((name, f"{value:.2f}", f"{100 * value / reached:.0f} %", f"{seconds:.0f}"))
        content.append({"known": name, "estimate": value, "states": LOOKED_AT, "cpu_seconds": seconds})
    began, firsts = time.process_time(), list[float]()
    bound = excite.bound(
        design, what_ifs=False, progress=lambda said: firsts.extend([time.process_time() - began] * ("proven)" in said))
    )
    seconds, (found,) = time.process_time() - began, bound.criteria
    rows.append(("the same, proven", f"{found.value:.2f}", f"{100 * found.efficiency:.0f} %", f"{seconds:.0f}"))
    content.append({"known": "all", "proven": found.value, "estimate": found.estimate, "cpu_seconds": seconds})
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    text = f"IRp-6, 13 parameters, 10 s, 5 harmonics: the design of {STARTS} starts has the condition number "
    text += f"{reached:.2f}.\n\n"
    text += f"The first number was proven after {firsts[0]:.1f} s CPU.\n\n"
    text += table(("what the relaxation knows", "no motion is below", "of the design's", "CPU s"), rows)
    save(
        "bound",
        before,
        {"condition_number": reached, "bounds": content, "first_proven_s": firsts[0], "memory_mb": peak},
        text,
        (
            "The first rows are estimated from the states that were looked at; only the last one is proven.",
            "Estimates depend on the seed of the search for states; one seed was tried.",
            "One robot; rest at both ends, torques and jerk are not used.",
        ),
    )


if __name__ == "__main__":
    main()
