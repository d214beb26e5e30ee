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
    from excite.design.design import Design
from excite.design.optimisation import design_trajectory
    from excite.files.design_folder import save_design
    from excite.files.design_json import load_design
    from excite.files.friction_file import read_friction
    from excite.files.result_json import read_result
    from excite.files.world_file import read_world
    from excite.identification.identification import identified
    from excite.identification.recipe import Recipe
    from excite.logs.log_reading import read_log
    from excite.logs.mapping import read_mapping
    from excite.plots import write_figures
    from excite.tasks.task import LimitOverrides, Task
    from excite.verification.verification import verified
    from regressors.errors import InputError
    from regressors.models.base import base_parameters
    from regressors.models.differential import DifferentialModel
    from regressors.readers.library import built_in_names, load_robot

_PLACES = {
    "Design": "excite.design.design",
    "DifferentialModel": "regressors.models.differential",
    "InputError": "regressors.errors",
    "LimitOverrides": "excite.tasks.task",
    "Recipe": "excite.identification.recipe",
    "Task": "excite.tasks.task",
    "base_parameters": "regressors.models.base",
    "built_in_names": "regressors.readers.library",
    "design_trajectory": "excite.design.design",
    "identified": "excite.identification.identification",
    "load_robot": "regressors.readers.library",
    "load_design": "excite.files.design_json",
    "read_friction": "excite.files.friction_file",
    "read_log": "excite.logs.log_reading",
    "read_mapping": "excite.logs.mapping",
    "read_result": "excite.files.result_json",
    "read_world": "excite.files.world_file",
    "save_design": "excite.files.design_folder",
    "verified": "excite.verification.verification",
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
    "load_design",
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
