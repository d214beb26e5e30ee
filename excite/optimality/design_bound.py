"""Bounds on the criteria of all motions within the limits of a design's problem, and how near the design comes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.design.blueprint import restricted_limits
from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.interruption import signal_answered
from excite.design.problem_identity import NotComparable, content_sha256, plain_options
from excite.errors import BrokenLimitError, ConicSolverError
from excite.information.target import target_of
from excite.information.weighting import minimised_text, weighting_of
from excite.optimality.cutting_planes import BOUNDED, LOOKED_AT, BoundedCriterion, CuttingPlanes, Tell
from excite.optimality.limited_states import MomentConditions, StateRows, limited_states, state_rows
from excite.optimality.proven_factor import COARSE, MOST_COORDINATES, MOST_POSITIONS, proven_factor
from excite.optimality.sensitivity import LIKELY_CAUSE, Sensitivity, sensitivity
from excite.registry import instance, is_own, name_of
from excite.storage.atomic import Destination, read_json
from excite.storage.codec import Beside
from excite.storage.commit import read_settled
from excite.storage.migrations import is_of_kind
from excite.storage.records import Shown, read_record, write_beside
from excite.tasks.criteria import TorqueCriterion
from regressors.arguments import checked
from regressors.errors import InputError, check_names
from regressors.numerical import numerical_work, one_thread
from regressors.samples import Array

_INSTANTS = 40  # of the design's motion, for each harmonic
_ROUNDS = 8
_FIRST_PROVEN = 2, 1  # coordinates, and positions among them, of arms with more than can be proven at once
KIND, NAME = "bound", "bound.json"


@dataclass(frozen=True)
class CriterionBound:
    """Lower bound on one criterion, smaller is better, over all motions of the problem."""

    beside: ClassVar[Beside] = {"efficiency": lambda bound: bound.efficiency, "basis": lambda bound: bound.basis}

    # ``condition``, ``logdet`` (D-optimality) or ``sigma-min`` (E-optimality), as `excite.Criterion` has them
    name: str
    described: str
    value: float  # the bound: proven for all states if `proven`, otherwise `estimate`
    proven: bool
    estimate: float  # what the same dual point proves if no state is worse than those that were looked at
    states: int  # number of states that were looked at
    reached: float  # criterion of the design
    cpu_seconds: float

    @property
    def efficiency(self) -> float:
        """``value / reached``: 1 where no motion can be better; at least this part of what is possible is reached."""
        return min(1.0, self.value / self.reached)

    @property
    def sentence(self) -> str:
        """How far the design is from the best possible, and whether that is proven."""
        times = self.reached / self.value
        return f"{self.described} at most {times:.3g} times the best possible (bound {self.value:.4g}, {self.basis})"

    @property
    def basis(self) -> str:
        """``proven``, or ``estimated from N states``."""
        return "proven" if self.proven else f"estimated from {self.states:,} states"


@dataclass(frozen=True, repr=False)
class DesignBound(Shown):
    """Bounds on criteria over all motions within the limits of a design.

    Parameters
    ----------
    name : str
        Of the design.
    problem : str or None
        Hash of the robot, the model, the family, the objective and the limits; None where parts of your own make it
        unknown.
    criteria : tuple of CriterionBound
    assumptions : tuple of str
        What the bounds take into account, and what not.
    coefficients : str
        Hash of the coefficients of the design's motion.
    sensitivity : Sensitivity, optional
        What more harmonics, more time or looser limits would bring; None where it is not known of this motion.
    """

    name: str
    problem: str | None
    criteria: tuple[CriterionBound, ...]
    assumptions: tuple[str, ...]
    coefficients: str = ""
    sensitivity: Sensitivity | None = None

    def __repr__(self) -> str:
        """One line per criterion."""
        lines = (f"{each.name} >= {each.value:.4g} ({each.basis}), {each.efficiency:.0%}" for each in self.criteria)
        return f"<DesignBound of {self.name}: {'; '.join(lines)}>"

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``bound.json`` into the folder of a design.

        Parameters
        ----------
        folder : path

        Raises
        ------
        InputError
            The folder cannot be written to, or holds a file of this name that is something else.
        """
        return write_beside(self, KIND, Path(folder), KIND)


