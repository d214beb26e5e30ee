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
    from constraints.collision.collision_limits import Collisions
    from constraints.limit import Limit
    from constraints.limits.plausible_torque import PlausibleTorqueLimit
    from constraints.limits.tool import ToolBox, ToolSpeed
    from constraints.limits.torque import TorqueLimit
    from constraints.nonlinear import NonlinearConstraint
    from excite.design.campaign import plan_campaign
    from excite.design.comparison import compare
    from excite.design.design import Design
    from excite.design.optimisation import design_trajectory
    from excite.design.solvers.solver import Solver
    from excite.errors import (
        BrokenLimitError,
        ConicSolverError,
        LostMotionError,
        LostWorkersError,
        NoFeasibleMotionError,
        TooLargeError,
    )
    from excite.export.exported import Exported
    from excite.export.models.export_ensemble import export_ensemble
    from excite.export.models.export_model import export_model
    from excite.export.models.model_format import ModelFormat
    from excite.export.motions.export_motion import export_motion
    from excite.export.motions.motion_format import MotionFormat
    from excite.files.design_json import load_design
    from excite.files.friction_file import read_friction
    from excite.files.result_json import load_result
    from excite.files.world_file import read_world
    from excite.friction.fit.fit_friction import fit_friction
    from excite.friction.fit.fit_settings import FitSettings
    from excite.friction.plan.plan_friction import plan_friction
    from excite.friction.plan.schedule import Schedule
    from excite.identification.estimate import Estimate
    from excite.identification.estimator import Estimator
    from excite.identification.identification import Identification
    from excite.identification.identify import identify
    from excite.identification.recipe import Recipe
    from excite.information.criteria import Criterion, SpectralCriterion
    from excite.logs.guess.log_guess import LogGuess, guess_mapping
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
    from excite.plots import write_figures
    from excite.plots.drawable import draw
    from excite.report.write_report import write_report
    from excite.simulation.impact_pulse import ImpactPulse
    from excite.simulation.payload import Payload
    from excite.simulation.settings import SimulationSettings
    from excite.simulation.simulate import simulate
    from excite.simulation.simulation import Simulation
    from excite.study.accuracy_prediction import AccuracyPrediction
    from excite.study.design_for_precision import design_for_precision
    from excite.study.next_motion import NextMotion, PrecisionInHand, next_motion
    from excite.study.posterior_samples import PosteriorSamples, load_posterior
    from excite.study.predict_accuracy import predict_accuracy
    from excite.study.sample_posterior import sample_posterior
    from excite.study.study_over_time import study_over_time
    from excite.study.time_study import TimeCourse, TimeStudy
    from excite.study.torque_noise import TorqueNoise, measured_noise
    from excite.sweeps.run_sweep import run_sweep
    from excite.sweeps.sweep_table import SweepTable, load_sweep
    from excite.tasks.earlier_information import EarlierInformation
    from excite.tasks.installation import Installation
    from excite.tasks.limit_choice import LimitChoice
    from excite.tasks.model_choice import ModelChoice
    from excite.tasks.objective import Belief, Objective
    from excite.tasks.output import Output
    from excite.tasks.precision_target import PrecisionTarget, TaskTorques
    from excite.tasks.search import Search
    from excite.tasks.task import Task
    from excite.tasks.task_motion import TaskMotion
    from excite.tasks.trajectory_choice import TrajectoryChoice
    from excite.trajectories.bspline import BSpline
    from excite.trajectories.cosine import Cosine
    from excite.trajectories.family import Family
    from excite.trajectories.fourier import Fourier
    from excite.trajectories.fourier_quintic import FourierQuintic
    from excite.trajectories.linear import LinearFamily
    from excite.trajectories.sines import Sines
    from excite.trajectories.waypoints import Waypoints
    from excite.verification.tolerances import Tolerances
    from excite.verification.verification import Verification
    from excite.verification.verify import verify
    from regressors.errors import ExciteError, InputError, NumericalError
    from regressors.models.base import base_parameters
    from regressors.models.columns import Column, Terms
    from regressors.models.differential import DifferentialModel
    from regressors.models.energy import EnergyModel
    from regressors.models.load import LoadIntegralModel, LoadModel, PayloadModel, Sensor
    from regressors.models.model import RegressorModel
    from regressors.models.windows import Window
    from regressors.readers.library import built_in_names, load_robot
    from regressors.robot.robot import Robot
    from regressors.samples import Samples

