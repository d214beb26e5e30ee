"""A view of a result: a verdict, sentences, tables of values with their units, and figures, in no form yet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any


class Format(Enum):
    """How the values of a column are written."""

    TEXT = "text"
    UNIT = "unit"  # of the numbers beside it
    NUMBER = "number"
    PERCENT = "percent"  # of a fraction
    KEPT = "kept"  # whether a limit holds


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    heading: str  # with the unit where all values have the same, such as ``at [s]``
    format: Format = Format.NUMBER
    brief: bool = False  # True for the few columns that a short summary shows
    wide: bool = False  # True for a column of long texts, which only a page has room for
    missing: str = ""  # stands for None and for what is not finite, such as ``never``; a dash if not given
    digits: int = 3  # significant digits of its numbers in a short summary


@dataclass(frozen=True)
class ViewTable:
    """A table of values."""

    name: str  # what programs find it by
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Any, ...], ...]  # text, or numbers in SI units
    folded: bool = False  # whether a page shows it only when it is asked for, and a terminal not at all
    note: str = ""  # stands below it
    marked: frozenset[tuple[int, int]] = frozenset()  # row and column of the values that a reader should see

    @property
    def brief(self) -> ViewTable:
        """The columns of a short summary."""
        kept = [k for k, column in enumerate(self.columns) if column.brief]
        columns = tuple(self.columns[k] for k in kept)
        return ViewTable(self.name, self.title, columns, tuple(tuple(row[k] for k in kept) for row in self.rows))


@dataclass(frozen=True)
class View:
    """Everything that is shown of a result."""

    title: str
    verdict: str  # in a sentence
    holds: bool | None = None  # whether what was asked holds; None where nothing was judged
    summary: tuple[str, ...] = ()  # the sentences with the numbers that matter most
    against: tuple[str, ...] = ()  # reasons against the result
    remarks: tuple[str, ...] = ()  # what was assumed, what was not checked, and what does not affect the verdict
    asked: tuple[tuple[str, str], ...] = ()  # what was asked, as names and values
    tables: tuple[ViewTable, ...] = ()
    # what draws each figure, by its title; the order is that of `endings`
    figures: Mapping[str, Callable[[], Any]] = field(default_factory=dict)
    endings: tuple[str, ...] = ()  # of the stems of the figures' files
    facts: Mapping[str, str] = field(default_factory=dict)  # provenance
