"""Exciting trajectories: motions that make a robot's dynamic parameters identifiable, within what the robot may do.

>>> import excite
>>> robot = excite.load_robot("irp6")
>>> design = excite.design_trajectory(robot, excite.Task("irp6", starts=1, executor="serial"))
>>> design.feasible
True
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from excite.design import Design, design_trajectory
    from excite.files.design_folder import save_design
    from excite.files.design_json import read_design
    from excite.plots import write_figures
    from excite.task import LimitOverrides, Task
    from regressors.base import base_parameters
    from regressors.differential import DifferentialModel
    from regressors.errors import InputError
    from regressors.library import built_in_names, load_robot

_PLACES = {
    "Design": "excite.design",
    "DifferentialModel": "regressors.differential",
    "InputError": "regressors.errors",
    "LimitOverrides": "excite.task",
    "Task": "excite.task",
    "base_parameters": "regressors.base",
    "built_in_names": "regressors.library",
    "design_trajectory": "excite.design",
    "load_robot": "regressors.library",
    "read_design": "excite.files.design_json",
    "save_design": "excite.files.design_folder",
    "write_figures": "excite.plots",
}

__all__ = [
    "Design",
    "DifferentialModel",
    "InputError",
    "LimitOverrides",
    "Task",
    "base_parameters",
    "built_in_names",
    "design_trajectory",
    "load_robot",
    "read_design",
    "save_design",
    "write_figures",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that ``import excite`` costs nothing."""
    if name not in _PLACES:
        raise AttributeError(f"module 'excite' has no attribute {name!r}")
    return getattr(import_module(_PLACES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
