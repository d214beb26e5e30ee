"""A design: a motion with its limits, criteria and provenance; the same when it is new and when it is loaded."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from constraints.certificate import EXACT, LimitUse
from constraints.closed_loops import free_limits
from constraints.enclosure import uses_of
from constraints.geometry import World
from constraints.interpolation import Curve, InterpolatedLimits, curves_text, interpolated_limits
from constraints.linear import linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.design.approach import ApproachAndReturn
from excite.design.start_results import HarmonicsTrial, SearchSummary, StartResult, read_starts
from excite.design.stated_limits import StatedWorld, Unchecked, nonlinear_limits, stated_limits
from excite.information.earlier_precision import information_in_hand
from excite.information.matrix import CONVENTIONS, MotionMeasures, PredictedAccuracy, noise_per_row
from excite.information.nearly_unidentifiable import NearlyUnidentifiable
from excite.information.precision_forecast import PrecisionForecast, PrecisionSearch, RunInformation
from excite.information.target import IdentificationTarget, target_of
from excite.information.weighting import PriorAndPosterior, minimised_text
from excite.registry import name_of
from excite.storage.codec import INLINE, OBJECT, named
from excite.storage.manifest import entry_sha256, sha256_of
from excite.storage.records import Saved
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.sequence import EXCITE, Motion, MotionSequence, Piece, WholeRobotMotion, again
from regressors.errors import InputError
from regressors.models.base import Base
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_ROUNDING = 1e-9  # of a metric, from process to process


@dataclass(frozen=True, eq=False, repr=False)
class Design(Saved):
    """One designed motion with its certificate.

    Of a design that was loaded, limits and metrics are computed again from its coefficients, whatever its file states.

    Parameters
    ----------
    robot : Robot
        The whole robot, as described.
    task : Task
    trajectory : Trajectory
        Motion of the moving robot's joints.
    certified : tuple of LimitUse
        Limits over continuous time, as the design was certified; see `limits`.
    measured : MotionMeasures
        Metrics, as the design was certified; see `measures`.
    minimised_value : float
        Value of the criterion that was minimised, as `excite.information.weighting.minimised_text` names it.
    best_start : int
    provenance : mapping
        Date, versions, seed, times.
    noise : tuple of float
        Standard deviation of each equation that the predictions assume.
    equations : tuple of (str, str)
        Names and units of the equations.
    gap : float, optional
        Of the singular values that decided on the base parameters; None where it is infinite.
    notes : tuple of str
    prior : tuple of PriorAndPosterior
        Base parameters before and after the experiment; empty without prior knowledge.
    interrupted : bool
        True if the search was stopped before its end.
    approach_and_return : ApproachAndReturn, optional
        Transfers from home and back, where the task has a home.
    unchecked : tuple of Unchecked
        Kinds of limits that nothing is known of, so that the motion may break them.
    nearly_unidentifiable : tuple of NearlyUnidentifiable
        Base parameters that the motion leaves far more uncertain than they are large; where there are any, the first
        of the notes says so.
    further_starts : int
        Number of starts beside `starts`.
    search : SearchSummary, optional
        Rounds of the search, and its estimate of what more of them would bring.
    harmonics_trials : tuple of HarmonicsTrial
        Numbers of harmonics that a search tried which chose it, in order; none otherwise.
    shape : World, optional
        Shape of the robot by which self-collision was checked, where it is that of the robot's own file.
    folder : Path, optional
        Where it was loaded from; None where it is new.
    results : tuple of StartResult, optional
        Of the starts, of a new design; see `starts`.
    formulated : (IdentificationTarget, tuple of NonlinearConstraint), optional
        Of a new design; see `target` and `nonlinear`.
    precision_search : PrecisionSearch, optional
        Periods that were tried, where the shortest experiment was sought.
    stated_series : mapping, optional
        Of a design that was loaded; see `series`.
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {
        "feasible": lambda d: d.feasible,
        "conventions": lambda d: CONVENTIONS,
        "minimised": lambda d: minimised_text(d.task),
        "base.rank": lambda d: len(d.predicted),
        "base.columns": lambda d: [each.name for each in d.predicted],
        "base.expressions": lambda d: [each.expression for each in d.predicted],
        "base.units": lambda d: [each.unit for each in d.predicted],
        "precision": lambda d: d.precision,
        "solver.name": lambda d: name_of(d.task.search.solver),
        "solver.starts": lambda d: [start.summary() for start in d.starts],
    }

    robot: Robot
    task: Task = field(metadata=OBJECT)
    trajectory: Trajectory = field(metadata=OBJECT)
    certified: tuple[LimitUse, ...] = field(metadata=named("limits"))
    measured: MotionMeasures = field(metadata=INLINE)
    minimised_value: float = field(metadata=OBJECT)
    best_start: int = field(metadata=named("solver.best_start"))
    provenance: Mapping[str, Any]
    noise: tuple[float, ...] = field(default=(), metadata=named("predicted.noise"))
    equations: tuple[tuple[str, str], ...] = field(default=(), metadata=named("predicted.equations"))
    gap: float | None = field(default=None, metadata=named("base.gap"))
    notes: tuple[str, ...] = ()
    prior: tuple[PriorAndPosterior, ...] = field(default=(), metadata=named("predicted.prior"))
    interrupted: bool = False
    approach_and_return: ApproachAndReturn | None = field(default=None, metadata=OBJECT)
    unchecked: tuple[Unchecked, ...] = ()
    nearly_unidentifiable: tuple[NearlyUnidentifiable, ...] = field(
        default=(), metadata=named("predicted.nearly_unidentifiable")
    )
    further_starts: int = field(default=0, metadata=named("solver.further_starts"))
    search: SearchSummary | None = field(default=None, metadata=named("solver.search"))
    harmonics_trials: tuple[HarmonicsTrial, ...] = field(default=(), metadata=named("solver.harmonics"))
    shape: World | None = None
    folder: Path | None = field(default=None, metadata=OBJECT)
    results: tuple[StartResult, ...] | None = field(default=None, metadata=OBJECT)
    formulated: tuple[IdentificationTarget, tuple[NonlinearConstraint, ...]] | None = field(
        default=None, metadata=OBJECT
    )
    precision_search: PrecisionSearch | None = field(default=None, metadata=OBJECT)
    stated_series: Mapping[str, Any] | None = field(default=None, metadata=OBJECT)

    @cached_property
    def target(self) -> IdentificationTarget:
        """Model to identify, with its base columns."""
        return target_of(self.robot, self.task) if self.formulated is None else self.formulated[0]

    @cached_property
    def moving(self) -> Robot:
        """The robot that the model is written for, with the task's limits."""
        return moving_robot(self.robot, self.task) if self.formulated is None else self.formulated[0].robot

    @property
    def base(self) -> Base:
        """Left-to-right base of the model."""
        return self.target.base

    @cached_property
    def nonlinear(self) -> tuple[NonlinearConstraint, ...]:
        """Limits of torques, the tool and distances, functions of the joints that move.

        Raises
        ------
        InputError
            A part or a file that the task only names.
        """
        return self.imposed_on(self.moving.joint_names) if self.formulated is None else self.formulated[1]

    def imposed_on(self, joints: tuple[str, ...]) -> tuple[NonlinearConstraint, ...]:
        """Limits that are not linear: those that its task asks for, and those that hold by default."""
        by_default = stated_limits(self.robot, joints, self.task, StatedWorld(self.shape)).constraints
        unclaimed = {each.limit for each in self.unchecked}
        kept = (limit for limit in by_default if limit.quantity not in unclaimed)
        return (*nonlinear_limits(self.robot, joints, self.task), *kept)

    @cached_property
    def starts(self) -> tuple[StartResult, ...]:
        """Results of the starts, the best of a great many; of a design that was loaded, those that its folder has."""
        if self.results is not None or self.folder is None:
            return self.results or ()
        folder = self.folder / "starts"
        return tuple(read_starts(folder)) if folder.is_dir() else ()

    @property
    def number_of_starts(self) -> int:
        """Number of starts that the motion is the best of."""
        return len(self.starts) + self.further_starts

    @cached_property
    def recomputed(self) -> RecomputedLimits:
        """Limits of the motion, of approach and return, and what is believed, computed from its coefficients."""
        return recomputed_limits(self)

    @property
    def limits(self) -> tuple[LimitUse, ...]:
        """Limits over continuous time."""
        return self.certified if self.folder is None else self.recomputed[0]

    @property
    def transfer_limits(self) -> Mapping[str, tuple[LimitUse, ...]]:
        """Limits on approach and return over continuous time, per segment; none without a home."""
        if self.approach_and_return is None:
            return {}
        return self.approach_and_return.limits if self.folder is None else self.recomputed[1]

    @cached_property
    def _measured(self) -> tuple[MotionMeasures, str]:
        """Metrics, and why they are those of the file; empty where they are computed.

        Where the file agrees but for rounding, which differs from process to process, a metric has its very bits.
        """
        stated = self.measured
        if self.folder is None:
            return stated, ""
        try:
            model = self.target.model
        except InputError as error:
            return stated, str(error)
        samples = self.trajectory.samples(model.times(self.trajectory.duration, self.task.output.rate))
        known = MotionMeasures.of(self.target, samples, noise_per_row(self.task.objective.noise, model))
        criteria = {name: _confirmed(value, stated.criteria.get(name)) for name, value in known.criteria.items()}
        return replace(known, criteria=criteria), ""

    @property
    def measures(self) -> MotionMeasures:
        """Metrics of the motion; those of the file where its model is not given."""
        return self._measured[0]

    @property
    def criteria(self) -> Mapping[str, float]:
        """Metrics by name, see `excite.information.matrix.CONVENTIONS`."""
        return self.measures.criteria

    @property
    def predicted(self) -> tuple[PredictedAccuracy, ...]:
        """Predicted accuracy of each base parameter."""
        return self.measures.predicted

    @property
    def spectrum(self) -> Array:
        """Singular values of W, largest first, shape (b,)."""
        return self.measures.spectrum

    @property
    def rows(self) -> int:
        """Number of rows of W."""
        return self.measures.rows

    @property
    def condition_number(self) -> float:
        """cond(W) in the left-to-right base, SI, unscaled; infinite where it is not finite."""
        return self.criteria["condition_number"]

    @property
    def believed(self) -> tuple[str, ...]:
        """What is not computed from the coefficients, but as the file states it, and why."""
        if self.folder is None:
            return ()
        why = self._measured[1]
        criteria = f"criteria and predictions are those that its file states: {why}" if why else ""
        return tuple(filter(None, [self.recomputed[2], criteria]))

    @cached_property
    def run_information(self) -> RunInformation | None:
        """What one run brings towards the precision that the task asks for, where it asks for one."""
        objective = self.task.objective
        if not isinstance(objective.precision, PrecisionTarget) or self.task.model.channel == "command":
            return None
        model = self.target.model
        samples = self.trajectory.samples(model.times(self.trajectory.duration, self.task.output.rate))
        noise, in_hand = noise_per_row(objective.noise, model), information_in_hand(self.target, self.task)
        return RunInformation.of(objective.precision, self.target, samples, noise, self.sequence.duration, in_hand)

    @property
    def precision(self) -> PrecisionForecast | None:
        """Runs that meet the precision that the task asks for within its `max_time`, and their half-widths."""
        run, search = self.run_information, self.precision_search
        if run is None:  # of servos, it is rehearsed
            return None if search is None else search.forecast
        return run.forecast(self.task.objective.max_time)

    @property
    def feasible(self) -> bool:
        """True if every checked limit holds over continuous time, to 1e-9 of its bound, on approach and return too."""
        return not self.broken

    @property
    def broken(self) -> tuple[str, ...]:
        """Labels of the limits that do not hold, on approach and return too."""
        uses = (use for some in (self.limits, *self.transfer_limits.values()) for use in some)
        return tuple(use.label for use in uses if not use.holds)

    @cached_property
    def sequence(self) -> MotionSequence:
        """The whole motion of every joint: the approach, the exciting motion, the return."""
        robot = self.task.limits.applied(self.robot)
        motion = WholeRobotMotion(self.trajectory, robot, self.moving.joint_names)
        played: list[Motion] = [motion]
        if self.task.output.stops:
            limits = [limit for limit in linear_limits(robot) if limit.derivative > 1]
            played += again(
                motion,
                self.task.output.rate,
                lambda samples: all((np.abs(g.values(samples)) <= g.upper).all() for g in limits),
            )
        pieces = tuple(Piece(EXCITE, each, round(each.duration * self.task.output.rate)) for each in played)
        return MotionSequence(pieces) if self.approach_and_return is None else self.approach_and_return.sequence(pieces)

    @property
    def samples(self) -> Samples:
        """The motion at the task's rate."""
        return self.trajectory.sampled(self.task.output.rate)

    @cached_property
    def between_samples(self) -> tuple[InterpolatedLimits, ...]:
        """Limits of lines, cubics and quintics through the samples of ``trajectory.csv``, to 1e-6 of the bounds."""
        return _interpolated(self, self.sequence.sampled()[0], tuple(Curve))

    @property
    def series(self) -> dict[str, Any]:
        """The joints that move, the family and its coefficients, as ``design.json`` has them."""
        if self.stated_series is not None:
            return dict(self.stated_series)
        names = self.trajectory.joints(self.moving.joint_names)
        return {"joints": list(names), **self.trajectory.family.to_dict(self.trajectory.x)}

    @property
    def coefficients_sha256(self) -> str:
        """Hash of the motion's coefficients, as ``design.json`` has it."""
        return entry_sha256(self.series)

    @property
    def file_sha256(self) -> str | None:
        """Hash of the ``design.json`` that it was read from; None for a design that was not read from a folder."""
        return None if self.folder is None else sha256_of(self.folder / "design.json")

    @property
    def name(self) -> str:
        """Folder of the design, or the name of its robot."""
        return str(self.folder) if self.folder is not None else self.robot.name

    def _written(self, place: Path, *, replace: bool) -> list[Path]:
        from excite.design.design_folder import save_design

        return save_design(self, place, replace=replace)

    def stored(self) -> Design:
        """The design that is written: with what is computed from the coefficients in place of what a file states."""
        if self.folder is None:
            return self
        ways = self.approach_and_return
        ways = None if ways is None else replace(ways, limits=dict(self.transfer_limits))
        return replace(
            self,
            certified=self.limits, measured=self.measures, approach_and_return=ways, results=self.starts, folder=None,
        )  # fmt: skip

    def __repr__(self) -> str:
        """One-line summary."""
        place = "" if self.folder is None else f" in {self.folder}"
        return (
            f"<Design of {self.robot.name}{place}: {self.trajectory.duration:g} s, "
            f"{self.trajectory.family.described}, condition number {self.condition_number:.4g}>"
        )


