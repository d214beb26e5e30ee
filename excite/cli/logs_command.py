"""``excite logs``: what a recording holds, and the mapping that reads it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import excite
from excite.cli.command import Command
from excite.cli.option_types import RobotName
from excite.cli.options import robot_file_of, robot_file_options
from excite.cli.sign_of_life import tell
from excite.cli.summary import Summary, show
from regressors.errors import printable

if TYPE_CHECKING:
    from excite.logs.guess.log_guess import LogGuess

_NAMED = 8  # columns
_STREAMS, _FACTS = 4, 5  # lines of the summary

_GROUPS = {"Robot": ("robot",), "Output": ("write_mapping",)}


@click.command(
    cls=Command,
    groups=_GROUPS,
    name="logs",
    epilog="""\b
Examples:
  excite logs run.mcap
  excite logs recording.csv --robot ur10e --write-mapping ur10e.yaml
  excite identify ur10e recording.csv --mapping ur10e.yaml --out results/ur10e

\b
Formats are recognised by their content: MCAP and rosbag2, Parquet (LeRobot), NPZ, HDF5, MATLAB, folders with one file
per signal, and tables in text, among them those of PlotJuggler, RTDE clients of Universal Robots and libfranka.

\b
Units that the recording does not state follow from the ratio of the velocities to the rate of change of the positions,
and from ranges. Each is stated, certain, or likely; what is not certain is asked. The mapping holds the likeliest
answers, with the questions as comments: correct it before you use it.""",
)
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE")
@click.option(
    "--robot", type=RobotName(), metavar="ROBOT", help="Robot that moved, for the names and the ranges of its joints."
)
@robot_file_options("--base")
@click.option(
    "--write-mapping", type=click.Path(path_type=Path), metavar="MAP.yaml", help="Mapping to write, for --mapping."
)
@click.option("--force", is_flag=True, help="Replace a mapping that is already there.")
def command(
    file: Path,
    robot: str | None,
    write_mapping: Path | None,
    force: bool,
    **given: Any,
) -> None:
    """Show what FILE holds, what was recognised, and what it does not say; write the mapping that reads it.

    FILE is a recording of any known format, or a folder of one.
    """
    from excite.logs.guess.log_guess import check_mapping_free, write_mapping_file

    if write_mapping is not None:
        check_mapping_free(write_mapping, replace=force)
    tell(f"reading {file}")
    read = robot_file_of(given)
    moved = None if robot is None else excite.load_robot(robot, read.pop("base_link"), **read)
    guess = excite.guess_mapping(file, moved)
    if write_mapping is not None:
        write_mapping_file(guess, write_mapping, replace=force)
    show(_summary(guess, write_mapping), lambda: _content(guess, write_mapping), lambda: _print(guess, write_mapping))


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


def _summary(guess: LogGuess, written: Path | None) -> Summary:
    source, questions = guess.contents.source, len(guess.questions)
    if questions:
        verdict = f"{source}: {questions} question{'s' * (questions > 1)} to answer before it can be used"
    else:
        verdict = f"{source} can be used as it is: no question is left"
    streams = [f"{one.stream}: {_rate(one)}" for one in guess.summaries]
    return Summary(
        verdict=verdict,
        holds=not questions,
        facts=[
            f"format: {guess.contents.format}",
            *streams[:_STREAMS],
            *([f"... and {len(streams) - _STREAMS} more streams"] if len(streams) > _STREAMS else []),
            *(f"recognised: {text}" for text in guess.recognised[:_FACTS]),
            *(f"question: {text}" for text in guess.questions[:_FACTS]),
        ],
        notes=guess.contents.notes,
        files=[] if written is None else [written],
        next_steps=[_next_step(guess, written)] if _next_step(guess, written) else [],
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
        more = f" and {len(one.columns) - _NAMED} more" if len(one.columns) > _NAMED else ""
        lines.append(f"    {', '.join(one.columns[:_NAMED])}{more}")
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
