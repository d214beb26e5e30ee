"""Identification from logs, for the command line and scripts."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.design.design import Design
from excite.errors import ConicSolverError
from excite.identification.allowances import FOUND, allowing_for_selection
from excite.identification.biases import allowing_for_nuisances
from excite.identification.choices.all_choices import Chosen, choose_settings, free_settings
from excite.identification.choices.friction_terms import TERM_SETTINGS, added_columns
from excite.identification.estimator import Context, Estimator, hide_parameters
from excite.identification.free_base import low_passed, why_not
from excite.identification.identification import Identification
from excite.identification.impossible_parameters import beyond_plausible
from excite.identification.large_residual import with_external_forces
from excite.identification.log_faults import clock_jumps
from excite.identification.prediction import instantaneous_target
from excite.identification.procedure import LogLike, calibrated, check_given, estimate_parameters, read_logs
from excite.identification.recipe import Recipe
from excite.identification.result import check_played, played_design, provenance_of
from excite.identification.spoilt_log import SPOILT
from excite.identification.streamed_rows import HELD
from excite.identification.symmetry import symmetry_of
from excite.information.target import friction_of_moving, model_of
from excite.logs.base_motion import measured_equations
from excite.logs.log import Log
from excite.logs.mapping import LogMapping, read_mapping
from excite.tasks.friction_file import read_friction
from excite.tasks.installation import Installation
from excite.tasks.robot_of_task import moving_robot, robot_and_task
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import ExciteError, InputError
from regressors.models.model import RegressorModel
from regressors.numerical import numerical_work, one_thread
from regressors.quantities import check
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.moving_base import BASE_JOINTS
from regressors.robot.robot import Limits, Robot
from regressors.robot.symbolic.vectorised import interpreted_note
from regressors.samples import Samples
from regressors.work_prediction import FLOAT, announce, check_memory

_NO_BODIES = "bodies are not held physically possible: the conic solver found none for all rows together"
_RECIPE = frozenset(field.name for field in fields(Recipe))


@checked
@one_thread()
@numerical_work(
    "the identification",
    "rows that hardly move, or numbers of very different sizes are the likely cause: "
    "check the units of the log and `rows`",
)
def identify(
    model: RegressorModel | Robot | Task | str,
    logs: LogLike | Sequence[LogLike],
    /,
    *,
    design: Design | None = None,
    friction_curves: FrictionCurves | str | Path | None = None,
    recipe: Recipe | None = None,
    estimator: Estimator | str | None = None,
    mapping: LogMapping | str | Path | None = None,
    drop: Iterable[str] = (),
    loaded: LogLike | Sequence[LogLike] = (),
    known_mass: float | None = None,
    gains: str = "each",
    each: bool = False,
    seed: int = 0,
    choose: bool | Collection[str] = True,
    progress: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> Identification:
    """Identify a model's parameters from one log or several.

    Parameters
    ----------
    model : RegressorModel, Robot, Task or str
        Model to identify. A robot, or the name or file of one, stands for the model of the design, or else for the
        differential model. Positional only, since ``model=...`` is an option of a `Task`.
    logs : Log, frame, dict of columns, Simulation, path, or a sequence of them
    design : Design, optional
        The design that was played: its model and joints are used where they are not given.
    friction_curves : FrictionCurves or path, optional
        Known friction, which is subtracted; that of the design if not given, unless friction is to be identified.
    recipe : Recipe, optional
        Settings of the identification.
    estimator : Estimator or str, optional
        Replaces that of the recipe.
    mapping : LogMapping or path, optional
        How foreign files are laid out; where it names the design that was played, another `design` is refused.
    drop : iterable of str
        Faulty rows of files to leave out, see `excite.logs.log_reading.read_log`.
    loaded : Log, frame, dict of columns, Simulation, path, or a sequence of them
        Logs with a load of known mass at the last link, which calibrate the gains of the drives; the parameters are
        then in corrected torques, of the robot without the load.
    known_mass : float, optional
        Of that load [kg].
    gains : {"each", "common"}
        One gain for each drive, or one for all.
    each : bool
        Keep the estimate of each of several logs alone with the result, beside the scatter between them.
    seed : int
        Seed of later random steps, such as repetitions; kept with the result.
    choose : bool or collection of str
        Which settings are chosen by predicting torques that were left out, where they are not given: all, none, or
        those named, see `excite.registry.CHOSEN`. The terms of a design, and those of a
        model object, are kept.
    progress : callable
        Called with a description of each step.
    **options
        Options of the recipe, and of the model of a `Task`, by name; `base_link` and `tip`, the ends of the chain,
        `snap_angles` and `xacro`, where the file of a robot is named.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        Logs that do not fit, that are given twice, or too few equations; a design of another robot.
    """
    check("seed", seed)
    check("known_mass", known_mass)
    began, cpu = time.monotonic(), time.process_time()
    layout = read_mapping(mapping) if isinstance(mapping, str | Path) else mapping
    model = _on_moving_base(model, layout, options)
    installation = _installation(model, design, options)
    robot, task = robot_and_task(model, **_ends(model, design, options), installation=installation)
    asked = options.get("equations", task.model.equations)
    equations = measured_equations(layout, robot, asked)
    options |= {} if equations is None else {"equations": equations}
    given = {*options, *(() if estimator is None else ("estimator",))}
    of_recipe = {name: options.pop(name) for name in list(options) if name in _RECIPE}
    if estimator is not None:
        of_recipe["estimator"] = estimator
    recipe = replace(recipe if recipe is not None else Recipe(), **of_recipe)
    check_played(design, mapping)
    if design is not None:
        check_design(robot, design)
        task = _as_designed(model, task, design)
        recipe = _with_period(recipe, design)
    task = task.changed(**options)
    if task.model.channel == "command":
        raise InputError("servos are identified by `excite.identification.servos.identify_servos`")
    as_designed = _friction_as_designed(model, task, options)
    curves, file = _known_friction(friction_curves, design if as_designed else None, task, robot)
    commanded = None if design is None else design.trajectory
    recipe.chosen_estimator().check(commanded)
    calibrate = check_given(loaded, known_mass, gains)
    read = read_logs(logs, robot, mapping, tuple(drop), progress, recipe.row_numbers)
    check_rows("the identification", read)
    if each and len(read) < 2:
        raise InputError(
            "`each` compares the estimates of several logs, but one log is given; give more, or leave it out"
        )
    free = free_settings(choose, recipe, task.model, given)
    if design is not None or not task.model.friction:
        free -= TERM_SETTINGS
    announce("the identification", identification_seconds(read, chosen=bool(free)))

    if equations != asked:
        _check_instants(robot, task)
    known = {"commanded": commanded, "friction": curves, "progress": progress}
    with _refusals_explained(robot, task, read, recipe, known):
        target = instantaneous_target(robot, task, recipe)
        read = [with_external_forces(robot, target, log, recipe) for log in read]
        chosen = choose_settings(robot, task, read, recipe, free, friction=curves, progress=progress)
        floats = asked is None and layout is not None and layout.base is not None and layout.base.free
        estimated = _estimated_on_free_base if floats else _estimated
        chosen, result = estimated(robot, chosen, read, known, may_fall_back="estimator" in free)
        if calibrate and known_mass is not None:
            with_load = read_logs(loaded, robot, mapping, tuple(drop), progress)
            result = calibrated(result, read, with_load, known_mass, gains, commanded=commanded)
        if task.model.symmetric:
            progress("comparing left and right")
            apart = _estimated(robot, _untied(chosen), read, known, may_fall_back=False)[1]
            apart = _allowing_for_choices(apart, chosen)
            result = replace(result, symmetry=symmetry_of(result.target, apart.target, apart.estimate))
    hidden = _implausible(_allowing_for_terms(result, chosen))
    result = _allowing_for_choices(result, chosen)
    if hidden.any():
        result = replace(result, estimate=hide_parameters(result.estimate, hidden))
    spent = time.monotonic() - began, time.process_time() - cpu
    return replace(
        result,
        estimate=replace(result.estimate, notes=(*result.estimate.notes, *chosen.notes, *interpreted_note())),
        choices=chosen.choices,
        each=each,
        friction_file=file,
        design=None if design is None else played_design(design),
        provenance=provenance_of(spent, mapping, tuple(drop), seed),
    )


@contextmanager
def _refusals_explained(
    robot: Robot, task: Task, logs: Sequence[Log], recipe: Recipe, known: Mapping[str, Any]
) -> Iterator[None]:
    """Add to what refuses logs in the block the fault that explains it, found without the limits of the robot."""
    try:
        yield
    except InputError as error:
        for jump in (jump for log in logs for jump in clock_jumps(log)):
            error.args = ("; ".join([str(error).split("; ")[0], f"{SPOILT} {jump.what}", jump.cure]),)
            raise
        known["progress"]("looking for the fault that explains why the log is refused")
        unlimited = robot.replace(limits=Limits.none(robot.n))
        with suppress(ExciteError, ArithmeticError, np.linalg.LinAlgError):  # of what limits alone do not refuse
            for doubt in estimate_parameters(unlimited, task, logs, recipe, friction=known["friction"]).doubts:
                if doubt.what.startswith(SPOILT):
                    error.args = ("; ".join([str(error).split("; ")[0], doubt.what, doubt.cure]),)
        raise


def _estimated(
    robot: Robot, chosen: Chosen, logs: Sequence[Log], known: dict[str, Any], *, may_fall_back: bool
) -> tuple[Chosen, Identification]:
    """The estimate under chosen settings; by least squares where possible bodies were chosen but none are found."""
    found = frozenset(choice.name for choice in chosen.choices) & set(FOUND)
    try:
        return chosen, estimate_parameters(robot, chosen.task, logs, chosen.recipe, **known, found=found)
    except ConicSolverError:
        if not may_fall_back:
            raise
    recipe = replace(chosen.recipe, estimator="weighted", described_within=None)
    choices = (
        replace(choice, value="weighted", reason=_NO_BODIES) if choice.name == "estimator" else choice
        for choice in chosen.choices
    )
    chosen = replace(chosen, recipe=recipe, choices=tuple(choices))
    return chosen, estimate_parameters(robot, chosen.task, logs, recipe, **known, found=found)


def _estimated_on_free_base(
    robot: Robot, chosen: Chosen, logs: Sequence[Log], known: dict[str, Any], *, may_fall_back: bool
) -> tuple[Chosen, Identification]:
    """The estimate by the equations of the joints, and by those of a base that nothing touches where they add to it."""
    chosen, joints = _estimated(robot, low_passed(chosen), logs, known, may_fall_back=may_fall_back)
    both = replace(chosen, task=chosen.task.changed(equations=None))
    whole, result = _estimated(robot, both, logs, known, may_fall_back=may_fall_back)
    if reason := why_not(result, joints):
        note = f"the equations of the base are left out, and its parameters stay hidden: {reason}"
        return replace(chosen, notes=(*chosen.notes, note)), joints
    note = "the equations of the base are used, since nothing touches the robot"
    return replace(whole, notes=(*whole.notes, note)), result


def _allowing_for_choices(result: Identification, chosen: Chosen) -> Identification:
    """Intervals that hold although settings and terms of drives were chosen by the same data."""
    if chosen.choices:
        context = Context(result.target, result.prepared, result.recipe)
        result = replace(result, estimate=allowing_for_nuisances(result.estimate, result.observations, context))
    return _allowing_for_terms(result, chosen)


def _untied(chosen: Chosen) -> Chosen:
    """The settings without `symmetric`, by an estimator whose covariance is that of its values."""
    recipe = chosen.recipe
    if recipe.chosen_estimator().name == "physical":
        recipe = replace(recipe, estimator="weighted", described_within=None)
    return replace(chosen, task=chosen.task.changed(symmetric=False), recipe=recipe)


def _allowing_for_terms(result: Identification, chosen: Chosen) -> Identification:
    """Intervals that hold although terms of drives were chosen by the same data."""
    estimate = result.estimate
    for choice in chosen.choices:
        if choice.name == "terms":
            added = added_columns(result.target, choice.value)
            estimate = allowing_for_selection(estimate, added, len(choice.candidates) - 1)
    return replace(result, estimate=estimate)


def _implausible(result: Identification) -> NDArray[np.bool_]:
    """Parameters of which the logs show nothing plausible, shape (p,); windows do not tell, and are not judged."""
    target, observations = result.target_of_instants, result.observations
    if target.base.names != result.names or observations.equations != target.model.row_labels:
        return np.zeros(len(result.names), dtype=bool)
    count, square = (
        np.bincount(observations.equation, weights, len(observations.equations))
        for weights in (None, observations.y**2)
    )
    torque = np.sqrt(square / np.maximum(count, 1))
    return beyond_plausible(target, result.estimate, Samples.joined([p.samples for p in result.prepared]), torque)


def _ends(model: object, design: Design | None, options: dict[str, Any]) -> dict[str, Any]:
    """How a file is read, taken out of the options: the ends of the chain; as for the design where nothing is said."""
    own: dict[str, Any] = {"base_link": None, "tip": None, "snap_angles": True, "xacro": False}
    given = {name: options.pop(name, None) for name in own}
    if design is not None and isinstance(model, str):
        own = {name: getattr(design.task, name) for name in own}
    return {name: own[name] if value is None else value for name, value in given.items()}


def _installation(model: object, design: Design | None, options: dict[str, Any]) -> Installation:
    """Remove from the options how the robot is installed; as in the design if a robot is given by name or file."""
    named = {field.name for field in fields(Installation)} & options.keys()
    given = {name: options.pop(name) for name in named}
    as_designed = design is not None and isinstance(model, str)
    return replace(design.task.installation if design is not None and as_designed else Installation(), **given)


def _on_moving_base(
    model: RegressorModel | Robot | Task | str, mapping: LogMapping | None, options: dict[str, Any]
) -> RegressorModel | Robot | Task | str:
    """What is to be identified, on a moving base where the mapping has one."""
    if mapping is None or mapping.base is None:
        return model
    moving = Installation(moving_base=True)
    if options.get("joints"):
        options["joints"] = (*BASE_JOINTS, *options["joints"])
    if isinstance(model, str):
        options["moving_base"] = True
        return model
    if isinstance(model, Robot):
        return moving.applied(model)
    if isinstance(model, RegressorModel):
        return model.on(moving.applied(model.robot))
    if isinstance(model.robot, Robot):
        return model.changed(robot=moving.applied(model.robot))
    return model.changed(moving_base=True)


def _check_instants(robot: Robot, task: Task) -> None:
    """Refuse windows on a moving base whose wrench is not measured: they hold the work of all that acts."""
    if model_of(moving_robot(robot, task), task).window is not None:
        raise InputError(
            "windows hold the work of all that acts on the robot, and no wrench on its moving base is measured; leave "
            "out `model`, or give `wrench:` in `base:`"
        )


def check_design(robot: Robot, design: Design) -> None:
    """Raise `InputError` where a design is of another robot."""
    other = design.robot
    if other.sha256() == robot.sha256():
        return
    theirs, ours = ", ".join(other.joint_names), ", ".join(robot.joint_names)
    joints = f"; its joints are {theirs}, here they are {ours}: choose what moves with `base_link` and `tip`"
    raise InputError(
        f"{design.name} is a design for {other.name} (description {other.sha256()[:12]}), "
        f"not for {robot.name} ({robot.sha256()[:12]}){joints if theirs != ours else ''}"
    )


def _as_designed(model: object, task: Task, design: Design) -> Task:
    """The task with the design's model if only a robot was given, else with the design's joints."""
    chosen = design.task.model
    if isinstance(model, Task):
        return task
    if isinstance(model, RegressorModel):
        return task.changed(joints=chosen.joints, drives=chosen.drives)
    plain = replace(chosen, friction_curves=None)
    nearly = design.task.objective.nearly_unidentifiable
    task = design.task if nearly == "drop" else task.changed(nearly_unidentifiable=nearly)  # "drop": by all of its task
    return task.changed(model=replace(plain, friction=chosen.friction, offset=chosen.offset))


def _with_period(recipe: Recipe, design: Design) -> Recipe:
    """The recipe with the period of the design's motion, where it needs one and has none."""
    periodic = design.trajectory.family.name == "fourier"
    useful = recipe.average or (periodic and recipe.signals == "fourier")
    return replace(recipe, period=design.trajectory.duration) if useful and recipe.period is None else recipe


