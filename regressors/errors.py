"""Errors that a caller can act on: bad input, with what was given, what was expected and what is available."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from regressors.quoting import listed_names, shortened


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

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}; `replace` replaces it, or choose another `folder`")


class TooLargeError(InputError):
    """The work would take more memory than it may; the message says what to change, and how far."""


class UnknownName(InputError):
    """A name that does not exist where it was looked up."""

    def __init__(self, what: str, given: str, available: Iterable[str], near: Sequence[str] = ()) -> None:
        meant = f"did you mean {' or '.join(map(shortened, near))}? " if near else ""
        super().__init__(f"no {what} named {shortened(given)}; {meant}available: {listed_names(available)}")