def stored_bound(design: Design) -> DesignBound | None:
    """The bound in a design's folder; None where there is none, or that of another problem."""
    path = None if design.folder is None else design.folder / NAME
    if path is None or not path.exists():
        return None
    problem = bounded_problem_sha256(design)
    content = read_settled(Destination(path.parent), lambda: read_json(path))
    if not is_of_kind(KIND, content.get("schema")) or problem is None or content.get("problem") != problem:
        return None
    try:
        known = read_record(path, DesignBound, KIND)
    except InputError as error:
        raise InputError(f"{error}; remove it, and run `excite bound` again") from error
    coefficients, changes = design.coefficients_sha256, known.sensitivity
    criterion = str(name_of(design.task.objective.criterion))
    if known.coefficients != coefficients or (changes is not None and changes.criterion != criterion):
        changes = None  # of another motion of the same problem
    criteria = tuple(replace(each, reached=reached_by(design, each.name)) for each in known.criteria)
    return replace(known, name=design.name, criteria=criteria, coefficients=coefficients, sensitivity=changes)


@checked
@numerical_work("the bound", LIKELY_CAUSE)
def bound(
    design: Design,
    criteria: Sequence[str] = ("condition",),
    *,
    rounds: int = _ROUNDS,
    seed: int = 0,
    what_ifs: bool = True,
    progress: Callable[[str], None] = lambda _: None,
) -> DesignBound:
    """Bound criteria from below over all motions of a design's family within the limits of its problem.

    M is a mean over the states that a motion passes, ``M = E[Y(s)'Y(s)]``. Any measure over admissible states that
    fulfils conditions which every motion fulfils takes the place of the motion; the best measure is a semidefinite
    programme, and its dual proves a bound [Lasserre 2001; Boyd, Vandenberghe 2004, section 7.5].
    Beside the bounds, see `excite.optimality.sensitivity.sensitivity` for what changes of the problem would bring.

    Parameters
    ----------
    design : Design
        A motion that was designed, with its task.
    criteria : sequence of str
        Of ``condition``, ``logdet`` and ``sigma-min``.
    rounds : int
        Largest number of rounds of cutting planes.
    seed : int
    what_ifs : bool
        Find what changes of the problem would bring, too. Ctrl-C ends the work, and the bounds so far are returned.
    progress : callable, optional
        Takes a sentence on the progress.

    Returns
    -------
    DesignBound

    Raises
    ------
    InputError
        The model integrates over time windows, a coordinate has no limit of its acceleration, an unknown criterion, or
        a design for some of the parameters, for predicted torques or for several robots.
    excite.errors.BrokenLimitError
        The design is not within its limits.
    excite.errors.ConicSolverError
        The relaxation could not be solved.
    """
    check_names("criterion", criteria, BOUNDED)
    _check_bounded(design)
    if design.broken:
        raise BrokenLimitError(
            f"{design.name} breaks {len(design.broken)} limits ({design.broken[0]}), and a bound holds for motions "
            "within the limits only; design it again within the limits"
        )
    design.robot.check_open("a bound on criteria over all motions")
    with one_thread():
        formulation = formulate(design.robot, design.task)
        planes = cutting_planes(formulation, design)
        best, changes, said = dict[str, CriterionBound](), None, _assumptions(formulation, planes)
        try:
            for name in criteria:
                for each in _improving(BOUNDED[name], planes, design, rounds, seed, progress):
                    if name not in best or (each.proven, each.value) > (best[name].proven, best[name].value):
                        progress(each.sentence)
                    best[name] = each
        except KeyboardInterrupt:
            if not best:
                raise
            signal_answered()
            said = (*said, "the work was interrupted: without that, the bound may be better")
        else:
            try:
                changes = sensitivity(design, progress) if what_ifs else None
            except KeyboardInterrupt:
                signal_answered()
    found, problem = tuple(best.values()), bounded_problem_sha256(design)
    return DesignBound(design.name, problem, found, said, design.coefficients_sha256, changes)


def _check_bounded(design: Design) -> None:
    """Raise `InputError` where a bound on criteria of all parameters says nothing of what a design minimises."""
    objective = design.task.objective
    of_torques = isinstance(instance("criterion", objective.criterion), TorqueCriterion)
    if objective.interest or objective.plausible_robots or of_torques:
        raise InputError(
            f"{design.name} minimises {minimised_text(design.task)}, of which no bound is known; "
            "bounds are for designs whose criterion is one of all parameters alike"
        )


def cutting_planes(formulation: Formulation, design: Design) -> CuttingPlanes:
    """The relaxation of a design problem."""
    blueprint, family = formulation.blueprint, formulation.task.trajectory.family()
    harmonics = family.harmonic_frequencies
    frequencies = np.zeros(0) if harmonics is None else harmonics
    bandwidth = float(frequencies[-1]) if frequencies.size else None
    limits = restricted_limits(formulation.limits, blueprint.motion)
    states = limited_states(limits, blueprint.centre, bandwidth)
    rows = state_rows(formulation)
    counted = rows.positions_that_count() & np.isfinite(states.extent(0))
    motion = _states_of(design, rows, _INSTANTS * family.richness)
    return CuttingPlanes(rows, MomentConditions(states, counted, frequencies), motion)


