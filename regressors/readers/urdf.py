"""Reader of URDF files: any serial chain of a tree of links, as a `Robot`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from regressors.errors import InputError, UnknownName
from regressors.readers.urdf_tree import MOVING, TreeJoint, UrdfTree, listing, parse_tree
from regressors.robot.inertia import Array, transport
from regressors.robot.robot import Drive, Joint, JointKind, Limits, Link, Robot, Transmission

_GRAVITY = np.array([0.0, 0.0, -9.81])
_NOISE = 1e-12


def read_urdf(path: str | Path, *, base: str | None = None, tip: str | None = None) -> Robot:
    """Read the serial chain from one link to another of a URDF file, as a `Robot`.

    See `parse_urdf` for what is read and how the rest of the tree is treated.

    Parameters
    ----------
    path : str or Path
        A URDF file; xacro must be expanded first.
    base, tip : str, optional
        Names of the first and the last link, see `parse_urdf`.

    Returns
    -------
    Robot
        Its ``source`` is ``"URDF <file name>"``.

    Raises
    ------
    UnknownName
        No link has the name given as base or tip.
    InputError
        The file cannot be read, is not a URDF, or holds no such serial chain.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot read the URDF file {str(path)!r}: {reason}") from error
    return parse_urdf(content, name_of_source=path.name, base=base, tip=tip)


