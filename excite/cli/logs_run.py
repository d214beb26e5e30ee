"""Execution of ``excite logs``: what a recording of others holds, and the mapping that reads it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

import excite
from excite.cli.options import robot_file_of
from excite.cli.streams import tell
from excite.cli.summary import show
from excite.logs.guess.log_guess import LogGuess, write_mapping_file
from excite.logs.log import counted
from excite.storage.result_folder import check_free
from excite.views.view import View
from regressors.errors import listed_names, printable

_NAMED = 8  # columns
_STREAMS, _FACTS = 4, 5  # lines of the summary


def show_recording(file: Path, **given: Any) -> None:
    """Show what a recording holds, and write the mapping that reads it, where one is asked for."""
    written: Path | None = given["write_mapping"]
    if written is not None:
        check_free(written, replace=given["force"])
    tell(f"reading {file}")
    read = robot_file_of(given)
    robot = None if given["robot"] is None else excite.load_robot(given["robot"], read.pop("base_link", None), **read)
    guess = excite.guess_mapping(file, robot)
    if written is not None:
        write_mapping_file(guess, written, replace=given["force"])
    show(
        _view(guess),
        [] if written is None else [written],
        content=lambda: _content(guess, written),
        next_steps=[step] if (step := _next_step(guess, written)) else [],
        details=lambda: _print(guess, written),
    )


def _content(guess: LogGuess, written: Path | None) -> dict[str, Any]:
    mapping = None if guess.mapping is None else guess.mapping.model_dump(exclude_unset=True)
    return {
        "file": guess.contents.source,
        "format": guess.contents.format,
        "streams": [asdict(one) for one in guess.summaries],
        "notes": list(guess.contents.notes),
        "recognised": list(guess.recognised),
        "questions": list(guess.questions),
        "mapping": mapping,
        "written": None if written is None else str(written),
    }


def _view(guess: LogGuess) -> View:
    source, questions = guess.contents.source, len(guess.questions)
    open_ones = f"{source}: {counted(questions, 'question')} to answer before it can be used"
    streams = [f"{one.stream}: {_rate(one)}" for one in guess.summaries]
    return View(
        title=source,
        verdict=open_ones if questions else f"{source} can be used as it is: no question is left",
        holds=not questions,
        summary=(
            f"format: {guess.contents.format}",
            *streams[:_STREAMS],
            *([f"... and {len(streams) - _STREAMS} more streams"] if len(streams) > _STREAMS else []),
            *(f"recognised: {text}" for text in guess.recognised[:_FACTS]),
            *(f"question: {text}" for text in guess.questions[:_FACTS]),
        ),
        remarks=tuple(guess.contents.notes),
    )


def _next_step(guess: LogGuess, written: Path | None) -> str:
    if not guess.questions:
        return "give the file as LOG, without a mapping"
    if written is not None:
        return f"answer the questions in {written}, and give it as --mapping"
    return "" if guess.mapping is None else "--write-mapping MAP.yaml writes the mapping that reads it, to be corrected"


def _print(guess: LogGuess, written: Path | None) -> None:
    lines = [f"{guess.contents.source}: {guess.contents.format}"]
    for one in guess.summaries:
        lines.append(f"  {one.stream}: {_rate(one)}")
        lines.append(f"    {listed_names(one.columns, _NAMED)}")
    lines += [f"  note: {note}" for note in guess.contents.notes]
    lines += ["recognised:", *(f"  {text}" for text in guess.recognised)] if guess.recognised else []
    lines += ["questions:", *(f"  {text}" for text in guess.questions)] if guess.questions else []
    if step := _next_step(guess, written):
        lines.append(f"next: {step}")
    for line in lines:
        click.echo(printable(line))


def _rate(one: Any) -> str:
    if not one.clock:
        return f"{one.rows} rows, without a time that was recognised" if one.rows else "not read"
    gaps = f", {one.gaps} gap{'s' * (one.gaps != 1)} of up to {one.longest_gap:.3g} s" if one.gaps else ", no gaps"
    clock = f"column {one.clock}" if one.clock.isdecimal() else one.clock
    return f"{one.rows} rows at {one.rate:.5g} Hz over {one.duration:.6g} s by {clock}{gaps}"
