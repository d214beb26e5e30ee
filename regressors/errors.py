"""Errors that a caller can act on, text of others in their messages, and what readers notice without an error."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal


class ExciteError(Exception):
    """Root of all errors of this project."""


class InputError(ExciteError, ValueError):
    """Input that cannot be used; the message is one line that says what to change.

    Options appear by their Python names, in backticks; the command line replaces them by its own option names.
    """


class NumericalError(ExciteError, ArithmeticError):
    """Numbers with which a computation cannot go on: the message says which work failed, and the likely cause."""


class TakenError(InputError):
    """The destination of a write exists already."""

    def __init__(self, what: str, another: str = "`folder`") -> None:
        super().__init__(f"{what}; `replace` replaces it, or choose another {another}")


class TooLargeError(InputError):
    """The work would take more memory than it may; the message says what to change, and how far."""


@contextmanager
def reading(what: str) -> Iterator[None]:
    """Turn what reading a file raises in the block into `InputError`."""
    try:
        yield
    except UnicodeDecodeError as error:
        raise InputError(f"cannot read {what}: not a text file in UTF-8 (byte {error.start + 1})") from error
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {what}: {getattr(error, 'strerror', None) or error}") from error


@contextmanager
def about(what: str) -> Iterator[None]:
    """Begin the message of an `InputError` in the block with what it is about."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{what}: {error}") from error


LIKE = 0.7  # likeness of names that may be meant


class UnknownName(InputError):
    """A name that does not exist where it was looked up."""

    def __init__(self, what: str, given: str, available: Iterable[str], near: Sequence[str] | None = None) -> None:
        names = tuple(available)
        near = difflib.get_close_matches(given, names, 2, LIKE) if near is None else near
        meant = f"did you mean {' or '.join(map(shortened, near))}? " if near else ""
        super().__init__(f"no {what} named {shortened(given)}; {meant}available: {listed_names(names)}")


def check_names(what: str, names: Iterable[str], known: Collection[str]) -> None:
    """Raise `UnknownName` for the first name that is not known."""
    for name in names:
        if name not in known:
            raise UnknownName(what, name, known)


LONGEST = 60  # characters of one quoted thing
LONGEST_LINE = 500  # characters of a whole message
LONGEST_NAME = 200  # characters of a joint, a link or another part of a robot
_TAIL = 120  # characters of its end, where the remedy is
_LISTED = 30  # names of a list


def printable(text: str) -> str:
    r"""Text whose control characters, directions of writing and lone surrogates are escaped, ``\x1b`` for ESC."""
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def cut(text: str, most: int = LONGEST) -> str:
    """Printable text of at most ``most`` characters; the middle of a longer one is an ellipsis."""
    text = printable(text if len(text) <= 2 * most else f"{text[:most]}{text[-most:]}")
    return text if len(text) <= most else f"{text[: most - 8]}...{text[-5:]}"


def shortened(value: object) -> str:
    """``repr`` of a value, its middle left out where it is long."""
    try:
        long = isinstance(value, str) and len(value) > 4 * LONGEST
        text = repr(value[: 2 * LONGEST] + value[-LONGEST:] if long else value)  # type: ignore[index]
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a very long number"
    return cut(text)


def long_name(name: str) -> str | None:
    """What is wrong with a name that would fill a table or a figure, as a clause; None if nothing."""
    if len(name) <= LONGEST_NAME:
        return None
    return f"a name has at most {LONGEST_NAME} characters, given {len(name)}: {shortened(name)}"


def one_line(message: str) -> str:
    """A message as one printable line of at most `LONGEST_LINE` characters; its end, with the remedy, is kept."""
    line = printable(" ".join(message.split()))
    if len(line) <= LONGEST_LINE:
        return line
    return f"{line[: LONGEST_LINE - _TAIL - 5]} ... {line[-_TAIL:]}"


def listed_names(names: Iterable[str], most: int = _LISTED) -> str:
    """Names separated by commas, each cut, the last of many only counted; ``none`` if there are none."""
    names = list(names)
    more = len(names) - most
    return ", ".join(map(cut, names[:most])) + (f" and {more} more" if more > 0 else "") if names else "none"


_MOST_SHARE = 10.0


def percent(share: float, digits: int = 2) -> str:
    """A share in percent: ``> 1000 %`` beyond ten times, and ``an unknown share`` where it is not a number."""
    if math.isnan(share):
        return "an unknown share"
    return f"> {100 * _MOST_SHARE:g} %" if share > _MOST_SHARE else f"{float(f'{100 * share:.{digits}g}'):g} %"


@dataclass(frozen=True)
class Finding:
    """One line of a health report."""

    # read as it stands; taken for granted, since the file does not say; changed to the exact value; not in the file;
    # in the file, but hardly right
    kind: Literal["found", "assumed", "snapped", "missing", "suspicious"]
    where: str  # link, joint or file
    what: str  # what was noticed, in words
    advice: str = ""  # what to do about it; empty where nothing is to be done
    joint: str = ""  # name of the joint that is not continuous, but whose range is not stated

    def __str__(self) -> str:
        """Whole sentence for notes and messages."""
        return f"{self.where}: {self.what}" + (f"; {self.advice}" if self.advice else "")