def _confirmed(value: float, stated: float | None) -> float:
    """The stated value, where it is the computed one but for rounding."""
    return stated if stated is not None and math.isclose(value, stated, rel_tol=_ROUNDING) else value


#: Limits of the motion; those on the approach and the return, where there are any; and which of them are those that the
#: file states, and why, empty if none are.
RecomputedLimits = tuple[tuple[LimitUse, ...], Mapping[str, tuple[LimitUse, ...]], str]


def recomputed_limits(design: Design, *, enclosed: bool = True) -> RecomputedLimits:
    """Limits of the motion of a design that was loaded.

    Those of positions and their derivatives need nothing but the robot. Others need the parts and files that the task
    names; without them those of the file stay. Limits of torques are not computed where the file does not claim them.
    """
    robot, moving, ways = design.robot, design.moving, design.approach_and_return
    transfers = {} if ways is None else ways.transfers
    stated = {} if ways is None else ways.limits
    of_motion: tuple[NonlinearConstraint, ...] = ()
    of_ways: tuple[NonlinearConstraint, ...] = ()
    reason = ""
    try:
        if enclosed:
            of_motion = design.nonlinear
        if enclosed and transfers:
            alike = moving.joint_names == robot.joint_names
            of_ways = of_motion if alike else design.imposed_on(robot.joint_names)
    except InputError as error:
        reason = f": {error}"
    proven = design.trajectory.proven if enclosed else ()
    uses = (*uses_of(design.trajectory, free_limits(moving), of_motion), *proven)
    motion, believed = _with_stated(uses, design.certified)
    whole = linear_limits(design.task.limits.applied(robot)) if transfers else ()
    of_transfers = {}
    for name, way in transfers.items():
        of_transfers[name], more = _with_stated(uses_of(way, whole, of_ways), stated.get(name, ()))
        believed = (*believed, *more)
    kinds = list(dict.fromkeys(use.quantity for use in believed))
    named_kinds = " and ".join(filter(None, [", ".join(kinds[:-1]), *kinds[-1:]]))
    said = f"limits of {named_kinds} are those that its file states{reason}" if believed else ""
    return motion, of_transfers, said


