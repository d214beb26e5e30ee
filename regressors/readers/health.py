"""Health report of a URDF: what was read, assumed and corrected, what is missing, and what is implausible."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from regressors.readers.chain_ends import Chain
from regressors.readers.inertia_findings import Body, inertia_findings
from regressors.readers.joint_ranges import range_findings, range_of
from regressors.readers.resting_joints import carried, resting_pose
from regressors.readers.urdf_tree import TreeJoint, UrdfTree, listing
from regressors.robot.finding import Finding

_FAR = 50.0  # m between two neighbouring joints
_SLOWEST = {"rad": 0.01, "m": 0.001}  # per second; the slowest joints of example-robot-data have 0.32 and 0.013
_NARROWEST = {"rad": 0.1, "m": 0.001}  # there 0.52 and 0.01
_WEAKEST = 0.02  # of the torque of the weight that a joint carries at zero; there 0.18
_GRAVITY = 9.81


def health(tree: UrdfTree, chain: Chain) -> tuple[Finding, ...]:
    """Findings on a chain of a URDF."""
    bodies = list(_bodies(tree, chain))
    return (
        _chain(chain),
        *_held(tree, chain),
        *chain.notes,
        *tree.notes,
        *tree.angles.findings(_labels(tree, chain)),
        *range_findings(chain.moving),
        *_rates(chain),
        *_placeholders(tree, chain),
        *_passive(tree, chain),
        *_lengths(chain),
        *_unknown_bodies(chain, bodies),
        *inertia_findings(bodies, _reach(chain)),
    )


def _bodies(tree: UrdfTree, chain: Chain) -> Iterator[Body]:
    """Every body that moves with the chain."""
    stop = {joint.name for joint in chain.moving}
    for joint in chain.moving:
        for name, _ in carried(tree, joint.child, stop):
            theta = tree.links[name]
            if theta is not None:
                yield Body(name, joint.child, theta)


def _chain(chain: Chain) -> Finding:
    names = ", ".join(listing(joint.name for joint in chain.moving))
    return Finding("found", f"link {chain.base!r} to {chain.tip!r}", f"{len(chain.moving)} moving joint(s): {names}")


def _labels(tree: UrdfTree, chain: Chain) -> set[str]:
    """Joints and links that the chain is made of, as they are called in messages."""
    above, below = tree.path(tree.root, chain.base) or [], _joints_carried(tree, chain)
    joints = [*above, *chain.path, *below]
    return {f"{what} {name!r}" for j in joints for what, name in (("joint", j.name), ("link", j.child))}


def _joints_carried(tree: UrdfTree, chain: Chain) -> list[TreeJoint]:
    """Joints beside the chain whose links move with it."""
    stop = {joint.name for joint in chain.moving}
    links = [name for joint in chain.moving for name, _ in carried(tree, joint.child, stop)]
    return [joint for link in links for joint in tree.below[link] if joint.name not in stop]


def _held(tree: UrdfTree, chain: Chain) -> Iterator[Finding]:
    """Joints beside the chain that would move what it carries."""
    joints = (joint for joint in _joints_carried(tree, chain) if joint.kind != "fixed")
    names = [joint.name for joint in joints if joint.name not in chain.held]
    if names:
        yield Finding("found", _listed("joint", names), "off the chain: held at zero, what they carry is merged")


def _rates(chain: Chain) -> Iterator[Finding]:
    for key, unit, advice in (
        ("velocity", "", "give `velocity`, or write it into the file"),
        ("effort", ", so torques are not limited", "write it into the file if `torque_margin` is to count"),
    ):
        free = [joint.name for joint in chain.moving if not joint.bounds.get(key)]
        if free:
            yield Finding("missing", _listed("joint", free), f"no {key} limit{unit}", advice)


def _placeholders(tree: UrdfTree, chain: Chain) -> Iterator[Finding]:
    """Limits that leave a joint hardly any speed, room or torque."""
    slow, narrow, weak = {}, {}, {}
    for joint in chain.moving:
        unit = "m" if joint.kind == "prismatic" else "rad"
        lower, upper = range_of(joint)
        speed, effort = joint.bounds.get("velocity"), joint.bounds.get("effort")
        if speed and speed < _SLOWEST[unit]:
            slow[joint.name] = f"a velocity limit of {speed:g} {unit}/s"
        if upper - lower < _NARROWEST[unit]:
            narrow[joint.name] = f"a range of {upper - lower:.2g} {unit}"
        if effort and unit == "rad" and effort < _WEAKEST * (weight := _weight(tree, joint)):
            weak[joint.name] = (
                f"an effort limit of {effort:g} Nm, but what it carries weighs on it with {weight:.2g} Nm"
            )
    for told, advice in (
        (slow, "it may be a placeholder: give `velocity`, or write it into the file"),
        (narrow, "it may be a placeholder, or in another unit: give `position`, or write it into the file"),
        (weak, "masses may be in grams, or the limit is a placeholder"),
    ):
        if told:
            yield Finding("suspicious", _listed("joint", told), next(iter(told.values())), advice)


def _weight(tree: UrdfTree, joint: TreeJoint) -> float:
    """Largest torque about a joint of the weight of all that hangs on it, with joints at zero [Nm]."""
    R = np.eye(3)
    for above in tree.path(tree.root, joint.child) or ():
        R = R @ resting_pose(tree, above)[:3, :3]
    level = float(np.hypot(*(R @ joint.axis)[:2]))  # an upright axis carries no weight
    parts = [(tree.links[name], T) for name, T in carried(tree, joint.child, ())]
    moments = [theta[0] * T[:3, 3] + T[:3, :3] @ theta[1:4] for theta, T in parts if theta is not None]
    return _GRAVITY * level * sum(float(np.linalg.norm(np.cross(joint.axis, moment))) for moment in moments)


def _passive(tree: UrdfTree, chain: Chain) -> Iterator[Finding]:
    """Joints that nothing drives, in a file that says what drives the others."""
    free = [joint.name for joint in chain.moving if joint.name not in tree.actuated]
    if free and len(free) < len(chain.moving):
        what = "no transmission, though others have one, so it may be passive"
        yield Finding("suspicious", _listed("joint", free), what, "leave a passive joint out of `joints`")


def _lengths(chain: Chain) -> Iterator[Finding]:
    far = [joint.name for joint in chain.path if np.linalg.norm(joint.pose[:3, 3]) > _FAR]
    if far:
        what = f"more than {_FAR:g} m from the one before"
        yield Finding("suspicious", _listed("joint", far), what, "lengths are in metres, not in millimetres")


def _unknown_bodies(chain: Chain, bodies: Sequence[Body]) -> Iterator[Finding]:
    known = {body.carrier for body in bodies}
    unknown = [joint.child for joint in chain.moving if joint.child not in known]
    if unknown:
        what = "no <inertial>: its parameters are unknown"
        advice = "identification does not need them, simulation and torque limits do"
        yield Finding("missing", _listed("link", unknown), what, advice)


def _reach(chain: Chain) -> float:
    """Length of the stretched chain [m]."""
    return float(sum(np.linalg.norm(joint.pose[:3, 3]) for joint in chain.path))


def _listed(what: str, names: Iterable[str]) -> str:
    names = list(names)
    return f"{what}{'s' if len(names) > 1 else ''} {', '.join(listing(names))}"
