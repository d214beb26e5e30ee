"""What a robot is: a tree of joints and links, bodies beside it, drives, limits, and known structure.

All values are SI, angles in radians; every array is read-only. A `Robot` checks itself when it is made, whichever
reader made it, and its content hash identifies it in the files that are written.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from regressors.arguments import checked
from regressors.errors import Finding, InputError, check_names, listed_names, long_name
from regressors.quantities import place_of
from regressors.robot.closures import Closure, MimicJoint, check_closures
from regressors.robot.gears import ConstantRatio, GearFunction
from regressors.robot.inertia import PARAMETERS_PER_LINK, Array, is_rotation, pose_of, skew
from regressors.robot.shapes import Part

JointKind = Literal["revolute", "prismatic"]


class Rebuilt:
    """Pickled and copied as the arguments of the constructor: what is read back is checked, and read-only, again."""

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        values = (getattr(self, f.name) for f in dataclasses.fields(self))  # type: ignore[arg-type]
        return type(self), tuple(dict(value) if isinstance(value, MappingProxyType) else value for value in values)

    def _freeze(self, name: str, shape: tuple[int, ...], what: str) -> Array:
        """Make a field a read-only array of a shape."""
        array = np.array(getattr(self, name), dtype=float)
        if array.shape != shape:
            raise InputError(f"{what}: expected shape {shape}, given {array.shape}")
        array.setflags(write=False)
        object.__setattr__(self, name, array)
        return array


@dataclass(frozen=True, eq=False)
class Joint(Rebuilt):
    """One joint and where it sits: its link's frame has the pose ``placement(q=0) motion(q)`` in the parent link's."""

    name: str
    kind: JointKind
    rotation: Array  # (3, 3) axes of the link frame in the parent's frame at q = 0
    translation: Array  # (3,) origin of the link frame in the parent's frame at q = 0 [m]
    # (3,) unit vector of the joint axis in the link's own frame
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))

    def __post_init__(self) -> None:
        R = self._freeze("rotation", (3, 3), f"joint {self.name!r}, rotation")
        axis = self._freeze("axis", (3,), f"joint {self.name!r}, axis")
        self._freeze("translation", (3,), f"joint {self.name!r}, translation")
        if self.kind not in ("revolute", "prismatic"):
            raise InputError(f"joint {self.name!r}: kind must be revolute or prismatic, given {self.kind!r}")
        if not is_rotation(R):
            raise InputError(f"joint {self.name!r}: rotation is not a rotation matrix")
        if not np.isclose(np.linalg.norm(axis), 1.0, atol=1e-9):
            raise InputError(f"joint {self.name!r}: axis must have length 1, given {np.linalg.norm(axis):g}")
        if not np.all(np.isfinite(self.translation)):
            raise InputError(f"joint {self.name!r}: translation must be finite, given {self.translation.tolist()}")

    @classmethod
    def from_mdh(
        cls, name: str, kind: JointKind, *, alpha: float, a: float, d: float = 0.0, offset: float = 0.0
    ) -> Joint:
        """Joint from modified Denavit-Hartenberg parameters, ``Rx(alpha) Tx(a) Rz(theta) Tz(d)`` [Craig 1986]."""
        # twist alpha [rad] and length a [m] from the previous z axis to this one; ``theta = q + offset`` of a revolute
        # joint, ``d + q`` along z of a prismatic one [m, rad]
        ca, sa, co, so = np.cos(alpha), np.sin(alpha), np.cos(offset), np.sin(offset)
        rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
        rz = np.array([[co, -so, 0], [so, co, 0], [0, 0, 1]])
        return cls(name, kind, rx @ rz, np.array([a, -d * sa, d * ca]))

    @property
    def unit(self) -> str:
        """Unit of the joint coordinate, ``rad`` or ``m``."""
        return "rad" if self.kind == "revolute" else "m"

    def motion(self, q: float) -> Array:
        """Pose of the link frame in the parent's frame at joint position ``q`` [rad or m], shape (4, 4)."""
        if self.kind == "prismatic":
            return pose_of(self.rotation, self.translation + self.rotation @ (self.axis * q))
        K = skew(self.axis)
        return pose_of(self.rotation @ (np.eye(3) + np.sin(q) * K + (1 - np.cos(q)) * K @ K), self.translation)


