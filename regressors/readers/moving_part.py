"""The part of a tree of links that moves: below a base, up to some tips; and the joints that are held."""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from regressors.errors import Finding, InputError, UnknownName, listed_names
from regressors.quantities import Tips
from regressors.readers.description import range_of
from regressors.readers.urdf_tree import MOVING, TreeJoint, UrdfTree
from regressors.robot.inertia import Array
from regressors.robot.moving_base import STANDS_STILL
from regressors.robot.robot import Joint, JointKind

_FINGER = re.compile(r"finger|jaw|claw|knuckle", re.IGNORECASE)
_GRIPPER = re.compile(r"gripper", re.IGNORECASE)
_HAND = re.compile(r"(?<![a-z])hand(?![a-z])", re.IGNORECASE)
_ARM = re.compile(r"wrist|elbow|shoulder|arm|axis", re.IGNORECASE)
_ENDS = re.compile(rf"wheel|caster|suspension|propeller|{_FINGER.pattern}", re.IGNORECASE)
_NUMBERED = re.compile(r"\d")  # joint6 may well carry the body of the gripper
_FEWEST_OF_ARM = 3  # joints; what parts behind fewer is no hand
_UNTIE = "switch the coupling off in the file (no <mimic>, active='false' of an <equality>), if a drive moves the joint"


@dataclass(frozen=True, eq=False)
class MovingPart:
    """Joints from the base to the tips: a chain where there is one tip, else a tree."""

    base: str  # first link
    tips: tuple[str, ...]  # last links
    path: list[TreeJoint]  # all joints between them, fixed ones too, each behind those that carry it
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

    @property
    def word(self) -> str:
        """What it is."""
        return "chain" if len(self.tips) == 1 else "tree"


def moving_part(tree: UrdfTree, base: str | None, tips: Tips) -> MovingPart:
    """What moves between a base and some tips, checked.

    Where no tip is given, that is everything below the base, but neither fingers, nor joints that move a gripper, nor
    wheels beside limbs.
    """
    base = tree.root if base is None else _known(tree, base)
    if tips is None:
        part = _by_default(tree, base)
    else:
        names = (tips,) if isinstance(tips, str) else tuple(dict.fromkeys(tips))
        part = _between(tree, base, tuple(_known(tree, tip) for tip in names))
    if not part.moving:
        ends = " or ".join(map(repr, part.tips))
        raise InputError(f"{tree.source}: no moving joint between the links {base!r} and {ends}")
    part = _with_followers(tree, part)
    _check(tree, part)
    return part


def _with_followers(tree: UrdfTree, part: MovingPart) -> MovingPart:
    """The part with the joints below its base that follow its own, on links of their own."""
    moving = part.moving_names
    mimics = [joint for joint in tree.above.values() if joint.mimic is not None and joint.name not in moving]
    below = (joint for joint in mimics if tree.path(part.base, joint.child) is not None)
    further = [joint.child for joint in below if rest(tree, joint)[1] in moving]
    if not further:
        return part
    return replace(_between(tree, part.base, (*part.tips, *further)), notes=part.notes, held=part.held)


def _known(tree: UrdfTree, link: str) -> str:
    if link not in tree.links:
        near = difflib.get_close_matches(link, tree.links, 3)
        raise UnknownName(f"link in {tree.source}", link, tree.links, near)
    return link


def _between(tree: UrdfTree, base: str, tips: tuple[str, ...]) -> MovingPart:
    names: set[str] = set()
    for tip in tips:
        path = tree.path(base, tip)
        if path is None:
            raise InputError(
                f"{tree.source}: link {tip!r} does not hang below link {base!r}; choose another base or tip: "
                f"{_how_they_hang(tree, base, tip)}"
            )
        names |= {joint.name for joint in path}
    joints, todo = list[TreeJoint](), tree.below[base][::-1]
    while todo:
        joint = todo.pop()
        if joint.name in names:
            joints.append(joint)
            todo += reversed(tree.below[joint.child])
    above = {joint.parent for joint in joints if len(tips) > 1}
    return MovingPart(base, tuple(tip for tip in tips if tip not in above), joints)


def _how_they_hang(tree: UrdfTree, base: str, tip: str) -> str:
    if tree.path(tip, base) is not None:
        return "it is the other way round"
    above = {joint.parent for joint in tree.path(tree.root, base) or ()}
    shared = next(joint.parent for joint in reversed(tree.path(tree.root, tip) or ()) if joint.parent in above)
    return f"both hang below link {shared!r}"


