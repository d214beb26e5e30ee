"""Drives, integrals over a motion and vector algebra in JAX."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from regressors.errors import InputError
from regressors.models.drives import SMALLEST_SPEED
from regressors.robot.columns import (
    ASYMMETRY,
    FRICTION_KINDS,
    LOAD_SHARE,
    OFFSET,
    ROOT,
    STRIBECK,
    VISCOUS,
    Terms,
)
from regressors.robot.gears import BallScrew, ConstantRatio, GearFunction
from regressors.robot.robot import Robot, drive_numbers, transmission_of
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class DriveConstants:
    """Constants of the m drives that have parameters."""

    numbers: tuple[int, ...]  # owners of their columns
    coupling: Array  # (m, n)
    offset: Array  # (m, n)
    rotors: Index  # drives whose rotor's inertia is a parameter
    gears: tuple[GearFunction, ...]  # gear functions of the rotors
    terms: Terms
    sign_width: float  # velocity over which the sign of Coulomb friction changes [rad/s]; zero for the exact sign

    def coordinates(self, q: jax.Array) -> jax.Array:
        """``z``, shape (m, L); `q` has shape (n, L)."""
        return self.velocities(q) + self.offset[:, None]

    def velocities(self, dq: jax.Array) -> jax.Array:
        """``C dq``, shape (m, L); accelerations likewise."""
        return jnp.asarray(self.coupling) @ dq

    def signs(self, dz: jax.Array) -> jax.Array:
        """Direction of motion, exact or smooth."""
        return jnp.sign(dz) if self.sign_width == 0.0 else jnp.tanh(dz / self.sign_width)

    def ratios(self, z: jax.Array) -> jax.Array:
        """``F'(z)`` of the rotors' gears, shape (rotors, L); `z` holds their coordinates."""
        return jnp.stack([_ratio(gear, z[k]) for k, gear in enumerate(self.gears)])

    def of_kind(self, kind: str) -> Index:
        """Drives that have a friction column of some kind."""
        return np.array([k for k, n in enumerate(self.numbers) if self.terms.include(kind, n)], dtype=np.intp)

    @property
    def kinds(self) -> list[tuple[str, Index]]:
        """Kinds of friction of which there are columns, each with its drives."""
        return [(kind, some) for kind in FRICTION_KINDS if (some := self.of_kind(kind)).size]

    def friction(self, kind: str, dz: jax.Array, carried: jax.Array | None = None) -> jax.Array:
        """Friction torque per unit parameter of some drives, shape (k, L), see `Terms`; `carried` is their load."""
        if kind == VISCOUS:
            return dz
        if kind == OFFSET:
            return jnp.ones_like(dz)
        if kind == ASYMMETRY:
            return jnp.abs(dz)
        if kind == ROOT:
            return jnp.sqrt(jnp.abs(dz) + SMALLEST_SPEED) * self.signs(dz)
        if kind == STRIBECK:
            return jnp.exp(-((dz / self.terms.stribeck_speed) ** 2)) * self.signs(dz)
        if kind == LOAD_SHARE:
            assert carried is not None
            return jnp.abs(carried) * self.signs(dz)
        return self.signs(dz)

    def rotor_torques(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Torque at the drive per unit rotor inertia, ``F'^2 ddz + F' F'' dz^2``, shape (rotors, L)."""
        z, dz, ddz = (x[self.rotors] for x in (self.coordinates(q), self.velocities(dq), self.velocities(ddq)))
        ratio, slope = jax.jvp(self.ratios, (z,), (jnp.ones_like(z),))
        torques: jax.Array = ratio**2 * ddz + ratio * slope * dz**2
        return torques

    def torque_columns(self, q: jax.Array, dq: jax.Array, ddq: jax.Array, carried: jax.Array | None) -> list[jax.Array]:
        """Joint torques per parameter, each of shape (n, k, L): rotors, then friction by kind, where selected."""
        # carried (m, L), for load shares
        dz = self.velocities(dq)
        blocks = []
        if self.terms.rotor and self.rotors.size:
            blocks.append((self.rotors, self.rotor_torques(q, dq, ddq)))
        for kind, some in self.kinds:
            blocks.append((some, self.friction(kind, dz[some], None if carried is None else carried[some])))
        return [jnp.asarray(self.coupling[index].T)[..., None] * values for index, values in blocks]

    def energy_columns(self, q: jax.Array, dq: jax.Array) -> list[jax.Array]:
        """Energy per parameter, each of shape (1, k, L): rotors ``1/2 (F'(z) dz)^2``, friction none, offset z."""
        z, dz = self.coordinates(q), self.velocities(dq)
        blocks = []
        if self.terms.rotor and self.rotors.size:
            blocks.append((self.ratios(z[self.rotors]) * dz[self.rotors]) ** 2 / 2)
        blocks += [z[some] if kind == OFFSET else jnp.zeros_like(z[some]) for kind, some in self.kinds]
        return [block[None] for block in blocks]

    def loss_columns(self, dq: jax.Array) -> list[jax.Array]:
        """Power lost per parameter, each of shape (1, k, L): ``dz`` times its torque; rotors and offset none."""
        dz = self.velocities(dq)
        blocks = [jnp.zeros_like(dz[self.rotors])] if self.terms.rotor and self.rotors.size else []
        for kind, some in self.kinds:
            speed = dz[some]
            blocks.append(jnp.zeros_like(speed) if kind == OFFSET else speed * self.friction(kind, speed))
        return [block[None] for block in blocks]


