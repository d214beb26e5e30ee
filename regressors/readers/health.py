"""What is implausible in a description: limits, inertias, angles."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from regressors.errors import Finding, listed_names
from regressors.readers.description import range_findings, range_of
from regressors.readers.moving_part import MovingPart, carried, resting_rotation
from regressors.readers.urdf_tree import TreeJoint, UrdfTree
from regressors.robot.inertia import Array
from regressors.robot.plausibility import principal_moments

_FAR = 50.0  # m between two neighbouring joints
_SLOWEST = {"rad": 0.01, "m": 0.001}  # per second; the slowest joints of example-robot-data have 0.32 and 0.013
_FASTEST = 100.0  # rad/s or m/s; the joints there have less, or 1000 and more, which is none
_NARROWEST = {"rad": 0.1, "m": 0.001}  # there 0.52 and 0.01
_WEAKEST = 0.02  # of the torque of the weight that a joint carries at zero; there 0.18
_GRAVITY = 9.81


def health(tree: UrdfTree, part: MovingPart) -> tuple[Finding, ...]:
    """Findings on what moves of a URDF."""
    names = listed_names(joint.name for joint in part.moving)
    found = f"{len(part.moving)} moving joint(s): {names}"
    bodies = list(_bodies(tree, part))
    paths = [tree.path(part.base, tip) or () for tip in part.tips]
    reach = max(float(sum(np.linalg.norm(j.pose[:3, 3]) for j in path)) for path in paths)  # of a stretched limb [m]
    return (
        Finding("found", f"link {part.base!r} to {', '.join(map(repr, part.tips))}", found),
        *_held(tree, part),
        *part.notes,
        *tree.notes,
        *tree.angles.findings(_labels(tree, part)),
        *range_findings(part.moving),
        *_rates(part),
        *_placeholders(tree, part),
        *_doubtful(tree, part, bodies),
        *inertia_findings(bodies, reach),
        *_equal_bodies(bodies, [{joint.child for joint in path} for path in paths]),
    )


def _bodies(tree: UrdfTree, part: MovingPart) -> Iterator[Body]:
    """Every body that moves with the part."""
    for joint in part.moving:
        for name, _ in carried(tree, joint.child, part.moving_names):
            if (theta := tree.links[name]) is not None:
                yield Body(name, joint.child, theta)


def _labels(tree: UrdfTree, part: MovingPart) -> set[str]:
    """Joints and links that the part is made of, as they are called in messages."""
    above, below = tree.path(tree.root, part.base) or [], _joints_carried(tree, part)
    joints = [*above, *part.path, *below]
    return {f"{what} {name!r}" for j in joints for what, name in (("joint", j.name), ("link", j.child))}


def _joints_carried(tree: UrdfTree, part: MovingPart) -> list[TreeJoint]:
    """Other joints whose links move with it."""
    stop = part.moving_names
    links = [name for joint in part.moving for name, _ in carried(tree, joint.child, stop)]
    return [joint for link in links for joint in tree.below[link] if joint.name not in stop]


def _held(tree: UrdfTree, part: MovingPart) -> Iterator[Finding]:
    """Other joints that would move what it carries."""
    joints = (joint for joint in _joints_carried(tree, part) if joint.kind != "fixed")
    names = [joint.name for joint in joints if joint.name not in part.held]
    yield from _of("found", "joint", names, f"off the {part.word}: held at zero, what they carry is merged")


def _rates(part: MovingPart) -> Iterator[Finding]:
    for key, unit, advice in (
        ("velocity", "", "give `velocity`, or write it into the file"),
        ("effort", ", so torques are not limited", "write it into the file if `torque_margin` is to count"),
    ):
        free = [joint.name for joint in part.moving if not joint.bounds.get(key)]
        yield from _of("missing", "joint", free, f"no {key} limit{unit}", advice)


def _placeholders(tree: UrdfTree, part: MovingPart) -> Iterator[Finding]:
    """Limits that leave a joint hardly any speed, room or torque, or more speed than there is."""
    slow, fast, narrow, weak = dict[str, str](), dict[str, str](), dict[str, str](), dict[str, str]()
    for joint in part.moving:
        unit = "m" if joint.kind == "prismatic" else "rad"
        lower, upper = range_of(joint)
        speed, effort = joint.bounds.get("velocity"), joint.bounds.get("effort")
        if speed and not _SLOWEST[unit] <= speed <= _FASTEST:
            (slow if speed < _FASTEST else fast)[joint.name] = f"a velocity limit of {speed:g} {unit}/s"
        if upper - lower < _NARROWEST[unit]:
            narrow[joint.name] = f"a range of {upper - lower:.2g} {unit}"
        if effort and unit == "rad" and effort < _WEAKEST * (weight := _weight(tree, joint)):
            weak[joint.name] = (
                f"an effort limit of {effort:g} Nm, but what it carries weighs on it with {weight:.2g} Nm"
            )
    advice = "it may be a placeholder, or in another unit: give `velocity`, or write it into the file"
    yield from _of("assumed", "joint", list(fast), next(iter(fast.values()), ""), advice)  # no motion fails by it
    for told, advice in (
        (slow, "it may be a placeholder: give `velocity`, or write it into the file"),
        (narrow, "it may be a placeholder, or in another unit: give `position`, or write it into the file"),
        (weak, "masses may be in grams, or the limit is a placeholder"),
    ):
        yield from _of("suspicious", "joint", list(told), next(iter(told.values()), ""), advice)


def _weight(tree: UrdfTree, joint: TreeJoint) -> float:
    """Largest torque about a joint of the weight of all that hangs on it, with joints at zero [Nm]."""
    axis = resting_rotation(tree, joint.child) @ joint.axis
    level = float(np.hypot(*axis[:2]))  # an upright axis carries no weight
    parts = [(tree.links[name], T) for name, T in carried(tree, joint.child, ())]
    moments = [theta[0] * T[:3, 3] + T[:3, :3] @ theta[1:4] for theta, T in parts if theta is not None]
    return _GRAVITY * level * sum(float(np.linalg.norm(np.cross(joint.axis, moment))) for moment in moments)


def _doubtful(tree: UrdfTree, part: MovingPart, bodies: Sequence[Body]) -> Iterator[Finding]:
    """Joints that nothing drives in a file that says what drives the others, far ones, and links without a body."""
    free = [joint.name for joint in part.moving if joint.name not in tree.actuated]
    if len(free) < len(part.moving):
        what = "no transmission, though others have one, so it may be passive"
        yield from _of("suspicious", "joint", free, what, "leave a passive joint out of `joints`")
    far = [joint.name for joint in part.path if np.linalg.norm(joint.pose[:3, 3]) > _FAR]
    what = f"more than {_FAR:g} m from the one before"
    yield from _of("suspicious", "joint", far, what, "lengths are in metres, not in millimetres")
    known = {body.carrier for body in bodies}
    unknown = [joint.child for joint in part.moving if joint.child not in known]
    advice = "identification does not need them, simulation and torque limits do"
    yield from _of("missing", "link", unknown, "no <inertial>: its parameters are unknown", advice)


_Kind = Literal["found", "assumed", "missing", "suspicious"]


def _of(kind: _Kind, part: str, names: list[str], what: str, advice: str = "", most: int = 20) -> Iterator[Finding]:
    """What was noticed of some joints, or of some links, the first of which are named; nothing if there are none."""
    if names:
        yield Finding(kind, f"{part}{'s' * (len(names) > 1)} {listed_names(names, most)}", what, advice)


def _doubts(names: list[str], what: str) -> Iterator[Finding]:
    """What is doubtful of some links."""
    return _of("suspicious", "link", names, what, _ADVICE, _FEW)


_HEAVY = 1e5  # kg
_SMALLEST_REACH = 0.3  # m; of robots whose links carry no lengths
_SLACK = 1e-3  # part of the largest moment of inertia, for values that were rounded
_FEWEST_EQUAL, _FEW = 3, 6
_NEGLIGIBLE = 1e-3  # part of all the mass; so light a body may well be a point
_ADVICE = "parameters known beforehand, torque limits and simulations rest on it; take it from a CAD model"


@dataclass(frozen=True, eq=False)
class Body:
    """A body with its inertial parameters about its own frame."""

    name: str  # of its link
    carrier: str  # moving link that it moves with
    theta: Array  # (10,)

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return float(self.theta[0])

    @cached_property
    def moments(self) -> Array:
        """Principal moments of inertia about the centre of mass, in ascending order [kg m^2], shape (3,)."""
        moments = principal_moments(self.theta)
        noise = 1e-12 * float(np.max(np.abs(self.theta[4:])))
        return np.where(np.abs(moments) < noise, 0.0, moments)


def inertia_findings(bodies: Sequence[Body], reach: float) -> Iterator[Finding]:
    """Findings on bodies: masses and inertias that no body has, that look copied, or that are far too large."""
    bodies = [body for body in bodies if np.all(np.isfinite(body.theta)) and np.any(body.theta)]
    least = _NEGLIGIBLE * sum(abs(body.mass) for body in bodies)
    size = max(reach, _SMALLEST_REACH)
    faults: Mapping[str, Callable[[Body], object]] = {
        "its mass is not positive": lambda body: body.mass <= 0.0,
        f"its mass is above {_HEAVY:g} kg, so it may be in grams": lambda body: body.mass > _HEAVY,
        "its inertia is zero, as of a point": lambda body: body.mass > least and not np.any(body.moments),
        "its inertia is not positive definite about the centre of mass": lambda body: (
            bool(np.any(body.moments)) and body.moments[0] <= 0.0
        ),
        "its inertia violates the triangle inequality: no body has it": lambda body: (
            body.moments[0] > 0.0 and body.moments[:2].sum() < body.moments[2] * (1.0 - _SLACK)
        ),
        "its inertia is too large for its mass: it would be larger than the arm": lambda body: (
            body.mass > 0.0 and body.moments[-1] > body.mass * size**2
        ),
        "its centre of mass is farther away than the arm reaches": lambda body: (
            body.mass > 0.0 and np.linalg.norm(body.theta[1:4] / body.mass) > size
        ),
    }
    for what, has in faults.items():
        yield from _doubts([body.name for body in bodies if has(body)], what)


def _equal_bodies(bodies: Sequence[Body], limbs: Sequence[set[str]]) -> Iterator[Finding]:
    """Moving links of a limb of the same mass and inertia; two limbs, and parts on one link, may be alike."""
    groups: dict[tuple[float, ...], list[str]] = defaultdict(list)
    for body in bodies:
        finite = np.all(np.isfinite(body.theta))
        if finite and body.mass > 0.0 and body.name == body.carrier:
            groups[tuple(float(f"{value:.6g}") for value in (body.mass, *body.moments))].append(body.name)
    for (mass, *_), names in groups.items():
        if any(len(limb.intersection(names)) >= _FEWEST_EQUAL for limb in limbs):
            yield from _doubts(names, f"the same {mass:g} kg and the same inertia, so they may be placeholders")
