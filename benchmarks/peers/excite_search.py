"""This project: the search that ``excite design`` makes by default, in one process."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from problems import HARMONICS, PERIOD, PROBLEMS, RATE

_COMMON = {"period": PERIOD, "harmonics": HARMONICS, "rate": RATE, "executor": "serial"}
_LIMITS = {"torque_margin": "none", "self_collision": False, "floor": "none"}
_ARM = {"base": "gautier", "friction": False, "rotor": False}


def motion(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """The best motion of the search; it ends by itself, and ``cpu`` is only compared with what it took."""
    from excite.design.formulation import formulate
    from excite.design.optimisation import solve
    from excite.tasks.task import Task
    from regressors.readers.library import load_robot

    arm = PROBLEMS.get(wanted["case"])
    robot = load_robot("irp6") if arm is None else arm.robot()
    own = {} if arm is None else _ARM
    task = Task("irp6" if arm is None else wanted["case"], seed=wanted["seed"], **_COMMON, **_LIMITS, **own)
    formulation = formulate(robot, task)
    with tempfile.TemporaryDirectory() as folder:
        design = solve(robot, formulation, Path(folder))
    found = design.trajectory
    return {"trajectory": found.family.to_dict(found.x), "starts": len(design.starts)}
