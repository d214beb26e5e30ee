"""The ends of the chain that is meant among all links, and the joints that are held."""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from regressors.errors import Finding, InputError, UnknownName
from regressors.readers.description import range_of
from regressors.readers.urdf_tree import MOVING, TreeJoint, UrdfTree, listing
from regressors.robot.inertia import Array
from regressors.robot.robot import Joint, JointKind

_FINGER = re.compile(r"finger|jaw|claw|knuckle", re.IGNORECASE)
_GRIPPER = re.compile(r"gripper", re.IGNORECASE)
_HAND = re.compile(r"(?<![a-z])hand(?![a-z])", re.IGNORECASE)
_ARM = re.compile(r"wrist|elbow|shoulder|arm|axis", re.IGNORECASE)
_LEG = re.compile(r"wheel|caster|leg|hip|thigh|knee|calf|shank|ankle|foot|rotor|head|neck", re.IGNORECASE)
_WHEEL = re.compile(r"wheel|caster|rotor|motor", re.IGNORECASE)
_NUMBERED = re.compile(r"\d")  # joint6 may well carry the body of the gripper
_FEWEST_OF_ARM = 3  # joints; what parts behind fewer is no hand
_UNTIE = "switch the coupling off in the file (no <mimic>, active='false' of an <equality>), if a drive moves the joint"


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints from the base to the tip."""

    base: str  # first and last link
    tip: str
    path: list[TreeJoint]  # all joints between them, fixed ones too
    notes: tuple[Finding, ...] = ()  # on what was left out
    held: tuple[str, ...] = ()  # joints that these notes name

    @property
    def moving(self) -> list[TreeJoint]:
        """Joints that are not fixed."""
        return [joint for joint in self.path if joint.kind != "fixed"]

    @property
    def moving_names(self) -> set[str]:
        """Names of these joints."""
        return {joint.name for joint in self.moving}


def chain_of(tree: UrdfTree, base: str | None, tip: str | None) -> Chain:
    """The chain between two links, or below the base, checked.

    Where no tip is given, the chain ends where fingers part, and before joints that move a gripper.
    """
    base = tree.root if base is None else _known(tree, base)
    chain = _without_gripper(tree, base) if tip is None else _between(tree, base, _known(tree, tip))
    if not chain.moving:
        raise InputError(f"{tree.source}: no moving joint between the links {base!r} and {chain.tip!r}")
    _check(tree, chain)
    return chain


def _known(tree: UrdfTree, link: str) -> str:
    if link not in tree.links:
        near = difflib.get_close_matches(link, tree.links, 3)
        raise UnknownName(f"link in {tree.source}", link, listing(tree.links), near)
    return link


def _between(tree: UrdfTree, base: str, tip: str) -> Chain:
    path = tree.path(base, tip)
    if path is None:
        raise InputError(
            f"{tree.source}: link {tip!r} does not hang below link {base!r}; choose another base or tip: "
            f"{_how_they_hang(tree, base, tip)}"
        )
    return Chain(base, tip, path)


def _how_they_hang(tree: UrdfTree, base: str, tip: str) -> str:
    if tree.path(tip, base) is not None:
        return "it is the other way round"
    above = {joint.parent for joint in tree.path(tree.root, base) or ()}
    shared = next(joint.parent for joint in reversed(tree.path(tree.root, tip) or ()) if joint.parent in above)
    return f"both hang below link {shared!r}"


def _without_gripper(tree: UrdfTree, base: str) -> Chain:
    tips = _moving_tips(tree, base)
    if not tips:
        raise InputError(f"{tree.source}: no moving joint below link {base!r}")
    fork, fingers = tips[0], list[str]()
    notes: tuple[Finding, ...] = ()
    if len(tips) > 1:
        fork = _fork(tree, base, tips)
        below = [[joint.name for joint in tree.path(fork, tip) or () if joint.kind != "fixed"] for tip in tips]
        fingers = list(dict.fromkeys(names[0] for names in below))
        what = f"the chain ends here, where fingers part; {', '.join(listing(fingers))} are held at zero"
        notes = (Finding("assumed", f"link {fork!r}", what, "`tip` chooses another end"),)
    chain = _between(tree, base, fork)
    moving = chain.moving
    held: list[TreeJoint] = []
    while moving and _moves_gripper(moving[-1]):
        held.insert(0, moving.pop())
    if not held or not moving:  # a hand or a finger alone is kept whole
        return Chain(base, fork, chain.path, notes, tuple(fingers))
    shorter = _between(tree, base, held[0].parent)
    names = (*(joint.name for joint in held), *fingers)
    return Chain(base, shorter.tip, shorter.path, (*_held(tree, held, fork), *notes), names)


def _moves_gripper(joint: TreeJoint) -> bool:
    """Whether a joint follows another or bears the name of a gripper, or its link that of a part of one."""
    if joint.mimic is not None or _FINGER.search(joint.name) or _GRIPPER.search(joint.name):
        return True
    if _ARM.search(joint.name):
        return False
    gripper = _GRIPPER.search(joint.child) and not _NUMBERED.search(joint.name)
    return bool(_HAND.search(joint.name) or _FINGER.search(joint.child) or gripper)


def _held(tree: UrdfTree, held: Sequence[TreeJoint], tip: str) -> tuple[Finding, ...]:
    where = f"joint {', '.join(joint.name for joint in held)}"
    note = Finding("assumed", where, "moves a gripper: held at zero and left out", f"`tip={tip!r}` includes it")
    ranges = ((joint.name, rest(tree, joint)[0], range_of(joint)) for joint in held)
    if outside := [name for name, position, (lower, upper) in ranges if not lower <= position <= upper]:
        return (note, Finding("suspicious", f"joint {', '.join(outside)}", "held where its limits do not allow it"))
    return (note,)


def _moving_tips(tree: UrdfTree, base: str) -> list[str]:
    """Last links that move, one where the moving joints below the base form a single chain."""
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
    return tips


def _fork(tree: UrdfTree, base: str, tips: Sequence[str]) -> str:
    """Link behind which fingers part: several chains, each of fewer joints than the arm before them."""
    paths = [tree.path(base, tip) or [] for tip in tips]
    shared: list[TreeJoint] = [
        level[0] for level in zip(*paths, strict=False) if all(joint is level[0] for joint in level)
    ]
    arm = _count(shared)
    if arm >= _FEWEST_OF_ARM and max(map(_count, paths)) - arm < arm:
        return shared[-1].child
    hint = f" (`tip={shared[-1].child!r}` ends where they part)" if arm else ""
    limbs = sorted(_limbs(tree, base, tips), key=_rank)
    proposed = f"; {_proposal(tree, base, limbs)}" if limbs else ""
    ends = ", ".join(listing(limb[-1].child for limb in limbs)) or ", ".join(listing(tips))
    raise InputError(
        f"{tree.source}: {len(limbs) or len(tips)} moving chains start from link {base!r}; choose the last link with "
        f"`tip`{hint}{proposed}; the chains end at: {ends}"
    )


def _count(path: Iterable[TreeJoint]) -> int:
    """Number of joints that move on their own."""
    return sum(joint.kind != "fixed" and joint.mimic is None for joint in path)


def _limbs(tree: UrdfTree, base: str, tips: Sequence[str]) -> list[list[TreeJoint]]:
    """What each chain has behind the last fork before it, without fingers and joints that move a gripper."""
    paths = [tree.path(base, tip) or [] for tip in tips]
    through = Counter(joint.name for path in paths for joint in path)
    between_forks = ([list(part) for _, part in groupby(path, lambda joint: through[joint.name])] for path in paths)
    parted = [[part for part in parts if _count(part)] for parts in between_forks]
    deepest: dict[str, int] = {}  # joints behind the last one of a part, on the longest chain
    for parts in parted:
        for k, part in enumerate(parts):
            behind = _count(j for later in parts[k + 1 :] for j in later if not _moves_gripper(j))
            deepest[part[-1].name] = max(deepest.get(part[-1].name, 0), behind)
    limbs: dict[str, list[TreeJoint]] = {}
    for parts in parted:
        hands = (part for part in parts if _count(part) >= _FEWEST_OF_ARM and deepest[part[-1].name] < _count(part))
        limb = next(hands, parts[-1])
        without = list(limb)
        while without and (without[-1].kind == "fixed" or _moves_gripper(without[-1])):
            without.pop()
        limb = without or limb
        limbs.setdefault(limb[-1].child, limb)
    return list(limbs.values())


def _rank(limb: Sequence[TreeJoint]) -> tuple[bool, bool, int]:
    """Order of limbs: arms first, wheels last, and the more joints the better."""
    ends = f"{limb[-1].name} {limb[-1].child}"
    return bool(_WHEEL.search(ends) or _FINGER.search(ends)), not _is_arm(limb), -_count(limb)


def _is_arm(limb: Sequence[TreeJoint]) -> bool:
    names = " ".join(f"{joint.name} {joint.child}" for joint in limb)
    return bool(_ARM.search(names)) and not _LEG.search(names)


def _proposal(tree: UrdfTree, base: str, limbs: Sequence[Sequence[TreeJoint]]) -> str:
    """The first limb that can be read, with the options that choose it."""
    for limb in limbs:
        first = limb[0].parent if _count(tree.path(base, limb[0].parent) or ()) else base
        if given := working_ends(tree, [(first, limb[-1].child)], base, None):
            joints = f"{_count(limb)} joint{'s' * (_count(limb) > 1)}"
            return f"for the {'arm' if _is_arm(limb) else 'limb'} of {joints} give {given}"
    return "none of them is a serial chain of joints that move on their own"


def working_ends(
    tree: UrdfTree,
    candidates: Iterable[tuple[str, str]],
    base: str,
    tip: str | None,
    accepts: Callable[[Chain], object] = lambda chain: None,
) -> str:
    """Options that choose a chain that can be read, each with what differs from the ends given; empty if none does."""
    texts = []
    for first, last in candidates:
        with suppress(InputError):
            chain = _between(tree, first, last)
            _check(tree, chain, advise=False)
            accepts(chain)
            options = {"base_link": (first, base), "tip": (last, tip)}
            given = " and ".join(f"`{name}={new!r}`" for name, (new, old) in options.items() if new != old)
            if chain.moving and given:
                texts.append(given)
    return ", or ".join(dict.fromkeys(texts))


def _check(tree: UrdfTree, chain: Chain, *, advise: bool = True) -> None:
    """Refuse joints that a serial chain of independent coordinates cannot hold."""

    def refuse(what: str, candidates: Iterable[tuple[str, str]], otherwise: str) -> None:
        working = working_ends(tree, candidates, chain.base, chain.tip) if advise else ""
        cure = f"what works is {working}" if working else otherwise
        raise InputError(f"{tree.source}: {what}; {cure}")

    base, tip = chain.base, chain.tip
    for joint in chain.moving:
        if joint.kind not in MOVING:
            refuse(
                f"joint {joint.name!r} on the chain is {joint.kind}, expected {', '.join(MOVING)} or fixed",
                [(joint.child, tip), (base, joint.parent)],
                'no joint of the other kinds moves before or behind it: write type="fixed" if it stands still',
            )
        if joint.mimic is not None:
            refuse(
                f"joint {joint.name!r} on the chain mimics joint {joint.mimic.joint!r}, expected joints that move on "
                "their own",
                _around(tree, chain, joint, joint.mimic.joint),
                _UNTIE,
            )
    moving = chain.moving_names
    for joint in tree.above.values():
        leader = rest(tree, joint)[1]
        if joint.name not in moving and leader in moving:
            refuse(
                f"joint {joint.name!r} off the chain mimics joint {leader!r} on the chain, expected one that stands "
                "still",
                _around(tree, chain, joint, leader),
                _UNTIE,
            )


def _around(tree: UrdfTree, chain: Chain, follower: TreeJoint, leader: str) -> list[tuple[str, str]]:
    """Ends of chains that may leave out a joint and the one that it follows."""
    pair = [joint for joint in tree.above.values() if joint.name in (follower.name, leader)]
    ends = [(joint.child, chain.tip) for joint in pair] + [(chain.base, joint.parent) for joint in pair]
    return [*ends, *((first.child, last.parent) for first in pair for last in pair)]


def rest(tree: UrdfTree, joint: TreeJoint) -> tuple[float, str]:
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
    position, _ = rest(tree, joint)
    if position == 0.0:
        return joint.pose
    return Joint(joint.name, kind_of(joint), joint.pose[:3, :3], joint.pose[:3, 3], joint.axis).motion(position)


def resting_rotation(tree: UrdfTree, link: str) -> Array:
    """Axes of a link in the root's frame, with all joints above it at rest, shape (3, 3)."""
    R = np.eye(3)
    for joint in tree.path(tree.root, link) or ():
        R = R @ resting_pose(tree, joint)[:3, :3]
    return R


def kind_of(joint: TreeJoint) -> JointKind:
    """How a joint of URDF moves, as a `Joint`."""
    return "prismatic" if joint.kind == "prismatic" else "revolute"


def carried(tree: UrdfTree, link: str, stop: Collection[str]) -> Iterator[tuple[str, Array]]:
    """A link and all that hangs on it up to the joints to stop at, with the poses in its frame, shape (4, 4)."""
    todo = [(link, np.eye(4))]
    while todo:
        name, T = todo.pop()
        yield name, T
        todo.extend((j.child, T @ resting_pose(tree, j)) for j in tree.below[name] if j.name not in stop)