@dataclass(frozen=True, eq=False)
class Link(Rebuilt):
    """A rigid body moved by the joint of the same number."""

    name: str
    # (10,) inertial parameters about the link frame's origin, see `regressors.robot.inertia`; None where unknown
    theta: Array | None = None
    # in parameter names; 0 for its place among them, branches following the links. A robot some of whose joints rest
    # keeps the numbers of the whole robot
    number: int = 0

    def __post_init__(self) -> None:
        if self.theta is None:
            return
        theta = self._freeze("theta", (PARAMETERS_PER_LINK,), f"link {self.name!r}, inertial parameters")
        if not np.all(np.isfinite(theta)):
            raise InputError(f"link {self.name!r}: inertial parameters must be finite, given {theta.tolist()}")


BASE = "base"


@dataclass(frozen=True, eq=False)
class Branch(Rebuilt):
    """A body beside the links that moves with a linear combination of the joints, such as a bar of a parallelogram.

    Its joint sits on a link, or on another branch, and its coordinate is ``coupling @ q + offset``.
    """

    parent: str  # name of the link or of the earlier branch that carries it, or `BASE` for the base frame
    joint: Joint  # where it sits: pose of its body's frame in the parent's frame
    link: Link  # the body; the branch bears its name
    coupling: Array  # (n,) coordinate of the branch's joint per coordinate of the robot's joints; not all zero
    offset: float = 0.0  # coordinate of the branch's joint at q = 0 [rad or m]

    def __post_init__(self) -> None:
        row = self._freeze("coupling", (np.size(self.coupling),), f"branch {self.name!r}, coupling")
        if not np.all(np.isfinite(row)) or not np.isfinite(self.offset):
            raise InputError(
                f"branch {self.name!r}: coupling and offset must be finite, given {row.tolist()} and {self.offset}"
            )
        if not np.any(row):
            raise InputError(
                f"branch {self.name!r}: its coupling is zero, so it does not move; make it a part of {self.parent!r}"
            )

    @property
    def name(self) -> str:
        """Name of the body."""
        return self.link.name


LIMITED = ("position", "velocity", "acceleration", "jerk", "torque")


@dataclass(frozen=True, eq=False)
class Limits(Rebuilt):
    """Bounds on a set of coordinates; infinite where there is none."""

    lower: Array  # (n,) position [rad or m]; ``lower < upper``
    upper: Array
    velocity: Array  # (n,) largest magnitude, > 0 [rad/s, rad/s^2, rad/s^3, Nm, or the same with m and N]
    acceleration: Array
    jerk: Array
    torque: Array

    def __post_init__(self) -> None:
        n = np.size(self.lower)
        for name in (f.name for f in dataclasses.fields(self)):
            array = self._freeze(name, (n,), f"limit {name}")
            if np.any(np.isnan(array)):
                raise InputError(f"limit {name}: NaN at number {int(np.argmax(np.isnan(array))) + 1} is not a number")

    @classmethod
    def none(cls, n: int) -> Limits:
        """No limits on ``n`` coordinates."""
        inf = np.full(n, np.inf)
        return cls(-inf, inf, inf, inf, inf, inf)

    def check(self, labels: tuple[str, ...]) -> None:
        """Raise `InputError` naming, by its label, the first coordinate whose bounds leave no room."""
        for label, lower, upper in zip(labels, self.lower, self.upper, strict=True):
            if not lower < upper:
                raise InputError(f"{label}: lower position limit {lower:g} must be below the upper one {upper:g}")
            if np.isfinite(lower) != np.isfinite(upper):
                raise InputError(f"{label}: position limits must be two or none, given {lower:g} and {upper:g}")
        for name in ("velocity", "acceleration", "jerk", "torque"):
            for label, bound in zip(labels, getattr(self, name), strict=True):
                if not bound > 0:
                    raise InputError(f"{label}: {name} limit must be greater than zero, given {bound:g}")

    def take(self, index: ArrayLike) -> Limits:
        """Limits of a selection of the coordinates."""
        return Limits(*(getattr(self, f.name)[np.asarray(index, dtype=int)] for f in dataclasses.fields(self)))