def parse_urdf(
    text: str | bytes, *, name_of_source: str = "text", base: str | None = None, tip: str | None = None
) -> Robot:
    """Read the serial chain from one link to another of a URDF document, as a `Robot`.

    The joints from base to tip that are revolute, continuous or prismatic become the robot's joints, with the frames
    of URDF: a link's frame is the frame of the joint that moves it. Everything else stands still and no mass is lost:

    - Whatever hangs on a moving link of the chain by other joints than the chain's (sensors, flanges, a gripper, the
      arm beyond the tip) is merged into it. Joints off the chain rest at position zero, whatever their limits say, and
      mimic joints where that puts them (at their offset).
    - The base, what hangs on it and what is above it does not move: its mass is ignored. Joints above the base rest at
      zero as well, and gravity, 9.81 m/s^2 along -z of the root link, is expressed in the axes of the base.
    - A link with which no ``<inertial>`` was merged has unknown parameters (``theta`` is None).

    Limits: an effort or velocity of zero, or not stated, means no limit; so does a joint without ``<limit>``, or one
    that states neither ``lower`` nor ``upper`` (if one of them is stated, the other is zero as URDF says). Continuous
    joints have no position limits. URDF has no limits on acceleration and jerk. ``<safety_controller>`` is not read.

    Friction of ``<dynamics>`` becomes one drive per joint, if any of it is not zero.

    Parameters
    ----------
    text : str or bytes
        The document.
    name_of_source : str
        Name of the file, for ``Robot.source`` and for messages.
    base : str, optional
        Name of the first link; the root of the tree if not given.
    tip : str, optional
        Name of the last link; if not given, the last moving link, where there is just one below the base.

    Returns
    -------
    Robot
        SI units, angles in radians.

    Raises
    ------
    UnknownName
        No link has the name given as base or tip.
    InputError
        The document is not a URDF, or holds no such serial chain.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # absurd sizes end as "must be finite"
        return robot_of_tree(parse_tree(text, name_of_source), base, tip)


def robot_of_tree(tree: UrdfTree, base: str | None, tip: str | None) -> Robot:
    """Serial chain of a tree of links, see `parse_urdf`."""
    base = tree.root if base is None else _known(tree, base)
    tip = _only_tip(tree, base) if tip is None else _known(tree, tip)
    path = tree.path(base, tip)
    if path is None:
        raise InputError(f"{tree.source}: link {tip!r} does not hang below link {base!r}; choose another base or tip")
    chain = [joint for joint in path if joint.kind != "fixed"]
    if not chain:
        raise InputError(f"{tree.source}: no moving joint between the links {base!r} and {tip!r}")
    _check_chain(tree, chain)
    try:
        return Robot(
            name=tree.name,
            joints=_joints(path),
            links=_links(tree, chain),
            limits=_limits(chain),
            transmission=_transmission(chain),
            gravity=_gravity(tree, base),
            source=f"URDF {tree.source}",
        )
    except InputError as error:
        message = " ".join(str(error).split())  # an array in it may have been printed on several lines
        raise InputError(f"{tree.source}: {message}") from error


def _known(tree: UrdfTree, link: str) -> str:
    if link not in tree.links:
        raise UnknownName(f"link in {tree.source}", link, listing(tree.links))
    return link


def _only_tip(tree: UrdfTree, base: str) -> str:
    """Last moving link, if the moving joints below the base form a single chain."""
    links = [base]
    for link in links:
        links.extend(joint.child for joint in tree.below[link])
    leads_on: set[str] = set()  # links with a moving joint somewhere below
    tips: list[str] = []
    for link in reversed(links[1:]):
        joint = tree.above[link]
        if joint.kind != "fixed" and link not in leads_on:
            tips.insert(0, link)
        if joint.kind != "fixed" or link in leads_on:
            leads_on.add(joint.parent)
    if len(tips) == 1:
        return tips[0]
    if not tips:
        raise InputError(f"{tree.source}: no moving joint below link {base!r}")
    raise InputError(
        f"{tree.source}: {len(tips)} moving chains start from link {base!r}; choose the last link with `tip`"
        f"{_fork_hint(tree, base, tips)}; the chains end at: {', '.join(listing(tips))}"
    )


def _fork_hint(tree: UrdfTree, base: str, tips: Sequence[str]) -> str:
    """Where several chains part, if they share a moving joint: the wrist of an arm with a gripper."""
    paths = [tree.path(base, tip) or [] for tip in tips]
    shared = [level[0] for level in zip(*paths, strict=False) if all(joint is level[0] for joint in level)]
    if all(joint.kind == "fixed" for joint in shared):
        return ""
    return f" (`tip={shared[-1].child!r}` ends where they part)"


def _check_chain(tree: UrdfTree, chain: Sequence[TreeJoint]) -> None:
    """Refuse joints that a serial chain of independent coordinates cannot hold."""
    for joint in chain:
        if joint.kind not in MOVING:
            raise InputError(
                f"{tree.source}: joint {joint.name!r} on the chain is {joint.kind}, expected {', '.join(MOVING)} "
                f"or fixed; start below it with `base={joint.child!r}`"
            )
        if joint.mimic is not None:
            raise InputError(
                f"{tree.source}: joint {joint.name!r} on the chain mimics joint {joint.mimic.joint!r}, expected joints "
                f"that move on their own; end before it with `tip={joint.parent!r}`"
            )
    moving = {joint.name for joint in chain}
    for joint in tree.above.values():
        leader = _rest(tree, joint)[1]
        if joint.name not in moving and leader in moving:
            raise InputError(
                f"{tree.source}: joint {joint.name!r} off the chain mimics joint {leader!r} on the chain, expected "
                "one that stands still; choose another base or tip"
            )


def _rest(tree: UrdfTree, joint: TreeJoint) -> tuple[float, str]:
    """Position of a joint off the chain, and the name of the joint that it follows in the end (its own if none)."""
    position, gain, visited = 0.0, 1.0, {joint.name}
    by_name = {other.name: other for other in tree.above.values()} if joint.mimic else {}
    while joint.mimic is not None:
        position += gain * joint.mimic.offset
        gain *= joint.mimic.multiplier
        leader = by_name.get(joint.mimic.joint)
        if leader is None:
            return position, joint.mimic.joint
        if leader.name in visited:
            names = ", ".join(listing(sorted(visited)))
            raise InputError(f"{tree.source}: joint {joint.name!r} mimics itself by way of {names}")
        visited.add(leader.name)
        joint = leader
    return position, joint.name


def resting_pose(tree: UrdfTree, joint: TreeJoint) -> Array:
    """Pose of a joint's child in its parent's frame, at position zero or where what it mimics puts it, shape (4, 4)."""
    position, _ = _rest(tree, joint)
    if position == 0.0:
        return joint.pose
    return Joint(joint.name, _kind(joint), joint.pose[:3, :3], joint.pose[:3, 3], joint.axis).motion(position)


def _kind(joint: TreeJoint) -> JointKind:
    return "prismatic" if joint.kind == "prismatic" else "revolute"


def _tidy(values: Array) -> Array:
    """Values without rounding noise about 0, 1 and -1, which would swell symbolic expressions."""
    nearest = np.clip(np.round(values), -1.0, 1.0)
    return np.where(np.abs(values - nearest) < _NOISE, nearest, values) + 0.0


def _joints(path: Sequence[TreeJoint]) -> tuple[Joint, ...]:
    """Give the moving joints, with the poses of the fixed ones before them merged in."""
    joints, T = [], np.eye(4)
    for joint in path:
        T = T @ joint.pose
        if joint.kind != "fixed":
            joints.append(Joint(joint.name, _kind(joint), _tidy(T[:3, :3]), _tidy(T[:3, 3]), _tidy(joint.axis)))
            T = np.eye(4)
    return tuple(joints)


def _links(tree: UrdfTree, chain: Sequence[TreeJoint]) -> tuple[Link, ...]:
    stop = {joint.name for joint in chain}
    return tuple(Link(joint.child, _merged_parameters(tree, joint.child, stop)) for joint in chain)


def _merged_parameters(tree: UrdfTree, link: str, stop: set[str]) -> Array | None:
    """Parameters of a link and all that hangs on it up to the joints to stop at, about the link frame's origin."""
    total: Array | None = None
    todo = [(link, np.eye(4))]
    while todo:
        name, T = todo.pop()
        theta = tree.links[name]
        if theta is not None:
            moved = transport(T[:3, :3], T[:3, 3]) @ theta if name != link else theta
            total = moved if total is None else total + moved
        todo.extend((j.child, T @ resting_pose(tree, j)) for j in tree.below[name] if j.name not in stop)
    return total


