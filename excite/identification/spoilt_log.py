"""Faults of a log that explain why the model does not: what each does to torques or positions, and what mends it.

Every fault is undone and the model fitted again, by weighted least squares at some instants of the log. With
``X_j = [W_j, Y]``, the rows of equation j beside all torque columns, a fault of the torques changes only which
combination of columns of Y is the right-hand side, so that the fit needs ``X_j' X_j`` alone; a fault of the positions
changes W. Friction, rotors and other parameters of one sign keep it, and the described robot is believed a little, so
that a fault that the parameters of one joint could take up shows all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
import scipy.optimize

from excite.identification.impossible_parameters import signs_of_bodies
from excite.identification.large_residual import Doubt
from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from excite.logs.event import within
from regressors.models.nominal import parameter_values, standard_values
from regressors.robot.columns import BODY_KINDS, COULOMB, OFFSET, ROTOR
from regressors.robot.plausibility import implausible_inertias
from regressors.samples import Array, Index, Samples

INSTANTS = 800  # more name no other fault
_BELIEF = (
    0.01  # weight of the described torques beside the measured ones: a departure of 100 % counts as an error of 10 %
)
_ROUNDS = 4  # of weights by the residuals
_LEAST_ERROR = 2e-3  # of the torques: a smaller one is no further evidence
_RIDGE = 1e-9  # of the scaled normal equations
GAIN = 0.7  # in the logarithm of the errors of all joints together that a fault must win on none
MARGIN = 0.3  # and on the next fault
_ONE_JOINT = 1.5  # factor by which the error of one joint at least must fall
_NOISY, _SMALL = 2.5, 0.01  # an error of one joint of more than so many times the noise, and of the torque, is searched
_ODD_GAIN = 1.25  # a gain nearer to one is not a fault
_DELAYS = np.array([-0.03, -0.01, 0.01, 0.03, 0.06, 0.1])  # [s]
_ZEROS = np.deg2rad([-8.0, 8.0, -90.0, 90.0, 180.0])


@dataclass(frozen=True)
class Fault:
    """A fault of a log, which is undone by ``torques`` or by ``positions``."""

    kind: str
    joints: tuple[str, ...]  # whose columns are concerned
    what: str  # the sentence
    cure: str
    torques: Array | None = None  # (n, n): right-hand sides ``torques @ y``
    late: Index | None = None  # (n,) steps
    positions: tuple[Array, Array] | None = None  # ``A (n, n), b (n,)``: true positions ``A q + b``

    @property
    def label(self) -> tuple[str, tuple[str, ...]]:
        """What tells it from other faults."""
        return self.kind, self.joints


@dataclass(frozen=True, eq=False)
class Fit:
    """How well the equations hold with a fault undone."""

    fault: Fault
    errors: Array  # (n,) of each equation, over its torque

    @property
    def size(self) -> float:
        """Sum of the logarithms of the errors, which is the likelihood with the noise of each equation unknown."""
        return float(np.sum(np.log(np.maximum(self.errors, _LEAST_ERROR))))

    @property
    def percent(self) -> str:
        """Root mean square of the errors over the joints."""
        return f"{100 * np.sqrt(np.mean(self.errors**2)):.2g} %"


NO_FAULT = Fault("none", (), "", "")


def spoilt_log(target: IdentificationTarget, parts: tuple[PreparedLog, ...], *, doubtful: bool) -> Doubt | None:
    """Doubt that names the fault of a log, if one explains clearly more than none and than any other.

    All faults are tried where the result is doubtful already or the residual is more than the noise.
    """
    equations = target.model.torque_equations()
    if equations is None or not equations.every_joint or not target.motion.complete:
        return None
    for fault in obvious_faults(target.robot.joint_names, parts):
        return Doubt(f"{_SPOILT} {fault.what}", "no robot measures such torques", fault.cure)
    search = Search.of(target, parts)
    none = search.plain.fit(NO_FAULT)
    if not doubtful and not np.any(none.errors > np.maximum(_NOISY * search.noise, _SMALL)):
        return None
    return named(none, search.fits())


def named(none: Fit, fits: list[Fit]) -> Doubt | None:
    """Doubt of the best fault, or of the best two if they concern the same joint and explain the same."""
    ranked = sorted(fits, key=lambda fit: fit.size)
    best = ranked[0]
    close = [fit for fit in ranked if fit.size - best.size <= MARGIN and fit.fault.label != best.fault.label]
    alike = [best.fault, *(fit.fault for fit in close if _alike(fit.fault, best.fault))]
    falls = float(np.max(none.errors / np.maximum(best.errors, _LEAST_ERROR)))
    if not (none.size - best.size > GAIN and falls > _ONE_JOINT) or not len(close) < len(alike) <= 2:
        return None
    return Doubt(
        f"{_SPOILT} {', or '.join(fault.what for fault in alike)}",
        f"without this fault the error of the joints is {best.percent} instead of {none.percent}",
        ", or ".join(fault.cure for fault in alike),
    )


def _alike(one: Fault, other: Fault) -> bool:
    """Whether two faults are of one joint, or of the gains of two, of which a log may show the ratio only."""
    return one.joints == other.joints or one.kind == other.kind == "torque gain"


_SPOILT = "the log is spoilt:"


# ---------------------------------------------------------------- the fit


@dataclass(frozen=True, eq=False)
class Search:
    """Faults tried on some instants of the logs."""

    target: IdentificationTarget
    samples: Samples  # (N,)
    step: float  # [s]
    # those measured some steps later than the instants, (n,) -> (N, n): whole steps, since noise between two measured
    # values is less than in each
    torques: Callable[[Index], Array]
    noise: Array  # (n,) white noise of the torques, over them
    described: Array | None  # (b,) base parameters of the description
    signs: Array  # (b,) of the base parameters of real bodies and drives

    @staticmethod
    def of(target: IdentificationTarget, parts: tuple[PreparedLog, ...]) -> Search:
        """The search of some logs, at instants evenly spread over the rows that make equations."""
        chosen = [_chosen(part, INSTANTS // len(parts)) for part in parts]
        samples = [part.samples.rows(rows) for part, rows in zip(parts, chosen, strict=True)]
        joined = Samples(
            *(np.concatenate([getattr(s, name) for s in samples]) for name in ("time", "q", "dq", "ddq", "dddq"))
        )
        uniform = [_on_grid(part) for part in parts]

        def torques(late: Index) -> Array:
            pairs = zip(uniform, chosen, strict=True)
            return np.concatenate([_later(y, rows, late) for y, rows in pairs])

        described = None if implausible_inertias(target.robot) else _described(target)
        step = float(np.median(np.diff(parts[0].samples.time)))
        return Search(target, joined, step, torques, _noise(uniform), described, signs_of_bodies(target.base))

    @cached_property
    def plain(self) -> Equations:
        """The equations as the log has them."""
        return self._equations(self.samples, self.torques(np.zeros(self.samples.q.shape[1], dtype=int)))

    def fits(self) -> list[Fit]:
        """Fits with each fault undone."""
        names = self.target.robot.joint_names
        fits = [self.plain.fit(fault) for fault in torque_faults(names)]
        fits += [self._fit(fault) for fault in position_faults(names)]
        fits += [fit for j in range(len(names)) if (fit := self._with_gain(j)) is not None]
        return [*fits, *self._delayed(), *self._zeros()]

    def _equations(self, samples: Samples, measured: Array) -> Equations:
        return Equations.of(self, samples, measured)

    def _fit(self, fault: Fault) -> Fit:
        """Fit with a fault of positions or of times undone."""
        samples, n = self.samples, len(self.target.robot.joint_names)
        if fault.positions is not None:
            A, b = fault.positions
            q, dq, ddq = samples.q @ A.T + b, samples.dq @ A.T, samples.ddq @ A.T
            samples = replace(samples, q=q, dq=dq, ddq=ddq)
        return self._equations(samples, self.torques(np.zeros(n, dtype=int) if fault.late is None else fault.late)).fit(
            fault
        )

    def _with_gain(self, j: int) -> Fit | None:
        """The best gain of one joint."""
        names = self.target.robot.joint_names

        def fit(log_gain: float) -> Fit:
            return self.plain.fit(gain_fault(names, j, float(np.exp(log_gain))))

        trials = np.log([1e-3, 1e-2, 0.05, 0.1, 0.2, 0.35, 0.6, 0.8, 1.25, 1.6, 2.8, 5.0, 10.0, 20.0, 100.0, 1e3])
        best = trials[int(np.argmin([fit(x).size for x in trials]))]
        refined = scipy.optimize.minimize_scalar(
            lambda x: fit(x).size, bounds=(best - 0.6, best + 0.6), method="bounded", options={"xatol": 0.01}
        )
        gain = float(np.exp(refined.x))
        if 1 / _ODD_GAIN < gain < _ODD_GAIN:
            return None
        return self.plain.fit(gain_fault(names, j, gain))

    def _delayed(self) -> Iterator[Fit]:
        """All torques late, and those of one joint."""
        names, n = self.target.robot.joint_names, len(self.target.robot.joint_names)
        grid = np.unique(np.round(_DELAYS / self.step).astype(int))
        for which in (np.ones(n, dtype=int), *np.eye(n, dtype=int)):
            sizes = {0: np.inf}

            def size(steps: int, which: Index = which, sizes: dict[int, float] = sizes) -> float:
                if steps not in sizes:
                    sizes[steps] = self._fit(delay_fault(names, steps * which, self.step)).size
                return sizes[steps]

            best, stride = min(grid.tolist(), key=size), max(1, round(0.01 / self.step))
            while stride:
                best = min((best - stride, best, best + stride), key=size)
                stride //= 2
            yield self._fit(delay_fault(names, best * which, self.step))

    def _zeros(self) -> Iterator[Fit]:
        """The zero of one joint."""
        names = self.target.robot.joint_names
        for j in range(len(names)):

            def fit(zero: float, j: int = j) -> Fit:
                return self._fit(zero_fault(names, j, zero))

            best = _ZEROS[int(np.argmin([fit(z).size for z in _ZEROS]))]
            refined = scipy.optimize.minimize_scalar(
                lambda z, fit=fit: fit(z).size,
                bounds=(best - 0.14, best + 0.14),
                method="bounded",
                options={"maxiter": 7},
            )
            yield fit(float(refined.x))


def _chosen(part: PreparedLog, most: int) -> Index:
    """Rows of some instants that make equations."""
    kept = np.flatnonzero(~within(part.samples.time, part.left_out))
    kept = kept if kept.size else np.arange(part.samples.time.size)
    return np.asarray(kept[np.unique(np.linspace(0, kept.size - 1, most).astype(int))])


def _on_grid(part: PreparedLog) -> Array:
    """Torques as recorded, at the instants of the motion, shape (N, n)."""
    assert part.log.effort is not None
    return np.column_stack([np.interp(part.samples.time, part.log.time, y) for y in part.log.effort.T])


def _described(target: IdentificationTarget) -> Array | None:
    """Base parameters of the described robot, unknown friction and rotors as zero; None where a body is unknown."""
    drives = {c.name: 0.0 for c in target.model.standard_columns if c.kind not in BODY_KINDS}
    values = parameter_values(target.model, target.base, drives | standard_values(target.robot))
    return values if np.isfinite(values).all() else None


def _noise(logs: list[Array]) -> Array:
    """White noise of the torques by their third differences, jumps of friction apart, over their size, shape (n,)."""
    third = np.concatenate([np.diff(y, 3, axis=0) for y in logs])
    size = np.sqrt(np.mean(np.concatenate(logs) ** 2, axis=0))
    return np.asarray(1.4826 * np.median(np.abs(third), axis=0) / np.sqrt(20) / np.where(size > 0, size, 1.0))


def _later(y: Array, rows: Index, late: Index) -> Array:
    """Each column some rows later, shape (k, n)."""
    places = np.clip(rows[:, None] + late, 0, len(y) - 1)
    return np.asarray(np.take_along_axis(y, places, axis=0))


@dataclass(frozen=True, eq=False)
class Equations:
    """Products of the columns of each equation, ``[W, Y, described torque]``."""

    products: Array  # (n, k, k) with k = b + n + 1
    signs: Array  # (b,)
    believed: Array  # (b,) 1 for the parameters that the description states

    @staticmethod
    def of(search: Search, samples: Samples, measured: Array) -> Equations:
        """The equations along a motion."""
        base, model = search.target.base, search.target.model
        n = measured.shape[1]
        W = model.selected(samples, base.index).reshape(-1, n, base.rank)
        inertial = np.array([base.columns[j].group == "inertial" for j in base.index])
        added, added_signs = _added_columns({base.columns[j].kind for j in base.index}, samples)
        described = (
            np.zeros(W.shape[:2]) if search.described is None else W[:, :, inertial] @ search.described[inertial]
        )
        believed = inertial.astype(float) * (search.described is not None)
        Y = np.broadcast_to(measured[:, None, :], (len(measured), n, n))
        X = np.concatenate([W, added, Y, described[:, :, None]], axis=2)
        products = np.array([X[:, j].T @ X[:, j] for j in range(n)])
        return Equations(
            products,
            np.concatenate([search.signs, added_signs]),
            np.concatenate([believed, np.zeros(added.shape[2])]),
        )

    def fit(self, fault: Fault) -> Fit:
        """Fit by least squares that weights each equation by its own residual."""
        n = len(self.products)
        b = self.signs.size
        T = np.eye(n) if fault.torques is None else fault.torques
        WW, WY, YY = self.products[:, :b, :b], self.products[:, :b, b : b + n], self.products[:, b : b + n, b : b + n]
        Wd, dd = self.products[:, :b, -1], self.products[:, -1, -1]
        right, size = np.einsum("jbn,jn->jb", WY, T), np.einsum("jn,jnm,jm->j", T, YY, T)
        size = np.where(size > 0, size, 1.0)
        belief = _BELIEF * self.believed
        normal = WW + np.sqrt(belief)[:, None] * WW * np.sqrt(belief)
        right_all = right + belief * Wd
        square = size
        for _ in range(_ROUNDS):
            weight = 1 / np.maximum(square, _LEAST_ERROR**2 * size)
            x = _of_one_sign(np.tensordot(weight, normal, 1), weight @ right_all, self.signs)
            square = np.einsum("b,jbc,c->j", x, normal, x) - 2 * right_all @ x + size
            square = np.maximum(square + _BELIEF * dd * np.any(self.believed), 0.0)
        return Fit(fault, np.sqrt(square / size))


def _of_one_sign(A: Array, right: Array, signs: Array) -> Array:
    """Solution of normal equations; parameters whose sign is wrong are taken out one set after the other."""
    scale = np.sqrt(np.diag(A))
    free = scale > 1e-9 * scale.max(initial=0.0)
    x = np.zeros(right.size)
    for _ in range(8):
        k = np.flatnonzero(free)
        M = A[np.ix_(k, k)] / np.outer(scale[k], scale[k])
        x[:] = 0.0
        x[k] = np.linalg.solve(M + _RIDGE * np.eye(k.size), right[k] / scale[k]) / scale[k]
        wrong = free & (signs * x < 0)
        if not wrong.any():
            break
        free &= ~wrong
    return x


def _added_columns(kinds: set[str], samples: Samples) -> tuple[Array, Array]:
    """What drives have and a model may lack, in the equation of each joint, shape (N, n, k), with the signs."""
    n = samples.q.shape[1]
    parts: list[Array] = []
    signs: list[float] = []
    if COULOMB not in kinds:
        parts, signs = [*parts, np.sign(samples.dq), samples.dq], [*signs, *[1.0] * (2 * n)]
    if ROTOR not in kinds:
        parts, signs = [*parts, samples.ddq], [*signs, *[1.0] * n]
    if OFFSET not in kinds:
        parts, signs = [*parts, np.ones_like(samples.q)], [*signs, *[0.0] * n]
    columns = [part[:, :, None] * np.eye(n) for part in parts]
    return np.concatenate([*columns, np.zeros((len(samples.q), n, 0))], axis=2), np.array(signs)


# ---------------------------------------------------------------- the library


def obvious_faults(names: tuple[str, ...], parts: tuple[PreparedLog, ...]) -> Iterator[Fault]:
    """Faults that the torques show without a model: magnitudes."""
    for part in parts:
        y, dq = part.log.effort, part.samples.dq
        if y is None:
            continue
        both_ways = np.minimum(np.mean(dq > 0, axis=0), np.mean(dq < 0, axis=0)) > 0.2
        if np.all(y >= 0) and np.any(y > 0) and both_ways.all() and len(names) > 1:
            yield Fault(
                "magnitudes",
                names,
                "the torques of all joints are never negative although all of them move both ways: they are magnitudes",
                "record torques with their signs, or map the columns of the signed currents (`current`)",
            )


def torque_faults(names: tuple[str, ...]) -> Iterator[Fault]:
    """Faults of torque columns that have no value of their own."""
    n = len(names)
    for a, b in combinations(range(n), 2):
        yield Fault(
            "torques swapped",
            (names[a], names[b]),
            f"the torque columns of {names[a]} and {names[b]} are exchanged",
            f"exchange these two `columns` of the torques in the mapping{_order(names, _exchanged(n, a, b))}",
            torques=np.eye(n)[_exchanged(n, a, b)],
        )
    for shift in (1, -1) if n > 2 else ():
        order = [(k + shift) % n for k in range(n)]
        yield Fault(
            "torques shifted",
            names,
            f"the torque columns are shifted: that of {names[0]} is what stands for {names[shift % n]}",
            f"shift the `columns` of the torques in the mapping by one{_order(names, order)}",
            torques=np.eye(n)[order],
        )
    for j, name in enumerate(names):
        yield Fault(
            "torque sign",
            (name,),
            f"the torques of {name} have the opposite sign",
            f"use `{_each('sign', n, j, '-1')}` for the torques in the mapping",
            torques=np.diag(np.where(np.arange(n) == j, -1.0, 1.0)),
        )


def position_faults(names: tuple[str, ...]) -> Iterator[Fault]:
    """Faults of position columns that have no value of their own."""
    n = len(names)
    for a, b in combinations(range(n), 2):
        order = _exchanged(n, a, b)
        yield Fault(
            "positions swapped",
            (names[a], names[b]),
            f"the position columns of {names[a]} and {names[b]} are exchanged",
            f"exchange these two `columns` of the positions in the mapping{_order(names, order)}",
            positions=(np.eye(n)[order], np.zeros(n)),
        )
    for j, name in enumerate(names):
        yield Fault(
            "position sign",
            (name,),
            f"the positions of {name} have the opposite sign",
            f"use `{_each('sign', n, j, '-1')}` for the positions and velocities in the mapping",
            positions=(np.diag(np.where(np.arange(n) == j, -1.0, 1.0)), np.zeros(n)),
        )


_UNITS = {1e3: ("kNm", "Nm"), 1e-3: ("mNm", "Nm")}  # of factors: what was recorded, and taken for


def gain_fault(names: tuple[str, ...], j: int, gain: float) -> Fault:
    """True torques of a joint are ``gain`` times those in the log."""
    n = len(names)
    torques = np.diag(np.where(np.arange(n) == j, gain, 1.0))
    for factor, (unit, taken) in _UNITS.items():
        if abs(np.log(gain / factor)) < np.log(_ODD_GAIN):
            what = f"the torques of {names[j]} are in {unit}, not in {taken}"
            cure = f"use `{_each('unit', n, j, unit, taken)}` for the torques in the mapping"
            return Fault("torque gain", (names[j],), what, cure, torques)
    return Fault(
        "torque gain",
        (names[j],),
        f"the torques of {names[j]} are {1 / gain:.2g} times what the other joints say of it",
        f"check its torque constant and ratio, or use `{_each('gain', n, j, f'{gain:.3g}')}` for the torques in "
        "the mapping, or that factor of the gain that is there",
        torques,
    )


def delay_fault(names: tuple[str, ...], late: Index, step: float) -> Fault:
    """Torques that were recorded later than the positions."""
    concerned = tuple(name for name, d in zip(names, late, strict=True) if d)
    delay = step * float(late[np.argmax(np.abs(late))])
    how = "later" if delay > 0 else "earlier"
    if len(concerned) == len(names):
        return Fault(
            "late",
            names,
            f"all torques are {1e3 * abs(delay):.3g} ms {how} than the positions",
            f"use `delay={delay:.3g}`",
            late=late,
        )
    return Fault(
        "channel late",
        concerned,
        f"the torques of {', '.join(concerned)} are {1e3 * abs(delay):.3g} ms {how} than those of the other joints",
        "shift its column in time before you give the log: a mapping has no delay of one joint",
        late=late,
    )


def zero_fault(names: tuple[str, ...], j: int, zero: float) -> Fault:
    """True positions of a joint are ``zero`` more than those in the log."""
    n, degrees = len(names), float(np.rad2deg(zero))
    return Fault(
        "zero",
        (names[j],),
        f"the zero of {names[j]} is off by {degrees:.3g} degrees",
        f"use `{_each('offset', n, j, f'{-degrees:.3g}', '0')}` for the positions in the mapping where their "
        f"unit is deg, or {-zero:.3g} in rad",
        positions=(np.eye(n), np.where(np.arange(n) == j, zero, 0.0)),
    )


def _exchanged(n: int, a: int, b: int) -> list[int]:
    order = list(range(n))
    order[a], order[b] = b, a
    return order


def _each(key: str, n: int, j: int, value: str, other: str = "1") -> str:
    """Line of a mapping with a value for each joint."""
    return f"{key}: [{', '.join(value if k == j else other for k in range(n))}]"


def _order(names: tuple[str, ...], order: list[int]) -> str:
    return f": the columns that now stand for {', '.join(names[k] for k in order)}, in this order"