def _with_stated(
    uses: tuple[LimitUse, ...], stated: Iterable[LimitUse]
) -> tuple[tuple[LimitUse, ...], tuple[LimitUse, ...]]:
    """Uses with those of a file that could not be computed, and these alone; exact ones are always computed."""
    known = {use.label for use in uses}
    believed = tuple(use for use in stated if use.method != EXACT and use.label not in known)
    return (*uses, *believed), believed


_FASTER = (2, 5, 10)  # times the rate, that may be enough for quintics
_MOST = 20_000  # samples that are tried for it
_JUMP = 0.01  # of a limit: more is a jump of the jerk between two samples, which no rate takes away


def between_samples_text(design: Design, certified: Sequence[InterpolatedLimits]) -> str:
    """One sentence: by which curves the limits are kept, which are passed by how much, and what helps."""
    return f"trajectory.csv, between its samples: limits {curves_text(certified)}{_remedy(design, certified)}"


def _interpolated(design: Design, samples: Samples, curves: Sequence[Curve]) -> tuple[InterpolatedLimits, ...]:
    limits = linear_limits(design.task.limits.applied(design.robot))
    return tuple(interpolated_limits(limits, samples, curve) for curve in curves)


def _remedy(design: Design, certified: Sequence[InterpolatedLimits]) -> str:
    """Quintics, or a rate at which they keep the limits, or an export that has samples where the jerk jumps."""
    passed = {each.curve: each.broken[0].use - 1.0 for each in certified if each.broken}
    if Curve.QUINTICS not in passed:
        return "; interpolate by quintics" if passed else ""
    if passed[Curve.QUINTICS] >= _JUMP:
        return "; its jerk jumps between samples: an export as ros2-yaml has samples there"
    for rate in (times * design.task.output.rate for times in _FASTER):
        time = np.arange(round(design.sequence.duration * rate) + 1) / rate
        if time.size <= _MOST and not _interpolated(design, design.sequence.at(time)[0], (Curve.QUINTICS,))[0].broken:
            return f"; `rate` {rate:g} keeps quintics within them"
    return ""
