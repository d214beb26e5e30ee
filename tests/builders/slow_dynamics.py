"""Slow, obvious dynamics of a serial chain, made from homogeneous matrices only [Uicker 1965]: the tests' oracle.

It shares nothing with `regressors.robot.symbolic.kinematics`: a link's pose is ``T_i = A_1(q_1) ... A_i(q_i)``, its
mass distribution ``J = int [x; 1] [x; 1]' dm``; by Lagrange's equation
``tau_j = sum_i tr(dT_i/dq_j J_i (ddT_i - G)')``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from regressors.models.load import EQUATIONS, Sensor
from regressors.readers.library import built_in
from regressors.robot.gears import GearFunction
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Drive, Joint, Limits, Link, Robot, Structure, Transmission


def cross_matrix(v: np.ndarray) -> np.ndarray:
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def mass_matrix_of_body(theta: np.ndarray) -> np.ndarray:
    """``J`` of a body with parameters (m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz), entry by entry."""
    m, mx, my, mz, xx, xy, xz, yy, yz, zz = theta
    return np.array(
        [
            [(yy + zz - xx) / 2, -xy, -xz, mx],
            [-xy, (xx + zz - yy) / 2, -yz, my],
            [-xz, -yz, (xx + yy - zz) / 2, mz],
            [mx, my, mz, m],
        ]
    )


def joint_matrix(joint: Joint, q: complex, derivative: int = 0) -> np.ndarray:
    """``A(q)`` or one of its derivatives with respect to q; q may be complex."""
    A = np.zeros((4, 4), dtype=complex)
    K = cross_matrix(joint.axis)
    if joint.kind == "revolute":
        shift = derivative * np.pi / 2
        turn = np.sin(q + shift) * K - np.cos(q + shift) * K @ K
        if derivative == 0:
            turn = turn + np.eye(3) + K @ K
        A[:3, :3] = joint.rotation @ turn
    elif derivative == 0:
        A[:3, :3] = joint.rotation
        A[:3, 3] = joint.rotation @ (joint.axis * q)
    elif derivative == 1:
        A[:3, 3] = joint.rotation @ joint.axis
    if derivative == 0:
        A[:3, 3] += joint.translation
        A[3, 3] = 1.0
    return A


def poses(robot: Robot, q: np.ndarray, j: int | None = None) -> list[np.ndarray]:
    """``T_i`` of every link, shape (4, 4), or ``dT_i/dq_j``: the chain's product with A_j differentiated."""
    T, found = np.eye(4), []
    for k, (joint, position) in enumerate(zip(robot.joints, q, strict=True)):
        T = T @ joint_matrix(joint, position, 1 if k == j else 0)
        found.append(np.zeros((4, 4)) if j is not None and k < j else T)
    return found


