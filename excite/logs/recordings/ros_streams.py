"""Streams of columns from the messages of a bag: decoded together where they share a layout, not one by one.

A bag is read twice: once to find topics and layouts, whose result is kept, and once for the columns that are wanted.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.bag_records import BagReader, Message, Topic
from excite.logs.recordings.recording import (
    Contents,
    Meaning,
    Numbers,
    Recording,
    Stream,
    StreamContents,
    Wanted,
    check_table,
    check_wanted,
)
from excite.logs.recordings.ros_decoding import (
    MESSAGE_TIME,
    STAMP,
    TEMPERATURE,
    Definitions,
    MessageLayout,
    NumberPlace,
    RosColumn,
    UnreadableMessage,
    definitions_of,
    layout_columns,
    message_layout,
)
from regressors.errors import InputError, cut
from regressors.samples import Index

Bytes: TypeAlias = NDArray[np.uint8]
LARGEST_MESSAGE = 64 * 1024  # bytes; what is larger, such as an image, is no measurement of joints
_AT_ONCE = 4096  # messages
_BYTES_AT_ONCE = 8 * 2**20
_MOST_LAYOUTS, _MOST_SHAPES, _MOST_FAULTS = 6000, 200, 100  # 7 joints have 5040 orders
_LEFT_OUT_SHOWN = 8


def bag_contents(messages: BagReader, path: Path, state: Hashable, form: str) -> Contents:
    """Contents of a bag; all of it is read once, but no number is decoded."""
    topics, notes = _scan_of(messages, path, state)
    streams = tuple(_stream_contents(rows.topic, *one) for rows in topics.values() for one in rows.streams().items())
    left_out = {topic.name: rows.unread for topic, rows in topics.items() if rows.unread}
    shown = [(cut(name), why) for name, why in list(left_out.items())[:_LEFT_OUT_SHOWN]]
    if not streams:
        why = "".join(f"; {name}: {why}" for name, why in shown)
        raise InputError(f"{path}: no topic has messages with numbers{why}")
    left = (f"topic {name} is left out: {why}" for name, why in shown)
    return Contents(str(path), form, streams, (*notes, *left))


def _stream_contents(topic: Topic, name: str, layouts: list[_Known]) -> StreamContents:
    columns = {name: column for one in layouts for name, column in one.columns.items()}
    stamp, time = f"{topic.name}/{STAMP}", f"{topic.name}/{MESSAGE_TIME}"
    units = {name: "ns" for name, (place, _, _) in columns.items() if place.kind == "stamp"}
    units |= {name: "degC" for name in columns if topic.kind == TEMPERATURE and name.endswith("/temperature")}
    meanings: dict[str, Meaning] = {name: meaning for name, (_, _, meaning) in columns.items() if meaning is not None}
    clocks = (stamp, time) if stamp in columns else (time,)
    rows = sum(one.rows for one in layouts)
    return StreamContents(name, (*columns, time), rows, clocks, meanings, units | {time: "ns"})


def bag_columns(messages: BagReader, path: Path, state: Hashable, form: str, wanted: Wanted) -> Recording:
    """Columns of a bag, by the names of their streams."""
    topics, notes = _scan_of(messages, path, state)
    check_wanted(path, dict.fromkeys(wanted, ()), {name: () for rows in topics.values() for name in rows.streams()})
    tables: dict[str, _Table] = {}
    by_topic: dict[Topic, dict[_Known, _Table]] = {}
    for topic, rows in topics.items():
        for name, layouts in rows.streams().items():
            if name in wanted:
                check_table(path, sum(one.rows for one in layouts), len(wanted[name]))
                tables[name] = table = _Table(topic, wanted[name], layouts)
                rows.faulty = 0
                by_topic.setdefault(topic, {}).update(dict.fromkeys(layouts, table))
    for topic, times, raws in _batches(messages(path, by_topic.__contains__, [])):
        groups: dict[_Table, list[_Group]] = {}
        for group in topics[topic].groups(raws):
            if (filled := by_topic[topic].get(group[0])) is not None:
                groups.setdefault(filled, []).append(group)
        for table, several in groups.items():
            table.add(several, np.array(times, dtype=np.int64))
    streams = {name: Stream(name, table.columns) for name, table in tables.items()}
    return Recording(str(path), form, streams, notes)


class _Table:
    """Columns of a stream, filled in the order of the messages; NaN where a message has no number."""

    def __init__(self, topic: Topic, names: Sequence[str], layouts: list[_Known]) -> None:
        self.rows, self.filled = sum(one.rows for one in layouts), 0
        self.time = f"{topic.name}/{MESSAGE_TIME}"
        stamps = [{name for name, (place, _, _) in one.columns.items() if place.kind == "stamp"} for one in layouts]
        whole = set.intersection(*stamps) | {self.time}
        self.columns: dict[str, Numbers] = {
            name: np.zeros(self.rows, np.int64) if name in whole else np.full(self.rows, np.nan) for name in names
        }

    def add(self, groups: list[_Group], times: NDArray[np.int64]) -> None:
        """Append messages, each group of them of one layout."""
        order = np.sort(np.concatenate([numbers for _, numbers, _ in groups]))
        if self.time in self.columns:
            self.columns[self.time][self.filled : self.filled + order.size] = times[order]
        for one, numbers, content in groups:
            rows = self.filled + np.searchsorted(order, numbers)
            blocks: dict[int, Numbers] = {}
            for name, (place, index, _) in one.columns.items():
                if name in self.columns:
                    if place.at not in blocks:
                        blocks[place.at] = _numbers(content, place, one.layout.order)
                    self.columns[name][rows] = blocks[place.at][:, index]
        self.filled += order.size


def _numbers(content: Bytes, place: NumberPlace, order: str) -> Numbers:
    """Numbers at one place of many messages, shape (messages, count)."""
    if place.kind == "stamp":
        fields = content[:, place.at : place.at + 8].copy()
        seconds = fields[:, :4].copy().view(f"{order}i4").astype(np.int64)
        return np.asarray(1_000_000_000 * seconds + fields[:, 4:].copy().view(f"{order}u4"))
    size = int(place.kind[-1]) * place.count
    return np.asarray(content[:, place.at : place.at + size].copy().view(place.kind), dtype=float)


@lru_cache(maxsize=4)
def _scan_of(messages: BagReader, path: Path, state: Hashable) -> tuple[Mapping[Topic, _TopicRows], tuple[str, ...]]:
    """Topics of a bag with all their layouts, and notes; contents and columns are usually asked for in turn."""
    topics, notes = dict[Topic, _TopicRows](), list[str]()

    def wanted(topic: Topic) -> bool:
        topics.setdefault(topic, _TopicRows(path, topic, topic.unread))
        return not topic.unread

    for topic, _, raws in _batches(messages(path, wanted, notes)):
        rows = topics[topic]
        with suppress(UnreadableMessage):  # which the topic then is as a whole
            for one, numbers, _ in [] if rows.unread else rows.groups(raws):
                one.rows += numbers.size
            rows.met += len(raws)
    for rows in topics.values():
        if not rows.unread and not rows.streams():
            rows.unread = f"its messages ({cut(rows.topic.kind)}) have no numbers"
    faulty = [
        f"{rows.faulty} messages of {cut(topic.name)} do not follow its definition and were left out"
        for topic, rows in topics.items()
        if rows.faulty and not rows.unread
    ]
    return topics, (*notes, *faulty)


def _batches(messages: Iterator[Message]) -> Iterator[_Batch]:
    """Messages of each topic, some thousand at once."""
    held: dict[int, _Batch] = {}  # by the identity of the topic, which is quicker than its hash
    waiting = 0
    for topic, time, raw in messages:
        _, times, raws = held.get(id(topic)) or held.setdefault(id(topic), (topic, [], []))
        times.append(time)
        raws.append(raw)
        waiting += len(raw)
        if len(raws) >= _AT_ONCE or waiting > _BYTES_AT_ONCE:
            yield from held.values()
            held, waiting = {}, 0
    yield from held.values()


@dataclass(eq=False)
class _Known:
    """A layout that some messages of a topic have; the first of them is number ``first``."""

    layout: MessageLayout
    columns: dict[str, RosColumn]
    first: int
    rows: int = 0

    @property
    def has_numbers(self) -> bool:
        return any(place.kind != "stamp" for place, _, _ in self.columns.values())


# Layouts whose structural bytes are at the same positions, by these bytes; they differ by names or lengths
_Alike: TypeAlias = tuple[NDArray[np.intp], dict[bytes, _Known]]
_Group: TypeAlias = tuple[_Known, Index, Bytes]  # messages of one layout: their numbers, and their bytes
_Batch: TypeAlias = tuple[Topic, list[int], list[bytes]]


@dataclass(eq=False)
class _TopicRows:
    """All layouts of the messages of one topic that were met so far."""

    path: Path
    topic: Topic
    unread: str = ""
    met: int = 0
    faulty: int = 0
    count: int = 0
    known: dict[int, list[_Alike]] = field(default_factory=dict)
    definitions: Definitions | None = None

    def groups(self, raws: list[bytes]) -> Iterator[_Group]:
        """Messages of equal layout: the layout, their numbers among those given, and their bytes."""
        lengths = np.fromiter(map(len, raws), dtype=np.intp, count=len(raws))
        for length in np.unique(lengths).tolist():
            rows = np.flatnonzero(lengths == length)
            if length > LARGEST_MESSAGE:
                raise self._given_up(f"it has messages of {length} bytes, more than measurements of joints need")
            content = b"".join(raws) if len(rows) == len(raws) else b"".join(raws[k] for k in rows.tolist())
            yield from self._of_equal_length(np.frombuffer(content, np.uint8).reshape(len(rows), length), rows)

    def _of_equal_length(self, content: Bytes, rows: Index) -> Iterator[_Group]:
        known = self.known.setdefault(content.shape[1], [])
        left = np.arange(rows.size)
        for alike in known:
            taken = np.zeros(rows.size, dtype=bool)
            for one, some in _by_layout(alike, content, left):
                yield (one, rows, content) if some.size == rows.size else (one, rows[some], content[some])
                taken[some] = True
            left = left[~taken[left]]
            if not left.size:
                return
        found = [(self._found_or_new(known, content[k], self.met + int(rows[k])), k) for k in left.tolist()]
        for one, several in _grouped(found):
            yield one, rows[several], content[several]

    def _found_or_new(self, known: list[_Alike], message: Bytes, number: int) -> _Known | None:
        """Layout of one message; None where it does not follow its definition."""
        for fixed, layouts in known:
            if (met := layouts.get(message[fixed].tobytes())) is not None:
                return met
        try:
            layout = self._layout(message.tobytes())
        except UnreadableMessage as error:
            if self.unread:
                raise
            self.faulty += 1
            if self.faulty > _MOST_FAULTS:
                why = f"more than {_MOST_FAULTS} messages do not follow its definition: {error}"
                raise self._given_up(why) from error
            return None
        fixed = layout.fixed
        one = _Known(layout, layout_columns(self.topic.name, self.topic.kind, layout), number)
        alike = next((layouts for each, layouts in known if np.array_equal(each, fixed)), None)
        if alike is None:
            known.append((fixed, alike := {}))
        if self.count >= _MOST_LAYOUTS or sum(map(len, self.known.values())) > _MOST_SHAPES:
            raise self._given_up(f"its messages have more than {self.count} different layouts")
        alike[message[fixed].tobytes()] = one
        self.count += 1
        return one

    def _layout(self, raw: bytes) -> MessageLayout:
        topic = self.topic
        if self.definitions is not None:
            return message_layout(raw, topic.kind, self.definitions, topic.ros1)
        why = f"its type {cut(topic.kind)} is not defined in the bag"
        for definitions in definitions_of(self.path, topic.kind, topic.form, topic.text, topic.ros1):
            try:
                layout = message_layout(raw, topic.kind, definitions, topic.ros1)
            except UnreadableMessage as error:
                why = f"its messages do not follow the definition of {cut(topic.kind)}: {error}"
            else:
                self.definitions = definitions
                return layout
        raise self._given_up(why)

    def _given_up(self, why: str) -> UnreadableMessage:
        """Read no message of the topic."""
        self.unread = why
        return UnreadableMessage(why)

    def streams(self) -> dict[str, list[_Known]]:
        """Layouts of each stream: messages that share a joint, directly or through others, are of one stream."""
        groups: list[tuple[set[str], list[_Known]]] = []
        if self.unread:
            return {}
        met = (one for several in self.known.values() for _, layouts in several for one in layouts.values())
        for one in (one for one in met if one.layout.names or one.has_numbers):
            joints, layouts = set(one.layout.names or ("",)), [one]  # by which it is put into a stream
            for group in [group for group in groups if group[0] & joints]:
                groups.remove(group)
                joints |= group[0]
                group[1].extend(layouts)
                layouts = group[1]
            groups.append((joints, layouts))
        groups = [group for group in groups if any(one.has_numbers for one in group[1])]
        groups.sort(key=lambda group: min(one.first for one in group[1]))
        name = self.topic.name
        return {name if k == 0 else f"{name}#{k + 1}": layouts for k, (_, layouts) in enumerate(groups)}


def _by_layout(alike: _Alike, content: Bytes, rows: Index) -> Iterator[tuple[_Known, Index]]:
    """Messages of known layouts: which of the given rows have which."""
    places, layouts = alike
    fixed = content[:, places] if rows.size == len(content) else content[np.ix_(rows, places)]
    if (one := layouts.get(fixed[0].tobytes())) is not None and (fixed == fixed[0]).all():
        yield one, rows
        return
    raw, width = fixed.tobytes(), places.size
    keys = (raw[k * width : (k + 1) * width] for k in range(rows.size))
    yield from _grouped(zip(map(layouts.get, keys), rows.tolist(), strict=True))


def _grouped(found: Iterable[tuple[_Known | None, int]]) -> Iterator[tuple[_Known, Index]]:
    """Rows of each layout; those without one are left out."""
    groups: dict[_Known, list[int]] = {}
    for one, row in found:
        if one is not None:
            groups.setdefault(one, []).append(row)
    for one, several in groups.items():
        yield one, np.array(several)