def _known_friction(
    given: FrictionCurves | str | Path | None, design: Design | None, task: Task, robot: Robot
) -> tuple[FrictionCurves | None, Path | None]:
    """Friction curves that were given, or else those of the design, and their file."""
    if given is not None:
        curves, file = (given, None) if isinstance(given, FrictionCurves) else (_read(given, robot), Path(given))
        return friction_of_moving(curves, robot, moving_robot(robot, task)), file
    if design is None or design.task.known_friction is None or task.model.channel != "effort":
        return None, None
    file = None if design.folder is None else design.folder / "design.json"
    return friction_of_moving(design.task.known_friction, robot, moving_robot(robot, task)), file


def _friction_as_designed(model: object, task: Task, options: Mapping[str, Any]) -> bool:
    """Whether the curves of a design are subtracted: unless friction is to be identified, in the model or by option."""
    said = isinstance(model, Task | RegressorModel) or "friction" in options
    return not said or task.model.friction is False


def _read(path: str | Path, robot: Robot) -> FrictionCurves:
    curves = read_friction(Path(path))
    try:
        curves.check(robot)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return curves


_OF_ANY, _OF_JOINT = 20.0, 13.0  # numbers of each row, and of each of its joints
_COPIES = 6.0  # of the regressor that is held, and of parts of it; beyond `HELD` it is computed when it is asked for


