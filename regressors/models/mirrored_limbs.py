"""Limbs of a tree that mirror each other, such as two arms of a torso: one set of parameters for both.

A reflection X, ``X^-1 = X``, of the body that carries two limbs takes the joints of the one to those of the other. With
the poses ``T_l, T_r`` of two links in the frames of what carries them, in the pose q = 0, and the map A between these,
the left body seen in the right one's frame is the mirror image by

    B = T_r^-1 A T_l,   A = X for the first links of the limbs, B of the links before for the others,

in every pose with ``q_r = s q_l``, if B takes the joint's axis to that of the other: s = -1 where a rotation keeps the
direction of its axis, since a mirror turns it round, s = 1 where a translation does. B is moved by the little that a
description's axes may be off, see `_NEAR`. A body that is the mirror image
then has the pseudo-inertia ``J_r = B J_l B'``, so that ``theta_r = S theta_l``. Rotors and friction are equal. Offsets
are not tied: the biases of torque sensors in them have no side.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from regressors.errors import InputError
from regressors.models.drives import drive_rows
from regressors.robot.columns import ASYMMETRY, FRICTION_KINDS, OFFSET, ROTOR, drive_column
from regressors.robot.gears import ConstantRatio, GearFunction
from regressors.robot.inertia import parameter_names, pose_of, pseudo_inertia, skew, transport
from regressors.robot.robot import BASE, Link, Robot, placed_bodies, transmission_of
from regressors.samples import Array

_EXACT = 1e-4  # rad and m: what descriptions round
_NEAR = 5e-3  # rad and m by which an axis may be off: both limbs keep their own kinematics, only bodies are tied


@dataclass(frozen=True, eq=False)
class Mirrored:
    """Two links that mirror each other, by their places among the links of the robot."""

    left: int
    right: int
    map: Array  # (4, 4) B, from the left body's frame to the right one's
    sign: float  # s of ``q_r = s q_l``
    off: float = 0.0  # by which the axes are off the mirror image [rad or m]


def with_mirrored_limbs(robot: Robot) -> Robot:
    """The robot with the parameters of mirrored limbs tied: the first of two limbs has the parameters of both.

    Raises
    ------
    InputError
        No two limbs mirror each other.
    """
    tree = _Tree(robot)
    pairs = tree.pairs()
    if not pairs:
        raise InputError(
            f"robot {robot.name!r}: `symmetric` needs two limbs that mirror each other, with axes that agree to "
            f"{_NEAR:g} m and rad, and there are none: {tree.misfit}; leave it out"
        )
    ties = dict[str, Mapping[str, float]]()
    for pair in pairs:
        names = [parameter_names(robot.body_numbers[k]) for k in (pair.left, pair.right)]
        S = transport(pair.map[:3, :3], pair.map[:3, 3])
        ties |= {right: dict(_terms(names[0], row)) for right, row in zip(names[1], S, strict=True)}
    ties |= _tied_drives(robot, pairs)
    return robot.replace(structure=replace(robot.structure, aggregates=(), mirrored=ties))


def mirrored_bodies(robot: Robot) -> tuple[str, ...]:
    """Names of the bodies that mirror each other, two in each text, and how far their axes are off."""
    return tuple(
        f"{robot.bodies[pair.left].name} and {robot.bodies[pair.right].name}"
        + (f" ({1000 * pair.off:.1g} mm or mrad off)" if pair.off else "")
        for pair in _Tree(robot).pairs()
    )


def _terms(names: tuple[str, ...], row: Array) -> Iterator[tuple[str, float]]:
    size = float(np.abs(row).max())
    return ((name, float(x)) for name, x in zip(names, row, strict=True) if abs(x) > 1e-12 * size)


def _tied_drives(robot: Robot, pairs: tuple[Mirrored, ...]) -> dict[str, Mapping[str, float]]:
    """Rotors and friction of drives that move mirrored joints, by drives that move them likewise."""
    rows, drives, ties = drive_rows(robot), transmission_of(robot).drives, dict[str, Mapping[str, float]]()
    gears = dict(zip(rows, (drive.ratio for drive in drives), strict=True))
    kinds = tuple(kind for kind in FRICTION_KINDS if kind != OFFSET)
    mirror = np.zeros((robot.n, robot.n))  # takes the coordinates of left limbs to those of the right ones
    mirror[[pair.right for pair in pairs], [pair.left for pair in pairs]] = [pair.sign for pair in pairs]
    for left, row in rows.items():
        image = mirror @ row
        if np.any(row) and not np.any(row[~np.any(mirror, axis=0)]):  # of tied limbs alone
            for right, other in rows.items():
                side = next((s for s in (1.0, -1.0) if np.allclose(other, s * image, atol=_EXACT)), None)
                if side is not None:
                    signs = {kind: side if kind == ASYMMETRY else 1.0 for kind in kinds}
                    signs |= {ROTOR: 1.0} if _same_ratio(gears[left], gears[right]) else {}
                    ties |= {drive_column(right, k).name: {drive_column(left, k).name: s} for k, s in signs.items()}
    return ties


def _same_ratio(one: GearFunction, other: GearFunction) -> bool:
    constant = isinstance(one, ConstantRatio) and isinstance(other, ConstantRatio)
    return constant and one.reference_ratio == other.reference_ratio


class _Tree:
    """The bodies of a robot, and what is known of mirrored limbs among them."""

    def __init__(self, robot: Robot) -> None:
        robot.check_open("`symmetric`")
        self.robot, self._placed = robot, list(placed_bodies(robot))
        self._below: dict[str, list[int]] = {}
        for k, (_, parent, *_) in enumerate(self._placed):
            self._below.setdefault(parent, []).append(k)
        self._misfits = [(-1, "no body carries two limbs")]

    @property
    def misfit(self) -> str:
        """What keeps the limbs that mirror each other furthest from doing so."""
        return max(self._misfits, key=lambda one: one[0])[1]

    def pairs(self) -> tuple[Mirrored, ...]:
        """Bodies of all mirrored limbs: of each body that carries some, by the plane that mirrors most of them."""
        found: list[Mirrored] = []
        for carrier in (BASE, *(name for name, *_ in self._placed)):
            limbs = self._below.get(carrier, [])
            mirrored = {self._placed[k][0] for pair in found for k in (pair.left, pair.right)}
            if len(limbs) > 1 and carrier not in mirrored:
                most = max((self._paired(limbs, X) for X in self._planes(limbs)), key=self._merit)
                found += most
        return tuple(sorted(found, key=lambda pair: (pair.left, pair.right)))

    def _planes(self, limbs: list[int]) -> Iterator[Array]:
        """Reflections at the planes y, x, z = 0 of the carrier, and at those midway between two of its joints."""
        for k in (1, 0, 2):
            yield _reflection(np.eye(3)[k], np.zeros(3))
        origins = [self._placed[k][2].translation for k in limbs]
        for a, b in combinations(origins, 2):
            if (apart := float(np.linalg.norm(b - a))) > _EXACT:
                yield _reflection((b - a) / apart, (a + b) / 2)

    def _merit(self, pairs: list[Mirrored]) -> tuple[int, float]:
        """How many bodies are paired, and how little their descriptions differ."""
        return len(pairs), -sum(map(self._difference, pairs))

    def _difference(self, pair: Mirrored) -> float:
        """Share of the described pseudo-inertia by which the right body differs from the mirrored left one."""
        left, right = (_pseudo_inertia(self.robot.bodies[k]) for k in (pair.left, pair.right))
        scale = np.sqrt(np.maximum(np.diag(right), 0.0))
        if not np.all(scale > 0):
            return 0.0
        return float(np.linalg.norm((pair.map @ left @ pair.map.T - right) / np.outer(scale, scale)))

    def _paired(self, limbs: list[int], X: Array) -> list[Mirrored]:
        """Bodies of the limbs of a carrier that a reflection takes to each other."""
        found, left = list[Mirrored](), list(limbs)
        while left:
            found += self._nearest(left.pop(0), left, X, 0)
        return found

    def _nearest(self, limb: int, others: list[int], A: Array, depth: int) -> list[Mirrored]:
        """Bodies of a limb and of that of some others which mirrors it best and is taken out; none where none does."""
        tried = [self._limb(limb, other, A, depth) for other in others]
        best = max(tried, key=self._merit, default=[])
        if best:
            others.remove(best[0].right)
        return best

    def _limb(self, left: int, right: int, A: Array, depth: int) -> list[Mirrored]:
        """Bodies of two limbs, from a body of each outwards; none where they do not mirror each other."""
        (one, _, joint, *_), (two, _, other, *_) = self._placed[left], self._placed[right]
        T_l, T_r = (pose_of(placed.rotation, placed.translation) for placed in (joint, other))
        B = np.linalg.inv(T_r) @ A @ T_l
        turned, beside = B[:3, :3] @ joint.axis, B[:3, 3] - other.axis * (other.axis @ B[:3, 3])
        along = float(np.sign(turned @ other.axis))
        beside *= joint.kind == "revolute"
        off = np.linalg.norm(turned - along * other.axis), np.linalg.norm(beside)
        limbs = (self._below.get(one, []), self._below.get(two, []))
        where, wrong = f"joints {joint.name} and {other.name}", ""
        if max(left, right) >= self.robot.n:
            wrong = f"{one} or {two} moves along with other joints"
        elif joint.kind != other.kind:
            wrong = f"{where} are {joint.kind} and {other.kind}"
        elif max(off) > _NEAR:
            wrong = f"{where} are off the mirror image by {off[0]:.3g} rad and {off[1]:.3g} m"
        elif len(limbs[0]) != len(limbs[1]):
            wrong = f"{one} carries {len(limbs[0])} moving bodies, and {two} {len(limbs[1])}"
        if wrong:
            self._misfits.append((depth, wrong))
            return []
        B = _rounded(pose_of(_turn(turned, along * other.axis) @ B[:3, :3], B[:3, 3] - beside))
        sign, off_by = (-along if joint.kind == "revolute" else along), float(max(off) * (max(off) > _EXACT))
        found, rest = [Mirrored(left, right, B, sign, off_by)], list(limbs[1])
        for k in limbs[0]:
            below = self._nearest(k, rest, B, depth + 1)
            if not below:
                return []
            found += below
        return found


def _reflection(normal: Array, point: Array) -> Array:
    """``x -> x - 2 n n' (x - p)``, shape (4, 4)."""
    return pose_of(np.eye(3) - 2 * np.outer(normal, normal), 2 * normal * (normal @ point))


def _turn(a: Array, b: Array) -> Array:
    """The smallest rotation that takes a unit vector to another near it."""
    K = skew(np.cross(a, b))
    return np.asarray(np.eye(3) + K + K @ K / (1.0 + a @ b))


def _rounded(B: Array) -> Array:
    """A map without what the description's rounding leaves of zeros and ones."""
    return np.where(np.abs(B - np.round(B)) < _EXACT, np.round(B), B) + 0.0


def _pseudo_inertia(body: Link) -> Array:
    return np.zeros((4, 4)) if body.theta is None else pseudo_inertia(body.theta)
