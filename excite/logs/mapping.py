"""Layout of a foreign file of measurements, described by a small YAML file.

Columns are given by name or by number, 1 for the first; without a header by number. Of every channel the value is

    ``value = sign gain unit (cell - offset) / ratio``   (position, velocity, command)
    ``value = sign gain unit (cell - offset) ratio``     (effort, current)

with `ratio` the turns of the motor per turn of the joint, where the motor's side was recorded, and `gain` a further
factor, such as the torque constant [Nm/A] of a measured current. Each of `unit`, `gain`, `ratio`, `ticks`,
`offset`, `sign` is one value for all joints or a list of one per joint.

- `joints` are those of the robot, in order, if not given.
- `design` is the SHA-256 of the design that was played: of its ``design.json``, or of its coefficients. Exports of
  motions write it.
- `time` is a column with its unit, or one of whole seconds with another of the `nanoseconds` in them; or it has the
  `rate` [Hz] of rows that no column has the time of, or that a column counts: ``time: {rate: 250}``,
  ``time: {column: sample, rate: 250}``. A column of dates with their times (ISO 8601) is in s.
- `skip` is the number of lines before the table; other lines that hold no row of numbers are left out and named.
- ``unit: ticks`` (or ``ticks/s``) needs `ticks`, the counts of the encoder per turn. Temperatures in ``K`` and ``degF``
  are converted to deg C.
- ``side: motor`` says that the columns are the drives', which go through the gears and the coupling of the robot's
  description, see `excite.logs.log_reading`; a `ratio` replaces the gears.
- `file` names another file of the same layout that holds the quantity, relative to the folder of the log; ``{log}`` in
  it stands for the name of the log without its ending. Its own `time` may be given. Its values are interpolated onto
  the rows of the positions; a command holds until the next one.

The logs of an arm that records motor currents, six joints in 31 columns without a header, are read by::

    separator: ","
    header: false
    time: {column: 1, unit: s}
    joints: [shoulder_pan_joint, shoulder_lift_joint, elbow_joint, wrist_1_joint, wrist_2_joint, wrist_3_joint]
    position: {columns: [2, 3, 4, 5, 6, 7], unit: rad}
    velocity: {columns: [8, 9, 10, 11, 12, 13], unit: rad/s}
    current: {columns: [14, 15, 16, 17, 18, 19], unit: A, gain: [14.87, 13.26, 11.13, 10.62, 11.03, 11.47]}

`base` has the channels of a base that moves, see `excite.logs.base_motion`: its position and its orientation, as
``quaternion`` (x, y, z, w) or as ``rpy`` (roll, pitch, yaw), in a frame whose z axis points up; where an IMU measures
them, ``angular_velocity`` and ``specific_force`` in its axes; and, where it is measured, the wrench of all that touches
the robot, which must be at its base. `xyz` and `rpy` of a channel place its sensor, or the frame that is tracked, in
the frame of the base::

    base:
      position: {columns: [px, py, pz], unit: m}
      quaternion: {columns: [qx, qy, qz, qw]}
      angular_velocity: {columns: [gx, gy, gz], unit: rad/s}
      specific_force: {columns: [ax, ay, az], unit: m/s^2, xyz: [0.02, 0, 0.05]}
      wrench: {columns: [fx, fy, fz, nx, ny, nz], unit: N, xyz: [0, 0, 0.1]}

Where nothing touches the robot, as in free fall, state ``free: true`` instead of a wrench.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from excite.logs.layout import ROWS, Channel, Layout, cells, checked_head, is_number, listed, twice
from excite.logs.log import WRENCH
from excite.logs.table import MOST
from excite.storage.result_folder import settle_files
from regressors.arguments import checked
from regressors.errors import InputError, UnknownName
from regressors.readers.documents import read_document, validate, within
from regressors.robot.robot import Robot
from regressors.samples import Array

MAPPING = ".mapping.yaml"
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SEPARATORS = {",": ",", ";": ";", "\t": "\t", "tab": "\t", "whitespace": None}
_LEAST = 1e-15  # of factors
TICKS = "ticks"  # of an encoder: the field ticks says how many per turn
_ANGLES = {
    "rad": 1.0, "deg": np.pi / 180, "turns": 2 * np.pi, "rev": 2 * np.pi, TICKS: 2 * np.pi, "m": 1.0, "mm": 1e-3,
}  # fmt: skip
_SPEEDS = {**{f"{name}/s": scale for name, scale in _ANGLES.items()}, "rpm": 2 * np.pi / 60}


def _several(value: object) -> object:
    return value if isinstance(value, list) else [value]


def _not_zero(value: list[float]) -> list[float]:
    if 0.0 in value:
        raise ValueError("must not be zero")
    if any(abs(x) < _LEAST for x in value):
        raise ValueError(f"must be {_LEAST:g} or more, or {-_LEAST:g} or less")
    return value


def _within(quantity: str) -> tuple[object, ...]:
    """Validators of one number or a list, each within the range of its quantity."""
    return AfterValidator(within(quantity)), BeforeValidator(_several)


Column = Annotated[int | str, AfterValidator(within("column"))]
Offsets = Annotated[list[float], *_within("reading")]
Gains = Annotated[list[float], AfterValidator(_not_zero), *_within("gain")]
Ratios = Annotated[list[float], AfterValidator(_not_zero), *_within("ratio")]
Ticks = Annotated[list[float], AfterValidator(_not_zero), *_within("ticks")]
Names = Annotated[list[str], BeforeValidator(_several)]
Signs = Annotated[list[Literal[1, -1]], BeforeValidator(_several)]


class Section(BaseModel):
    """Base of all sections: unknown fields are refused."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