def _states_of(design: Design, rows: StateRows, count: int) -> Array:
    """States of the design's motion in the moving coordinates, at equal steps over its duration."""
    inverse = np.asarray(np.linalg.pinv(rows.motion.matrix), dtype=float)
    moving = design.trajectory.carried(inverse, -inverse @ rows.motion.offset)
    samples = moving.samples((np.arange(count) + 0.5) * moving.duration / count)
    return np.hstack([samples.q, samples.dq, samples.ddq])


def _improving(
    criterion: BoundedCriterion, planes: CuttingPlanes, design: Design, rounds: int, seed: int, progress: Tell
) -> Iterator[CriterionBound]:
    """Better and better bounds: soon a proven one, of few coordinates if there are many; then the estimate of all."""
    began, proven, estimate = time.process_time(), 0.0, 0.0
    reached = reached_by(design, criterion.name)

    def outcome() -> CriterionBound:
        useful, seconds = proven > criterion.trivial, time.process_time() - began
        value, name, described = proven if useful else estimate, criterion.name, criterion.described
        return CriterionBound(name, described, value, useful, estimate, LOOKED_AT, reached, seconds)

    small = planes.states.n <= MOST_COORDINATES and int(planes.conditions.counted.sum()) <= MOST_POSITIONS
    few = planes if small or not criterion.of_columns else planes.of_few(*_FIRST_PROVEN)
    with suppress(*(() if few is planes else (ConicSolverError,))):
        for number, best in enumerate(few.improving(criterion, rounds, np.random.default_rng(seed), progress)):
            estimate = criterion.proven(*best)
            if number == 0:
                factor = proven_factor(*best, seed, progress, COARSE)
                proven = 0.0 if factor is None else criterion.proven(best[0], factor)
            yield outcome()
        if (factor := proven_factor(*best, seed, progress)) is not None:
            proven = max(proven, criterion.proven(best[0], factor))
        yield outcome()
    with suppress(*((ConicSolverError,) if proven else ())):
        for best in () if few is planes else planes.improving(criterion, rounds, np.random.default_rng(seed), progress):
            estimate = max(estimate, criterion.proven(*best))
            yield outcome()


def reached_by(design: Design, name: str) -> float:
    """Criterion of a design's motion, sampled at its rate."""
    task = design.task
    target = target_of(design.robot, task)
    samples = design.trajectory.samples(target.model.times(design.trajectory.duration, task.output.rate))
    M = weighting_of(target, task).matrix(target.model.assemble(samples)[:, target.base.index])
    return float(instance("criterion", name).value(M))


def _assumptions(formulation: Formulation, planes: CuttingPlanes) -> tuple[str, ...]:
    """What the relaxation knows of the motions."""
    said = [
        "the bound uses the limits of position, velocity and acceleration of joints and drives, and that derivatives "
        "have mean zero over a closed motion"
    ]
    if planes.states.bandwidth is None:
        family = formulation.task.trajectory.name
        said.append(f"motions of the family {family} have no highest frequency, so that none is used")
    else:
        said.append("it uses the harmonics of the motions; at rest at both ends is not used")
    if formulation.nonlinear or formulation.stated:
        said.append(
            "limits of torques, of the tool and of distances are not used: with them the best possible is no better"
        )
    said.append("the bound is on means over continuous time; sampled criteria differ by the error of sampling")
    return tuple(said)


_METHOD = 1  # to be raised where the same problem is bounded in another manner
_PARTS = ("model", "trajectory", "objective", "limits")
_LEFT_OUT = ("class", "criterion", "require", "interest", "task_motion", "plausible_robots")


def bounded_problem_sha256(design: Design) -> str | None:
    """Hash of the problem that a design's bound belongs to; None where parts of one's own make it unknown."""
    content: dict[str, Any] = {"robot": design.robot.sha256(), "method": _METHOD, "rate": design.task.output.rate}
    try:
        content |= plain_options(design.task, _PARTS, _LEFT_OUT)
    except NotComparable:
        return None
    named = (design.task.model.model, design.task.trajectory.trajectory, *design.task.limits.constraints)
    unknown = any(isinstance(each, str) and is_own(each) for each in named)
    return None if unknown else content_sha256(content)