check_packages()

_PLACES = {
    "AccuracyPrediction": "excite.study.accuracy_prediction",
    "BSpline": "excite.trajectories.bspline",
    "Belief": "excite.tasks.objective",
    "Collisions": "constraints.collision.collision_limits",
    "SweepTable": "excite.sweeps.sweep_table",
    "Column": "regressors.models.columns",
    "BrokenLimitError": "excite.errors",
    "ConicSolverError": "excite.errors",
    "Cosine": "excite.trajectories.cosine",
    "Criterion": "excite.information.criteria",
    "Design": "excite.design.design",
    "DesignBound": "excite.optimality.design_bound",
    "DifferentialModel": "regressors.models.differential",
    "EarlierInformation": "excite.tasks.earlier_information",
    "EnergyModel": "regressors.models.energy",
    "Estimate": "excite.identification.estimate",
    "Estimator": "excite.identification.estimator",
    "ExciteError": "regressors.errors",
    "Exported": "excite.export.exported",
    "Family": "excite.trajectories.family",
    "FitSettings": "excite.friction.fit.fit_settings",
    "Fourier": "excite.trajectories.fourier",
    "FourierQuintic": "excite.trajectories.fourier_quintic",
    "Identification": "excite.identification.identification",
    "ImpactPulse": "excite.simulation.impact_pulse",
    "InputError": "regressors.errors",
    "Limit": "constraints.limit",
    "Installation": "excite.tasks.installation",
    "LimitChoice": "excite.tasks.limit_choice",
    "LinearFamily": "excite.trajectories.linear",
    "LoadIntegralModel": "regressors.models.load",
    "LoadModel": "regressors.models.load",
    "Log": "excite.logs.log",
    "LogGuess": "excite.logs.guess.log_guess",
    "LostMotionError": "excite.errors",
    "LostWorkersError": "excite.errors",
    "ModelChoice": "excite.tasks.model_choice",
    "ModelFormat": "excite.export.models.model_format",
    "MotionFormat": "excite.export.motions.motion_format",
    "NextMotion": "excite.study.next_motion",
    "NoFeasibleMotionError": "excite.errors",
    "NonlinearConstraint": "constraints.nonlinear",
    "NumericalError": "regressors.errors",
    "Objective": "excite.tasks.objective",
    "Output": "excite.tasks.output",
    "PrecisionInHand": "excite.study.next_motion",
    "Payload": "excite.simulation.payload",
    "PrecisionTarget": "excite.tasks.precision_target",
    "PosteriorSamples": "excite.study.posterior_samples",
    "Recipe": "excite.identification.recipe",
    "PlausibleTorqueLimit": "constraints.limits.plausible_torque",
    "RegressorModel": "regressors.models.model",
    "Robot": "regressors.robot.robot",
    "Samples": "regressors.samples",
    "Schedule": "excite.friction.plan.schedule",
    "Search": "excite.tasks.search",
    "Sensor": "regressors.models.load",
    "Simulation": "excite.simulation.simulation",
    "SimulationSettings": "excite.simulation.settings",
    "Sines": "excite.trajectories.sines",
    "Solver": "excite.design.solvers.solver",
    "SpectralCriterion": "excite.information.criteria",
    "Task": "excite.tasks.task",
    "TaskMotion": "excite.tasks.task_motion",
    "TaskTorques": "excite.tasks.precision_target",
    "Terms": "regressors.models.columns",
    "TimeCourse": "excite.study.time_study",
    "TimeStudy": "excite.study.time_study",
    "Tolerances": "excite.verification.tolerances",
    "TooLargeError": "excite.errors",
    "TorqueNoise": "excite.study.torque_noise",
    "ToolBox": "constraints.limits.tool",
    "ToolSpeed": "constraints.limits.tool",
    "TorqueLimit": "constraints.limits.torque",
    "TrajectoryChoice": "excite.tasks.trajectory_choice",
    "Verification": "excite.verification.verification",
    "Waypoints": "excite.trajectories.waypoints",
    "Window": "regressors.models.windows",
    "base_parameters": "regressors.models.base",
    "built_in_names": "regressors.readers.library",
    "bound": "excite.optimality.design_bound",
    "compare": "excite.design.comparison",
    "design_for_precision": "excite.study.design_for_precision",
    "design_trajectory": "excite.design.optimisation",
    "draw": "excite.plots.drawable",
    "export_ensemble": "excite.export.models.export_ensemble",
    "export_model": "excite.export.models.export_model",
    "export_motion": "excite.export.motions.export_motion",
    "fit_friction": "excite.friction.fit.fit_friction",
    "guess_mapping": "excite.logs.guess.log_guess",
    "identify": "excite.identification.identify",
    "load_sweep": "excite.sweeps.sweep_table",
    "load_design": "excite.files.design_json",
    "load_posterior": "excite.study.posterior_samples",
    "load_result": "excite.files.result_json",
    "load_robot": "regressors.readers.library",
    "next_motion": "excite.study.next_motion",
    "measured_noise": "excite.study.torque_noise",
    "plan_campaign": "excite.design.campaign",
    "plan_friction": "excite.friction.plan.plan_friction",
    "predict_accuracy": "excite.study.predict_accuracy",
    "read_friction": "excite.files.friction_file",
    "read_log": "excite.logs.log_reading",
    "read_mapping": "excite.logs.mapping",
    "read_recording": "excite.logs.recordings.formats",
    "read_world": "excite.files.world_file",
    "run_sweep": "excite.sweeps.run_sweep",
    "sample_posterior": "excite.study.sample_posterior",
    "simulate": "excite.simulation.simulate",
    "study_over_time": "excite.study.study_over_time",
    "verify": "excite.verification.verify",
    "write_figures": "excite.plots",
    "CalibratedGains": "excite.payload.calibrate_gains",
    "KnownGains": "excite.payload.known_gains",
    "LogChoice": "excite.payload.load_rows",
    "PayloadModel": "regressors.models.load",
    "PayloadMotion": "excite.payload.payload_motion",
    "PayloadResult": "excite.payload.payload_result",
    "calibrate_gains": "excite.payload.calibrate_gains",
    "design_payload_motion": "excite.payload.payload_motion",
    "identify_payload": "excite.payload.identify_payload",
    "write_report": "excite.report.write_report",
}
# deprecated names, with what they are called now; docs/development.md says when they go
_RENAMED = {
    "CampaignTable": "SweepTable",
    "load_campaign": "load_sweep",
    "run_campaign": "run_sweep",
    "LimitOverrides": "LimitChoice",
    "identified": "identify",
    "read_design": "load_design",
    "read_result": "load_result",
    "verified": "verify",
}

