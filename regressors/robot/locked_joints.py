"""The robot that is left when some joints, or some drives, are locked: links of held joints merge into their parents.

A held joint's link is merged into the link that carries it, so parameters of the remaining links mean composite
bodies. A branch that no moving joint turns is merged into what carries it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from regressors.errors import InputError
from regressors.quantities import place_of
from regressors.robot.gears import ConstantRatio
from regressors.robot.inertia import PARAMETERS_PER_LINK, Array, parameter_names, transport
from regressors.robot.robot import (
    BASE,
    Branch,
    Drive,
    Joint,
    Limits,
    Link,
    Robot,
    Structure,
    Transmission,
    transmission_of,
)
from regressors.robot.shapes import Part


def with_locked_joints(robot: Robot, moving: Sequence[int], position: Array | None = None) -> Robot:
    """Robot of the moving joints only, the others held."""  # position (n,)
    keep = sorted(set(moving))
    if not keep:
        raise InputError(f"robot {robot.name!r}: no joint moves; choose from {', '.join(robot.joint_names)}")
    return robot if len(keep) == robot.n else _reduced(robot, _held(robot, keep, position))


def with_locked_drives(robot: Robot, drives: Sequence[str]) -> Robot:
    """Robot whose named drives hold their coordinate at its value for q = 0; their joints follow the others.

    From ``z_h = C_hh q_h + C_hk q_k`` constant, ``q_h = -C_hh^-1 C_hk q_k``: behind a parallelogram a locked drive
    keeps the direction of its link, which then is a body beside the links, with the limits of its joint.
    """
    transmission = transmission_of(robot)
    C, names = transmission.coupling, [drive.name for drive in transmission.drives]
    held = sorted({place_of("drive", name, names) for name in drives})
    keep = [k for k in range(robot.n) if k not in held]
    if not keep:
        raise InputError(f"robot {robot.name!r}: every drive is locked, so no joint moves")
    if C.shape != (robot.n, robot.n) or np.linalg.matrix_rank(C[np.ix_(held, held)]) < len(held):
        raise InputError(f"robot {robot.name!r}: the locked drives {', '.join(drives)} do not fix their joints")
    motion = np.eye(robot.n)[:, keep]
    motion[held] = -np.linalg.solve(C[np.ix_(held, held)], C[np.ix_(held, keep)])
    motion[np.abs(motion) < _NOTHING] = 0.0
    state = replace(_held(robot, keep, None), motion=motion)
    rides = _rides(robot, state)[: robot.n]
    for follower in state.follow:
        below = [follower]
        for k, ride in enumerate(rides):
            below += [k] if ride.parent in below else []
        if carried := [robot.joint_names[k] for k in below if k in keep]:
            raise InputError(
                f"robot {robot.name!r}: joint {robot.joint_names[follower]} cannot follow the others and carry joint "
                f"{carried[-1]}, which moves: lock the drive of {carried[-1]} too"
            )
    return _reduced(robot, state)


def carriers(
    robot: Robot, moving: Sequence[int], position: Array | None = None
) -> tuple[tuple[int | None, Array], ...]:
    """Body that each body of the robot has become a part of, with its pose in that one's frame."""
    return tuple((ride.carrier, ride.pose) for ride in _rides(robot, _held(robot, sorted(set(moving)), position)))


_NOTHING = 1e-12  # of a joint's motion per that of another


@dataclass(frozen=True, eq=False)
class _Held:
    """Motion of all joints while some are held, ``q = N q_k + q0``."""

    keep: list[int]  # joints that move by themselves
    motion: Array  # (n, k) N
    rest: Array  # (n,) q0, zero for those that move by themselves

    @property
    def follow(self) -> list[int]:
        """Joints that are moved by others."""
        return [k for k in range(len(self.rest)) if k not in self.keep and np.any(self.motion[k])]

    def branch(self, branch: Branch) -> tuple[Array, float]:
        """Coordinate of a branch's joint: its row and its offset."""
        return branch.coupling @ self.motion, float(branch.offset + branch.coupling @ self.rest)


def _held(robot: Robot, keep: list[int], position: Array | None) -> _Held:
    rest = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper) if position is None else position
    rest = np.array(rest, dtype=float)
    rest[keep] = 0.0
    return _Held(keep, np.eye(robot.n)[:, keep], rest)


def _reduced(robot: Robot, held: _Held) -> Robot:
    if robot.closures:
        raise InputError(
            f"robot {robot.name!r}: joints of a robot with closed loops cannot be locked one by one; leave out "
            "`joints`, or read a part without loops with `tip`"
        )
    keep, rides = held.keep, _rides(robot, held)
    return robot.replace(
        joints=tuple(rides[k].joint for k in keep),
        links=tuple(_composite(robot, rides, k) for k in keep),
        limits=robot.limits.take(keep),
        transmission=_transmission(robot, held),
        structure=_structure(robot, held, rides),
        branches=tuple(_branches(robot, held, rides)),
        home=None,
        shapes=tuple(_shapes(robot, rides)),
        parents=tuple(0 if (above := rides[k].parent) is None else keep.index(above) + 1 for k in keep),
    )


