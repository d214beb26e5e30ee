"""The JAX form of a model: the differential, the energy and the load model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from importlib import import_module

import jax
import jax.numpy as jnp
import numpy as np

from regressors.errors import InputError
from regressors.jax_models.jax_bodies import effort, energy_regressor, torque_regressor, tree_motion, tree_of
from regressors.jax_models.jax_drives import cross, drives_of, path_lengths, running_integral
from regressors.models.differential import DifferentialModel, carried_rotors
from regressors.models.energy import EnergyModel
from regressors.models.load import EQUATIONS, LoadIntegralModel, LoadModel
from regressors.models.model import PartialModel, RegressorModel
from regressors.models.windows import Window
from regressors.robot.columns import COULOMB
from regressors.robot.friction.load_and_temperature import torques_at_drives
from regressors.samples import Array, Index


class JaxModel:
    """Regressor of a model as a pure function of batches, to be compiled, mapped and differentiated by JAX."""

    def __init__(self, model: RegressorModel, columns: Index | None = None) -> None:
        chosen = np.arange(len(model.columns)) if columns is None else np.asarray(columns)
        self.names = tuple(model.names[k] for k in chosen)
        self.n, self.equations = model.robot.n, len(model.row_labels)
        self._part = part_of(model, chosen)

    def rows(self, q: jax.Array | Array, dq: jax.Array | Array, ddq: jax.Array | Array) -> jax.Array:
        """Regressor of single instants, as the model's `rows`."""  # q, dq, ddq (..., n)
        motion = self._checked(q, dq, ddq)
        lead = motion[0].shape[:-1]
        values = self._part.rows(*(x.reshape(-1, self.n).T for x in motion))
        return jnp.moveaxis(values, -1, 0).reshape(*lead, self.equations, len(self.names))

    def assemble(self, time: Array, q: jax.Array | Array, dq: jax.Array | Array, ddq: jax.Array | Array) -> jax.Array:
        """Regressor of whole motions, as the model's `assemble`: one block of rows per instant, or per window."""
        # time (N,); q, dq, ddq (..., N, n)
        q, dq, ddq = self._checked(q, dq, ddq)
        return _over_motions(lambda *x: self._part.assembled(time, *(y.T for y in x)), q, dq, ddq)

    def right_side(
        self, time: Array, q: jax.Array | Array, dq: jax.Array | Array, measured: jax.Array | Array
    ) -> jax.Array:
        """Measured vector y of whole motions, as the model's `right_side`."""
        # time (N,); q, dq (..., N, n); measured (..., N, channels)
        q, dq = self._checked(q, dq)
        y = jnp.asarray(measured)
        return _over_motions(lambda q, dq, y: self._part.right_side(time, q.T, dq.T, y), q, dq, y)

    def _checked(self, *motion: jax.Array | Array) -> list[jax.Array]:
        if jnp.result_type(float) != jnp.float64:
            raise InputError(
                "the JAX form of a model needs 64-bit numbers: call it within `with jax.enable_x64(True):`"
            )
        for x in motion:
            if x.ndim < 1 or x.shape[-1] != self.n or x.shape != motion[0].shape:
                shapes = ", ".join(str(x.shape) for x in motion)
                raise InputError(
                    f"motion of {self.n} joints: expected arrays of one shape (..., {self.n}), given {shapes}"
                )
        return [jnp.asarray(x) for x in motion]


def _over_motions(function: Callable[..., jax.Array], *arrays: jax.Array) -> jax.Array:
    """Map a function of one motion's arrays, shape (N, ...) each, over the leading axes."""
    lead = arrays[0].shape[:-2]
    values = jax.vmap(function)(*(x.reshape(-1, *x.shape[-2:]) for x in arrays))
    return values.reshape(*lead, *values.shape[1:])


