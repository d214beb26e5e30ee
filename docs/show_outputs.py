"""Fill in what the commands on a page print, and the figures that they draw: ``python docs/show_outputs.py [PAGE...]``.

The commands of a page run in its order, in an empty folder. In the page

- ``<!-- prints: 8 to 3 -->`` before a ``console`` block: below each command stand the first 8 and the last 3 lines that
  it prints, or all where there are hardly more;
- ``<!-- draws: designs/arm/motion.png -->`` before an image: the image is a smaller copy of this file;
- ``<!-- file: NAME -->`` before any other block: the block is a file that the commands read;
- ``<!-- folder: example-robot-data -->``: the folder of robots of that package is there, as a link;
- ``# exit status 1`` behind a command: that is how it ends.

Without PAGE all pages with such marks are filled in. Commands of ``excite`` run, and scripts that the page shows; all
others are only shown. ``--keep DIR`` runs in DIR/PAGE and leaves everything there. The CPU time of every command is
printed: all of a page should take less than a minute.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
BLOCK = re.compile(
    r"(?:<!-- (?P<mark>file|prints): (?P<what>[^\n]+?) -->\n)?^```(?P<kind>\w*)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
DRAWING = re.compile(r"<!-- draws: (\S+) -->\n!\[[^\]]*\]\((\S+)\)")
ROBOTS = re.compile(r"^<!-- folder: example-robot-data -->$", re.MULTILINE)
COMMAND = re.compile(r"^(?P<printed>\$ (?:.*\\\n)*.*)\n(?P<below>(?:(?!\$ ).*\n)*)", re.MULTILINE)
STATUS = re.compile(r"#.* exit status (\d)")
WIDTH = 92  # of a terminal, as wide as a block on the site
PIXELS, COLOURS = 900, 64  # of a figure
PLACE = "cmeel.prefix/share/example-robot-data"


@dataclass(frozen=True)
class Command:
    """One command of a page: as printed, its words, the exit status that the page states, and the lines below it."""

    printed: str
    words: tuple[str, ...]
    status: int
    shown: tuple[str, ...]

    def runs(self, folder: Path) -> bool:
        """Whether it is run, not only shown: `excite`, and scripts that the page shows."""
        program, *rest = self.words
        return program == "excite" or (program in ("python", "sh") and (folder / rest[0]).is_file())


def commands(block: str) -> Iterator[Command]:
    """Commands of one console block, with what is shown below them."""
    for found in COMMAND.finditer(block):
        line = found["printed"].removeprefix("$ ").replace("\\\n", " ")
        status = STATUS.search(line)
        words, shown = shlex.split(line, comments=True), found["below"].splitlines()
        yield Command(found["printed"], tuple(words), int(status[1]) if status else 0, tuple(shown))


def write_files(text: str, folder: Path) -> None:
    """Write the files that a page shows, and link the folder of robots if it needs it."""
    for block in BLOCK.finditer(text):
        if block["mark"] == "file":
            (folder / block["what"]).write_text(block["text"], encoding="utf-8")
    if ROBOTS.search(text):
        (folder / "example-robot-data").symlink_to(str(distribution("example-robot-data").locate_file(PLACE)))


def run(command: Command, folder: Path) -> tuple[int, str]:
    """Exit status of a command, and what it prints; where it refuses its input, the messages without the progress."""
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    alone = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    ended = subprocess.run(
        command.words,
        cwd=folder,
        env={**os.environ, **alone, "PATH": programs, "COLUMNS": str(WIDTH)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    messages = [line for line in ended.stderr.splitlines() if not line.endswith(" ...")]
    return ended.returncode, ended.stdout if ended.returncode < 2 else "\n".join(messages)


def _seconds(times: os.times_result) -> float:
    return times.children_user + times.children_system


def excerpt(printed: str, first: int, last: int) -> list[str]:
    """First and last lines, wrapped as a terminal does."""
    lines = printed.strip().splitlines()
    if len(lines) > first + last + 3:
        lines = [*lines[:first], "...", *lines[len(lines) - last :]]
    return [part.rstrip() for line in lines for part in _wrapped(line)]


def _wrapped(line: str) -> list[str]:
    if len(line) <= WIDTH or line.lstrip()[:1] in "│┃┏┡└├╇━":
        return [line]
    return textwrap.wrap(line, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)


def filled(text: str, folder: Path) -> str:
    """Text of a page with what its commands print; they run in the folder."""
    write_files(text, folder)

    def played(block: re.Match[str]) -> str:
        if block["kind"] != "console":
            return block[0]
        first, last = map(int, block["what"].split(" to ")) if block["mark"] == "prints" else (0, 0)
        lines: list[str] = []
        for command in commands(block["text"]):
            lines.append(command.printed)
            if not command.runs(folder):
                continue
            before = os.times()
            status, printed = run(command, folder)
            print(f"{_seconds(os.times()) - _seconds(before):6.1f} s of CPU: {' '.join(command.words)}")
            if status != command.status:
                raise SystemExit(f"{command.printed}\nends with {status}, not {command.status}:\n{printed[-3000:]}")
            lines += excerpt(printed, first, last) if block["mark"] == "prints" else []
        head = block[0].partition("```")[0]
        return "\n".join([f"{head}```console", *lines, "```"])

    return BLOCK.sub(played, text)


def copy_figures(page: Path, text: str, folder: Path) -> None:
    """Write smaller copies of the figures that the commands have drawn."""
    for source, target in DRAWING.findall(text):
        figure = Image.open(folder / source).convert("RGB")
        figure.thumbnail((PIXELS, 2 * PIXELS), Image.Resampling.LANCZOS)
        out = page.parent / target
        out.parent.mkdir(exist_ok=True)
        beside = out.with_name(f".{out.name}")
        figure.quantize(COLOURS, dither=Image.Dither.NONE).save(beside, "PNG", optimize=True)
        beside.replace(out)


def pages() -> list[Path]:
    """Pages with marks."""
    marks = ("<!-- prints:", "<!-- draws:")
    every = (DOCS.parent / "README.md", *sorted(DOCS.rglob("*.md")))
    return [page for page in every if any(mark in page.read_text("utf-8") for mark in marks)]


def fill(page: Path, folder: Path) -> None:
    """Run the commands of a page in a folder, and write the page and its figures anew."""
    text = filled(page.read_text(encoding="utf-8"), folder)
    copy_figures(page, text, folder)
    beside = page.with_suffix(".tmp")
    beside.write_text(text, encoding="utf-8")
    beside.replace(page)


def main() -> None:
    """Fill in the pages that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=Path, nargs="*")
    parser.add_argument("--keep", type=Path, metavar="DIR")
    given = parser.parse_args()
    for page in given.page or pages():
        with tempfile.TemporaryDirectory() as empty:
            folder = given.keep / page.stem if given.keep else Path(empty)
            folder.mkdir(parents=True, exist_ok=True)
            fill(page.resolve(), folder)


if __name__ == "__main__":
    main()
