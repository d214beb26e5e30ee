"""Limits as objects, stated before it is known which joints move, and limits on smooth functions of the motion.

Each is a CasADi expression g(q, dq, ddq), so that an optimiser has its exact derivatives and a certificate can enclose
it between samples.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cache, cached_property
from typing import Any

import casadi as ca
import cloudpickle
import numpy as np
from numpy.typing import NDArray

from constraints.linear import OTHER, Constraint
from regressors.arguments import checked
from regressors.models.partial import PartialMotion
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.robot.symbolic.intervals import OverBoxes, interval_function
from regressors.robot.symbolic.kinematics import sparse
from regressors.robot.symbolic.vectorised import VectorisedFunction, evaluate_samples
from regressors.samples import Array, Index, Samples


class Limit(ABC):
    """One kind of limit, beside those of joints and drives that the robot's description states.

    A limit of your own is a subclass with `imposed`, given in ``constraints=[...]``.

    Attributes
    ----------
    friction : FrictionCurves or None
        Friction curves that the limit takes into account, if any.
    """

    friction: FrictionCurves | None = None

    @abstractmethod
    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """The constraints that a robot's motion must keep.

        Parameters
        ----------
        robot : Robot
            The whole robot.
        motion : PartialMotion
            Map from the coordinates that may move to all joints of the robot, ``q = N s + q0``.

        Returns
        -------
        sequence of NonlinearConstraint
            Functions of the coordinates that may move: those of all joints, `restricted` to the motion.

        Raises
        ------
        InputError
            An invalid limit, or one that needs data missing from the robot's description.
        """

    def knowing(self, friction: FrictionCurves | None) -> Limit:
        """The limit with friction known beforehand, where it has a field for it and none was given."""
        takes = is_dataclass(self) and any(each.name == "friction" for each in fields(self))
        return replace(self, friction=friction) if takes and self.friction is None else self  # type: ignore[type-var]


Expression = Callable[[ca.SX, ca.SX, ca.SX], ca.SX]


@checked
@dataclass(eq=False, repr=False)
class NonlinearConstraint(Constraint):
    """``lower <= g(q, dq, ddq) <= upper``.

    Parameters
    ----------
    joints : int
        Number of joints, n.
    expression : callable
        g of q, dq, ddq, each SX of shape (n, 1); returns shape (k, 1).
    lower, upper : ndarray, shape (k,)
        Infinite where there is no bound.
    scale : ndarray, shape (k,)
        Magnitude of each function, > 0, relative to which an optimiser keeps its distance from the bounds.
    labels, units : tuple of str
    shown : callable, optional
        Maps values of g to the reported quantity; the identity if not given.
    quantity : str
        What is limited, in a word.

    Attributes
    ----------
    unchecked : Mapping[str, str]
        What the limits leave out, and why.
    notes : tuple of str
        Notes on the limits for the user.
    """

    joints: int
    expression: Expression
    lower: Array
    upper: Array
    scale: Array
    labels: tuple[str, ...]
    units: tuple[str, ...]
    shown: Callable[[Array], Array] = lambda values: values
    quantity: str = OTHER
    unchecked: Mapping[str, str] = field(default_factory=dict, init=False)
    notes: tuple[str, ...] = field(default=(), init=False)

    def __getstate__(self) -> dict[str, Any]:
        """The state with the instructions of g, whose expression pickle could not name."""
        compiled = {name for name in vars(self) if isinstance(getattr(type(self), name, None), cached_property)}
        symbols = motion_symbols(self.joints)[:3]
        g = ca.Function("g", symbols, [self.expression(*symbols)])
        kept = {name: value for name, value in vars(self).items() if name not in compiled}
        return {**kept, "expression": g, "shown": cloudpickle.dumps(self.shown)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update({**state, "shown": cloudpickle.loads(state["shown"])})

    @cached_property
    def function(self) -> VectorisedFunction:
        """Values of g for many instants at once."""
        symbols = motion_symbols(self.joints)[:3]
        return VectorisedFunction(symbols, self.expression(*symbols))

    @cached_property
    def jacobian(self) -> VectorisedFunction:
        """``dg / d(q, dq, ddq)``, shape (k, 3 n), for many instants at once."""
        symbols = motion_symbols(self.joints)[:3]
        return VectorisedFunction(symbols, ca.jacobian(self.expression(*symbols), ca.vertcat(*symbols)))

    @cached_property
    def rate(self) -> OverBoxes:
        """``dg/dt`` of (q, dq, ddq, dddq), enclosed over boxes."""
        q, dq, ddq, dddq = motion_symbols(self.joints)
        g = self.expression(q, dq, ddq)
        return interval_function([q, dq, ddq, dddq], ca.jtimes(g, ca.vertcat(q, dq, ddq), ca.vertcat(dq, ddq, dddq)))

    def restricted(self, motion: PartialMotion) -> NonlinearConstraint:
        """The same bounds as functions of the moving coordinates s of ``q = N s + q0``."""
        if motion.complete:
            return self
        N, q0, whole = sparse(motion.matrix), ca.DM(motion.offset), self.expression

        def expression(s: ca.SX, ds: ca.SX, dds: ca.SX) -> ca.SX:
            return whole(ca.mtimes(N, s) + q0, ca.mtimes(N, ds), ca.mtimes(N, dds))

        s, bounds, texts = motion.matrix.shape[1], (self.lower, self.upper, self.scale), (self.labels, self.units)
        return NonlinearConstraint(s, expression, *bounds, *texts, self.shown, self.quantity)

    def values(self, samples: Samples) -> Array:
        """Values of g at every instant, shape (N, k)."""
        return evaluate_samples(self.function, samples)[:, :, 0]

    def at_rest(self, pose: Array) -> Array:
        """Values of g at rest in one pose of shape (n,), shape (k,)."""
        return np.asarray(self.values(Samples.at_rest(pose[None]))[0])

    @cached_property
    def derivatives(self) -> tuple[int, ...]:
        """Those of position (0), velocity (1) and acceleration (2) that the functions depend on."""
        return tuple(sorted(set((self.jacobian.column // self.joints).tolist()))) or (0,)

    @cached_property
    def varies(self) -> NDArray[np.bool_]:
        """Which functions depend on the motion, shape (k,)."""
        return np.isin(np.arange(len(self.lower)), self.jacobian.row)

    def at_instants(self, motion: Sequence[Array]) -> Array:
        """Values of g, shape (k, N), of position, velocity and acceleration of shape (n, N), as a search has them."""
        nonzeros, count = self._evaluated(motion), len(self.lower)
        if len(nonzeros) == count:
            return nonzeros
        values = np.zeros((count, nonzeros.shape[1]))
        values[self.function.row] = nonzeros
        return values

    def _evaluated(self, motion: Sequence[Array]) -> Array:
        """Nonzeros of g: most limits are far from their bounds, so that a search looks at them a few times."""
        return self.function.seldom(*motion)

    def slopes_at_instants(self, motion: Sequence[Array]) -> Callable[[Index, Index, Index], Array]:
        """``dg / d(q, dq, ddq)`` as in `at_instants`, by numbers of functions, of instants and of columns."""
        # numbers (rows,), (rows,) and (c,); result (rows, c)
        nonzeros = self.jacobian.seldom(*motion)
        padded = np.concatenate([nonzeros, np.zeros((1, nonzeros.shape[1]))])

        def slopes(function: Index, instant: Index, columns: Index) -> Array:
            return np.asarray(padded[self._nonzero[function[:, None], columns], instant[:, None]])

        return slopes

    @cached_property
    def _nonzero(self) -> Index:
        """Number of the Jacobian's nonzero at each place, and one more where there is none, shape (k, 3 n)."""
        row, column = self.jacobian.row, self.jacobian.column
        places = np.full((len(self.lower), 3 * self.joints), row.size)
        places[row, column] = np.arange(row.size)
        return places

    def slopes(self, samples: Samples) -> Array:
        """``dg / d(q, dq, ddq)`` at every instant, shape (N, k, 3 n)."""
        return evaluate_samples(self.jacobian, samples)