def drives_of(robot: Robot, terms: Terms, sign_width: float) -> DriveConstants:
    """Drives of a robot that have parameters; one per joint, without rotor, where it has no transmission."""
    transmission = transmission_of(robot)
    drives = transmission.drives
    moving = [k for k, drive in enumerate(drives) if not drive.rests]
    rotors = np.array([i for i, k in enumerate(moving) if drives[k].rotor_inertia is not None], dtype=np.intp)
    gears = tuple(drives[moving[i]].ratio for i in rotors)
    for gear in gears:
        if not isinstance(gear, ConstantRatio | BallScrew):
            raise InputError(
                f"gear function {type(gear).__name__} has no JAX counterpart; expected a constant ratio or a ball screw"
            )
    numbers = tuple(drive_numbers(robot)[k] for k in moving)
    C, offset = transmission.coupling[moving], transmission.offset[moving]
    return DriveConstants(numbers, C, offset, rotors, gears, terms, sign_width)


def _ratio(gear: GearFunction, z: jax.Array) -> jax.Array:
    if isinstance(gear, BallScrew):
        length = jnp.sqrt(gear.square + gear.cosine * jnp.cos(z) + gear.sine * jnp.sin(z))
        return (np.pi / gear.pitch) * (gear.sine * jnp.cos(z) - gear.cosine * jnp.sin(z)) / length
    assert isinstance(gear, ConstantRatio)
    return jnp.full_like(z, gear.value)


def running_integral(values: jax.Array, spacing: float) -> jax.Array:
    """Integral from the first sample on, along the first axis; as SciPy's ``cumulative_simpson`` on uniform samples.

    Even intervals are integrated by the parabola through their ends and the next sample, odd ones and the last by that
    through their ends and the sample before.
    """  # values (N, ...)
    if values.shape[0] < 3:
        parts = (values[1:] + values[:-1]) * (spacing / 2)
    else:
        before, here, after = values[:-2], values[1:-1], values[2:]
        ahead = (5 * before + 8 * here - after) * (spacing / 12)
        behind = (5 * after + 8 * here - before) * (spacing / 12)
        interval = np.arange(values.shape[0] - 1)
        even = (interval % 2 == 0) & (interval < interval[-1])
        even = even.reshape(-1, *(1,) * (values.ndim - 1))
        parts = jnp.where(even, jnp.concatenate([ahead, ahead[-1:]]), jnp.concatenate([behind[:1], behind]))
    return jnp.concatenate([jnp.zeros_like(values[:1]), jnp.cumsum(parts, axis=0)])


