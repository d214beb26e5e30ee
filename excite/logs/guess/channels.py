"""Groups of columns of one quantity, one column for each joint, and which of them are the channels of a log."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from excite.logs.guess.units import Clock
from excite.logs.log import WRENCH, integrate_rates
from excite.logs.recordings.recording import SAGE, ColumnName, Contents, Recording, StreamContents, parsed_name
from regressors.errors import listed_names
from regressors.robot.robot import Robot
from regressors.samples import Array

_PREFERRED = frozenset({"actual", "measured", "meas", "state", "states", "joint", "feedback", "present"})
_COMMANDED = frozenset({"action", "command", "commands", "commanded", "cmd", "goal", "target"})  # positions
_OF_COPIES = frozenset({"filtered", "filter", "filt", "smoothed", "smooth", "lowpass", "lp"})
_AXIS = re.compile(r"^(.*?)(force|torque|f|t|m)[^a-z0-9]?([xyz])$", re.IGNORECASE)
_UNIT_BEHIND = re.compile(r"\s*[\[(][^\])]*[\])]\s*$")


@dataclass(frozen=True)
class ChannelGroup:
    """Columns of one quantity."""

    quantity: str  # such as ``position``, see `Meaning`; empty where nothing says it
    stream: str
    columns: Mapping[str, str]  # by joint, whose numbers or names are as the file has them
    unit: str = ""  # empty where nothing states it
    why: str = ""  # definition that says so; empty where it is by name
    common: tuple[str, ...] = ()  # words that all names share beside quantity and joint
    measured: bool = True
    how: str = "by their names"  # it was found, the end of a sentence
    guessed: bool = False  # whether the columns themselves are to be asked for

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints, in the order of their columns."""
        return tuple(self.columns)

    @property
    def names(self) -> list[str]:
        """Names of the columns."""
        return list(self.columns.values())

    @property
    def span(self) -> str:
        """First and last column, in words."""
        first, last = self.names[0], self.names[-1]
        number = first.isdigit()
        if len(self.columns) == 1:
            return f"{'column ' * number}{first}"
        return f"columns {first} ... {last}" if number else f"{first} ... {'column ' * last.isdigit()}{last}"

    @property
    def rank(self) -> tuple[bool, int, int]:
        """By which the likeliest of several is chosen: defined, named as measured, with most joints."""
        return bool(self.why), len(_PREFERRED.intersection(self.common)), len(self.columns)

    def of(self, joints: Sequence[str]) -> ChannelGroup:
        """The same, of some joints in an order."""
        return replace(self, columns={joint: self.columns[joint] for joint in joints})


def channel_groups(contents: Contents) -> list[ChannelGroup]:
    """All groups of columns of a recording, by definitions and by names, without filtered copies of others."""
    groups = [group for stream in contents.streams for find in (_defined, _wrenches, _named) for group in find(stream)]
    own = [(g.stream, g.quantity, set(g.columns)) for g in groups if not _OF_COPIES.intersection(g.common)]
    return [
        group
        for group in groups
        if not _OF_COPIES.intersection(group.common) or (group.stream, group.quantity, set(group.columns)) not in own
    ]


def _defined(stream: StreamContents) -> Iterator[ChannelGroup]:
    there: dict[tuple[str, str, str], dict[str, str]] = {}
    for column in stream.columns:
        if (meaning := stream.meanings.get(column)) is not None:
            there.setdefault((meaning.quantity, meaning.unit, meaning.why), {})[meaning.of] = column
    for (quantity, unit, why), columns in there.items():
        group = ChannelGroup(quantity, stream.name, columns, unit, why)
        if quantity != "wrench":
            yield group
        elif set(WRENCH) <= set(columns):
            yield group.of(WRENCH)


def _wrenches(stream: StreamContents) -> Iterator[ChannelGroup]:
    """Six columns such as ``ft/force/x`` or ``fx``."""
    there: dict[tuple[str, bool], dict[str, str]] = {}
    for column in stream.columns:
        title = re.sub(r"\s*[\[(].*$", "", stream.title(column))
        if column not in stream.meanings and (match := _AXIS.match(title)):
            side = "force" if match[2].lower() in ("force", "f") else "torque"
            there.setdefault((match[1].lower(), len(match[2]) > 1), {})[f"{side}.{match[3].lower()}"] = column
    for columns in there.values():
        if set(WRENCH) <= set(columns):
            yield ChannelGroup("wrench", stream.name, columns).of(WRENCH)


