"""The columns of a case as a CasADi function, by hand: what Pinocchio's wheel, which has no CasADi, leaves to write.

Twists are (linear, angular) in the frame of the link, and the base accelerates against gravity. Joint j's torque from
link i is the twist S_j of its axis there, times the wrench ``K_i theta_i`` of the link's motion: ``Y_ji = S_j' K_i``.
"""

from __future__ import annotations

from typing import Any

import casadi as ca  # type: ignore[import-untyped]
import irp6_model
import numpy as np
from cases import case, ur10e_model
from judge import Array, base_columns, numbers_in_pinocchio, pinocchio_model, standard_names

_SLOW = 0.02  # [rad/s] tanh(v / _SLOW) stands for the sign of velocity
_AXES = {"JointModelRX": 0, "JointModelRY": 1, "JointModelRZ": 2}


def _turn(axis: int, angle: ca.SX) -> ca.SX:
    """Rotation about a coordinate axis."""
    R = ca.SX.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[i, i] = R[j, j] = ca.cos(angle)
    R[i, j], R[j, i] = -ca.sin(angle), ca.sin(angle)
    return R


def _tensor(w: ca.SX) -> ca.SX:
    """L of ``I w = L (Ixx, Ixy, Iyy, Ixz, Iyz, Izz)``."""
    x, y, z = w[0], w[1], w[2]
    return ca.blockcat([[x, y, 0, z, 0, 0], [0, x, y, 0, z, 0], [0, 0, 0, x, y, z]])


def _wrench(a: ca.SX, w: ca.SX, dw: ca.SX) -> ca.SX:
    """K of a link: force and moment are K (m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz), shape (6, 10)."""
    of_moment = ca.skew(dw) + ca.skew(w) @ ca.skew(w)
    force = ca.horzcat(a, of_moment, ca.SX(3, 6))
    return ca.vertcat(force, ca.horzcat(ca.SX(3, 1), -ca.skew(a), _tensor(dw) + ca.skew(w) @ _tensor(w)))


def regressor(model: Any, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
    """Regressor of a chain of revolute joints, parameters in Pinocchio's order, shape (n, 10 n)."""
    n = model.nv
    Y = ca.SX(n, 10 * n)
    w, dw, a, S = ca.SX(3, 1), ca.SX(3, 1), ca.SX(-model.gravity.linear), ca.SX(6, 0)
    for i in range(n):
        place, axis = model.jointPlacements[i + 1], _AXES[model.joints[i + 1].shortname()]
        R = ca.SX(np.where(abs(place.rotation) < 1e-12, 0.0, place.rotation)) @ _turn(axis, q[i])
        r = ca.SX(place.translation)
        e = ca.SX.zeros(3)
        e[axis] = 1.0
        a = R.T @ (a + ca.cross(dw, r) + ca.cross(w, ca.cross(w, r)))
        w, dw = R.T @ w, R.T @ dw
        w, dw = w + e * dq[i], dw + e * ddq[i] + ca.cross(w, e) * dq[i]
        S = ca.vertcat(R.T @ (S[:3, :] - ca.skew(r) @ S[3:, :]), R.T @ S[3:, :])
        S = ca.horzcat(S, ca.vertcat(ca.SX(3, 1), e))
        Y[: i + 1, 10 * i : 10 * i + 10] = S.T @ _wrench(a, w, dw)
    return Y


def parts(name: str) -> tuple[Any, Array, Array | None]:
    """Pinocchio's model of a case, what selects its columns (10 n, b), and C of z = C q where friction counts."""
    if name == "IRp-6":
        return irp6_model.model()[0], np.linalg.pinv(irp6_model.aggregates()[1]), irp6_model.coupling()
    known = standard_names(len(case(name).middle))
    wanted = case(name).names if name == "ur10e" else base_columns(name)["gautier"]
    chosen = numbers_in_pinocchio(len(case(name).middle))[[known.index(each) for each in wanted if each in known]]
    model = ur10e_model()[0] if name == "ur10e" else pinocchio_model(name)[0]
    return model, np.eye(10 * model.nv)[:, chosen], np.eye(model.nv) if name == "ur10e" else None


def columns(name: str) -> ca.Function:
    """``Y(q, dq, ddq)`` of a case, shape (n, b), compiled."""
    model, selection, C = parts(name)
    state = [ca.SX.sym(letter, model.nv) for letter in ("q", "dq", "ddq")]
    Y = regressor(model, *state) @ ca.sparsify(ca.DM(selection))
    if C is not None:
        speed = C @ state[1]
        Y = ca.horzcat(Y, C.T @ ca.diag(ca.tanh(speed / _SLOW)), C.T @ ca.diag(speed))
    compiled = {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O2"]}}
    return ca.Function("Y", state, [ca.cse(Y)], compiled)
