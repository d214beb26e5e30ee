"""What a model does not explain: stretches of a log, or all of it; and reasons to doubt a result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy

from excite.identification.observations import Observations, rows_of_groups
from excite.identification.preparation import prepare
from excite.identification.recipe import ALL, Recipe
from excite.information.target import IdentificationTarget
from excite.logs.event import within
from excite.logs.excitation import runs
from excite.logs.log import Log
from regressors.errors import percent
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


@dataclass(frozen=True)
class Doubt:
    """A reason to doubt a result."""

    what: str  # what cannot be right, with its numbers
    cause: str  # why, as far as the data show it
    cure: str  # what to do, with options in backticks
    # which question it answers with no; a warning about inertia leaves that of possible bodies open
    about: Literal["bodies", "torques", "limbs", "inertia"] = "bodies"

    @property
    def text(self) -> str:
        """One sentence."""
        return f"{self.what}: {self.cause}; {self.cure}"


_MOST_LEFT_OUT = 0.05  # of the exciting rows


def left_out_rows(source: str, share: float) -> Doubt | None:
    """Warning where more than 5 % of the exciting rows are left out."""
    if not share > _MOST_LEFT_OUT:
        return None
    return Doubt(
        f"{percent(share)} of the exciting rows of {source} are left out, more than {100 * _MOST_LEFT_OUT:g} %",
        "the motion that remains is no longer the one that was played",
        "see the notes on this log for which rows and why; record it again without these events, or give the stretch "
        "that is sound (`rows`)",
    )


LARGEST = 0.30  # residual over measurement


def large_residual(relative: float, noise: float, cause: tuple[str, str]) -> Doubt | None:
    """Doubt where the residual, less the noise of the measurement, is above 30 % of what was measured."""
    unexplained = float(np.sqrt(max(relative**2 - noise**2, 0.0)))
    if not unexplained > LARGEST:
        return None
    of_noise = f", of which {percent(noise)} may be noise of the measurement" if noise > 0.1 * relative else ""
    what = f"the residual is {percent(relative, 3)} of what was measured{of_noise}, more than {100 * LARGEST:g} %"
    return Doubt(what, *cause, about="torques")


UNEXPLAINED = (
    "no single cause explains it",
    "check in the mapping the units, the signs and the order of the joints, that positions and torques belong to "
    "the same instants, and lower the cutoff (`cutoff`)",
)
_TERMS = {  # and the option that identifies it
    "friction": ("friction", "friction=True"),
    "rotor": ("an inertia of its own", "joint_rotors=True"),
    "offset": ("a constant torque", "offset=True"),
}


def cause_of_residual(
    shares: dict[str, float], per_joint: Array, names: list[str], without_curve: list[str]
) -> tuple[str, str]:
    """The term that explains more than half of a residual, of `missing_terms`, as cause and cure.

    ``without_curve`` are the drives that move and have no friction curve, where friction is known.
    """
    term = max(shares, key=shares.__getitem__)
    if not shares[term] > MOST:
        return UNEXPLAINED
    share = f"{100 * shares[term]:.0f} % of it (squared)"
    if term == "friction" and without_curve:
        return (
            f"there is no friction curve for {', '.join(without_curve)}, so that it counts as zero and "
            f"friction explains {share}",
            "fit curves for these drives too, or identify friction with the other parameters (`friction=True` "
            "without `friction_curves`)",
        )
    what, option = _TERMS[term]
    largest = [name for name, part in zip(names, per_joint, strict=True) if part > 0.2 * per_joint.max()]
    return (f"{what} of {', '.join(largest)} explains {share} and is not in the model", f"identify it too (`{option}`)")


MOST = 0.5  # share of the squared residual that makes a cause the cause
_FEWEST = 50  # rows of a spectrum
_STRETCH = 2**16  # rows of a long one


def noisy_derivatives(observations: Observations, predicted: Array, above: float) -> tuple[str, str] | None:
    """Cause and cure where most of the squared residual is power above the motion's frequencies, in predictions alone.

    It comes from differentiated positions. What the measurements have too is noise of theirs, or jumps of friction,
    which the predictions share.
    """  # predicted (m,); above [Hz]
    residual = observations.y - predicted
    fast, total = 0.0, float(np.sum(residual**2))
    for _, rows in rows_of_groups(observations.group):
        time = observations.time[rows]
        if time.size < _FEWEST or not time[-1] > time[0]:
            continue
        rate = (time.size - 1) / float(time[-1] - time[0])
        in_residual, in_measured = (_fast(x[rows], rate, above) for x in (residual, observations.y))
        fast += time.size * max(in_residual - in_measured, 0.0)
    if not (total > 0 and fast / total > MOST):
        return None
    return (
        f"the torques that the model predicts are mostly noise above {above:.3g} Hz, where the motion has "
        "no content: the positions are noisy, or their time stamps are",
        f"filter the positions with a lower cutoff, such as `cutoff={above:.2g}`",
    )


def _fast(x: Array, rate: float, above: float) -> float:
    """Mean square above a frequency; of long signals the mean over their stretches [Welch 1967]."""
    frequency, power = scipy.signal.welch(x, rate, "hann", nperseg=min(x.size, _STRETCH))
    return float(np.sum(power[frequency > above]) * frequency[1])


def missing_terms(residual: Array, speed: Array, acceleration: Array) -> tuple[dict[str, float], Array]:
    """What friction and rotors of its own joint explain of each joint's residual."""
    # residual, speed, acceleration (N, r); result (r,)
    total = float(np.sum(residual**2))
    one = np.ones(len(residual))
    explained: dict[str, float] = dict.fromkeys(("friction", "rotor", "offset"), 0.0)
    per_joint = np.zeros(residual.shape[1])
    for j in range(residual.shape[1]):
        e, v, a = residual[:, j], speed[:, j], acceleration[:, j]
        terms = {"friction": [np.sign(v), v], "rotor": [a], "offset": [one]}
        for name, columns in terms.items():
            explained[name] += _explained(e, columns) / total
        per_joint[j] = _explained(e, [column for columns in terms.values() for column in columns]) / total
    return explained, per_joint


