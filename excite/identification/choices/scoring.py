"""Errors of left-out torques under trial settings: equations on the same instants, and estimates from parts of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from excite.errors import ConicSolverError
from excite.identification.choices.left_out import (
    BlockStatistics,
    Choice,
    Estimate,
    LeftOut,
    best_of,
    candidates_of,
    least_squares_of_products,
    left_out,
    time_blocks,
    weighted_sum,
)
from excite.identification.equations import DirectedFriction, drive_directions, friction_drives, nearest
from excite.identification.estimators.physical import possible_fit
from excite.identification.estimators.possible_set import Described, Pull, near_described
from excite.identification.prediction import without_friction
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.presliding import Sliding
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.logs.event import Spans, within
from excite.logs.log import Log
from excite.logs.signals.method import DelayedMotion
from regressors.errors import percent
from regressors.models.nominal import standard_values
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.robot.robot import Robot
from regressors.robot.symbolic.vectorised import SparseRow
from regressors.samples import Array, Index, Samples

Delays = float | Array  # of all measurements after the motion, or of each equation of each log, shape (L, r) [s]


@dataclass(frozen=True, eq=False)
class Scoring:
    """Logs, the columns of a target, and an estimate."""

    trial: Trial
    target: IdentificationTarget
    estimate: Estimate | None = None  # see `left_out`; weighted least squares if not given
    prepared: Sequence[PreparedLog] | None = None  # the logs, whatever is tried; else as each recipe prepares them

    def softened(self, recipe: Recipe) -> Scoring:
        """With friction that changes its sign over the recipe's velocity, where trials cannot write it themselves."""
        width, model = recipe.common_width, self.target.model
        if not width or model.coulomb_friction() is not None:
            return self
        return replace(self, target=replace(self.target, model=model.softened(width)))

    def prepared_by(self, recipe: Recipe) -> Scoring:
        """With the logs as a recipe prepares them, whatever is tried."""
        return replace(self, prepared=self.parts(recipe))

    def parts(self, recipe: Recipe) -> Sequence[PreparedLog]:
        """The logs under a recipe."""
        return self.trial.prepared(self.target, recipe) if self.prepared is None else self.prepared

    def step(self, recipe: Recipe) -> float:
        """Least sample time of the logs [s]."""
        return min(1 / part.log.rate for part in self.parts(recipe))

    def equations(self, recipe: Recipe, delay: Delays = 0.0) -> list[TrialEquations]:
        """W and y of every log, see `Trial.equations`."""
        return self.trial.equations(self.target, self.parts(recipe), recipe, delay)

    def statistics(self, recipe: Recipe, delay: Delays = 0.0) -> BlockStatistics:
        """Sums of products under a recipe."""
        return self.trial.statistics_of(self.equations(recipe, delay), self.target.base.rank)

    def of(self, statistics: BlockStatistics, judged: BlockStatistics | None = None) -> LeftOut:
        """Left-out errors, of the rows that are judged if these are not those of the estimates."""
        plain = left_out(statistics, judged=judged)
        return plain if self.estimate is None else left_out(statistics, self.estimate, plain.weights, judged=judged)

    def fitted(self, statistics: BlockStatistics, weights: Array) -> Array:
        """The estimate from all blocks, shape (p,)."""
        return (self.estimate or least_squares_of_products)(weighted_sum(statistics.total, weights))

    def with_target(self, target: IdentificationTarget, recipe: Recipe) -> Scoring:
        """Score in the columns of another target, with the described bodies if these were needed before."""
        other = replace(self, target=target, estimate=None)
        if self.estimate is None:
            return other
        described = standard_values(target.robot)
        return replace(other, estimate=best_pulled(target, described, other.statistics(recipe)))


def scoring_of(trial: Trial, target: IdentificationTarget, recipe: Recipe, *, may_hold: bool) -> Scoring:
    """Score by least squares; with possible bodies where few data determine too little."""
    plain = Scoring(trial, target)
    if not may_hold or not target.model.standard_columns:
        return plain
    statistics = plain.statistics(recipe)
    errors = plain.of(statistics)
    described = standard_values(target.robot)
    possible = left_out(statistics, possible_estimate_of_products(target, described, None), errors.weights)
    gain, deviation = errors.gain_over(possible)
    return plain if gain > -deviation else replace(plain, estimate=best_pulled(target, described, statistics))


WITHIN = (10.0, 3.0, 1.0)  # of the described bodies, in their sizes