def check_rows(work: str, logs: Sequence[Log]) -> None:
    """Refuse work with the rows of some logs that takes more memory than it may; the factors are measured."""
    rows, joints = sum(log.count for log in logs), max(len(log.joints) for log in logs)
    equations = min(_COPIES * HELD, FLOAT * rows * 10.0 * joints**2)
    held = FLOAT * rows * (_OF_ANY + _OF_JOINT * joints) + equations
    check_memory(work, held, f"{rows} rows", "choose fewer rows with `rows`")


_CHOICES = 0.09  # seconds of choosing settings on the instants of a trial, for each pair of joints
_FURTHER = 0.4  # of that, for each log after the first
_TRIED, _MOST_TRIED = 2.5e-6, 1e5  # seconds of choosing for each row and pair of joints, and rows that count
_ROWS = 5e-7  # seconds of the estimate for each row and pair of joints


def identification_seconds(logs: Sequence[Log], *, chosen: bool) -> float:
    """Time of an identification on one core, without figures [s]; right within a factor of three.

    The unit that it grows with is a number of the regressor: rows times joints times joints, as there are about ten
    parameters to a joint. Measured with 800 to 2,000,000 rows, 5 to 18 joints and up to 5 logs by the estimators
    ``weighted`` and ``physical``; others take more.
    """
    rows, joints = sum(log.count for log in logs), max(len(log.joints) for log in logs)
    seconds = 0.1 + _ROWS * rows * joints**2
    if chosen:
        seconds += _CHOICES * joints**2 * (1.0 + _FURTHER * (len(logs) - 1))
        seconds += _TRIED * min(rows, _MOST_TRIED) * joints**2
    return float(seconds)
