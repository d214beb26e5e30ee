"""Regressors of rigid bodies: forces along given directions, momentum and energy, linear in the ten parameters."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from regressors.jax_models.tree import KinematicTree, TreeMotion
from regressors.jax_models.vectors import cross, dot, times_inertia, turned_back


def effort(l: jax.Array, s: jax.Array, w: jax.Array, dw: jax.Array, a: jax.Array) -> jax.Array:
    """``l'F + s'N`` of a body per parameter, with F and N of [KD96] eq. (8), (9).

    ``F = m a + (dw x + w x w x) mc`` and ``N = mc x a + I dw + w x I w``, so the ten values are ``l'a``,
    ``l x dw + (l x w) x w + a x s`` and ``s'[. dw] + (s x w)'[. w]``.
    """  # l, s (..., 3, L); w, dw, a (..., 3, L)
    moment = cross(l, dw) + cross(cross(l, w), w) + cross(a, s)
    inertia = times_inertia(s, dw) + times_inertia(cross(s, w), w)
    return _joined(dot(l, a), moment, inertia)


def momentum(l: jax.Array, s: jax.Array, w: jax.Array, v: jax.Array) -> jax.Array:
    """``l'P + s'L`` per parameter: linear and angular momentum, the bracketed terms of [KD96] eq. (12), (13)."""
    # l, s (..., 3, L); w, v (..., 3, L)
    return _joined(dot(l, v), cross(l, w) + cross(v, s), times_inertia(s, w))


def torque_regressor(tree: KinematicTree, motion: TreeMotion) -> jax.Array:
    """Joint torques per inertial parameter, shape (n, 10 B, L) [Nm or N per unit parameter].

    The wrench of body k acts on the joint j of each ancestor along its motion, and on the robot's joints by
    ``tau_q = G' tau_s``.
    """
    joint, body = tree.pairs
    R, e = motion.R[body], motion.e[joint]
    turns = jnp.asarray(tree.revolute[joint])[:, None, None]
    way = cross(e, motion.origin[body] - motion.origin[joint])
    l, s = turned_back(R, jnp.where(turns > 0, way, e)), turns * turned_back(R, e)
    rows = effort(l, s, motion.omega[body], motion.domega[body], motion.a[body])  # (pairs, 10, L)
    B = len(tree.parent)
    place = np.full((B, B), len(joint))
    place[joint, body] = np.arange(len(joint))
    of_joints = jnp.concatenate([rows, jnp.zeros_like(rows[:1])])[place].reshape(B, 10 * B, -1)
    if tree.coupling.shape[0] == tree.coupling.shape[1]:
        return of_joints
    return jnp.tensordot(jnp.asarray(tree.coupling.T), of_joints, axes=1)


def energy_regressor(tree: KinematicTree, motion: TreeMotion) -> jax.Array:
    """Kinetic and potential energy per inertial parameter, shape (1, 10 B, L) [J per unit parameter].

    ``1/2 m v'v + mc'(v x w) + 1/2 w' I w - m g'p - mc' R'g`` [KD96] eq. (4), (5).
    """
    v, w = motion.v, motion.omega
    g = jnp.asarray(tree.gravity)[:, None]
    mass = dot(v, v) / 2 - dot(jnp.broadcast_to(g, v.shape), motion.origin)
    energy = _joined(mass, cross(v, w) - motion.up, times_inertia(w, w) / 2)
    return energy.reshape(1, -1, energy.shape[-1])


def _joined(mass: jax.Array, moment: jax.Array, inertia: jax.Array) -> jax.Array:
    return jnp.concatenate([mass[..., None, :], moment, inertia], axis=-2)