def _by_default(tree: UrdfTree, base: str) -> MovingPart:
    tips = _moving_tips(tree, base)
    if not tips:
        raise InputError(f"{tree.source}: no moving joint below link {base!r}")
    if len(tips) == 1:
        return _without_gripper(tree, base, tips[0])
    paths = [tree.path(base, tip) or [] for tip in tips]
    shared: list[TreeJoint] = [
        level[0] for level in zip(*paths, strict=False) if all(joint is level[0] for joint in level)
    ]
    arm = _count(shared)
    if not (arm >= _FEWEST_OF_ARM and max(map(_count, paths)) - arm < arm):
        return _limbs_alone(tree, base, tips)
    fork = shared[-1].child
    below = [[joint.name for joint in tree.path(fork, tip) or () if joint.kind != "fixed"] for tip in tips]
    fingers = list(dict.fromkeys(names[0] for names in below))
    what = f"the chain ends here, where fingers part; {listed_names(fingers)} are held at zero"
    note = Finding("assumed", f"link {fork!r}", what, "`tip` chooses another end")
    return _without_gripper(tree, base, fork, (note,), tuple(fingers))


def _without_gripper(
    tree: UrdfTree, base: str, tip: str, notes: tuple[Finding, ...] = (), fingers: tuple[str, ...] = ()
) -> MovingPart:
    """The chain to a tip, up to the first of the joints at its end that move a gripper."""
    part = _between(tree, base, (tip,))
    kept = _up_to(part.moving, lambda joint: _moves_gripper(tree, joint))
    held = part.moving[len(kept) :]
    if not held or not kept:  # a hand or a finger alone is kept whole
        return replace(part, notes=notes, held=fingers)
    shorter = _between(tree, base, (held[0].parent,))
    names = (*(joint.name for joint in held), *fingers)
    return replace(
        shorter, notes=(*_held(tree, held, "moves a gripper", f"`tip={tip!r}` includes it"), *notes), held=names
    )


def _limbs_alone(tree: UrdfTree, base: str, tips: Sequence[str]) -> MovingPart:
    """All limbs, without what they hold; wheels and fingers only where there is nothing else."""
    limbs = _limbs(tree, base, tips)
    ends = [limb[-1].child for limb in map(_without_wheels, limbs) if limb] or [limb[-1].child for limb in limbs]
    part = _between(tree, base, tuple(ends))
    still = f"{STANDS_STILL}, and so does all that it carries but these limbs"
    notes = [Finding("assumed", f"link {base!r}", still, "`base_link` and `tip` choose a part")]
    links = {joint.child for tip in tips for joint in tree.path(base, tip) or ()}
    moving = part.moving_names
    held = [j for link in tree.below if link in links and (j := tree.above[link]).kind != "fixed"]
    if held := [joint for joint in held if joint.name not in moving]:
        notes += _held(tree, held, "moves a gripper, or is a wheel", "`tip`, given for each end, includes it")
    return replace(part, notes=tuple(notes), held=tuple(joint.name for joint in held))


def _without_wheels(limb: Sequence[TreeJoint]) -> list[TreeJoint]:
    """A limb up to the wheels, or fingers, at its end; nothing where it is one."""
    return _up_to(limb, lambda joint: _ENDS.search(f"{joint.name} {joint.child}"))


def _up_to(limb: Sequence[TreeJoint], ends: Callable[[TreeJoint], object]) -> list[TreeJoint]:
    """A limb without the joints at its end that are fixed, or of a kind."""
    left = list(limb)
    while left and (left[-1].kind == "fixed" or ends(left[-1])):
        left.pop()
    return left


def _moves_gripper(tree: UrdfTree, joint: TreeJoint) -> bool:
    """Whether a joint follows one that does or bears the name of a gripper, or its link that of a part of one."""
    if joint.mimic is not None:
        leaders = [other for other in tree.above.values() if other.name == rest(tree, joint)[1]]
        return all(leader.kind == "fixed" or _moves_gripper(tree, leader) for leader in leaders)
    if _FINGER.search(joint.name) or _GRIPPER.search(joint.name):
        return True
    if _ARM.search(joint.name):
        return False
    gripper = _GRIPPER.search(joint.child) and not _NUMBERED.search(joint.name)
    return bool(_HAND.search(joint.name) or _FINGER.search(joint.child) or gripper)


