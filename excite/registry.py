"""Built-in parts by name, and parts of a user's own by ``module:Name``.

A name on the command line or in a task file stands for an object: ``condition`` for a built-in criterion,
``mine:Mine`` for the attribute ``Mine`` of the user's module ``mine``, looked for in the current folder too. Built-in
parts are imported when they are asked for, so that the command line starts at once. What a file of results names is
never imported: that would be code in data.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path
from typing import Any

from regressors.errors import InputError, UnknownName, check_names
from regressors.quantities import shown

BUILT_IN: Mapping[str, Mapping[str, str]] = {
    "model": {
        "differential": "regressors.models.differential:DifferentialModel",
        "energy": "regressors.models.energy:EnergyModel",
        "load": "regressors.models.load:LoadModel",
        "load-integral": "regressors.models.load:LoadIntegralModel",
        "payload": "regressors.models.load:PayloadModel",
        "base-wrench": "regressors.models.load:BaseWrenchModel",
        "servo": "regressors.models.servo:ServoModel",
        "springs": "regressors.models.differential:SpringModel",
    },
    "trajectory": {
        "fourier": "excite.trajectories.fourier:Fourier",
        "fourier-quintic": "excite.trajectories.fourier:FourierQuintic",
        "cosine": "excite.trajectories.fourier:Cosine",
        "bspline": "excite.trajectories.bspline:BSpline",
        "waypoints": "excite.trajectories.waypoints:Waypoints",
        "sines": "excite.trajectories.sines:Sines",
        "polynomial": "excite.trajectories.polynomial:Polynomial",
    },
    "criterion": {
        "condition": "excite.tasks.criteria:ConditionNumber",
        "frobenius": "excite.tasks.criteria:FrobeniusCondition",
        "sigma-min": "excite.tasks.criteria:SmallestSingularValue",
        "logdet": "excite.tasks.criteria:Determinant",
        "trace": "excite.tasks.criteria:Trace",
        "max-deviation": "excite.tasks.criteria:MaxDeviation",
        "torque-deviation": "excite.tasks.criteria:TorqueDeviation",
        "max-torque-deviation": "excite.tasks.criteria:MaxTorqueDeviation",
    },
    "solver": {
        "sqp": "excite.design.solvers.sqp:SequentialQuadratic",
    },
    "executor": {
        "process": "excite.design.multistart:run_in_pool",
        "serial": "excite.design.multistart:serial",
    },
    "constraint": {
        "torque": "constraints.torque:TorqueLimit",
        "plausible-torque": "constraints.torque:PlausibleTorqueLimit",
        "power": "constraints.power:PowerLimit",
        "tool-box": "constraints.power:ToolBox",
        "tool-speed": "constraints.power:ToolSpeed",
        "collision": "constraints.collision_limits:Collisions",
    },
    "signals": {
        "butterworth": "excite.logs.signals.filters:Butterworth",
        "differences": "excite.logs.signals.filters:Differences",
        "fourier": "excite.logs.signals.series:FourierFit",
        "savitzky-golay": "excite.logs.signals.filters:SavitzkyGolay",
        "spline": "excite.logs.signals.series:SmoothingSpline",
    },
    "estimator": {
        "huber": "excite.identification.estimators.robust:Huber",
        "instrumental": "excite.identification.estimators.robust:Instrumental",
        "least-squares": "excite.identification.estimators.least_squares:LeastSquares",
        "physical": "excite.identification.estimators.physical:Physical",
        "recursive": "excite.identification.estimators.least_squares:Recursive",
        "weighted": "excite.identification.estimators.least_squares:Weighted",
    },
    "model format": {
        "urdf": "excite.export.models.urdf_model:UrdfFormat",
        "mjcf": "excite.export.models.mjcf_model:MjcfFormat",
        "drake": "excite.export.models.urdf_model:DrakeFormat",
        "isaac": "excite.export.models.plain_models:IsaacFormat",
        "yaml": "excite.export.models.plain_models:YamlFormat",
        "npz": "excite.export.models.plain_models:NpzFormat",
        "csv": "excite.export.models.plain_models:CsvTable",
        "md": "excite.export.models.plain_models:MarkdownTable",
        "tex": "excite.export.models.plain_models:LatexTable",
        "bam": "excite.export.models.plain_models:BamFormat",
    },
    "motion format": {
        "ros2-yaml": "excite.export.motions.ros2:Ros2Yaml",
        "mcap": "excite.export.motions.ros2:McapTrajectory",
        "urscript": "excite.export.motions.universal_robots:UrScript",
        "rtde": "excite.export.motions.universal_robots:RtdeCsv",
        "franka": "excite.export.motions.industrial:FrankaCsv",
        "krl": "excite.export.motions.industrial:KrlSpline",
        "rsi": "excite.export.motions.industrial:RsiCsv",
        "rapid": "excite.export.motions.industrial:RapidModule",
        "egm": "excite.export.motions.industrial:EgmCsv",
        "lerobot": "excite.export.motions.servo_arms:LeRobotDataset",
        "sage": "excite.export.motions.servo_arms:SageCommands",
        "npz": "excite.export.motions.motion_arrays:NpzMotion",
        "mujoco": "excite.export.motions.motion_arrays:MujocoMotion",
        "mat": "excite.export.motions.motion_arrays:MatMotion",
    },
    # what `excite export` calls, by what the folder holds
    "exporter": {
        "model": "excite.export.models.export_model:export_model",
        "ensemble": "excite.export.models.export_ensemble:export_ensemble",
        "motion": "excite.export.motions.export_motion:export_motion",
    },
    # what shows a result, in the room above it
    "shown": {"table": "excite.views.view:table_of", "html": "excite.views.page_text:notebook_text"},
    # of a folder that a task names: a design, or a result of the room above
    "reader": {
        "earlier": "excite.identification.result_json:earlier_information",
        "servos": "excite.identification.servo_result:task_servos",
    },
}

# what a part of a user's own is a subclass of
INTERFACES: Mapping[str, str] = {
    "model": "regressors.models.model:RegressorModel",
    "trajectory": "excite.trajectories.family:Family",
    "criterion": "excite.tasks.criteria:Criterion",
    "constraint": "constraints.nonlinear:Limit",
    "estimator": "excite.identification.estimator:Estimator",
    "solver": "excite.design.solvers.solver:Solver",
    "model format": "excite.export.models.export_model:ModelFormat",
    "motion format": "excite.export.motions.motion_format:MotionFormat",
}
_FUNCTIONS = ("executor", "signals")

# parts whose names go on with an address, by how the names begin: they are called with the whole name
ADDRESSED: Mapping[str, Mapping[str, str]] = {
    "executor": {
        "dask://": "excite.design.executors.dask_cluster:DaskStarts",
        "dask-file:": "excite.design.executors.dask_cluster:DaskStarts",
        "dask-local": "excite.design.executors.dask_cluster:DaskStarts",
    },
}
ADDRESS_FORMS = {"executor": ("dask://HOST:PORT", "dask-file:PATH", "dask-local[:N]")}

MODELS, TRAJECTORIES, CRITERIA = (tuple(BUILT_IN[kind]) for kind in ("model", "trajectory", "criterion"))
EXECUTORS, SIGNALS, ESTIMATORS = (tuple(BUILT_IN[kind]) for kind in ("executor", "signals", "estimator"))
MOTION_FORMATS, MODEL_FORMATS = (tuple(BUILT_IN[kind]) for kind in ("motion format", "model format"))
WINDOWS = ("short", "long")
NEARLY = ("drop-rounding", "keep", "drop")
STARTS = ("random", "cosine", "quintic", "sines")
CONVENTIONS = ("gautier", "pivoted", "orthonormal")
SCALES = ("unit", "prior", "value", "precision")
DROPPABLE = ("truncated", "nan", "repeated", "garbage")
REPEATABLE = ("instrumental", "least-squares", "weighted")
COVARIANCES = ("auto", "white", "robust")
FIGURE_FORMATS = ("png", "pdf", "svg")
FIGURE_WIDTHS = ("screen", "single", "double")
CHOSEN = (
    "cutoff",
    "signals",
    "delay",
    "bias",
    "friction_scale",
    "offset",
    "load_share",
    "root_friction",
    "asymmetric_friction",
    "stribeck",
    "joint_rotors",
    "standstill",
    "estimator",
)  # settings of an identification that are chosen where they are not given
_MANY = (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)


@dataclass(frozen=True)
class OwnPart:
    """A part of a user's own that a file of results names: known by name, not imported.

    Parameters
    ----------
    kind : str
        Such as ``criterion``.
    name : str
        ``module:Name``.
    """

    kind: str
    name: str

    def missing(self) -> InputError:
        """What to say where the part itself is needed."""
        known = self.name.partition(":")[2] or self.name
        example = f"constraints=[{known}]" if self.kind == "constraint" else f"{self.kind}={known}"
        return InputError(
            f"{self.kind} {self.name} is not built in, and loading a file imports no code that it names: where the "
            f"file is loaded, `part='{self.name}'` allows it, or in Python give the object itself, such as {example}"
        )


def built_in(kind: str, name: str) -> Any:
    """Class or function that a name stands for."""
    check_names(kind, [name], BUILT_IN[kind])
    return import_attribute(BUILT_IN[kind][name])


def import_attribute(place: str) -> Any:
    """What ``module:attribute`` or ``module.attribute`` names."""
    module, _, attribute = place.replace(":", ".").rpartition(".")
    return getattr(import_module(module), attribute)


def is_own(name: str) -> bool:
    """True for ``module:Name``."""
    module, colon, attribute = name.partition(":")
    return bool(colon) and all(part.isidentifier() for part in (*module.split("."), *attribute.split(".")))


def is_addressed(kind: str, name: str) -> bool:
    """True for a name with an address, such as ``dask://HOST:PORT``."""
    return any(name.startswith(begin) for begin in ADDRESSED.get(kind, ()))


