"""A guess of the mapping that reads a recording: what was recognised, how certainly, and what remains to be asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from excite.logs.guess.channel_choice import ChosenChannels, chosen_channels
from excite.logs.guess.channel_group import ChannelGroup, channel_groups, numbered_groups
from excite.logs.guess.clock_choice import Clock, StreamSummary, chosen_clock, clock_candidates, summaries
from excite.logs.guess.motion_units import CERTAIN, STATED, FoundUnit, consistency, motion_units, time_unit
from excite.logs.mapping import LogMapping
from excite.logs.recordings.formats import Preloaded, recording_format
from excite.logs.recordings.recording import JOINT_STATE, Contents, Recording, RecordingFormat
from excite.logs.sampled_channels import seconds_of
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.robot.robot import Robot
from regressors.samples import Array

Read = Callable[[Path, Mapping[str, Sequence[str]]], Recording]
_SURE = (STATED, CERTAIN)
_PLURAL = {
    "position": "positions", "velocity": "velocities", "effort": "efforts", "current": "currents",
    "temperature": "temperatures", "wrench": "wrenches",
}  # fmt: skip
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
    path = Path(path)
    form = recording_format(path)
    return _guess(form, path, form.read, robot)[0]


def _guess(form: RecordingFormat, path: Path, read: Read, robot: Robot | None) -> tuple[LogGuess, Preloaded]:
    with np.errstate(over="ignore", invalid="ignore"):  # of columns that hold anything
        return _guess_of(form, path, read, robot)


def _guess_of(form: RecordingFormat, path: Path, read: Read, robot: Robot | None) -> tuple[LogGuess, Preloaded]:
    contents = form.contents(path)
    groups = channel_groups(contents)
    by_name = any(group.quantity == "position" and group.measured for group in groups)
    recording = read(path, _wanted(contents, groups if by_name else None))
    clocks = _clocks(contents, recording)
    if not by_name:
        groups = [*groups, *numbered_groups(contents, recording, clocks, None if robot is None else robot.n)]
    chosen = chosen_channels(groups, robot)
    found = _Guessing(contents, recording, clocks, chosen, robot)
    guess = found.guess(form.mapping_fields(path))
    return guess, Preloaded(form, contents, recording)


def _wanted(contents: Contents, groups: Sequence[ChannelGroup] | None) -> dict[str, list[str]]:
    """Columns to load: those of the groups and the clocks; all where names say nothing."""
    wanted: dict[str, dict[str, None]] = {}
    for stream in contents.streams:
        if groups is None:
            if len(stream.columns) > _MOST_COLUMNS:
                continue
            wanted[stream.name] = dict.fromkeys(stream.columns)
            continue
        columns = [c for g in groups if g.stream == stream.name and g.quantity and g.measured for c in g.columns]
        columns += [c for g in groups if g.stream == stream.name and not g.quantity for c in g.columns][:_MOST_COLUMNS]
        if columns or stream.clocks:
            wanted[stream.name] = dict.fromkeys([*clock_candidates(stream)[:_MOST_COLUMNS], *columns])
    return {name: list(columns) for name, columns in wanted.items()}


def _clocks(contents: Contents, recording: Recording) -> dict[str, Clock]:
    clocks = {}
    for stream in contents.streams:
        if stream.name in recording.streams:
            clock = chosen_clock(stream, recording.streams[stream.name])
            if clock is not None:
                clocks[stream.name] = clock
    return clocks


@dataclass(frozen=True, eq=False)
class _Guessing:
    """What a guess is made from."""

    contents: Contents
    recording: Recording
    clocks: Mapping[str, Clock]
    chosen: ChosenChannels
    robot: Robot | None

    def guess(self, fields: Mapping[str, object]) -> LogGuess:
        remarks: dict[str, list[str]] = {"": [], "time": []}
        questions: dict[str, list[str]] = {}
        for part, question in self.chosen.questions:
            questions.setdefault(part, []).append(question)
        mapping, units = None, self._units()
        positions = self.chosen.groups.get("position")
        if positions is None:
            questions.setdefault("", []).append(
                f"Which columns are the positions of the joints? None was recognised among {self._names()}"
            )
        elif positions.stream not in self.clocks:
            questions.setdefault("", []).append(f"When was each row taken? No column of {positions.stream} increases")
        else:
            self._tell(units, remarks, questions)
            mapping = self._mapping(units, fields)
        told = [text for several in remarks.values() for text in several]
        asked = [text for several in questions.values() for text in several]
        about = {
            part: (*remarks.get(part, ()), *(f"QUESTION: {text}" for text in questions.get(part, ())))
            for part in dict.fromkeys([*remarks, *questions])
        }
        streams = summaries(self.contents, self.recording, self.clocks, units.get("time", FoundUnit("", "", "")).unit)
        return LogGuess(self.contents, streams, tuple(told), tuple(asked), mapping, about)

    def _names(self) -> str:
        names = [stream.title(name) for stream in self.contents.streams for name in stream.columns]
        more = f" and {len(names) - 12} more" if len(names) > 12 else ""
        return ", ".join(names[:12]) + more

    def _units(self) -> dict[str, FoundUnit]:
        """Units of time, positions and velocities."""
        group = self.chosen.groups.get("position")
        if group is None or (clock := self.clocks.get(group.stream)) is None:
            return {}
        raw, q = self._samples(group)
        candidates = time_unit(raw, clock.unit)
        if q.shape[0] < 4 or not candidates:
            unit = FoundUnit(clock.unit or "s", STATED if clock.unit else "unknown", "no unit makes a likely rate")
            return {"time": unit, "position": FoundUnit(group.unit or "rad", "unknown", "too few rows show it")}
        speed = self.chosen.groups.get("velocity")
        ratio, signs = float("nan"), np.zeros(0)
        if speed is not None and speed.stream in self.clocks:
            other, dq = self._samples(speed)
            if other.size > 1:
                aligned = np.column_stack([np.interp(raw, other, column) for column in dq.T])
                agreement = consistency(raw - raw[0], q, aligned)
                ratio, signs = agreement.ratio, agreement.ratios
        turning = self._turning(group)
        stated = None if speed is None else speed.unit
        time, angle, rate = motion_units(candidates, group.unit, stated, ratio, q, turning)
        if clock.unit and time.level != "unknown":
            time = FoundUnit(clock.unit, STATED, "as the file says")
        units = {"time": time, "position": angle}
        if rate is not None:
            units["velocity"] = rate
        if np.any(signs < 0) or (np.isfinite(ratio) and np.nanmax(np.abs(np.abs(signs) / ratio - 1)) > _APART):
            units["signs"] = FoundUnit("", "unknown", self._unlike(group, signs))
        return units

    def _unlike(self, group: ChannelGroup, ratios: Array) -> str:
        each = ", ".join(f"{joint} {ratio:.3g}" for joint, ratio in zip(group.joints, ratios, strict=True))
        return f"ratio of velocity to rate of change of position: {each}"

    def _samples(self, group: ChannelGroup) -> tuple[Array, Array]:
        """Times, in their unit, and values of the rows that have all columns of a group."""
        columns = self.recording.streams[group.stream].columns
        values = np.column_stack([np.asarray(columns[name], dtype=float) for name in group.columns])
        clock = columns[self.clocks[group.stream].column]
        zero = float(clock[0]) if clock.dtype.kind in "iu" and clock.size else 0.0
        time = seconds_of(clock, 1.0, zero) + zero if zero else np.asarray(clock, dtype=float)
        there = np.isfinite(values).all(axis=1) & np.isfinite(time)
        return time[there], values[there]

    def _turning(self, group: ChannelGroup) -> Array:
        """How far the joints can move, infinite where it is not known [rad]."""
        n = len(group.columns)
        if self.robot is None or self.robot.n != n:
            return np.full(n, np.inf)
        limits = self.robot.limits
        return np.asarray(limits.upper - limits.lower, dtype=float)

    def _tell(
        self, units: Mapping[str, FoundUnit], remarks: dict[str, list[str]], questions: dict[str, list[str]]
    ) -> None:
        group = self.chosen.groups["position"]
        clock = self.clocks[group.stream]
        if clock.why:
            remarks["time"].append(f"{_capital(clock.why)}.")
        time, column = units["time"], _shown(clock.column)
        how = "." if time.level == STATED else f" ({time.level}): {time.why}."
        remarks["time"].append(f"The time is {column} in {time.unit}{how}")
        if time.level not in _SURE or not clock.certain:
            questions.setdefault("time", []).append(f"Is {column} the time in {time.unit}? ({time.level}: {time.why})")
        for quantity, each in self.chosen.groups.items():
            found = units.get(quantity, FoundUnit(each.unit, STATED, ""))
            remarks.setdefault(quantity, []).append(_columns_sentence(quantity, each, found))
            if quantity == "effort" and each.why == JOINT_STATE:
                remarks[quantity].append(_CURRENTS)
            if each.guessed and quantity == "position":
                questions.setdefault(quantity, []).append(f"Are the positions of all joints {each.span}?")
            if found.level != STATED:
                sentence = f"{_capital(_PLURAL[quantity])} are in {found.unit} ({found.level}): {found.why}."
                remarks[quantity].append(sentence)
                follows = quantity == "velocity" and units["position"].level not in _SURE
                if found.level not in _SURE and not follows:
                    questions.setdefault(quantity, []).append(
                        f"Are the {_PLURAL[quantity]} in {found.unit}? ({found.level}: {found.why})"
                    )
        if "signs" in units:
            questions.setdefault("velocity", []).append(
                f"Do all velocities belong to the positions of their joints, with the same sign? ({units['signs'].why})"
            )

    def _mapping(self, units: Mapping[str, FoundUnit], fields: Mapping[str, object]) -> LogMapping:
        groups = self.chosen.groups
        home = groups["position"].stream
        content: dict[str, Any] = dict(fields)
        if self.chosen.names is not None:
            content["joints"] = list(self.chosen.names)
        content["time"] = {"column": self._column(self.clocks[home].column, fields), "unit": units["time"].unit}
        for quantity, group in groups.items():
            unit = units[quantity].unit if quantity in units else group.unit or _DEFAULT[quantity]
            section: dict[str, Any] = {
                "columns": [self._column(name, fields) for name in group.columns],
                "unit": [unit],
            }
            if group.stream != home and (clock := self.clocks.get(group.stream)) is not None:
                section["time"] = {"column": clock.column, "unit": clock.unit or units["time"].unit}
            if quantity == "current":
                section["gain"] = [1.0] * len(group.columns)
            content[quantity] = section
        return LogMapping.model_validate(content)

    def _column(self, name: str, fields: Mapping[str, object]) -> str | int:
        """Column in the mapping: its number where a text has no header."""
        return int(name) if fields.get("header") is False else name


_DEFAULT = {"velocity": "rad/s", "effort": "Nm", "current": "A", "temperature": "degC", "wrench": "N"}
_CURRENTS = (
    "Some drivers of robots publish motor currents [A] as efforts, such as those of Universal Robots: see its manual."
)
_APART = 0.1  # of the ratios of joints


def _columns_sentence(quantity: str, group: ChannelGroup, found: FoundUnit) -> str:
    how = f"as {group.why} defines" if group.why else group.how
    of = "component" if quantity == "wrench" else "joint"
    count = f"{len(group.columns)} {of}{'s' * (len(group.columns) != 1)}"
    verb = "may be" if group.guessed else "are"
    unit = f" [{found.unit}]" if found.unit and found.level == STATED else ""
    return f"{_capital(_PLURAL[quantity])}{unit} {verb} {group.span}, of {count}, {how}."


def _shown(column: str) -> str:
    return f"column {column}" if column.isdigit() else column


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def certain_mapping(path: Path, robot: Robot | None, otherwise: InputError | None = None) -> tuple[LogGuess, Preloaded]:
    """The guess of a recording that leaves no question, and what was read for it."""
    try:
        form = recording_format(path)
        guess, loaded = _guess(form, path, form.glance, robot)
    except InputError:
        if otherwise is not None:
            raise otherwise from None
        raise
    if guess.mapping is not None and not guess.questions:
        return guess, loaded
    if guess.mapping is None and otherwise is not None:
        raise otherwise
    more = f"; and {len(guess.questions) - 1} more" if len(guess.questions) > 1 else ""
    raise InputError(
        f"{path}, {guess.contents.format}, leaves a question: {guess.questions[0]}{more}; `guess_mapping` shows what "
        "is in it and writes a mapping to be corrected, which is given as `mapping`"
    )