def best_pulled(target: IdentificationTarget, described: Described, statistics: BlockStatistics) -> Estimate:
    """`pulled_least_squares` with the deviation that predicts left-out blocks best."""
    pulls = [near_described(target.model, described, within) for within in WITHIN]
    estimates = [pulled_least_squares(target, pull, range(target.base.rank)) for pull in pulls]
    return min(estimates, key=lambda estimate: left_out(statistics, estimate).score)


def pulled_least_squares(target: IdentificationTarget, pull: Pull, columns: Sequence[int]) -> Estimate:
    """Least squares with the prior ``beta ~ N(A theta0, A D^2 A')`` of the base parameters that bodies are part of."""
    definition, names = target.model.definition()
    A = np.asarray(target.base.D @ definition)[list(columns)]
    values, deviations = np.array([pull.get(name, (0.0, 0.0)) for name in names]).T
    spread, center = A * deviations, A @ values
    known = np.flatnonzero(np.any(spread != 0.0, axis=1))
    length = np.linalg.norm(spread[known], axis=1)
    inverse = np.linalg.pinv((spread[known] / length[:, None]).T)
    information = inverse @ inverse.T / np.outer(length, length) if known.size else np.zeros((0, 0))

    prior = np.zeros((len(columns) + 1,) * 2)
    prior[np.ix_(known, known)] = information
    prior[known, -1] = prior[-1, known] = information @ center[known]
    places = [*range(len(columns)), -1]  # further columns, of which nothing is known, stand before the last

    def estimate(both: Array) -> Array:
        beside = np.zeros(both.shape[-2:])
        beside[np.ix_(places, places)] = prior
        return least_squares_of_products(both + beside)

    return estimate


_WORTH = 0.005  # of the score: what is as good
DEVIATIONS = (None, 10.0, 3.0, 1.0, 0.3)  # of the described bodies, in their sizes; None: only possible


def choose_bodies(
    statistics: BlockStatistics, target: IdentificationTarget, described: Described, recipe: Recipe
) -> tuple[Recipe, Choice]:
    """Whether bodies are held physically possible, and how near to the description.

    Least squares is taken only where it predicts left-out torques better by more than a standard error, and a
    thousandth; and of the pulls towards the description the weakest that is within that of the best.
    """
    free = left_out(statistics)
    held = {
        deviation: left_out(statistics, possible_estimate_of_products(target, described, deviation), free.weights)
        for deviation in deviations_to_try(target, described)
    }
    best = held[best_of(held)]
    chosen = next(deviation for deviation in held if not best.is_better(held[deviation], _WORTH))
    listed = candidates_of({"weighted": free, **{_words(deviation): errors for deviation, errors in held.items()}})
    pull = _pull(target, described, chosen)
    try:
        _possible_fit(target, weighted_sum(statistics.total, held[chosen].weights), described, pull)
    except ConicSolverError:
        reason = "bodies are not held physically possible: the conic solver found none"
        return recipe, Choice("estimator", "weighted", listed, reason)
    gain, deviation = free.gain_over(held[chosen])
    worse = f"by {100 * np.expm1(gain):.2g} +- {percent(deviation)} of it on average over the joints"
    if free.is_better(held[chosen], _WORTH):
        reason = f"bodies are not held physically possible: that raises the error in cross-validation {worse}"
        return recipe, Choice("estimator", "weighted", listed, reason)
    reason = (
        f"bodies are held {_words(chosen)}: error in cross-validation {held[chosen].percent}, by least squares "
        f"{free.percent}, changed {worse}"
    )
    taken = replace(recipe, estimator="physical", described_within=chosen)
    return taken, Choice("estimator", _words(chosen), listed, reason)


def deviations_to_try(target: IdentificationTarget, described: Described) -> Sequence[float | None]:
    """Deviations from the description that are tried; only None where it states no body."""
    return DEVIATIONS if near_described(target.model, described, 1.0) else DEVIATIONS[:1]


def _words(deviation: float | None) -> str:
    if deviation is None:
        return "physically possible"
    return f"physically possible, within about {deviation:g} times their size of the description"


def possible_estimate_of_products(
    target: IdentificationTarget, described: Described, deviation: float | None
) -> Estimate:
    """Estimate by physically possible bodies from sums of products; by least squares where the solver finds none."""
    pull = _pull(target, described, deviation)

    def estimate(both: Array) -> Array:
        if both.ndim > 2:
            return np.array([estimate(one) for one in both])
        try:
            return _possible_fit(target, both, described, pull)
        except ConicSolverError:
            return least_squares_of_products(both)

    return estimate


