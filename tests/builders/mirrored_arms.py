"""Two mirrored arms of three joints on a torso that stands still, and logs of them by Pinocchio."""

from __future__ import annotations

import numpy as np
from motions import random_sines
from pinocchio_chains import joint_torques

import excite
from regressors.robot.inertia import from_centre_of_mass
from regressors.robot.robot import Joint, Limits, Link, Robot
from regressors.samples import Array, Samples

MIRROR = np.kron([[0, 1], [1, 0]], np.diag([-1.0, 1.0, 1.0]))  # q of the mirror image, in the plane y = 0
ALONE = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])  # the left arm moves
BOTH = ALONE + ALONE @ MIRROR  # and the right one as its mirror image
_PARTS = (  # name, axis, place of the joint with y outwards, mass, centre likewise, diagonal of the inertia about it
    ("shoulder", (1.0, 0.0, 0.0), (0.0, 0.25, 0.3), 1.5, (0.01, 0.05, 0.01), (0.010, 0.012, 0.011)),
    ("upper", (0.0, 1.0, 0.0), (0.0, 0.1, 0.0), 2.0, (0.14, 0.02, 0.02), (0.010, 0.030, 0.030)),
    ("fore", (0.0, 1.0, 0.0), (0.3, 0.0, 0.0), 1.0, (0.12, 0.01, 0.01), (0.004, 0.012, 0.012)),
)


def arms(heavier: float = 1.0) -> Robot:
    """Both arms; the right forearm as many times as heavy as the left one."""
    joints, links = list[Joint](), list[Link]()
    for side, flip in (("left", (1.0, 1.0, 1.0)), ("right", (1.0, -1.0, 1.0))):
        for part, axis, place, mass, centre, inertia in _PARTS:
            theta = from_centre_of_mass(mass, np.multiply(flip, centre), np.diag(inertia))
            links.append(Link(f"{side}_{part}", theta * (heavier if (side, part) == ("right", "fore") else 1.0)))
            at = np.multiply(flip, place)
            joints.append(Joint(f"{side}_{part}_joint", "revolute", np.eye(3), at, np.array(axis)))
    limits = Limits(*(np.full(6, bound) for bound in (-2.0, 2.0, 4.0, 20.0, np.inf, 60.0)))
    return Robot("torso", tuple(joints), tuple(links), limits, parents=(0, 1, 2, 0, 4, 5))


def motion(P: Array | None = None) -> Samples:
    """Ten seconds in which all joints move in their own ways, or as a matrix makes of that, shape (6, 6)."""
    moves = random_sines(6, seed=5).samples(time := np.arange(0.0, 10.0, 0.005))
    return moves if P is None else Samples(time, *(x @ P for x in (moves.q, moves.dq, moves.ddq, moves.dddq)))


def log_of(robot: Robot, moves: Samples, seed: int, noise: float = 0.1) -> excite.Log:
    """What the robot measures, with the same friction in all joints and white noise of the torques [Nm]."""
    tau = joint_torques(robot, moves) + 0.3 * np.sign(moves.dq) + 0.2 * moves.dq
    tau += noise * np.random.default_rng(seed).normal(size=tau.shape)
    return excite.Log.from_arrays(moves.time, moves.q, tau, dq=moves.dq, joints=robot.joint_names)
