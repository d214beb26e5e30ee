"""The information matrix M = W'W / N of a motion, with exact first derivatives, and metrics of the motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, TypeVar

import numpy as np

from excite.information.target import IdentificationTarget
from excite.information.tracking import LinearServos
from excite.storage.codec import OBJECT, Beside, named
from excite.trajectories.closed import joint_motion, joint_trajectory
from excite.trajectories.family import Family, Trajectory
from regressors.errors import InputError
from regressors.models.model import Combination, RegressorModel
from regressors.models.nominal import MotorSide, motor_sides
from regressors.models.partial import PartialMotion
from regressors.numerical import column_lengths
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Index, Samples

_CALL = 100_000  # multiplications in the time of a call
_CACHE = 2**17  # numbers that stay in a cache
Item = TypeVar("Item")


@dataclass(frozen=True, eq=False)
class Evaluation:
    """M at one point, with the intermediate results that its derivative needs."""

    x: Array  # the point
    M: Array  # (b, b)
    motion: list[Array]  # (n, T) q, dq, ddq at the instants
    W: list[Array]  # rows of W divided by their noise, by blocks: (c, e, N) column, scalar equation, instant


@dataclass(frozen=True, eq=False)
class _Block:
    """Consecutive equations, and the columns that they have entries in."""

    columns: Index  # (c,)
    equations: int  # e
    entries: Index  # (k,) numbers of the entries of W in the block
    place: tuple[Index, Index]  # (k,) column and equation of each in the block

    @cached_property
    def square(self) -> tuple[Index | slice, Index | slice]:
        """Its part of M."""
        first, last = int(self.columns[0]), int(self.columns[-1])
        adjacent = last - first + 1 == self.columns.size
        return (slice(first, last + 1),) * 2 if adjacent else (self.columns[:, None], self.columns)


class Information:
    """M(x) for one model's columns over one family.

    The equation of a joint depends on the bodies that the joint carries. Products with W leave out zeros of the others.
    """  # Y regressor of one instant, (r, b) of q, dq, ddq; noise (r,)

    def __init__(
        self,
        Y: VectorisedFunction,
        family: Family,
        combination: Combination,
        motion: PartialMotion,
        noise: Array,
        tracking: LinearServos | None = None,
    ) -> None:
        self._function = Y
        self._family, self._motion = family, motion
        told = joint_motion(family, combination.time, motion)
        self._joints = told if tracking is None else tracking.motion(told, combination.time.size)
        self._difference, self._integral = combination.difference, combination.integral
        self._count = combination.difference.shape[0]
        equations = Y.shape[0] if self._integral is None else Y.shape[0] // 2
        is_state = Y.row < equations
        self._states, self._densities = np.flatnonzero(is_state), np.flatnonzero(~is_state)
        entries, self._entry = np.unique(Y.column * equations + Y.row % equations, return_inverse=True)
        column, equation = np.divmod(entries, equations)
        self._blocks = _blocks(column, equation, equations, self._count)
        self._weights = None if np.all(noise == 1.0) else 1.0 / noise[equation, None]

    @property
    def following(self) -> int:
        """Number of joints that follow others since loops close."""
        return self._motion.following

    @property
    def instructions(self) -> int:
        """Those of the regressor at one instant."""
        return self._function.instructions

    def trajectory(self, x: Array) -> Trajectory:
        """Motion of every joint, from that of the moving coordinates."""
        return joint_trajectory(self._family, x, self._motion)

    def evaluate(self, x: Array) -> Evaluation:
        """M of the motion x of the moving coordinates."""
        return self.evaluations([x])[0]

    def evaluations(self, xs: Sequence[Array]) -> list[Evaluation]:
        """M of several motions; each is the same as alone, to the last bit."""
        return [at for some in _groups(xs, self._together) for at in self._evaluate(some)]

    def _evaluate(self, xs: Sequence[Array]) -> list[Evaluation]:
        motions = [self._joints.values(x) for x in xs]
        entries, b = self._entries(self._function(*_beside(motions)), len(xs)), self._function.shape[1]
        M, W = np.zeros((len(xs), b, b)), []
        for block in self._blocks:
            rows = np.zeros((len(xs), block.columns.size, block.equations, self._count))
            rows[:, *block.place] = entries[:, block.entries]
            W.append(rows)
            flat = rows.reshape(*rows.shape[:2], -1)
            M[:, *block.square] += flat @ flat.transpose(0, 2, 1)
        M /= self._count
        return [Evaluation(*one) for one in zip(xs, M, motions, map(list, zip(*W, strict=True)), strict=True)]

    def _entries(self, values: Array, motions: int) -> Array:
        """Entries of W of each motion, shape (motions, entries, N)."""
        values = values.reshape(len(values), motions, -1).transpose(1, 0, 2)
        if self._integral is not None:
            entries = np.zeros((motions, self._entry.max(initial=-1) + 1, self._count))
            s, d = self._states, self._densities
            for k in range(motions):
                entries[k, self._entry[s]] = (self._difference @ values[k, s].T).T
                entries[k, self._entry[d]] += (self._integral @ values[k, d].T).T
            values = entries
        return values if self._weights is None else values * self._weights

    def gradients(self, evaluations: Sequence[Evaluation], Gs: Sequence[Array]) -> list[Array]:
        """Gradients of functions of M with respect to x, from G = df/dM; each is the same as alone, to the last bit.

        ``df = <G, dM> = sum_k <2/N S_k^-1 W_k G, dW_k>``: one reverse sweep with the seeds ``2/N S_k^-1 W_k G``.
        """
        pairs = list(zip(evaluations, Gs, strict=True))
        return [g for some in _groups(pairs, self._together) for g in self._gradients(some)]

    def _gradients(self, pairs: Sequence[tuple[Evaluation, Array]]) -> list[Array]:
        seeds = _stacked([self._seeds(at.W, G) for at, G in pairs])
        motions = [at.motion for at, _ in pairs]
        slopes = self._function.pullback(_beside(motions), seeds)
        each = zip(*(np.split(slope, len(pairs), axis=1) for slope in slopes), strict=True)
        return [self._joints.pullback(at.x, some) for (at, _), some in zip(pairs, each, strict=True)]

    def _seeds(self, W: Sequence[Array], G: Array) -> Array:
        """Derivatives of the function of M with respect to the values, shape (nnz, T)."""
        used = np.empty((self._entry.max(initial=-1) + 1, self._count))
        scaled = 2.0 / self._count * G
        for block, rows in zip(self._blocks, W, strict=True):
            product = scaled[block.square] @ rows.reshape(len(rows), -1)
            used[block.entries] = product.reshape(rows.shape)[block.place]
        if self._weights is not None:
            used *= self._weights
        if self._integral is None:
            return used
        s, d = self._states, self._densities
        seeds = np.empty((self._entry.size, self._integral.shape[1]))
        seeds[s] = (self._difference.T @ used[self._entry[s]].T).T
        seeds[d] = (self._integral.T @ used[self._entry[d]].T).T
        return seeds

    @property
    def _together(self) -> int:
        """Motions whose W fit into a processor's cache together."""
        numbers: int = sum(block.columns.size * block.equations for block in self._blocks) * self._count
        return max(1, _CACHE // max(1, numbers))


def _groups(items: Sequence[Item], most: int) -> Iterator[Sequence[Item]]:
    return (items[first : first + most] for first in range(0, len(items), most))


def _beside(motions: Sequence[list[Array]]) -> list[Array]:
    """Inputs of several motions, one after the other."""
    return [_stacked(parts) for parts in zip(*motions, strict=True)]


def _stacked(parts: Sequence[Array]) -> Array:
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)