class TimeSection(Section):
    """Column of the time, and its unit; or the rate of rows that a column counts, or that none does."""

    column: Column | None = None
    unit: Literal["s", "ms", "us", "ns"] = "s"
    nanoseconds: Column | None = None  # in the whole seconds of the column
    rate: Annotated[float, AfterValidator(within("rate"))] | None = None  # [Hz]

    @model_validator(mode="after")
    def _told(self) -> TimeSection:
        if (self.column or self.rate) is None or (self.rate is not None and "unit" in self.model_fields_set):
            raise ValueError("needs the column of the time with its unit, or the rate of rows [Hz]")
        if self.nanoseconds is not None and (self.column is None or self.rate is not None or self.unit != "s"):
            raise ValueError("nanoseconds are those in the whole seconds of the column; leave out unit and rate")
        return self

    @property
    def second(self) -> float:
        """Seconds per unit of the column, per nanosecond where another column has these, or per row."""
        if self.rate is not None:
            return 1 / self.rate
        return SECONDS["ns" if self.nanoseconds is not None else self.unit]


class ChannelSection(Section):
    """Columns of one channel, and the conversion of their cells to SI."""

    units: ClassVar[Mapping[str, float]] = {}
    zeros: ClassVar[Mapping[str, float]] = {}  # readings at zero of the SI unit

    file: str | None = None
    time: TimeSection | None = None
    columns: list[Column]
    unit: Names
    gain: Gains = [1.0]
    offset: Offsets = [0.0]
    sign: Signs = [1]

    @field_validator("unit")
    @classmethod
    def _known(cls, value: list[str]) -> list[str]:
        for unit in value:
            if unit not in cls.units:
                raise ValueError(f"no unit {unit!r}; available: {', '.join(cls.units)}")
        return value

    @field_validator("unit", "gain", "offset", "sign", "ratio", "ticks", check_fields=False)
    @classmethod
    def _one_or_each(cls, value: list[object] | None, info: ValidationInfo) -> list[object] | None:
        if value is None:
            return None
        columns = len(info.data.get("columns", value))
        if len(value) not in (1, columns):
            raise ValueError(f"gives {len(value)} values for {columns} columns; expected one for all, or one for each")
        return value

    @property
    def factor(self) -> Array:
        """Further factors of the values, from the gear ratios and the ticks of encoders; one for all, or one each."""
        return np.ones(1)

    def channel(self, columns: tuple[int, ...]) -> Channel:
        """Channel in given columns; an offset that is a unit's own zero is not subtracted twice."""
        unit = np.array([self.units[name] for name in self.unit])
        scale = np.array(self.sign, dtype=float) * np.array(self.gain) * unit * self.factor
        own, given = np.array([self.zeros.get(name, 0.0) for name in self.unit]), np.array(self.offset)
        each = np.ones(len(columns))
        return Channel(columns, scale * each, np.where(given == own, own, own + given) * each)


class GearedSection(ChannelSection):
    """A channel of the joints, or of their motors, which goes through gears or a ratio that replaces these."""

    side: Literal["joint", "motor"] = "joint"
    ratio: Ratios = [1.0]

    @property
    def own_gears(self) -> bool:
        """Whether the gears of the robot's description are meant."""
        return self.side == "motor" and "ratio" not in self.model_fields_set


class PositionSection(GearedSection):
    """Positions, of the joints or of their motors."""

    units: ClassVar = _ANGLES
    ticks: Ticks | None = None

    @model_validator(mode="after")
    def _ticks_with_their_unit(self) -> Self:
        counted = any(TICKS in name for name in self.unit)
        if counted and self.ticks is None:
            raise ValueError("unit ticks needs the field ticks: how many the encoder counts per turn")
        if self.ticks is not None and not all(TICKS in name for name in self.unit):
            raise ValueError("ticks is given, but the unit is not ticks")
        return self

    @property
    def factor(self) -> Array:
        """Joint per motor, and turn per tick."""
        return np.asarray(1.0 / (np.array(self.ratio) * np.array(self.ticks or [1.0])))


