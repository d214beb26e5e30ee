"""A robot whose base moves: six joints without drives carry the base, which is then a link as any other.

Three slides and three hinges put the base where it is, ``R = Rz(yaw) Ry(pitch) Rx(roll)`` at x, y, z in a frame whose
z axis points up. In these coordinates the equations of a free base are those of joints,

    [Y_base; Y_joints](q, dq, ddq) theta = [J' w; tau],

with the wrench ``w = [F; N]`` that acts on the base from outside, about its origin and in its axes, and

    J' w = [R F; E' N],   omega = E (dyaw, dpitch, droll)

[Featherstone 2008, section 9.1]. Everything that knows trees of joints knows such a robot; E is singular at a pitch of
90 degrees, which `steepest` refuses.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from regressors.errors import InputError
from regressors.robot.inertia import PARAMETERS_PER_LINK, parameter_names
from regressors.robot.robot import (
    BASE,
    Drive,
    Joint,
    Limits,
    Link,
    Robot,
    Structure,
    Transmission,
    transmission_of,
)
from regressors.samples import Array

BASE_JOINTS = ("base_x", "base_y", "base_z", "base_yaw", "base_pitch", "base_roll")
_AXES = np.eye(3)[[0, 1, 2, 2, 1, 0]]
_LINK, _WORLD = "moving_base", "world"
STANDS_STILL = "stands still, as on a stand or a table"
_STEEPEST = np.deg2rad(80.0)


def with_moving_base(robot: Robot) -> Robot:
    """The robot with the six joints of `BASE_JOINTS` below its base; itself where it has them.

    The parameters of the base follow those of all other bodies, with the next number.

    Raises
    ------
    InputError
        Closed loops, or a base that is the world.
    """
    if robot.base_joints:
        return robot
    robot.check_open("a moving base")
    if robot.base is not None and robot.base.name == _WORLD:
        raise InputError(
            f"robot {robot.name!r}: its base is the world, which does not move; name the body that does as `base_link`"
        )
    count, k = len(robot.bodies), len(BASE_JOINTS)
    slides = (Joint(BASE_JOINTS[j], "prismatic", np.eye(3), np.zeros(3), _AXES[j]) for j in range(3))
    hinges = (Joint(BASE_JOINTS[j], "revolute", np.eye(3), np.zeros(3), _AXES[j]) for j in range(3, k))
    massless = tuple(Link(name, np.zeros(PARAMETERS_PER_LINK), count + 1 + j) for j, name in enumerate(BASE_JOINTS, 1))
    base = Link(_LINK, None if robot.base is None else robot.base.theta, count + 1)
    own = (replace(link, number=number) for link, number in zip(robot.links, robot.link_numbers, strict=True))
    zero = {name for link in massless[:-1] for name in parameter_names(link.number)}
    return robot.replace(
        joints=(*slides, *hinges, *robot.joints),
        links=(*massless[:-1], base, *own),
        limits=_joined(Limits.none(k), robot.limits),
        transmission=_transmission(transmission_of(robot)),
        gravity=np.array([0.0, 0.0, -np.linalg.norm(robot.gravity)]),
        structure=Structure(robot.structure.zero | zero, robot.structure.equal),
        branches=tuple(
            replace(
                branch,
                parent=_LINK if branch.parent == BASE else branch.parent,
                link=replace(branch.link, number=number),
                coupling=np.append(np.zeros(k), branch.coupling),
            )
            for branch, number in zip(robot.branches, robot.body_numbers[robot.n :], strict=True)
        ),
        home=None,
        shapes=(),
        parents=(*range(k), *(parent + k for parent in robot.parents)),
        base_joints=BASE_JOINTS,
        base=None,
        notes=tuple(note for note in robot.notes if not note.what.startswith(STANDS_STILL)),
    )


def _joined(*parts: Limits) -> Limits:
    """Limits of coordinates one after the other."""
    return Limits(*(np.concatenate(values) for values in zip(*(vars(part).values() for part in parts), strict=True)))


def _transmission(own: Transmission) -> Transmission:
    """The drives, and behind them those of the base's joints, which rest: they have neither friction nor limits."""
    count, k = len(own.drives), len(BASE_JOINTS)
    C = scipy.linalg.block_diag(np.zeros((0, k)), own.coupling, np.zeros((k, 0)))
    C[count:, :k] = np.eye(k)
    drives = (*own.drives, *(Drive(name, rests=True) for name in BASE_JOINTS))
    return Transmission(C, drives, _joined(own.limits, Limits.none(k)), np.append(own.offset, np.zeros(k)))


def steepest(source: str, time: Array, pitch: Array) -> None:
    """Refuse a base that pitches so far that yaw and roll are about one axis."""  # time, pitch (N,)
    k = int(np.argmax(np.abs(pitch)))
    if abs(pitch[k]) > _STEEPEST:
        raise InputError(
            f"{source}: the base pitches by {np.rad2deg(pitch[k]):.0f} degrees at {time[k]:.4g} s, where yaw and roll "
            "are about nearly the same axis; use the rows before (`rows`), or state all poses in a frame that is "
            "turned by 90 degrees about x or y, and `gravity` in it"
        )


def turning_axes(q: Array) -> Array:
    """``E`` of ``omega = E (dyaw, dpitch, droll)``, in the axes of the base, shape (N, 3, 3)."""
    # q (N, 3): yaw, pitch, roll
    (_, pitch, roll), zero = q.T, np.zeros(len(q))
    sp, cp, sr, cr = np.sin(pitch), np.cos(pitch), np.sin(roll), np.cos(roll)
    return np.array([[-sp, zero, zero + 1.0], [cp * sr, cr, zero], [cp * cr, -sr, zero]]).transpose(2, 0, 1)