def check_name(kind: str, name: str) -> None:
    """Raise `UnknownName` for a name that is neither built in, nor has an address, nor is ``module:Name``."""
    if name not in BUILT_IN[kind] and not is_addressed(kind, name) and not is_own(name):
        raise UnknownName(kind, name, (*BUILT_IN[kind], *ADDRESS_FORMS.get(kind, ()), "or module:Name of your own"))


def check_part(kind: str, given: Any, name: str = "") -> None:
    """Raise `InputError` for what is neither a name that may be given, nor a part of its kind, nor a class of such."""
    if isinstance(given, str):
        return check_name(kind, given)
    interface = import_attribute(INTERFACES[kind]) if kind in INTERFACES else None
    function = kind in _FUNCTIONS and callable(given)
    if isinstance(given, OwnPart) or function or (interface is not None and _is_part(given, interface)):
        return None
    expected = f"a {interface.__name__}, a class of such," if interface is not None else "a function"
    raise InputError(f"{f'{kind} {name}'.strip()}: expected {expected} or a name, given {shown(given)}")


def _is_part(given: Any, interface: type) -> bool:
    return issubclass(given, interface) if isinstance(given, type) else isinstance(given, interface)


def own(kind: str, name: str) -> Any:
    """Object that ``module:Name`` stands for; the module may lie in the current folder."""
    module, _, attribute = name.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)  # stays: processes of a search import the module from there too
    try:
        value: Any = import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            raise
        raise InputError(f"{kind} {name}: no module {module!r} in {here} or among the installed packages") from error
    for part in attribute.split("."):
        if not hasattr(value, part):
            raise InputError(f"{kind} {name}: {module} has no {attribute!r}")
        value = getattr(value, part)
    return value