def _limits(chain: Sequence[TreeJoint]) -> Limits:
    unlimited = np.full(len(chain), np.inf)
    lower, upper = zip(*(_range(joint) for joint in chain), strict=True)
    velocity, effort = ([joint.bounds.get(key) or np.inf for joint in chain] for key in ("velocity", "effort"))
    return Limits(np.array(lower), np.array(upper), np.array(velocity), unlimited, unlimited, np.array(effort))


def _range(joint: TreeJoint) -> tuple[float, float]:
    stated = joint.kind != "continuous" and ("lower" in joint.bounds or "upper" in joint.bounds)
    return (joint.bounds.get("lower", 0.0), joint.bounds.get("upper", 0.0)) if stated else (-np.inf, np.inf)


def _transmission(chain: Sequence[TreeJoint]) -> Transmission | None:
    if not any(joint.damping or joint.friction for joint in chain):
        return None
    drives = tuple(Drive(joint.name, coulomb=joint.friction, viscous=joint.damping) for joint in chain)
    return Transmission(np.eye(len(chain)), drives, Limits.none(len(chain)))


def _gravity(tree: UrdfTree, base: str) -> Array:
    """Gravity in the axes of the base, with the joints above it at rest."""
    R = np.eye(3)
    for joint in tree.path(tree.root, base) or ():
        R = R @ resting_pose(tree, joint)[:3, :3]
    magnitude = float(np.linalg.norm(_GRAVITY))
    return magnitude * _tidy(R.T @ (_GRAVITY / magnitude))
