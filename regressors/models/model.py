"""The one interface of every model: which parameters it has, and its regressor for a motion.

A model is linear in its parameters, ``y = W parameters``. Design and identification use this interface only.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import casadi as ca
import numpy as np
import scipy

from regressors.errors import InputError, listed_names
from regressors.models.drives import drive_rows
from regressors.models.partial import PartialMotion, of_joints
from regressors.models.reduction import CoulombFriction, Reduction, coulomb_friction
from regressors.quantities import place_of
from regressors.robot.columns import DIRECTED_KINDS, Column, Terms
from regressors.robot.robot import Robot
from regressors.robot.symbolic.vectorised import (
    SparseRow,
    VectorisedFunction,
    evaluate_samples,
    rows_at_samples,
)
from regressors.samples import Array, Index, Samples

if TYPE_CHECKING:
    from regressors.models.windows import Window

Channel = Literal["effort", "wrench", "command"]


@dataclass(frozen=True, eq=False)
class Combination:
    """Linear map from the values of a model's expression at some instants to the rows of W.

    The expression's rows are r states above r densities; row w of W, for each of the r equations, is
    ``difference[w] @ state + integral[w] @ density``. A model of single instants has no densities, and no integral.
    """

    time: Array  # (T,) instants at which the expression is evaluated [s]
    difference: scipy.sparse.csr_array  # (N, T)
    integral: scipy.sparse.csr_array | None = None  # (N, T)
    unit: float = 1.0  # factor from these rows to those of `RegressorModel.assemble`: the window length of means


class RegressorModel(ABC):
    """A linear-in-parameters model of a robot.

    A model of your own is a subclass that sets `robot`, `columns` and `row_labels` and defines `rows`. All other
    members have defaults: those of general equations at single instants or, where `rows_are_joint_torques`, of the
    torques of all joints. A constructor that takes more than the robot returns the rest in `options`.

    Attributes
    ----------
    robot : Robot
    columns : tuple of Column
        Parameters, in the order of the regressor's columns.
    row_labels : tuple of (str, str)
        Name and unit of each of the r scalar equations.
    reduction : Reduction or None
        Composition of the first columns from standard ones; None where they are standard ones themselves.
    window : Window or None
        Time windows that the equations are integrated over; None for equations at single instants.
    channel : str
        Channel of a log that `right_side` needs: ``effort``, ``wrench`` or ``command``.
    keeps_all_links : bool
        True if no link may be merged with the one before, even where the joint between them is locked.
    bears_robot : bool
        True if the wrench is that of the whole robot, below its base.
    rows_are_joint_torques : bool
        True if there is one row per joint, its torque [Nm or N], affine in the acceleration.
    equations_can_be_chosen : bool
        False where there is a single equation by nature.
    jax_form : str or None
        Its JAX form as ``module:Class``, a subclass of `regressors.jax_models.jax_model.RegressorBlock` constructed
        from the model and the indices of the selected columns. It is not inherited, since a subclass has other rows.
    """

    robot: Robot
    columns: tuple[Column, ...]
    row_labels: tuple[tuple[str, str], ...]
    reduction: Reduction | None = None
    window: Window | None = None
    channel: ClassVar[Channel] = "effort"
    keeps_all_links: ClassVar[bool] = False
    bears_robot: ClassVar[bool] = False
    rows_are_joint_torques: ClassVar[bool] = False
    equations_can_be_chosen: ClassVar[bool] = True
    jax_form: ClassVar[str | None] = None

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.jax_form = vars(cls).get("jax_form")

    def __repr__(self) -> str:
        """One line."""
        rows = listed_names([name for name, _ in self.row_labels])
        return f"<{type(self).__name__} of {self.robot.name}: {len(self.columns)} parameters, equations of {rows}>"

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without compiled functions, which are rebuilt when needed."""
        kept = vars(self).items()
        return {name: value for name, value in kept if not isinstance(getattr(type(self), name, None), cached_property)}

    @abstractmethod
    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Regressor of one instant as an expression.

        Parameters
        ----------
        q, dq, ddq : SX, shape (n, 1)
            Joint position, velocity, acceleration [rad, rad/s, rad/s^2, or with m].

        Returns
        -------
        SX, shape (r, p)
            One row per scalar equation, one column per parameter; for a model over time windows its rate of change.
        """

    def expression(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Expression to evaluate at each instant and combine into the rows of W; by default the rows themselves."""
        return self.rows(q, dq, ddq)

    @property
    def composition(self) -> Reduction:
        """Composition of all columns from standard ones; those that a subclass adds to `reduction`'s are standard."""
        if self.reduction is None:
            return Reduction.none(self.columns)
        return self.reduction.extended(self.columns[len(self.reduction.columns) :])

    @property
    def standard_columns(self) -> tuple[Column, ...]:
        """Standard parameters, from which the columns are composed."""
        return self.composition.standard

    def definition(self) -> tuple[Array, tuple[str, ...]]:
        """The matrix of ``parameters = matrix @ standard``, and the names of the standard parameters."""
        composition = self.composition
        return composition.definition, tuple(column.name for column in composition.standard)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(column.name for column in self.columns)

    @cached_property
    def function(self) -> VectorisedFunction:
        """`rows` compiled for many instants at once."""
        return self._compiled(self.rows)

    def _compiled(self, expression: Callable[[ca.SX, ca.SX, ca.SX], ca.SX]) -> VectorisedFunction:
        symbols = [ca.SX.sym(name, self.robot.n) for name in ("q", "dq", "ddq")]
        return VectorisedFunction(symbols, expression(*symbols))

    def instants(self, samples: Samples) -> Array:
        """Rows of single instants, before any combination over time.

        Parameters
        ----------
        samples : Samples
            N instants, not necessarily of one motion.

        Returns
        -------
        ndarray, shape (N * r, p)
            The r rows of the first instant, then of the second, and so on.
        """
        return evaluate_samples(self.function, samples).reshape(-1, len(self.columns))

    def selected(self, samples: Samples, columns: Index) -> Array:
        """Some columns of `instants`, shape (N * r, k), without computing an array of all of them.

        Parameters
        ----------
        samples : Samples
        columns : ndarray of int, shape (k,)
        """
        if type(self).instants is not RegressorModel.instants:
            return self.instants(samples)[:, columns]
        return evaluate_samples(self.function, samples, columns).reshape(-1, columns.size)

    def entries(self, samples: Samples, columns: Index) -> list[SparseRow]:
        """Some columns of `instants`, by equation: those that are not zero by structure, and their entries.

        Parameters
        ----------
        samples : Samples
        columns : ndarray of int, shape (k,)
        """
        if type(self).instants is not RegressorModel.instants:
            W = self.instants(samples).reshape(samples.time.size, -1, len(self.columns))[:, :, columns]
            return [(np.arange(columns.size), np.ascontiguousarray(row)) for row in W.transpose(1, 2, 0)]
        return rows_at_samples(self.function, samples, columns)

    def assemble(self, samples: Samples) -> Array:
        """Stacked regressor W of a motion.

        Parameters
        ----------
        samples : Samples
            N instants of one motion.

        Returns
        -------
        ndarray, shape (N * r, p)
        """
        return self.instants(samples)

    def assembled_entries(self, samples: Samples, columns: Index) -> Array:
        """Some columns of `assemble`, shape (r, k, m): every entry of the matrix in all m blocks of r rows.

        Parameters
        ----------
        samples : Samples
        columns : ndarray of int, shape (k,)
        """
        W = self.assemble(samples)[:, columns]
        return np.ascontiguousarray(W.reshape(-1, len(self.row_labels), columns.size).transpose(1, 2, 0))

    def right_side(self, samples: Samples, measured: Array) -> Array:
        """Measured vector y of ``y = W parameters``.

        Parameters
        ----------
        samples : Samples
        measured : ndarray, shape (N, r)
            Joint torques [Nm or N].

        Returns
        -------
        ndarray, shape (N * r,)
        """
        return np.asarray(measured, dtype=float).reshape(-1)

    def combination(self, duration: float, count: int) -> Combination:
        """Instants and weights that represent W of a periodic motion for an optimiser.

        Parameters
        ----------
        duration : float
            [s]
        count : int
            Approximate number of rows per equation.
        """
        time = np.linspace(0.0, duration, count, endpoint=False)
        return Combination(time, scipy.sparse.eye_array(count, format="csr"))

    def times(self, duration: float, rate: float) -> Array:
        """Instants at which a motion of some duration is to be sampled for `assemble`.

        Parameters
        ----------
        duration : float
            [s]
        rate : float
            Smallest number of instants per second [Hz].
        """
        return np.linspace(0.0, duration, round(duration * rate) + 1)

    def row_times(self, time: Array) -> Array:
        """Instant to which each block of r rows of `assemble` belongs, from the N sample times [s]."""
        return time

    @property
    def options(self) -> dict[str, Any]:
        """Keyword arguments, beside the robot, with which the constructor builds the same model again."""
        return {}

    def on(self, robot: Robot) -> RegressorModel:
        """The same model for another form of the robot, such as one with locked joints or added rotors.

        Parameters
        ----------
        robot : Robot
        """
        return type(self)(robot, **self._options_on(robot))  # type: ignore[call-arg]

    def _options_on(self, robot: Robot) -> dict[str, Any]:
        """Options for another form of the robot, without the terms of drives that it does not have."""
        options = dict(self.options)
        if isinstance(options.get("terms"), Terms):
            options["terms"] = options["terms"].among(tuple(drive_rows(robot)))
        return options

    def softened(self, sign_width: float) -> RegressorModel:
        """The same model with Coulomb friction ``tanh(dz / sign_width)``; itself where it has none.

        Parameters
        ----------
        sign_width : float
            Velocity over which the sign changes [rad/s or m/s]; zero for the exact sign.
        """
        return self._made_with("sign_width", sign_width) if "sign_width" in self.options else self

    def with_window(self, window: Window) -> RegressorModel:
        """The same model over other time windows; itself where it has none.

        Parameters
        ----------
        window : Window
        """
        return self if self.window is None else self._made_with("window", window)

    def _made_with(self, option: str, value: object) -> RegressorModel:
        return type(self)(self.robot, **{**self.options, option: value})  # type: ignore[call-arg]

    def instantaneous(self) -> RegressorModel:
        """Model of what is measured at single instants, in the same parameters; itself without windows.

        Raises
        ------
        InputError
            The equations are integrals, and the class does not define the model that they integrate.
        """
        if self.window is not None:
            raise InputError(f"{type(self).__name__} does not name the model of single instants that it integrates")
        return self

    def restricted(self, motion: PartialMotion, equations: Sequence[str] | None = None) -> RegressorModel:
        """The model restricted to a partial motion: of joint torques, only those of the moving coordinates are kept.

        Parameters
        ----------
        motion : PartialMotion
        equations : sequence of str, optional
            Moving coordinates whose torques are used, by label or number; all of them if not given.

        Raises
        ------
        UnknownName
            No such coordinate.
        """
        if not self.rows_are_joint_torques or (motion.complete and equations is None):
            return self
        return PartialModel(self, motion, equations)

    def torque_equations(self) -> TorqueEquations | None:
        """The equations as torques along coordinates; None where they are not joint torques at single instants."""
        if not self.rows_are_joint_torques:
            return None
        joints = range(self.robot.n)
        return TorqueEquations(self, of_joints(self.robot, joints), tuple(joints))

    def speeds(self, samples: Samples) -> Array:
        """Velocity of each equation's coordinate, shape (N, r) [rad/s or m/s]; NaN where it has none."""
        equations = self.torque_equations()
        if equations is None:
            return np.full((samples.time.size, len(self.row_labels)), np.nan)
        return equations.speeds(samples.dq)

    def coulomb_friction(self) -> CoulombFriction | None:
        """Columns of directed friction and their drives; None where friction is no torque at every instant."""
        equations = self.torque_equations()
        if equations is None:
            return None
        magnitudes = equations.model.friction_magnitudes
        return coulomb_friction(self.robot, self.composition, equations.directions, magnitudes)

    def friction_magnitudes(self, samples: Samples) -> Array:
        """Friction per unit parameter and unit direction, of every standard column of directed friction.

        Parameters
        ----------
        samples : Samples
            N instants.

        Returns
        -------
        ndarray, shape (N, k)
            One for each standard column whose kind is one of `regressors.robot.columns.DIRECTED_KINDS`, in their
            order; by default ones, the magnitude of Coulomb friction.
        """
        return np.ones((samples.time.size, sum(c.kind in DIRECTED_KINDS for c in self.standard_columns)))


