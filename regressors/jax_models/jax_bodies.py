"""Bodies of a robot and their regressor in JAX.

Branches are bodies like the links: body k is attached to its parent by its own joint, at the coordinate
``s = G q + s0`` (for a link its own joint's). Velocities and accelerations are sums over a body's ancestors, so only
the rotations are built one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from regressors.jax_models.jax_drives import cross, dot, product, times_inertia, turned, turned_back
from regressors.robot.inertia import skew
from regressors.robot.robot import BASE, Robot
from regressors.samples import Array, Index


def effort(l: jax.Array, s: jax.Array, w: jax.Array, dw: jax.Array, a: jax.Array) -> jax.Array:
    """``l'F + s'N`` of a body per parameter, with F and N of [KD96] eq. (8), (9).

    ``F = m a + (dw x + w x w x) mc`` and ``N = mc x a + I dw + w x I w``, so the ten values are ``l'a``,
    ``l x dw + (l x w) x w + a x s`` and ``s'[. dw] + (s x w)'[. w]``.
    """  # l, s (..., 3, L); w, dw, a (..., 3, L)
    moment = cross(l, dw) + cross(cross(l, w), w) + cross(a, s)
    inertia = times_inertia(s, dw) + times_inertia(cross(s, w), w)
    return _joined(dot(l, a), moment, inertia)


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


@dataclass(frozen=True, eq=False)
class KinematicTree:
    """Constants of the B bodies of a robot with n joints, links first."""

    parent: Index  # (B,) body that carries each; B for the base
    ancestors: Array  # (B, B) 1 where the joint of body j moves body k, else 0
    coupling: Array  # (B, n) ``s = G q + s0`` [rad or m]
    offset: Array  # (B, n)
    turn: Array  # (3, B, 3, 3) constant, sine and versine part of each rotation in the parent's frame
    shift: Array  # (B, 3) origin in the parent's frame at s = 0 [m], and its displacement per unit of s
    slide: Array  # (B, 3)
    axis: Array  # (B, 3) joint axis in the body's own frame
    revolute: Array  # (B,) 1 for a revolute joint, 0 for a prismatic one
    gravity: Array  # (3,) in the base frame [m/s^2]

    @property
    def pairs(self) -> tuple[Index, Index]:
        """Every joint j and body k that it moves: arrays of j and of k."""
        body, joint = np.nonzero(self.ancestors)
        return joint, body


def tree_of(robot: Robot) -> KinematicTree:
    """The robot's links and branches as one tree."""
    joints = [*robot.joints, *(branch.joint for branch in robot.branches)]
    B, n = len(joints), robot.n
    place = {BASE: B, **{body.name: k for k, body in enumerate(robot.bodies)}}
    parent = np.array([*(k - 1 if k else B for k in robot.parents), *(place[b.parent] for b in robot.branches)])
    ancestors = np.eye(B + 1)
    for k in range(B):
        ancestors[k] += ancestors[parent[k]]
    revolute = np.array([joint.kind == "revolute" for joint in joints], dtype=float)
    R, K = np.array([joint.rotation for joint in joints]), np.array([skew(joint.axis) for joint in joints])
    axis = np.array([joint.axis for joint in joints])
    turns = revolute[:, None, None]
    return KinematicTree(
        parent,
        ancestors[:B, :B],
        np.vstack([np.eye(n), *(branch.coupling for branch in robot.branches)]),
        np.array([0.0] * n + [branch.offset for branch in robot.branches]),
        np.array([R, R @ K * turns, R @ K @ K * turns]),
        np.array([joint.translation for joint in joints]),
        np.einsum("bij,bj,b->bi", R, axis, 1.0 - revolute),
        axis,
        revolute,
        robot.gravity,
    )


@dataclass(frozen=True)
class TreeMotion:
    """Motion of every body at L instants."""

    R: jax.Array  # (B, 3, 3, L) axes of the body's frame in the base frame
    origin: jax.Array  # (B, 3, L) origin of the body's frame in the base frame [m]
    e: jax.Array  # (B, 3, L) joint axis in the base frame
    # (B, 3, L) angular velocity and acceleration, velocity of the origin, its acceleration less gravity, and gravity,
    # all in the axes of the body's frame [rad/s, rad/s^2, m/s, m/s^2, m/s^2]
    omega: jax.Array
    domega: jax.Array  # (B, 3, L)
    v: jax.Array  # (B, 3, L)
    a: jax.Array  # (B, 3, L)
    up: jax.Array  # (B, 3, L)


def tree_motion(tree: KinematicTree, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> TreeMotion:
    """Motion of every body from that of the robot's joints."""  # q, dq, ddq (n, L)
    s, ds, dds = (_coordinates(tree.coupling, x)[:, None] for x in (q, dq, ddq))
    R, origin, d = _poses(tree, s[:, 0] + tree.offset[:, None])
    e = turned(R, jnp.asarray(tree.axis)[..., None])
    r = jnp.asarray(tree.revolute)[:, None, None]
    p = 1.0 - r
    # in the base frame: contributions of the joints, summed over the ancestors of a body
    omega = _summed(tree, r * e * ds)
    domega = _summed(tree, r * (e * dds + cross(omega, e * ds)))
    w, dw = (jnp.concatenate([x, jnp.zeros_like(x[:1])])[tree.parent] for x in (omega, domega))  # of the parents
    v = _summed(tree, cross(w, d) + p * e * ds)
    a = _summed(tree, cross(dw, d) + cross(w, cross(w, d)) + p * (e * dds + 2 * cross(w, e * ds)))
    g = jnp.asarray(tree.gravity)[:, None]
    own = (turned_back(R, x) for x in (omega, domega, v, a - g, jnp.broadcast_to(g, origin.shape)))
    return TreeMotion(R, origin, e, *own)


def _coordinates(coupling: Array, x: jax.Array) -> jax.Array:
    return x if np.array_equal(coupling, np.eye(*coupling.shape)) else jnp.asarray(coupling) @ x


def _poses(tree: KinematicTree, s: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Rotations, origins, and displacements from each parent's origin, in the base frame; `s` has shape (B, L)."""
    constant, sine, versine = jnp.asarray(tree.turn)[..., None]
    local = constant + sine * jnp.sin(s)[:, None, None] + versine * (1.0 - jnp.cos(s))[:, None, None]
    shift = jnp.asarray(tree.shift)[..., None] + jnp.asarray(tree.slide)[..., None] * s[:, None]
    R: list[jax.Array] = []
    for k, parent in enumerate(tree.parent):
        R.append(local[k] if parent == len(tree.parent) else product(R[parent], local[k]))
    rotations = jnp.stack(R)
    eye = jnp.broadcast_to(jnp.eye(3)[..., None], (1, *rotations.shape[1:]))
    d = turned(jnp.concatenate([rotations, eye])[tree.parent], shift)
    return rotations, _summed(tree, d), d


def _summed(tree: KinematicTree, x: jax.Array) -> jax.Array:
    """Sum over each body's ancestors and itself, shape (B, 3, L)."""
    return jnp.tensordot(jnp.asarray(tree.ancestors), x, axes=1)
