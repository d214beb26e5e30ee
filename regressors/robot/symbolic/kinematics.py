"""Kinematics of a tree of links and the regressor of a body as CasADi expressions.

Every vector of link i is written in the axes of frame i. All are CasADi expressions of (q, dq, ddq), so whatever is
built on them can be differentiated exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from regressors.robot.inertia import skew
from regressors.robot.robot import BASE, Branch, Joint, Robot


@dataclass(frozen=True)
class LinkMotion:
    """Motion of one link, and how each joint moves it."""

    omega: ca.SX  # (3, 1) angular velocity and acceleration [rad/s, rad/s^2]
    domega: ca.SX  # (3, 1)
    v: ca.SX  # (3, 1) velocity of the frame's origin [m/s]
    a: ca.SX  # (3, 1) acceleration of the frame's origin less gravity, ``dv - g`` [m/s^2]
    up: ca.SX  # (3, 1) gravity in the axes of this frame, ``R' g`` [m/s^2]
    rotation: ca.SX  # (3, 3) pose of the frame in the base frame [-, m]
    origin: ca.SX  # (3, 3)
    # angular and linear velocity of this frame per unit rate of joint 1, 2, ...; joints beyond the last entry do not
    # move it, nor do those of other branches, whose entries have no nonzeros
    axes: tuple[tuple[ca.SX, ca.SX], ...]


def sparse(values: ArrayLike) -> ca.SX:
    """Numbers as a sparse expression: zeros drop out of products; values close to 0, 1 and -1 become exact."""
    array = np.array(values, dtype=float)
    for exact in (0.0, 1.0, -1.0):
        array[np.abs(array - exact) < 1e-12] = exact
    return ca.sparsify(ca.SX(ca.DM(array)))


def relative_pose(joint: Joint, q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Axes and origin of a joint's link in the frame of the link that carries it, at joint position q [rad or m]."""
    R, p, axis = sparse(joint.rotation), sparse(joint.translation), sparse(joint.axis)
    if joint.kind == "prismatic":
        return R, p + ca.mtimes(R, axis) * q
    K = skew(joint.axis)
    turn = ca.SX.eye(3) + ca.sin(q) * sparse(K) + (1 - ca.cos(q)) * sparse(K @ K)
    return ca.mtimes(R, ca.sparsify(ca.simplify(turn))), p


