"""Messages in a database of rosbag2 (``.db3``).

Source: rosbag2_storage_sqlite3, schema versions 1 to 4: tables ``topics``, ``messages`` and, since version 4,
``message_definitions``.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing

from excite.logs.recordings.ros_definitions import full_name
from excite.logs.recordings.ros_messages import BagFile, Messages, Topic
from regressors.errors import InputError
from regressors.input_files import LOG, opened
from regressors.memory_cap import memory_cap
from regressors.quoting import cut, one_line

SQLITE = b"SQLite format 3\0"
_FORMS = {"ros2msg": "msg", "ros2idl": "idl"}
_AT_ONCE = 4096  # rows
_LONGEST = 2**31 - 1  # bytes of a value, SQLite's own limit


class SqliteBag(BagFile):
    """A database of rosbag2."""

    def messages(self, wanted: Callable[[Topic], bool]) -> Iterator[Messages]:
        """See `BagFile.messages`."""
        self.notes = []
        try:
            with opened(self.path, LOG) as stream:  # not a device or a pipe
                stream.read(1)
            with closing(self._connection()) as base:
                yield from self._rows(base, wanted)
        except OSError as error:
            raise InputError(f"cannot read {self.path}: {error.strerror}") from error
        except InputError:
            raise
        except (sqlite3.Error, ValueError, OverflowError) as error:
            raise InputError(f"{self.path}: the database is damaged: {cut(one_line(str(error)))}") from error

    def _connection(self) -> sqlite3.Connection:
        base = sqlite3.connect(f"{self.path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)
        base.text_factory = lambda text: text.decode("utf-8", "replace")
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, int(min(memory_cap(), _LONGEST)))
        base.execute("PRAGMA trusted_schema=OFF")
        base.execute("PRAGMA cell_size_check=ON")
        return base

    def _rows(self, base: sqlite3.Connection, wanted: Callable[[Topic], bool]) -> Iterator[Messages]:
        topics = {number: topic for number, topic in self._topics(base).items() if wanted(topic)}
        self._note_journal()
        if not topics:
            return
        numbers = ",".join(map(str, topics))
        rows = base.execute(f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({numbers}) ORDER BY id")
        count = 0
        try:
            while some := rows.fetchmany(_AT_ONCE):
                count += len(some)
                yield from self._by_topic(some, topics)
        except sqlite3.DatabaseError:
            if not count:
                raise
            self.notes.append(f"the database {self.path.name} is damaged; the {count} messages before were read")

    def _by_topic(self, rows: list[tuple[int, int, bytes]], topics: Mapping[int, Topic]) -> Iterator[Messages]:
        for number, topic in topics.items():
            times = [time for of, time, _ in rows if of == number]
            raws = [raw for of, _, raw in rows if of == number]
            if not all(isinstance(time, int) for time in times) or not all(isinstance(raw, bytes) for raw in raws):
                raise InputError(f"{self.path}: a message of {cut(topic.name)} is no row of bytes")
            if times:
                yield Messages(topic, times, raws)

    def _topics(self, base: sqlite3.Connection) -> dict[int, Topic]:
        self._check_tables(base)
        columns = {row[1] for row in base.execute("PRAGMA table_info(message_definitions)")}
        texts: dict[str, tuple[str, str]] = {}
        if {"topic_type", "encoding", "encoded_message_definition"} <= columns:
            own = base.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
            texts = {str(kind): (str(form), str(text)) for kind, form, text in own}
        topics = {}
        for number, name, kind, encoding in base.execute("SELECT id, name, type, serialization_format FROM topics"):
            form, text = texts.get(str(kind), ("", ""))
            form = _FORMS.get(form, "") if text else ""
            unread = "" if encoding == "cdr" else f"its messages are encoded as {cut(str(encoding))}, not as CDR"
            topics[int(number)] = Topic(str(name), full_name(str(kind)), form, text if form else "", unread=unread)
        return topics

    def _check_tables(self, base: sqlite3.Connection) -> None:
        """Refuse what is no bag; views and virtual tables of a database could compute for ever."""
        made = {str(name): str(text) for name, text in base.execute("SELECT name, sql FROM sqlite_master")}
        for name in ("topics", "messages"):
            if name not in made:
                raise InputError(f"{self.path}: a database without the table {name!r} is no bag of rosbag2")
        for name in made.keys() & {"topics", "messages", "message_definitions"}:
            if not made[name].upper().startswith("CREATE TABLE"):
                raise InputError(f"{self.path}: {name!r} is no plain table; this is no bag of rosbag2")

    def _note_journal(self) -> None:
        journal = self.path.with_name(f"{self.path.name}-wal")
        if journal.is_file() and journal.stat().st_size:
            self.notes.append(
                f"messages that are still in {journal.name} were not read; `sqlite3 {self.path.name} .tables` puts "
                "them into the bag"
            )