def _named(stream: StreamContents) -> Iterator[ChannelGroup]:
    parsed = {
        column: parsed_name(stream.title(column), stream.units.get(column, ""))
        for column in stream.columns
        if column not in stream.meanings and column not in stream.clocks and stream.title(column)
    }
    for quantity in ("position", "velocity", "effort", "current", "temperature", ""):
        for measured in (True, False):
            some = {c: p for c, p in parsed.items() if p.quantity == quantity and p.measured == measured}
            for common, unit, columns in _by_joint(stream, quantity, some):
                if quantity == "position" and _COMMANDED.intersection(common):
                    yield ChannelGroup("command", stream.name, columns, unit, "", common)
                else:
                    yield ChannelGroup(quantity, stream.name, columns, unit, "", common, measured)


def _by_joint(
    stream: StreamContents, quantity: str, parsed: Mapping[str, ColumnName]
) -> Iterator[tuple[tuple[str, ...], str, dict[str, str]]]:
    """Columns whose names differ by a number, else by the name of a joint, with their common words and their unit."""
    numbered: dict[tuple[tuple[str, ...], str], dict[str, str]] = {}
    for column, name in parsed.items():
        if digits := [k for k, word in enumerate(name.label) if word.isdigit()]:
            k = digits[-1]
            template = (*name.label[:k], "#", *name.label[k + 1 :])
            numbered.setdefault((template, name.unit), {}).setdefault(name.label[k], column)
    several = {key: columns for key, columns in numbered.items() if len(columns) > 1}
    if sum(map(len, several.values())) == len(parsed) or not quantity:
        for (template, unit), columns in several.items():
            yield template, unit, {joint: columns[joint] for joint in sorted(columns, key=int)}
        return
    by_place: dict[tuple[str, str], dict[str, str]] = {}
    for column, name in parsed.items():
        place, joint = _joint_name(stream.title(column), name)
        by_place.setdefault((place, name.unit), {}).setdefault(joint, column)
    for (place, unit), columns in by_place.items():
        yield tuple(part for part in re.split(r"[^a-z]+", place.lower()) if part), unit, columns


def _joint_name(title: str, parsed: ColumnName) -> tuple[str, str]:
    """Where a column is, and the name of its joint, of a name such as ``/topic/shoulder/position`` or ``elbow.pos``."""
    parts = [part for part in re.split(r"[/.]", _UNIT_BEHIND.sub("", title)) if part]
    of_quantity = [k for k, part in enumerate(parts) if parsed_name(part).quantity == parsed.quantity]
    k = of_quantity[-1] if of_quantity else len(parts) - 1
    if not parsed_name(parts[k]).label and len(parts) > 1:  # the quantity alone: the joint stands before or behind it
        joint = k - 1 if k else 1
        return "/".join(part for n, part in enumerate(parts) if n not in (k, joint)), parts[joint]
    if k < len(parts) - 1:  # joint_positions/shoulder
        return "/".join(parts[:-1]), parts[-1]
    return "/".join(parts[:k]), "_".join(parsed_name(parts[k]).label) or "joint"


def numbered_groups(
    contents: Contents, recording: Recording, clocks: Mapping[str, Clock], joints: int | None
) -> list[ChannelGroup]:
    """Positions and velocities of each stream by their agreement, and blocks of as many columns beside them."""
    groups: list[ChannelGroup] = []
    for stream in contents.streams:
        if (clock := clocks.get(stream.name)) is not None and stream.name in recording.streams:
            columns = recording.streams[stream.name].columns
            names = [name for name in stream.columns if name in columns and not np.isnan(columns[name]).all()]
            values = np.column_stack([np.asarray(columns[name], dtype=float) for name in names])
            time = clock.times(columns)
            values[:, place := names.index(clock.column)] = time - time[0]
            groups += _of_numbers(stream.name, names, values, place, joints)
    return groups


def _of_numbers(stream: str, names: list[str], values: Array, clock: int, joints: int | None) -> Iterator[ChannelGroup]:
    whole = values[np.isfinite(values).all(axis=1)]
    found = motion_columns(whole[:, clock], whole, clock) if whole.shape[0] >= 100 else None
    if found is None:
        return
    positions, offset, seen = found
    n = min(joints or len(positions), len(positions))

    def group(quantity: str, places: Iterable[int], how: str, guessed: bool = False) -> ChannelGroup:
        columns = {f"{k}": names[place] for k, place in enumerate(places, 1)}
        return ChannelGroup(quantity, stream, columns, common=("#",), how=how, guessed=guessed)

    shown = "" if seen >= n else f", as {seen} of them show{'s' * (seen == 1)} that moved"
    yield group("position", positions[:n], f"since other columns are their rate of change{shown}", seen < n)
    yield group("velocity", [k + offset for k in positions[:n]], "since they are their rate of change")
    free = [k for k in range(len(names)) if k > max(positions) + offset and k != clock]
    for first in range(0, len(free) - n + 1, n):
        yield group("", free[first : first + n], "by their place")


