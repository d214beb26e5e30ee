"""Regressor of one rigid body: the wrench that its motion requires, linear in its ten parameters."""

from __future__ import annotations

import casadi as ca


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
