"""What a command prints beside its result, wherever that goes: a closed or broken stderr ends no work."""

from __future__ import annotations

import io
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

import click

from excite.cli.messages import in_options


def open_streams() -> None:
    """Let standard streams that are closed go nowhere; their numbers would be given to the next files."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        _write_what_is_known(getattr(sys, name))


def _write_what_is_known(stream: TextIO) -> None:
    """Let a stream write a question mark for characters that its encoding lacks, as those of consoles of Windows do."""
    if isinstance(stream, io.TextIOWrapper) and not (stream.encoding or "").lower().startswith("utf"):
        stream.reconfigure(errors="replace")


def say(text: str) -> None:
    """Print a line on stderr, where that is possible.

    Parameters
    ----------
    text : str
    """
    with suppress(OSError, ValueError):
        click.echo(text, err=True)


class _Lines(logging.Handler):
    """Prints warnings of the library as lines of the command."""

    def emit(self, record: logging.LogRecord) -> None:
        say(f"excite: {in_options(record.getMessage())}")


@contextmanager
def printed_warnings() -> Iterator[None]:
    """Print what the library logs in the block: warnings, and how long work will take."""
    logger, times, handler = logging.getLogger("excite"), logging.getLogger("excite.estimates"), _Lines(logging.INFO)
    before = times.level
    times.setLevel(logging.INFO)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        times.setLevel(before)