def _blocks(column: Index, equation: Index, equations: int, instants: int) -> list[_Block]:
    """Blocks that together contain every entry of W, for few and small products.

    Of the columns from the first one that an equation has an entry in, those of other branches are left out: they enter
    equations that have no column in common with it.
    """
    present = np.zeros((equations, int(column.max(initial=-1)) + 1))
    present[equation, column] = 1.0
    of_others = (present @ present.T == 0.0) @ present > 0.0
    ranges: list[tuple[int, int, Index]] = []
    for k in range(equations):
        first = int(column[equation == k].min(initial=present.shape[1]))
        begin, columns = k, first + np.flatnonzero(~of_others[k, first:])
        if ranges:
            before, _, earlier = ranges[-1]
            joined = np.union1d(earlier, columns)
            apart = _operations(earlier, k - before, instants) + _operations(columns, 1, instants)
            if _operations(joined, k + 1 - before, instants) <= apart:
                begin, columns = before, joined
                ranges.pop()
        ranges.append((begin, k + 1, columns))
    blocks = []
    for begin, end, columns in ranges:
        entries = np.flatnonzero((equation >= begin) & (equation < end))
        place = np.searchsorted(columns, column[entries]), equation[entries] - begin
        blocks.append(_Block(columns, end - begin, entries, place))
    return [block for block in blocks if block.columns.size]