def link_motions(robot: Robot, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> Iterator[LinkMotion]:
    """Motion of each link in turn, by the outward Newton-Euler recursion."""  # q, dq, ddq (n, 1)
    states = [_base_motion(robot)]
    for i, (joint, parent) in enumerate(zip(robot.joints, robot.parents, strict=True)):
        states.append(next_link(states[parent], joint, q[i], dq[i], ddq[i], i))
        yield states[-1]


def _base_motion(robot: Robot) -> LinkMotion:
    zero, gravity = ca.SX(3, 1), sparse(robot.gravity)
    return LinkMotion(zero, zero, zero, -gravity, gravity, ca.SX.eye(3), zero, ())


def next_link(
    parent: LinkMotion, joint: Joint, q: ca.SX, dq: ca.SX, ddq: ca.SX, place: int | None = None
) -> LinkMotion:
    """Motion of the link that a joint on another one moves, the next one unless its place among them is given."""
    # q, dq, ddq (1, 1)
    R, p = relative_pose(joint, q)
    Rt = R.T
    w, dw = parent.omega, parent.domega
    v = ca.mtimes(Rt, parent.v + ca.cross(w, p))
    a = ca.mtimes(Rt, parent.a + ca.cross(dw, p) + ca.cross(w, ca.cross(w, p)))
    w, dw = ca.mtimes(Rt, w), ca.mtimes(Rt, dw)
    axes = tuple((ca.mtimes(Rt, s), ca.mtimes(Rt, l + ca.cross(s, p))) for s, l in parent.axes)
    e, zero = sparse(joint.axis), ca.SX(3, 1)
    if place is not None:
        axes += ((zero, zero),) * (place - len(axes))
    if joint.kind == "revolute":
        dw = dw + e * ddq + ca.cross(w, e * dq)
        w = w + e * dq
        axes = (*axes, (e, zero))
    else:
        v = v + e * dq
        a = a + e * ddq + 2 * ca.cross(w, e * dq)
        axes = (*axes, (zero, e))
    pose = ca.mtimes(parent.rotation, R), parent.origin + ca.mtimes(parent.rotation, p)
    return LinkMotion(w, dw, v, a, ca.mtimes(Rt, parent.up), *pose, axes)


def bodies(robot: Robot, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> Iterator[LinkMotion]:
    """Motion of every body that has inertial parameters, in the order of their parameters."""  # q, dq, ddq (n, 1)
    carriers = {BASE: _base_motion(robot)}
    for link, motion in zip(robot.links, link_motions(robot, q, dq, ddq), strict=True):
        carriers[link.name] = motion
        yield motion
    for branch in robot.branches:
        carriers[branch.name] = _branch_motion(carriers[branch.parent], branch, q, dq, ddq)
        yield carriers[branch.name]


def _branch_motion(parent: LinkMotion, branch: Branch, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> LinkMotion:
    """Motion of a branch at ``s = coupling @ q + offset``; joint j moves it along ``axis_j + coupling_j axis_s``."""
    s, ds, dds = (ca.mtimes(sparse(branch.coupling[None]), x) for x in (q, dq, ddq))
    moved = next_link(parent, branch.joint, s + branch.offset, ds, dds)
    *through_parent, (angular, linear) = moved.axes
    entries = max(len(through_parent), int(np.flatnonzero(branch.coupling)[-1]) + 1)
    axes = through_parent + [(ca.SX(3, 1), ca.SX(3, 1))] * (entries - len(through_parent))
    for j in np.flatnonzero(branch.coupling):
        share = float(branch.coupling[j])
        axes[j] = (ca.sparsify(axes[j][0] + share * angular), ca.sparsify(axes[j][1] + share * linear))
    return replace(moved, axes=tuple(axes))


def times_inertia(w: ca.SX) -> ca.SX:
    """Matrix ``[. w]`` with ``I w = [. w] (Ixx, Ixy, Ixz, Iyy, Iyz, Izz)``, shape (3, 6) [KD96] eq. (9)."""
    x, y, z = w[0], w[1], w[2]
    zero = ca.SX(1, 1)
    return ca.vertcat(
        ca.horzcat(x, y, z, zero, zero, zero),
        ca.horzcat(zero, x, zero, y, z, zero),
        ca.horzcat(zero, zero, x, zero, y, z),
    )


def body_regressor(omega: ca.SX, domega: ca.SX, a: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Force and moment about the frame's origin that move a body, per parameter [KD96] eq. (8)-(10).

    ``F = m a + (domega x + omega x omega x) mc`` and ``N = mc x a + I domega + omega x I omega``.
    """  # omega, domega (3, 1); a (3, 1); result (3, 10)
    W = ca.skew(domega) + ca.mtimes(ca.skew(omega), ca.skew(omega))
    inertia = times_inertia(domega) + ca.mtimes(ca.skew(omega), times_inertia(omega))
    force = ca.horzcat(a, W, ca.SX(3, 6))
    moment = ca.horzcat(ca.SX(3, 1), -ca.skew(a), inertia)
    return force, moment


def effort_regressor(body: LinkMotion) -> ca.SX:
    """Torque per parameter of a body at each joint that moves it, ``l_j' F + s_j' N``, shape (joints, 10)."""
    force, moment = body_regressor(body.omega, body.domega, body.a)
    return ca.vertcat(*(ca.mtimes(linear.T, force) + ca.mtimes(angular.T, moment) for angular, linear in body.axes))
