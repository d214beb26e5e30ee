"""Exciting trajectories: motions that make a robot's dynamic parameters identifiable, within what the robot may do.

>>> import excite
>>> robot = excite.load_robot("irp6")
>>> model = excite.DifferentialModel(robot)
>>> design = excite.design_trajectory(model, search=excite.Search(starts=1, executor="serial"))
>>> design.feasible
True
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

from excite.own_packages import check_packages

if TYPE_CHECKING:
    from constraints.collision_limits import Collisions as Collisions
    from constraints.nonlinear import Limit, NonlinearConstraint
    from constraints.power import ToolBox as ToolBox
    from constraints.power import ToolSpeed as ToolSpeed
    from constraints.torque import PlausibleTorqueLimit as PlausibleTorqueLimit
    from constraints.torque import TorqueLimit as TorqueLimit
    from constraints.world_file import read_world
    from excite.design.campaign import plan_campaign
    from excite.design.comparison import compare
    from excite.design.design import Design
    from excite.design.design_json import load_design
    from excite.design.friction_runs.plan_friction import plan_friction
    from excite.design.friction_runs.schedule import Schedule
    from excite.design.optimisation import design_trajectory
    from excite.design.solvers.solver import Solver
    from excite.design.sweeps.run_sweep import run_sweep
    from excite.design.sweeps.sweep_table import SweepTable
    from excite.export.models.export_ensemble import export_ensemble
    from excite.export.models.export_model import ModelFormat, export_model
    from excite.export.motions.export_motion import export_motion
    from excite.export.motions.motion_format import MotionFormat
    from excite.friction.constant_speed_windows import FitSettings
    from excite.friction.fit_friction import fit_friction
    from excite.identification.estimator import Estimate, Estimator
    from excite.identification.identification import Identification
    from excite.identification.identify import identify
    from excite.identification.recipe import Recipe
    from excite.identification.result_json import load_result
    from excite.logs.guess.log_guess import guess_mapping
    from excite.logs.log import Log
    from excite.logs.log_reading import read_log
    from excite.logs.mapping import read_mapping
    from excite.logs.recordings.formats import read_recording
    from excite.optimality.design_bound import DesignBound, bound
    from excite.payload.calibrate_gains import CalibratedGains, calibrate_gains
    from excite.payload.identify_payload import identify_payload
    from excite.payload.known_gains import KnownGains
    from excite.payload.load_rows import LogChoice
    from excite.payload.payload_motion import PayloadMotion, design_payload_motion
    from excite.payload.payload_result import PayloadResult
    from excite.simulation.settings import ImpactPulse, SimulationSettings
    from excite.simulation.simulate import simulate
    from excite.simulation.simulation import Simulation
    from excite.study.design_for_precision import design_for_precision
    from excite.study.next_motion import NextMotion, PrecisionInHand, next_motion
    from excite.study.posterior_samples import PosteriorSamples
    from excite.study.predict_accuracy import AccuracyPrediction, predict_accuracy
    from excite.study.rehearsal import TorqueNoise, measured_noise
    from excite.study.sample_posterior import sample_posterior
    from excite.study.study_over_time import study_over_time
    from excite.study.time_study import TimeCourse, TimeStudy
    from excite.tasks.criteria import Criterion, SpectralCriterion
    from excite.tasks.friction_file import read_friction
    from excite.tasks.installation import Installation
    from excite.tasks.limit_choice import LimitChoice
    from excite.tasks.model_choice import ModelChoice
    from excite.tasks.objective import Belief, Objective
    from excite.tasks.payload import Payload
    from excite.tasks.precision_target import PrecisionTarget, TaskTorques
    from excite.tasks.search import Output, Search
    from excite.tasks.stored_files import EarlierInformation, TaskMotion
    from excite.tasks.task import Task
    from excite.tasks.trajectory_choice import TrajectoryChoice
    from excite.trajectories.bspline import BSpline as BSpline
    from excite.trajectories.family import Family
    from excite.trajectories.fourier import Cosine as Cosine
    from excite.trajectories.fourier import Fourier as Fourier
    from excite.trajectories.fourier import FourierQuintic as FourierQuintic
    from excite.trajectories.linear import LinearFamily
    from excite.trajectories.sines import Sines as Sines
    from excite.trajectories.waypoints import Waypoints as Waypoints
    from excite.verification.tolerances import Tolerances
    from excite.verification.verification import Verification
    from excite.verification.verify import verify
    from excite.views.figures import draw, write_figures
    from excite.views.subjects import load
    from excite.views.write_report import write_report
    from regressors.errors import ExciteError, InputError, NumericalError
    from regressors.models.base import base_parameters
    from regressors.models.differential import DifferentialModel as DifferentialModel
    from regressors.models.energy import EnergyModel as EnergyModel
    from regressors.models.load import LoadIntegralModel as LoadIntegralModel
    from regressors.models.load import LoadModel as LoadModel
    from regressors.models.load import PayloadModel as PayloadModel
    from regressors.models.load import Sensor
    from regressors.models.model import RegressorModel
    from regressors.readers.library import built_in_names, load_robot
    from regressors.robot.columns import Column
    from regressors.robot.robot import Robot
    from regressors.samples import Samples

check_packages()

_PLACES = {
    "Column": "regressors.robot.columns",
    "AccuracyPrediction": "excite.study.predict_accuracy",
    "Belief": "excite.tasks.objective",
    "SweepTable": "excite.design.sweeps.sweep_table",
    "Criterion": "excite.tasks.criteria",
    "Design": "excite.design.design",
    "DesignBound": "excite.optimality.design_bound",
    "EarlierInformation": "excite.tasks.stored_files",
    "Estimate": "excite.identification.estimator",
    "Estimator": "excite.identification.estimator",
    "ExciteError": "regressors.errors",
    "Family": "excite.trajectories.family",
    "FitSettings": "excite.friction.constant_speed_windows",
    "Identification": "excite.identification.identification",
    "ImpactPulse": "excite.simulation.settings",
    "InputError": "regressors.errors",
    "Limit": "constraints.nonlinear",
    "Installation": "excite.tasks.installation",
    "LimitChoice": "excite.tasks.limit_choice",
    "LinearFamily": "excite.trajectories.linear",
    "Log": "excite.logs.log",
    "ModelChoice": "excite.tasks.model_choice",
    "ModelFormat": "excite.export.models.export_model",
    "MotionFormat": "excite.export.motions.motion_format",
    "NextMotion": "excite.study.next_motion",
    "NonlinearConstraint": "constraints.nonlinear",
    "NumericalError": "regressors.errors",
    "Objective": "excite.tasks.objective",
    "Output": "excite.tasks.search",
    "PrecisionInHand": "excite.study.next_motion",
    "Payload": "excite.tasks.payload",
    "PrecisionTarget": "excite.tasks.precision_target",
    "PosteriorSamples": "excite.study.posterior_samples",
    "Recipe": "excite.identification.recipe",
    "RegressorModel": "regressors.models.model",
    "Robot": "regressors.robot.robot",
    "Samples": "regressors.samples",
    "Schedule": "excite.design.friction_runs.schedule",
    "Search": "excite.tasks.search",
    "Sensor": "regressors.models.load",
    "Simulation": "excite.simulation.simulation",
    "SimulationSettings": "excite.simulation.settings",
    "Solver": "excite.design.solvers.solver",
    "SpectralCriterion": "excite.tasks.criteria",
    "Task": "excite.tasks.task",
    "TaskMotion": "excite.tasks.stored_files",
    "TaskTorques": "excite.tasks.precision_target",
    "TimeCourse": "excite.study.time_study",
    "TimeStudy": "excite.study.time_study",
    "Tolerances": "excite.verification.tolerances",
    "TorqueNoise": "excite.study.rehearsal",
    "TrajectoryChoice": "excite.tasks.trajectory_choice",
    "Verification": "excite.verification.verification",
    "base_parameters": "regressors.models.base",
    "built_in_names": "regressors.robots",
    "bound": "excite.optimality.design_bound",
    "compare": "excite.design.comparison",
    "design_for_precision": "excite.study.design_for_precision",
    "design_trajectory": "excite.design.optimisation",
    "draw": "excite.views.figures",
    "export_ensemble": "excite.export.models.export_ensemble",
    "export_model": "excite.export.models.export_model",
    "export_motion": "excite.export.motions.export_motion",
    "fit_friction": "excite.friction.fit_friction",
    "guess_mapping": "excite.logs.guess.log_guess",
    "identify": "excite.identification.identify",
    "load": "excite.views.subjects",
    "load_design": "excite.design.design_json",
    "load_result": "excite.identification.result_json",
    "load_robot": "regressors.readers.library",
    "next_motion": "excite.study.next_motion",
    "measured_noise": "excite.study.rehearsal",
    "plan_campaign": "excite.design.campaign",
    "plan_friction": "excite.design.friction_runs.plan_friction",
    "predict_accuracy": "excite.study.predict_accuracy",
    "read_friction": "excite.tasks.friction_file",
    "read_log": "excite.logs.log_reading",
    "read_mapping": "excite.logs.mapping",
    "read_recording": "excite.logs.recordings.formats",
    "read_world": "constraints.world_file",
    "run_sweep": "excite.design.sweeps.run_sweep",
    "sample_posterior": "excite.study.sample_posterior",
    "simulate": "excite.simulation.simulate",
    "study_over_time": "excite.study.study_over_time",
    "verify": "excite.verification.verify",
    "write_figures": "excite.views.figures",
    "CalibratedGains": "excite.payload.calibrate_gains",
    "KnownGains": "excite.payload.known_gains",
    "LogChoice": "excite.payload.load_rows",
    "PayloadMotion": "excite.payload.payload_motion",
    "PayloadResult": "excite.payload.payload_result",
    "calibrate_gains": "excite.payload.calibrate_gains",
    "design_payload_motion": "excite.payload.payload_motion",
    "identify_payload": "excite.payload.identify_payload",
    "write_report": "excite.views.write_report",
}
# deprecated names, with what they are called now; docs/development.md says when they go
_RENAMED = {
    **dict.fromkeys(("BrokenLimitError", "ConicSolverError", "LostMotionError"), "in excite.errors"),
    **dict.fromkeys(("LostWorkersError", "NoFeasibleMotionError", "TooLargeError"), "in excite.errors"),
    "CampaignTable": "SweepTable",
    "Exported": "in excite.export.exported",
    "load_campaign": "load",
    "load_posterior": "load",
    "load_sweep": "load",
    "run_campaign": "run_sweep",
    "LimitOverrides": "LimitChoice",
    "identified": "identify",
    "read_design": "load_design",
    "read_result": "load_result",
    "LogGuess": "in excite.logs.guess.log_guess",
    "Terms": "in regressors.robot.columns",
    "Window": "in regressors.models.windows",
    "verified": "verify",
}

__all__ = [
    "AccuracyPrediction",
    "Belief",
    "CalibratedGains",
    "Column",
    "Criterion",
    "Design",
    "DesignBound",
    "EarlierInformation",
    "Estimate",
    "Estimator",
    "ExciteError",
    "Family",
    "FitSettings",
    "Identification",
    "ImpactPulse",
    "InputError",
    "Installation",
    "KnownGains",
    "Limit",
    "LimitChoice",
    "LinearFamily",
    "Log",
    "LogChoice",
    "ModelChoice",
    "ModelFormat",
    "MotionFormat",
    "NextMotion",
    "NonlinearConstraint",
    "NumericalError",
    "Objective",
    "Output",
    "Payload",
    "PayloadMotion",
    "PayloadResult",
    "PosteriorSamples",
    "PrecisionInHand",
    "PrecisionTarget",
    "Recipe",
    "RegressorModel",
    "Robot",
    "Samples",
    "Schedule",
    "Search",
    "Sensor",
    "Simulation",
    "SimulationSettings",
    "Solver",
    "SpectralCriterion",
    "SweepTable",
    "Task",
    "TaskMotion",
    "TaskTorques",
    "TimeCourse",
    "TimeStudy",
    "Tolerances",
    "TorqueNoise",
    "TrajectoryChoice",
    "Verification",
    "base_parameters",
    "bound",
    "built_in_names",
    "calibrate_gains",
    "compare",
    "design_for_precision",
    "design_payload_motion",
    "design_trajectory",
    "draw",
    "export_ensemble",
    "export_model",
    "export_motion",
    "fit_friction",
    "guess_mapping",
    "identify",
    "identify_payload",
    "load",
    "load_design",
    "load_result",
    "load_robot",
    "measured_noise",
    "next_motion",
    "plan_campaign",
    "plan_friction",
    "predict_accuracy",
    "read_friction",
    "read_log",
    "read_mapping",
    "read_recording",
    "read_world",
    "run_sweep",
    "sample_posterior",
    "simulate",
    "study_over_time",
    "verify",
    "write_figures",
    "write_report",
]


def _built_in_parts() -> dict[str, str]:
    """Classes of all built-in parts, which are public by being registered, with their modules."""
    from excite.registry import BUILT_IN

    kinds = ("model", "trajectory", "criterion", "constraint", "estimator", "solver")
    places = (place.partition(":") for kind in kinds for place in BUILT_IN[kind].values())
    return {name: module for module, _, name in places}


def _explained(thing: Any) -> Any:
    """The same, with all names of its annotations: `typing.get_type_hints` finds those that typing alone needs too."""
    from regressors.arguments import evaluated

    evaluated(thing)
    return thing


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that ``import excite`` costs nothing."""
    if name == "errors":
        return import_module("excite.errors")
    if name in _PLACES:
        return _explained(getattr(import_module(_PLACES[name]), name))
    if name in (*_RENAMED, "save_design"):
        now = _RENAMED.get(name, "the method save of a design")
        warnings.warn(f"excite.{name} is now {now}", DeprecationWarning, stacklevel=2)
        return getattr(import_module("excite.renamed"), name)
    parts = {} if name.startswith("_") else _built_in_parts()
    if name in parts:
        return getattr(import_module(parts[name]), name)
    raise AttributeError(f"module 'excite' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_built_in_parts()})
