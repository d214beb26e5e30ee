"""Drives in JAX: rotor inertia and friction at the drive coordinates ``z = C q + z0``."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from regressors.errors import InputError
from regressors.models.columns import Drives as Chosen
from regressors.models.columns import Terms, includes
from regressors.robot.gears import BallScrew, ConstantRatio, GearFunction
from regressors.robot.robot import Robot
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class Drives:
    """Constants of the m drives that have parameters.

    Parameters
    ----------
    numbers : tuple of int
        Numbers of the drives, the owners of their columns.
    coupling, offset : ndarray, shape (m, n) and (m,)
    rotors : ndarray of int
        Drives whose rotor's inertia is a parameter.
    gears : tuple of GearFunction
        Gear functions of the rotors.
    terms : Terms
    sign_width : float
        Velocity over which the sign of Coulomb friction changes [rad/s]; zero for the exact sign.
    """

    numbers: tuple[int, ...]
    coupling: Array
    offset: Array
    rotors: Index
    gears: tuple[GearFunction, ...]
    terms: Terms
    sign_width: float

    def having(self, chosen: Chosen) -> Index:
        """Indices of the drives that have one of the optional columns."""
        return np.array([k for k, number in enumerate(self.numbers) if includes(chosen, number)], dtype=np.intp)

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

    def torque_columns(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> list[jax.Array]:
        """Joint torques per parameter, each of shape (n, k, L): rotors, Coulomb, viscous, offset where selected.

        Rotors take ``F'^2 ddz + F' F'' dz^2``; a drive's torque reaches the joints by its row of C.
        """
        z, dz, ddz = self.coordinates(q), self.velocities(dq), self.velocities(ddq)
        blocks = []
        if self.terms.rotor and self.rotors.size:
            turning, speed = z[self.rotors], dz[self.rotors]
            ratio, slope = jax.jvp(self.ratios, (turning,), (jnp.ones_like(turning),))
            blocks.append((self.rotors, ratio**2 * ddz[self.rotors] + ratio * slope * speed**2))
        friction = (
            (self.terms.coulomb, self.signs),
            (self.terms.viscous, lambda x: x),
            (self.terms.offset, jnp.ones_like),
        )
        blocks += [(self.having(chosen), torque(dz)[self.having(chosen)]) for chosen, torque in friction]
        return [jnp.asarray(self.coupling[index].T)[..., None] * values for index, values in blocks]

    def energy_columns(self, q: jax.Array, dq: jax.Array) -> list[jax.Array]:
        """Energy per parameter, each of shape (1, k, L): rotors ``1/2 (F'(z) dz)^2``, friction none, offset z."""
        z, dz = self.coordinates(q), self.velocities(dq)
        blocks = []
        if self.terms.rotor and self.rotors.size:
            blocks.append((self.ratios(z[self.rotors]) * dz[self.rotors]) ** 2 / 2)
        blocks += [jnp.zeros_like(z[self.having(chosen)]) for chosen in (self.terms.coulomb, self.terms.viscous)]
        blocks += [z[self.having(self.terms.offset)]]
        return [block[None] for block in blocks]

    def loss_columns(self, dq: jax.Array) -> list[jax.Array]:
        """Power lost per parameter, each of shape (1, k, L): ``dz sign(dz)`` and ``dz^2``; rotors and offset none."""
        dz = self.velocities(dq)
        blocks = [jnp.zeros_like(dz[self.rotors])] if self.terms.rotor and self.rotors.size else []
        rubbing, viscous, offset = (
            dz[self.having(chosen)] for chosen in (self.terms.coulomb, self.terms.viscous, self.terms.offset)
        )
        blocks += [rubbing * self.signs(rubbing), viscous**2, jnp.zeros_like(offset)]
        return [block[None] for block in blocks]

    @property
    def coulomb_columns(self) -> slice:
        """Slice of the Coulomb columns among the drives' columns."""
        start = self.rotors.size if self.terms.rotor else 0
        return slice(start, start + self.having(self.terms.coulomb).size)


def drives_of(robot: Robot, terms: Terms, sign_width: float) -> Drives:
    """Drives of a robot that have parameters; one per joint, without rotor, where it has no transmission.

    Raises
    ------
    InputError
        A gear function that has no JAX form.
    """
    n, none = robot.n, np.zeros(0, dtype=np.intp)
    if robot.transmission is None:
        return Drives(robot.link_numbers, np.eye(n), np.zeros(n), none, (), terms, sign_width)
    C, offset, drives = robot.transmission.coupling, robot.transmission.offset, robot.transmission.drives
    moving = [k for k, drive in enumerate(drives) if not drive.rests]
    rotors = np.array([i for i, k in enumerate(moving) if drives[k].rotor_inertia is not None], dtype=np.intp)
    gears = tuple(drives[moving[i]].ratio for i in rotors)
    for gear in gears:
        if not isinstance(gear, ConstantRatio | BallScrew):
            raise InputError(
                f"gear function {type(gear).__name__} has no JAX counterpart; expected a constant ratio or a ball screw"
            )
    numbers = tuple(k + 1 for k in moving)
    return Drives(numbers, C[moving], offset[moving], rotors, gears, terms, sign_width)


def _ratio(gear: GearFunction, z: jax.Array) -> jax.Array:
    if isinstance(gear, BallScrew):
        length = jnp.sqrt(gear.square + gear.cosine * jnp.cos(z) + gear.sine * jnp.sin(z))
        return (np.pi / gear.pitch) * (gear.sine * jnp.cos(z) - gear.cosine * jnp.sin(z)) / length
    assert isinstance(gear, ConstantRatio)
    return jnp.full_like(z, gear.value)
