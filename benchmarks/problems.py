"""The two common problems, P1 (Panda) and P2 (UR10), and what other systems reach on them.

T = 10 s, 5 harmonics, at rest at both ends; inertial base parameters, SI, unscaled; judged at 1001 instants (100 Hz).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from importlib.metadata import distribution
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from regressors.robot.robot import Robot

PERIOD, HARMONICS, RATE = 10.0, 5, 100.0
#: Options of the common problems, of those of the paper and of the public ones: nothing is in the way of the robot.
FREE_SPACE = {"floor": "none", "self_collision": False}
_ROBOTS = "cmeel.prefix/share/example-robot-data/robots"

#: Base columns and what else counts: the name, and whether ``sign(dq_j)`` and ``dq_j`` are columns too.
CONVENTIONS = {
    "gautier": False,
    "pivoted": False,
    "pivoted-lapack": False,
    "orthonormal": False,
    "friction": True,
    "friction-lapack": True,
}


@dataclass(frozen=True)
class Problem:
    """One arm with its limits.

    Parameters
    ----------
    name, title : str
    urdf : str
        Below the folder of example-robot-data's robots.
    tip : str
        Last link; what hangs behind it is merged into the last moving link.
    lower, upper, velocity, acceleration : tuple of float
        Per joint [rad, rad/s, rad/s^2].
    others, prototype : dict of str to float
        Lowest condition numbers measured side by side, per convention: of four other systems, and of the best of 40
        starts of this project's prototype.
    """

    name: str
    title: str
    urdf: str
    tip: str
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    others: dict[str, float] = field(default_factory=dict)
    prototype: dict[str, float] = field(default_factory=dict)

    @property
    def path(self) -> Path:
        """The URDF, from the installed package example-robot-data."""
        return Path(str(distribution("example-robot-data").locate_file(f"{_ROBOTS}/{self.urdf}")))

    def bounds(self, derivative: int) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds on position (0), velocity (1) or acceleration (2), shape (n,) each."""
        if derivative == 0:
            return np.array(self.lower), np.array(self.upper)
        bound = np.array((self.velocity, self.acceleration)[derivative - 1])
        return -bound, bound

    def robot(self) -> Robot:
        """The arm as this project reads it, with the limits of the problem."""
        from regressors.readers.urdf import read_urdf

        robot = read_urdf(self.path, tip=self.tip)
        limits = replace(
            robot.limits,
            lower=np.array(self.lower),
            upper=np.array(self.upper),
            velocity=np.array(self.velocity),
            acceleration=np.array(self.acceleration),
        )
        return robot.replace(limits=limits)


_PI2 = 2 * math.pi

PROBLEMS = {
    "P1": Problem(
        name="P1",
        title="P1, Panda, 7 axes, 43 base parameters",
        urdf="panda_description/urdf/panda.urdf",
        tip="panda_hand",
        lower=(-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
        upper=(2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
        velocity=(2.175,) * 4 + (2.61,) * 3,
        acceleration=(15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
        others={"gautier": 10.3, "pivoted": 12.1, "orthonormal": 6.43, "friction": 36.0},
        prototype={"gautier": 8.63, "pivoted": 11.7, "orthonormal": 6.00, "friction": 30.3},
    ),
    "P2": Problem(
        name="P2",
        title="P2, UR10, 6 axes, 36 base parameters",
        urdf="ur_description/urdf/ur10_robot.urdf",
        tip="ee_link",
        lower=(-_PI2, -_PI2, -math.pi, -_PI2, -_PI2, -_PI2),
        upper=(_PI2, _PI2, math.pi, _PI2, _PI2, _PI2),
        velocity=(2.16, 2.16, 3.15, 3.2, 3.2, 3.2),
        acceleration=(15.0,) * 6,
        others={"gautier": 10.7, "pivoted": 7.67, "orthonormal": 7.07, "friction": 37.0},
        prototype={"gautier": 7.26, "pivoted": 7.41, "orthonormal": 5.66, "friction": 27.6},
    ),
}


def known(problem: Problem, convention: str) -> dict[str, float]:
    """Lowest values of the others and of the prototype; in pivoted columns theirs are in a set that LAPACK found."""
    name = convention.removesuffix("-lapack")
    return {"others": problem.others[name], "prototype": problem.prototype[name]}
