"""Schema of robot YAML files: fields, units, and the conversion of each section to a part of a `Robot`.

Lengths are in metres, angles in radians or as text such as ``90 deg``. Fields that are not given are unknown.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationInfo,
    field_validator,
    model_validator,
)

from regressors.errors import InputError, check_names, long_name, shortened
from regressors.readers.documents import described
from regressors.robot.closures import Closure, MimicJoint
from regressors.robot.gears import BallScrew, ConstantRatio, GearFunction
from regressors.robot.inertia import Array, from_centre_of_mass, inertia_tensor, rotation_from_rpy, transport
from regressors.robot.robot import Branch, Drive, Joint, JointKind, Limits, Link
from regressors.robot.shapes import Capsule, Part, vector_of

_ROUNDING = 1e-15
_DEGREES = re.compile(r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*deg(\S*)")


_NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_POWER = re.compile(r"([A-Za-z][A-Za-z0-9_]*)(?:\^(-?[0-9]{1,2}))?")


Coefficient = tuple[float, list[tuple[str, int]]]  # a number, times powers of named constants


def coefficient_of(text: str) -> Coefficient:
    """Coefficient from its text: ``[+-] factor * factor * ...`` with factors ``2.5``, ``l2`` or ``n1^2``."""
    unsigned = text.strip()
    number = -1.0 if unsigned.startswith("-") else 1.0
    powers = []
    for factor in unsigned.removeprefix("-" if number < 0 else "+").split("*"):
        if _NUMBER.fullmatch(factor.strip()):
            number *= float(factor)
        elif power := _POWER.fullmatch(factor.strip()):
            powers.append((power[1], int(power[2] or 1)))
        else:
            raise InputError(f"expected a number or a product such as '-2*l2*n1^2', given {text!r}")
    if not math.isfinite(number):
        raise InputError(f"coefficient must be finite, given {text!r}")
    return number, powers


def coefficient_value(coefficient: Coefficient, constants: Mapping[str, float]) -> float:
    """Value of the product for given values of the constants."""
    value, powers = coefficient
    check_names("constant", (name for name, _ in powers), constants)
    for name, exponent in powers:
        try:
            value *= constants[name] ** exponent
        except (OverflowError, ZeroDivisionError):
            value = math.nan
    if not math.isfinite(value):
        raise InputError(f"coefficient is not a finite number with {dict(constants)}")
    return value


def _radians(per: str) -> Callable[[object], object]:
    def converted(value: object) -> object:
        if not isinstance(value, str):
            return value
        match = _DEGREES.fullmatch(value.strip())
        if match is None or match[2] not in ("", per):
            raise ValueError(f"expected a number or text such as '90 deg{per}', given {shortened(value)}")
        return float(np.deg2rad(float(match[1])))

    return converted


def _coefficient(value: object) -> Coefficient:
    if isinstance(value, str):
        return coefficient_of(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(float(value)):
        raise ValueError(f"expected a finite number or a product such as '-2*l2*n1^2', given {described(value)}")
    return float(value), []


def _name(value: str) -> str:
    if not re.fullmatch(r"[^\s,]+", value):
        raise ValueError(f"a name must not be empty nor hold spaces or commas, given {shortened(value)}")
    if not value.isprintable():
        raise ValueError(f"a name holds printable characters only, given {shortened(value)}")
    return _of_a_length(value)


def _title(value: str) -> str:
    if not value.strip() or not value.isprintable():
        raise ValueError(f"a robot's name is printable text on one line, given {shortened(value)}")
    return _of_a_length(value)


def _of_a_length(value: str) -> str:
    if (wrong := long_name(value)) is not None:
        raise ValueError(wrong)
    return value


def _constant_name(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", value):
        raise ValueError(f"a constant's name holds letters, digits and '_' only, given {shortened(value)}")
    return _of_a_length(value)


def _ordered(value: list[float]) -> list[float]:
    lower, upper = value
    if not lower < upper:
        raise ValueError(f"lower bound {lower:g} must be below the upper bound {upper:g}")
    return value


def _downwards(value: object) -> object:
    return [0.0, 0.0, -value] if isinstance(value, int | float) and not isinstance(value, bool) else value


Name = Annotated[str, AfterValidator(_name)]
Angle = Annotated[float, BeforeValidator(_radians(""))]
Bounds = Annotated[list[Angle], Field(min_length=2, max_length=2), AfterValidator(_ordered)]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Section(BaseModel):
    """A mapping whose fields are all known, and whose numbers are finite and not text."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