def part(kind: str, given: Any) -> Any:
    """The object that a part was given as, or that its name stands for."""
    if isinstance(given, OwnPart):
        raise given.missing()
    if not isinstance(given, str):
        return given
    for begin, place in ADDRESSED.get(kind, {}).items():
        if given.startswith(begin):
            return import_attribute(place)(given)
    if not is_own(given):
        return built_in(kind, given)
    check_part(kind, found := own(kind, given), given)
    return found


def instance(kind: str, given: Any) -> Any:
    """As `part`; a class is called without arguments."""
    attribute = part(kind, given)
    if not isinstance(attribute, type):
        return attribute
    wanted = [p.name for p in signature(attribute).parameters.values() if p.default is p.empty and p.kind not in _MANY]
    if wanted:
        raise InputError(
            f"{kind} {name_of(given)} needs its {', '.join(wanted)}: in Python give an object with them, on the "
            "command line module:Name of a class that needs no arguments"
        )
    return attribute()


def place_of(given: Any) -> str:
    """``module:Name`` of a part's class; its own name where it was given by name."""
    if isinstance(given, OwnPart):
        return given.name
    if isinstance(given, str):
        return given
    kind = given if hasattr(given, "__qualname__") else type(given)  # of an object its class
    return f"{kind.__module__}:{kind.__qualname__}"


def name_of(given: Any) -> str:
    """Name that a part has in files: its own where it was given by name or is built in, else its `place_of`."""
    place = place_of(given)
    for names in BUILT_IN.values():
        for name, known in names.items():
            if known == place:
                return name
    return place