@cache
def motion_symbols(joints: int) -> list[ca.SX]:
    """Position, velocity, acceleration and jerk, which all limits of so many joints share."""
    return [ca.SX.sym("d" * order + "q", joints) for order in range(4)]


class StackedConstraint(NonlinearConstraint):
    """The functions of several constraints on the same coordinates, which share the robot's kinematics."""

    def __init__(self, parts: Sequence[NonlinearConstraint]) -> None:
        self.parts = tuple(parts)
        self._first = np.cumsum([0, *(len(part.lower) for part in parts)])
        names = ("lower", "upper", "scale")
        lower, upper, scale = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
        labels, units = (sum((getattr(part, name) for part in parts), ()) for name in ("labels", "units"))
        super().__init__(parts[0].joints, self._stacked, lower, upper, scale, labels, units, self._shown)

    def _stacked(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        return ca.vertcat(*(part.expression(q, dq, ddq) for part in self.parts))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.parts,)

    def _evaluated(self, motion: Sequence[Array]) -> Array:
        """Nonzeros of g at every step of a search."""
        return self.function(*motion)

    def _shown(self, values: Array) -> Array:
        split = np.split(values, self._first[1:-1], axis=-1)
        return np.concatenate([part.shown(own) for part, own in zip(self.parts, split, strict=True)], axis=-1)

    @cached_property
    def derivatives(self) -> tuple[int, ...]:
        """Those that a part depends on."""
        return tuple(sorted({order for part in self.parts for order in part.derivatives}))

    @cached_property
    def varies(self) -> NDArray[np.bool_]:
        """Which functions depend on the motion, shape (k,)."""
        return np.concatenate([part.varies for part in self.parts])

    def slopes_at_instants(self, motion: Sequence[Array]) -> Callable[[Index, Index, Index], Array]:
        """The same of each part, at those of the instants that its functions are asked for."""

        def slopes(function: Index, instant: Index, columns: Index) -> Array:
            found = np.zeros((function.size, columns.size))
            owner = np.searchsorted(self._first, function, side="right") - 1
            for k in np.flatnonzero(np.bincount(owner, minlength=len(self.parts))):
                (rows,) = np.nonzero(owner == k)
                used, place = np.unique(instant[rows], return_inverse=True)
                of_part = self.parts[k].slopes_at_instants([part[:, used] for part in motion])
                found[rows] = of_part(function[rows] - self._first[k], place, columns)
            return found

        return slopes


class JoinedConstraint(StackedConstraint):
    """The same, each with the functions that it has: a search that finds more limits to keep compiles nothing."""

    def at_instants(self, motion: Sequence[Array]) -> Array:
        """Values of g, see `NonlinearConstraint.at_instants`."""
        return np.concatenate([part.at_instants(motion) for part in self.parts])