@dataclass(frozen=True, eq=False)
class Drive:
    """A motor and its gear, acting on one drive coordinate."""

    name: str
    # motor angle per drive coordinate as a function of it, `ConstantRatio` or `BallScrew`
    ratio: GearFunction = field(default_factory=ConstantRatio)
    rotor_inertia: float | None = None  # inertia of the motor's rotor [kg m^2]; None where there is none to identify
    # friction ``tau = viscous * dz + coulomb * sign(dz)`` at the drive coordinate [Nm s, Nm], where known
    coulomb: float | None = None
    viscous: float | None = None
    # True if the joint that this drive belongs to is held: its limits hold still, but it has no parameters
    rests: bool = False


@dataclass(frozen=True, eq=False)
class Transmission(Rebuilt):
    """How drives move joints: ``z = C q + z0``, hence ``tau_q = C' tau_z``."""

    coupling: Array  # (m, n) ``C``; the identity where each drive moves its own joint
    drives: tuple[Drive, ...]
    limits: Limits  # bounds on the drive coordinates z, m of them
    offset: Array = field(default_factory=lambda: np.zeros(0))  # (m,) ``z0``, zero if not given

    def __post_init__(self) -> None:
        C = self._freeze("coupling", np.shape(self.coupling), "transmission, coupling")
        if C.ndim != 2 or C.shape[0] != len(self.drives) or self.limits.lower.size != len(self.drives):
            raise InputError(
                f"transmission: {len(self.drives)} drives need as many coupling rows and limits, "
                f"given a coupling of shape {C.shape} and {self.limits.lower.size} limits"
            )
        if not np.all(np.isfinite(C)):
            raise InputError("transmission: the coupling matrix must hold finite numbers")
        if not np.size(self.offset):
            object.__setattr__(self, "offset", np.zeros(len(self.drives)))
        self._freeze("offset", (len(self.drives),), "transmission, offset")


@dataclass(frozen=True)
class Aggregates:
    """Parameters that the model is written in, each a linear combination of standard ones."""

    joints: tuple[str, ...]  # the moving joints for which this form holds
    parameters: Mapping[str, Mapping[str, float]]  # name of the aggregate to ``{standard parameter: coefficient}``


@dataclass(frozen=True)
class Structure:
    """What is known of the parameters before any measurement."""

    zero: frozenset[str] = frozenset()  # standard parameters known to vanish, such as ``m2c2y`` of a symmetric link
    equal: tuple[tuple[str, ...], ...] = ()  # groups of standard parameters that share one value
    aggregates: tuple[Aggregates, ...] = ()  # combinations that replace standard parameters, per set of moving joints
    # parameters of limbs that mirror others, as ``{standard parameter of the other: coefficient}``; no file states them
    mirrored: Mapping[str, Mapping[str, float]] = field(default_factory=dict, metadata={"derived": True})