def _held(tree: UrdfTree, held: Sequence[TreeJoint], what: str, advice: str) -> tuple[Finding, ...]:
    where = f"joint {listed_names(joint.name for joint in held)}"
    note = Finding("assumed", where, f"{what}: held at zero and left out", advice)
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


def _count(path: Iterable[TreeJoint]) -> int:
    """Number of joints that move on their own."""
    return sum(joint.kind != "fixed" and joint.mimic is None for joint in path)


def _limbs(tree: UrdfTree, base: str, tips: Sequence[str]) -> list[list[TreeJoint]]:
    """What each chain has behind the last fork before it, without fingers and joints that move a gripper."""
    paths = [tree.path(base, tip) or [] for tip in tips]
    through = Counter(joint.name for path in paths for joint in path)
    between_forks = ([list(part) for _, part in groupby(path, lambda joint: through[joint.name])] for path in paths)
    parted = [own for parts in between_forks if (own := [part for part in parts if _count(part)])]
    deepest: dict[str, int] = {}  # joints behind the last one of a part, on the longest chain
    for parts in parted:
        for k, part in enumerate(parts):
            behind = _count(j for later in parts[k + 1 :] for j in later if not _moves_gripper(tree, j))
            deepest[part[-1].name] = max(deepest.get(part[-1].name, 0), behind)
    limbs: dict[str, list[TreeJoint]] = {}
    for parts in parted:
        hands = (part for part in parts if _count(part) >= _FEWEST_OF_ARM and deepest[part[-1].name] < _count(part))
        limb = next(hands, parts[-1])
        limb = _up_to(limb, lambda joint: _moves_gripper(tree, joint)) or limb
        limbs.setdefault(limb[-1].child, limb)
    return list(limbs.values())


Ends = tuple[str, tuple[str, ...]]  # a base and its tips


def working_ends(
    tree: UrdfTree,
    candidates: Iterable[Ends],
    given: Ends,
    accepts: Callable[[MovingPart], object] = lambda part: None,
) -> str:
    """Options that choose what can be read, each with what differs from the ends given; empty if none does."""
    texts = []
    for base, tips in candidates:
        with suppress(InputError):
            part = _between(tree, base, tips)
            _check(tree, _with_followers(tree, part), advise=False)
            accepts(part)
            options = [f"`base_link={base!r}`"] if base != given[0] else []
            options += [f"`tip={tip!r}`" for tip in part.tips] if part.tips != given[1] else []
            if part.moving and options:
                texts.append(" and ".join(options))
    return ", or ".join(dict.fromkeys(texts))


def _check(tree: UrdfTree, part: MovingPart, *, advise: bool = True) -> None:
    """Refuse joints that independent coordinates cannot hold."""

    def refuse(joint: TreeJoint, what: str, otherwise: str = _UNTIE) -> None:
        working = working_ends(tree, _beside(tree, part, joint), (part.base, part.tips)) if advise else ""
        raise InputError(f"{tree.source}: {what}; {f'what works is {working}' if working else otherwise}")

    moving = {joint.name: joint for joint in part.moving}
    for joint in part.moving:
        if joint.kind not in MOVING:
            refuse(
                joint,
                f"joint {joint.name!r} on the {part.word} is {joint.kind}, expected {', '.join(MOVING)} or fixed",
                'no joint of the other kinds moves before or behind it: write type="fixed" if it stands still',
            )
        if joint.mimic is not None and (joint.mimic.curved or joint.mimic.joint not in moving):
            what = "by a curve, expected a line" if joint.mimic.curved else "which stands still"
            refuse(joint, f"joint {joint.name!r} on the {part.word} mimics joint {joint.mimic.joint!r}, {what}")
    for joint in tree.above.values():
        leader = rest(tree, joint)[1]
        if joint.name not in moving and leader in moving:
            where = f"joint {joint.name!r} off the {part.word} mimics joint {leader!r} on the {part.word}"
            refuse(moving[leader], f"{where}, expected one that stands still")


def _beside(tree: UrdfTree, part: MovingPart, joint: TreeJoint) -> tuple[Ends, Ends]:
    """What moves behind a joint, and what moves without it."""
    tips = tuple(tip for tip in part.tips if tree.path(joint.child, tip) is not None)
    others = tuple(tip for tip in part.tips if tip not in tips and len(part.tips) > 1)
    without = others if others and joint.parent == part.base else (*others, joint.parent)
    return (joint.child, tips or part.tips), (part.base, without)


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
            names = listed_names(sorted(visited))
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
