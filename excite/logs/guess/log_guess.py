"""A guess of the mapping that reads a recording: what was recognised, how certainly, and what remains to be asked.

The mapping is written as YAML, with what is known and what is asked as comments.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from excite.logs.guess.channels import (
    MOST_NAMES,
    ChannelGroup,
    channel_groups,
    chosen_channels,
    numbered_groups,
    unnamed_positions,
)
from excite.logs.guess.units import (
    CERTAIN,
    FASTEST,
    SLOWEST,
    STATED,
    UNKNOWN,
    Clock,
    FoundUnit,
    StreamSummary,
    chosen_clock,
    clock_candidates,
    motion_units,
    summaries,
    time_units,
    velocity_ratios,
)
from excite.logs.log import counted
from excite.logs.mapping import SECONDS, LogMapping, PositionSection, VelocitySection
from excite.logs.recorded_log import seconds_of
from excite.logs.recordings.formats import preloaded, recording_format
from excite.logs.recordings.recording import JOINT_STATE, SAGE, SI_UNITS, Contents, Recording, RecordingFormat
from excite.storage.result_folder import write_file
from regressors.arguments import checked
from regressors.errors import InputError, listed_names, printable
from regressors.robot.robot import Robot
from regressors.samples import Array

_SURE = (STATED, CERTAIN)
_WHOLE = ""  # part of the mapping that a sentence on all of it is about
_PLURAL = {
    "position": "positions", "velocity": "velocities", "effort": "efforts", "current": "currents",
    "temperature": "temperatures", "wrench": "wrenches", "command": "commands",
}  # fmt: skip
_CURRENTS = (
    "Some drivers of robots publish motor currents [A] as efforts, such as those of Universal Robots: see its manual."
)
_APART = 0.1  # of the ratios of joints
_MOST_COLUMNS = 500  # that are loaded where no name says what they are


@dataclass(frozen=True, eq=False, repr=False)
class LogGuess:
    """What a recording seems to hold.

    Parameters
    ----------
    contents : Contents
        What is inside.
    summaries : tuple of StreamSummary
        Rates, durations and gaps.
    recognised : tuple of str
        Sentences on what was recognised, each with how certain it is.
    questions : tuple of str
        What the recording does not say; without any, `mapping` is certain.
    mapping : LogMapping or None
        The likeliest one; None if no positions were recognised.
    remarks : mapping of str to tuple of str
        Sentences by the section of the mapping that they are about.
    """

    contents: Contents
    summaries: tuple[StreamSummary, ...]
    recognised: tuple[str, ...]
    questions: tuple[str, ...]
    mapping: LogMapping | None
    remarks: Mapping[str, tuple[str, ...]]

    def __repr__(self) -> str:
        """One line."""
        return f"<LogGuess {self.contents.source}: {self.contents.format}, {len(self.questions)} questions>"


@checked
def guess_mapping(path: str | Path, robot: Robot | None = None) -> LogGuess:
    """Guess the mapping by which `excite.logs.log_reading.read_log` reads a recording.

    Columns are recognised by the definition of the format, by their names, else by their numbers: a velocity is the
    rate of change of a position. Units that nothing states follow from the ratio of the velocities to that rate of
    change, and from the ranges; these last are questions still.

    Parameters
    ----------
    path : path
        File or folder.
    robot : Robot, optional
        Whose joints these are, for their names and ranges.

    Raises
    ------
    InputError
        Cannot be read, or of no known format.
    """
    return _guess(Path(path), robot, glance=False)[0]


def certain_mapping(
    path: Path, robot: Robot | None, otherwise: InputError | None = None
) -> tuple[LogGuess, RecordingFormat]:
    """The guess of a recording that leaves no question, and what was read for it."""
    try:
        guess, loaded = _guess(path, robot, glance=True)
    except InputError:
        if otherwise is not None:
            raise otherwise from None
        raise
    if guess.mapping is not None and not guess.questions:
        return guess, loaded
    more = f"; and {len(guess.questions) - 1} more" if len(guess.questions) > 1 else ""
    raise InputError(
        f"{path}, {guess.contents.format}, leaves a question: {guess.questions[0]}{more}; `guess_mapping` shows what "
        "is in it and writes a mapping to be corrected, which is given as `mapping`"
    )


@np.errstate(over="ignore", invalid="ignore")  # of columns that hold anything
def _guess(path: Path, robot: Robot | None, glance: bool) -> tuple[LogGuess, RecordingFormat]:
    form = recording_format(path)
    contents = form.contents(path)
    groups = channel_groups(contents)
    by_name = any(group.quantity == "position" and group.measured for group in groups)
    read = (form.glance if glance else None) or form.read
    recording = read(path, _wanted(contents, groups if by_name else None))
    guessing = _Guessing(contents, recording, form.mapping_fields(path))
    if not by_name:
        joints = None if robot is None else robot.n
        groups += numbered_groups(contents, recording, guessing.clocks, joints) or unnamed_positions(groups, joints)
    return guessing.guess(groups, robot), preloaded(form, contents, recording)


def _wanted(contents: Contents, groups: Sequence[ChannelGroup] | None) -> dict[str, list[str]]:
    """Columns to load: those of the groups and the clocks; all where names say nothing."""
    wanted: dict[str, list[str]] = {}
    for stream in contents.streams:
        if groups is None:
            if len(stream.columns) <= _MOST_COLUMNS:
                wanted[stream.name] = list(stream.columns)
            continue
        own = [group for group in groups if group.stream == stream.name]
        columns = [column for group in own if group.quantity and group.measured for column in group.names]
        columns += [column for group in own if not group.quantity for column in group.names][:_MOST_COLUMNS]
        if columns or stream.clocks:
            wanted[stream.name] = list(dict.fromkeys([*clock_candidates(stream)[:_MOST_COLUMNS], *columns]))
    return wanted


class _Guessing:
    """The guess of one recording, with what was recognised and what is to be asked by the parts of the mapping."""

    def __init__(self, contents: Contents, recording: Recording, fields: Mapping[str, object]) -> None:
        self.contents, self.recording, self.fields = contents, recording, fields
        self.told: dict[str, list[str]] = {_WHOLE: [], "time": []}
        self.asked: dict[str, list[str]] = {_WHOLE: []}
        self.clocks: dict[str, Clock] = {}
        self.rate = 0.0  # of rows that no column has the time of [Hz]
        for stream in contents.streams:
            loaded = recording.streams.get(stream.name)
            if loaded is not None and (clock := chosen_clock(stream, loaded.columns)) is not None:
                self.clocks[stream.name] = clock

    def tell(self, part: str, sentence: str) -> None:
        self.told.setdefault(part, []).append(sentence[:1].upper() + sentence[1:])

    def ask(self, part: str, question: str) -> None:
        self.asked.setdefault(part, []).append(question)

    def guess(self, groups: Sequence[ChannelGroup], robot: Robot | None) -> LogGuess:
        chosen, joints = chosen_channels(groups, robot, self.ask)
        mapping, time = None, ""
        if (position := chosen.get("position")) is None:
            names = [stream.title(name) or name for stream in self.contents.streams for name in stream.columns]
            which = "Which columns are the positions of the joints? None was recognised among"
            self.ask(_WHOLE, f"{which} {listed_names(names, MOST_NAMES)}")
        elif position.stream not in self.clocks and not self._find_rate(position, chosen.get("velocity")):
            of_rows = "a mapping may state a rate of rows: `time: {rate: HZ}`"
            self.ask(_WHOLE, f"When was each row taken? No column of {position.stream} increases; {of_rows}")
        else:
            units, unlike = self._units(chosen, robot)
            speed = chosen.get("velocity")
            if speed is not None and speed.why == SAGE and (unlike or units["position"].level == UNKNOWN):
                why = unlike or units["position"].why  # positions of servos may be scaled, and their velocities not
                self.tell("velocity", f"velocities that disagree with the positions are not used: {why}.")
                del chosen["velocity"]
                units, unlike = self._units(chosen, robot)
            time = units["time"].unit
            if "command" in chosen and not chosen["command"].unit:
                units["command"] = FoundUnit(units["position"].unit, CERTAIN, "as the positions")
            self._describe(chosen, units)
            if unlike:
                sign = "Do all velocities belong to the positions of their joints, with the same sign?"
                self.ask("velocity", f"{sign} ({unlike})")
            mapping = self._mapping(chosen, joints, units)
        remarks = {
            part: (*self.told.get(part, ()), *(f"QUESTION: {text}" for text in self.asked.get(part, ())))
            for part in dict.fromkeys([*self.told, *self.asked])
        }
        told, asked = (tuple(text for part in some.values() for text in part) for some in (self.told, self.asked))
        streams = summaries(self.contents, self.recording, self.clocks, time)
        return LogGuess(self.contents, streams, told, asked, mapping, remarks)

    def _find_rate(self, position: ChannelGroup, speed: ChannelGroup | None) -> bool:
        """Whether velocities beside the positions tell how many rows there are in a second, if no column does."""
        if speed is None or speed.stream != position.stream or speed.stream not in self.recording.streams:
            return False
        (row, q), (_, dq) = self._samples(position), self._samples(speed)
        ratios = velocity_ratios(row, q, dq) if len(q) == len(dq) > 3 else np.zeros(0)
        units = PositionSection.units.get(position.unit), VelocitySection.units.get(speed.unit)
        ratios = np.abs(ratios[np.isfinite(ratios)]) * (units[1] / units[0] if units[0] and units[1] else 1.0)
        if not ratios.size or not 1 / SLOWEST <= np.median(ratios) <= 1 / FASTEST:
            return False
        self.rate = float(f"{np.median(ratios):.3g}")
        why = "but velocities are that many times the change of positions from row to row"
        self.ask("time", f"Are there {self.rate:g} rows in a second? No column increases as a time does, {why}")
        return True

    def _units(self, chosen: Mapping[str, ChannelGroup], robot: Robot | None) -> tuple[dict[str, FoundUnit], str]:
        """Units of time, positions and velocities; and how velocities of single joints disagree with positions."""
        position, speed = chosen["position"], chosen.get("velocity")
        stated = "s" if self.rate else self.clocks[position.stream].unit
        raw, q = self._samples(position)
        candidates = time_units(raw, stated)
        if q.shape[0] < 4 or not candidates:
            time = FoundUnit(stated or "s", STATED if stated else UNKNOWN, "no unit makes a likely rate")
            return {"time": time, "position": FoundUnit(position.unit or "rad", UNKNOWN, "too few rows show it")}, ""
        ratios = np.zeros(0)
        if speed is not None and (self.rate or speed.stream in self.clocks):
            other, dq = self._samples(speed)
            if other.size > 1:
                aligned = np.column_stack([np.interp(raw, other, column) for column in dq.T])
                ratios = velocity_ratios(raw - raw[0], q, aligned)
        there = ratios[np.isfinite(ratios)]
        ratio = float(np.median(np.abs(there))) if there.size else float("nan")
        turning = np.full(q.shape[1], np.inf)  # how far the joints can move [rad]
        if robot is not None and robot.n == turning.size:
            turning = robot.limits.upper - robot.limits.lower
        of_velocity = None if speed is None else speed.unit
        time, angle, rate = motion_units(candidates, position.unit, of_velocity, ratio, q, turning)
        if stated and time.level != UNKNOWN:
            time = FoundUnit(stated, STATED, "as the file says")
        units = {"time": time, "position": angle} | ({} if rate is None else {"velocity": rate})
        if np.any(ratios < 0) or (there.size and np.nanmax(np.abs(np.abs(ratios) / ratio - 1)) > _APART):
            rates = ratios * SECONDS[time.unit]
            each = ", ".join(f"{joint} {one:.3g}" for joint, one in zip(position.joints, rates, strict=True))
            return units, f"ratio of velocity to rate of change of position: {each}"
        return units, ""

    def _samples(self, group: ChannelGroup) -> tuple[Array, Array]:
        """Times, in their unit, and values of the rows that have all columns of a group."""
        columns = self.recording.streams[group.stream].columns
        values = np.column_stack([np.asarray(columns[name], dtype=float) for name in group.names])
        rows = np.arange(len(values)) / (self.rate or 1.0)
        clock = self.clocks[group.stream].times(columns) if group.stream in self.clocks else rows
        zero = float(clock[0]) if clock.dtype.kind in "iu" and clock.size else 0.0
        time = seconds_of(clock, 1.0, zero) + zero if zero else np.asarray(clock, dtype=float)
        there = np.isfinite(values).all(axis=1) & np.isfinite(time)
        return time[there], values[there]

    def _describe(self, chosen: Mapping[str, ChannelGroup], units: Mapping[str, FoundUnit]) -> None:
        """Tell what was recognised, each with how it is known, and ask where that is not certain."""
        if (clock := self.clocks.get(chosen["position"].stream)) is not None:
            self._describe_clock(clock, units["time"])
        for quantity, group in chosen.items():
            found, plural = units.get(quantity, FoundUnit(group.unit, STATED, "")), _PLURAL[quantity]
            of = f"{'component' if quantity == 'wrench' else 'joint'}{'s' * (len(group.columns) != 1)}"
            unit = f" [{found.unit}]" if found.unit and found.level == STATED else ""
            what = f"{plural}{unit} {'may be' if group.guessed else 'are'} {group.span}, of {len(group.columns)} {of}"
            self.tell(quantity, f"{what}, {f'as {group.why} defines' if group.why else group.how}.")
            if quantity == "effort" and group.why == JOINT_STATE:
                self.tell(quantity, _CURRENTS)
            if group.why == SAGE and quantity == "position":
                lists = [one for stream in self.contents.streams for one in stream.meanings.values()]
                if more := sum(one.quantity == quantity for one in lists) - len(group.columns):
                    self.tell(quantity, f"{counted(more, 'further number')} in each list is of no joint of the robot.")
            if group.guessed and quantity == "position":
                self.ask(quantity, f"Are the positions of all joints {group.span}?")
            if found.level != STATED:
                self.tell(quantity, f"{plural} are in {found.unit} ({found.level}): {found.why}.")
                follows = quantity == "velocity" and units["position"].level not in _SURE
                if found.level not in _SURE and not follows:
                    self.ask(quantity, f"Are the {plural} in {found.unit}? ({found.level}: {found.why})")

    def _describe_clock(self, clock: Clock, time: FoundUnit) -> None:
        if clock.why:
            self.tell("time", f"{clock.why}.")
        how = "" if time.level == STATED else f" ({time.level}): {time.why}"
        unit = "s" if clock.nanoseconds else time.unit
        self.tell("time", f"the time is {clock.title} in {unit}{how}.")
        if time.level not in _SURE or not clock.certain:
            counts = "; where it counts rows, state `rate: HZ` instead of the unit" * (time.level == UNKNOWN)
            self.ask("time", f"Is {clock.title} the time in {unit}? ({time.level}: {time.why}{counts})")

    def _mapping(
        self, chosen: Mapping[str, ChannelGroup], joints: Sequence[str] | None, units: Mapping[str, FoundUnit]
    ) -> LogMapping:
        def column(name: str) -> str | int:  # its number where a text has no header
            return int(name) if self.fields.get("header") is False else name

        home = chosen["position"].stream
        content: dict[str, Any] = dict(self.fields) | ({} if joints is None else {"joints": list(joints)})
        clock = self.clocks.get(home)
        content["time"] = _time_section(clock, units["time"].unit, column) if clock else {"rate": self.rate}
        for quantity, group in chosen.items():
            unit = units[quantity].unit if quantity in units else group.unit or SI_UNITS[quantity]
            content[quantity] = section = {"columns": list(map(column, group.names)), "unit": [unit]}
            if group.stream != home and (clock := self.clocks.get(group.stream)) is not None:
                section["time"] = _time_section(clock, clock.unit or units["time"].unit, column)
            if quantity == "current":
                section["gain"] = [1.0] * len(group.columns)
        return LogMapping.model_validate(content)


def _time_section(clock: Clock, unit: str, column: Callable[[str], str | int]) -> dict[str, str | int]:
    """Columns of a clock with its unit, as a mapping has them."""
    if clock.nanoseconds:
        return {"column": column(clock.column), "nanoseconds": column(clock.nanoseconds)}
    return {"column": column(clock.column), "unit": unit}


_WIDTH = 110
_OF_TEXT = ("separator", "header", "skip")
_WORDS = frozenset({"true", "false", "null", "yes", "no", "on", "off", "y", "n", "True", "False", "Null", "nan", "inf"})


def mapping_text(guess: LogGuess) -> str:
    """Text of the mapping file of a guess."""
    if guess.mapping is None:
        raise InputError(f"{guess.contents.source}: no mapping can be written; {guess.questions[0]}")
    content = guess.mapping.model_dump(exclude_unset=True)
    title = f"Mapping of {guess.contents.source} ({guess.contents.format}), to be corrected."
    how = "Give it as the mapping of the log once the lines with QUESTION are answered."
    lines = _comments([title, how, *guess.remarks.get("", ())])
    fields = [name for name in _OF_TEXT if getattr(guess.mapping, name) != LogMapping.model_fields[name].default]
    fields += ["joints"] * bool(content.get("joints"))
    lines += [f"{name}: {_value(content[name])}" for name in fields]
    for name in ("time", *_PLURAL):
        if name in content:
            lines += ["", *_comments(guess.remarks.get(name, ()))]
            if name == "time":
                lines.append(f"time: {_value(content['time'])}")
            else:
                lines += [f"{name}:", *(f"  {key}: {_value(_single(key, v))}" for key, v in content[name].items())]
    for name in _PLURAL:
        if name not in content and guess.remarks.get(name):
            lines += ["", *_comments(guess.remarks[name])]
    return "\n".join(lines) + "\n"


def _comments(texts: Iterable[str]) -> list[str]:
    wrapper = textwrap.TextWrapper(
        _WIDTH, initial_indent="# ", subsequent_indent="#   ", break_long_words=False, break_on_hyphens=False
    )
    return [line for text in texts for line in wrapper.wrap(printable(text))]


def _single(key: str, value: Any) -> Any:
    """One value for all, where a field has only one."""
    one = key in ("unit", "sign", "offset") and isinstance(value, list) and len(value) == 1
    return value[0] if one else value


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_value(each)}" for key, each in value.items()) + "}"
    if isinstance(value, str) and value.replace("/", "").isalnum() and not value[:1].isdigit():
        return value if value not in _WORDS else json.dumps(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(_value(each) for each in value) + "]"
    return json.dumps(value, ensure_ascii=not (isinstance(value, str) and value.isprintable()))


def write_mapping_file(guess: LogGuess, path: str | Path, *, replace: bool = False) -> None:
    """Write the mapping of a guess, with what is known and what is asked as comments."""
    if not Path(path).name:
        raise InputError("the name of the mapping to write is empty")
    write_file(Path(path), mapping_text(guess).encode("utf-8"), replace=replace)
