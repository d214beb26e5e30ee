"""The robot that is left when some joints are locked: their links merge into their parents.

A held joint's link is merged into the link before it, so parameters of the remaining links mean the composite bodies.
A branch that no moving joint turns is merged into what carries it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from regressors.errors import InputError
from regressors.robot.gears import ConstantRatio
from regressors.robot.inertia import PARAMETERS_PER_LINK, Array, parameter_names, transport
from regressors.robot.robot import BASE, Branch, Drive, Joint, Link, Robot, Structure, Transmission, transmission_of
from regressors.robot.shapes import Part


def with_locked_joints(robot: Robot, moving: Sequence[int], position: Array | None = None) -> Robot:
    """Robot of the moving joints only, the others held."""  # position (n,)
    keep = sorted(set(moving))
    if not keep:
        raise InputError(f"robot {robot.name!r}: no joint moves; choose from {', '.join(robot.joint_names)}")
    if len(keep) == robot.n:
        return robot
    rest = _resting(robot, position)
    rides = _rides(robot, keep, rest)
    return robot.replace(
        joints=tuple(rides[k].joint for k in keep),
        links=tuple(_composite(robot, rides, k) for k in keep),
        limits=robot.limits.take(keep),
        transmission=_transmission(robot, keep, rest),
        structure=_structure(robot, keep, rides),
        branches=tuple(_branches(robot, keep, rest, rides)),
        home=None,
        shapes=tuple(_shapes(robot, rides)),
    )


def carriers(
    robot: Robot, moving: Sequence[int], position: Array | None = None
) -> tuple[tuple[int | None, Array], ...]:
    """Body that each body of the robot has become a part of, with its pose in that one's frame."""
    return tuple((ride.carrier, ride.pose) for ride in _rides(robot, sorted(set(moving)), _resting(robot, position)))


def _resting(robot: Robot, position: Array | None) -> Array:
    rest = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper) if position is None else position
    return np.asarray(rest, dtype=float)


@dataclass(frozen=True, eq=False)
class _Ride:
    """Where a body of the whole robot has gone."""

    carrier: int | None  # index of the body whose part it has become, its own if it moves by itself; None for the base
    pose: Array  # (4, 4) its frame in the carrier's
    parent: int | None  # carrier of the body that it sits on
    joint: Joint  # its joint, placed in the frame of that carrier


def _rides(robot: Robot, keep: list[int], rest: Array) -> list[_Ride]:
    """Of every body of the robot, links first."""
    place = {BASE: None, **{body.name: k for k, body in enumerate(robot.bodies)}}
    steps: list[tuple[int | None, Joint, bool, float]] = [
        *((k - 1 if k else None, joint, k in keep, float(rest[k])) for k, joint in enumerate(robot.joints)),
        *((place[b.parent], b.joint, bool(np.any(b.coupling[keep])), _offset(b, keep, rest)) for b in robot.branches),
    ]
    rides: list[_Ride] = []
    for number, (parent, joint, moves, position) in enumerate(steps):
        before, pose = (None, np.eye(4)) if parent is None else (rides[parent].carrier, rides[parent].pose)
        rotation, translation = pose[:3, :3] @ joint.rotation, pose[:3, :3] @ joint.translation + pose[:3, 3]
        placed = Joint(joint.name, joint.kind, rotation, translation, joint.axis)
        if moves:
            rides.append(_Ride(number, np.eye(4), before, placed))
        else:
            rides.append(_Ride(before, pose @ joint.motion(position), before, placed))
    return rides


def _offset(branch: Branch, keep: list[int], rest: Array) -> float:
    """Coordinate of a branch's joint where the moving joints are at zero."""
    held = np.setdiff1d(np.arange(rest.size), keep)
    return float(branch.offset + branch.coupling[held] @ rest[held])


def _riders(rides: list[_Ride], carrier: int) -> list[int]:
    return [k for k, ride in enumerate(rides) if ride.carrier == carrier]


def _names(robot: Robot, body: int) -> tuple[str, ...]:
    return parameter_names(robot.body_numbers[body])


def _composite(robot: Robot, rides: list[_Ride], carrier: int) -> Link:
    """Body together with all that it carries; unknown if one of them is."""
    body, theta = robot.bodies[carrier], np.zeros(PARAMETERS_PER_LINK)
    for k in _riders(rides, carrier):
        part, pose = robot.bodies[k].theta, rides[k].pose
        if part is None:
            return Link(body.name, None, robot.body_numbers[carrier])
        theta += transport(pose[:3, :3], pose[:3, 3]) @ part
    return Link(body.name, theta, robot.body_numbers[carrier])


def _branches(robot: Robot, keep: list[int], rest: Array, rides: list[_Ride]) -> list[Branch]:
    """Branches that still move, each on what carries its parent now."""
    branches = []
    for k, branch in enumerate(robot.branches, robot.n):
        if rides[k].carrier == k:
            above = rides[k].parent
            parent = BASE if above is None else robot.bodies[above].name
            link, row = _composite(robot, rides, k), branch.coupling[keep]
            branches.append(Branch(parent, rides[k].joint, link, row, _offset(branch, keep, rest)))
    return branches


def _shapes(robot: Robot, rides: list[_Ride]) -> Iterator[Part]:
    """Capsules, each on what carries its link now."""
    ride_of = {body.name: ride for body, ride in zip(robot.bodies, rides, strict=True)}
    for part in robot.shapes:
        ride = ride_of.get(part.link)
        if ride is None:
            yield part
        else:
            carrier = BASE if ride.carrier is None else robot.bodies[ride.carrier].name
            yield Part(carrier, part.capsule.moved(ride.pose))