class LimitsSection(Section):
    """Bounds of one coordinate; what is not given is not limited (no position limits: the joint is continuous)."""

    position: Bounds | None = None
    velocity: Annotated[float, Field(gt=0), BeforeValidator(_radians("/s"))] | None = None
    acceleration: Annotated[float, Field(gt=0), BeforeValidator(_radians("/s^2"))] | None = None
    jerk: Annotated[float, Field(gt=0), BeforeValidator(_radians("/s^3"))] | None = None
    torque: Positive | None = None


def limits(sections: list[LimitsSection]) -> Limits:
    """Limits of several coordinates."""
    lower, upper = np.array([s.position or [-np.inf, np.inf] for s in sections], dtype=float).reshape(-1, 2).T
    rates = ("velocity", "acceleration", "jerk", "torque")
    return Limits(lower, upper, *(np.array([getattr(s, name) or np.inf for s in sections]) for name in rates))


class MdhSection(Section):
    """Modified Denavit-Hartenberg parameters, ``Rx(alpha) Tx(a) Rz(q + offset) Tz(d)``."""

    alpha: Angle = 0.0
    a: float = 0.0
    d: float = 0.0
    offset: Angle = 0.0


class FrameSection(Section):
    """A frame in another one: origin [m], then roll, pitch, yaw with ``R = Rz(yaw) Ry(pitch) Rx(roll)``, as in URDF."""

    xyz: Vector = [0.0, 0.0, 0.0]
    rpy: Annotated[list[Angle], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]

    def rotation(self) -> Array:
        """``R``, shape (3, 3)."""
        return rotation_from_rpy(self.rpy)


class PoseSection(FrameSection):
    """Pose of a link's frame in the one that carries it at q = 0, and the joint's axis in the link's frame.

    The rows of a rotation ``matrix`` may stand in the place of ``rpy``: they say every digit.
    """

    matrix: Annotated[list[Vector], Field(min_length=3, max_length=3)] | None = None
    axis: Vector = [0.0, 0.0, 1.0]

    @model_validator(mode="after")
    def _turned_once(self) -> PoseSection:
        if self.matrix is not None and "rpy" in self.model_fields_set:
            raise ValueError("give rpy or matrix, not both")
        return self

    @field_validator("axis")
    @classmethod
    def _has_a_direction(cls, axis: list[float]) -> list[float]:
        length = float(np.linalg.norm(axis))
        if not 0 < length < np.inf:
            raise ValueError(f"an axis needs a length that is not zero, given {axis}")
        return axis if abs(length - 1.0) < _ROUNDING else [x / length for x in axis]

    def rotation(self) -> Array:
        """``R``, shape (3, 3)."""
        return super().rotation() if self.matrix is None else np.array(self.matrix)


class PlacedSection(Section):
    """How a joint moves, and its place in the parent's frame, as ``mdh`` or as ``pose``."""

    kind: JointKind = "revolute"
    mdh: MdhSection | None = None
    pose: PoseSection | None = None

    @model_validator(mode="after")
    def _placed_once(self) -> Self:
        if (self.mdh is None) == (self.pose is None):
            what = f"joint {self.name!r}" if isinstance(self, JointSection) else "the joint of a branch"
            raise ValueError(f"{what} needs mdh or pose, and not both")
        return self

    def joint_named(self, name: str) -> Joint:
        """Joint of a robot."""
        if self.mdh is not None:
            return Joint.from_mdh(name, self.kind, **self.mdh.model_dump())
        assert self.pose is not None
        return Joint(name, self.kind, self.pose.rotation(), np.array(self.pose.xyz), np.array(self.pose.axis))


