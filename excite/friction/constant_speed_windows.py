"""Settings of a friction fit; time windows of constant speed, which is the path increment [KD96] section 5.2."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from excite.logs.event import LEAST, STEPS
from excite.logs.excitation import noise_deviation, quantum
from excite.tasks.option import check_choices, essential, option
from regressors.arguments import checked
from regressors.quantities import check_options
from regressors.samples import Array

_PLACES = 16  # candidate windows per length of a window
_FEWEST = 8
_SIGMAS = 3.0
_PARTS, _PART = 4, 0.1  # of a window whose speeds are compared: least number, and largest length [s]
_MARGIN = 0.1  # of a window, on each side of it
_SLACK = 0.02  # of a window: how far it may extend beyond its span
_STEPS = 10  # changes of speed that differ by less than a tenth of what is allowed count as equal


@dataclass(frozen=True)
class ConstantWindow:
    """Rows ``start`` to before ``stop`` in which a coordinate moves at one speed."""

    start: int
    stop: int
    speed: float  # path increment over time, ``(z2 - z1) / (t2 - t1)`` with its sign [rad/s or m/s]


@dataclass(frozen=True)
class WindowSearch:
    """Search criteria."""

    length: float  # of a window [s]; the paper has 0.5 s and 0.3 s
    tolerance: float  # allowed change of the speed over the window, relative to the speed
    least_speed: float  # below, the coordinate counts as at rest [rad/s or m/s]
    # windows lie within one of these, begin and end since the first sample [s]; anywhere if not given
    spans: tuple[tuple[float, float], ...] | None = None

    def within(self, begin: float, end: float) -> bool:
        """Whether a window between two times, since the first sample, lies within one of the spans."""
        slack = _SLACK * self.length
        return self.spans is None or any(a - slack <= begin and end <= b + slack for a, b in self.spans)


@dataclass(frozen=True)
class Found:
    """Windows in the order of time, and the number of those that were rejected."""

    windows: tuple[ConstantWindow, ...]
    changing: int  # number of windows, end to end, in the time in between: of changing speed, and at rest
    resting: int
    missing: int = 0  # number of windows of a plan that have a gap


def constant_windows(time: Array, z: Array, others: Array, search: WindowSearch) -> Found:
    """Find windows in which a coordinate moves at constant speed, and no other one accelerates.

    The change of the speed is that of a parabola through the positions, or the difference between a part of the window,
    a quarter or 0.1 s, and the whole if that is larger, less three standard deviations of the effect of position noise.
    Windows do not overlap; where they would, the one with the smaller change is taken.
    """  # time (N,); z (N,); others (N, k)
    columns = np.column_stack([z, others])
    noise = position_noise(time, columns)
    places = (x for x in _places(time, search) if search.within(*(time[[x[0], x[1] - 1]] - time[0])))
    windows = [w for a, b in places if (w := constant_window(time, columns, noise, a, b, search))]
    taken = np.zeros(time.size, dtype=bool)
    chosen: list[ConstantWindow] = []
    for _, window in sorted(windows, key=lambda one: (one[0], one[1].start)):
        if not taken[window.start : window.stop - 1].any():
            taken[window.start : window.stop - 1] = True
            chosen.append(window)
    changing, resting = _left(time, z, taken, search)
    return Found(tuple(sorted(chosen, key=lambda w: w.start)), changing, resting)


def _places(time: Array, search: WindowSearch) -> Iterator[tuple[int, int]]:
    """Rows of candidate windows, none with a gap in it."""
    length = search.length
    step = float(np.median(np.diff(time))) if time.size > 1 else np.inf
    longest = longest_step(time)
    apart = max(length / _PLACES, 0.25 * step)  # closer ones have the same rows
    begins = np.arange(time[0], time[-1] - length + step, apart)
    for begin in np.concatenate([begins, [time[0] + a for a, _ in search.spans or ()]]):
        a = int(np.searchsorted(time, begin - 0.25 * step))
        b = int(np.searchsorted(time, begin + length + 0.25 * step, side="right"))
        enough = b - a >= max(_FEWEST, 0.7 * length / step) and time[b - 1] - time[a] > 0.9 * length
        if enough and unbroken(time[a:b], longest):
            yield a, b


def constant_window(
    time: Array, columns: Array, noise: Array, a: int, b: int, search: WindowSearch, margin: float = _MARGIN
) -> tuple[float, ConstantWindow] | None:
    """A window if its speed is constant, with the change of the speed relative to the allowed one, in steps."""
    # time (N,); columns (N, 1 + k); noise (1 + k,)
    duration = float(time[b - 1] - time[a])
    speed = float(columns[b - 1, 0] - columns[a, 0]) / duration
    wider = _with_margin(time, a, b, margin)
    t, z = time[wider], columns[wider]
    allowed = search.tolerance * abs(speed)
    doubt = _SIGMAS * noise / duration
    if abs(speed) < search.least_speed or doubt[0] > abs(speed):
        return None
    change, factor = _changes(t, z)
    excess = np.maximum(np.abs(change) - factor * doubt, 0.0)
    uneven = _unevenness(t, z[:, 0], noise[0])
    worst = max(float(excess.max()), uneven) / allowed
    return (round(_STEPS * worst) / _STEPS, ConstantWindow(a, b, speed)) if worst <= 1.0 else None


def _with_margin(time: Array, a: int, b: int, part: float) -> slice:
    """Rows of the window and a margin on both sides, so that no end of a ramp is in the window itself."""
    margin = part * float(time[b - 1] - time[a])
    return slice(int(np.searchsorted(time, time[a] - margin)), int(np.searchsorted(time, time[b - 1] + margin)) + 1)


def _changes(time: Array, z: Array) -> tuple[Array, float]:
    """Change of each column's speed over the window, of a parabola, and the factor from noise to such a change."""
    half = 0.5 * (time[-1] - time[0])
    s = (time - time[0]) / half - 1.0
    Q, R = np.linalg.qr(np.column_stack([np.ones_like(s), s, s**2]))
    curvature = Q[:, 2] @ z / R[2, 2]
    return 4.0 * curvature / half, 8.0 / abs(float(R[2, 2]))