class VelocitySection(PositionSection):
    """Velocities, of the joints or of their motors."""

    units: ClassVar = _SPEEDS


class EffortSection(GearedSection):
    """Torques or forces, of the joints or of their motors."""

    units: ClassVar = {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3, "N": 1.0, "kN": 1e3}

    @property
    def factor(self) -> Array:
        """Torque of the joint per torque of the motor."""
        return np.array(self.ratio)


class CurrentSection(EffortSection):
    """Currents of the motors, with the torque constant [Nm/A] as their gain."""

    units: ClassVar = {"A": 1.0, "mA": 1e-3}
    gain: Gains = Field(default=...)


class TemperatureSection(ChannelSection):
    """Temperatures; an offset of kelvin's own 273.15 is not subtracted twice."""

    units: ClassVar = {"degC": 1.0, "K": 1.0, "degF": 5 / 9}
    zeros: ClassVar = {"K": 273.15, "degF": 32.0}


class WrenchSection(ChannelSection):
    """Three forces [N] and three torques [Nm] at the sensor; unit kN means kN and kNm."""

    units: ClassVar = {"N": 1.0, "kN": 1e3}


OF_BASE = {  # columns of each channel of a base, and their units
    "position": (3, ("m", "mm")), "rpy": (3, ("rad", "deg")), "quaternion": (4, ("1",)),
    "angular_velocity": (3, ("rad/s", "deg/s")), "specific_force": (3, ("m/s^2", "g")), "wrench": (6, ("N", "kN")),
}  # fmt: skip
Triple = Annotated[list[float], Field(min_length=3, max_length=3), AfterValidator(within("length"))]


class BaseChannel(ChannelSection):
    """One channel of a base that moves."""

    units: ClassVar = {**_ANGLES, **_SPEEDS, **WrenchSection.units, "1": 1.0, "m/s^2": 1.0, "g": 9.80665}
    unit: Names = ["1"]
    xyz: Triple = [0.0, 0.0, 0.0]  # of the sensor's frame, or the tracked one, in that of the base [m, rad]
    rpy: Triple = [0.0, 0.0, 0.0]


class BaseSection(Section):
    """Channels of a base that moves; together one channel of the log, in this order."""

    file: str | None = None
    time: TimeSection | None = None
    position: BaseChannel
    rpy: BaseChannel | None = None
    quaternion: BaseChannel | None = None
    angular_velocity: BaseChannel | None = None
    specific_force: BaseChannel | None = None
    wrench: BaseChannel | None = None
    free: bool = False  # nothing touches the robot

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.free and self.wrench is not None:
            raise ValueError("free says that nothing touches the robot; leave out one of free and wrench")
        if (self.rpy is None) == (self.quaternion is None):
            raise ValueError("needs one of rpy and quaternion, the orientation of the base")
        for name, section in self.channels.items():
            count, units = OF_BASE[name]
            if len(section.columns) != count or not {*section.unit} <= {*units}:
                raise ValueError(f"{name} needs {count} columns, in one of {', '.join(units)}")
            if section.file is not None or section.time is not None:
                raise ValueError(f"{name}: give file and time of all channels of the base together")
        return self

    @property
    def channels(self) -> dict[str, BaseChannel]:
        """Channels by name, of those that have columns."""
        return {name: one for name in OF_BASE if (one := getattr(self, name)) is not None}

    @property
    def columns(self) -> list[int | str]:
        """Columns of all channels."""
        return [column for section in self.channels.values() for column in section.columns]

    def channel(self, columns: tuple[int, ...]) -> Channel:
        """All channels in given columns."""
        parts = [section.channel(tuple(range(len(section.columns)))) for section in self.channels.values()]
        return Channel(
            columns, *(np.concatenate([getattr(part, name) for part in parts]) for name in ("scale", "zero"))
        )


