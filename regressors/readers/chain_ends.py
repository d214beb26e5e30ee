"""Which chain of a URDF is the robot: from the base to the tip, or to where its gripper begins."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass

from regressors.errors import InputError, UnknownName
from regressors.readers.joint_ranges import range_of
from regressors.readers.resting_joints import rest
from regressors.readers.urdf_tree import MOVING, TreeJoint, UrdfTree, listing
from regressors.robot.finding import Finding

_FINGER = re.compile(r"finger|jaw|claw|knuckle", re.IGNORECASE)
_GRIPPER = re.compile(r"gripper", re.IGNORECASE)
_HAND = re.compile(r"(?<![a-z])hand(?![a-z])", re.IGNORECASE)
_ARM = re.compile(r"wrist|elbow|shoulder|arm|axis", re.IGNORECASE)
_NUMBERED = re.compile(r"\d")  # joint6 may well carry the body of the gripper
_FEWEST_OF_ARM = 3  # joints; what parts behind fewer is no hand


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints from the base to the tip.

    Parameters
    ----------
    base, tip : str
        First and last link.
    path : list of TreeJoint
        All joints between them, fixed ones too.
    notes : tuple of Finding
        On what was left out.
    held : tuple of str
        Joints that these notes name.
    """

    base: str
    tip: str
    path: list[TreeJoint]
    notes: tuple[Finding, ...] = ()
    held: tuple[str, ...] = ()

    @property
    def moving(self) -> list[TreeJoint]:
        """Joints that are not fixed."""
        return [joint for joint in self.path if joint.kind != "fixed"]


def chain_of(tree: UrdfTree, base: str | None, tip: str | None) -> Chain:
    """The chain between two links, or below the base, checked.

    Where no tip is given, the chain ends where fingers part, and before joints that move a gripper.

    Parameters
    ----------
    tree : UrdfTree
    base, tip : str, optional
        Names of links; the root, and the last link that moves, if not given.

    Raises
    ------
    UnknownName
        No such link.
    InputError
        No such chain, several, or joints in it that do not move on their own.
    """
    base = tree.root if base is None else _known(tree, base)
    chain = _without_gripper(tree, base) if tip is None else _between(tree, base, _known(tree, tip))
    if not chain.moving:
        raise InputError(f"{tree.source}: no moving joint between the links {base!r} and {chain.tip!r}")
    _check(tree, chain.moving)
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
    fork = tips[0] if len(tips) == 1 else _fork(tree, base, tips)
    fingers = [] if len(tips) == 1 else _first_of_fingers(tree, fork, tips)
    notes = (_fingers(fork, fingers),) if fingers else ()
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
    outside = [joint.name for joint in held if not _allows(joint, rest(tree, joint)[0])]
    if not outside:
        return (note,)
    return (note, Finding("suspicious", f"joint {', '.join(outside)}", "held where its limits do not allow it"))


def _allows(joint: TreeJoint, position: float) -> bool:
    lower, upper = range_of(joint)
    return lower <= position <= upper


def _first_of_fingers(tree: UrdfTree, fork: str, tips: Sequence[str]) -> list[str]:
    first = (next(joint.name for joint in tree.path(fork, tip) or () if joint.kind != "fixed") for tip in tips)
    return list(dict.fromkeys(first))


def _fingers(fork: str, fingers: Sequence[str]) -> Finding:
    what = f"the chain ends here, where fingers part; {', '.join(listing(fingers))} are held at zero"
    return Finding("assumed", f"link {fork!r}", what, "`tip` chooses another end")


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
    arm = sum(joint.kind != "fixed" for joint in shared)
    longest = max(sum(joint.kind != "fixed" for joint in path) for path in paths) - arm
    if arm >= _FEWEST_OF_ARM and longest < arm:
        return shared[-1].child
    hint = f" (`tip={shared[-1].child!r}` ends where they part)" if arm else ""
    raise InputError(
        f"{tree.source}: {len(tips)} moving chains start from link {base!r}; choose the last link with `tip`{hint}; "
        f"the chains end at: {', '.join(listing(tips))}"
    )


def _check(tree: UrdfTree, chain: Sequence[TreeJoint]) -> None:
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
        leader = rest(tree, joint)[1]
        if joint.name not in moving and leader in moving:
            raise InputError(
                f"{tree.source}: joint {joint.name!r} off the chain mimics joint {leader!r} on the chain, expected "
                "one that stands still; choose another base or tip"
            )
