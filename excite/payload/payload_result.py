"""What controllers want to know of a payload, in their own words."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import scipy

from excite.logs.log import LogReference
from excite.payload.held_body import UPPER, Frame, HeldBody, is_possible, nearest_possible, spread_of
from excite.payload.known_gains import KnownGains
from excite.payload.load_estimate import LoadEstimate
from excite.storage.atomic import write_bytes
from excite.storage.records import NUMBERS, Shown, every, write_record
from excite.storage.result_folder import check_not_taken, result_folder
from regressors.errors import check_names
from regressors.models.load import LOAD_PARAMETERS
from regressors.robot.robot import Robot
from regressors.samples import Array

EXPECTED = {
    "ur": "the tool flange, z out of it",
    "franka": "the flange F",
    "kuka": "the FLANGE coordinate system",
    "abb": "the wrist coordinate system (the flange) for the load of a tool, the tool's for GripLoad",
    "urdf": "the link that the joint names as its parent",
}
"""In which frame a controller expects centre and inertia, in words."""
CONTROLLERS = tuple(EXPECTED)
_DIGITS = 9
_MM = 1e3
_LEAST_MASS, _LEAST_PLACE = 0.001, 0.001  # of a loaddata [kg, mm]


def number_text(value: float, digits: int = _DIGITS) -> str:
    """A number with a point, some digits behind it, and no exponent."""
    text = f"{value:.{digits}f}".rstrip("0")
    text = f"{text}0" if text.endswith(".") else text
    return "0.0" if text == "-0.0" else text


def list_text(values: Iterable[float], digits: int = _DIGITS) -> str:
    """Numbers separated by commas."""
    return ", ".join(number_text(value, digits) for value in values)


def target_payload_text(body: HeldBody, frame: str) -> str:
    """A payload in URScript: ``set_target_payload(m, cog, inertia)``, and ``set_payload(m, cog)`` of older software.

    Universal Robots, "The URScript Programming Language for e-Series": masses in kg, the centre of gravity in m from
    the tool mount, the inertia as [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] in kg m^2 about the centre of gravity, with axes
    parallel to those of the tool flange. `set_target_payload` is there from 5.10 on, and zeroes the force/torque
    measurement.
    """
    I = body.inertia
    mass, centre = number_text(body.mass, 6), list_text(body.centre, 6)
    inertia = list_text((I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]))
    return (
        f"# centre [m] and inertia [kg m^2] in: {frame}; expected: {EXPECTED['ur']}\n"
        f"set_target_payload({mass}, [{centre}], [{inertia}])\n"
        f"# software before 5.10: set_payload({mass}, [{centre}])\n"
    )


def set_load_text(body: HeldBody, frame: str) -> str:
    """A payload for libfranka: ``robot.setLoad(mass, F_x_Cload, load_inertia)``.

    libfranka API documentation, `franka::Robot::setLoad` and `franka::RobotState::I_load`: mass in kg, translation from
    the flange to the centre of mass in m, the inertia matrix in kg m^2 with respect to the centre of mass,
    column-major. The Panda's flange is 0.107 m along z from the frame of link 7.
    """
    centre, inertia = list_text(body.centre, 6), list_text(body.inertia.ravel(order="F"))
    return (
        f"// centre [m] and inertia [kg m^2, column-major] in: {frame}; expected: {EXPECTED['franka']}\n"
        f"robot.setLoad({number_text(body.mass, 6)}, {{{{{centre}}}}}, {{{{{inertia}}}}});\n"
    )


def angles_of(rotation: Array) -> tuple[float, float, float]:
    """A, B, C with ``R = Rz(A) Ry(B) Rx(C)`` [deg]; C is zero where B is 90 degrees."""  # rotation (3, 3)
    R = rotation
    flat = float(np.hypot(R[0, 0], R[1, 0]))
    B = np.arctan2(-R[2, 0], flat)
    if flat < 1e-9:
        A, C = np.arctan2(-R[0, 1], R[1, 1]), 0.0
    else:
        A, C = np.arctan2(R[1, 0], R[0, 0]), np.arctan2(R[2, 1], R[2, 2])
    return tuple(map(float, np.degrees([A, B, C])))  # type: ignore[return-value]


def load_data_text(body: HeldBody, frame: str) -> str:
    """A payload as KUKA's ``LOAD_DATA``: ``{M 3.2,CM {X ..,Y ..,Z ..,A ..,B ..,C ..},J {X ..,Y ..,Z ..}}``.

    KUKA System Software, "Operating and Programming Instructions for System Integrators", load data, and the data
    sheets' "Load center of gravity and mass moment of inertia": mass M in kg; CM the centre of gravity in mm and the
    orientation of the principal axes of inertia in degrees, relative to the flange, A about Z, then B about the new Y,
    then C about the new X; J the moments about these axes in kg m^2. In `$config.dat` it belongs to tool 1 of 16.
    """
    moments, axes = body.principal
    place = _fields("XYZ", _MM * body.centre, 4) + "," + _fields("ABC", angles_of(axes), 6)
    expected = EXPECTED["kuka"]
    return (
        f"; X, Y, Z [mm], A, B, C [deg] in: {frame}; expected: {expected}; J [kg m^2] about the principal axes\n"
        f"LOAD_DATA[1]={{M {number_text(body.mass, 6)},CM {{{place}}},J {{{_fields('XYZ', moments, 9)}}}}}\n"
    )


def _fields(names: str, values: Array | tuple[float, ...], digits: int) -> str:
    return ",".join(f"{name} {number_text(float(x), digits)}" for name, x in zip(names, values, strict=True))


def quaternion_of(rotation: Array) -> Array:
    """Unit quaternion of a rotation, scalar first and not negative, shape (4,)."""  # rotation (3, 3)
    q = scipy.spatial.transform.Rotation.from_matrix(rotation).as_quat(scalar_first=True)
    return np.asarray(q if q[np.flatnonzero(np.abs(q) > 1e-12)[0]] > 0 else -q)


def loaddata_text(body: HeldBody, frame: str) -> str:
    """A payload as ABB's ``loaddata``: ``[mass, [x, y, z], [q1, q2, q3, q4], ix, iy, iz]``.

    ABB, "Technical reference manual - RAPID Instructions, Functions and Data types", loaddata: mass in kg, at least
    0.001; cog in mm, in the tool coordinate system (wrist coordinate system for the load of a tool); aom the
    orientation of the principal axes of inertia at the centre of gravity as a quaternion, scalar first; ix, iy, iz the
    moments about these axes in kg m^2, none of them negative; three zeros stand for a point mass. A mass needs a cog
    that is not the origin.
    """
    moments, axes = body.principal
    centre = _MM * body.centre
    if np.all(np.abs(centre) < _LEAST_PLACE):
        centre = np.array([0.0, 0.0, _LEAST_PLACE])
    data = (
        f"[{number_text(max(body.mass, _LEAST_MASS), 6)}, [{list_text(centre, 4)}], "
        f"[{list_text(quaternion_of(axes))}], {list_text(np.maximum(moments, 0.0))}]"
    )
    return (
        f"! cog [mm] and aom in: {frame}; expected: {EXPECTED['abb']}; ix, iy, iz [kg m^2] about the principal axes\n"
        f"PERS loaddata payload := {data};\n"
    )


def urdf_link_text(body: HeldBody, frame: str) -> str:
    """A payload as a link of a URDF, with the joint that fixes it.

    ROS wiki, "urdf/XML/link": mass in kg; origin, the centre of mass, in m; ixx, ixy, ixz, iyy, iyz, izz in kg m^2
    about the centre of mass in the axes of the inertial frame, here those of the link.
    """
    x, y, z = (f"{v:.9g}" for v in body.centre)
    entries = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), body.inertia[UPPER], strict=True)
    inertia = " ".join(f'{name}="{value:.12g}"' for name, value in entries)
    stated = frame.replace("--", "- -").replace("]]>", "")
    return (
        f"<!-- centre and inertia in: {stated}; expected: {EXPECTED['urdf']}: replace PARENT -->\n"
        '<link name="payload">\n'
        f'  <inertial><origin xyz="{x} {y} {z}" rpy="0 0 0"/><mass value="{body.mass:.9g}"/>\n'
        f"    <inertia {inertia}/></inertial>\n"
        "</link>\n"
        '<joint name="payload_fixed" type="fixed"><parent link="PARENT"/><child link="payload"/></joint>\n'
    )


# name of the file, and its text from the body and the name of the frame
_FILES: dict[str, tuple[str, Callable[[HeldBody, str], str]]] = {
    "ur": ("payload.script", target_payload_text),
    "franka": ("payload.franka.cpp", set_load_text),
    "kuka": ("payload.dat", load_data_text),
    "abb": ("payload.mod", loaddata_text),
    "urdf": ("payload.urdf", urdf_link_text),
}
KIND, PAYLOAD = "payload", "payload.json"
_NOT_NEGATIVE = (0, 4, 7, 9)
_FAR = 2.0  # half intervals


@dataclass(frozen=True, eq=False, repr=False)
class PayloadResult(Shown):
    """An identified payload; the same when it is loaded.

    Parameters
    ----------
    robot : Robot
    frame : Frame
        In which it is stated.
    estimate : LoadEstimate
        About the last link's frame.
    source : str
        What was measured: ``joint torques`` or ``wrench``.
    gains : KnownGains, optional
    without, loaded : tuple of LogReference
        Logs without and with the load.
    rated : float, optional
        Largest load of the robot [kg].
    notes, doubts : tuple of str
        What was assumed and found; why the result cannot be right.
    provenance : mapping
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"payload": lambda result: result.stated}

    robot: Robot
    frame: Frame
    estimate: LoadEstimate
    source: str
    gains: KnownGains | None
    without: tuple[LogReference, ...] = ()
    loaded: tuple[LogReference, ...] = ()
    rated: float | None = None
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def _free(self) -> tuple[Array, Array]:
        T = self.frame.from_link
        return T @ self.estimate.phi, T @ self.estimate.covariance @ T.T

    @cached_property
    def body(self) -> HeldBody:
        """The body: the estimate, or the nearest that real masses can make."""
        return HeldBody.of(nearest_possible(*self._free)) if self._free[0][0] > 0 else HeldBody.of(self._free[0])

    @property
    def constrained(self) -> bool:
        """Whether no body has the estimated parameters, so that the nearest possible body is stated."""
        return not is_possible(self._free[0])

    @cached_property
    def deviation(self) -> Array:
        """Standard deviations of mass, centre, and xx, xy, xz, yy, yz, zz of the inertia, shape (10,)."""
        phi, covariance = self._free
        return spread_of(lambda x: HeldBody.of(x).listed, phi, covariance)

    @cached_property
    def intervals(self) -> Array:
        """99 % intervals of the same, about the estimate before it is made possible, shape (10, 2)."""
        free, half = HeldBody.of(self._free[0]).listed, self.estimate.quantile * self.deviation
        value = self.body.listed
        low, high = np.minimum(free - half, value), np.maximum(free + half, value)
        if self.body.mass > 0:
            low[list(_NOT_NEGATIVE)] = np.maximum(low[list(_NOT_NEGATIVE)], 0.0)
        return np.column_stack([low, high])

    @property
    def far_from_estimate(self) -> bool:
        """Whether mass or centre of the possible body are far outside of the intervals about the estimate."""
        free, half = HeldBody.of(self._free[0]).listed, self.estimate.quantile * self.deviation
        return bool(np.any(np.abs(self.body.listed - free)[:4] > _FAR * half[:4]))

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.body.mass

    @property
    def stated(self) -> dict[str, Any]:
        """Mass, centre and inertia with their intervals, as plain values."""
        body, intervals = self.body, self.intervals
        inertia = np.zeros((3, 3, 2))
        inertia[UPPER] = intervals[4:]
        inertia.transpose(1, 0, 2)[UPPER] = intervals[4:]
        return {
            "frame": {
                "name": self.frame.name,
                "xyz": self.frame.translation.tolist(),
                "rotation": self.frame.rotation.tolist(),
                "of": self.robot.links[-1].name,
            },
            "gains": self._gain_factors,
            "mass": {"value": body.mass, "interval": intervals[0].tolist(), "unit": "kg"},
            "centre": {"value": body.centre.tolist(), "interval": intervals[1:4].tolist(), "unit": "m"},
            "inertia": {
                "value": body.inertia.tolist(),
                "interval": inertia.tolist(),
                "unit": "kg m^2",
                "about": "the centre of mass, in the axes of the frame",
            },
            "parameters": dict(zip(LOAD_PARAMETERS, body.parameters.tolist(), strict=True)),
            "confidence": 0.99,
            "possible": not self.constrained,
            "by_gains": float(self.estimate.quantile * np.sqrt(self.mass_variance_by_gains)),
        }

    @property
    def mass_variance_by_gains(self) -> float:
        """Part of the variance of the mass that is due to the gains [kg^2]."""
        return max(float(self.estimate.by_gains[0, 0]), 0.0)

    @property
    def _gain_factors(self) -> dict[str, dict[str, float]]:
        """Factor of each drive's torques, as it was known and as it is estimated with the payload."""
        if self.gains is None:
            return {}
        numbers = (self.gains.factor.tolist(), self.gains.deviation.tolist(), self.estimate.gains.tolist())
        return {
            drive: {"factor": factor, "deviation": deviation, "found": factor / (1.0 + error)}
            for drive, factor, deviation, error in zip(self.gains.drives, *numbers, strict=True)
        }

    def stored(self) -> PayloadResult:
        """What a file keeps: of many residuals every k-th."""
        residuals = self.estimate.residuals
        return replace(self, estimate=replace(self.estimate, residuals=residuals[:: every(residuals.size, NUMBERS)]))

    def text_for(self, controller: str) -> str:
        """The payload in a controller's own words, see `excite.payload.payload_result`."""
        check_names("controller", [controller], CONTROLLERS)
        return _FILES[controller][1](self.body, self.frame.name)

    def texts(self, controllers: Collection[str]) -> dict[str, dict[str, str]]:
        """What each controller wants to know, and in which frame it expects it; nothing without a mass."""
        chosen = controllers if self.mass > 0 else ()
        return {name: {"text": self.text_for(name), "expected_frame": EXPECTED[name]} for name in chosen}

    def save(
        self, folder: str | Path, *, controllers: Collection[str] = CONTROLLERS, replace: bool = False
    ) -> list[Path]:
        """Write ``payload.json``, and what controllers want, into a folder, made if it does not exist.

        Parameters
        ----------
        folder : path
        controllers : collection of str
            That get a file.
        replace : bool
            Replace a payload that is already there.

        Returns
        -------
        list of Path
            Files that were written.

        Raises
        ------
        InputError
            The folder holds a payload, is being written by another process, or cannot be written to.
        """
        place, chosen = Path(folder), controllers if self.mass > 0 else ()
        with result_folder(place):
            check_no_payload(place, chosen, replace=replace)
            further = {_FILES[name][0]: partial(write_bytes, content=self.text_for(name).encode()) for name in chosen}
            return write_record(self, KIND, place, KIND, further=further)

    def __repr__(self) -> str:
        """One line."""
        low, high = self.intervals[0]
        return f"<PayloadResult of {self.robot.name}: {self.mass:.4g} kg, 99 % from {low:.4g} to {high:.4g} kg>"


def check_no_payload(folder: Path, controllers: Collection[str] = (), *, replace: bool) -> None:
    """Raise `TakenError` where a folder holds a payload, or files for controllers, that may not be replaced."""
    check_not_taken(folder, PAYLOAD, "a payload", [_FILES[name][0] for name in controllers], replace=replace)
