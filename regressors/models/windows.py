"""Models over time windows: differences of states and integrals of densities, without accelerations.

One row of W belongs to a window (t_1, t_2): ``[state]_{t_1}^{t_2} + int_{t_1}^{t_2} density dt``, with short windows
(t_k, t_k + dt) or long ones (t_0, t_k) [KD96] section 2.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import casadi as ca
import numpy as np
import scipy
from numpy.typing import NDArray

from regressors.arguments import checked
from regressors.errors import InputError, check_names
from regressors.models.model import Combination, RegressorModel
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Index, Samples

Mask = NDArray[np.bool_]

WINDOWS = ("short", "long")
SHORT = 0.005


@checked
@dataclass(frozen=True)
class Window:
    """Time windows that form the rows of W."""

    kind: Literal["short", "long"] = "short"  # (t_k, t_k + length), or (t_0, t_k) from the first sample on
    length: float = SHORT  # of a short window [s]; 5 ms in [KD96]
    # time from the start of a short window to that of the next [s]; the length if not given, so that they adjoin
    step: float | None = None

    def __post_init__(self) -> None:
        check_names("window", [str(self.kind)], WINDOWS)
        for what in ("length", "step"):
            value = getattr(self, what)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(f"window {what} must be a positive number of seconds, given {value}")

    def fitted(self, spacing: float) -> Window:
        """These windows with short ones rounded to a whole number of samples; long ones as they are."""  # spacing [s]
        if self.kind == "long":
            return self
        length = max(1, round(self.length / spacing)) * spacing
        return Window(self.kind, length, None if self.step is None else max(1, round(self.step / spacing)) * spacing)

    def ends(self, time: Array) -> tuple[Index, Index]:
        """First and last sample of every window of uniform times [s]; `InputError` where windows do not fit these."""
        if self.kind == "long":
            last = np.arange(1, time.size)
            return np.zeros_like(last), last
        if time.size < 2:
            raise InputError(f"a window needs two samples or more, given {time.size}")
        spacing = float(time[-1] - time[0]) / max(time.size - 1, 1)
        length = _samples(self.length, spacing, "length")
        step = length if self.step is None else _samples(self.step, spacing, "step")
        if length >= time.size:
            raise InputError(f"a window of {self.length:g} s is longer than the motion of {time[-1] - time[0]:g} s")
        first = np.arange(0, time.size - length, step)
        return first, first + length


def _samples(seconds: float, spacing: float, what: str) -> int:
    count = seconds / spacing
    if count < 1 - 1e-6:
        raise InputError(f"window {what} {seconds:g} s is shorter than the sample time {spacing:g} s")
    if abs(count - round(count)) > 1e-6 * count:
        raise InputError(f"window {what} {seconds:g} s is not a whole number of samples of {spacing:g} s")
    return round(count)


class WindowModel(RegressorModel):
    """A model whose rows are differences of states plus integrals of densities over windows."""

    window: Window

    @abstractmethod
    def state(self, q: ca.SX, dq: ca.SX) -> ca.SX:
        """State, whose difference over a window enters its row, as a function of the motion, shape (r, p)."""

    @abstractmethod
    def density(self, q: ca.SX, dq: ca.SX) -> ca.SX:
        """Density, whose integral over a window enters its row, as a function of the motion, shape (r, p)."""

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Rate of change of a growing window's row, ``d/dt state + density``; it has the model's base parameters."""
        state, motion, rate = self.state(q, dq), ca.vertcat(q, dq), ca.vertcat(dq, ddq)
        slope = ca.jtimes(ca.vec(ca.densify(state)), motion, rate)
        return ca.sparsify(ca.reshape(slope, *state.shape)) + self.density(q, dq)

    def expression(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """States over densities, shape (2 r, p)."""
        return ca.vertcat(self.state(q, dq), self.density(q, dq))

    @cached_property
    def _parts(self) -> VectorisedFunction:
        return self._compiled(self.expression)

    @cached_property
    def _selections(self) -> dict[bytes, tuple[VectorisedFunction, int, Index, Index]]:
        """What was compiled for a selection of columns."""
        return {}

    def _selection(self, columns: Index) -> tuple[VectorisedFunction, int, Index, Index]:
        """Structural nonzeros of some columns, those of the states first, their number, and all rows and columns."""
        if (key := columns.tobytes()) not in self._selections:
            parts, r = self._parts, len(self.row_labels)
            place = np.full(parts.shape[1], -1)
            place[columns] = np.arange(columns.size)
            integrated = self._integrated_exactly()[parts.column]
            used = np.flatnonzero((place[parts.column] >= 0) & ((parts.row < r) | ~integrated))
            used = used[np.argsort(parts.row[used] >= r, kind="stable")]
            row, column = parts.row[used], place[parts.column[used]]
            self._selections[key] = parts.selection(used), int(np.count_nonzero(row < r)), row % r, column
        return self._selections[key]

    def _integrated_exactly(self) -> Mask:
        """Which columns have no density here, since `_cumulated` of a subclass knows their integrals, shape (p,)."""
        return np.zeros(len(self.columns), dtype=bool)

    def _cumulated(self, samples: Samples, columns: Index) -> Array:
        """``state(t) + int density`` from the first sample on, by Simpson's rule, shape (r, k, N)."""
        function, states, row, column = self._selection(columns)
        cumulated = np.zeros((len(self.row_labels), columns.size, samples.time.size))
        values = function(*(np.ascontiguousarray(x.T) for x in (samples.q, samples.dq, samples.ddq)))
        cumulated[row[:states], column[:states]] = values[:states]
        cumulated[row[states:], column[states:]] += _running_integral(values[states:], samples.time, axis=-1)
        return cumulated

    def assemble(self, samples: Samples) -> Array:
        """Stacked regressor W, the r rows of the first window, then of the second, and so on.

        Parameters
        ----------
        samples : Samples
            N uniform instants of one motion.

        Returns
        -------
        ndarray, shape (windows * r, p)

        Raises
        ------
        InputError
            See `Window.ends`.
        """
        W = self.assembled_entries(samples, np.arange(len(self.columns)))
        return np.asarray(W.transpose(2, 0, 1).reshape(-1, len(self.columns)))

    def assembled_entries(self, samples: Samples, columns: Index) -> Array:
        """Some columns of `assemble`, without computing the others, shape (r, k, windows)."""
        if type(self).assemble is not WindowModel.assemble:
            return super().assembled_entries(samples, columns)
        first, last = self.window.ends(samples.time)
        cumulated = self._cumulated(samples, columns)
        return np.asarray(cumulated[..., last] - cumulated[..., first])

    def right_side(self, samples: Samples, measured: Array) -> Array:
        """Integrals of the `measured_density` over the windows.

        Parameters
        ----------
        samples : Samples
        measured : ndarray, shape (N, ...)

        Returns
        -------
        ndarray, shape (windows * r,)
        """
        first, last = self.window.ends(samples.time)
        cumulated = _running_integral(self.measured_density(samples, np.asarray(measured, dtype=float)), samples.time)
        return np.asarray((cumulated[last] - cumulated[first]).reshape(-1))

    def row_times(self, time: Array) -> Array:
        """End of every window [s]."""
        return time[self.window.ends(time)[1]]

    @abstractmethod
    def measured_density(self, samples: Samples, measured: Array) -> Array:
        """Measured density whose integral over a window is y, shape (N, r)."""

    def times(self, duration: float, rate: float) -> Array:
        """Uniform instants, at least two per short window, that divide it."""
        if self.window.kind == "long":
            return super().times(duration, rate)
        parts = max(2, int(np.ceil(self.window.length * rate - 1e-9)))
        spacing = self.window.length / parts
        return np.asarray(np.arange(int(np.floor(duration / spacing + 1e-9)) + 1) * spacing)

    def combination(self, duration: float, count: int) -> Combination:
        """Short windows spread over the motion, each with Simpson's three instants; or long ones on a fine grid."""
        if self.window.kind == "long":
            time = np.linspace(0.0, duration, 2 * count + 1)
            difference = np.eye(time.size)[1:]
            difference[:, 0] -= 1.0
            integral = _running_integral(np.eye(time.size), time)[1:]
            return Combination(time, scipy.sparse.csr_array(difference), scipy.sparse.csr_array(integral))
        return _short_windows(duration, count, self.window.length)


def _running_integral(values: Array, time: Array, axis: int = 0) -> Array:
    return np.asarray(scipy.integrate.cumulative_simpson(values, x=time, axis=axis, initial=0.0), dtype=float)


def _short_windows(duration: float, count: int, length: float) -> Combination:
    start = np.linspace(0.0, duration - length, count)
    time = (start[:, None] + length * np.array([0.0, 0.5, 1.0])).ravel()
    eye = scipy.sparse.eye_array(count, format="csr")
    difference = scipy.sparse.kron(eye, np.array([[-1.0, 0.0, 1.0]]), format="csr")
    integral = scipy.sparse.kron(eye, length / 6 * np.array([[1.0, 4.0, 1.0]]), format="csr")
    return Combination(time, difference / length, integral / length, unit=length)