@dataclass(frozen=True, eq=False)
class TorqueEquations:
    """Torques of moving coordinates, ``N' tau`` with ``q = N s + q0``, from which equations of motion are built."""

    model: RegressorModel  # of the torques of all joints, one row each
    motion: PartialMotion  # N and q0
    used: tuple[int, ...]  # moving coordinates whose torques are equations

    @property
    def directions(self) -> Array:
        """Columns of N that are used, shape (n, r)."""
        return self.motion.matrix[:, self.used]

    @property
    def every_joint(self) -> bool:
        """True if the equations are the torques of all joints themselves."""
        return np.array_equal(self.directions, np.eye(len(self.motion.offset)))

    @property
    def unused(self) -> tuple[str, ...]:
        """Moving coordinates without an equation; if there are any, the torques do not determine the motion."""
        return tuple(label for k, label in enumerate(self.motion.labels) if k not in self.used)

    def speeds(self, dq: Array) -> Array:
        """Velocity of each equation's coordinate, shape (N, r), from the joints', shape (N, n) [rad/s or m/s]."""
        if self.motion.complete:
            return dq[:, self.used]
        return np.asarray(dq @ np.linalg.pinv(self.motion.matrix)[list(self.used)].T)


class PartialModel(RegressorModel):
    """A torque model restricted to the moving coordinates, ``N' Y``.

    Held joints and drives are left out: at rest, static friction hides the torque they carry.
    """

    jax_form = "regressors.jax_models.jax_model:ProjectedPart"

    def __init__(self, model: RegressorModel, motion: PartialMotion, equations: Sequence[str] | None = None) -> None:
        if not model.rows_are_joint_torques or len(model.row_labels) != len(motion.offset):
            raise InputError(
                f"a partial motion of {len(motion.offset)} joints needs a model of their torques, one row per joint, "
                f"given {type(model).__name__} with {len(model.row_labels)}"
            )
        self.model, self.motion = model, motion
        self.robot, self.columns, self.reduction = model.robot, model.columns, model.composition
        self.used = sorted({place_of("equation", equation, motion.labels) for equation in equations or motion.labels})
        torque = {"rad": "Nm", "m": "N"}
        self.row_labels = tuple((motion.labels[k], torque[motion.units[k]]) for k in self.used)

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Rows of the moving coordinates that are used, shape (r, p)."""
        return ca.mtimes(self.motion.directions(q)[:, self.used].T, self.model.rows(q, dq, ddq))

    def right_side(self, samples: Samples, measured: Array) -> Array:
        """Torques of the moving coordinates that are used, ``N' tau``; `measured` has shape (N, n) [Nm or N]."""
        torque = self.motion.torques(samples.q, np.asarray(measured, dtype=float))
        return np.ascontiguousarray(torque[:, self.used]).reshape(-1)

    def torque_equations(self) -> TorqueEquations | None:
        """Torque equations of the moving coordinates that are used; None where loops bend the motion."""
        if not self.motion.straight:
            return None
        return TorqueEquations(self.model, self.motion, tuple(self.used))

    def restricted(self, motion: PartialMotion, equations: Sequence[str] | None = None) -> RegressorModel:
        """The complete model, restricted to another motion of the same joints."""
        return self.model.restricted(motion, equations)

    def on(self, robot: Robot) -> PartialModel:
        """The model for another form of the robot with the same joints, restricted to the same motion."""
        return self._around(self.model.on(robot))

    def softened(self, sign_width: float) -> PartialModel:
        """The softened model, restricted to the same motion."""
        return self._around(self.model.softened(sign_width))

    def instantaneous(self) -> PartialModel:
        """The model of single instants, restricted to the same motion."""
        return self._around(self.model.instantaneous())

    def _around(self, model: RegressorModel) -> PartialModel:
        if model is self.model:
            return self
        return PartialModel(model, self.motion, [self.motion.labels[k] for k in self.used])