class RegressorBlock(ABC):
    """JAX form of a model of single instants."""  # columns (p,)

    @abstractmethod
    def __init__(self, model: RegressorModel, columns: Index) -> None: ...

    @abstractmethod
    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Regressor of L instants, shape (r, p, L); `q`, `dq`, `ddq` have shape (n, L)."""

    def assembled(self, time: Array, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Regressor of one motion of N instants, shape (m, r, p); `time` has shape (N,), the motion (n, N)."""
        return jnp.moveaxis(self.rows(q, dq, ddq), -1, 0)

    def right_side(self, time: Array, q: jax.Array, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """Measured vector y, shape (m, r), from the channels, shape (N, channels); the motion has shape (n, N)."""
        return measured


def part_of(model: RegressorModel, columns: Index) -> RegressorBlock:
    """JAX form of a model, from the class that `RegressorModel.jax_form` names."""  # columns (p,)
    if model.jax_form is None:
        raise InputError(f"{type(model).__name__} has no JAX form: its class names none as jax_form, 'module:Class'")
    module, _, name = model.jax_form.partition(":")
    part: RegressorBlock = getattr(import_module(module), name)(model, columns)
    return part


class WindowPart(RegressorBlock):
    """JAX form of a model over time windows, those of its attribute `window`."""

    window: Window

    @abstractmethod
    def state(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """State whose difference over a window counts, shape (r, p, L)."""

    @abstractmethod
    def density(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Density whose integral over a window counts, shape (r, p, L)."""

    @abstractmethod
    def measured_density(self, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """Measured density whose integral over a window is y, shape (N, r)."""

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """``d/dt state + density``."""
        rate: jax.Array = jax.jvp(self.state, (q, dq), (dq, ddq))[1]
        return rate + self.density(q, dq)

    def cumulated(self, time: Array, q: jax.Array, dq: jax.Array) -> jax.Array:
        """``state(t) + int density`` from the first sample on, shape (N, r, p)."""
        state, density = (jnp.moveaxis(f(q, dq), -1, 0) for f in (self.state, self.density))
        return state + running_integral(density, spacing(time))

    def assembled(self, time: Array, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """One row per window and equation, shape (windows, r, p)."""
        return self._differences(time, self.cumulated(time, q, dq))

    def right_side(self, time: Array, q: jax.Array, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """Integrals over the windows, shape (windows, r)."""
        return self._differences(time, running_integral(self.measured_density(dq, measured), spacing(time)))

    def _differences(self, time: Array, cumulated: jax.Array) -> jax.Array:
        first, last = self.window.ends(time)
        return cumulated[last] - cumulated[first]


def spacing(time: Array) -> float:
    """Sample time of uniform samples [s]."""
    return float(time[-1] - time[0]) / (time.size - 1)


def reduced(Y: jax.Array, S: Array) -> jax.Array:
    """``Y S`` at every instant, shape (r, p, L); by indexing where S only selects columns."""  # Y (r, P, L); S (P, p)
    if np.all(np.count_nonzero(S, axis=0) == 1) and np.all(S.sum(axis=0) == 1.0):
        return Y[:, np.argmax(S, axis=0)]
    used = np.flatnonzero(np.any(S != 0.0, axis=1))
    return jnp.moveaxis(jnp.tensordot(jnp.asarray(S[used]), Y[:, used], axes=(0, 1)), 0, 1)


class DifferentialPart(RegressorBlock):
    """Joint torques per parameter."""  # columns (p,)

    def __init__(self, model: DifferentialModel, columns: Index) -> None:
        self._tree = tree_of(model.robot)
        self._drives = drives_of(model.robot, model.terms, model.sign_width)
        self._S = model.reduction.matrix[:, columns]
        self._bodies = None
        if model.carried_bodies is not None:
            self._bodies = model.carried_bodies.reshape(-1)
            self._to_drives = torques_at_drives(model.robot)
            inertias = carried_rotors(model.robot, model.carried)
            self._rotors = np.array([inertias[self._drives.numbers[k]] for k in self._drives.rotors])

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """``tau = Y p``, shape (n, p, L)."""
        inertial = torque_regressor(self._tree, tree_motion(self._tree, q, dq, ddq))
        drives = self._drives.torque_columns(q, dq, ddq, self._carried(inertial, q, dq, ddq))
        return reduced(jnp.concatenate([inertial, *drives], axis=1), self._S)

    def _carried(self, inertial: jax.Array, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array | None:
        """Torque that each drive carries, shape (m, L); None where no load share is a parameter."""
        if self._bodies is None:
            return None
        of_bodies = jnp.einsum("npl,p->nl", inertial, jnp.asarray(self._bodies))
        carried = jnp.asarray(self._to_drives) @ of_bodies
        if not self._drives.rotors.size:
            return carried
        rotors = self._rotors[:, None] * self._drives.rotor_torques(q, dq, ddq)
        return carried.at[self._drives.rotors].add(rotors)


class ProjectedPart(RegressorBlock):
    """Linear combinations of another model's rows, ``N' Y``."""  # columns (p,)

    def __init__(self, model: PartialModel, columns: Index) -> None:
        self._whole = part_of(model.model, columns)
        model.robot.check_open("the JAX form of the projected model")
        self._projection = model.motion.matrix[:, model.used].T

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Rows of the moving coordinates, shape (r, p, L)."""
        return jnp.tensordot(jnp.asarray(self._projection), self._whole.rows(q, dq, ddq), axes=1)


class EnergyPart(WindowPart):
    """Work of the joint torques per parameter."""  # columns (p,)

    def __init__(self, model: EnergyModel, columns: Index) -> None:
        self.window = model.window
        self._tree = tree_of(model.robot)
        self._drives = drives_of(model.robot, model.terms, model.sign_width)
        self._S = model.reduction.matrix[:, columns]
        self._inertial = 10 * len(self._tree.parent)
        first = self._inertial + (self._drives.rotors.size if model.terms.rotor else 0)
        self._spread = self._S[first : first + self._drives.of_kind(COULOMB).size]

    def state(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Energy, shape (1, p, L)."""
        links = energy_regressor(self._tree, tree_motion(self._tree, q, dq, jnp.zeros_like(q)))
        return reduced(jnp.concatenate([links, *self._drives.energy_columns(q, dq)], axis=1), self._S)

    def density(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Power lost by friction, shape (1, p, L)."""
        links = jnp.zeros((1, self._inertial, q.shape[-1]))
        return reduced(jnp.concatenate([links, *self._drives.loss_columns(dq)], axis=1), self._S)

    def measured_density(self, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """Power of the joint torques, ``tau' dq``, shape (N, 1) [W]; `measured` has shape (N, n)."""
        return jnp.sum(measured * dq.T, axis=1, keepdims=True)

    def cumulated(self, time: Array, q: jax.Array, dq: jax.Array) -> jax.Array:
        """As for any window model, but Coulomb losses of exact sign come from the drives' path lengths."""
        cumulated = super().cumulated(time, q, dq)
        columns = np.flatnonzero(np.any(self._spread != 0.0, axis=0))
        if self._drives.sign_width > 0.0 or not columns.size:
            return cumulated
        C = jnp.asarray(self._drives.coupling[self._drives.of_kind(COULOMB)])
        paths = path_lengths((C @ q).T, (C @ dq).T, spacing(time)) @ jnp.asarray(self._spread[:, columns])
        return cumulated.at[:, 0, columns].set(paths)


class _SensorPart(RegressorBlock):
    """JAX form of a model of the wrench at a sensor, or of its integrals."""  # columns (p,)

    def __init__(self, model: LoadModel | LoadIntegralModel, columns: Index) -> None:
        sensor = model.sensor
        self._tree, self._link = tree_of(model.robot), sensor.place(model.robot)
        self._Rt, self._p = np.asarray(sensor.rotation).T, np.asarray(sensor.translation)[:, None]
        self._equations = [EQUATIONS.index(name) for name in sensor.equations]
        self._directions = np.split(np.eye(6)[self._equations, :, None], 2, axis=1)
        self._S = np.eye(len(model.columns))[:, columns]

    def _motion(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> tuple[jax.Array, ...]:
        """``omega, domega, v, a, up`` in the sensor's axes, shape (3, L) each, as in `TreeMotion`."""
        m, k = tree_motion(self._tree, q, dq, ddq), self._link
        w, dw, p = m.omega[k], m.domega[k], jnp.broadcast_to(self._p, m.omega[k].shape)
        v, a = m.v[k] + cross(w, p), m.a[k] + cross(dw, p) + cross(w, cross(w, p))
        return tuple(jnp.asarray(self._Rt) @ x for x in (w, dw, v, a, m.up[k]))

    def _per_parameter(self, function: Callable[..., jax.Array], *motion: jax.Array) -> jax.Array:
        """A function of the equations' directions and of the same motion for each, shape (r, p, L)."""
        shape = (len(self._equations), *motion[0].shape)
        each = (jnp.broadcast_to(jnp.asarray(x), shape) for x in (*self._directions, *motion))
        return reduced(function(*each), self._S)

    def _selected(self, measured: jax.Array) -> jax.Array:
        return measured[:, self._equations] if measured.shape[1] == len(EQUATIONS) else measured


class LoadPart(_SensorPart):
    """Wrench at the sensor per parameter."""

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Selected rows of K, shape (r, p, L)."""
        w, dw, _, a, _ = self._motion(q, dq, ddq)
        return self._per_parameter(effort, w, dw, a)

    def right_side(self, time: Array, q: jax.Array, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """The wrench, selected equations, shape (N, r); `measured` has shape (N, 6) or (N, r)."""
        return self._selected(measured)


class LoadIntegralPart(_SensorPart, WindowPart):
    """Integrals of the wrench over time windows per parameter."""  # columns (p,)

    def __init__(self, model: LoadIntegralModel, columns: Index) -> None:
        super().__init__(model, columns)
        self.window = model.window

    def state(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Momentum, the effort at the accelerations ``omega`` and ``v`` of a body that does not turn, (r, p, L)."""
        w, _, v, _, _ = self._motion(q, dq, jnp.zeros_like(q))
        return self._per_parameter(effort, jnp.zeros_like(w), w, v)

    def density(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Effort at the acceleration ``omega x v - g`` without angular acceleration, shape (r, p, L)."""
        w, _, v, _, up = self._motion(q, dq, jnp.zeros_like(q))
        return self._per_parameter(effort, w, jnp.zeros_like(w), cross(w, v) - up)

    def measured_density(self, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """The wrench itself, selected equations, shape (N, r); `measured` has shape (N, 6) or (N, r)."""
        return self._selected(measured)