def _pull(target: IdentificationTarget, described: Described, deviation: float | None) -> Pull | None:
    return None if deviation is None else near_described(target.model, described, deviation)


def _possible_fit(target: IdentificationTarget, both: Array, described: Described, pull: Pull | None) -> Array:
    return possible_fit(factor_of_products(both), target.model, target.base, pull=pull, reference=described)


def factor_of_products(both: Array) -> Array:
    """F of ``[W y]' [W y] = F' F``, shape (p + 1, p + 1)."""
    length = np.sqrt(np.diag(both))
    length = np.where(length > 0, length, 1.0)
    values, vectors = np.linalg.eigh(both / np.outer(length, length))
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * length)


def of_base_columns(target: IdentificationTarget, columns: Sequence[int]) -> IdentificationTarget:
    """A target with some of its base columns; parameters that only the others contain remain undetermined."""
    base, kept = target.base, list(columns)
    few = replace(
        base,
        index=base.index[kept],
        D=base.D[kept],
        singular_values=base.singular_values[kept],
        expressions=tuple(base.expressions[k] for k in kept),
    )
    return replace(target, base=few)


_LONGEST = 50_000  # rows of a log that are tried
_PIECES = 5


LogPiece = tuple[Log, Spans]  # without faulty rows; first and last instant of what makes no equations [s]


def pieces_of(part: PreparedLog) -> list[LogPiece]:
    """The exciting stretch of a log, or evenly spaced pieces of a very long one."""
    log = part.log
    if log.count <= _LONGEST:
        return [(log, part.left_out)]
    length = _LONGEST // _PIECES
    spacing = (log.count - length) // (_PIECES - 1)
    return [(log.rows(slice(k * spacing, k * spacing + length)), part.left_out) for k in range(_PIECES)]


_MOST = 64_000_000  # [bytes]
_LOGS = 8  # whose motion is kept as splines


@dataclass(frozen=True, eq=False)
class TrialRows:
    """Equations of one log under one delay."""

    target: IdentificationTarget  # with a model of single instants
    part: PreparedLog
    delay: float  # of the measurements after the motion, beyond that of the part [s]
    time: Array  # (N,) trial instants [s]
    rows: Index  # (N,) of the part at these instants
    motion: Samples  # the whole delayed motion
    samples: Samples  # of it at the trial instants
    W: list[SparseRow]  # of each equation. Its entries of directed friction are written by `regressor`
    directed: DirectedFriction | None  # None where the model has no friction torque at every instant

    def regressor(self, recipe: Recipe) -> list[SparseRow]:
        """W with friction that has the recipe's directions; valid until the next call."""
        if self.directed is not None and self.directed.columns:
            remembers = np.any(recipe.breakaway or 0.0)
            motion = self.motion if remembers else self.samples
            direction = drive_directions(self.target.robot, motion, recipe.sign_width, recipe.breakaway)
            if direction is None:
                direction = np.sign(motion.dq @ friction_rows(self.target.robot).T)
            torque = self.directed.torque(direction[self.rows] if remembers else direction)
            column, rows = np.array(self.directed.columns), self.directed.rows
            for (place, entries), row in zip(self.W, rows.T, strict=True):
                for k in np.flatnonzero(np.isin(place, column)):
                    used = column == place[k]
                    entries[k] = torque[:, used] @ row[used]
        return self.W

    @property
    def nbytes(self) -> int:
        """Memory of the entries [bytes]."""
        return sum(entries.nbytes for _, entries in self.W)


Mask = NDArray[np.bool_]
TrialEquations = tuple[list[SparseRow], Array]
_INSTANTS = 6000  # of all logs together