class LogMapping(Section):
    """Layout of a file, and units of its columns; see the module's example."""

    joints: Annotated[list[str], Field(min_length=1)] | None = None
    time: TimeSection
    position: PositionSection
    velocity: VelocitySection | None = None
    effort: EffortSection | None = None
    current: CurrentSection | None = None
    temperature: TemperatureSection | None = None
    wrench: WrenchSection | None = None
    command: PositionSection | None = None
    base: BaseSection | None = None
    separator: Literal[",", ";", "\t", "tab", "whitespace"] = ","
    header: bool = True
    skip: Annotated[int, AfterValidator(within("skip"))] = 0
    design: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = None

    @field_validator("joints")
    @classmethod
    def _once(cls, value: list[str] | None) -> list[str] | None:
        if value is not None and (name := twice(value)) is not None:
            raise ValueError(f"{name!r} is given twice")
        return value

    @field_validator("position", "velocity", "effort", "current", "temperature", "wrench", "command")
    @classmethod
    def _each(cls, value: ChannelSection | None, info: ValidationInfo) -> ChannelSection | None:
        if value is None:
            return None
        expected, what = len(info.data.get("joints") or ()), "joints"
        if info.field_name == "wrench":
            expected, what = len(WRENCH), "components"
        if expected and len(value.columns) != expected:
            raise ValueError(f"has {len(value.columns)} columns for {expected} {what}")
        if value.file is not None and info.field_name == "position":
            raise ValueError("positions are in the log itself; give a file for other quantities")
        if info.field_name == "current" and info.data.get("effort") is not None:
            raise ValueError("is given as well as effort; give one of them")
        return value

    @property
    def sections(self) -> dict[str, ChannelSection | BaseSection]:
        """Sections by the names of the channels of `excite.logs.log.Log`."""
        given = {
            "q": self.position, "dq": self.velocity, "effort": self.effort or self.current,
            "temperature": self.temperature, "wrench": self.wrench, "command": self.command, "base": self.base,
        }  # fmt: skip
        return {name: section for name, section in given.items() if section is not None}

    def of(self, robot: Robot | None) -> LogMapping:
        """The mapping with the names of its joints: those of the robot, in order, where it does not name them."""
        if self.joints is not None:
            return self
        if robot is None:
            raise InputError("the log mapping does not name its joints, and no robot is given whose they are")
        names = robot.joint_names[len(robot.base_joints) :]
        for name, section in self.sections.items():
            if name not in ("wrench", "base") and len(section.columns) != len(names):
                raise InputError(
                    f"the log mapping has {len(section.columns)} columns of one quantity for the {len(names)} joints "
                    f"{', '.join(names)} of {robot.name}; name those that were recorded (joints: [...])"
                )
        return self.model_copy(update={"joints": list(names)})

    def layout(self, source: str, lines: Sequence[str], file: str | None = None) -> Layout:
        """Layout of the lines of a file, which is the log itself where the mapping's name of another is not given."""
        if len(lines) <= self.skip:
            raise InputError(f"{source} has {len(lines)} lines, of which the mapping skips {self.skip}")
        separator, first = _SEPARATORS[self.separator], self.skip
        head = checked_head(source, cells(lines[first], separator))
        if not self.header:  # garbage before the first row is found with the rest
            few = lines[first : first + int(MOST * (len(lines) - first)) + 1]
            head = next((row for line in few if _is_row(row := cells(line, separator))), head)
        here = f"{source}, line {self.skip + 1}"
        if self.header and all(is_number(cell) for cell in head):
            raise InputError(f"{here} holds numbers, but the mapping expects a header; give header: false")
        if not self.header and not any(is_number(cell) for cell in head):
            raise InputError(f"{here} holds no number: {listed(head)}; check header, skip and separator of the mapping")
        names = head if self.header else [f"{k}" for k in range(1, len(head) + 1)]
        index = {name: k for k, name in reversed(list(enumerate(head)))} if self.header else {}
        return replace(self.columns_layout(source, names, index, file), separator=separator, first=first + self.header)

    def columns_layout(
        self, source: str, names: Sequence[str], index: Mapping[str, int], file: str | None = None
    ) -> Layout:
        """Layout of columns, some of which have names by which the mapping may call them."""
        sections = {name: section for name, section in self.sections.items() if section.file == file}
        channels = {
            name: section.channel(tuple(_place(source, c, index, len(names)) for c in section.columns))
            for name, section in sections.items()
        }
        time = next((section.time for section in sections.values() if section.time is not None), self.time)
        clock = ROWS if time.column is None else _place(source, time.column, index, len(names))
        parts = None if time.nanoseconds is None else _place(source, time.nanoseconds, index, len(names))
        return Layout(",", 1, tuple(names), clock, time.second, tuple(self.joints or ()), channels, nanoseconds=parts)


def _is_row(row: list[str]) -> bool:
    return sum(map(is_number, row)) > len(row) / 2


def _place(source: str, column: int | str, index: Mapping[str, int], count: int) -> int:
    if isinstance(column, str):
        if column not in index:
            raise UnknownName(f"column in {source}", column, index or ["numbers only, the file has no header"])
        return index[column]
    if column > count:
        raise InputError(f"{source} has {count} columns, the mapping asks for number {column}")
    return column - 1


@checked
def read_mapping(path: str | Path) -> LogMapping:
    """Read a mapping from a YAML file.

    Parameters
    ----------
    path : path

    Raises
    ------
    InputError
        Cannot be read, or malformed; with line and field.
    """
    settle_files(Path(path))
    if Path(path).name.endswith(MAPPING):  # written beside an exported motion
        settle_files(Path(str(path).removesuffix(MAPPING)))
    return validate(read_document(path, "log mapping"), LogMapping)