def _operations(columns: Index, equations: int, instants: int) -> int:
    """Operations of a product with a block, and those that its call is worth."""
    return int(columns.size) ** 2 * equations * instants + _CALL


LENGTH = 0.1
_OF_LIMIT = 0.01  # of the largest torque limit, which noise is at most a decade above
_LENGTH_POWER = {"kg m": 1, "kg m^2": 2}

CONVENTIONS = {
    "condition_number": "cond(W), columns of the left-to-right QR base (Gautier 1991), SI, unscaled",
    "condition_number_pivoted": "cond(W), columns of the column-pivoted QR base, SI, unscaled",
    "condition_number_orthonormal": "sigma_1 / sigma_b of the full regressor: cond(W) in an orthonormal base",
    "condition_number_column_normalised": "cond(W), left-to-right base, each column divided by its length",
    "condition_number_length_scaled": f"cond(W), left-to-right base, lengths of inertial parameters in {LENGTH:g} m",
    "condition_number_noise_weighted": "cond(W), left-to-right base, each row divided by its noise",
    "condition_number_frobenius": "|W|_F |W^+|_F, left-to-right base, SI, unscaled",
    "smallest_singular_value": "sigma_b(W), left-to-right base, SI",
    "log_det": "natural log det(W'W), left-to-right base, SI, all rows",
    "log_det_per_sample": "natural log det(W'W / N), left-to-right base, SI, N rows per equation",
    "trace_inverse": "tr((W'W)^-1), left-to-right base, SI",
    "smallest_singular_value_noise_weighted": "sigma_b(W), left-to-right base, each row divided by its noise",
    "log_det_noise_weighted": "natural log det(W'W), left-to-right base, each row divided by its noise",
    "trace_inverse_noise_weighted": "tr((W'W)^-1), left-to-right base, each row divided by its noise",
}


@dataclass(frozen=True)
class PredictedAccuracy:
    """Predicted accuracy of one base parameter.

    Parameters
    ----------
    name, expression, unit : str
        The base column, its parameter in standard parameters, and its unit.
    standard_deviation : float
        Standard deviation of the weighted least-squares estimate for the stated torque noise, independent from instant
        to instant.
    motor_side : MotorSide, optional
        The rotor inertia that a parameter at the drive coordinate stands for.
    """

    beside: ClassVar[Beside] = {"motor_side.standard_deviation": lambda p: p.of_motor}

    name: str
    expression: str
    unit: str
    standard_deviation: float
    motor_side: MotorSide | None = None

    @property
    def of_motor(self) -> float | None:
        """Standard deviation of the motor's own inertia, where the parameter stands for one."""
        return None if self.motor_side is None else self.standard_deviation / self.motor_side.factor


def noise_per_row(noise: tuple[float, ...] | None, model: RegressorModel) -> Array:
    """Standard deviation of the noise of each of a model's equations, shape (r,), in their units."""
    given = noise if noise is not None else (_assumed_noise(model),)
    labels = [name for name, _ in model.row_labels]
    if len(given) not in (1, len(labels)):
        raise InputError(f"noise needs one value, or {len(labels)} for {', '.join(labels)}; given {len(given)}")
    return np.broadcast_to(np.asarray(given, dtype=float), (len(labels),)).copy()


def _assumed_noise(model: RegressorModel) -> float:
    """1 in the unit of the equations; of the torques of a small arm, 0.1, 0.01 ... by its largest torque limit."""
    limits = model.robot.limits.torque
    largest = limits[np.isfinite(limits)].max(initial=0.0)
    if largest == 0.0 or model.torque_equations() is None:
        return 1.0
    return min(1.0, float(f"1e{int(np.ceil(np.log10(_OF_LIMIT * largest) - 1e-9))}"))