@checked
@dataclass(frozen=True, eq=False)
class Robot(Rebuilt):
    """A robot on a base that stands still, or that six joints move: everything its regressor and its limits need.

    Parameters
    ----------
    name : str
    joints : tuple of Joint
        From the base outwards.
    links : tuple of Link
        Link k is moved by joint k.
    limits : Limits
        On the joint coordinates.
    transmission : Transmission, optional
        Drives and their coupling; without it each joint has its own drive and nothing is known of it.
    gravity : array_like, shape (3,)
        In the base frame [m/s^2].
    structure : Structure
    constants : mapping of str to float
        Named lengths and ratios, used to write base parameters as readable expressions.
    source : str
        Where the description comes from.
    branches : tuple of Branch
        Bodies beside the links, each after the one that carries it.
    home : array_like, shape (n,), optional
        Pose in which the robot waits [rad or m].
    shapes : tuple of Part
        Capsules around the links, for checks of collisions; no part of the hash, since no regressor depends on them.
    parents : tuple of int
        Number of the link that carries each joint, 1 for the first, and 0 for the base; smaller than the joint's own. A
        chain, in which each joint sits on the link before it, if not given.
    closures : tuple of Closure or MimicJoint
        What closes loops: the joints and links are the tree that is left when these are cut; and joints that follow.
    passive : tuple of str
        Joints of these loops that no drive acts on, by name: their torque is zero.
    base_joints : tuple of str
        First joints, by name, which stand for the motion of the base: no drive acts on them. See
        `regressors.robot.moving_base`.
    base : Link, optional
        What stands still, with all that hangs on it; no part of the description.
    notes : tuple of Finding
        What the reader noticed; no part of the description, nor of its hash.

    Raises
    ------
    InputError
        No joints, counts that differ, a name twice, limits that leave no room, or a body that nothing carries.
    """

    name: str
    joints: tuple[Joint, ...]
    links: tuple[Link, ...]
    limits: Limits
    transmission: Transmission | None = None
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    structure: Structure = Structure()
    constants: Mapping[str, float] = field(default_factory=dict)
    source: str = ""
    branches: tuple[Branch, ...] = ()
    home: Array | None = None
    shapes: tuple[Part, ...] = ()
    parents: tuple[int, ...] = ()
    closures: tuple[Closure | MimicJoint, ...] = ()
    passive: tuple[str, ...] = ()
    base_joints: tuple[str, ...] = ()
    base: Link | None = None
    notes: tuple[Finding, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        n = len(self.joints)
        if n == 0:
            raise InputError(f"robot {self.name!r} has no moving joint")
        if len(self.links) != n or self.limits.lower.size != n:
            raise InputError(
                f"robot {self.name!r}: {n} joints, but {len(self.links)} links and {self.limits.lower.size} limits"
            )
        drives = () if self.transmission is None else self.transmission.drives
        parts = (self.joints, self.links, drives, self.branches, [branch.joint for branch in self.branches])
        for name in (self.name, *(part.name for some in parts for part in some)):
            _check_name(name)
        names = self.joint_names
        if len(set(names)) != n:
            raise InputError(f"robot {self.name!r}: two joints share a name: {', '.join(names)}")
        self._freeze("gravity", (3,), "gravity")
        object.__setattr__(self, "constants", MappingProxyType(dict(self.constants)))
        if not np.all(np.isfinite(self.gravity)):
            raise InputError(
                f"robot {self.name!r}: gravity must hold three finite numbers, given {self.gravity.tolist()}"
            )
        if self.home is not None:
            home = self._freeze("home", (n,), f"robot {self.name!r}, home")
            if not np.all(np.isfinite(home)):
                raise InputError(f"robot {self.name!r}: home must hold finite numbers, given {home.tolist()}")
        self.limits.check(tuple(f"joint {name}" for name in names))
        if self.transmission is not None:
            if self.transmission.coupling.shape[1] != n:
                raise InputError(f"robot {self.name!r}: the coupling must have {n} columns, one per joint")
            self.transmission.limits.check(tuple(f"drive {d.name}" for d in self.transmission.drives))
        object.__setattr__(self, "parents", tuple(map(int, self.parents)) or tuple(range(n)))
        if not self.is_chain or self.branches:
            _check_tree(self)
        known = (BASE, *(body.name for body in self.bodies))
        check_names(f"link with a shape, of robot {self.name!r},", (part.link for part in self.shapes), known)
        check_closures(self.name, self.closures, self.passive, names, known)
        if names[: len(self.base_joints)] != self.base_joints:
            raise InputError(f"robot {self.name!r}: base_joints must be its first joints, in their order")

    def __repr__(self) -> str:
        """One line."""
        return f"<Robot {self.name}: {self.n} joints, {listed_names(self.joint_names)}>"

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints from the base outwards."""
        return tuple(joint.name for joint in self.joints)

    @property
    def is_chain(self) -> bool:
        """Whether each joint sits on the link before it."""
        return self.parents == tuple(range(self.n))

    @property
    def tips(self) -> tuple[Link, ...]:
        """Links that carry no other one: the last link of a chain, or of each branch of a tree."""
        return tuple(link for k, link in enumerate(self.links, 1) if k not in self.parents)

    @property
    def limbs(self) -> tuple[frozenset[str], ...]:
        """Names of the links from the base to each of the tips; of all bodies of a chain, branches included."""
        if self.is_chain:
            return (frozenset(body.name for body in self.bodies),)
        paths = [frozenset[str]()]
        for link, parent in zip(self.links, self.parents, strict=True):
            paths.append(paths[parent] | {link.name})
        return tuple(path for k, path in enumerate(paths) if k not in self.parents)

    def last_link(self, what: str) -> int:
        """Index of the one link that carries something, such as a tool.

        Raises
        ------
        InputError
            There are several last links.
        """
        if self.is_chain:
            return self.n - 1
        raise InputError(
            f"robot {self.name!r} ends in {listed_names([link.name for link in self.tips])}, and {what} has its place "
            "on one last link; read the part of its URDF or MJCF that ends there, with `tip`"
        )

    def check_open(self, what: str) -> None:
        """Raise `InputError` for what knows neither closed loops nor moving bases, where the robot has one."""
        if self.base_joints:
            raise InputError(
                f"robot {self.name!r}: {what} does not support a moving base; put the base on a stand, and take "
                "a log mapping without `base`"
            )
        if self.closures:
            raise InputError(
                f"robot {self.name!r}: {what} does not support closed loops, and it has {self.closures[0].label}; "
                "read a part without loops with `tip`"
            )

    @property
    def link_numbers(self) -> tuple[int, ...]:
        """Number of each link in parameter names."""
        return self.body_numbers[: self.n]

    @property
    def reading_notes(self) -> tuple[str, ...]:
        """What the reader of its description took for granted, corrected, or doubts."""
        return tuple(str(note) for note in self.notes if note.kind in ("assumed", "snapped", "suspicious"))

    @property
    def bodies(self) -> tuple[Link, ...]:
        """Every body that has inertial parameters: the links, then those of the branches."""
        return (*self.links, *(branch.link for branch in self.branches))

    @property
    def body_numbers(self) -> tuple[int, ...]:
        """Number of each of the `bodies` in parameter names."""
        return tuple(body.number or place for place, body in enumerate(self.bodies, 1))

    def joint_index(self, name: str) -> int:
        """Index of a joint by its name or by its number, 1 for the first.

        Raises
        ------
        UnknownName
            No such joint.
        """
        return place_of("joint", name, self.joint_names)

    def replace(self, **changes: object) -> Robot:
        """A copy with some fields changed, checked again; one of a chain with other joints is a chain."""
        if self.is_chain:
            changes.setdefault("parents", ())
        return dataclasses.replace(self, **changes)  # type: ignore[arg-type]

    def description(self) -> dict[str, object]:
        """The whole robot as plain lists, numbers and strings, ready for JSON."""
        content = plain(self)
        assert isinstance(content, dict)
        content["shapes"] = [part.to_dict() for part in self.shapes]
        # robots without them keep the hash that they had before there were branches, homes, trees, or loops
        optional = ("branches", "home", "shapes", "parents", "closures", "passive", "base_joints")
        if self.is_chain:
            content["parents"] = []
        stated = ((name, value) for name, value in content.items() if name not in ("notes", "base"))
        return {name: value for name, value in stated if value or name not in optional}

    def sha256(self) -> str:
        """Hash of the content, independent of the format and the place of the file that it was read from."""
        content = {key: value for key, value in self.description().items() if key not in ("source", "shapes")}
        text = json.dumps(content, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


def placed_bodies(robot: Robot) -> Iterator[tuple[str, str, Joint, Array, float]]:
    """Each body after the one that carries it: its name, that one's, its joint, row and offset of its coordinate."""
    names = (BASE, *(link.name for link in robot.links))
    for name, parent, joint, row in zip(names[1:], robot.parents, robot.joints, np.eye(robot.n), strict=True):
        yield name, names[parent], joint, row, 0.0
    for branch in robot.branches:
        yield branch.name, branch.parent, branch.joint, branch.coupling, branch.offset


def finite_ranges(robot: Robot) -> tuple[Array, Array]:
    """Lower and upper position limits of the joints; half a turn either way where there is none."""
    lower, upper = robot.limits.lower, robot.limits.upper
    return np.where(np.isfinite(lower), lower, -np.pi), np.where(np.isfinite(upper), upper, np.pi)


def transmission_of(robot: Robot) -> Transmission:
    """How its drives move its joints; where that is not stated, each by one of its own, of which nothing is known."""
    if robot.transmission is not None:
        return robot.transmission
    return Transmission(np.eye(robot.n), tuple(map(Drive, robot.joint_names)), Limits.none(robot.n))


def drive_numbers(robot: Robot) -> tuple[int, ...]:
    """Number of each of these drives in parameter names."""
    return robot.link_numbers if robot.transmission is None else tuple(range(1, len(robot.transmission.drives) + 1))


def linear_drives(robot: Robot) -> tuple[bool, ...]:
    """Whether each of these drives moves a prismatic joint."""
    prismatic = [joint.kind == "prismatic" for joint in robot.joints]
    return tuple(bool(np.any(row[prismatic])) for row in transmission_of(robot).coupling)


def _check_name(name: object) -> None:
    """Raise `InputError` for a name that would break a line of a message, a table, a figure or a file's header."""
    if not isinstance(name, str) or not name.isprintable():
        shown = ascii(name)
        raise InputError(f"a name is printable text, given {shown if len(shown) <= 60 else shown[:57] + '...'}")
    if (wrong := long_name(name)) is not None:
        raise InputError(wrong)


def _check_tree(robot: Robot) -> None:
    here = f"robot {robot.name!r}"
    if len(robot.parents) != robot.n or not all(0 <= parent <= k for k, parent in enumerate(robot.parents)):
        raise InputError(
            f"{here}: expected, for each of {robot.n} joints, the number of an earlier link as its parent, or 0 for "
            f"the base, given {list(robot.parents)}"
        )
    carriers = [BASE, *(link.name for link in robot.links)]
    for branch in robot.branches:
        check_names(f"link or earlier branch, as parent of branch {branch.name!r},", [branch.parent], carriers)
        if branch.coupling.size != robot.n:
            raise InputError(
                f"{here}, branch {branch.name!r}: the coupling must have {robot.n} numbers, one per joint, "
                f"given {branch.coupling.size}"
            )
        carriers.append(branch.name)
    if len(set(carriers)) < len(carriers):
        raise InputError(f"{here}: two of the base, links and branches share a name: {', '.join(carriers)}")
    numbers = robot.body_numbers
    if len(set(numbers)) < len(numbers):
        raise InputError(f"{here}: two links or branches share a number: {', '.join(map(str, numbers))}")


def plain(value: object) -> object:
    """Nested dicts and lists of plain values, which JSON holds, and which can be compared."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        stated = (f.name for f in dataclasses.fields(value) if not f.metadata.get("derived"))
        fields = {name: plain(getattr(value, name)) for name in stated}
        untyped = isinstance(value, Robot | Joint | Link | Branch | Limits)
        return fields if untyped else {"type": type(value).__name__, **fields}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, frozenset):
        return sorted(plain(item) for item in value)  # type: ignore[type-var]
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value
