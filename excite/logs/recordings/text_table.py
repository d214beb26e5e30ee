"""Tables of numbers in text: CSV, with other separators, or columns of a fixed width; cells may be empty.

Of PlotJuggler (``__time``, and a column per signal that is empty where its topic has no message), of the clients of
Universal Robots' Real-Time Data Exchange (``timestamp actual_q_0 ...``), of libfranka's ``franka::logToCSV``
(``time, success_rate, state.q[0], ...``), and any other whose rows are numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from excite.logs.layout import Layout, listed
from excite.logs.recordings.recording import Contents, Recording, Stream, StreamContents
from excite.logs.recordings.recording_format import RecordingFormat
from excite.logs.recordings.text_layout import TextLayout, text_layout
from excite.logs.recordings.text_makers import maker_of
from excite.logs.table import sparse_table
from excite.logs.text import Text, text_of
from regressors.errors import InputError

TABLE = "table"  # the one stream
_KINDS = {None: "separated by white space", ",": "CSV", ";": "CSV with semicolons", "\t": "separated by tabs"}


class TextTable(RecordingFormat):
    """Tables of numbers in text."""

    name = "text"

    def recognises(self, head: bytes, path: Path) -> bool:
        """Whether it may be a text: it has no zero byte."""
        with suppress(UnicodeDecodeError):
            head[: max(1, len(head) - 4)].decode("utf-8")
            return bool(head) and b"\0" not in head
        return False

    def contents(self, path: Path) -> Contents:
        """Columns and number of rows."""
        with text_of(path) as text:
            layout = table_layout(text)
            maker = maker_of(layout.titles)
            titles = dict(zip(layout.names, layout.titles, strict=True))
            units = {name: unit for name, unit in zip(layout.names, layout.units, strict=True) if unit}
            clocks: tuple[str, ...] = ()
            meanings = {}
            if maker is not None and maker.clock in layout.names:
                clocks, units = (maker.clock,), {**units, maker.clock: maker.unit}
                meanings = maker.meanings(layout.names)
            rows = len(text.lines) - layout.first
            table = StreamContents(TABLE, layout.names, rows, clocks, meanings, units, titles)
            return Contents(text.source, kind_of(layout), (table,), text.mended)

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """Columns as numbers."""
        return _read(path, wanted, None)

    def glance(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """Columns of the first rows: text is slow to read, and the log is read next."""
        return _read(path, wanted, _GLANCED)

    def mapping_fields(self, path: Path) -> Mapping[str, object]:
        """Separator, header and lines before the table."""
        with text_of(path) as text:
            layout = table_layout(text)
        skip = layout.first if layout.header is None else layout.header
        separator = _SEPARATORS.get(layout.separator, layout.separator)
        return {"separator": separator, "header": layout.header is not None, "skip": skip}


def _read(path: Path, wanted: Mapping[str, Sequence[str]], most: int | None) -> Recording:
    with text_of(path) as text:
        found = table_layout(text)
        columns = dict.fromkeys(wanted.get(TABLE, ()))
        place = {name: found.names.index(name) for name in columns}
        used = tuple(sorted(place.values()))
        layout = _Columns(found.separator, found.first, found.titles_or_names, used)
        rows = len(text.lines) - found.first
        only = None if most is None or rows <= most else (1, most)
        table = sparse_table(text, layout, frozenset({"truncated"}), only)
        values = {name: table.values[:, used.index(k)] for name, k in place.items()}
        notes = (*text.mended, *table.left_out)
        return Recording(text.source, kind_of(found), {TABLE: Stream(TABLE, values)}, notes)


_GLANCED = 50_000  # rows
_SEPARATORS: Mapping[str | None, str] = {None: "whitespace", "\t": "tab"}


class _Columns(Layout):
    """Layout of which nothing but the columns is known."""

    def __init__(self, separator: str | None, first: int, names: tuple[str, ...], used: tuple[int, ...]) -> None:
        super().__init__(separator, first, names, used[0] if used else 0, 1.0, (), {})
        object.__setattr__(self, "_used", used)

    @property
    def used(self) -> tuple[int, ...]:
        """Columns that are read."""
        return self.__dict__["_used"] or (0,)


def table_layout(text: Text) -> TextLayout:
    """Layout of the table in a text."""
    layout = text_layout(text.lines)
    if layout is None:
        shown = listed(list(text.lines[:2]))
        raise InputError(f"{text.source} holds no table of numbers; it begins with {shown}")
    return layout


def kind_of(layout: TextLayout) -> str:
    """Name of the format, by the names of the columns."""
    kind = _KINDS[layout.separator]
    maker = maker_of(layout.titles)
    return f"text, {kind}" if maker is None else f"{maker.name}, {kind}"