def _explained(e: Array, columns: list[Array]) -> float:
    A = np.column_stack(columns)
    return float(np.sum((A @ np.linalg.lstsq(A, e, rcond=None)[0]) ** 2))


_WINDOW = 0.15  # [s] that residuals are averaged over
_LEAST_UNIT = 1e-3  # of the torque: residuals of a log without noise are rounding
_INSTANTS = 2000
_ROUNDS, _TRIMMED = 6, 3.0  # of the fit without residuals of more than so many times the usual
_RARE, _LONG, _LARGE = 3, 0.15, 4.0  # stretches at most, share of the log, and their size over that of the next


def with_external_forces(robot: Robot, target: IdentificationTarget, log: Log, recipe: Recipe) -> Log:
    """The log with the stretches in which something else pushed the robot, as where it was touched, which are left out.

    What friction does, a fit of the log itself explains, or leaves over again and again. So up to three stretches count
    whose residuals, in units of their usual size, are more than four times those of any other.
    """
    if target.model.channel != "effort" or recipe.rows == ALL:
        return log
    part = prepare(log, robot, target, recipe)
    some = np.flatnonzero(~within(part.samples.time, part.left_out))
    if not some.size:
        return log
    some = some[np.unique(np.linspace(0, some.size - 1, _INSTANTS).astype(int))]
    size, time = _unexplained(target, part.samples.rows(some), part.measured[some]), part.samples.time[some]
    usual = _TRIMMED * max(1.0, float(np.median(size)))
    stretches = sorted(runs(size > usual), key=lambda ends: -size[slice(*ends)].max())
    peaks = [float(size[slice(*ends)].max()) for ends in stretches] + [usual]
    count = max((k for k in range(1, min(_RARE, len(stretches)) + 1) if peaks[k - 1] > _LARGE * peaks[k]), default=0)
    spans = tuple((float(time[a]) - _WINDOW, float(time[b - 1]) + _WINDOW) for a, b in stretches[:count])
    return replace(log, external_forces=spans) if 0 < within(log.time, spans).mean() < _LONG else log


def _unexplained(target: IdentificationTarget, motion: Samples, measured: Array) -> Array:
    """Residuals of all joints in units of their medians, averaged over a time, shape (N,); large ones do not count."""
    measured = target.model.right_side(motion, measured).reshape(motion.time.size, -1)
    W = target.model.selected(motion, target.base.index).reshape(*measured.shape, -1)
    W /= np.maximum(np.linalg.norm(W, axis=(0, 1)), 1e-300)
    count = max(1, round(_WINDOW / float(np.median(np.diff(motion.time)))))
    scale, kept = np.std(measured, axis=0), np.ones(len(measured), dtype=bool)
    for _ in range(_ROUNDS):
        scale = np.where(scale > 0, scale, 1.0)
        A, b = W[kept] / scale[:, None], measured[kept] / scale
        residual = measured - W @ np.linalg.lstsq(A.reshape(-1, W.shape[2]), b.ravel(), rcond=1e-9)[0]
        scale = np.sqrt(np.mean(residual[kept] ** 2, axis=0))
        middle = np.maximum(np.median(np.abs(residual), axis=0), _LEAST_UNIT * np.std(measured, axis=0))
        squares = np.mean((residual / np.where(middle > 0, middle, 1.0)) ** 2, axis=1)
        size = np.sqrt(np.maximum(scipy.ndimage.uniform_filter1d(squares, count, mode="nearest"), 0.0))
        kept = size <= _TRIMMED * max(1.0, float(np.median(size)))
    return np.asarray(size)