@dataclass(frozen=True, eq=False)
class _Ride:
    """Where a body of the whole robot has gone."""

    carrier: int | None  # index of the body whose part it has become, its own if it moves by itself; None for the base
    pose: Array  # (4, 4) its frame in the carrier's
    parent: int | None  # carrier of the body that it sits on
    joint: Joint  # its joint, placed in the frame of that carrier


def _rides(robot: Robot, held: _Held) -> list[_Ride]:
    """Of every body of the robot, links first."""
    place = {BASE: None, **{body.name: k for k, body in enumerate(robot.bodies)}}
    coordinates = [*zip(held.motion, held.rest.tolist(), strict=True), *map(held.branch, robot.branches)]
    below = [*(k - 1 if k else None for k in robot.parents), *(place[branch.parent] for branch in robot.branches)]
    joints = [*robot.joints, *(branch.joint for branch in robot.branches)]
    rides: list[_Ride] = []
    for number, (parent, joint, (row, position)) in enumerate(zip(below, joints, coordinates, strict=True)):
        before, pose = (None, np.eye(4)) if parent is None else (rides[parent].carrier, rides[parent].pose)
        rotation, translation = pose[:3, :3] @ joint.rotation, pose[:3, :3] @ joint.translation + pose[:3, 3]
        placed = Joint(joint.name, joint.kind, rotation, translation, joint.axis)
        if np.any(row):
            rides.append(_Ride(number, np.eye(4), before, placed))
        else:
            rides.append(_Ride(before, pose @ joint.motion(position), before, placed))
    return rides


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


def _branches(robot: Robot, held: _Held, rides: list[_Ride]) -> Iterator[Branch]:
    """Links that follow, and branches that still move, each on what carries its parent now."""
    follow = [(k, held.motion[k], float(held.rest[k])) for k in held.follow]
    beside = [(k, *held.branch(branch)) for k, branch in enumerate(robot.branches, robot.n)]
    for k, row, offset in (*follow, *beside):
        if rides[k].carrier == k:
            above = rides[k].parent
            parent = BASE if above is None else robot.bodies[above].name
            yield Branch(parent, rides[k].joint, _composite(robot, rides, k), row, offset)


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


def _structure(robot: Robot, held: _Held, rides: list[_Ride]) -> Structure:
    """What is still known: of composites less, and aggregates only where no knowledge of a moving body is lost."""
    old, zero = robot.structure, _zero(robot, rides)
    moving = [k for k, ride in enumerate(rides) if ride.carrier == k]
    names = {name for k in moving for name in _names(robot, k)}
    alone = {name for k in moving if _riders(rides, k) == [k] for name in _names(robot, k)}
    equal = tuple(group for group in old.equal if set(group) <= alone)
    lost = bool(old.zero & names - zero) or any(names & set(group) for group in set(old.equal) - set(equal))
    joints = tuple(robot.joint_names[k] for k in held.keep)
    kept = not (lost or held.follow)
    return Structure(zero, equal, tuple(a for a in old.aggregates if a.joints == joints and kept))


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


def _transmission(robot: Robot, held: _Held) -> Transmission | None:
    """Drives of the joints that move, and of those that follow the limits, which hold for them as before."""
    old, follow = robot.transmission, held.follow
    if old is None:
        return None
    coupling = old.coupling @ held.motion
    coupling[np.abs(coupling) < _NOTHING] = 0.0
    drives = _drives(old, coupling, [robot.link_numbers[k] - 1 for k in held.keep])
    limits = Limits(
        *(np.append(getattr(old.limits, f.name), getattr(robot.limits, f.name)[follow]) for f in fields(Limits))
    )
    joints = tuple(Drive(robot.joint_names[k], rests=True) for k in follow)
    offset = np.append(old.offset + old.coupling @ held.rest, held.rest[follow])
    return Transmission(np.vstack([coupling, held.motion[follow]]), (*drives, *joints), limits, offset)


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
    gear = ratio * other.ratio.reference_ratio / drive.ratio.reference_ratio
    factors = {"coulomb": abs(ratio), "viscous": ratio**2, "rotor_inertia": gear**2}
    known = {name: f for name, f in factors.items() if None not in (getattr(drive, name), getattr(other, name))}
    return replace(drive, **{name: getattr(drive, name) + f * getattr(other, name) for name, f in known.items()})


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