def pose_rates(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """``dT_i/dt`` and ``d2T_i/dt2`` by the product rule."""
    T, dT, ddT, found = np.eye(4), np.zeros((4, 4)), np.zeros((4, 4)), []
    for joint, position, rate, growth in zip(robot.joints, q, dq, ddq, strict=True):
        A, A1, A2 = (joint_matrix(joint, position, d) for d in range(3))
        dA, ddA = A1 * rate, A2 * rate**2 + A1 * growth
        T, dT, ddT = T @ A, dT @ A + T @ dA, ddT @ A + 2 * dT @ dA + T @ ddA
        found.append((dT, ddT))
    return found


def gravity_matrix(robot: Robot) -> np.ndarray:
    G = np.zeros((4, 4))
    G[:3, 3] = robot.gravity
    return G


def torques(robot: Robot, thetas: np.ndarray, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """Joint torques by Lagrange's equation; ``thetas`` has one row of ten parameters per link."""
    J = [mass_matrix_of_body(theta) for theta in thetas]
    bent = [ddT - gravity_matrix(robot) for _, ddT in pose_rates(robot, q, dq, ddq)]
    tau = [sum(np.trace(P @ J_i @ B.T) for P, J_i, B in zip(poses(robot, q, j), J, bent, strict=True))
           for j in range(robot.n)]  # fmt: skip
    return np.real(tau)


def random_body(rng: np.random.Generator) -> np.ndarray:
    """Ten parameters of a body made of eight random point masses: physically possible by construction."""
    m, r = rng.uniform(0.1, 2.0, 8), rng.normal(0.0, 0.3, (8, 3))
    tensor = sum(mass * (p @ p * np.eye(3) - np.outer(p, p)) for mass, p in zip(m, r, strict=True))
    return np.concatenate([[m.sum()], m @ r, tensor[np.triu_indices(3)]])


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(R))
    return Q * np.linalg.det(Q)


def random_chain(kinds: str, rng: np.random.Generator) -> Robot:
    """A chain of revolute (``r``) and prismatic (``p``) joints with random frames, axes, bodies and gravity."""
    names = {"r": "revolute", "p": "prismatic"}
    joints = []
    for k, kind in enumerate(kinds):
        axis = rng.normal(size=3)
        placement = random_rotation(rng), rng.normal(0.0, 0.5, 3)
        joints.append(Joint(f"j{k + 1}", names[kind], *placement, axis / np.linalg.norm(axis)))
    links = tuple(Link(f"link{k + 1}", random_body(rng)) for k in range(len(kinds)))
    return Robot("chain", tuple(joints), links, Limits.none(len(kinds)), gravity=rng.normal(0.0, 5.0, 3))


@cache
def three_axes() -> Robot:
    """The IRp-6 in the paper's 13 parameters."""
    return with_locked_joints(built_in("irp6"), [0, 1, 2])


def general(robot: Robot) -> Robot:
    """The robot without what its structure says of its parameters."""
    return robot.replace(structure=Structure())


def table_energies(q: Any, dq: Any, xp: Any = np) -> list[Any]:
    """d_1 ... d_7 of [KD96] section 5.1, misprints corrected (shared/paper/errata.md), of three joints' rows."""
    (_, q2, q3), (w1, w2, w3) = ((x[0], x[1], x[2]) for x in (q, dq))
    l2, g = 0.455, 9.81
    return [
        w1**2 / 2,
        w1**2 * xp.sin(q2) ** 2 / 2,
        w2**2 / 2,
        w3**2 / 2 + w2 * w3,
        -(xp.sin(q3) ** 2 * xp.cos(2 * q2) + xp.sin(2 * q2) * xp.sin(2 * q3) / 2) * w1**2 / 2,
        l2 * xp.sin(q3) * (w2 + w3) * w2 - l2 * xp.sin(q2) * xp.cos(q2 + q3) * w1**2 + g * xp.sin(q2 + q3),
        g * xp.cos(q2),
    ]


def thetas_of(robot: Robot) -> np.ndarray:
    """Links' parameters, one row each."""
    return np.array([link.theta for link in robot.links])


def driven_chain(gears: list[GearFunction], rng: np.random.Generator, kinds: str = "rrr") -> Robot:
    """A chain whose drives move several joints each, with an offset."""
    robot = random_chain(kinds, rng)
    coupling = np.array([[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, -1.0, 1.0]])
    drives = tuple(Drive(f"d{k + 1}", gear, rotor_inertia=1e-4) for k, gear in enumerate(gears))
    offset = rng.uniform(-0.3, 0.3, 3)
    return robot.replace(transmission=Transmission(coupling, drives, Limits.none(3), offset))


@cache
def sliders() -> Robot:
    return random_chain("rprpr", np.random.default_rng(0))


ROBOTS: dict[str, Callable[[], Robot]] = {
    "irp6": lambda: built_in("irp6"),
    "panda": lambda: built_in("panda"),
    "sliders": sliders,
}


def shifted(link: str | None = None, seed: int = 0, equations: tuple[str, ...] = EQUATIONS) -> Sensor:
    """A sensor whose frame is turned and away from the link's."""
    rng = np.random.default_rng(seed)
    return Sensor(link, random_rotation(rng), rng.normal(0.0, 0.2, 3), equations)