@dataclass(frozen=True, eq=False)
class Trial:
    """Logs, and the instants of each on which all settings are tried."""

    robot: Robot  # the whole robot
    logs: tuple[Log, ...]
    instants: tuple[Array, ...]  # of each log [s]
    blocks: tuple[Index, ...]  # block of each instant
    friction: FrictionCurves | None = None  # known friction, which is subtracted
    rows: tuple[Mask, ...] | None = None  # (M, r) rows of each log's instants that count; all if not given

    # presliding that every row shows, by recipe, target and known friction
    slidings: dict[tuple[object, ...], list[tuple[Sliding, float]]] = field(default_factory=dict, repr=False)
    _recent: deque[TrialRows] = field(default_factory=deque, repr=False)  # as many as 64 MB hold
    _prepared: deque[tuple[Recipe, list[PreparedLog]]] = field(default_factory=deque, repr=False)  # likewise
    _motions: deque[DelayedMotion] = field(default_factory=lambda: deque(maxlen=_LOGS), repr=False)

    def prepared(self, target: IdentificationTarget, recipe: Recipe) -> list[PreparedLog]:
        """The logs under a recipe, of which friction has no part in them; one of the last is not filtered again."""
        recipe = replace(recipe, sign_width=None, breakaway=None)
        known = next((parts for one, parts in self._prepared if one == recipe), None)
        if known is None:
            known = [prepare(log, self.robot, target, recipe) for log in self.logs]
            self._prepared.append((recipe, known))
            own = sum(x.nbytes for part in known for x in vars(part.samples).values())
            while len(self._prepared) > _MOST // own:
                self._prepared.popleft()
        return known

    def statistics_of(self, equations: Sequence[TrialEquations], rank: int) -> BlockStatistics:
        """Sums of products of every block, from the equations of every log."""
        equations = equations if self.rows is None else masked(equations, self.rows)
        W, y = zip(*equations, strict=True)
        return BlockStatistics.of(W, y, self.blocks, rank)

    def equations(
        self, target: IdentificationTarget, parts: Sequence[PreparedLog], recipe: Recipe, delay: Delays = 0.0
    ) -> list[TrialEquations]:
        """W, of each equation, and y, shape (N, r), of each log at its trial instants; valid until the next call."""
        late = np.broadcast_to(delay, (len(parts), len(target.model.row_labels)))
        equations = []
        for part, time, own in zip(parts, self.instants, late.tolist(), strict=True):
            under = {one: self._under(target, part, recipe, one, time) for one in dict.fromkeys(own)}
            W = [under[one][0][j] for j, one in enumerate(own)]
            equations.append((W, np.column_stack([under[one][1][:, j] for j, one in enumerate(own)])))
        return equations

    def _under(
        self, target: IdentificationTarget, part: PreparedLog, recipe: Recipe, delay: float, time: Array
    ) -> TrialEquations:
        """W and y of one log under one delay of all equations."""
        trial, measured = self._rows(target, part, delay, time), part.measured
        if self.friction is not None:
            measured = without_friction(replace(part, samples=trial.motion), target, self.friction, recipe).measured
        y = target.model.right_side(trial.samples, measured[trial.rows])
        return trial.regressor(recipe), y.reshape(trial.rows.size, -1)

    def _rows(self, target: IdentificationTarget, part: PreparedLog, delay: float, time: Array) -> TrialRows:
        """Equations of the last ones, or new ones; arguments as of `TrialRows`."""
        for known in self._recent:
            if known.target is target and known.part is part and known.delay == delay and known.time is time:
                return known
        rows, motion = nearest(part.samples.time, time), self._motion(part).by(delay)
        samples = motion.rows(rows)
        W = target.model.entries(samples, target.base.index)
        directed = None if target.model.coulomb_friction() is None else friction_drives(target, samples)
        new = TrialRows(target, part, delay, time, rows, motion, samples, W, directed)
        self._recent.append(new)
        while len(self._recent) > 1 and sum(known.nbytes for known in self._recent) > _MOST:
            self._recent.popleft()
        return new

    def _motion(self, part: PreparedLog) -> DelayedMotion:
        """A log's motion, to be delayed."""
        known = next((motion for motion in self._motions if motion.samples is part.samples), None)
        if known is None:
            self._motions.append(known := DelayedMotion(part.samples))
        return known


def masked(equations: Sequence[TrialEquations], masks: Sequence[Mask]) -> list[TrialEquations]:
    """Equations of every log with zeros instead of the rows that do not count."""
    pairs = zip(equations, masks, strict=True)
    return [
        ([(place, W * m) for (place, W), m in zip(rows, mask.T, strict=True)], y * mask) for (rows, y), mask in pairs
    ]


def trial_of(
    robot: Robot,
    pieces: Sequence[LogPiece],
    target: IdentificationTarget,
    recipe: Recipe,
    friction: FrictionCurves | None = None,
) -> Trial:
    """Logs and trial instants: evenly spaced ones that a recipe leaves, without those that make no equations."""
    empty = Trial(robot, tuple(log for log, _ in pieces), (), (), friction)
    times = [part.samples.time for part in empty.prepared(target, recipe)]
    every = max(1, -(-sum(time.size for time in times) // _INSTANTS))
    kept = [time[::every] for time in times]
    instants = [time[~within(time, left_out)] for time, (_, left_out) in zip(kept, pieces, strict=True)]
    return replace(empty, instants=tuple(instants), blocks=tuple(time_blocks(instants)))
