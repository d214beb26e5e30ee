"""Exciting trajectories: motions that make a robot's dynamic parameters identifiable, within what the robot may do.

>>> import excite
>>> robot = excite.load_robot("irp6")
>>> model = excite.DifferentialModel(robot)
>>> design = excite.design_trajectory(model, search=excite.Search(starts=1, executor="serial"))
>>> design.feasible
True
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from excite.own_packages import check_packages

if TYPE_CHECKING:
    from constraints.collision_limits import Collisions as Collisions
    from constraints.nonlinear import Limit as Limit, NonlinearConstraint as NonlinearConstraint
    from constraints.power import ToolBox as ToolBox, ToolSpeed as ToolSpeed
    from constraints.torque import PlausibleTorqueLimit as PlausibleTorqueLimit, TorqueLimit as TorqueLimit
    from constraints.world_file import read_world as read_world
    from excite.design.campaign import plan_campaign as plan_campaign
    from excite.design.comparison import compare as compare
    from excite.design.design import Design as Design
    from excite.design.design_json import load_design as load_design
    from excite.design.friction_runs.plan_friction import plan_friction as plan_friction
    from excite.design.friction_runs.schedule import Schedule as Schedule
    from excite.design.optimisation import design_trajectory as design_trajectory
    from excite.design.solvers.solver import Solver as Solver
    from excite.design.sweeps.run_sweep import run_sweep as run_sweep
    from excite.design.sweeps.sweep_table import SweepTable as SweepTable
    from excite.export.models.export_ensemble import export_ensemble as export_ensemble
    from excite.export.models.export_model import ModelFormat as ModelFormat, export_model as export_model
    from excite.export.motions.export_motion import export_motion as export_motion
    from excite.export.motions.motion_format import MotionFormat as MotionFormat
    from excite.friction.constant_speed_windows import FitSettings as FitSettings
    from excite.friction.fit_friction import fit_friction as fit_friction
    from excite.identification.estimator import Estimate as Estimate, Estimator as Estimator
    from excite.identification.identification import Identification as Identification
    from excite.identification.identify import identify as identify
    from excite.identification.recipe import Recipe as Recipe
    from excite.identification.result_json import load_result as load_result
    from excite.logs.guess.log_guess import guess_mapping as guess_mapping
    from excite.logs.log import Log as Log
    from excite.logs.log_reading import read_log as read_log
    from excite.logs.mapping import read_mapping as read_mapping
    from excite.logs.recordings.formats import read_recording as read_recording
    from excite.optimality.design_bound import DesignBound as DesignBound, bound as bound
    from excite.payload.calibrate_gains import CalibratedGains as CalibratedGains, calibrate_gains as calibrate_gains
    from excite.payload.identify_payload import identify_payload as identify_payload
    from excite.payload.known_gains import KnownGains as KnownGains
    from excite.payload.load_rows import LogChoice as LogChoice
    from excite.payload.payload_motion import (
        PayloadMotion as PayloadMotion,
        design_payload_motion as design_payload_motion,
    )
    from excite.payload.payload_result import PayloadResult as PayloadResult
    from excite.simulation.settings import ImpactPulse as ImpactPulse, SimulationSettings as SimulationSettings
    from excite.simulation.simulate import simulate as simulate
    from excite.simulation.simulation import Simulation as Simulation
    from excite.study.design_for_precision import design_for_precision as design_for_precision
    from excite.study.next_motion import (
        NextMotion as NextMotion,
        PrecisionInHand as PrecisionInHand,
        next_motion as next_motion,
    )
    from excite.study.posterior_samples import PosteriorSamples as PosteriorSamples
    from excite.study.predict_accuracy import (
        AccuracyPrediction as AccuracyPrediction,
        predict_accuracy as predict_accuracy,
    )
    from excite.study.rehearsal import TorqueNoise as TorqueNoise, measured_noise as measured_noise
    from excite.study.sample_posterior import sample_posterior as sample_posterior
    from excite.study.study_over_time import study_over_time as study_over_time
    from excite.study.time_study import TimeCourse as TimeCourse, TimeStudy as TimeStudy
    from excite.tasks.criteria import Criterion as Criterion, SpectralCriterion as SpectralCriterion
    from excite.tasks.friction_file import read_friction as read_friction
    from excite.tasks.further_settings import Tolerances as Tolerances
    from excite.tasks.installation import Installation as Installation
    from excite.tasks.limit_choice import LimitChoice as LimitChoice
    from excite.tasks.model_choice import ModelChoice as ModelChoice
    from excite.tasks.objective import Belief as Belief, Objective as Objective
    from excite.tasks.payload import Payload as Payload
    from excite.tasks.precision_target import PrecisionTarget as PrecisionTarget, TaskTorques as TaskTorques
    from excite.tasks.search import Output as Output, Search as Search
    from excite.tasks.stored_files import EarlierInformation as EarlierInformation, TaskMotion as TaskMotion
    from excite.tasks.task import Task as Task
    from excite.tasks.trajectory_choice import TrajectoryChoice as TrajectoryChoice
    from excite.trajectories.bspline import BSpline as BSpline
    from excite.trajectories.family import Family as Family
    from excite.trajectories.fourier import Cosine as Cosine, Fourier as Fourier, FourierQuintic as FourierQuintic
    from excite.trajectories.linear import LinearFamily as LinearFamily
    from excite.trajectories.sines import Sines as Sines
    from excite.trajectories.waypoints import Waypoints as Waypoints
    from excite.verification.verification import Verification as Verification
    from excite.verification.verify import verify as verify
    from excite.views.figures import draw as draw, write_figures as write_figures
    from excite.views.subjects import load as load
    from excite.views.write_report import write_report as write_report
    from regressors.errors import ExciteError as ExciteError, InputError as InputError, NumericalError as NumericalError
    from regressors.models.base import base_parameters as base_parameters
    from regressors.models.differential import DifferentialModel as DifferentialModel
    from regressors.models.energy import EnergyModel as EnergyModel
    from regressors.models.load import (
        LoadIntegralModel as LoadIntegralModel,
        LoadModel as LoadModel,
        PayloadModel as PayloadModel,
        Sensor as Sensor,
    )
    from regressors.models.model import RegressorModel as RegressorModel
    from regressors.readers.library import built_in_names as built_in_names, load_robot as load_robot
    from regressors.robot.columns import Column as Column
    from regressors.robot.robot import Robot as Robot
    from regressors.samples import Samples as Samples

check_packages()

_NAMES = {
    "constraints.nonlinear": "Limit NonlinearConstraint",
    "constraints.world_file": "read_world",
    "excite.design.campaign": "plan_campaign",
    "excite.design.comparison": "compare",
    "excite.design.design": "Design",
    "excite.design.design_json": "load_design",
    "excite.design.friction_runs.plan_friction": "plan_friction",
    "excite.design.friction_runs.schedule": "Schedule",
    "excite.design.optimisation": "design_trajectory",
    "excite.design.solvers.solver": "Solver",
    "excite.design.sweeps.run_sweep": "run_sweep",
    "excite.design.sweeps.sweep_table": "SweepTable",
    "excite.export.models.export_ensemble": "export_ensemble",
    "excite.export.models.export_model": "ModelFormat export_model",
    "excite.export.motions.export_motion": "export_motion",
    "excite.export.motions.motion_format": "MotionFormat",
    "excite.friction.constant_speed_windows": "FitSettings",
    "excite.friction.fit_friction": "fit_friction",
    "excite.identification.estimator": "Estimate Estimator",
    "excite.identification.identification": "Identification",
    "excite.identification.identify": "identify",
    "excite.identification.recipe": "Recipe",
    "excite.identification.result_json": "load_result",
    "excite.logs.guess.log_guess": "guess_mapping",
    "excite.logs.log": "Log",
    "excite.logs.log_reading": "read_log",
    "excite.logs.mapping": "read_mapping",
    "excite.logs.recordings.formats": "read_recording",
    "excite.optimality.design_bound": "DesignBound bound",
    "excite.payload.calibrate_gains": "CalibratedGains calibrate_gains",
    "excite.payload.identify_payload": "identify_payload",
    "excite.payload.known_gains": "KnownGains",
    "excite.payload.load_rows": "LogChoice",
    "excite.payload.payload_motion": "PayloadMotion design_payload_motion",
    "excite.payload.payload_result": "PayloadResult",
    "excite.simulation.settings": "ImpactPulse SimulationSettings",
    "excite.simulation.simulate": "simulate",
    "excite.simulation.simulation": "Simulation",
    "excite.study.design_for_precision": "design_for_precision",
    "excite.study.next_motion": "NextMotion PrecisionInHand next_motion",
    "excite.study.posterior_samples": "PosteriorSamples",
    "excite.study.predict_accuracy": "AccuracyPrediction predict_accuracy",
    "excite.study.rehearsal": "TorqueNoise measured_noise",
    "excite.study.sample_posterior": "sample_posterior",
    "excite.study.study_over_time": "study_over_time",
    "excite.study.time_study": "TimeCourse TimeStudy",
    "excite.tasks.criteria": "Criterion SpectralCriterion",
    "excite.tasks.friction_file": "read_friction",
    "excite.tasks.further_settings": "Tolerances",
    "excite.tasks.installation": "Installation",
    "excite.tasks.limit_choice": "LimitChoice",
    "excite.tasks.model_choice": "ModelChoice",
    "excite.tasks.objective": "Belief Objective",
    "excite.tasks.payload": "Payload",
    "excite.tasks.precision_target": "PrecisionTarget TaskTorques",
    "excite.tasks.search": "Output Search",
    "excite.tasks.stored_files": "EarlierInformation TaskMotion",
    "excite.tasks.task": "Task",
    "excite.tasks.trajectory_choice": "TrajectoryChoice",
    "excite.trajectories.family": "Family",
    "excite.trajectories.linear": "LinearFamily",
    "excite.verification.verification": "Verification",
    "excite.verification.verify": "verify",
    "excite.views.figures": "draw write_figures",
    "excite.views.subjects": "load",
    "excite.views.write_report": "write_report",
    "regressors.errors": "ExciteError InputError NumericalError",
    "regressors.models.base": "base_parameters",
    "regressors.models.load": "Sensor",
    "regressors.models.model": "RegressorModel",
    "regressors.readers.library": "load_robot",
    "regressors.robot.columns": "Column",
    "regressors.robot.robot": "Robot",
    "regressors.robots": "built_in_names",
    "regressors.samples": "Samples",
}
_PLACES = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_PLACES)


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
    parts = {} if name.startswith("_") else _built_in_parts()
    if name in parts:
        return getattr(import_module(parts[name]), name)
    raise AttributeError(f"module 'excite' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_built_in_parts()})