class NamedSection(Section):
    """A part of a robot with a name, the first of its fields."""

    name: Name


class JointSection(PlacedSection, NamedSection):
    """A joint, and the limits of its coordinate; ``parent`` is the link that carries it, else the one before."""

    parent: str | None = None
    limits: LimitsSection = LimitsSection()

    @field_validator("limits", mode="before")
    @classmethod
    def _metres_of_a_prismatic_joint(cls, given: object, info: ValidationInfo) -> object:
        if info.data.get("kind") == "prismatic" and isinstance(given, dict) and "deg" in str(list(given.values())):
            raise ValueError("the limits of a prismatic joint are in metres, not in degrees")
        return given


class InertiaSection(Section):
    """Inertia tensor [kg m^2] in the axes of the frame, about its origin or about the centre of mass."""

    about: Literal["origin", "centre-of-mass"]
    xx: float
    yy: float
    zz: float
    xy: float = 0.0
    xz: float = 0.0
    yz: float = 0.0


class LinkSection(NamedSection):
    """A link and its inertial parameters, in its own frame or in a ``frame`` given relative to it."""

    mass: NotNegative | None = None
    com: Vector | None = None
    first_moment: Vector | None = None
    inertia: InertiaSection | None = None
    frame: FrameSection = FrameSection()

    @model_validator(mode="after")
    def _known_or_unknown(self) -> LinkSection:
        if self.com is not None and self.first_moment is not None:
            raise ValueError(f"link {self.name!r}: give com or first_moment, not both")
        given = {"mass": self.mass, "com or first_moment": self.com or self.first_moment, "inertia": self.inertia}
        missing = [name for name, value in given.items() if value is None]
        if 0 < len(missing) < len(given):
            wanted = "give mass, com or first_moment, and inertia, or none"
            raise ValueError(f"link {self.name!r}: {wanted}; no {', '.join(missing)}")
        if self.mass == 0.0 and any(self.first_moment or ()):
            raise ValueError(f"link {self.name!r}: a link without mass has no first moment")
        return self

    def link(self) -> Link:
        """Link of a robot, its parameters about the origin of its own frame."""
        if self.mass is None or self.inertia is None:
            return Link(self.name)
        with np.errstate(over="ignore", invalid="ignore"):  # a link refuses what is not finite
            return Link(self.name, self._theta(self.mass, self.inertia))

    def _theta(self, mass: float, i: InertiaSection) -> Array:
        moment = np.array(self.first_moment) if self.com is None else mass * np.array(self.com)
        theta = np.array([mass, *moment, i.xx, i.xy, i.xz, i.yy, i.yz, i.zz])
        if i.about == "centre-of-mass" and mass > 0:
            theta = from_centre_of_mass(mass, moment / mass, inertia_tensor(theta))
        if self.frame == FrameSection():
            return theta
        return np.asarray(transport(self.frame.rotation(), self.frame.xyz) @ theta)


class BranchSection(LinkSection):
    """A body beside the chain: a link with its joint, whose coordinate is ``coupling @ q + offset``.

    ``parent`` is a link, an earlier branch, or ``base``. ``number`` appears in the names of its parameters; by default
    the numbers of branches follow those of the links.
    """

    parent: str
    joint: PlacedSection
    coupling: list[float]
    offset: Angle = 0.0
    number: Annotated[int, Field(gt=0)] | None = None

    @field_validator("coupling")
    @classmethod
    def _moves(cls, coupling: list[float]) -> list[float]:
        if not any(coupling):
            raise ValueError("no joint moves this branch; describe it as a part of its parent")
        return coupling

    def branch(self) -> Branch:
        """Branch of a robot."""
        link = replace(self.link(), number=self.number or 0)
        return Branch(self.parent, self.joint.joint_named(self.name), link, np.array(self.coupling), self.offset)