__all__ = [
    "AccuracyPrediction",
    "BSpline",
    "Belief",
    "BrokenLimitError",
    "CalibratedGains",
    "Collisions",
    "Column",
    "ConicSolverError",
    "Cosine",
    "Criterion",
    "Design",
    "DesignBound",
    "DifferentialModel",
    "EarlierInformation",
    "EnergyModel",
    "Estimate",
    "Estimator",
    "ExciteError",
    "Exported",
    "Family",
    "FitSettings",
    "Fourier",
    "FourierQuintic",
    "Identification",
    "ImpactPulse",
    "InputError",
    "Installation",
    "KnownGains",
    "Limit",
    "LimitChoice",
    "LinearFamily",
    "LoadIntegralModel",
    "LoadModel",
    "Log",
    "LogChoice",
    "LogGuess",
    "LostMotionError",
    "LostWorkersError",
    "ModelChoice",
    "ModelFormat",
    "MotionFormat",
    "NextMotion",
    "NoFeasibleMotionError",
    "NonlinearConstraint",
    "NumericalError",
    "Objective",
    "Output",
    "Payload",
    "PayloadModel",
    "PayloadMotion",
    "PayloadResult",
    "PlausibleTorqueLimit",
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
    "Sines",
    "Solver",
    "SpectralCriterion",
    "SweepTable",
    "Task",
    "TaskMotion",
    "TaskTorques",
    "Terms",
    "TimeCourse",
    "TimeStudy",
    "Tolerances",
    "TooLargeError",
    "ToolBox",
    "ToolSpeed",
    "TorqueLimit",
    "TorqueNoise",
    "TrajectoryChoice",
    "Verification",
    "Waypoints",
    "Window",
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
    "load_design",
    "load_posterior",
    "load_result",
    "load_robot",
    "load_sweep",
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