def _unevenness(time: Array, z: Array, noise: float) -> float:
    """Largest difference between the speeds of a part of the window and of the whole, beyond the effect of noise."""
    duration = float(time[-1] - time[0])
    count = max(_PARTS, min(int(duration / _PART), (time.size - 1) // 2))
    ends = np.linspace(0, time.size - 1, count + 1).astype(int)
    parts = np.diff(z[ends]) / np.diff(time[ends])
    sigmas = max(_SIGMAS, np.sqrt(2.0 * np.log(20.0 * count)))  # the largest of many deviates further
    doubt = sigmas * np.sqrt(2.0) * noise * count / duration
    return max(float(np.abs(parts - (z[-1] - z[0]) / duration).max()) - float(doubt), 0.0)


def _left(time: Array, z: Array, taken: np.ndarray, search: WindowSearch) -> tuple[int, int]:
    """Number of windows that fit end to end into the time in between: of changing speed, and at rest."""
    changing = resting = 0
    if search.length < float(np.median(np.diff(time))):
        return 0, 0  # no window holds two rows
    for begin in np.arange(time[0], time[-1] - search.length, search.length):
        a, b = (int(np.searchsorted(time, t)) for t in (begin, begin + search.length))
        if b - a < 2 or taken[a:b].mean() > 0.5:
            continue
        if abs(z[b] - z[a]) < search.least_speed * search.length:
            resting += 1
        else:
            changing += 1
    return changing, resting


_CONSECUTIVE = 9  # consecutive samples that noise can be estimated from


def longest_step(time: Array) -> float:
    """Longest step that is not a gap: 3.5 times the median one, or 20 ms if that is more [s]."""  # time (N,)
    return max(STEPS * float(np.median(np.diff(time))), LEAST) if time.size > 1 else np.inf


def unbroken(time: Array, longest: float) -> bool:
    """Whether no two consecutive samples are further apart than `longest`."""  # time (N,)
    return bool(np.diff(time).max(initial=0.0) <= longest)


def position_noise(time: Array, x: Array) -> Array:
    """Standard deviation of the noise of positions, over the stretches between steps longer than 3.5 median ones.

    The motion continues in a gap, so a difference across it is not noise.
    """  # time (N,); x (N, n)
    step = np.diff(time)
    broken = np.flatnonzero(step > STEPS * np.median(step)) + 1
    parts = [x[a:b] for a, b in pairwise([0, *broken.tolist(), len(x)]) if b - a >= _CONSECUTIVE]
    if not broken.size or not parts:
        return noise_deviation(x)
    power = np.array([len(part) * noise_deviation(part) ** 2 for part in parts]).sum(axis=0)
    return np.asarray(np.maximum(np.sqrt(power / sum(map(len, parts))), quantum(x) / np.sqrt(12)))


WINDOW = 0.3  # [s], where there is no plan; that of [KD96] for arm and forearm


@checked
@dataclass(frozen=True)
class FitSettings:
    """Settings of a friction fit.

    Parameters
    ----------
    window : float, optional
        Length of the windows [s]; the plan's whole windows, or 0.3 s without a plan, if not given.
    tolerance : float
        Allowed change of speed over a window, relative to the speed.
    speed : {"auto", "constant", "averaged"}
        Whether windows of changing speed count with their mean speed [KD96] section 4; needs a model, which subtracts
        what acceleration takes. auto takes them where constant ones do not determine the change with speed, and
        the drive moves alone.
    gravity : {"auto", "model", "symmetric", "none"}
        auto subtracts it by the model; where masses are not known it trusts a plan that cancels it, or a structure in
        which it never loads the drive.
    model : {"auto", "coulomb-viscous", "stribeck", "table"}
    exponent : float, optional
        Of the Stribeck term; chosen between 1 and 2 if not given.
    criterion : {"bic", "aicc"}
    temperature : {"auto", "linear", "none"}
        Whether friction is linear in temperature; auto where the log's temperature changes by 2 K or more.
    load : {"auto", "linear", "none"}
        Whether friction grows with the torque that the drive carries; auto where that differs between the windows.
    stiction : {"fit", "report"}
        Whether break-away torques are points of the curve at speed zero, or only reported.
    """

    window: float | None = option(
        None, "number", "Length of a window.", metavar="S", unset="the plan's whole windows; 0.3 without"
    )
    tolerance: float = option(0.03, "number", "Change of speed allowed over a window.", metavar="X")
    speed: str = option(
        "auto",
        "name",
        "averaged: also use windows of changing speed, with a model that subtracts the torque of acceleration; auto: "
        "only if constant speeds are too few and the drive moves alone.",
        choices=("auto", "constant", "averaged"),
    )
    gravity: str = essential(
        "auto", "name", "How gravity is removed; see below.", choices=("auto", "model", "symmetric", "none")
    )
    model: str = essential(
        "auto",
        "name",
        "Equation of the curve; auto: the one with the smallest criterion.",
        choices=("auto", "coulomb-viscous", "stribeck", "table"),
    )
    exponent: float | None = option(
        None, "number", "Exponent of the Stribeck term.", metavar="D", unset="1 or 2, whichever fits better"
    )
    criterion: str = option("bic", "name", "Information criterion that chooses the equation.", choices=("bic", "aicc"))
    temperature: str = essential(
        "auto", "name", "Whether friction is linear in the log's temperature.", choices=("auto", "linear", "none")
    )
    load: str = essential(
        "auto",
        "name",
        "Whether friction grows with the torque that the drive carries.",
        choices=("auto", "linear", "none"),
    )
    stiction: str = option(
        "fit",
        "name",
        "fit: torques at which a drive broke away are points of its curve at speed zero.",
        choices=("fit", "report"),
    )

    def __post_init__(self) -> None:
        check_choices(self)
        check_options(self, ("window", "tolerance", "exponent"))

    @property
    def length(self) -> float:
        """Length of the windows that are searched for [s]."""
        return WINDOW if self.window is None else self.window
