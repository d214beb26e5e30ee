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
    from excite.files.friction_file import read_friction
    from excite.files.result_json import read_result
    from excite.files.world_file import read_world
    from excite.identify.identification import identified
    from excite.identify.recipe import Recipe
    from excite.logs.mapping import read_mapping
    from excite.logs.reading import read_log
    from excite.plots import write_figures
    from excite.task import LimitOverrides, Task
    from excite.verify.verification import verified
    from regressors.base import base_parameters
    from regressors.differential import DifferentialModel
    from regressors.errors import InputError
    from regressors.library import built_in_names, load_robot

_PLACES = {
    "Design": "excite.design",
    "DifferentialModel": "regressors.differential",
    "InputError": "regressors.errors",
    "LimitOverrides": "excite.task",
    "Recipe": "excite.identify.recipe",
    "Task": "excite.task",
    "base_parameters": "regressors.base",
    "built_in_names": "regressors.library",
    "design_trajectory": "excite.design",
    "identified": "excite.identify.identification",
    "load_robot": "regressors.library",
    "read_design": "excite.files.design_json",
    "read_friction": "excite.files.friction_file",
    "read_log": "excite.logs.reading",
    "read_mapping": "excite.logs.mapping",
    "read_result": "excite.files.result_json",
    "read_world": "excite.files.world_file",
    "save_design": "excite.files.design_folder",
    "verified": "excite.verify.verification",
    "write_figures": "excite.plots",
}

__all__ = [
    "Design",
    "DifferentialModel",
    "InputError",
    "LimitOverrides",
    "Recipe",
    "Task",
    "base_parameters",
    "built_in_names",
    "design_trajectory",
    "identified",
    "load_robot",
    "read_design",
    "read_friction",
    "read_log",
    "read_mapping",
    "read_result",
    "read_world",
    "save_design",
    "verified",
    "write_figures",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that ``import excite`` costs nothing."""
    if name not in _PLACES:
        raise AttributeError(f"module 'excite' has no attribute {name!r}")
    return getattr(import_module(_PLACES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