def _structure(robot: Robot, keep: list[int], rides: list[_Ride]) -> Structure:
    """What is still known: of composites less, and aggregates only where no knowledge of a moving body is lost."""
    old, zero = robot.structure, _zero(robot, rides)
    moving = [k for k, ride in enumerate(rides) if ride.carrier == k]
    names = {name for k in moving for name in _names(robot, k)}
    alone = {name for k in moving if _riders(rides, k) == [k] for name in _names(robot, k)}
    equal = tuple(group for group in old.equal if set(group) <= alone)
    lost = bool(old.zero & names - zero) or any(names & set(group) for group in set(old.equal) - set(equal))
    joints = tuple(robot.joint_names[k] for k in keep)
    return Structure(zero, equal, tuple(a for a in old.aggregates if a.joints == joints and not lost))


def _zero(robot: Robot, rides: list[_Ride]) -> frozenset[str]:
    """Parameters of the composites that vanish because all do that they are made of."""
    zero: set[str] = set()
    for carrier in (k for k, ride in enumerate(rides) if ride.carrier == k):
        possible = np.zeros(PARAMETERS_PER_LINK, dtype=bool)
        for k in _riders(rides, carrier):
            X = transport(rides[k].pose[:3, :3], rides[k].pose[:3, 3])
            free = np.array([name not in robot.structure.zero for name in _names(robot, k)])
            possible |= np.abs(X) @ free.astype(float) > 1e-12
        zero |= {name for name, may in zip(_names(robot, carrier), possible, strict=True) if not may}
    return frozenset(zero)


def _transmission(robot: Robot, keep: list[int], rest: Array) -> Transmission | None:
    old = robot.transmission
    if old is None:
        return None
    held = np.setdiff1d(np.arange(robot.n), keep)
    coupling = old.coupling[:, keep]
    drives = _drives(old, coupling, [robot.link_numbers[k] - 1 for k in keep])
    return Transmission(coupling, drives, old.limits, old.offset + old.coupling[:, held] @ rest[held])


def _drives(transmission: Transmission, coupling: Array, own: list[int]) -> tuple[Drive, ...]:
    """Drives with what turns along with each; `own` are those of the moving joints.

    One that turns in proportion to another, ``dz_k = a dz``, cannot be told apart from it: its friction and its rotor
    count with that one's, ``F_c + |a| F_c,k``, ``F_v + a^2 F_v,k`` and ``n^2 Ia + a^2 n_k^2 Ia_k``, if both state the
    same of their friction and their rotors are behind constant ratios.
    """
    drives, turning = list(transmission.drives), list[int]()
    for k in sorted(range(len(drives)), key=lambda k: (k not in own, k)):
        drive, row = drives[k], coupling[k]
        if drive.rests or not np.any(row):
            drives[k] = replace(drive, rests=True)
            continue
        alike = (m for m in turning if np.linalg.matrix_rank(np.array([row, coupling[m]])) == 1)
        into = next((m for m in alike if _counts_with(drive, drives[m])), None)
        if into is None:
            turning.append(k)
        else:
            ratio = float(row @ coupling[into] / (coupling[into] @ coupling[into]))
            drives[into] = _together(drives[into], drive, ratio)
            drives[k] = replace(drive, rests=True, rotor_inertia=None, coulomb=None, viscous=None)
    return tuple(drives)


def _counts_with(drive: Drive, other: Drive) -> bool:
    """Whether what is known of a drive and of another that turns in proportion can be stated as one drive's."""
    same = all((getattr(drive, name) is None) == (getattr(other, name) is None) for name in ("coulomb", "viscous"))
    rotor = drive.rotor_inertia is None or (_constant_rotor(drive) and _constant_rotor(other))
    return same and rotor


def _together(drive: Drive, other: Drive, ratio: float) -> Drive:
    """A drive with what another adds that turns `ratio` times as fast."""
    coulomb, viscous, rotor = drive.coulomb, drive.viscous, drive.rotor_inertia
    if coulomb is not None and other.coulomb is not None:
        coulomb += abs(ratio) * other.coulomb
    if viscous is not None and other.viscous is not None:
        viscous += ratio**2 * other.viscous
    if rotor is not None and other.rotor_inertia is not None:
        gear = ratio * other.ratio.reference_ratio / drive.ratio.reference_ratio
        rotor += gear**2 * other.rotor_inertia
    return replace(drive, coulomb=coulomb, viscous=viscous, rotor_inertia=rotor)


def _constant_rotor(drive: Drive) -> bool:
    return drive.rotor_inertia is not None and isinstance(drive.ratio, ConstantRatio)


UNKNOWN = math.nan


def with_joint_rotors(robot: Robot) -> Robot:
    """The robot with a rotor on every drive, of unknown inertia where the description has none.

    Without a transmission each joint gets a drive of ratio 1: its ``Ia`` is what the rotor's inertia amounts to at the
    joint, ``Ia = ratio^2 x inertia of the rotor`` [kg m^2].
    """
    old = transmission_of(robot)
    drives = tuple(d if d.rotor_inertia is not None else replace(d, rotor_inertia=UNKNOWN) for d in old.drives)
    return robot.replace(transmission=replace(old, drives=drives))