def unnamed_positions(groups: Sequence[ChannelGroup], joints: int | None) -> list[ChannelGroup]:
    """Numbered columns whose names say no quantity, such as ``j1`` ... ``j6``, as positions to be asked about."""
    counts = {joints} - {None} or {len(group.columns) for group in groups if group.quantity in ("effort", "current")}
    some = [group for group in groups if not group.quantity and group.measured and len(group.columns) in counts]
    return [replace(group, quantity="position", how="by their place", guessed=True) for group in some[:1]]


_ALIKE = 0.95  # correlation
_MOST_ROWS = 20_000
_WIDTH = 10  # rows over which a rate of change is taken


def motion_columns(time: Array, values: Array, clock: int) -> tuple[tuple[int, ...], int, int] | None:
    """Columns of positions, how far behind them their velocities are, and how many of them the motion shows.

    None if no column is the rate of change of another.
    """
    # time (N,); values (N, c)
    some = slice(None, None, max(1, time.size // _MOST_ROWS))
    pairs = _pairs(time[some], values[some], clock)
    if not pairs:
        return None
    apart = [b - a for a, b in pairs]
    offset = max(set(apart), key=apart.count)
    rates = {b for a, b in pairs if b - a == offset}  # of change, whose own is an acceleration
    starts = [a for a, b in pairs if b - a == offset and a not in rates]
    if not starts:
        return None
    first = min(starts)
    if offset == 1:  # q1, dq1, q2, dq2, ...: every second or third column
        stride = min(np.diff(starts), default=2)
        block = tuple(range(first, max(starts) + 1, int(stride)))
    elif max(starts) - first < offset:
        lowest = max(clock + 1 if clock < first else 0, max(starts) - offset + 1)
        begin = lowest if lowest <= first else first
        block = tuple(range(begin, min(begin + offset, values.shape[1] - offset)))
    else:
        block = tuple(sorted(set(starts)))
    return block, offset, len(set(starts).intersection(block))


def _pairs(time: Array, values: Array, clock: int) -> list[tuple[int, int]]:
    """Columns of which the second is the rate of change of the first."""
    area = integrate_rates(time, values)
    moved = _unit(values[_WIDTH:] - values[:-_WIDTH])
    integral = _unit(area[_WIDTH:] - area[:-_WIDTH])
    alike = np.abs(moved.T @ integral)  # (positions, velocities)
    alike[clock] = alike[:, clock] = 0.0
    np.fill_diagonal(alike, 0.0)
    best = [(int(a), int(np.argmax(alike[a]))) for a in range(values.shape[1]) if alike[a].max() > _ALIKE]
    return [(a, b) for a, b in best if int(np.argmax(alike[:, b])) == a]


def _unit(values: Array) -> Array:
    rounding = 1e-9 * np.maximum(1.0, np.linalg.norm(values, axis=0))
    values = values - values.mean(axis=0)
    size = np.linalg.norm(values, axis=0)
    return np.asarray(np.divide(values, size, out=np.zeros_like(values), where=size > rounding))


_SHOWN, MOST_NAMES = 4, 12
Ask = Callable[[str, str], None]  # a quantity, empty for the whole, and a question about it


def chosen_channels(
    groups: Sequence[ChannelGroup], robot: Robot | None, ask: Ask
) -> tuple[dict[str, ChannelGroup], tuple[str, ...] | None]:
    """The likeliest channels by quantity, and the names of the joints; None for those of the robot, in order."""
    candidates = [_of_robot(group, robot) for group in groups if group.quantity == "position" and group.measured]
    if not candidates:
        return {}, None
    fitting = [group for group in candidates if robot is None or len(group.columns) == robot.n] or candidates
    best = max(fitting, key=lambda group: group.rank)
    if others := [group for group in fitting if group is not best and group.rank == best.rank]:
        ask("position", f"Which are the measured positions of the joints: {_spans([best, *others], ' or ')}?")
    names = _joint_names(best, robot, ask)
    chosen = {"position": best}
    for quantity in ("velocity", "effort", "current", "temperature", "command"):
        beside = _beside(groups, quantity, best)
        if beside is not None and not (quantity == "current" and "effort" in chosen):
            chosen[quantity] = beside
    _ask_of_efforts(groups, chosen, ask)
    if wrenches := [group for group in groups if group.quantity == "wrench"]:
        chosen["wrench"] = wrench = max(wrenches, key=lambda group: group.rank)
        if len(wrenches) > 1:
            ask("wrench", f"Which is the wrench of the sensor: {_spans(wrenches, ' or ')}?")
        if not wrench.why and not wrench.unit:
            ask("wrench", f"Is the wrench {wrench.span} in N and Nm, in the frame of the sensor?")
    return chosen, names


def _spans(groups: Sequence[ChannelGroup], between: str) -> str:
    return between.join(group.span for group in groups[:_SHOWN])


def _plain(names: Iterable[str]) -> list[str]:
    return ["".join(character for character in name.lower() if character.isalnum()) for name in names]


def _of_robot(group: ChannelGroup, robot: Robot | None) -> ChannelGroup:
    """The group limited to the joints of a robot, in order, where it names all of them or counts from the base."""
    known = dict(zip(_plain(group.joints), group.joints, strict=True))
    if robot is None or len(known) < len(group.joints):
        return group
    if group.why == SAGE:
        return group.of(group.joints[: robot.n])
    wanted = _plain(robot.joint_names)
    return group.of([known[name] for name in wanted]) if set(wanted) <= set(known) else group


def _joint_names(group: ChannelGroup, robot: Robot | None, ask: Ask) -> tuple[str, ...] | None:
    numbers = all(not joint or joint.isdigit() for joint in group.joints)
    if robot is None:
        return None if numbers else group.joints
    known = dict(zip(_plain(robot.joint_names), robot.joint_names, strict=True))
    own = [known.get(joint, "") for joint in _plain(group.joints)]
    if all(own):
        return tuple(own)
    listed, names = listed_names(group.joints, MOST_NAMES), ", ".join(robot.joint_names)
    if len(group.joints) < robot.n:
        which = f"Which of the {robot.n} joints of {robot.name} ({names}) are the {len(group.joints)} of the recording"
        ask("", f"{which} ({listed})? Name them in this order (joints: [...])")
    elif len(group.joints) > robot.n:
        ask(
            "",
            f"Which of the {len(group.joints)} joints of the recording ({listed}) are those of {robot.name} ({names})? "
            "Give the columns of these only",
        )
    elif not numbers:
        ask("", f"Are the joints {listed} of the recording, in this order, {names} of {robot.name}?")
        return robot.joint_names
    return None


def _beside(groups: Sequence[ChannelGroup], quantity: str, position: ChannelGroup) -> ChannelGroup | None:
    """Group of a quantity of the same joints."""
    joints, words = set(position.joints), set(position.common)
    fitting = [g for g in groups if g.quantity == quantity and g.measured and joints <= set(g.joints)]
    if not fitting:
        return None
    nearest = max(fitting, key=lambda g: (g.stream == position.stream, len(words.intersection(g.common)), g.rank))
    return nearest.of(position.joints)


def _ask_of_efforts(groups: Sequence[ChannelGroup], chosen: dict[str, ChannelGroup], ask: Ask) -> None:
    """Ask about efforts and currents; choose the likeliest columns where no name says so."""
    edit = "edit effort, or make it current with a gain [Nm/A]"
    if (effort := chosen.get("effort")) is not None:
        if not effort.why and not effort.unit:
            kinds = "may be joint torques [Nm], motor torques [Nm] or motor currents [A]"
            if "%" in effort.span:
                kinds, edit = "are in % of a torque of each joint", "give a hundredth of it [Nm] as the gain of effort"
            ask("effort", f"The efforts ({effort.span}) {kinds}: the file does not say; {edit}")
        return
    if (current := chosen.get("current")) is not None:
        ask(
            "current",
            f"What is the gain of each motor current ({current.span}), joint torque per current [Nm/A]? The gain 1 "
            "stands for it",
        )
        return
    position = chosen["position"]
    used = {column for group in chosen.values() for column in group.names}
    others = [
        group
        for group in groups
        if not group.quantity and len(group.columns) == len(position.columns) and not used.intersection(group.names)
    ]
    if not others and "command" in chosen:  # what a position controller was told may stand for efforts
        return
    if not others:
        ask("effort", "The recording holds no efforts that were recognised: add effort or current, if it has any")
        return
    columns = dict(zip(position.joints, others[0].names, strict=True))
    chosen["effort"] = replace(others[0], quantity="effort", columns=columns, guessed=True)
    ask(
        "effort",
        f"Which columns are the efforts of the joints ({_spans(others, ', or ')}), and are they joint torques [Nm], "
        f"motor torques [Nm] or motor currents [A]? The file does not say; {edit}",
    )
