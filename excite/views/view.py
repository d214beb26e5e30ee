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


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Parameters
    ----------
    heading : str
        With the unit where all values have the same, such as ``at [s]``.
    format : Format
    brief : bool
        True for the few columns that a short summary shows.
    missing : str
        Stands for None and for what is not finite, such as ``never``; a dash if not given.
    """

    heading: str
    format: Format = Format.NUMBER
    brief: bool = False
    missing: str = ""


@dataclass(frozen=True)
class ViewTable:
    """A table of values.

    Parameters
    ----------
    name : str
        What programs find it by.
    title : str
    columns : tuple of Column, length c
    rows : tuple of tuple, each of length c
        Text, or numbers in SI units.
    folded : bool
        Whether a page shows it only when it is asked for, and a terminal not at all.
    """

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Any, ...], ...]
    folded: bool = False

    @property
    def brief(self) -> ViewTable:
        """The columns of a short summary."""
        kept = [k for k, column in enumerate(self.columns) if column.brief]
        columns = tuple(self.columns[k] for k in kept)
        return ViewTable(self.name, self.title, columns, tuple(tuple(row[k] for k in kept) for row in self.rows))


@dataclass(frozen=True)
class View:
    """Everything that is shown of a result.

    Parameters
    ----------
    title : str
    verdict : str
        In a sentence.
    holds : bool or None
        Whether what was asked holds; None where nothing was judged.
    summary : tuple of str
        The sentences with the numbers that matter most.
    against : tuple of str
        Reasons against the result.
    remarks : tuple of str
        What was assumed, what was not checked, and what does not affect the verdict.
    asked : tuple of (str, str)
        What was asked, as names and values.
    tables : tuple of ViewTable
    figures : mapping of str to callable
        What draws each figure, by its title; the order is that of `endings`.
    endings : tuple of str
        Of the stems of the figures' files.
    facts : mapping of str to str
        Provenance.
    """

    title: str
    verdict: str
    holds: bool | None = None
    summary: tuple[str, ...] = ()
    against: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    asked: tuple[tuple[str, str], ...] = ()
    tables: tuple[ViewTable, ...] = ()
    figures: Mapping[str, Callable[[], Any]] = field(default_factory=dict)
    endings: tuple[str, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
