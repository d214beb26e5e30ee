"""Layout of a foreign file of measurements, described by a small YAML file.

Columns are given by name or by number, 1 for the first; without a header by number. Of every channel the value is

    ``value = sign gain unit (cell - offset) / ratio``   (position, velocity)
    ``value = sign gain unit (cell - offset) ratio``     (effort, current)

with `ratio` the turns of the motor per turn of the joint, where the motor's side was recorded, and `gain` a further
factor, such as the torque constant [Nm/A] of a measured current. Each of `unit`, `gain`, `ratio`, `ticks`,
`offset`, `sign` is one value for all joints or a list of one per joint.

- `joints` are those of the robot, in order, if not given.
- `design` is the SHA-256 of the design that was played: of its ``design.json``, or of its coefficients. Exports of
  motions write it.
- `skip` is the number of lines before the table; other lines that hold no row of numbers are left out and named.
- ``unit: ticks`` (or ``ticks/s``) needs `ticks`, the counts of the encoder per turn. Temperatures in ``K`` and ``degF``
  are converted to deg C.
- ``side: motor`` says that the columns are the drives', which go through the gears and the coupling of the robot's
  description, see `excite.logs.motor_channels`; a `ratio` replaces the gears.
- `file` names another file of the same layout that holds the quantity, relative to the folder of the log; ``{log}`` in
  it stands for the name of the log without its ending. Its own `time` may be given. Its values are interpolated onto
  the rows of the positions.

The logs of an arm that records motor currents, six joints in 31 columns without a header, are read by::

    separator: ","
    header: false
    time: {column: 1, unit: s}
    joints: [shoulder_pan_joint, shoulder_lift_joint, elbow_joint, wrist_1_joint, wrist_2_joint, wrist_3_joint]
    position: {columns: [2, 3, 4, 5, 6, 7], unit: rad}
    velocity: {columns: [8, 9, 10, 11, 12, 13], unit: rad/s}
    current: {columns: [14, 15, 16, 17, 18, 19], unit: A, gain: [14.87, 13.26, 11.13, 10.62, 11.03, 11.47]}
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from excite.logs.layout import Layout, cells, head_cells, is_number, listed, twice
from excite.logs.log import WRENCH
from excite.logs.mapping_sections import (
    ChannelSection,
    CurrentSection,
    EffortSection,
    PositionSection,
    Section,
    TemperatureSection,
    TimeSection,
    VelocitySection,
    WrenchSection,
)
from excite.logs.table import MOST
from excite.storage.result_folder import settle_files
from regressors.arguments import checked
from regressors.errors import InputError, UnknownName
from regressors.input_files import read_text
from regressors.readers.documents import parse_document, validate
from regressors.readers.sized_numbers import within
from regressors.robot.robot import Robot

MAPPING = ".mapping.yaml"
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SEPARATORS = {",": ",", ";": ";", "\t": "\t", "tab": "\t", "whitespace": None}


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

    @field_validator("position", "velocity", "effort", "current", "temperature", "wrench")
    @classmethod
    def _each(cls, value: ChannelSection | None, info: ValidationInfo) -> ChannelSection | None:
        names = info.data.get("joints")
        expected = len(WRENCH) if info.field_name == "wrench" else names and len(names)
        if value is not None and expected and len(value.columns) != expected:
            what = "components" if info.field_name == "wrench" else "joints"
            raise ValueError(f"has {len(value.columns)} columns for {expected} {what}")
        if value is not None and value.file is not None and info.field_name == "position":
            raise ValueError("positions are in the log itself; give a file for other quantities")
        return value

    @field_validator("current")
    @classmethod
    def _either(cls, value: CurrentSection | None, info: ValidationInfo) -> CurrentSection | None:
        if value is not None and info.data.get("effort") is not None:
            raise ValueError("is given as well as effort; give one of them")
        return value

    @property
    def sections(self) -> dict[str, ChannelSection]:
        """Sections by the names of the channels of `excite.logs.log.Log`."""
        named = {
            "q": self.position,
            "dq": self.velocity,
            "effort": self.effort or self.current,
            "temperature": self.temperature,
            "wrench": self.wrench,
        }
        return {name: section for name, section in named.items() if section is not None}

    def of(self, robot: Robot | None) -> LogMapping:
        """The mapping with the names of its joints: those of the robot, in order, where it does not name them.

        Parameters
        ----------
        robot : Robot, optional

        Raises
        ------
        InputError
            No joints are named and no robot is given, or it has another number of joints than there are columns.
        """
        if self.joints is not None:
            return self
        if robot is None:
            raise InputError("the log mapping does not name its joints, and no robot is given whose they are")
        for name, section in self.sections.items():
            if name != "wrench" and len(section.columns) != robot.n:
                raise InputError(
                    f"the log mapping has {len(section.columns)} columns of one quantity for the {robot.n} joints "
                    f"{', '.join(robot.joint_names)} of {robot.name}; name those that were recorded (joints: [...])"
                )
        return self.model_copy(update={"joints": list(robot.joint_names)})

    def layout(self, source: str, lines: Sequence[str], file: str | None = None) -> Layout:
        """Layout of a file's lines.

        Parameters
        ----------
        source : str
            Name of the file, for messages.
        lines : sequence of str
        file : str, optional
            Name of the file in the mapping; that of the log itself if not given.

        Raises
        ------
        InputError
            The file does not have the lines or the columns that the mapping refers to.
        """
        if len(lines) <= self.skip:
            raise InputError(f"{source} has {len(lines)} lines, of which the mapping skips {self.skip}")
        separator = _SEPARATORS[self.separator]
        first = self.skip
        head = head_cells(source, lines[first], separator)
        if not self.header:  # garbage before the first row is found with the rest
            head = next((row for row in _first_rows(lines[first:], separator) if _is_row(row)), head)
        self._check_head(source, head)
        numbers = [f"{k}" for k in range(1, len(head) + 1)]
        index = {name: k for k, name in reversed(list(enumerate(head)))} if self.header else {}
        sections = {name: section for name, section in self.sections.items() if section.file == file}
        channels = {
            name: section.channel(tuple(_place(source, c, index, len(head)) for c in section.columns))
            for name, section in sections.items()
        }
        time = next((section.time for section in sections.values() if section.time is not None), self.time)
        return Layout(
            separator,
            first + self.header,
            tuple(head if self.header else numbers),
            _place(source, time.column, index, len(head)),
            SECONDS[time.unit],
            tuple(self.joints or ()),
            channels,
        )

    def _check_head(self, source: str, head: list[str]) -> None:
        """Raise `InputError` if the first line does not match the mapping."""
        here = f"{source}, line {self.skip + 1}"
        if self.header and all(is_number(cell) for cell in head):
            raise InputError(f"{here} holds numbers, but the mapping expects a header; give header: false")
        if not self.header and not any(is_number(cell) for cell in head):
            raise InputError(f"{here} holds no number: {listed(head)}; check header, skip and separator of the mapping")


def _first_rows(lines: Sequence[str], separator: str | None) -> Iterator[list[str]]:
    """Cells of the first lines, as many as may be garbage, and one more."""
    return (cells(line, separator) for line in lines[: int(MOST * len(lines)) + 1])


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
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read log mapping {path}: {getattr(error, 'strerror', None) or error}") from error
    return validate(parse_document(text, str(path)), LogMapping)