def path_lengths(z: jax.Array, dz: jax.Array, spacing: float) -> jax.Array:
    """``int |dz| dt`` from the first sample on, exact for cubics through the samples' positions and velocities."""
    # z, dz (N, k)
    a, b, rise = dz[:-1], dz[1:], z[1:] - z[:-1]
    # velocity of the cubic at fraction s of an interval: a + slope s + curve s^2
    curve = 3 * (a + b - 2 * rise / spacing)
    slope = b - a - curve
    root = jnp.sqrt(jnp.maximum(slope**2 - 4 * curve * a, 0.0))
    divisor = -0.5 * (slope + jnp.where(slope >= 0, root, -root))
    turns = jnp.stack([_quotient(divisor, curve), _quotient(a, divisor)])
    parts = jnp.sort(jnp.clip(turns, 0.0, 1.0), axis=0)
    reached = spacing * parts * (a + parts * (slope / 2 + parts * curve / 3))
    length = jnp.abs(reached[0]) + jnp.abs(reached[1] - reached[0]) + jnp.abs(rise - reached[1])
    return jnp.concatenate([jnp.zeros_like(z[:1]), jnp.cumsum(length, axis=0)])


def _quotient(a: jax.Array, b: jax.Array) -> jax.Array:
    """``a / b``; zero where ``b`` is zero."""
    return jnp.where(b == 0.0, 0.0, a / jnp.where(b == 0.0, 1.0, b))


def dot(a: jax.Array, b: jax.Array) -> jax.Array:
    """``a . b``, shapes (..., 3, L) to (..., L)."""
    return a[..., 0, :] * b[..., 0, :] + a[..., 1, :] * b[..., 1, :] + a[..., 2, :] * b[..., 2, :]


def cross(a: jax.Array, b: jax.Array) -> jax.Array:
    """``a x b``, shapes (..., 3, L)."""
    (ax, ay, az), (bx, by, bz) = ((v[..., 0, :], v[..., 1, :], v[..., 2, :]) for v in (a, b))
    return jnp.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-2)


def times_inertia(s: jax.Array, x: jax.Array) -> jax.Array:
    """``s'[. x]`` with ``I x = [. x] (Ixx, Ixy, Ixz, Iyy, Iyz, Izz)``, (..., 6, L) [KD96] eq. (9)."""
    (s0, s1, s2), (x0, x1, x2) = ((v[..., 0, :], v[..., 1, :], v[..., 2, :]) for v in (s, x))
    return jnp.stack([s0 * x0, s0 * x1 + s1 * x0, s0 * x2 + s2 * x0, s1 * x1, s1 * x2 + s2 * x1, s2 * x2], axis=-2)


def turned(R: jax.Array, v: jax.Array) -> jax.Array:
    """``R v``, shapes (..., 3, 3, L) and (..., 3, L)."""
    return R[..., 0, :] * v[..., None, 0, :] + R[..., 1, :] * v[..., None, 1, :] + R[..., 2, :] * v[..., None, 2, :]


def turned_back(R: jax.Array, v: jax.Array) -> jax.Array:
    """``R' v``, shapes (..., 3, 3, L) and (..., 3, L)."""
    x, y, z = v[..., 0, None, :], v[..., 1, None, :], v[..., 2, None, :]
    return R[..., 0, :, :] * x + R[..., 1, :, :] * y + R[..., 2, :, :] * z


def product(A: jax.Array, B: jax.Array) -> jax.Array:
    """``A B``, shapes (3, 3, L)."""
    return A[:, 0, None] * B[None, 0] + A[:, 1, None] * B[None, 1] + A[:, 2, None] * B[None, 2]