def noise_text(noise: tuple[float, ...] | None, model: RegressorModel) -> str:
    """Text of the noise that the predictions assume, such as ``noise of 1 Nm (assumed) in each row``."""
    values = noise_per_row(noise, model)
    shown = f"{values[0]:g}" if np.all(values == values[0]) else f"{values.min():g} to {values.max():g}"
    units = " or ".join(dict.fromkeys(unit for _, unit in model.row_labels))
    return f"noise of {shown} {units}{' (assumed)' if noise is None else ''} in each row"


def _cond(singular_values: Array) -> float:
    return float(singular_values[0] / singular_values[-1]) if singular_values[-1] > 0 else np.inf


def _log_det(singular_values: Array) -> float:
    return float(2 * np.sum(np.log(singular_values))) if singular_values[-1] > 0 else -np.inf


def _trace_inverse(singular_values: Array) -> float:
    return float(np.sum(singular_values**-2.0)) if singular_values[-1] > 0 else np.inf


def _singular_values(W: Array) -> Array:
    return np.asarray(np.linalg.svd(np.linalg.qr(W, mode="r"), compute_uv=False))


@dataclass(frozen=True, eq=False)
class MotionMeasures:
    """What one motion says of the parameters of a target."""

    listed: ClassVar[bool] = True

    criteria: dict[str, float] = field(metadata=OBJECT)  # see `CONVENTIONS`
    predicted: tuple[PredictedAccuracy, ...] = field(metadata=named("predicted.parameters"))
    # (b,) singular values of W in the left-to-right base, largest first
    spectrum: Array = field(metadata=named("base.singular_values"))
    rows: int = field(default=0, metadata=named("base.rows"))  # number of rows of W

    @classmethod
    def of(cls, target: IdentificationTarget, samples: Samples, noise: Array) -> MotionMeasures:
        """Those of samples, for the noise of each equation, shape (r,)."""
        W = target.model.assemble(samples)[:, target.base.index]
        weighted = W / np.tile(noise, W.shape[0] // noise.size)[:, None]
        spectrum = _singular_values(W)
        criteria = _criteria(target, W, spectrum, _singular_values(weighted), W.shape[0] // noise.size)
        return cls(criteria, _predicted(target, weighted), spectrum, int(W.shape[0]))


def _criteria(target: IdentificationTarget, W: Array, plain: Array, weighted: Array, count: int) -> dict[str, float]:
    """All metrics, defined in `CONVENTIONS`, of W and of its singular values, plain and noise-weighted."""
    base, R = target.base, np.asarray(np.linalg.qr(W, mode="r"))
    length = np.array([LENGTH ** _LENGTH_POWER.get(unit, 0) for unit in base.units])
    log_det, trace_inverse = _log_det(plain), _trace_inverse(plain)
    return {
        "condition_number": _cond(plain),
        "condition_number_pivoted": _cond(_singular_values(R @ target.transforms["pivoted"])),
        "condition_number_orthonormal": _cond(_singular_values(R @ target.transforms["orthonormal"])),
        "condition_number_column_normalised": _cond(_singular_values(R / column_lengths(R))),
        "condition_number_length_scaled": _cond(_singular_values(R * length)),
        "condition_number_noise_weighted": _cond(weighted),
        "condition_number_frobenius": float(np.linalg.norm(plain)) * float(np.sqrt(trace_inverse)),
        "smallest_singular_value": float(plain[-1]),
        "log_det": log_det,
        "log_det_per_sample": log_det - base.rank * float(np.log(count)),
        "trace_inverse": trace_inverse,
        "smallest_singular_value_noise_weighted": float(weighted[-1]),
        "log_det_noise_weighted": _log_det(weighted),
        "trace_inverse_noise_weighted": _trace_inverse(weighted),
    }


def _predicted(target: IdentificationTarget, weighted: Array) -> tuple[PredictedAccuracy, ...]:
    """Standard deviation of each base parameter, ``sqrt(diag((W' S^-1 W)^-1))`` with S the noise covariance."""
    base, inverse = target.base, np.linalg.pinv(np.linalg.qr(weighted, mode="r"))
    deviation, sides = np.linalg.norm(inverse, axis=1), motor_sides(target.model, base)
    return tuple(
        PredictedAccuracy(name, expression, unit, float(s), sides.get(name))
        for name, expression, unit, s in zip(base.names, base.expressions, base.units, deviation, strict=True)
    )
