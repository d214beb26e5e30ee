"""A console that prints text of others as text: nothing in it is an instruction to the terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from excite.cli.terminal import has_colours


class LiteralConsole(Console):
    """Console whose text has a replacement character for every control character but line ends."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render as a `Console` does, literally."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.replace("\n", "").isprintable():
                yield segment
            else:
                yield Segment("".join(map(_literal, segment.text)), segment.style)


def _literal(character: str) -> str:
    return character if character.isprintable() or character == "\n" else "\N{REPLACEMENT CHARACTER}"


def console() -> LiteralConsole:
    """Console on stdout that prints names literally, brackets included, and does not wrap tables when piped."""
    width = None if sys.stdout.isatty() else 120
    if not has_colours(sys.stdout):
        return LiteralConsole(markup=False, highlight=False, color_system=None, width=width)
    return LiteralConsole(markup=False, highlight=False, force_terminal=True, width=width)


def console_of_progress() -> Console:
    """Console on stderr, a terminal, for a bar that moves."""
    return Console(stderr=True, color_system="auto" if has_colours(sys.stderr) else None)