class ShapeSection(Section):
    """A capsule in the frame of a link, a branch or ``base``: all points near a line; near a point if no ``to``."""

    link: Name
    start: Vector = Field(alias="from")
    end: Vector | None = Field(default=None, alias="to")
    radius: Positive

    def part(self) -> Part:
        """Shape of a robot."""
        return Part(self.link, Capsule(vector_of(self.start), vector_of(self.end or self.start), self.radius))


class LoopSection(Section):
    """What closes a loop: a point of each of two bodies, each in its own frame [m], that are one.

    ``axes`` are the rows of the rotation from the second body's axes to the first one's, where the two do not turn. Or
    a joint that follows another one, ``joints: [follower, leader]``, by ``multiplier`` and ``offset`` [rad or m].
    """

    bodies: Annotated[list[Name], Field(min_length=2, max_length=2)] | None = None
    points: Annotated[list[Vector], Field(min_length=2, max_length=2)] | None = None
    axes: Annotated[list[Vector], Field(min_length=3, max_length=3)] | None = None
    joints: Annotated[list[Name], Field(min_length=2, max_length=2)] | None = None
    multiplier: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _closes(self) -> LoopSection:
        given = {name for name in ("bodies", "points", "joints") if getattr(self, name) is not None}
        if given not in ({"bodies", "points"}, {"joints"}):
            raise ValueError("expected bodies and points, or joints")
        self.closure()
        return self

    def closure(self) -> Closure | MimicJoint:
        """Closure of a robot."""
        return Closure.from_dict(self.model_dump())


class BallScrewSection(Section):
    """A ball screw, see `regressors.robot.gears.BallScrew`: ``L(z)^2 = square + cosine cos z + sine sin z`` [m^2]."""

    pitch: Positive
    square: float
    cosine: float
    sine: float

    @model_validator(mode="after")
    def _is_a_triangle(self) -> BallScrewSection:
        self.gear()
        return self

    def gear(self) -> BallScrew:
        """Gear function."""
        return BallScrew(self.pitch, self.square, self.cosine, self.sine)


class RatioSection(Section):
    """Motor angle per drive coordinate: a number, or a ball screw."""

    constant: float | None = None
    ball_screw: BallScrewSection | None = None

    @model_validator(mode="before")
    @classmethod
    def _plain_number(cls, given: object) -> object:
        if isinstance(given, int | float) and not isinstance(given, bool):
            return {"constant": given}
        if not isinstance(given, dict):
            raise ValueError(f"expected a number or a ball_screw, given {described(given)}")
        return given

    @model_validator(mode="after")
    def _one_gear(self) -> RatioSection:
        if (self.constant is None) == (self.ball_screw is None):
            raise ValueError("a ratio is a number or a ball_screw")
        self.gear()
        return self

    def gear(self) -> GearFunction:
        """Gear function."""
        if self.ball_screw is not None:
            return self.ball_screw.gear()
        assert self.constant is not None
        return ConstantRatio(self.constant)


class FrictionSection(Section):
    """Friction at the drive coordinate, ``tau = viscous dz + coulomb sign(dz)`` [Nm s/rad, Nm]."""

    coulomb: NotNegative | None = None
    viscous: NotNegative | None = None


def _motor_speed(value: object) -> object:
    """``3000 rpm`` in rad/s; other values as of the limits of a coordinate."""
    if isinstance(value, str) and value.split()[1:] == ["rpm"]:
        try:
            return float(value.split()[0]) * 2 * np.pi / 60.0
        except ValueError:
            raise ValueError(f"expected a number of rpm, given {shortened(value)}") from None
    return _radians("/s")(value)


class MotorLimitsSection(LimitsSection):
    """Limits as the motor has them, before its gear [rad, rad/s or rpm, rad/s^2, rad/s^3, Nm]."""

    velocity: Annotated[float, Field(gt=0), BeforeValidator(_motor_speed)] | None = None

    def at_coordinate(self, ratio: float) -> dict[str, Any]:
        """The limits of the coordinate behind a gear: angles and rates divided by its ratio, the torque times it."""
        size = abs(ratio)
        given = self.model_dump(exclude_none=True)
        if "position" in given:
            given["position"] = sorted(angle / ratio for angle in given["position"])
        rates = {name: given[name] / size for name in ("velocity", "acceleration", "jerk") if name in given}
        return given | rates | ({"torque": given["torque"] * size} if "torque" in given else {})


class DriveSection(NamedSection):
    """A drive: its gear, the inertia of its rotor [kg m^2], its friction and the limits of its coordinate z.

    ``motor_limits`` states limits on the motor's side of a constant ratio instead.
    """

    ratio: RatioSection = RatioSection(constant=1.0)
    rotor_inertia: NotNegative | None = None
    friction: FrictionSection = FrictionSection()
    offset: Angle = 0.0
    limits: LimitsSection = LimitsSection()
    motor_limits: MotorLimitsSection = MotorLimitsSection()

    @model_validator(mode="after")
    def _limited_once(self) -> DriveSection:
        twice = sorted(self.limits.model_dump(exclude_none=True).keys() & self.motor_limits.model_fields_set)
        if twice:
            raise ValueError(f"limits and motor_limits both state {', '.join(twice)}; give each once")
        if self.motor_limits.model_fields_set and self.ratio.constant is None:
            raise ValueError("motor_limits need a constant ratio; state the limits of the coordinate below limits")
        return self

    @property
    def coordinate_limits(self) -> LimitsSection:
        """Limits of the coordinate z, wherever they were stated."""
        if self.ratio.constant is None:
            return self.limits
        of_motor = self.motor_limits.at_coordinate(self.ratio.constant)
        return LimitsSection(**self.limits.model_dump(exclude_none=True), **of_motor)

    def drive(self) -> Drive:
        """Drive of a robot."""
        friction = self.friction
        return Drive(self.name, self.ratio.gear(), self.rotor_inertia, friction.coulomb, friction.viscous)


class AggregatesSection(Section):
    """Parameters in which the model is written when only these joints move: name to {standard parameter: factor}."""

    joints: Annotated[list[str], Field(min_length=1)]
    parameters: dict[str, dict[str, Annotated[Coefficient, PlainValidator(_coefficient)]]]


class StructureSection(Section):
    """Structural knowledge of the parameters before any measurement; names as in `regressors.robot.inertia`."""

    zero: list[str] = []
    equal: list[Annotated[list[str], Field(min_length=2)]] = []
    aggregates: list[AggregatesSection] = []


class Description(Section):
    """A robot.

    ``sources`` says where the values come from: any keys, text. ``gravity`` is a magnitude, downwards along the base
    frame's z axis, or a vector in the base frame [m/s^2]. ``coupling`` is the matrix C of ``z = C q + offset``.
    ``home`` is the pose in which the robot waits, a number per joint. ``shapes`` are capsules around the links.
    ``loops`` close the tree of joints, ``passive`` are the joints of these that no drive acts on.
    """

    name: Annotated[str, AfterValidator(_title)]
    source: str = ""
    sources: dict[str, str] = {}
    gravity: Annotated[Vector, BeforeValidator(_downwards)] = [0.0, 0.0, -9.81]
    constants: dict[Annotated[str, AfterValidator(_constant_name)], float] = {}
    joints: Annotated[list[JointSection], Field(min_length=1)]
    links: list[LinkSection] | None = None
    branches: list[BranchSection] = []
    drives: list[DriveSection] | None = None
    coupling: list[list[float]] | None = None
    structure: StructureSection = StructureSection()
    home: list[Angle] | None = None
    shapes: list[ShapeSection] = []
    loops: list[LoopSection] = []
    passive: list[str] = []
